//! The controller as its lowest priority reaches it.

use rtic_core::Mutex;

use super::hardware::{BoardFacts, CaptureTimer, ControlHardware, RequestHardware};
use super::plan::Plan;
use super::{Control, Inputs, Tick};
use crate::channel::Channel;
use crate::link::{MotorFaults, Refusal};
use crate::settings::{MOTORS, Validated};

/// What only the board has counted, for [`Faults`](crate::link::Faults).
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    /// Bytes of the link that were lost.
    pub link_overruns: u32,
    /// Control ticks that began late.
    pub missed_deadlines: u32,
    /// Times that the lowest priority was away for 20 s while a flight controller turned a motor.
    pub idle_hangs: u32,
    /// At the inputs.
    pub motors: [MotorFaults; MOTORS],
}

/// How often pulses or frames come and go at a motor, in a second; 0 where none come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameRates {
    /// In.
    pub input_hz: u32,
    /// Out, where there are any.
    pub output_hz: u32,
}

/// How a [`RequestHandler`](super::RequestHandler) reaches the control task and what only the board knows. A board does not
/// implement it: [`ControlHandle`] does, of its parts.
pub trait ControlAccess {
    /// Runs `f` on the control task's state with nobody else at it. Short: the control task waits.
    fn tick<R>(&mut self, f: impl FnOnce(&mut Tick) -> R) -> R;
    /// Sets rates and pulses, and gives the tick its new channels. Every motor is at rest.
    ///
    /// # Errors
    /// Where a timer does not suit the pulses.
    fn reconfigure(&mut self, settings: &Validated, channels: [Channel; MOTORS]) -> Result<(), Refusal>;
    /// The flash will stall the core (`true`), or has done so (`false`).
    fn flash_stalls(&mut self, stalls: bool);
    /// What only the board knows.
    fn facts(&mut self) -> BoardFacts;
    /// What only the board has counted.
    fn counts(&mut self) -> Counts;
    /// How often pulses or frames come and go, as measured.
    fn frame_rates(&mut self, loop_rate_hz: u32) -> [FrameRates; MOTORS];
    /// Whether somebody at the board has allowed excitation and injection.
    fn is_bench_enabled(&mut self) -> bool;
}

/// A [`ControlAccess`] to parts that are shared with tasks of higher priority.
pub struct ControlHandle<'a, I, C, H> {
    /// The inputs.
    pub inputs: I,
    /// The control task's state.
    pub control: C,
    /// The rest of the board.
    pub hardware: &'a mut H,
}

impl<I, C, H, T, D> ControlAccess for ControlHandle<'_, I, C, H>
where
    I: Mutex<T = Inputs<T>>,
    C: Mutex<T = Control<D>>,
    H: RequestHardware,
    T: CaptureTimer,
    D: ControlHardware,
{
    fn tick<R>(&mut self, f: impl FnOnce(&mut Tick) -> R) -> R {
        self.control.lock(|control| f(control.tick_mut()))
    }

    fn reconfigure(&mut self, settings: &Validated, channels: [Channel; MOTORS]) -> Result<(), Refusal> {
        let facts = self.hardware.facts();
        if !facts.suits(settings) {
            return Err(Refusal::NoDshot);
        }
        let plan =
            Plan::new(settings, facts.clocks.timer_hz, facts.clocks.tells_pulses_apart()).ok_or(Refusal::Design)?;
        // At once, or a tick would read pulses of one protocol on the scale of the other.
        self.inputs.lock(|inputs| {
            self.control.lock(|control| control.reconfigure(settings, &channels, &plan));
            inputs.set_timing(plan.input.timing());
        });
        Ok(())
    }

    fn flash_stalls(&mut self, stalls: bool) {
        self.control.lock(|control| control.flash_stalls(stalls));
        self.hardware.wait_for_watchdog();
    }

    fn facts(&mut self) -> BoardFacts {
        self.hardware.facts()
    }

    fn counts(&mut self) -> Counts {
        let mut motors = self.inputs.lock(|inputs| inputs.faults()).unwrap_or_default();
        let (missed_deadlines, idle_hangs) = self.control.lock(|control| {
            control.count_faults(&mut motors);
            (control.missed_deadlines(), control.idle_hangs())
        });
        Counts { link_overruns: self.hardware.link_overruns(), missed_deadlines, idle_hangs, motors }
    }

    fn frame_rates(&mut self, loop_rate_hz: u32) -> [FrameRates; MOTORS] {
        let timer_hz = self.hardware.facts().clocks.timer_hz;
        let pulses = self.inputs.lock(|inputs| inputs.periods());
        self.control.lock(|control| {
            let inputs = match pulses {
                Some(periods) => periods.map(|period| period.map_or(0, |ticks| timer_hz / ticks.max(1))),
                None => control.input_frames(loop_rate_hz),
            };
            inputs.map(|input_hz| FrameRates { input_hz, output_hz: control.output_hz(input_hz, loop_rate_hz) })
        })
    }

    fn is_bench_enabled(&mut self) -> bool {
        self.hardware.is_bench_enabled()
    }
}
