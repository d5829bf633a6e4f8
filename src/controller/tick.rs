//! The control tick of all motors.

use heapless::spsc::{Consumer, Producer};

use crate::capture::Signal;
use crate::channel::{Channel, Excitation, Input, Refusal as ChannelRefusal, State};
use crate::link::{
    ChannelState, INJECT_SAMPLES, INJECT_TIMEOUT_MS, INJECT_WINDOW, NO_INPUT, RecordClock, Sample, Source,
};
use crate::settings::MOTORS;
use crate::throttle::{Command, PulseScale};

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
    pub outputs: Producer<'static, Command, INJECT_QUEUE>,
}

/// What drives a motor.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Feed {
    /// The flight controller's pulses.
    Pulse,
    /// The host's commands.
    Inject,
    /// An injection that is over, since the host went away or a real input is armed: as after the loss of an input, to
    /// the stop; then the pulses again.
    Ending,
    /// Nothing: the output is at the stop. Afterwards as before.
    Paused(Source),
}

/// One motor: its channel, and where its commands come from.
pub struct Motor {
    channel: Channel,
    feed: Feed,
    queues: MotorQueues,
    /// Ticks since the last injected command.
    silent_ticks: u32,
    /// The last output.
    output: Command,
    /// The pulse input as a command, while there is one.
    input: i32,
    /// Whether the filter is in the path of the pulses: what an injection does with it ends with the injection.
    compensates: bool,
    /// Excitations of former channels that ended because the host was silent.
    dead_man: u32,
}

impl Motor {
    /// A motor that takes its commands from its pulses.
    #[must_use]
    pub const fn new(channel: Channel, queues: MotorQueues) -> Self {
        let output = channel.settings().stop;
        let compensates = channel.is_enabled();
        Self { channel, feed: Feed::Pulse, queues, silent_ticks: 0, output, input: NO_INPUT, compensates, dead_man: 0 }
    }

    /// The channel.
    #[must_use]
    pub const fn channel(&self) -> &Channel {
        &self.channel
    }

    /// Where the commands come from.
    #[must_use]
    pub const fn source(&self) -> Source {
        match self.feed {
            Feed::Pulse | Feed::Ending => Source::Pulse,
            Feed::Inject => Source::Inject,
            Feed::Paused(source) => source,
        }
    }

    /// Whether pulses come at its input, or came until a moment ago, whatever drives it.
    #[must_use]
    pub const fn is_input_live(&self) -> bool {
        self.input != NO_INPUT || matches!(self.channel.state(), State::Holding)
    }

    /// Whether pulses come at its input that mean a spinning motor, whatever drives it.
    #[must_use]
    pub const fn is_input_armed(&self) -> bool {
        self.input >= self.channel.settings().arming_threshold.to_bits()
    }

    /// Starts afresh, with a new channel and with nothing left in the queues.
    pub fn restart(&mut self, channel: Channel, source: Source) {
        self.dead_man = self.dead_man();
        self.channel = channel;
        self.feed = match source {
            Source::Pulse => {
                self.compensates = self.channel.is_enabled();
                Feed::Pulse
            }
            Source::Inject => Feed::Inject,
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
        if self.feed != Feed::Pulse {
            return Err(ChannelRefusal::AlreadyRunning);
        }
        self.channel.start_excitation(excitation)
    }

    /// Commands were accepted that are to be injected: the host is there.
    pub const fn expect_commands(&mut self) {
        self.silent_ticks = 0;
    }

    /// Holds the output at the stop.
    fn pause(&mut self) {
        self.feed = Feed::Paused(self.source());
        self.channel.lock();
    }

    fn resume(&mut self) {
        if let Feed::Paused(source) = self.feed {
            self.feed = match source {
                Source::Pulse => {
                    // It may have been an ending injection that was paused.
                    self.channel.set_enabled(self.compensates);
                    Feed::Pulse
                }
                Source::Inject => Feed::Inject,
            };
        }
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

    #[inline]
    fn run(&mut self, signal: Signal, scale: &PulseScale, silence_limit: u32) {
        let input = Input::from_signal(signal, scale);
        match input {
            Input::Command(command) => self.input = command.to_bits(),
            Input::Unchanged => {}
            Input::Nothing | Input::Lost => self.input = NO_INPUT,
        }
        self.output = match self.feed {
            Feed::Pulse => self.channel.tick(input),
            _ => self.without_pulses(silence_limit),
        };
    }

    #[inline(never)]
    fn without_pulses(&mut self, silence_limit: u32) -> Command {
        match self.feed {
            Feed::Inject if !self.is_input_armed() => self.injected(silence_limit),
            Feed::Inject | Feed::Ending => self.end_injection(),
            Feed::Paused(_) | Feed::Pulse => self.channel.settings().stop,
        }
    }

    /// One injected command. Without any, the last output stands: no tick, so that outputs do not depend on when frames
    /// arrive. A host that stays away loses the motor, which stops.
    fn injected(&mut self, silence_limit: u32) -> Command {
        if let Some(command) = self.queues.inject.dequeue() {
            self.silent_ticks = 0;
            let output = self.channel.tick(Input::Command(command));
            // The queue has room for every command that was accepted.
            let _ = self.queues.outputs.enqueue(output);
            return output;
        }
        self.silent_ticks = self.silent_ticks.saturating_add(1);
        if self.silent_ticks < silence_limit {
            return self.output;
        }
        self.end_injection()
    }

    /// The channel goes through its hold time to the stop; a disarmed pulse takes it there at once. An armed one must
    /// not: the motor would go on from the host's command to the flight controller's without ever having stopped.
    /// Commands that are still queued are answered with what went out in their place.
    fn end_injection(&mut self) -> Command {
        let is_disarmed = self.input != NO_INPUT && !self.is_input_armed();
        let pulse = Command::saturating_from_bits(self.input);
        let output = self.channel.tick(if is_disarmed { Input::Command(pulse) } else { Input::Lost });
        let is_queue_empty = self.queues.inject.dequeue().is_none();
        if !is_queue_empty {
            let _ = self.queues.outputs.enqueue(output);
        }
        let is_over = is_queue_empty && self.channel.state().is_at_rest();
        if is_over {
            self.channel.set_enabled(self.compensates);
        }
        self.feed = if is_over { Feed::Pulse } else { Feed::Ending };
        output
    }
}

/// The state of the control task.
pub struct Tick {
    motors: [Motor; MOTORS],
    input_scale: PulseScale,
    silence_limit: u32,
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
        input_scale: PulseScale,
        loop_rate_hz: u32,
        samples: Producer<'static, Sample, RECORD_QUEUE>,
    ) -> Self {
        let silence_limit = super::ticks(INJECT_TIMEOUT_MS, loop_rate_hz);
        Self { motors, input_scale, silence_limit, samples, recording: None, ticks: 0, samples_dropped: 0 }
    }

    /// One tick: what the inputs have, to what the ESCs get.
    ///
    /// Integer, without division, heap or panic; every loop is over the motors. The signals, one for each motor, are taken
    /// one by one, each on its way to its motor. The converter's count is asked for after the motors, and only where it
    /// is recorded: a conversion that began with the tick is done by then.
    #[inline]
    pub fn run(&mut self, signals: impl IntoIterator<Item = Signal>, adc: impl FnOnce() -> u16) -> [Command; MOTORS] {
        self.ticks = self.ticks.wrapping_add(1);
        for (motor, signal) in self.motors.iter_mut().zip(signals) {
            motor.run(signal, &self.input_scale, self.silence_limit);
        }
        self.record(adc);
        self.motors.each_ref().map(|motor| motor.output)
    }

    #[inline]
    fn record(&mut self, adc: impl FnOnce() -> u16) {
        let Some((index, clock)) = &mut self.recording else { return };
        let Some(motor) = self.motors.get(usize::from(*index)) else { return };
        let Some(tick) = clock.tick() else { return };
        let before = motor.channel.command().to_bits();
        let sample = Sample { tick, input: motor.input, before, after: motor.output.to_bits(), adc: adc() };
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

    /// New channels, a new meaning of the input's pulses, and a new rate.
    pub fn reconfigure(&mut self, channels: [Channel; MOTORS], input_scale: PulseScale, loop_rate_hz: u32) {
        for (motor, channel) in self.motors.iter_mut().zip(channels) {
            motor.restart(channel, Source::Pulse);
        }
        self.input_scale = input_scale;
        self.silence_limit = super::ticks(INJECT_TIMEOUT_MS, loop_rate_hz);
    }

    /// Holds every output at the stop from now until [`Self::resume`] or [`Self::reconfigure`], whatever the inputs say;
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

    /// The host is there. Where pulses have come up at any input meanwhile, a flight controller is, too, and excitations
    /// end: they are not begun then either.
    pub fn keep_alive(&mut self) {
        if self.motors.iter().any(Motor::is_input_live) {
            return self.stop_excitation();
        }
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

    /// The first motor whose output is not at rest.
    #[must_use]
    pub fn turning(&self) -> Option<u8> {
        let index = self.motors.iter().position(|motor| !motor.channel.state().is_at_rest())?;
        Some(index as u8)
    }
}
