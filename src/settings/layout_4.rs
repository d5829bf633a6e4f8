//! Settings as the fourth layout stored them, before speeds corrected an inverse.

use serde::Deserialize;

use super::{CompensatorKind, ExcitationLimits, Inverse, Lead, MOTORS, MotorSettings, NoSignal, Pulse, Settings};
use crate::design::RotorCurve;

/// The number of this layout in a stored set.
pub(super) const LAYOUT: u16 = 4;

/// All that the fourth layout had.
#[derive(Deserialize)]
pub(super) struct Settings4 {
    loop_rate_hz: u32,
    compensator: CompensatorKind,
    lead: Lead,
    inverse: Inverse,
    input: Pulse,
    output: Pulse,
    slew_per_s: f64,
    stop: i32,
    no_signal: NoSignal,
    stop_pulses_ms: u16,
    resume: bool,
    motors: [Motor4; MOTORS],
    excitation: ExcitationLimits,
    recorder_divisor: u16,
}

#[derive(Deserialize)]
struct Motor4 {
    compensate: bool,
    disarming: Option<i32>,
    arming: Option<i32>,
    idle: Option<i32>,
    max: i32,
    hold_ms: u16,
    curve: Option<RotorCurve>,
}

impl Settings4 {
    /// The same settings in today's layout: nobody knew the speeds.
    pub fn migrate(self) -> Settings {
        let Self { loop_rate_hz, compensator, lead, inverse, input, output, slew_per_s, stop, .. } = self;
        Settings {
            loop_rate_hz,
            compensator,
            lead,
            inverse,
            input,
            output,
            slew_per_s,
            stop,
            no_signal: self.no_signal,
            stop_pulses_ms: self.stop_pulses_ms,
            resume: self.resume,
            motors: self.motors.map(Motor4::migrate),
            excitation: self.excitation,
            recorder_divisor: self.recorder_divisor,
        }
    }
}

impl Motor4 {
    fn migrate(self) -> MotorSettings {
        let Self { compensate, disarming, arming, idle, max, hold_ms, curve } = self;
        MotorSettings { compensate, disarming, arming, idle, max, hold_ms, curve, erpm: None }
    }
}
