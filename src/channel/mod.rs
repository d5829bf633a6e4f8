//! One motor's path from the newest command to the next pulse, with its safety states. No hardware in it.
//!
//! # States
//!
//! ```text
//!               live, >= threshold
//!   NoSignal --------------------------> Locked
//!      |                                   |  |
//!      | live, < threshold                 |  | not live
//!      v                                   |  v
//!   Disarmed <-----------------------------+ Lost <------+
//!    |    ^       live, < threshold           |          |
//!    v    +--------- from every state --------+          | hold time over
//!   Armed                                                |
//!    |         not live (Disarmed or Armed)              |
//!    +------------------> Holding -----------------------+
//!                            |  live again: on as before the loss
//! ```
//!
//! | state | output |
//! |---|---|
//! | [`State::NoSignal`] | stop |
//! | [`State::Locked`] | stop: the command is armed, but none that was disarmed came before it |
//! | [`State::Disarmed`] | the command, untouched, but never below the stop |
//! | [`State::Armed`] | the command through the compensator, within [idle, max] |
//! | [`State::Holding`] | as if the last command were still coming |
//! | [`State::Lost`] | stop |
//! | [`State::Excitation`] | the excitation, through the compensator as a command would be |
//!
//! # Rules
//!
//! - **A disarmed command passes untouched in every state, on its own tick**: a motor stop is neither delayed nor shaped,
//!   and it ends an excitation. The filter is at rest meanwhile, and starts from rest at the first armed command, so that
//!   arming does not look like a step to it (which would make a kick of 3.4 times the command).
//! - **Armed, the lowest output is idle**, not stop: a step from 0.5 to 0.3 drives the unclamped filter below 0 for
//!   20 ms, and a motor that stops in flight may not start again.
//! - **Loss.** The last *command* is held, not the last output, which may be the peak of an answer to a step: the filter
//!   settles on it. After `hold_ticks` ticks comes the stop pulse.
//! - **Return within the hold time** goes on without a jump: the output starts from where it is and fades to the new
//!   command within some 50 ms, instead of answering the step that the outage made with a lead kick. With the filter
//!   switched out there is nothing to smooth; the command passes at once.
//! - **Return after the stop**, and the first command after a start or a reset: a motor turns only after a disarmed
//!   command was seen, as a pilot expects of a receiver that comes back. A controller that was reset in flight
//!   (brown-out) therefore stays at stop until it is disarmed and armed again.
//! - **Excitation** starts only where no pulse input is live or held. A pulse input that becomes live ends it: with a
//!   disarmed command at once, with an armed one down the ramp and then locked.
//!
//! A tick is integer, without division, loop (but that over an excitation's lines) or panic.

mod excitation;
mod settings;

pub use excitation::{End, Excitation, ExcitationRequest, Phase, Refusal};
pub use settings::{ChannelSettings, ChannelSettingsError, ExcitationLimits, SLOWEST_RAMP_PER_TICK};

use crate::biquad::Coefficients;
use crate::capture::Signal;
use crate::compensator::Compensator;
use crate::throttle::{Command, PulseScale};
use excitation::Player;

/// What the input of a channel has for this tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// There was no signal yet.
    Nothing,
    /// A new command.
    Command(Command),
    /// No news: a live input's last command is still good.
    Unchanged,
    /// The input was live and is not any more.
    Lost,
}

impl Input {
    /// What a decoder says, as a command.
    #[must_use]
    #[inline]
    pub const fn from_signal(signal: Signal, scale: &PulseScale) -> Self {
        match signal {
            Signal::Nothing => Self::Nothing,
            Signal::Pulse { width_ticks, .. } => Self::Command(scale.to_command(width_ticks)),
            Signal::Unchanged => Self::Unchanged,
            Signal::Lost(_) => Self::Lost,
        }
    }
}

/// What a channel does. See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// No input since the start.
    NoSignal,
    /// An armed command that no disarmed one came before.
    Locked,
    /// The command is below the arming threshold.
    Disarmed,
    /// The command is at or above the arming threshold.
    Armed,
    /// The input was lost and the hold time runs.
    Holding,
    /// The input was lost and the output has stopped.
    Lost,
    /// The host runs the motor.
    Excitation(Phase),
}

impl State {
    /// Whether the output is, and stays until further input, below the arming threshold. Only then may the settings be
    /// saved.
    #[must_use]
    pub const fn is_at_rest(self) -> bool {
        matches!(self, Self::NoSignal | Self::Locked | Self::Disarmed | Self::Lost)
    }
}

/// [`State`] without what the player knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    NoSignal,
    Locked,
    Disarmed,
    Armed,
    Holding,
    Lost,
    Excitation,
}

/// What becomes of a tick's command.
enum Path {
    /// It goes to the ESC as it is.
    Pass(Command),
    /// It goes through the compensator, which starts from rest where it was not in use.
    Shape(Command),
}

/// One motor's channel. See the [module](self).
#[derive(Clone, Debug)]
pub struct Channel {
    mode: Mode,
    /// Whether the input was live at the last tick.
    live: bool,
    /// Whether the last output came from the compensator.
    engaged: bool,
    /// The last live command.
    command: Command,
    held_ticks: u32,
    compensator: Compensator,
    settings: ChannelSettings,
    /// There while the mode is `Excitation`.
    player: Option<Player>,
    last_end: Option<End>,
    /// Excitations that ended because the host was silent; wraps.
    dead_man_ends: u32,
}

impl Channel {
    /// A channel without a signal, its filter in the path.
    ///
    /// # Errors
    /// When the settings contradict each other.
    pub fn new(settings: &ChannelSettings, coefficients: Coefficients) -> Result<Self, ChannelSettingsError> {
        settings.validate()?;
        Ok(Self {
            mode: Mode::NoSignal,
            live: false,
            engaged: false,
            command: settings.stop,
            held_ticks: 0,
            compensator: Compensator::new(coefficients, settings.idle, settings.max),
            settings: *settings,
            player: None,
            last_end: None,
            dead_man_ends: 0,
        })
    }

    /// One control tick: what the input has, to what the ESC gets.
    #[inline]
    pub fn tick(&mut self, input: Input) -> Command {
        // Nearly all ticks of a flight: armed by the last tick, whose input was live and whose output came from the
        // compensator, and armed still.
        if self.mode == Mode::Armed {
            let command = match input {
                Input::Command(command) => command,
                Input::Unchanged => self.command,
                Input::Nothing | Input::Lost => return self.tick_any(input),
            };
            if command >= self.settings.arming_threshold {
                self.command = command;
                return self.compensator.update(command);
            }
        }
        self.tick_any(input)
    }

    /// Any tick.
    #[inline(never)]
    fn tick_any(&mut self, input: Input) -> Command {
        match input {
            Input::Command(command) => {
                self.command = command;
                self.live = true;
            }
            Input::Unchanged => {}
            Input::Nothing | Input::Lost => self.live = false,
        }
        match self.decide() {
            Path::Pass(command) => {
                self.engaged = false;
                command
            }
            Path::Shape(command) => {
                if !self.engaged {
                    self.engaged = true;
                    self.compensator.reset(command);
                }
                self.compensator.update(command)
            }
        }
    }

    fn decide(&mut self) -> Path {
        if !self.live {
            return self.without_input();
        }
        if self.command < self.settings.arming_threshold {
            if let Some(player) = self.player.take() {
                let was_ending = player.phase() == Phase::RampDown;
                self.ended(if was_ending { player.end() } else { End::PulseInput });
            }
            self.mode = Mode::Disarmed;
            return self.disarmed();
        }
        match self.mode {
            Mode::Disarmed | Mode::Armed => {
                self.mode = Mode::Armed;
                Path::Shape(self.command)
            }
            Mode::Holding => {
                self.mode = Mode::Armed;
                // Out of the path there is nothing to smooth.
                if self.engaged && self.compensator.is_enabled() {
                    self.compensator.restart(self.command);
                }
                Path::Shape(self.command)
            }
            Mode::NoSignal | Mode::Locked | Mode::Lost => {
                self.mode = Mode::Locked;
                self.stop()
            }
            Mode::Excitation => {
                if let Some(player) = &mut self.player {
                    player.ramp_down(End::PulseInput);
                }
                self.excite()
            }
        }
    }

    fn without_input(&mut self) -> Path {
        match self.mode {
            Mode::Disarmed | Mode::Armed => {
                self.mode = Mode::Holding;
                self.held_ticks = 0;
                self.hold()
            }
            Mode::Holding => self.hold(),
            Mode::Locked => {
                self.mode = Mode::Lost;
                self.stop()
            }
            Mode::NoSignal | Mode::Lost => self.stop(),
            Mode::Excitation => self.excite(),
        }
    }

    /// As if the last command were still coming, until the hold time is over.
    fn hold(&mut self) -> Path {
        if self.held_ticks >= self.settings.hold_ticks {
            self.mode = Mode::Lost;
            return self.stop();
        }
        self.held_ticks = self.held_ticks.saturating_add(1);
        if self.engaged { Path::Shape(self.command) } else { self.disarmed() }
    }

    /// A disarmed command, as it is; only what is below the stop, where a raw duty has no edges, is put at the stop.
    fn disarmed(&self) -> Path {
        Path::Pass(self.command.max(self.settings.stop))
    }

    /// One tick of the excitation. On the ramps it passes the arming threshold as a command would.
    fn excite(&mut self) -> Path {
        match self.player.as_mut().and_then(Player::tick) {
            Some(level) if level >= self.settings.arming_threshold => Path::Shape(level),
            Some(level) => Path::Pass(level),
            None => {
                if let Some(player) = self.player.take() {
                    self.ended(player.end());
                }
                self.mode = if self.live { Mode::Locked } else { Mode::NoSignal };
                self.stop()
            }
        }
    }

    fn ended(&mut self, end: End) {
        self.last_end = Some(end);
        if end == End::DeadMan {
            self.dead_man_ends = self.dead_man_ends.wrapping_add(1);
        }
    }

    const fn stop(&self) -> Path {
        Path::Pass(self.settings.stop)
    }

    /// Starts an excitation; the next tick is the first of its ramp. The dead-man's time starts now.
    ///
    /// # Errors
    /// When a pulse input is live or held, another excitation runs, or the channel's settings are not those that the
    /// excitation was checked against.
    pub fn start_excitation(&mut self, excitation: Excitation) -> Result<(), Refusal> {
        match self.mode {
            Mode::NoSignal | Mode::Lost => {}
            Mode::Locked | Mode::Disarmed | Mode::Armed => return Err(Refusal::InputLive),
            Mode::Holding => return Err(Refusal::InputHeld),
            Mode::Excitation => return Err(Refusal::AlreadyRunning),
        }
        if *excitation.settings() != self.settings {
            return Err(Refusal::OtherSettings);
        }
        self.player = Some(Player::new(excitation));
        self.last_end = None;
        self.mode = Mode::Excitation;
        Ok(())
    }

    /// To stop, at once and until a disarmed command comes: for a motor at rest whose ticks are about to pause, and whose
    /// last disarmed command is then an old one.
    pub fn lock(&mut self) {
        self.mode = Mode::Lost;
        self.live = false;
        self.engaged = false;
        self.player = None;
    }

    /// The host is still there.
    pub const fn keep_alive(&mut self) {
        if let Some(player) = &mut self.player {
            player.keep_alive();
        }
    }

    /// Ends an excitation down the ramp; without effect where none runs.
    pub fn stop_excitation(&mut self) {
        if let Some(player) = &mut self.player {
            player.ramp_down(End::Requested);
        }
    }

    /// Why the last excitation ended; `None` where there was none, or while one runs.
    #[must_use]
    pub const fn last_end(&self) -> Option<End> {
        self.last_end
    }

    /// Excitations that ended because the host was silent, wrapping.
    #[must_use]
    pub const fn dead_man_ends(&self) -> u32 {
        self.dead_man_ends
    }

    /// Switches the filter in (`true`) or out of the path from the next tick on, without a jump. The limits stay.
    pub const fn set_enabled(&mut self, enabled: bool) {
        self.compensator.set_enabled(enabled);
    }

    /// Whether the filter is in the path.
    #[must_use]
    pub const fn is_enabled(&self) -> bool {
        self.compensator.is_enabled()
    }

    /// What the channel does.
    #[must_use]
    pub const fn state(&self) -> State {
        match self.mode {
            Mode::NoSignal => State::NoSignal,
            Mode::Locked => State::Locked,
            Mode::Disarmed => State::Disarmed,
            Mode::Armed => State::Armed,
            Mode::Holding => State::Holding,
            Mode::Lost => State::Lost,
            Mode::Excitation => State::Excitation(match &self.player {
                Some(player) => player.phase(),
                None => Phase::RampDown,
            }),
        }
    }

    /// The command of the last tick, before the filter: the input's (or the last one, while it is held), the
    /// excitation's, or stop.
    #[must_use]
    pub const fn command(&self) -> Command {
        match (self.mode, &self.player) {
            (Mode::Disarmed | Mode::Armed | Mode::Holding, _) => self.command,
            (Mode::Excitation, Some(player)) => player.level(),
            _ => self.settings.stop,
        }
    }

    /// The limits it works within.
    #[must_use]
    pub const fn settings(&self) -> &ChannelSettings {
        &self.settings
    }
}
