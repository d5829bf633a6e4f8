//! Settings as the second layout stored them, before there was an inverse.

use serde::Deserialize;

use super::{ExcitationLimits, Lead, Levels, MOTORS, MotorSettings, NoSignal, Pulse, Settings};

/// The number of this layout in a stored set.
pub(super) const LAYOUT: u16 = 2;

/// All that the second layout had.
#[derive(Deserialize)]
pub(super) struct Settings2 {
    loop_rate_hz: u32,
    lead: Lead,
    input: Pulse,
    output: Pulse,
    stop: i32,
    no_signal: NoSignal,
    stop_pulses_ms: u16,
    motors: [Motor2; MOTORS],
    excitation: ExcitationLimits,
    recorder_divisor: u16,
}

#[derive(Deserialize)]
struct Motor2 {
    compensate: bool,
    disarming: i32,
    arming: i32,
    idle: i32,
    max: i32,
    hold_ms: u16,
}

impl Settings2 {
    /// The same settings in today's layout: the compensator was a lead.
    pub fn migrate(self) -> Settings {
        let Self { loop_rate_hz, lead, input, output, stop, no_signal, stop_pulses_ms, motors, .. } = self;
        Settings {
            loop_rate_hz,
            lead,
            input,
            output,
            stop,
            no_signal,
            stop_pulses_ms,
            motors: motors.map(Motor2::migrate),
            excitation: self.excitation,
            recorder_divisor: self.recorder_divisor,
            ..Settings::default()
        }
    }
}

impl Motor2 {
    fn migrate(self) -> MotorSettings {
        let Self { compensate, disarming, arming, idle, max, hold_ms } = self;
        let motor = MotorSettings { compensate, max, hold_ms, ..MotorSettings::default() };
        motor.with_levels(Levels { disarming, arming, idle })
    }
}
