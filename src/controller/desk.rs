//! Answers the host.

use embedded_storage::nor_flash::NorFlash;
use heapless::Deque;
use heapless::spsc::{Consumer, Producer};

use super::{INJECT_QUEUE, Motor, RECORD_QUEUE, Tick, channel_settings, channels, coefficients};
use crate::biquad::Coefficients;
use crate::channel::{Channel, Excitation, ExcitationRequest, Refusal as ChannelRefusal, State};
use crate::link::{
    Clock, ExciteRequest, Faults, FrameFaults, INJECT_WINDOW, Info, InjectRequest, Injector, Message, MotorFaults,
    RecordRequest, Recorder, Refusal, Request, ResetReason, Sample, Source, Tagged,
};
use crate::settings::{MOTORS, Origin, Settings, Store, Validated};
use crate::throttle::Command;

/// What only the board knows, for [`Info`].
#[derive(Clone, Copy, Debug)]
pub struct Facts {
    /// Which clock runs.
    pub clock: Clock,
    /// Core clock, hertz.
    pub core_hz: u32,
    /// Clock of the timers, hertz.
    pub timer_hz: u32,
    /// Why it started.
    pub reset: ResetReason,
}

/// What only the board has counted, for [`Faults`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    /// Bytes of the link that were lost.
    pub link_overruns: u32,
    /// Control ticks that began late.
    pub missed_deadlines: u32,
    /// At the inputs.
    pub motors: [MotorFaults; MOTORS],
}

/// The hardware around a [`Desk`].
pub trait Board {
    /// Runs `f` on the control task's state with nobody else at it. Short: the control task waits.
    fn tick<R>(&mut self, f: impl FnOnce(&mut Tick) -> R) -> R;
    /// Sets rates and pulses, and gives the tick its new channels. Every motor is at rest.
    fn reconfigure(&mut self, settings: &Validated, channels: [Channel; MOTORS]) -> Result<(), Refusal>;
    /// The flash will stall the core (`true`), or has done so (`false`).
    fn flash_stalls(&mut self, stalls: bool);
    /// What only the board knows.
    fn facts(&mut self) -> Facts;
    /// What only the board has counted.
    fn counts(&mut self) -> Counts;
}

/// The desk's ends of the queues to the control tick.
pub struct DeskQueues {
    /// Commands to be injected, per motor.
    pub inject: [Producer<'static, Command, INJECT_QUEUE>; MOTORS],
    /// What they came to.
    pub outputs: [Consumer<'static, Command, INJECT_QUEUE>; MOTORS],
    /// The recorder's samples.
    pub samples: Consumer<'static, Sample, RECORD_QUEUE>,
}

/// Takes requests, one at a time, and gives what is to be sent.
pub struct Desk<F> {
    settings: Validated,
    coefficients: Coefficients,
    origin: Origin,
    store: Store<F>,
    queues: DeskQueues,
    injectors: [Injector; MOTORS],
    recorder: Option<(u8, Recorder)>,
    /// A recording that was stopped: the rest of its samples goes out first, then `Done` to the request with this tag.
    stopping: Option<u8>,
    /// Answers that became due while another request was answered.
    owed: Deque<Owed, OWED>,
}

/// An answer to a request that something else has settled.
enum Owed {
    /// A recording was stopped, and another was begun before that was said.
    Done(u8),
    /// An injection was cut short by a change of mode or of the settings.
    NotInjecting(u8),
}

/// Every injection of every motor, and the end of a recording.
const OWED: usize = MOTORS * INJECT_WINDOW + 1;

impl<F: NorFlash> Desk<F> {
    /// With the settings as they were loaded, and the coefficients that they give.
    pub fn new(
        settings: Validated,
        origin: Origin,
        coefficients: Coefficients,
        store: Store<F>,
        queues: DeskQueues,
    ) -> Self {
        let injectors = [const { Injector::new() }; MOTORS];
        let (recorder, stopping, owed) = (None, None, Deque::new());
        Self { settings, coefficients, origin, store, queues, injectors, recorder, stopping, owed }
    }

    /// The settings in use.
    pub const fn settings(&self) -> &Validated {
        &self.settings
    }

    /// Answers a request; `None` when the answer comes later, from [`Self::poll`].
    pub fn answer(
        &mut self,
        request: Tagged<Request>,
        link_faults: FrameFaults,
        board: &mut impl Board,
    ) -> Option<Tagged<Message>> {
        let Tagged { tag, message: request } = request;
        let result = match request {
            Request::Info => Ok(Message::Info(self.info(board))),
            Request::GetSettings => Ok(Message::Settings(Settings::clone(&self.settings))),
            Request::SetSettings(settings) => self.set(settings, board),
            Request::SaveSettings => self.save(board),
            Request::SetMode { motor, source, compensate } => self.set_mode(motor, source, compensate, board),
            Request::Excite(request) => self.excite(&request, board),
            Request::KeepAlive => {
                board.tick(Tick::keep_alive);
                Ok(Message::Done)
            }
            Request::StopExcitation => {
                board.tick(Tick::stop_excitation);
                Ok(Message::Done)
            }
            Request::Record(Some(request)) => self.record(tag, request, board),
            Request::Record(None) => {
                board.tick(|tick| tick.set_recording(None));
                self.settle_stop();
                self.stopping = Some(tag);
                return None;
            }
            Request::Inject(request) => match self.inject(tag, &request, board) {
                Ok(true) => return None,
                Ok(false) => Ok(Message::Done),
                Err(refusal) => Err(refusal),
            },
            Request::Faults => {
                let Counts { link_overruns, missed_deadlines, motors } = board.counts();
                let (record_dropped, dead_man) = board.tick(|tick| (tick.samples_dropped(), tick.dead_man()));
                let link = link_faults;
                Ok(Message::Faults(Faults { link, link_overruns, missed_deadlines, record_dropped, dead_man, motors }))
            }
        };
        Some(Tagged { tag, message: result.unwrap_or_else(Message::Refused) })
    }

    /// What has become ready to be sent since the last call: records, and the outputs of injected commands.
    pub fn poll(&mut self) -> Option<Tagged<Message>> {
        if let Some(owed) = self.owed.pop_front() {
            let (tag, message) = match owed {
                Owed::Done(tag) => (tag, Message::Done),
                Owed::NotInjecting(tag) => (tag, Message::Refused(Refusal::NotInjecting)),
            };
            return Some(Tagged { tag, message });
        }
        for (injector, outputs) in self.injectors.iter_mut().zip(&mut self.queues.outputs) {
            while let Some(output) = outputs.dequeue() {
                if let Some(Tagged { tag, message }) = injector.output(output) {
                    return Some(Tagged { tag, message: Message::Injected(message) });
                }
            }
        }
        while let Some(sample) = self.queues.samples.dequeue() {
            if let Some((tag, recorder)) = &mut self.recorder
                && let Some(record) = recorder.push(sample)
            {
                return Some(Tagged { tag: *tag, message: Message::Record(record) });
            }
        }
        let stopping = self.stopping?;
        if let Some((tag, mut recorder)) = self.recorder.take()
            && let Some(record) = recorder.finish()
        {
            return Some(Tagged { tag, message: Message::Record(record) });
        }
        self.stopping = None;
        Some(Tagged { tag: stopping, message: Message::Done })
    }

    fn info(&self, board: &mut impl Board) -> Info {
        let Facts { clock, core_hz, timer_hz, reset } = board.facts();
        let (ticks, motors) = board.tick(|tick| (tick.ticks(), tick.motors().each_ref().map(|motor| motor.state())));
        let version = |text: &str| text.parse().unwrap_or(0);
        let firmware = [
            version(env!("CARGO_PKG_VERSION_MAJOR")),
            version(env!("CARGO_PKG_VERSION_MINOR")),
            version(env!("CARGO_PKG_VERSION_PATCH")),
        ];
        Info { firmware, clock, core_hz, timer_hz, ticks, reset, settings: self.origin, motors }
    }

    fn set(&mut self, settings: Settings, board: &mut impl Board) -> Result<Message, Refusal> {
        at_rest(board)?;
        let settings = settings.validate().map_err(Refusal::Settings)?;
        let coefficients = coefficients(&settings).map_err(|_| Refusal::Design)?;
        let channels = channels(&settings, coefficients).ok_or(Refusal::Design)?;
        // The design took its time: somebody may have armed meanwhile, and may still.
        pause(board)?;
        let reconfigured = board.reconfigure(&settings, channels);
        board.tick(Tick::resume);
        reconfigured?;
        for motor in 0..MOTORS {
            self.forget_injection(motor);
        }
        self.coefficients = coefficients;
        let warnings = settings.warnings();
        self.settings = settings;
        Ok(Message::SettingsTaken(warnings))
    }

    fn save(&mut self, board: &mut impl Board) -> Result<Message, Refusal> {
        // An erase stalls the core for seconds: nobody may arm between the question and the erase.
        pause(board)?;
        board.flash_stalls(true);
        let saved = self.store.save(&self.settings);
        board.flash_stalls(false);
        board.tick(Tick::resume);
        saved.map_err(|_| Refusal::SaveFailed)?;
        self.origin = Origin::Stored;
        Ok(Message::Done)
    }

    fn set_mode(
        &mut self,
        motor: u8,
        source: Source,
        compensate: bool,
        board: &mut impl Board,
    ) -> Result<Message, Refusal> {
        let index = usize::from(motor);
        if index >= MOTORS {
            return Err(Refusal::UnknownMotor);
        }
        let limits = channel_settings(&self.settings, index);
        let mut channel = Channel::new(&limits, self.coefficients).map_err(|_| Refusal::Design)?;
        channel.set_enabled(compensate);
        board.tick(|tick| {
            let path = tick.motor_mut(index).ok_or(Refusal::UnknownMotor)?;
            // A fresh channel begins at the stop: only where the old one is there, too.
            match path.channel().state() {
                State::Excitation(_) => return Err(Refusal::Exciting),
                State::Armed | State::Holding if path.is_input_armed() => return Err(Refusal::InputArmed),
                state if !state.is_at_rest() => return Err(Refusal::NotDisarmed { motor }),
                _ if source == Source::Inject && path.is_input_armed() => return Err(Refusal::InputArmed),
                _ => {}
            }
            path.restart(channel, source);
            Ok(())
        })?;
        self.forget_injection(index);
        Ok(Message::Done)
    }

    fn excite(&mut self, request: &ExciteRequest, board: &mut impl Board) -> Result<Message, Refusal> {
        let index = usize::from(request.motor);
        let motor = *self.settings.motors.get(index).ok_or(Refusal::UnknownMotor)?;
        let limits = channel_settings(&self.settings, index);
        let lines = request.lines.lines();
        let seconds = lines.period_s().saturating_mul(u32::from(request.periods));
        let max_duration_s = self.settings.excitation.max_duration_s;
        if seconds == 0 || seconds > u32::from(max_duration_s) {
            return Err(Refusal::TooLong { max_duration_s });
        }
        let outside = Refusal::CommandOutsideLimits {
            min_command: motor.idle,
            max_command: limits.excitation.max_command.min(limits.max).to_bits(),
            max_amplitude: limits.excitation.max_amplitude.to_bits(),
        };
        let in_range = 0..=Command::ONE.to_bits();
        if !in_range.contains(&request.nominal) || !in_range.contains(&request.amplitude) {
            return Err(outside);
        }
        let live = Refusal::InputLive { motor: request.motor };
        let refusal = |refusal: ChannelRefusal| match refusal {
            ChannelRefusal::InputLive | ChannelRefusal::InputHeld => live,
            ChannelRefusal::AlreadyRunning | ChannelRefusal::OtherSettings => Refusal::Exciting,
            ChannelRefusal::Duration { .. } => Refusal::TooLong { max_duration_s },
            ChannelRefusal::BelowIdle { .. }
            | ChannelRefusal::AboveMax { .. }
            | ChannelRefusal::AmplitudeTooHigh { .. }
            | ChannelRefusal::Generator(_) => outside,
        };
        let checked = ExcitationRequest {
            lines,
            nominal: Command::saturating_from_bits(request.nominal),
            amplitude: Command::saturating_from_bits(request.amplitude),
            duration_ticks: seconds.saturating_mul(self.settings.loop_rate_hz),
        };
        let excitation = Excitation::new(&limits, &checked, f64::from(self.settings.loop_rate_hz)).map_err(refusal)?;
        board.tick(|tick| {
            let exciting = |state| matches!(state, State::Excitation(_));
            if tick.motors().iter().any(|motor| exciting(motor.channel().state())) {
                return Err(Refusal::Exciting);
            }
            // Whichever it is: with a flight controller at any of the inputs somebody may mean to fly.
            if let Some(motor) = tick.motors().iter().position(Motor::is_input_live) {
                return Err(Refusal::InputLive { motor: motor as u8 });
            }
            tick.motor_mut(index).ok_or(Refusal::UnknownMotor)?.excite(excitation).map_err(refusal)
        })?;
        Ok(Message::Done)
    }

    fn record(&mut self, tag: u8, request: RecordRequest, board: &mut impl Board) -> Result<Message, Refusal> {
        if usize::from(request.motor) >= MOTORS {
            return Err(Refusal::UnknownMotor);
        }
        let divisor = if request.divisor == 0 { self.settings.recorder_divisor } else { request.divisor };
        if u32::from(divisor) > self.settings.loop_rate_hz {
            return Err(Refusal::Divisor);
        }
        board.tick(|tick| tick.set_recording(None));
        while self.queues.samples.dequeue().is_some() {}
        self.settle_stop();
        self.recorder = Some((tag, Recorder::new(request.motor, divisor)));
        board.tick(|tick| tick.set_recording(Some((request.motor, divisor))));
        Ok(Message::Done)
    }

    /// Whether outputs will follow.
    fn inject(&mut self, tag: u8, request: &InjectRequest, board: &mut impl Board) -> Result<bool, Refusal> {
        let index = usize::from(request.motor);
        board.tick(|tick| match tick.motors().get(index) {
            None => Err(Refusal::UnknownMotor),
            Some(motor) if motor.is_input_armed() => Err(Refusal::InputArmed),
            Some(motor) if motor.source() != Source::Inject => Err(Refusal::NotInjecting),
            Some(_) => Ok(()),
        })?;
        let injector = self.injectors.get_mut(index).ok_or(Refusal::UnknownMotor)?;
        let queue = self.queues.inject.get_mut(index).ok_or(Refusal::UnknownMotor)?;
        injector.accept(tag, request)?;
        if request.samples.is_empty() {
            return Ok(false);
        }
        // Only now: a host that sends what cannot be used does not keep a motor running.
        board.tick(|tick| tick.motor_mut(index).map(Motor::expect_commands));
        for &sample in request.samples.as_slice() {
            // The queue holds a whole window, and the injector accepts no more.
            let _ = queue.enqueue(Command::saturating_from_bits(sample));
        }
        Ok(true)
    }

    /// A motor starts afresh: what was under way will not come to anything.
    fn forget_injection(&mut self, motor: usize) {
        let Some(injector) = self.injectors.get_mut(motor) else { return };
        for tag in core::mem::take(injector).tags() {
            // There is room for all that can be under way; whatever was owed before was sent, or is a few older ones.
            let _ = self.owed.push_back(Owed::NotInjecting(tag));
        }
        if let Some(outputs) = self.queues.outputs.get_mut(motor) {
            while outputs.dequeue().is_some() {}
        }
    }

    /// A recording that is being stopped is stopped: another one begins.
    fn settle_stop(&mut self) {
        if let Some(tag) = self.stopping.take() {
            let _ = self.owed.push_back(Owed::Done(tag));
        }
    }
}

/// Every motor stays at the stop until [`Tick::resume`].
fn pause(board: &mut impl Board) -> Result<(), Refusal> {
    board.tick(Tick::pause).map_err(|motor| Refusal::NotDisarmed { motor })
}

fn at_rest(board: &mut impl Board) -> Result<(), Refusal> {
    match board.tick(|tick| tick.turning()) {
        Some(motor) => Err(Refusal::NotDisarmed { motor }),
        None => Ok(()),
    }
}
