//! What the controller's recorder sends, as columns.

use std::time::{Duration, Instant};

use rotorlead::link::{Message, Record as Frame, RecordRequest, Request};
use rotorlead::throttle::Throttle;

use super::session::done;
use super::{DeviceError, Session};
use crate::record::{Excitation, Record};

/// How often the host says that it is there.
const KEEP_ALIVE: Duration = Duration::from_millis(50);

/// From the converter's counts to newtons: `(count - zero) * newtons_per_count`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration {
    /// The count without thrust.
    pub zero: f64,
    /// Newtons per count; negative when the sensor is turned around.
    pub newtons_per_count: f64,
}

/// Samples without a gap, one row each.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Recording {
    /// Ticks from row to row.
    pub divisor: u32,
    /// The pulse input, Q2.29; negative where there is none.
    pub input: Vec<i32>,
    /// Command before the compensator, Q2.29.
    pub before: Vec<i32>,
    /// Command after it, Q2.29.
    pub after: Vec<i32>,
    /// Counts of the converter.
    pub adc: Vec<i32>,
}

impl Recording {
    /// Rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.before.len()
    }

    /// Appends a frame of the recorder.
    ///
    /// # Errors
    /// [`DeviceError::SamplesLost`] when it does not follow on the last one: a record with a gap is no record.
    pub fn append(&mut self, frame: &Frame) -> Result<(), DeviceError> {
        let columns = [&frame.input, &frame.before, &frame.after, &frame.adc];
        if columns.iter().any(|column| column.len() != frame.before.len()) || frame.divisor == 0 {
            return Err(DeviceError::Unexpected { request: "record" });
        }
        self.divisor = u32::from(frame.divisor);
        let expected = (self.rows() as u32).wrapping_mul(self.divisor);
        let gap = frame.first_tick.wrapping_sub(expected);
        if gap != 0 {
            return Err(DeviceError::SamplesLost { missing: gap / self.divisor, tick: expected });
        }
        self.input.extend_from_slice(frame.input.as_slice());
        self.before.extend_from_slice(frame.before.as_slice());
        self.after.extend_from_slice(frame.after.as_slice());
        self.adc.extend_from_slice(frame.adc.as_slice());
        Ok(())
    }

    /// Rows `from..from + rows` as the record of an experiment. The converter is read before the command changes, so a
    /// row is the response at its time, and its command takes effect from then on.
    #[must_use]
    pub fn to_record(
        &self,
        from: usize,
        rows: usize,
        loop_rate_hz: f64,
        calibration: Calibration,
        template: Record,
    ) -> Record {
        let rows = from.min(self.rows())..(from + rows).min(self.rows());
        let row_s = f64::from(self.divisor) / loop_rate_hz;
        let commands = |bits: &[i32]| bits.iter().map(|&bits| Throttle::from_bits(bits).to_f64()).collect::<Vec<_>>();
        let thrust = |&count: &i32| (f64::from(count) - calibration.zero) * calibration.newtons_per_count;
        Record {
            time_s: (0..rows.len()).map(|row| row as f64 * row_s).collect(),
            command: commands(&self.before[rows.clone()]),
            esc_command: template.compensated.then(|| commands(&self.after[rows.clone()])),
            thrust_n: Some(self.adc[rows].iter().map(thrust).collect()),
            ..template
        }
    }
}

/// A record without columns, that names `compensator.toml` when it is compensated.
#[must_use]
pub fn template(file: String, nominal: f64, excitation: Excitation, compensated: bool) -> Record {
    Record {
        file,
        nominal,
        excitation,
        period_s: None,
        amplitude: None,
        compensated,
        compensator: compensated.then(|| "compensator.toml".into()),
        role: None,
        time_s: Vec::new(),
        command: Vec::new(),
        thrust_n: None,
        rpm: None,
        esc_command: None,
        voltage_v: None,
        current_a: None,
    }
}

/// Records `rows` rows of a motor as it is driven, one in `divisor` ticks (0: as in the settings).
///
/// # Errors
/// [`DeviceError`]; nothing is repeated, so a gap ends the recording.
pub fn record(
    session: &mut Session,
    motor: u8,
    divisor: u16,
    rows: usize,
    progress: &dyn Fn(usize),
) -> Result<Recording, DeviceError> {
    let mut tape = Tape::start(session, motor, divisor)?;
    let mut run = || -> Result<(), DeviceError> {
        while tape.recording.rows() < rows {
            tape.read(session)?;
            progress(tape.recording.rows().min(rows));
        }
        Ok(())
    };
    let recorded = run();
    let stopped = tape.stop(session);
    recorded?;
    stopped
}

/// A recording that runs.
pub(super) struct Tape {
    tag: u8,
    pub(super) recording: Recording,
    last_keep_alive: Instant,
}

impl Tape {
    /// Starts it.
    pub(super) fn start(session: &mut Session, motor: u8, divisor: u16) -> Result<Self, DeviceError> {
        let tag = session.send(&Request::Record(Some(RecordRequest { motor, divisor })))?;
        let limit = session.limit();
        done("record", session.answer(tag, limit, "record")?)?;
        Ok(Self { tag, recording: Recording::default(), last_keep_alive: Instant::now() })
    }

    /// Takes the next frame.
    pub(super) fn read(&mut self, session: &mut Session) -> Result<(), DeviceError> {
        let frame = session.next_record(self.tag)?;
        self.recording.append(&frame)
    }

    /// As [`Self::read`], and keeps an excitation alive. Its answers are not waited for.
    pub(super) fn read_alive(&mut self, session: &mut Session) -> Result<(), DeviceError> {
        if self.last_keep_alive.elapsed() >= KEEP_ALIVE {
            self.last_keep_alive = Instant::now();
            session.send(&Request::KeepAlive)?;
        }
        self.read(session)
    }

    /// Stops it.
    pub(super) fn stop(self, session: &mut Session) -> Result<Recording, DeviceError> {
        match session.ask("record", &Request::Record(None))? {
            Message::Done => Ok(self.recording),
            _ => Err(DeviceError::Unexpected { request: "record" }),
        }
    }
}
