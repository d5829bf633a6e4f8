//! The control tick of all motors.

use heapless::spsc::{Consumer, Producer};

use super::pacing::InputPulse;
use super::resume::HeldMotor;
use crate::capture::InputReading;
use crate::channel::{Channel, Excitation, Input, Refusal as ChannelRefusal, State};
use crate::compensator::TICKS_PER_UPDATE;
use crate::link::{
    ChannelState, INJECT_SAMPLES, INJECT_TIMEOUT_MS, INJECT_WINDOW, NO_INPUT, Path, REST_MS, RecordClock, Sample,
    Sensed, Source,
};
use crate::settings::MOTORS;
use crate::throttle::{Command, EscCommand, PulseScale};

/// Size of a queue for injected commands, or for what they came to. It holds one less, and a power of two needs no
/// division.
pub const INJECT_QUEUE: usize = (INJECT_WINDOW * INJECT_SAMPLES + 1).next_power_of_two();
/// Size of the queue of the recorder: 50 ms at 5 kHz, in which the lowest priority may be busy.
pub const RECORD_QUEUE: usize = 256;

/// A motor's ends of the queues of injection.
pub struct MotorQueues {
    /// Commands from the host.
    pub inject: Consumer<'static, Command, INJECT_QUEUE>,
    /// What they came to.
    pub outputs: Producer<'static, EscCommand, INJECT_QUEUE>,
}

/// Where a motor's commands come from.
#[derive(Clone, Copy, PartialEq, Eq)]
enum CommandSource {
    /// The flight controller's pulses.
    Pulse,
    /// The host.
    Inject,
    /// An injection that is over, and whose queued commands are still to be answered; then the pulses again.
    EndingInjection,
    /// Nothing: the output is at rest. Afterwards as [`Motor::before_pause`] says.
    Paused,
}

/// One motor: its channel, and where its commands come from.
pub struct Motor {
    channel: Channel,
    source: CommandSource,
    /// What a pause interrupts: an ending injection still has commands to answer afterwards.
    before_pause: CommandSource,
    queues: MotorQueues,
    /// Ticks since the last injected command.
    silent_ticks: u32,
    /// The last output.
    output: EscCommand,
    /// The pulse input as a command, while there is one.
    input: i32,
    /// Without one: whether the line is driven all the same.
    is_unreadable: bool,
    /// Whether the filter is in the path of the pulses: what an injection does with it ends with the injection.
    compensates: bool,
    /// Excitations of former channels that ended because the host was silent.
    dead_man: u32,
}

impl Motor {
    /// A motor that takes its commands from its pulses.
    #[must_use]
    pub const fn new(channel: Channel, queues: MotorQueues) -> Self {
        let compensates = channel.is_enabled();
        Self {
            channel,
            source: CommandSource::Pulse,
            before_pause: CommandSource::Pulse,
            queues,
            silent_ticks: 0,
            output: EscCommand::NO_PULSE,
            input: NO_INPUT,
            is_unreadable: false,
            compensates,
            dead_man: 0,
        }
    }

    /// The channel.
    #[must_use]
    pub const fn channel(&self) -> &Channel {
        &self.channel
    }

    /// Where the commands come from.
    #[must_use]
    pub const fn source(&self) -> Source {
        match self.unpaused() {
            CommandSource::Inject => Source::Inject,
            _ => Source::Pulse,
        }
    }

    /// The source, now or after a pause.
    const fn unpaused(&self) -> CommandSource {
        match self.source {
            CommandSource::Paused => self.before_pause,
            source => source,
        }
    }

    /// Whether the host injects, or has commands queued from an injection that is over.
    #[must_use]
    pub const fn is_injected(&self) -> bool {
        matches!(self.unpaused(), CommandSource::Inject | CommandSource::EndingInjection)
    }

    /// Whether the host drives the motor: an injection or an excitation.
    #[must_use]
    const fn is_bench_driven(&self) -> bool {
        self.is_injected() || matches!(self.channel.state(), State::Excitation(_))
    }

    /// Whether a flight controller turns the motor, or did until its pulses were lost a moment ago.
    fn is_flown(&self) -> bool {
        self.source == CommandSource::Pulse && matches!(self.channel.state(), State::Armed | State::Holding)
    }

    /// How it goes on after a reset: only where a flight controller turns it.
    #[inline]
    pub(super) fn held(&self) -> HeldMotor {
        let held = if self.source == CommandSource::Pulse { self.channel.hold_state() } else { None };
        HeldMotor { held, is_enabled: self.channel.is_enabled() }
    }

    /// Whether pulses come at its input, or came until a moment ago, be they of another protocol, and whatever drives the
    /// motor.
    #[must_use]
    pub const fn is_input_live(&self) -> bool {
        self.input != NO_INPUT || self.is_unreadable || matches!(self.channel.state(), State::Holding)
    }

    /// Starts afresh, with a new channel and with nothing left in the queues.
    pub fn restart(&mut self, channel: Channel, source: Source) {
        self.dead_man = self.dead_man();
        self.channel = channel.at_rest_for(self.channel.rest_ticks());
        self.output = EscCommand::NO_PULSE;
        self.source = match source {
            Source::Pulse => {
                self.compensates = self.channel.is_enabled();
                CommandSource::Pulse
            }
            Source::Inject => CommandSource::Inject,
        };
        self.silent_ticks = 0;
        // At most as many as a queue holds.
        for _ in 0..INJECT_QUEUE {
            if self.queues.inject.dequeue().is_none() {
                break;
            }
        }
    }

    /// Excitations that ended because the host was silent, wrapping.
    const fn dead_man(&self) -> u32 {
        self.dead_man.wrapping_add(self.channel.dead_man_ends())
    }

    /// Starts an excitation.
    ///
    /// # Errors
    /// As [`Channel::start_excitation`], and when the host injects.
    pub fn excite(&mut self, excitation: Excitation) -> Result<(), ChannelRefusal> {
        if self.source != CommandSource::Pulse {
            return Err(ChannelRefusal::AlreadyRunning);
        }
        self.channel.start_excitation(excitation)
    }

    /// Commands were accepted that are to be injected, and are queued under the same lock: the host is there.
    pub const fn expect_commands(&mut self) {
        self.silent_ticks = 0;
    }

    /// Holds the output at rest.
    fn pause(&mut self) {
        self.before_pause = self.unpaused();
        self.source = CommandSource::Paused;
        self.channel.mark_lost();
    }

    fn resume(&mut self) {
        self.source = self.unpaused();
    }

    /// What to report.
    #[must_use]
    pub const fn state(&self) -> ChannelState {
        if matches!(self.source(), Source::Inject) {
            return ChannelState::Injected;
        }
        match self.channel.state() {
            State::NoSignal => ChannelState::NoSignal,
            State::Locked => ChannelState::Locked,
            State::Disarmed => ChannelState::Disarmed,
            State::Armed => ChannelState::Armed,
            State::Holding => ChannelState::Holding,
            State::Lost => ChannelState::Lost,
            State::Excitation(_) => ChannelState::Excitation,
        }
    }

    /// What is in its path, without the rates of the frames.
    #[must_use]
    pub const fn path(&self) -> Path {
        let compensates = self.channel.is_enabled();
        Path { compensates, command: self.input, output: self.output.to_bits(), input_hz: 0, output_hz: 0 }
    }

    /// One tick.
    #[inline]
    fn run(&mut self, reading: InputReading, common: &Common) {
        // Nearly all ticks of a flight.
        if self.source == CommandSource::Pulse {
            if let Some(width_ticks) = reading.width_ticks() {
                let command = common.input_scale.to_command(width_ticks);
                self.input = command.to_bits();
                self.output = self.channel.tick(Input::Command(command));
                return;
            }
            if reading == InputReading::UNCHANGED {
                self.output = self.channel.tick(Input::Unchanged);
                return;
            }
        }
        self.run_any(reading, common);
    }

    /// [`Self::run`] with any source and any reading.
    #[inline(never)]
    fn run_any(&mut self, reading: InputReading, common: &Common) {
        self.is_unreadable = reading == InputReading::UNREADABLE;
        let input = Input::from_reading(reading, &common.input_scale);
        match input {
            Input::Command(command) => self.input = command.to_bits(),
            Input::Unchanged => {}
            Input::Nothing | Input::Lost => self.input = NO_INPUT,
        }
        self.output = match self.source {
            CommandSource::Pulse => self.channel.tick(input),
            _ => self.without_pulses(common.is_any_driven, common.silence_limit),
        };
    }

    fn without_pulses(&mut self, is_any_driven: bool, silence_limit: u32) -> EscCommand {
        match self.source {
            CommandSource::Inject if !is_any_driven => self.injected(silence_limit),
            CommandSource::Inject | CommandSource::EndingInjection => self.end_injection(),
            CommandSource::Paused | CommandSource::Pulse => self.channel.tick(Input::Nothing),
        }
    }

    /// One injected command. Without any the channel has no tick, so that its outputs do not depend on when frames arrive;
    /// the ESC gets the last command itself meanwhile, and not the last output, which may be the peak of an answer to a
    /// step. After the motor's hold time without a command, or `silence_limit` at rest, the injection ends.
    fn injected(&mut self, silence_limit: u32) -> EscCommand {
        if let Some(command) = self.queues.inject.dequeue() {
            self.silent_ticks = 0;
            let output = self.channel.inject(command);
            // The queue has room for every command that was accepted.
            let _ = self.queues.outputs.enqueue(output);
            return output;
        }
        let held = self.channel.held_command();
        let limit = if held.is_some() { self.channel.settings().hold_ticks } else { silence_limit };
        if self.silent_ticks >= limit {
            return self.end_injection();
        }
        self.silent_ticks = self.silent_ticks.saturating_add(1);
        held.map_or(self.output, EscCommand::from)
    }

    /// To the stop at once. A flight controller whose pulses have come up meanwhile has the motor afterwards, from a
    /// disarmed command on. Commands that are still queued are answered with what went out in their place.
    fn end_injection(&mut self) -> EscCommand {
        if self.source == CommandSource::Inject {
            // A line that had no pulse gets none now: they would arm an ESC.
            if self.output == EscCommand::NO_PULSE {
                self.channel.mark_lost()
            } else {
                self.channel.stop()
            }
            self.source = CommandSource::EndingInjection;
        }
        let output = self.channel.tick(Input::Nothing);
        if self.queues.inject.dequeue().is_some() {
            let _ = self.queues.outputs.enqueue(output);
        } else {
            self.channel.set_enabled(self.compensates);
            self.source = CommandSource::Pulse;
        }
        output
    }
}

/// Whether pulses may go out at all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outputs {
    /// As the channels say.
    Enabled,
    /// Every line stays low: nobody has chosen the settings, and what stops one ESC may be full speed for another.
    Low,
}

/// What is the same for all motors.
struct Common {
    input_scale: PulseScale,
    /// Ticks without an injected command after which the injection into a motor at rest ends.
    silence_limit: u32,
    /// How long a motor must have been at rest before anything is changed unasked at the board, ticks.
    rest_limit: u32,
    /// Whether some input was live in the last tick, or had pulses of another protocol.
    is_any_driven: bool,
}

/// The state of the control task.
pub struct Tick {
    motors: [Motor; MOTORS],
    outputs: Outputs,
    common: Common,
    /// What the first of the live inputs had in the last tick.
    input_pulse: InputPulse,
    samples: Producer<'static, Sample, RECORD_QUEUE>,
    recording: Option<(u8, RecordClock)>,
    ticks: u32,
    samples_dropped: u32,
}

impl Tick {
    /// Before the first tick.
    #[must_use]
    pub fn new(
        motors: [Motor; MOTORS],
        outputs: Outputs,
        input_scale: PulseScale,
        loop_rate_hz: u32,
        samples: Producer<'static, Sample, RECORD_QUEUE>,
    ) -> Self {
        Self {
            motors,
            outputs,
            common: Common {
                input_scale,
                silence_limit: super::ticks(INJECT_TIMEOUT_MS, loop_rate_hz),
                rest_limit: super::ticks(REST_MS, loop_rate_hz),
                is_any_driven: false,
            },
            input_pulse: InputPulse::None,
            samples,
            recording: None,
            ticks: 0,
            samples_dropped: 0,
        }
    }

    /// One tick: what the inputs have, to what the ESCs get.
    ///
    /// Integer, without division, heap or panic; every loop is over the motors. What is measured of a motor is asked for after
    /// the motors, and only where it is recorded: a conversion that began with the tick is done by then.
    #[inline]
    pub fn run(
        &mut self,
        readings: [InputReading; MOTORS],
        sensed: impl FnOnce(usize) -> Sensed,
    ) -> [EscCommand; MOTORS] {
        self.ticks = self.ticks.wrapping_add(1);
        for (motor, reading) in self.motors.iter_mut().zip(&readings) {
            motor.run(*reading, &self.common);
        }
        let first_live = readings.iter().find(|reading| reading.is_live());
        let is_any_driven = first_live.is_some() || readings.iter().any(|reading| reading.is_driven());
        self.input_pulse = match first_live {
            None => InputPulse::None,
            Some(reading) if reading.width_ticks().is_none() => InputPulse::Awaited,
            Some(_) => InputPulse::New,
        };
        if is_any_driven != self.common.is_any_driven {
            self.common.is_any_driven = is_any_driven;
            // Somebody drives an input now: a flight controller is there, and somebody may mean to fly.
            if is_any_driven {
                self.stop_excitation();
            }
        }
        if self.outputs == Outputs::Low {
            self.motors.iter_mut().for_each(|motor| motor.output = EscCommand::NO_PULSE);
        }
        self.record(sensed);
        self.motors.each_ref().map(|motor| motor.output)
    }

    /// What the ESCs say of their speed, after a tick: of one motor in turn, whose flight controller has it. [`Self::run`] is apart, for
    /// most protocols have no replies.
    #[inline]
    pub fn correct(&mut self, turn_us: impl FnOnce(usize) -> i32) {
        // As many motors as ticks from one update to the next.
        const { assert!(MOTORS as u32 == TICKS_PER_UPDATE) };
        let index = (self.ticks % TICKS_PER_UPDATE) as usize;
        let Some(motor) = self.motors.get_mut(index) else { return };
        if motor.source == CommandSource::Pulse {
            motor.channel.correct(turn_us(index));
        }
    }

    /// The outputs of the motors that the host drives, and no pulse for all others.
    #[must_use]
    pub fn bench_commands(&self) -> [EscCommand; MOTORS] {
        self.motors.each_ref().map(|motor| if motor.is_bench_driven() { motor.output } else { EscCommand::NO_PULSE })
    }

    /// What the first of the inputs at which pulses come had in the last tick.
    #[must_use]
    #[inline]
    pub const fn input_pulse(&self) -> InputPulse {
        self.input_pulse
    }

    /// Somebody has chosen the settings: pulses may go out.
    pub const fn enable_outputs(&mut self) {
        self.outputs = Outputs::Enabled;
    }

    /// Whether pulses may go out at all.
    #[must_use]
    pub const fn outputs(&self) -> Outputs {
        self.outputs
    }

    #[inline]
    fn record(&mut self, sensed: impl FnOnce(usize) -> Sensed) {
        let Some((index, clock)) = &mut self.recording else { return };
        let index = usize::from(*index);
        let Some(motor) = self.motors.get(index) else { return };
        let Some(tick) = clock.tick() else { return };
        let before = motor.channel.command().to_bits();
        let sample = Sample { tick, input: motor.input, before, after: motor.output.to_bits(), sensed: sensed(index) };
        if self.samples.enqueue(sample).is_err() {
            self.samples_dropped = self.samples_dropped.wrapping_add(1);
        }
    }

    /// The motors.
    #[must_use]
    pub const fn motors(&self) -> &[Motor; MOTORS] {
        &self.motors
    }

    /// One of them.
    pub fn motor_mut(&mut self, index: usize) -> Option<&mut Motor> {
        self.motors.get_mut(index)
    }

    /// New channels, a new meaning of the input's pulses, and a new rate. A host has chosen them, so pulses may go out.
    pub fn reconfigure(&mut self, channels: &[Channel; MOTORS], input_scale: PulseScale, loop_rate_hz: u32) {
        for (motor, channel) in self.motors.iter_mut().zip(channels) {
            motor.restart(channel.clone(), Source::Pulse);
        }
        self.enable_outputs();
        self.common.input_scale = input_scale;
        self.common.silence_limit = super::ticks(INJECT_TIMEOUT_MS, loop_rate_hz);
        self.common.rest_limit = super::ticks(REST_MS, loop_rate_hz);
    }

    /// Holds every output at rest from now until [`Self::resume`] or [`Self::reconfigure`], whatever the inputs say;
    /// afterwards a motor turns only when a disarmed command has come. For what must not be interrupted by somebody who
    /// arms.
    ///
    /// # Errors
    /// The motor that is not at rest; then nothing is changed.
    pub fn pause(&mut self) -> Result<(), u8> {
        if let Some(motor) = self.turning() {
            return Err(motor);
        }
        self.motors.iter_mut().for_each(Motor::pause);
        Ok(())
    }

    /// Ends [`Self::pause`].
    pub fn resume(&mut self) {
        self.motors.iter_mut().for_each(Motor::resume);
    }

    /// The host is there.
    pub fn keep_alive(&mut self) {
        self.motors.iter_mut().for_each(|motor| motor.channel.keep_alive());
    }

    /// Every excitation ends down its ramp.
    pub fn stop_excitation(&mut self) {
        self.motors.iter_mut().for_each(|motor| motor.channel.stop_excitation());
    }

    /// Starts a recording of `motor`, one tick in `divisor`, or with `None` ends it.
    pub fn set_recording(&mut self, recording: Option<(u8, u16)>) {
        self.recording = recording.map(|(motor, divisor)| (motor, RecordClock::new(divisor)));
    }

    /// Whether some motor has its filter in the path.
    #[must_use]
    pub fn compensates(&self) -> bool {
        self.motors.iter().any(|motor| motor.channel.is_enabled())
    }

    /// Whether the next tick may ask for a conversion.
    #[must_use]
    #[inline]
    pub const fn is_recording(&self) -> bool {
        self.recording.is_some()
    }

    /// Whether a flight controller turns a motor.
    pub(super) fn is_flown(&self) -> bool {
        self.motors.iter().any(Motor::is_flown)
    }

    /// Ticks since the start, wrapping.
    #[must_use]
    pub const fn ticks(&self) -> u32 {
        self.ticks
    }

    /// Samples of the recorder that found no room, wrapping.
    #[must_use]
    pub const fn samples_dropped(&self) -> u32 {
        self.samples_dropped
    }

    /// Excitations that ended because the host was silent, wrapping.
    #[must_use]
    pub fn dead_man(&self) -> u32 {
        self.motors.iter().fold(0, |sum, motor| motor.dead_man().wrapping_add(sum))
    }

    /// The first motor whose output was not at rest for [`REST_MS`].
    #[must_use]
    pub fn not_rested(&self) -> Option<u8> {
        let index = self.motors.iter().position(|motor| motor.channel.rest_ticks() < self.common.rest_limit)?;
        Some(index as u8)
    }

    /// The first motor whose output is not at rest.
    #[must_use]
    pub fn turning(&self) -> Option<u8> {
        let index = self.motors.iter().position(|motor| !motor.channel.state().is_at_rest())?;
        Some(index as u8)
    }
}
