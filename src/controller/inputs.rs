//! The inputs and what decodes them.

use super::hardware::{CaptureTimer, Edge};
use crate::capture::{Decoder, Faults, InputReading, Level, Listening, Timing};
use crate::link::MotorFaults;
use crate::settings::MOTORS;

/// A capturing timer and a decoder for each input. The capture interrupt and the control task share it.
pub struct Inputs<T> {
    timer: T,
    /// `None` where the inputs have frames of DShot, which the control task takes.
    decoders: Option<[Decoder; MOTORS]>,
    /// Which edges of each input interrupt.
    listening: [Listening; MOTORS],
    /// Whether those of an input do not all.
    is_any_restricted: bool,
}

impl<T: CaptureTimer> Inputs<T> {
    /// With decoders that know nothing of their lines yet.
    pub fn new(timer: T, timing: Option<Timing>) -> Self {
        let decoders = timing.map(decoders::<T>);
        Self { timer, decoders, listening: [Listening::All; MOTORS], is_any_restricted: false }
    }

    /// The capture interrupt: gives the edges that were captured to their decoders. Whether there were any.
    #[inline]
    pub fn capture(&mut self) -> bool {
        let Some(decoders) = &mut self.decoders else { return false };
        let edges = self.timer.take();
        let mut has_edges = false;
        for (decoder, edge) in decoders.iter_mut().zip(edges) {
            let Some(Edge { timestamp, is_high, overcapture }) = edge else { continue };
            has_edges = true;
            if overcapture {
                decoder.overcapture();
            }
            decoder.edge(timestamp, if is_high { Level::High } else { Level::Low });
        }
        if decoders.iter().any(Decoder::has_new_listening) {
            self.listen();
        }
        has_edges
    }

    /// Once per control tick: what has become of each input. The capture interrupt waits meanwhile, and only so long.
    #[inline]
    pub fn poll(&mut self) -> [InputReading; MOTORS] {
        let now = self.timer.now();
        let mut readings = [InputReading::NOTHING; MOTORS];
        let Some(decoders) = &mut self.decoders else { return readings };
        for (decoder, reading) in decoders.iter_mut().zip(&mut readings) {
            *reading = decoder.read(now);
        }
        if self.is_any_restricted {
            self.listen();
        }
        readings
    }

    /// New limits, or no pulses; the decoders know nothing of their lines afterwards.
    pub fn set_timing(&mut self, timing: Option<Timing>) {
        match (timing, &mut self.decoders) {
            // In place: the capture interrupt and the control task wait meanwhile.
            (Some(timing), Some(decoders)) => decoders.iter_mut().for_each(|one| *one = decoder::<T>(timing)),
            _ => self.decoders = timing.map(decoders::<T>),
        }
        self.listen();
        // Also where nothing changes: what was captured before is dropped.
        self.timer.listen(self.listening);
    }

    /// What was wrong at each input since the settings were set; `None` where they have no pulses.
    #[must_use]
    pub fn faults(&self) -> Option<[MotorFaults; MOTORS]> {
        let decoders = self.decoders.as_ref()?;
        Some(decoders.each_ref().map(|decoder| {
            let Faults { glitches, missing_edges, out_of_range, too_soon, floods, losses } = decoder.faults();
            let default = MotorFaults::default();
            MotorFaults { glitches, missing_edges, out_of_range, too_soon, lost: losses, masked: floods, ..default }
        }))
    }

    /// Time between the last two pulses of each input that is live, timer ticks; `None` where they have no pulses.
    #[must_use]
    pub fn periods(&self) -> Option<[Option<u32>; MOTORS]> {
        Some(self.decoders.as_ref()?.each_ref().map(Decoder::period))
    }

    #[cold]
    #[inline(never)]
    fn listen(&mut self) {
        let listening = |decoders: &mut [Decoder; MOTORS]| decoders.each_mut().map(Decoder::take_listening);
        let listening = self.decoders.as_mut().map_or([Listening::Off; MOTORS], listening);
        self.is_any_restricted = self.decoders.is_some() && listening != [Listening::All; MOTORS];
        if listening != self.listening {
            self.listening = listening;
            self.timer.listen(listening);
        }
    }
}

fn decoder<T: CaptureTimer>(timing: Timing) -> Decoder {
    Decoder::new(if T::IS_QUEUED { timing.without_flood() } else { timing })
}

fn decoders<T: CaptureTimer>(timing: Timing) -> [Decoder; MOTORS] {
    core::array::from_fn(|_| decoder::<T>(timing))
}
