//! A motor run by the host: stop pulses for the ESC to arm, up a ramp, a multisine for a set time, down a ramp.

use core::fmt;

use super::settings::ChannelSettings;
use crate::excitation::{ExcitationError, Lines, Multisine};
use crate::throttle::Command;

/// Decimals like 0.1, 0.05 and their difference are rounded to commands one by one, so a request at a limit may miss it by
/// one step of 2^-29. It is let pass; the output is limited by the channel anyway.
const ROUNDING: i32 = 1;

/// What the host asks for. A host that plays the same samples makes its [`Multisine`] from the same commands
/// (`amplitude.to_f64()`), not from the decimals that they were rounded from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExcitationRequest {
    /// The spectral lines.
    pub lines: Lines<'static>,
    /// `u_nom`, the command around which they are played.
    pub nominal: Command,
    /// `delta_u`, their peak.
    pub amplitude: Command,
    /// For how long they are played, control ticks; the ramps come on top.
    pub duration_ticks: u32,
}

/// Why a channel does not take an excitation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// A pulse input is live, whether armed or not: the flight controller has the motor.
    InputLive,
    /// A pulse input was live a moment ago and its hold time runs.
    InputHeld,
    /// Another excitation runs.
    AlreadyRunning,
    /// It was made for other limits than this channel has.
    OtherSettings,
    /// `nominal - amplitude` is below idle, where the output would be clamped.
    BelowIdle {
        /// The lowest command of the excitation.
        lowest: Command,
        /// The channel's idle command.
        idle: Command,
    },
    /// `nominal + amplitude` is too high.
    AboveMax {
        /// The highest command of the excitation.
        highest: Command,
        /// The lower one of the channel's highest command and its excitation's.
        max: Command,
    },
    /// `amplitude` is too high.
    AmplitudeTooHigh {
        /// What was asked for.
        amplitude: Command,
        /// The limit.
        max: Command,
    },
    /// `duration_ticks` is zero or too long.
    Duration {
        /// What was asked for.
        ticks: u32,
        /// The limit.
        max_ticks: u32,
    },
    /// The generator cannot play it.
    Generator(ExcitationError),
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::InputLive => write!(f, "a pulse input is live: unplug the flight controller first"),
            Self::InputHeld => write!(f, "a pulse input was live a moment ago: wait until the output has stopped"),
            Self::AlreadyRunning => write!(f, "an excitation runs: stop it first"),
            Self::OtherSettings => write!(f, "the settings changed since the request was checked: ask again"),
            Self::BelowIdle { lowest, idle } => write!(
                f,
                "nominal - amplitude is {}, below idle, {}: raise nominal or lower amplitude",
                lowest.to_f64(),
                idle.to_f64()
            ),
            Self::AboveMax { highest, max } => {
                write!(f, "nominal + amplitude is {}, above the limit, {}", highest.to_f64(), max.to_f64())
            }
            Self::AmplitudeTooHigh { amplitude, max } => {
                write!(f, "amplitude is {}, above the limit, {}", amplitude.to_f64(), max.to_f64())
            }
            Self::Duration { ticks, max_ticks } => {
                write!(f, "duration_ticks is {ticks}, outside 1 to {max_ticks}")
            }
            Self::Generator(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for Refusal {}

/// A checked request, ready to be started.
///
/// Making one takes floating point and some microseconds: do it outside the control task, and hand it over.
#[derive(Clone, Debug)]
pub struct Excitation {
    multisine: Multisine<'static>,
    ticks_left: u32,
    settings: ChannelSettings,
}

impl Excitation {
    /// Checks a request against the limits of the channel that is to play it.
    ///
    /// # Errors
    /// [`Refusal`] names what is out of range, and the range.
    pub fn new(settings: &ChannelSettings, request: &ExcitationRequest, loop_rate_hz: f64) -> Result<Self, Refusal> {
        let limits = &settings.excitation;
        let ExcitationRequest { lines, nominal, amplitude, duration_ticks: ticks } = *request;
        if amplitude > limits.max_amplitude {
            return Err(Refusal::AmplitudeTooHigh { amplitude, max: limits.max_amplitude });
        }
        let lowest = Command::saturating_from_bits(nominal.to_bits() - amplitude.to_bits());
        if lowest.to_bits() + ROUNDING < settings.idle.to_bits() {
            return Err(Refusal::BelowIdle { lowest, idle: settings.idle });
        }
        // Two commands add up to 2^30 at most.
        let highest = nominal.to_bits() + amplitude.to_bits();
        let max = settings.max.min(limits.max_command);
        if highest - ROUNDING > max.to_bits() {
            return Err(Refusal::AboveMax { highest: Command::saturating_from_bits(highest), max });
        }
        if ticks == 0 || ticks > limits.max_ticks {
            return Err(Refusal::Duration { ticks, max_ticks: limits.max_ticks });
        }
        let multisine =
            Multisine::new(lines, nominal.to_f64(), amplitude.to_f64(), loop_rate_hz).map_err(Refusal::Generator)?;
        Ok(Self { multisine, ticks_left: ticks, settings: *settings })
    }

    /// The limits that it was checked against.
    pub(super) const fn settings(&self) -> &ChannelSettings {
        &self.settings
    }
}

/// Where an excitation is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Stop pulses, for the ESC to arm.
    Arming,
    /// On the way from stop to the nominal command.
    RampUp,
    /// The lines are played.
    Playing,
    /// On the way to stop, from wherever it was.
    RampDown,
}

/// Why an excitation ended, or is on its way down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Its time was up.
    Completed,
    /// The host asked for it.
    Requested,
    /// The host gave no sign of life for the dead-man's time.
    DeadMan,
    /// A pulse input became live.
    PulseInput,
}

/// An excitation that runs.
#[derive(Clone, Debug)]
pub(super) struct Player {
    excitation: Excitation,
    phase: Phase,
    arm_ticks_left: u32,
    /// The last command.
    level: Command,
    /// Ticks since the host's last sign of life.
    silent_ticks: u32,
    end: End,
}

impl Player {
    pub(super) const fn new(excitation: Excitation) -> Self {
        let level = excitation.settings.stop;
        let arm_ticks_left = excitation.settings.excitation.arm_ticks;
        Self { excitation, phase: Phase::Arming, arm_ticks_left, level, silent_ticks: 0, end: End::Completed }
    }

    pub(super) const fn phase(&self) -> Phase {
        self.phase
    }

    pub(super) const fn level(&self) -> Command {
        self.level
    }

    pub(super) const fn end(&self) -> End {
        self.end
    }

    pub(super) const fn keep_alive(&mut self) {
        self.silent_ticks = 0;
    }

    /// Ramps down from the present command. The first reason stays.
    pub(super) fn ramp_down(&mut self, end: End) {
        if self.phase != Phase::RampDown {
            self.phase = Phase::RampDown;
            self.end = end;
        }
    }

    /// The command of this tick; `None` when it has come to a stop.
    pub(super) fn tick(&mut self) -> Option<Command> {
        let ChannelSettings { stop, excitation: limits, .. } = self.excitation.settings;
        let (step, dead_man_ticks) = (limits.ramp_per_tick.to_bits(), limits.dead_man_ticks);
        if self.silent_ticks >= dead_man_ticks {
            self.ramp_down(End::DeadMan);
        }
        self.silent_ticks = self.silent_ticks.saturating_add(1);
        if self.phase == Phase::Arming {
            match self.arm_ticks_left.checked_sub(1) {
                Some(left) => self.arm_ticks_left = left,
                None => self.phase = Phase::RampUp,
            }
        }
        if self.phase == Phase::Playing && self.excitation.ticks_left == 0 {
            self.ramp_down(End::Completed);
        }
        // A command and a step add up to 2^30 at most.
        self.level = match self.phase {
            Phase::Arming => stop,
            Phase::RampUp => {
                let nominal = self.excitation.multisine.nominal();
                let level = Command::saturating_from_bits(self.level.to_bits() + step).min(nominal);
                if level == nominal {
                    self.phase = Phase::Playing;
                    self.excitation.multisine.start(None);
                }
                level
            }
            Phase::Playing => {
                self.excitation.ticks_left = self.excitation.ticks_left.saturating_sub(1);
                self.excitation.multisine.update()
            }
            Phase::RampDown => Command::saturating_from_bits(self.level.to_bits() - step).max(stop),
        };
        (self.phase != Phase::RampDown || self.level > stop).then_some(self.level)
    }
}
