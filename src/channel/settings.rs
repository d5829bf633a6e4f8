//! The limits of a channel, and their order.

use core::fmt;

use crate::throttle::Command;

/// What an output does without a signal at its input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "settings", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
pub enum NoSignal {
    /// Its line stays low: no ESC arms by itself.
    NoPulses,
    /// It has stop pulses, which arm an ESC that waits for them.
    StopPulses,
}

/// Longest ramp of an excitation, control ticks: a motor is down within 13 s at 10 kHz whatever is set.
pub const LONGEST_RAMP_TICKS: u32 = 1 << 17;

/// What a channel may do. Times are in control ticks.
///
/// `stop < disarming_threshold <= arming_threshold <= idle < max`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChannelSettings {
    /// The command of the stop pulse: the bottom of the pulse range, or above it where the protocol is raw duty, whose
    /// 0 has no edges.
    pub stop: Command,
    /// An armed motor disarms below this command.
    pub disarming_threshold: Command,
    /// A disarmed motor arms from this command on.
    pub arming_threshold: Command,
    /// Lowest output while armed: the lowest command at which a motor runs reliably.
    pub idle: Command,
    /// Highest output while armed.
    pub max: Command,
    /// How long the last command stays good after the input is lost.
    pub hold_ticks: u32,
    /// For how long stop pulses follow the last command of a flight controller or a host.
    pub stop_pulse_ticks: u32,
    /// What comes after them, and before the first signal.
    pub no_signal: NoSignal,
    /// What an excitation may ask for.
    pub excitation: ExcitationLimits,
}

/// What an excitation may ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExcitationLimits {
    /// Highest sum of nominal command and amplitude, before the filter. With the filter in the path the output may be
    /// higher, up to the channel's `max`: put that down where the stand cannot take it.
    pub max_command: Command,
    /// Highest amplitude.
    pub max_amplitude: Command,
    /// Longest time between the ramps.
    pub max_ticks: u32,
    /// The excitation ramps down after this long without a keep-alive from the host.
    pub dead_man_ticks: u32,
    /// How long stop pulses come before the ramp, for the ESC to arm.
    pub arm_ticks: u32,
    /// Change of the command per tick on the ramps from stop and back; `max_command` must not take more than
    /// [`LONGEST_RAMP_TICKS`].
    pub ramp_per_tick: Command,
}

impl Default for ChannelSettings {
    /// For a loop at 5 kHz: armed from 5 % on and down to 4 %, idle at 5 %, no upper limit, 100 ms of hold, 2 s of stop
    /// pulses.
    fn default() -> Self {
        Self {
            stop: Command::ZERO,
            disarming_threshold: Command::saturating_from_f64(0.04),
            arming_threshold: Command::saturating_from_f64(0.05),
            idle: Command::saturating_from_f64(0.05),
            max: Command::ONE,
            hold_ticks: 500,
            stop_pulse_ticks: 10_000,
            no_signal: NoSignal::NoPulses,
            excitation: ExcitationLimits::default(),
        }
    }
}

impl Default for ExcitationLimits {
    /// For a loop at 5 kHz: the paper's stand (0.65 + 0.05) with some room, 2 minutes, a dead-man of 200 ms, 3 s for the
    /// ESC to arm, and 2 s from stop to 0.5.
    fn default() -> Self {
        Self {
            max_command: Command::saturating_from_f64(0.8),
            max_amplitude: Command::saturating_from_f64(0.1),
            max_ticks: 120 * 5000,
            dead_man_ticks: 1000,
            arm_ticks: 15_000,
            ramp_per_tick: Command::saturating_from_f64(0.25 / 5000.0),
        }
    }
}

/// Settings that contradict each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChannelSettingsError {
    /// `disarming_threshold` is not above `stop`, so that the stop pulse would not disarm.
    DisarmingNotAboveStop,
    /// `arming_threshold` is below `disarming_threshold`: a command between them would arm and disarm by turns.
    ArmingBelowDisarming,
    /// `idle` is below `arming_threshold`: an armed channel could put out what means disarmed.
    IdleBelowThreshold,
    /// `max` is not above `idle`.
    MaxNotAboveIdle,
    /// `excitation.max_command` takes more than [`LONGEST_RAMP_TICKS`].
    RampTooSlow,
    /// `excitation.dead_man_ticks` is zero, so that every excitation ends before it starts.
    NoDeadMan,
}

impl fmt::Display for ChannelSettingsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::DisarmingNotAboveStop => "disarming_threshold is not above stop",
            Self::ArmingBelowDisarming => "arming_threshold is below disarming_threshold",
            Self::IdleBelowThreshold => "idle is below arming_threshold: raise idle",
            Self::MaxNotAboveIdle => "max is not above idle",
            Self::RampTooSlow => "excitation.ramp_per_tick is so low that a motor would take over 2^17 ticks to stop",
            Self::NoDeadMan => "excitation.dead_man_ticks is 0: no host can be that fast",
        })
    }
}

impl core::error::Error for ChannelSettingsError {}

impl ChannelSettings {
    /// Whether they are in order.
    ///
    /// # Errors
    /// The first contradiction.
    pub fn validate(&self) -> Result<(), ChannelSettingsError> {
        let in_order = [
            (self.disarming_threshold > self.stop, ChannelSettingsError::DisarmingNotAboveStop),
            (self.arming_threshold >= self.disarming_threshold, ChannelSettingsError::ArmingBelowDisarming),
            (self.idle >= self.arming_threshold, ChannelSettingsError::IdleBelowThreshold),
            (self.max > self.idle, ChannelSettingsError::MaxNotAboveIdle),
            (self.excitation.ramp_is_short(), ChannelSettingsError::RampTooSlow),
            (self.excitation.dead_man_ticks > 0, ChannelSettingsError::NoDeadMan),
        ];
        match in_order.into_iter().find(|(holds, _)| !holds) {
            Some((_, error)) => Err(error),
            None => Ok(()),
        }
    }
}

impl ExcitationLimits {
    const fn ramp_is_short(&self) -> bool {
        let longest = self.ramp_per_tick.to_bits() as i64 * LONGEST_RAMP_TICKS as i64;
        self.ramp_per_tick.to_bits() > 0 && self.max_command.to_bits() as i64 <= longest
    }
}
