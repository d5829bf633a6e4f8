//! Which settings may be used.

use core::fmt;
use core::ops::Deref;

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::{CompensatorKind, Key, Levels, MotorSettings, Pulse, PulseProtocol, SettingId, Settings};
use crate::capture::{FASTEST_FRAME_HZ, SLOWEST_FRAME_HZ};
use crate::design::{
    DAMPING_RANGE, ERPM_RANGE, LeadParameters, SHORTEST_SPEED_RANGE, SLEW_RANGE_PER_S, SpeedCurve,
    TIME_CONSTANT_RANGE_S,
};
use crate::dshot::WINDOW_LEVELS;
use crate::throttle::Command;

/// Frame rates in hertz: from a slow servo output to the fastest that OneShot125 is run at.
pub const FRAME_RANGE_HZ: (u16, u16) = (SLOWEST_FRAME_HZ as u16, FASTEST_FRAME_HZ as u16);
/// Frame rates of DShot: up to one in each tick of the fastest loop.
pub const DSHOT_FRAME_RANGE_HZ: (u16, u16) = (FRAME_RANGE_HZ.0, LOOP_RATE_RANGE_HZ.1 as u16);
/// A line is high, and low, for at least this long in every frame, microseconds. It must outlast the capture's glitch
/// filter and the slew of an opto-coupled input, which is a few microseconds.
pub const SHORTEST_LEVEL_US: u32 = 20;
/// Highest stop command of a raw duty: an ESC that takes the duty for the command must not turn its motor at it.
pub const HIGHEST_STOP: i32 = (Command::ONE.to_bits() as i64 * 3 / 100) as i32;
/// Fastest frames of a raw duty: with more, [`SHORTEST_LEVEL_US`] is above [`HIGHEST_STOP`], 3 % of the frame.
pub const FASTEST_RAW_DUTY_HZ: u16 = (30_000 / SHORTEST_LEVEL_US) as u16;
/// Highest idle, and with it the highest command that arms: a motor at a fifth of its range, some 5 % of its thrust, is as much as
/// may be expected of one that has just been armed.
pub const HIGHEST_IDLE: i32 = ONE / 5;
/// An idle above this is warned of: flight controllers idle at 3 to 8 %.
const HIGH_IDLE: i32 = ONE / 10;
/// Frames of DShot per control tick that the inputs take: an input's queue holds four words, and ticks are not quite even.
const FRAMES_PER_TICK: u32 = 2;
/// An arming threshold below this is warned of: a flight controller whose clock is 3 % off sends 1030 µs for a stop.
const LOW_ARMING: i32 = (Command::ONE.to_bits() as i64 * 4 / 100) as i32;

/// Ticks per second of the control loop.
const LOOP_RATE_RANGE_HZ: (u32, u32) = (1000, 10_000);
const STOP_PULSES_RANGE_MS: (u16, u16) = (0, 60_000);
const ARM_RANGE_MS: (u16, u16) = (0, 10_000);
const HOLD_RANGE_MS: (u16, u16) = (0, 1000);
const DURATION_RANGE_S: (u16, u16) = (1, 600);
const RAMP_RANGE_MS: (u16, u16) = (100, 10_000);
const DIVISOR_RANGE: (u16, u16) = (1, 5000);
/// A quarter: beyond it a motor's lag is not one number any more.
const LARGEST_AMPLITUDE: i32 = Command::ONE.to_bits() / 4;
const ONE: i32 = Command::ONE.to_bits();

/// Why settings are refused: the parameter, its motor, and what is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct SettingsError {
    /// The parameter.
    pub place: SettingId,
    /// What is wrong with it.
    pub problem: Problem,
}

/// What is wrong with a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Problem {
    /// Outside its range, or not a number. Levels are given as commands, 0 to 1.
    OutOfRange {
        /// Its value.
        value: f64,
        /// Lowest value allowed.
        min: f64,
        /// Highest value allowed.
        max: f64,
    },
    /// The zero is not below the poles.
    ZeroNotBelowPoles,
    /// The inverse has no time constants of this motor.
    NoCurve,
    /// A stop command above 0 with a protocol whose 0 has a pulse of its own.
    StopWithoutRawDuty,
    /// The longest pulse, with a gap of [`SHORTEST_LEVEL_US`], does not fit the frame.
    PulseTooLong {
        /// The longest pulse, microseconds.
        longest_us: u32,
        /// Highest frame rate that it fits.
        max_frame_hz: u16,
    },
    /// At this raw duty the line is high, or low, for less than [`SHORTEST_LEVEL_US`] in a frame: it has no edges that
    /// can be relied on.
    NoEdges {
        /// Lowest duty allowed at this frame rate.
        min: f64,
        /// Highest duty allowed at this frame rate.
        max: f64,
    },
    /// More frames of DShot come in than are taken from the input's queue, which would keep the oldest.
    FramesOutrunTicks {
        /// Lowest rate of the control loop for them.
        min_loop_rate_hz: u32,
    },
    /// The flight controller waits for replies, and the outputs' protocol has none.
    NoReplies,
    /// A correction by the speed has no speeds of this motor.
    NoSpeed,
    /// The speed does not rise with the command everywhere.
    SpeedFalls,
    /// A correction by the speed needs the replies of the ESCs, and the outputs' protocol has none.
    NeedsReplies,
}

impl fmt::Display for SettingsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = self.place;
        match self.problem {
            Problem::OutOfRange { value, min, max } => {
                write!(f, "{place} is {value}, outside its range {min} to {max}")
            }
            Problem::ZeroNotBelowPoles => write!(f, "{place} is not below omega_f_rad_s: there is nothing to speed up"),
            Problem::NoCurve => {
                write!(
                    f,
                    "{place} is none: with compensator inverse it must be given, from the motor's identified model"
                )
            }
            Problem::StopWithoutRawDuty => {
                write!(f, "{place} must be 0 unless output.protocol is raw_duty, whose 0 has no pulse")
            }
            Problem::PulseTooLong { longest_us, max_frame_hz } => write!(
                f,
                "{place}: the longest pulse, {longest_us} us, and a gap of {SHORTEST_LEVEL_US} us do not fit the frame; \
                 use {max_frame_hz} Hz or less, or a shorter protocol"
            ),
            Problem::FramesOutrunTicks { min_loop_rate_hz } => write!(
                f,
                "{place}: more than {FRAMES_PER_TICK} frames of DShot would come in each control tick; set loop_rate_hz to \
                 {min_loop_rate_hz} or more"
            ),
            Problem::NoReplies => write!(
                f,
                "{place} is bidirectional, so the flight controller waits for the ESCs' replies: output.protocol must be \
                 bidirectional, too"
            ),
            Problem::NoSpeed => write!(
                f,
                "{place} is none: with compensator rpm it must be given, from the motor's speeds at its commands"
            ),
            Problem::SpeedFalls => {
                write!(f, "{place} must rise with the command everywhere: give more points, or ones with less noise")
            }
            Problem::NeedsReplies => write!(
                f,
                "{place} is not bidirectional, and compensator rpm goes by the ESCs' replies: set it to dshot300_bidirectional or \
                 dshot600_bidirectional, or compensator to inverse"
            ),
            Problem::NoEdges { min, max } => write!(
                f,
                "{place}: a raw duty needs an edge in every frame; at this frame rate it may be {min:.4} to {max:.4}"
            ),
        }
    }
}

impl core::error::Error for SettingsError {}

/// What is likely to go wrong with settings that may be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Warning {
    /// Frames come at less than twice the highest frequency that the compensator amplifies, `omega_g / (2 pi)`: it
    /// answers the steps between frames with ripple, and brings no bandwidth.
    SlowFrames(Key),
    /// Output frames may not come faster than input frames, so they cannot follow them: their phase drifts, and a
    /// command waits for up to a whole frame.
    FramesCannotFollow,
    /// A motor arms below 0.04, the command of a stop pulse of 1000 µs from a flight controller whose clock is 4 % off.
    LowArming,
    /// A motor's idle is above 0.1: it turns so fast once it is armed.
    HighIdle,
    /// Levels are chosen for an input with frames of DShot: commands below them stop the motor.
    LevelsAboveFrames,
    /// Pulses come at least as often as control ticks: of some, no tick ever hears.
    PulsesOutrunTicks,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SlowFrames(key) => write!(
                f,
                "{} is under twice the highest frequency that the compensator amplifies, omega_g / (2 pi): \
                 that makes ripple, not bandwidth",
                key.name()
            ),
            Self::FramesCannotFollow => write!(
                f,
                "output frames, which come at output.frame_hz and of DShot in whole control ticks, cannot follow the input's, and a \
                 command waits for up to a whole frame; raise output.frame_hz by some percent if the ESC allows it"
            ),
            Self::LowArming => write!(
                f,
                "a motor's arming is below 0.04: the stop pulse of a flight controller whose clock is some percent off \
                 may arm it; raise arming"
            ),
            Self::HighIdle => write!(
                f,
                "a motor's idle is above 0.1: it turns at that as soon as it is armed; flight controllers idle at 0.03 to 0.08"
            ),
            Self::LevelsAboveFrames => write!(
                f,
                "levels are set for a DShot input, or stop is above 0: a throttle below disarming stops the motor, in flight too, and it turns again \
                 only at arming; Betaflight's dshot_idle_value must be above both, dynamic idle and ArduPilot's MOT_SPIN_MIN go \
                 down to 48; set disarming, arming and idle to none, and stop to 0, unless the ESC needs them"
            ),
            Self::PulsesOutrunTicks => write!(
                f,
                "input.frame_hz is not below loop_rate_hz: a control tick takes the newest pulse, so some are left over; raise \
                 loop_rate_hz"
            ),
        }
    }
}

/// The warnings about one set of settings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Warnings {
    /// The input frames are slow.
    pub slow_input: bool,
    /// The output frames are slow.
    pub slow_output: bool,
    /// The output frames cannot follow the input's.
    pub cannot_follow: bool,
    /// An arming threshold is low.
    pub low_arming: bool,
    /// An idle is high.
    pub high_idle: bool,
    /// Levels are chosen for an input with frames.
    pub levels_above_frames: bool,
    /// Pulses come as often as control ticks.
    pub pulses_outrun_ticks: bool,
}

impl Warnings {
    /// One by one.
    pub fn iter(self) -> impl Iterator<Item = Warning> {
        let slow = |is_slow: bool, key| is_slow.then_some(Warning::SlowFrames(key));
        slow(self.slow_input, Key::InputFrameHz)
            .into_iter()
            .chain(slow(self.slow_output, Key::OutputFrameHz))
            .chain(self.cannot_follow.then_some(Warning::FramesCannotFollow))
            .chain(self.low_arming.then_some(Warning::LowArming))
            .chain(self.high_idle.then_some(Warning::HighIdle))
            .chain(self.levels_above_frames.then_some(Warning::LevelsAboveFrames))
            .chain(self.pulses_outrun_ticks.then_some(Warning::PulsesOutrunTicks))
    }
}

/// Settings that passed [`Settings::validate`].
#[derive(Clone, Debug, PartialEq)]
pub struct Validated {
    settings: Settings,
    warnings: Warnings,
}

impl Validated {
    /// What there is to say about them.
    #[must_use]
    pub const fn warnings(&self) -> Warnings {
        self.warnings
    }

    /// The settings, to be changed and validated again.
    #[must_use]
    pub fn into_settings(self) -> Settings {
        self.settings
    }
}

impl Deref for Validated {
    type Target = Settings;

    fn deref(&self) -> &Settings {
        &self.settings
    }
}

impl Default for Validated {
    /// The defaults, which are valid; a test holds them to it.
    fn default() -> Self {
        Self { settings: Settings::default(), warnings: Warnings::default() }
    }
}

impl Settings {
    /// Checks every range, and what the parameters ask of each other. Cheap: the compensator itself is not designed.
    ///
    /// # Errors
    /// [`SettingsError`] names the first parameter that is wrong, and its range.
    pub fn validate(self) -> Result<Validated, SettingsError> {
        let whole = |key| SettingId { key, motor: None };
        within(whole(Key::LoopRateHz), self.loop_rate_hz, LOOP_RATE_RANGE_HZ)?;
        let fastest_rad_s = crate::design::FASTEST_POLE_RAD * f64::from(self.loop_rate_hz);
        within(whole(Key::OmegaZRadS), self.lead.omega_z_rad_s, (f64::MIN_POSITIVE, fastest_rad_s))?;
        within(whole(Key::OmegaFRadS), self.lead.omega_f_rad_s, (f64::MIN_POSITIVE, fastest_rad_s))?;
        within(whole(Key::Damping), self.lead.damping, DAMPING_RANGE)?;
        if self.lead.omega_z_rad_s >= self.lead.omega_f_rad_s {
            return Err(SettingsError { place: whole(Key::OmegaZRadS), problem: Problem::ZeroNotBelowPoles });
        }
        self.check_inverse(fastest_rad_s)?;
        pulse(whole(Key::InputFrameHz), self.input)?;
        pulse(whole(Key::OutputFrameHz), self.output)?;
        within(whole(Key::OutputSlewPerS), self.slew_per_s, SLEW_RANGE_PER_S)?;
        let least_hz = u32::from(self.input.frame_hz).div_ceil(FRAMES_PER_TICK);
        if self.has_frames() && self.loop_rate_hz < least_hz {
            let problem = Problem::FramesOutrunTicks { min_loop_rate_hz: least_hz };
            return Err(SettingsError { place: whole(Key::InputFrameHz), problem });
        }
        self.check_speeds()?;
        if self.input.protocol.is_bidirectional() && !self.output.protocol.is_bidirectional() {
            return Err(SettingsError { place: whole(Key::InputProtocol), problem: Problem::NoReplies });
        }
        self.check_stop(whole(Key::Stop))?;
        within(whole(Key::StopPulsesMs), self.stop_pulses_ms, STOP_PULSES_RANGE_MS)?;
        for (index, motor) in (0..).zip(&self.motors) {
            self.check_motor(index, motor)?;
        }
        let limits = &self.excitation;
        within(whole(Key::ExcitationMaxDurationS), limits.max_duration_s, DURATION_RANGE_S)?;
        level(whole(Key::ExcitationMaxCommand), limits.max_command, (0, ONE))?;
        level(whole(Key::ExcitationMaxAmplitude), limits.max_amplitude, (1, LARGEST_AMPLITUDE))?;
        within(whole(Key::ExcitationArmMs), limits.arm_ms, ARM_RANGE_MS)?;
        within(whole(Key::ExcitationRampMs), limits.ramp_ms, RAMP_RANGE_MS)?;
        within(whole(Key::RecorderDivisor), self.recorder_divisor, DIVISOR_RANGE)?;

        let warnings = self.warnings();
        Ok(Validated { settings: self, warnings })
    }

    /// An inverse, and where it is used the time constants of every motor.
    fn check_inverse(&self, fastest_rad_s: f64) -> Result<(), SettingsError> {
        let whole = |key| SettingId { key, motor: None };
        let inverse = &self.inverse;
        within(whole(Key::InverseNaturalRadS), inverse.natural_rad_s, (f64::MIN_POSITIVE, fastest_rad_s))?;
        within(whole(Key::InverseDamping), inverse.damping, DAMPING_RANGE)?;
        level(whole(Key::InverseCompensateFrom), inverse.compensate_from, (0, ONE))?;
        level(whole(Key::InverseCompensateTo), inverse.compensate_to, (inverse.compensate_from, ONE))?;
        for (index, motor) in (0..).zip(&self.motors) {
            let place = SettingId { key: Key::TimeConstantS, motor: Some(index) };
            match &motor.curve {
                Some(curve) => {
                    for tau_s in curve.time_constants_s() {
                        within(place, f64::from(tau_s), TIME_CONSTANT_RANGE_S)?;
                    }
                }
                None if self.compensator != CompensatorKind::Lead => {
                    return Err(SettingsError { place, problem: Problem::NoCurve });
                }
                None => {}
            }
        }
        Ok(())
    }

    /// Speeds over the command, and where they are used those of every motor that goes by them, and replies.
    fn check_speeds(&self) -> Result<(), SettingsError> {
        let is_used = self.compensator == CompensatorKind::Rpm;
        if is_used && !self.output.protocol.is_bidirectional() {
            let place = SettingId { key: Key::OutputProtocol, motor: None };
            return Err(SettingsError { place, problem: Problem::NeedsReplies });
        }
        for ((index, motor), speeds) in (0..).zip(&self.motors).zip(&self.speeds) {
            let place = SettingId { key: Key::Erpm, motor: Some(index) };
            match speeds {
                Some(curve) => check_speed(place, curve)?,
                None if is_used && motor.compensate => {
                    return Err(SettingsError { place, problem: Problem::NoSpeed });
                }
                None => {}
            }
        }
        Ok(())
    }

    /// A stop command that stops, and raw duties that have edges.
    fn check_stop(&self, place: SettingId) -> Result<(), SettingsError> {
        if self.output.protocol != PulseProtocol::RawDuty {
            level(place, self.stop, (0, ONE))?;
            return if self.stop == 0 {
                Ok(())
            } else {
                Err(SettingsError { place, problem: Problem::StopWithoutRawDuty })
            };
        }
        let shortest = f64::from(SHORTEST_LEVEL_US) * 1e-6 * f64::from(self.output.frame_hz);
        let edges = |place, bits: i32, max: f64| {
            // A decimal at the limit is rounded to a step of the command, and so is the limit.
            let [lowest, highest] = [shortest, max].map(|limit| Command::saturating_from_f64(limit).to_bits());
            if (lowest..=highest).contains(&bits) {
                return Ok(());
            }
            Err(SettingsError { place, problem: Problem::NoEdges { min: shortest, max } })
        };
        edges(place, self.stop, as_command(HIGHEST_STOP))?;
        for (index, motor) in (0..).zip(&self.motors) {
            edges(SettingId { key: Key::Max, motor: Some(index) }, motor.max, 1.0 - shortest)?;
        }
        Ok(())
    }

    /// Whether output frames begin with the input's pulses: at rates above the input's and below twice that. Pulses that come
    /// as fast as frames may, or as control ticks, cannot be followed; where several frames fit between two pulses there is
    /// nothing to follow; and the value of a raw duty is its share of a frame of known length.
    #[must_use]
    pub fn output_follows_input(&self) -> bool {
        let (input_hz, output_hz) = (u32::from(self.input.frame_hz), u32::from(self.output.frame_hz));
        let is_between = input_hz < output_hz && output_hz < 2 * input_hz;
        let has_length = self.output.protocol != PulseProtocol::RawDuty && self.output.protocol.dshot().is_none();
        has_length && is_between && input_hz < self.loop_rate_hz
    }

    /// Whether each frame that goes out answers one that came in: DShot at both ends.
    #[must_use]
    pub const fn relays_frames(&self) -> bool {
        self.input.protocol.dshot().is_some() && self.output.protocol.dshot().is_some()
    }

    /// Whether the inputs have frames of DShot.
    pub(super) const fn has_frames(&self) -> bool {
        self.input.protocol.dshot().is_some()
    }

    /// Control ticks from one frame of DShot to the next that an output gets where none come in; `None` with pulses.
    #[must_use]
    pub fn bench_frame_ticks(&self) -> Option<u32> {
        self.output.protocol.dshot()?;
        Some(if self.relays_frames() { 1 } else { self.frame_ticks(self.output) })
    }

    /// Control ticks in a frame of an input or an output, rounded up.
    pub(crate) fn frame_ticks(&self, pulse: Pulse) -> u32 {
        self.loop_rate_hz.div_ceil(u32::from(pulse.frame_hz).max(1))
    }

    /// The highest frequency that the compensator of the fastest motor amplifies, rad/s.
    fn omega_g_rad_s(&self) -> f64 {
        if self.compensator == CompensatorKind::Lead {
            return LeadParameters::from(self.lead).omega_g_rad_s();
        }
        // The inverse of the rotor with the time constant tau is a lead with its zero on 1 / tau: eq. (5) of the paper.
        let curves = self.motors.iter().filter_map(|motor| motor.curve);
        let shortest_s = curves.fold(f64::INFINITY, |shortest, curve| {
            curve.time_constants_s().iter().fold(shortest, |shortest, &tau_s| shortest.min(f64::from(tau_s)))
        });
        self.inverse.natural_rad_s * self.inverse.natural_rad_s * shortest_s
    }

    fn warnings(&self) -> Warnings {
        let omega_g_hz = self.omega_g_rad_s() / (2.0 * core::f64::consts::PI);
        // Without the compensator in any path nothing is amplified.
        let is_used = self.motors.iter().any(|motor| motor.compensate);
        let slow = |pulse: Pulse| is_used && f64::from(pulse.frame_hz) < 2.0 * omega_g_hz;
        Warnings {
            slow_input: slow(self.input),
            // Frames that are relayed come as often as the input's.
            slow_output: !self.relays_frames() && slow(self.output),
            cannot_follow: match self.output.protocol.dshot() {
                // One frame in whole control ticks.
                Some(_) => {
                    !self.has_frames() && self.loop_rate_hz / self.frame_ticks(self.output) < self.input.frame_hz.into()
                }
                None => self.output.protocol != PulseProtocol::RawDuty && self.output.frame_hz <= self.input.frame_hz,
            },
            // A frame is a number: no clock makes a stop of it that is none.
            low_arming: !self.has_frames() && self.any_level(|levels| levels.arming < LOW_ARMING),
            high_idle: self.any_level(|levels| levels.idle > HIGH_IDLE),
            levels_above_frames: self.has_frames()
                && (self.any_level(|levels| levels.disarming > Levels::FRAMES.disarming)
                    || self.motors.iter().any(MotorSettings::has_levels)),
            pulses_outrun_ticks: !self.has_frames() && u32::from(self.input.frame_hz) >= self.loop_rate_hz,
        }
    }

    fn any_level(&self, is: impl Fn(Levels) -> bool) -> bool {
        self.motors.iter().any(|motor| is(self.levels(motor)))
    }

    fn check_motor(&self, index: u8, motor: &MotorSettings) -> Result<(), SettingsError> {
        let place = |key| SettingId { key, motor: Some(index) };
        let Levels { disarming, arming, idle } = self.levels(motor);
        // Each level inside its widest range first, so that the ranges of the others make sense.
        level(place(Key::Disarming), disarming, (0, HIGHEST_IDLE))?;
        level(place(Key::Arming), arming, (0, HIGHEST_IDLE))?;
        level(place(Key::Idle), idle, (0, HIGHEST_IDLE))?;
        level(place(Key::Disarming), disarming, (self.stop.saturating_add(1), HIGHEST_IDLE))?;
        // Between the two of pulses there is a gap that noise does not cross; the numbers in frames have no noise.
        let lowest_arming = if self.has_frames() { disarming } else { disarming.saturating_add(1) };
        level(place(Key::Arming), arming, (lowest_arming, HIGHEST_IDLE))?;
        level(place(Key::Idle), idle, (arming, HIGHEST_IDLE))?;
        level(place(Key::Max), motor.max, (idle.saturating_add(1), ONE))?;
        within(place(Key::HoldMs), motor.hold_ms, HOLD_RANGE_MS)
    }
}

/// For how long a line is left to the reply behind a frame, microseconds, rounded up.
const fn reply_us(protocol: PulseProtocol) -> u32 {
    match protocol.dshot() {
        Some(line) if line.is_bidirectional => (WINDOW_LEVELS * 1_000_000).div_ceil(line.speed.reply_levels_per_s()),
        _ => 0,
    }
}

/// A frame rate within its range, whose frame holds the longest pulse and a gap.
fn pulse(place: SettingId, pulse: Pulse) -> Result<(), SettingsError> {
    if pulse.protocol.dshot().is_some() {
        within(place, pulse.frame_hz, DSHOT_FRAME_RANGE_HZ)?;
    } else {
        within(place, pulse.frame_hz, FRAME_RANGE_HZ)?;
    }
    if pulse.protocol == PulseProtocol::RawDuty {
        return within(place, pulse.frame_hz, (FRAME_RANGE_HZ.0, FASTEST_RAW_DUTY_HZ));
    }
    let Some((_, longest_us)) = pulse.protocol.range_us() else { return Ok(()) };
    let longest_us = longest_us + reply_us(pulse.protocol);
    let max_frame_hz = 1_000_000 / (longest_us + SHORTEST_LEVEL_US);
    if u32::from(pulse.frame_hz) > max_frame_hz {
        // Under 10^6 / 27: fits.
        let problem = Problem::PulseTooLong { longest_us, max_frame_hz: max_frame_hz as u16 };
        return Err(SettingsError { place, problem });
    }
    Ok(())
}

/// Speeds within their range that rise over enough of the commands.
fn check_speed(place: SettingId, curve: &SpeedCurve) -> Result<(), SettingsError> {
    let ([from, to], shortest) = (curve.range(), SHORTEST_SPEED_RANGE.to_bits());
    level(place, from, (0, ONE - shortest))?;
    level(place, to, (from + shortest, ONE))?;
    for erpm in curve.erpm() {
        within(place, erpm, ERPM_RANGE)?;
    }
    if curve.is_rising() { Ok(()) } else { Err(SettingsError { place, problem: Problem::SpeedFalls }) }
}

/// A number within its range. NaN is not.
fn within<T: Into<f64>>(place: SettingId, value: T, (min, max): (T, T)) -> Result<(), SettingsError> {
    let (value, min, max) = (value.into(), min.into(), max.into());
    if value >= min && value <= max {
        return Ok(());
    }
    Err(SettingsError { place, problem: Problem::OutOfRange { value, min, max } })
}

/// Command bits within their range, reported as commands.
// Rarely called, from many places: in line it would take several times the flash.
#[inline(never)]
fn level(place: SettingId, bits: i32, (min, max): (i32, i32)) -> Result<(), SettingsError> {
    within(place, as_command(bits), (as_command(min), as_command(max)))
}

fn as_command(bits: i32) -> f64 {
    f64::from(bits) / f64::from(ONE)
}
