//! Settings as the first layout stored them, and what they mean today.

use serde::Deserialize;

use super::{
    ExcitationLimits, Lead, Levels, MOTORS, MotorSettings, NoSignal, Pulse, PulseProtocol, Settings,
    validate::HIGHEST_STOP,
};

/// The number of this layout in a stored set.
pub(super) const LAYOUT: u16 = 1;

/// All that the first layout had.
#[derive(Deserialize)]
#[cfg_attr(test, derive(serde::Serialize))]
pub(super) struct Settings1 {
    loop_rate_hz: u32,
    lead: Lead,
    input: Pulse,
    output: Pulse,
    stop: i32,
    motors: [Motor1; MOTORS],
    excitation: Excitation1,
    recorder_divisor: u16,
}

#[derive(Deserialize)]
#[cfg_attr(test, derive(serde::Serialize, Clone, Copy))]
struct Motor1 {
    compensate: bool,
    arming: i32,
    idle: i32,
    max: i32,
    hold_ms: u16,
}

#[derive(Deserialize)]
#[cfg_attr(test, derive(serde::Serialize))]
struct Excitation1 {
    max_duration_s: u16,
    max_command: i32,
    max_amplitude: i32,
    ramp_ms: u16,
}

impl Settings1 {
    /// The same settings in today's layout. What was not there then has its default, but for the threshold of disarming,
    /// which keeps its distance from an arming threshold that somebody chose. A stop command that is not allowed any
    /// more is made the nearest one that is: it was higher than any ESC's stop.
    pub fn migrate(self) -> Settings {
        let today = Settings::default();
        let stop = if self.output.protocol == PulseProtocol::RawDuty { self.stop.min(HIGHEST_STOP) } else { 0 };
        Settings {
            loop_rate_hz: self.loop_rate_hz,
            lead: self.lead,
            input: self.input,
            output: self.output,
            stop,
            no_signal: NoSignal::NoPulses,
            stop_pulses_ms: today.stop_pulses_ms,
            motors: self.motors.map(|motor| motor.migrate(stop)),
            excitation: ExcitationLimits {
                max_duration_s: self.excitation.max_duration_s,
                max_command: self.excitation.max_command,
                max_amplitude: self.excitation.max_amplitude,
                arm_ms: today.excitation.arm_ms,
                ramp_ms: self.excitation.ramp_ms,
            },
            recorder_divisor: self.recorder_divisor,
            ..today
        }
    }
}

impl Motor1 {
    fn migrate(self, stop: i32) -> MotorSettings {
        // Four fifths of the way from the stop to arming, as with today's defaults. A flight controller that idles just
        // above the threshold that it was set up with must not find its motors stopped by an update.
        let above_stop = i64::from(self.arming) - i64::from(stop);
        let disarming = i64::from(stop) + above_stop * 4 / 5;
        let Self { compensate, arming, idle, max, hold_ms } = self;
        // Between two numbers of its type.
        let levels = Levels { disarming: disarming as i32, arming, idle };
        MotorSettings { compensate, max, hold_ms, ..MotorSettings::default() }.with_levels(levels)
    }
}
