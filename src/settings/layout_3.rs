//! Settings as the third layout stored them, when levels were numbers and the slew was the inverse's.

use serde::Deserialize;

use super::{
    CompensatorKind, ExcitationLimits, Inverse, Lead, Levels, MOTORS, MotorSettings, NoSignal, Pulse, Settings,
};
use crate::design::RotorCurve;

/// The number of this layout in a stored set.
pub(super) const LAYOUT: u16 = 3;

/// All that the third layout had.
#[derive(Deserialize)]
pub(super) struct Settings3 {
    loop_rate_hz: u32,
    compensator: CompensatorKind,
    lead: Lead,
    inverse: Inverse3,
    input: Pulse,
    output: Pulse,
    stop: i32,
    no_signal: NoSignal,
    stop_pulses_ms: u16,
    motors: [Motor3; MOTORS],
    excitation: ExcitationLimits,
    recorder_divisor: u16,
}

#[derive(Deserialize)]
struct Inverse3 {
    natural_rad_s: f64,
    damping: f64,
    slew_per_s: f64,
    compensate_from: i32,
    compensate_to: i32,
}

#[derive(Deserialize)]
struct Motor3 {
    compensate: bool,
    disarming: i32,
    arming: i32,
    idle: i32,
    max: i32,
    hold_ms: u16,
    curve: Option<RotorCurve>,
}

impl Settings3 {
    /// The same settings in today's layout. A lead has the ESC's slew now, too: the default, since it had none then.
    pub fn migrate(self) -> Settings {
        let Self { loop_rate_hz, compensator, lead, input, output, stop, no_signal, stop_pulses_ms, .. } = self;
        let today = Settings::default();
        let Inverse3 { natural_rad_s, damping, slew_per_s, compensate_from, compensate_to } = self.inverse;
        Settings {
            loop_rate_hz,
            compensator,
            lead,
            inverse: Inverse { natural_rad_s, damping, compensate_from, compensate_to },
            input,
            output,
            slew_per_s: if compensator == CompensatorKind::Lead { today.slew_per_s } else { slew_per_s },
            stop,
            no_signal,
            stop_pulses_ms,
            motors: self.motors.map(Motor3::migrate),
            excitation: self.excitation,
            recorder_divisor: self.recorder_divisor,
            ..today
        }
    }
}

impl Motor3 {
    fn migrate(self) -> MotorSettings {
        let Self { compensate, disarming, arming, idle, max, hold_ms, curve } = self;
        let motor = MotorSettings { compensate, max, hold_ms, curve, ..MotorSettings::default() };
        motor.with_levels(Levels { disarming, arming, idle })
    }
}
