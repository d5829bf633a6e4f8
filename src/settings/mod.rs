//! What a controller stores: its parameters, their ranges, and their form in flash.
//!
//! [`Settings`] are numbers; [`Settings::validate`] says whether they may be used, and is asked before they are set and
//! after they are loaded. The filter's coefficients are not among them: [`crate::design`] makes those at start-up, on the
//! controller as on the host.
//!
//! [`Store`] keeps them in flash, twice. Settings of an older layout are migrated when they are loaded.

mod compensator;
mod key;
mod layout_1;
mod layout_2;
mod layout_3;
mod levels;
mod store;
mod validate;

use libm::sqrt;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::design::{DEFAULT_DAMPING, DEFAULT_SLEW_PER_S, RotorCurve, SpeedCurve};
use crate::throttle::Command;

pub use crate::channel::NoSignal;
pub use crate::protocol::{Pulse, PulseProtocol};
pub use compensator::{CompensatorKind, Inverse, Lead};
pub use key::{Key, SettingId};
pub use levels::Levels;
pub use store::{Loaded, Origin, SaveError, Store};
pub use validate::{
    DSHOT_FRAME_RANGE_HZ, FASTEST_RAW_DUTY_HZ, FRAME_RANGE_HZ, HIGHEST_IDLE, HIGHEST_STOP, Problem, SHORTEST_LEVEL_US,
    SettingsError, Validated, Warning, Warnings,
};

/// Motors of one controller.
pub const MOTORS: usize = 4;

/// Slowest capture and pulse timer that the default settings suit; any faster one that a `u32` holds suits them, too.
pub const SLOWEST_TIMER_HZ: u32 = 1_000_000;

/// Time without a [`KeepAlive`](crate::link::Request::KeepAlive) after which an excitation ramps down, milliseconds.
pub const DEAD_MAN_MS: u32 = 200;

/// What nearly every flight controller sends, at the fastest of the usual rates: 400, 480 (Betaflight) and 490 Hz (ArduPilot's
/// `RC_SPEED`).
const DEFAULT_INPUT: Pulse = Pulse { protocol: PulseProtocol::StandardPwm, frame_hz: 490 };
/// What nearly every ESC understands. Its frames may come closer than the input's, so that they can follow those: as close as
/// pulses of 2 ms may.
const DEFAULT_OUTPUT: Pulse = Pulse { protocol: PulseProtocol::StandardPwm, frame_hz: 495 };

/// Everything that a controller stores. Levels are commands in Q2.29 ([`Command::to_bits`]).
///
/// | key | range | default |
/// |---|---|---|
/// | `loop_rate_hz` | 1000..=10000 | 5000 |
/// | `compensator` | lead, inverse, rpm | lead |
/// | `omega_z_rad_s`, `omega_f_rad_s` | above 0, the zero below the poles | the paper's, 14.13 and 94.2 |
/// | `damping` | 0.3..=2 | 1/sqrt 2 |
/// | `inverse.natural_rad_s` | above 0 | the paper's, 94.2 |
/// | `inverse.damping` | 0.3..=2 | 1/sqrt 2 |
/// | `inverse.compensate_from`, `inverse.compensate_to` | 0..=1, in this order | 0, 1 |
/// | `input.protocol`, `output.protocol` | the name of a [`PulseProtocol`] | standard_pwm |
/// | `input.frame_hz`, `output.frame_hz` | 40..=3703, and the longest pulse fits; raw duty up to 1500; DShot up to 10000, and as an input to twice `loop_rate_hz` | 490, 495 |
/// | `output.slew_per_s` | 0 (no limit)..=1e6 | 20, 2 % per millisecond |
/// | `stop` | 0; raw duty: 20 µs of the frame up to 0.03 | 0 |
/// | `no_signal` | no_pulses, stop_pulses | no_pulses |
/// | `stop_pulses_ms` | 0..=60000 | 2000 |
/// | `resume` | true, false | true |
/// | `motor.N.compensate` | true, false | false |
/// | `motor.N.disarming` | above `stop`, or none | none: 0.04; DShot: its lowest throttle |
/// | `motor.N.arming` | above `disarming`, up to 0.2, or none; DShot: `disarming` or above | none: 0.05; DShot: `disarming` |
/// | `motor.N.idle` | `arming` or above, up to 0.2, or none | none: 0.05, or `arming` where that is above; DShot: `arming` |
/// | `motor.N.max` | above `idle`, 1 or below | 1 |
/// | `motor.N.hold_ms` | 0..=1000 | 100 |
/// | `motor.N.time_constant_s` | 33 of 1e-6..=1000, or none; needed where `compensator` is inverse or rpm | none |
/// | `motor.N.erpm` | 1000..=1e6, rising over a twentieth of the range or more, or none; needed where `compensator` is rpm and `motor.N.compensate` true | none |
/// | `excitation.max_duration_s` | 1..=600 | 120 |
/// | `excitation.max_command` | 0..=1 | 0.75 |
/// | `excitation.max_amplitude` | above 0, 0.25 or below | 0.1 |
/// | `excitation.arm_ms` | 0..=10000 | 3000 |
/// | `excitation.ramp_ms` | 100..=10000 | 2000 |
/// | `recorder_divisor` | 1..=5000 | 1 |
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Settings {
    /// Ticks of the control loop per second.
    pub loop_rate_hz: u32,
    /// What the compensators run.
    pub compensator: CompensatorKind,
    /// The lead, one for all motors.
    pub lead: Lead,
    /// The inverse, but for each motor's curve.
    pub inverse: Inverse,
    /// The flight controller's pulses.
    pub input: Pulse,
    /// The ESCs' pulses. All come from one timer, so there is one kind.
    pub output: Pulse,
    /// Largest change of the output that the ESCs follow, units of the command per second; 0 for no limit. Of every compensator.
    pub slew_per_s: f64,
    /// The command of the stop pulse. Above 0 for raw duty only, where 0 would be no pulse at all.
    pub stop: i32,
    /// What a motor's output does while its input has no signal.
    pub no_signal: NoSignal,
    /// For how long stop pulses follow a motor's last command before the output does as [`Self::no_signal`] says,
    /// milliseconds.
    pub stop_pulses_ms: u16,
    /// Whether motors that a flight controller has armed go on after a reset of the watchdog, a panic or a fault.
    pub resume: bool,
    /// What each motor has of its own.
    pub motors: [MotorSettings; MOTORS],
    /// What an excitation may do.
    pub excitation: ExcitationLimits,
    /// The recorder takes one tick in so many, unless a request says otherwise.
    pub recorder_divisor: u16,
    /// Each motor's electrical speed over the command; `None` where it is not known. Last, so that what an older layout has is a set without
    /// them.
    pub speeds: [Option<SpeedCurve>; MOTORS],
}

/// One motor's own parameters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct MotorSettings {
    /// Whether the compensator is in the path.
    pub compensate: bool,
    /// An armed motor disarms below this command; `None` for what the input's protocol has ([`Levels`]).
    pub disarming: Option<i32>,
    /// A disarmed motor arms from this command on; `None` likewise.
    pub arming: Option<i32>,
    /// The lowest output while armed; `None` likewise.
    pub idle: Option<i32>,
    /// The highest output.
    pub max: i32,
    /// How long the last command is held when the input is lost, milliseconds.
    pub hold_ms: u16,
    /// The rotor's time constants over the command; `None` where they are not known.
    pub curve: Option<RotorCurve>,
}

/// What an excitation may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ExcitationLimits {
    /// Longest time between the ramps, seconds.
    pub max_duration_s: u16,
    /// Highest command, nominal plus amplitude.
    pub max_command: i32,
    /// Largest peak deviation from the nominal command.
    pub max_amplitude: i32,
    /// How long stop pulses come before the ramp, for the ESC to arm, milliseconds.
    pub arm_ms: u16,
    /// Ramp time from command 0 to `max_command`, milliseconds; a shorter ramp takes proportionally less.
    pub ramp_ms: u16,
}

impl Default for Settings {
    /// Standard PWM in and out, the paper's compensator, switched out: a pulse passes as it is until somebody who has
    /// identified the motor says otherwise.
    fn default() -> Self {
        // The fastest motor of the paper's Table 1, and 2 pi 100 rad/s amplified at most (eq. 5 and 6).
        let omega_z_rad_s = 14.1275;
        let omega_g_rad_s = 200.0 * core::f64::consts::PI;
        let omega_f_rad_s = sqrt(omega_z_rad_s * omega_g_rad_s);
        Self {
            loop_rate_hz: 5000,
            compensator: CompensatorKind::Lead,
            lead: Lead { omega_z_rad_s, omega_f_rad_s, damping: DEFAULT_DAMPING },
            inverse: Inverse {
                natural_rad_s: omega_f_rad_s,
                damping: DEFAULT_DAMPING,
                compensate_from: 0,
                compensate_to: percent(100),
            },
            input: DEFAULT_INPUT,
            output: DEFAULT_OUTPUT,
            slew_per_s: DEFAULT_SLEW_PER_S,
            stop: 0,
            no_signal: NoSignal::NoPulses,
            stop_pulses_ms: 2000,
            resume: true,
            motors: [MotorSettings::default(); MOTORS],
            excitation: ExcitationLimits {
                max_duration_s: 120,
                max_command: percent(75),
                max_amplitude: percent(10),
                arm_ms: 3000,
                ramp_ms: 2000,
            },
            recorder_divisor: 1,
            speeds: [None; MOTORS],
        }
    }
}

impl Default for MotorSettings {
    fn default() -> Self {
        Self {
            compensate: false,
            disarming: None,
            arming: None,
            idle: None,
            max: percent(100),
            hold_ms: 100,
            curve: None,
        }
    }
}

/// Hundredths as command bits, rounded down.
const fn percent(value: i64) -> i32 {
    (Command::ONE.to_bits() as i64 * value / 100) as i32
}
