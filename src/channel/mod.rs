//! One motor's path from the newest command to the next pulse, with its safety states. No hardware in it.
//!
//! # States
//!
//! ```text
//!                 live, not disarmed
//!   NoSignal --------------------------> Locked
//!      |                                  |  |
//!      | live, < disarming                |  | not live
//!      v                                  |  v
//!   Disarmed <----------------------------+ Lost <-------+
//!    |    ^  |    live, < disarming          ^           |
//!    |    |  |    from every state           |           |
//!    |    |  +-------------------------------+           |
//!    |    |           not live, or armed only now ------>| hold time over
//!    |    | live, < disarming                            |
//!    v    |                                              |
//!   Armed  ---------------------------> Holding ---------+
//!     three live, >= arming   not live      | live again: on as before the loss
//! ```
//!
//! | state | output |
//! |---|---|
//! | [`State::NoSignal`] | no pulse, or stop pulses where the settings ask for them |
//! | [`State::Locked`] | the same: the command is not disarmed, and no disarmed one came before it |
//! | [`State::Disarmed`] | stop pulses |
//! | [`State::Armed`] | the command through the compensator, within [idle, max] |
//! | [`State::Holding`] | as if the last command were still coming |
//! | [`State::Lost`] | stop pulses for a set time, then as [`State::NoSignal`] |
//! | [`State::Excitation`] | stop pulses for a set time, then the excitation, through the compensator as a command would be |
//!
//! # Rules
//!
//! - **Thresholds.** A disarmed motor arms with [`COMMANDS_TO_ARM`] commands in a row that are at `arming_threshold` or above, and
//!   an armed one disarms with the first below `disarming_threshold`. Before a first disarmed command, one between the two is not
//!   taken for one.
//! - **A disarmed command stops the motor on its own tick, in every state**: the stop is neither delayed nor shaped, and it
//!   ends an excitation. The filter is at rest meanwhile, and starts from rest at the first armed command, so that arming
//!   does not look like a step to it (which would make a kick of 3.4 times the command).
//! - **Armed, the lowest output is idle**, not stop: a step from 0.5 to 0.3 drives the unclamped filter below 0 for
//!   20 ms, and a motor that stops in flight may not start again.
//! - **Loss.** The last *command* is held, not the last output, which may be the peak of an answer to a step: the filter
//!   settles on it. After `hold_ticks` ticks come stop pulses, and after `stop_pulse_ticks` of those none. A loss is held only if
//!   the motor was armed longer than the hold time; a shorter signal counts as a disturbance.
//! - **Return within the hold time**, with the filter in the path, goes on without a jump: the output starts from where it
//!   is and fades to the new command within some 50 ms, instead of answering the step that the outage made with a lead
//!   kick. With the filter switched out there is no such kick; the command passes at once.
//! - **Return after the stop**, and the first command after a start or a reset: a motor turns only after a disarmed
//!   command was seen, as a pilot expects of a receiver that comes back. A controller that was reset in flight
//!   (brown-out) therefore stays at stop until it is disarmed and armed again.
//! - **Resumption.** After a reset that the controller itself caused, [`Channel::resume`] goes on as in [`State::Holding`], at the
//!   last command and for what is left of the hold time.
//! - **No ESC is armed by this controller alone**, and none is put into its calibration: before a disarmed command there
//!   are no pulses (unless the settings ask for stop pulses), so a full throttle at power-up does not reach it.
//! - **Excitation** starts only where no pulse input is live or held. A pulse input that becomes live ends it: with a
//!   disarmed command at once, with another one down the ramp.
//!
//! A tick is integer, without division, loop (but that over an excitation's lines) or panic.

mod excitation;
mod settings;

pub use excitation::{End, Excitation, ExcitationRequest, Phase, Refusal};
pub use settings::{ChannelSettings, ChannelSettingsError, ExcitationLimits, LONGEST_RAMP_TICKS, NoSignal};

use crate::capture::InputReading;
use crate::compensator::{Compensator, Filter, SpeedCorrection};
use crate::throttle::{Command, EscCommand, PulseScale};
use excitation::Player;

/// Commands in a row that arm a motor: as many as pulses make an input live ([`PULSES_TO_LIVE`](crate::capture::PULSES_TO_LIVE)). One
/// disturbance may look like a command; three of them in a row, each a valid one, are a flight controller.
pub const COMMANDS_TO_ARM: u8 = crate::capture::PULSES_TO_LIVE;

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
    pub const fn from_reading(reading: InputReading, scale: &PulseScale) -> Self {
        match (reading, reading.width_ticks()) {
            (_, Some(width_ticks)) => Self::Command(scale.to_command(width_ticks)),
            (InputReading::UNCHANGED, None) => Self::Unchanged,
            (InputReading::LOST, None) => Self::Lost,
            (_, None) => Self::Nothing,
        }
    }
}

/// What a channel does. See the [module](self).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// No input since the start, or since an excitation.
    NoSignal,
    /// A command that does not disarm, and none that does came before it.
    Locked,
    /// The command is below the arming threshold.
    Disarmed,
    /// The command is at or above the disarming threshold, after it was at or above the arming threshold.
    Armed,
    /// The input was lost and the hold time runs.
    Holding,
    /// The input was lost and the output has stopped.
    Lost,
    /// The host runs the motor.
    Excitation(Phase),
}

impl State {
    /// Whether the output is, and stays until further input, at a stop pulse or none. Only then may the settings be
    /// changed or saved.
    #[must_use]
    pub const fn is_at_rest(self) -> bool {
        matches!(self, Self::NoSignal | Self::Locked | Self::Disarmed | Self::Lost)
    }
}

/// [`State`] with what belongs to it alone.
// A channel has one of these for as long as it lives.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug)]
enum Mode {
    NoSignal,
    Locked,
    /// After so many commands in a row that arm.
    Disarmed {
        arming: u8,
    },
    /// Armed for `ticks` ticks, not yet long enough for a signal loss to be held: that takes a command after more than the hold time.
    JustArmed {
        ticks: u32,
    },
    Armed,
    Holding {
        ticks_left: u32,
    },
    Lost,
    Excitation(Player),
}

/// One motor's channel. See the [module](self).
#[derive(Clone, Debug)]
pub struct Channel {
    mode: Mode,
    /// The last command of the input.
    command: Command,
    compensator: Compensator,
    settings: ChannelSettings,
    /// Stop pulses that are still to come, in ticks, while the motor is at rest without a disarmed command.
    stop_ticks_left: u32,
    /// Ticks since the output was last anything but a stop pulse or none, or since a command asked the motor to turn. Counts from
    /// start-up, since earlier history is unknown.
    rest_ticks: u32,
    last_end: Option<End>,
    /// Excitations that ended because the host was silent; wraps.
    dead_man_ends: u32,
}

impl Channel {
    /// A channel without a signal, its filter in the path.
    ///
    /// # Errors
    /// When the settings contradict each other.
    pub fn new(settings: &ChannelSettings, filter: impl Into<Filter>) -> Result<Self, ChannelSettingsError> {
        settings.validate()?;
        Ok(Self {
            mode: Mode::NoSignal,
            command: settings.stop,
            compensator: Compensator::new(filter, settings.idle, settings.max),
            settings: *settings,
            stop_ticks_left: 0,
            rest_ticks: 0,
            last_end: None,
            dead_man_ends: 0,
        })
    }

    /// The channel as [`Self::new`] made it, with the filter in the path or not. For how long it was at rest stays known.
    #[must_use]
    pub fn fresh_copy(&self, is_enabled: bool) -> Self {
        let ChannelSettings { stop: command, idle, .. } = self.settings;
        let mut compensator = self.compensator;
        compensator.set_enabled(is_enabled);
        compensator.reset(idle);
        let settings = self.settings;
        Self {
            mode: Mode::NoSignal,
            command,
            compensator,
            settings,
            stop_ticks_left: 0,
            rest_ticks: self.rest_ticks,
            last_end: None,
            dead_man_ends: 0,
        }
    }

    /// One control tick: what the input has, to what the ESC gets.
    #[inline]
    pub fn tick(&mut self, input: Input) -> EscCommand {
        // Nearly all ticks of a flight: armed, and armed still.
        if matches!(self.mode, Mode::Armed) {
            let command = match input {
                Input::Command(command) => command,
                Input::Unchanged => self.command,
                Input::Nothing | Input::Lost => return self.tick_any(input),
            };
            if command >= self.settings.disarming_threshold {
                self.command = command;
                return self.compensator.update(command).into();
            }
        }
        self.tick_any(input)
    }

    /// One control tick with a command of the host, which arms a disarmed motor at once: its frames have a checksum of 32 bits, and
    /// somebody at the board has allowed them.
    pub fn inject(&mut self, command: Command) -> EscCommand {
        if let Mode::Disarmed { arming } = &mut self.mode {
            *arming = COMMANDS_TO_ARM - 1;
        }
        self.tick(Input::Command(command))
    }

    /// Any tick.
    #[inline(never)]
    fn tick_any(&mut self, input: Input) -> EscCommand {
        match (input, &self.mode) {
            (Input::Command(command), &Mode::JustArmed { ticks }) if command >= self.settings.disarming_threshold => {
                self.command = command;
                self.just_armed(ticks, ticks > self.settings.hold_ticks)
            }
            (Input::Unchanged, &Mode::JustArmed { ticks }) => self.just_armed(ticks, false),
            (Input::Command(command), _) => self.with_command(command),
            (Input::Unchanged, Mode::Locked | Mode::Armed) => self.with_command(self.command),
            (Input::Unchanged, &Mode::Disarmed { arming }) => self.disarmed(arming),
            (Input::Unchanged, Mode::Excitation(_)) => {
                let output = self.excite();
                if self.last_end == Some(End::PulseInput) {
                    self.require_disarm();
                }
                output
            }
            _ => self.without_command(),
        }
    }

    fn with_command(&mut self, command: Command) -> EscCommand {
        self.command = command;
        let ChannelSettings { disarming_threshold, arming_threshold, .. } = self.settings;
        match &mut self.mode {
            &mut Mode::Disarmed { arming } if command >= arming_threshold && arming + 1 < COMMANDS_TO_ARM => {
                self.disarmed(arming + 1)
            }
            Mode::Disarmed { .. } if command >= arming_threshold => {
                self.mode = Mode::JustArmed { ticks: 1 };
                self.rest_ticks = 0;
                self.compensator.reset(command);
                self.compensator.update(command).into()
            }
            Mode::Disarmed { .. } => self.disarmed(0),
            _ if command < disarming_threshold => {
                if let Mode::Excitation(player) = &self.mode {
                    let was_ending = player.phase() == Phase::RampDown;
                    let end = if was_ending { player.end() } else { End::PulseInput };
                    self.end_record(end);
                }
                self.disarmed(0)
            }
            Mode::JustArmed { .. } | Mode::Armed => self.compensator.update(command).into(),
            Mode::Holding { .. } => {
                self.mode = Mode::Armed;
                // Out of the path there is nothing to smooth.
                if self.compensator.is_enabled() {
                    self.compensator.restart(command);
                }
                self.compensator.update(command).into()
            }
            Mode::NoSignal | Mode::Locked | Mode::Lost => {
                self.mode = Mode::Locked;
                let output = self.rest();
                // The motor stands, but somebody means to fly.
                self.rest_ticks = 0;
                output
            }
            Mode::Excitation(player) => {
                player.ramp_down(End::PulseInput);
                let output = self.excite();
                self.require_disarm();
                output
            }
        }
    }

    /// Behind an excitation that is over, while the input is live: it has to be seen disarmed.
    const fn require_disarm(&mut self) {
        if matches!(self.mode, Mode::NoSignal) {
            self.mode = Mode::Locked;
        }
    }

    fn without_command(&mut self) -> EscCommand {
        match self.mode {
            Mode::NoSignal | Mode::Lost => self.rest(),
            Mode::Locked | Mode::Disarmed { .. } => {
                self.mode = Mode::Lost;
                self.rest()
            }
            Mode::JustArmed { .. } => {
                self.stop();
                self.rest()
            }
            Mode::Armed => self.hold(self.settings.hold_ticks),
            Mode::Holding { ticks_left } => self.hold(ticks_left),
            Mode::Excitation(_) => self.excite(),
        }
    }

    /// A tick at the stop, after so many commands in a row that arm.
    fn disarmed(&mut self, arming: u8) -> EscCommand {
        self.mode = Mode::Disarmed { arming };
        self.stop_ticks_left = self.settings.stop_pulse_ticks;
        self.rest_ticks = self.rest_ticks.saturating_add(1);
        self.settings.stop.into()
    }

    /// A tick of a motor that has been armed for so many, whose loss is held from now on, or not yet.
    fn just_armed(&mut self, ticks: u32, is_held_now: bool) -> EscCommand {
        self.mode = if is_held_now { Mode::Armed } else { Mode::JustArmed { ticks: ticks.saturating_add(1) } };
        self.compensator.update(self.command).into()
    }

    /// As if the last command were still coming, until the hold time is over.
    fn hold(&mut self, ticks_left: u32) -> EscCommand {
        match ticks_left.checked_sub(1) {
            Some(ticks_left) => {
                self.mode = Mode::Holding { ticks_left };
                self.compensator.update(self.command).into()
            }
            None => {
                self.stop();
                self.rest()
            }
        }
    }

    /// Stop pulses while there are some left to come, then what the settings ask for.
    fn rest(&mut self) -> EscCommand {
        self.rest_ticks = self.rest_ticks.saturating_add(1);
        match (self.stop_ticks_left.checked_sub(1), self.settings.no_signal) {
            (Some(left), _) => {
                self.stop_ticks_left = left;
                self.settings.stop.into()
            }
            (None, NoSignal::StopPulses) => self.settings.stop.into(),
            (None, NoSignal::NoPulses) => EscCommand::NO_PULSE,
        }
    }

    /// One tick of the excitation. On the ramps it passes the arming threshold as a command would.
    fn excite(&mut self) -> EscCommand {
        let Mode::Excitation(player) = &mut self.mode else { return self.rest() };
        self.rest_ticks = 0;
        let was_armed = player.level() >= self.settings.arming_threshold;
        match player.tick() {
            Some(level) if level >= self.settings.arming_threshold => {
                if !was_armed {
                    self.compensator.reset(level);
                }
                self.compensator.update(level).into()
            }
            Some(level) => level.into(),
            None => {
                let end = player.end();
                self.end_record(end);
                self.mode = Mode::NoSignal;
                self.stop_ticks_left = self.settings.stop_pulse_ticks;
                self.rest()
            }
        }
    }

    fn end_record(&mut self, end: End) {
        self.last_end = Some(end);
        if end == End::DeadMan {
            self.dead_man_ends = self.dead_man_ends.wrapping_add(1);
        }
    }

    /// Starts an excitation with the next tick. The dead-man's time starts now.
    ///
    /// # Errors
    /// When a pulse input is live or held, another excitation runs, or the channel's settings are not those that the
    /// excitation was checked against.
    pub fn start_excitation(&mut self, excitation: Excitation) -> Result<(), Refusal> {
        match self.mode {
            Mode::NoSignal | Mode::Lost => {}
            Mode::Locked | Mode::Disarmed { .. } | Mode::JustArmed { .. } | Mode::Armed => {
                return Err(Refusal::InputLive);
            }
            Mode::Holding { .. } => return Err(Refusal::InputHeld),
            Mode::Excitation(_) => return Err(Refusal::AlreadyRunning),
        }
        if *excitation.settings() != self.settings {
            return Err(Refusal::OtherSettings);
        }
        self.last_end = None;
        self.mode = Mode::Excitation(Player::new(excitation));
        Ok(())
    }

    /// Treats the input as lost at once, without restarting the stop-pulse time. Only for a motor at rest, such as one whose ticks are
    /// about to pause; it turns again only after a new disarmed command, since the last one is then old.
    pub fn mark_lost(&mut self) {
        self.mode = Mode::Lost;
    }

    /// The same for a motor that may turn: stop pulses come first.
    pub fn stop(&mut self) {
        self.mode = Mode::Lost;
        self.stop_ticks_left = self.settings.stop_pulse_ticks;
    }

    /// What a loss of the input would be held with now: the command, and for how many ticks.
    #[must_use]
    pub const fn hold_state(&self) -> Option<(Command, u32)> {
        match self.mode {
            Mode::Armed => Some((self.command, self.settings.hold_ticks)),
            Mode::Holding { ticks_left } => Some((self.command, ticks_left)),
            _ => None,
        }
    }

    /// Goes on with what [`Self::hold_state`] gave before a reset, the filter at rest at the command. Of a channel that is as
    /// [`Self::new`] made it, and without effect on any other.
    pub fn resume(&mut self, command: Command, ticks_left: u32) {
        if !matches!(self.mode, Mode::NoSignal) || command < self.settings.disarming_threshold {
            return;
        }
        self.mode = Mode::Holding { ticks_left: ticks_left.min(self.settings.hold_ticks) };
        self.command = command;
        self.rest_ticks = 0;
        self.compensator.reset(command);
    }

    /// Ticks for which the output has been at a stop pulse or none, since the start at most.
    #[must_use]
    pub const fn rest_ticks(&self) -> u32 {
        self.rest_ticks
    }

    /// The channel that follows one which was at rest for so many ticks.
    #[must_use]
    pub const fn at_rest_for(mut self, ticks: u32) -> Self {
        self.rest_ticks = ticks;
        self
    }

    /// The host is still there.
    pub const fn keep_alive(&mut self) {
        if let Mode::Excitation(player) = &mut self.mode {
            player.keep_alive();
        }
    }

    /// Ends an excitation down the ramp; without effect where none runs.
    pub fn stop_excitation(&mut self) {
        if let Mode::Excitation(player) = &mut self.mode {
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

    /// Has an inverse go by the speed that the ESC says ([`Compensator::set_correction`]).
    pub const fn set_correction(&mut self, correction: SpeedCorrection) {
        self.compensator.set_correction(correction);
    }

    /// What the ESC says of the speed, where a pulse input has the motor ([`Compensator::correct`]). During an excitation nothing is
    /// corrected: what is identified is the path as it is.
    #[inline]
    pub fn correct(&mut self, turn_us: i32) {
        if matches!(self.mode, Mode::JustArmed { .. } | Mode::Armed | Mode::Holding { .. }) {
            self.compensator.correct(turn_us);
        }
    }

    /// What the speed has made of the gain of an inverse; 1 where nothing corrects it.
    #[must_use]
    pub fn gain(&self) -> f64 {
        self.compensator.gain()
    }

    /// Whether the filter is in the path.
    #[must_use]
    pub const fn is_enabled(&self) -> bool {
        self.compensator.is_enabled()
    }

    /// What the channel does.
    #[must_use]
    pub const fn state(&self) -> State {
        match &self.mode {
            Mode::NoSignal => State::NoSignal,
            Mode::Locked => State::Locked,
            Mode::Disarmed { .. } => State::Disarmed,
            Mode::JustArmed { .. } | Mode::Armed => State::Armed,
            Mode::Holding { .. } => State::Holding,
            Mode::Lost => State::Lost,
            Mode::Excitation(player) => State::Excitation(player.phase()),
        }
    }

    /// The command of the last tick, before the filter: the input's (or the last one, while it is held), the
    /// excitation's, or stop.
    #[must_use]
    pub const fn command(&self) -> Command {
        match &self.mode {
            Mode::Disarmed { .. } | Mode::JustArmed { .. } | Mode::Armed | Mode::Holding { .. } => self.command,
            Mode::Excitation(player) => player.level(),
            Mode::NoSignal | Mode::Locked | Mode::Lost => self.settings.stop,
        }
    }

    /// The last command within the limits, while the motor is armed: what the ESC gets when the source of the commands
    /// pauses.
    #[must_use]
    pub const fn held_command(&self) -> Option<Command> {
        match &self.mode {
            Mode::JustArmed { .. } | Mode::Armed | Mode::Holding { .. } => {
                Some(self.command.clamp_to(self.settings.idle, self.settings.max))
            }
            _ => None,
        }
    }

    /// The limits it works within.
    #[must_use]
    pub const fn settings(&self) -> &ChannelSettings {
        &self.settings
    }
}
