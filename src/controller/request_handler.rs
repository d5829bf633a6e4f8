//! Answers the host.

use embedded_storage::nor_flash::NorFlash;
use heapless::Deque;
use heapless::spsc::{Consumer, Producer};

use super::{
    BoardFacts, ControlAccess, Counts, FrameRates, INJECT_QUEUE, Motor, Outputs, RECORD_QUEUE, ResumeMemory, Tick,
    channel_settings, channels, filters, load,
};
use crate::channel::{Excitation, ExcitationRequest, Refusal as ChannelRefusal, State};
use crate::link::{
    ExciteRequest, Faults, FrameFaults, INJECT_WINDOW, Info, InjectRequest, Injector, MAX_LOAD_PERCENT, Message,
    RecordRequest, Recorder, Refusal, Request, Sample, Source, Tagged,
};
use crate::settings::{MOTORS, Origin, Settings, Store, Validated};
use crate::throttle::{Command, EscCommand};

/// The request handler's ends of the queues to the control tick.
pub struct HandlerQueues {
    /// Commands to be injected, per motor.
    pub inject: [Producer<'static, Command, INJECT_QUEUE>; MOTORS],
    /// What they came to.
    pub outputs: [Consumer<'static, EscCommand, INJECT_QUEUE>; MOTORS],
    /// The recorder's samples.
    pub samples: Consumer<'static, Sample, RECORD_QUEUE>,
}

/// Takes requests, one at a time, and gives what is to be sent.
pub struct RequestHandler<F> {
    settings: Validated,
    origin: Origin,
    store: Store<F>,
    queues: HandlerQueues,
    injectors: [Injector; MOTORS],
    recorder: Option<(u8, Recorder)>,
    /// A recording that was stopped: the rest of its samples goes out first, then `Done` to the request with this tag.
    stopping: Option<u8>,
    /// Replies that became due while another request was answered.
    pending: Deque<PendingReply, PENDING>,
    /// Where the settings are kept over a reset.
    memory: Option<&'static ResumeMemory>,
    /// Which motors have gone on after it.
    resumed: [bool; MOTORS],
    /// The boot loader was asked for, and every motor is held at rest for it.
    is_leaving: bool,
}

/// A reply to a request that something else has settled.
enum PendingReply {
    /// A recording was stopped, and another was begun before that was said.
    Done(u8),
    /// An injection was cut short by a change of mode or of the settings.
    NotInjecting(u8),
}

/// Every injection of every motor, and the end of a recording.
const PENDING: usize = MOTORS * INJECT_WINDOW + 1;

impl<F: NorFlash> RequestHandler<F> {
    /// With the settings as they were loaded.
    pub fn new(settings: Validated, origin: Origin, store: Store<F>, queues: HandlerQueues) -> Self {
        let injectors = [const { Injector::new() }; MOTORS];
        let (recorder, stopping, pending) = (None, None, Deque::new());
        let (memory, resumed) = (None, [false; MOTORS]);
        let is_leaving = false;
        Self { settings, origin, store, queues, injectors, recorder, stopping, pending, memory, resumed, is_leaving }
    }

    /// Memory that survives a reset, in which it keeps the settings, and the motors that have gone on after this one.
    pub(super) const fn set_memory(&mut self, memory: Option<&'static ResumeMemory>, resumed: [bool; MOTORS]) {
        (self.memory, self.resumed) = (memory, resumed);
    }

    /// The settings in use.
    pub const fn settings(&self) -> &Validated {
        &self.settings
    }

    /// Whether the board is to call its boot loader.
    pub(super) const fn is_leaving(&self) -> bool {
        self.is_leaving
    }

    /// Answers a request; `None` when the answer comes later, from [`Self::poll`].
    pub fn answer(
        &mut self,
        request: Tagged<Request>,
        link_faults: FrameFaults,
        board: &mut impl ControlAccess,
    ) -> Option<Tagged<Message>> {
        let Tagged { tag, message: request } = request;
        if self.is_leaving {
            // Whatever would end the pause comes too late: in a moment nobody is there.
            return None;
        }
        let result = match request {
            Request::Info => Ok(Message::Info(self.info(board))),
            Request::GetSettings => Ok(Message::Settings(Settings::clone(&self.settings))),
            Request::SetSettings(settings) => self.set(settings, board),
            Request::SaveSettings => self.save(board),
            Request::SetMode { motor, source, compensate } => self.set_mode(motor, source, compensate, board),
            Request::Excite(request) => self.excite(&request, board),
            Request::KeepAlive => Self::keep_alive(board),
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
                let Counts { link_overruns, missed_deadlines, idle_hangs, motors } = board.counts();
                let (record_dropped, dead_man) = board.tick(|tick| (tick.samples_dropped(), tick.dead_man()));
                let link = link_faults;
                Ok(Message::Faults(Faults {
                    link,
                    link_overruns,
                    missed_deadlines,
                    idle_hangs,
                    record_dropped,
                    dead_man,
                    motors,
                }))
            }
            Request::BootLoader => self.leave(board),
        };
        Some(Tagged { tag, message: result.unwrap_or_else(Message::Refused) })
    }

    /// What has become ready to be sent since the last call: records, and the outputs of injected commands.
    pub fn poll(&mut self) -> Option<Tagged<Message>> {
        if let Some(pending) = self.pending.pop_front() {
            let (tag, message) = match pending {
                PendingReply::Done(tag) => (tag, Message::Done),
                PendingReply::NotInjecting(tag) => (tag, Message::Refused(Refusal::NotInjecting)),
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

    fn info(&self, board: &mut impl ControlAccess) -> Info {
        let BoardFacts { clocks, reset, brown_out, .. } = board.facts();
        let rates = board.frame_rates(self.settings.loop_rate_hz);
        let (ticks, outputs, motors, paths) = board.tick(|tick| {
            let motors = tick.motors().each_ref();
            let mut paths = motors.map(|motor| motor.path());
            for (path, FrameRates { input_hz, output_hz }) in paths.iter_mut().zip(rates) {
                (path.input_hz, path.output_hz) = (input_hz, if path.output < 0 { 0 } else { output_hz });
            }
            (tick.ticks(), tick.outputs(), motors.map(|motor| motor.state()), paths)
        });
        let version = |text: &str| text.parse().unwrap_or(0);
        let firmware = [
            version(env!("CARGO_PKG_VERSION_MAJOR")),
            version(env!("CARGO_PKG_VERSION_MINOR")),
            version(env!("CARGO_PKG_VERSION_PATCH")),
        ];
        Info {
            firmware,
            clock: clocks.source,
            core_hz: clocks.core_hz,
            timer_hz: clocks.timer_hz,
            crystal: clocks.crystal,
            may_arm: clocks.tells_pulses_apart(),
            ticks,
            reset,
            brown_out,
            settings: self.origin,
            outputs_enabled: outputs == Outputs::Enabled,
            bench_enabled: board.is_bench_enabled(),
            motors,
            paths,
            resumed: self.resumed,
        }
    }

    /// The host is there. It is no use where the jumper was taken out meanwhile: what plays ramps down.
    fn keep_alive(board: &mut impl ControlAccess) -> Result<Message, Refusal> {
        if !board.is_bench_enabled() {
            board.tick(Tick::stop_excitation);
            return Err(Refusal::BenchDisabled);
        }
        board.tick(Tick::keep_alive);
        Ok(Message::Done)
    }

    fn set(&mut self, settings: Settings, board: &mut impl ControlAccess) -> Result<Message, Refusal> {
        Self::may_change(board)?;
        let settings = settings.validate().map_err(Refusal::Settings)?;
        let filters = filters(&settings).map_err(|_| Refusal::Design)?;
        let channels = channels(&settings, filters).ok_or(Refusal::Design)?;
        // The design took its time: somebody may have armed meanwhile, and may still.
        pause(board)?;
        let reconfigured = board.reconfigure(&settings, channels);
        if let (Ok(()), Some(memory)) = (&reconfigured, self.memory) {
            memory.write_settings(&settings, Origin::Host, &filters);
        }
        board.tick(Tick::resume);
        reconfigured?;
        for motor in 0..MOTORS {
            self.forget_injection(motor);
        }
        self.origin = Origin::Host;
        let warnings = settings.warnings();
        self.settings = settings;
        Ok(Message::SettingsTaken(warnings))
    }

    fn save(&mut self, board: &mut impl ControlAccess) -> Result<Message, Refusal> {
        Self::may_change(board)?;
        // An erase stalls the core for seconds: nobody may arm between the question and the erase.
        pause(board)?;
        board.flash_stalls(true);
        let saved = self.store.save(&self.settings);
        board.flash_stalls(false);
        if let (Ok(()), Some(memory)) = (&saved, self.memory) {
            memory.set_origin(Origin::Stored);
        }
        board.tick(Tick::resume);
        saved.map_err(|_| Refusal::SaveFailed)?;
        // Who stores the defaults has chosen them.
        board.tick(Tick::enable_outputs);
        self.origin = Origin::Stored;
        Ok(Message::Done)
    }

    fn leave(&mut self, board: &mut impl ControlAccess) -> Result<Message, Refusal> {
        if !board.facts().has_boot_loader {
            return Err(Refusal::NoBootLoader);
        }
        if !board.is_bench_enabled() {
            return Err(Refusal::BenchDisabled);
        }
        // For good, so that nobody arms in between.
        pause(board)?;
        self.is_leaving = true;
        Ok(Message::Done)
    }

    fn set_mode(
        &mut self,
        motor: u8,
        source: Source,
        compensate: bool,
        board: &mut impl ControlAccess,
    ) -> Result<Message, Refusal> {
        let index = usize::from(motor);
        if index >= MOTORS {
            return Err(Refusal::UnknownMotor);
        }
        if source == Source::Inject {
            may_drive(board)?;
        } else if !board.is_bench_enabled() {
            Self::may_change(board)?;
        }
        board.tick(|tick| {
            if source == Source::Inject {
                host_drives_none(tick, Some(index))?;
            }
            let path = tick.motor_mut(index).ok_or(Refusal::UnknownMotor)?;
            // A fresh channel begins at rest: only where the old one is there, too.
            match path.channel().state() {
                State::Excitation(_) => Err(Refusal::Exciting),
                state if !state.is_at_rest() => Err(Refusal::NotDisarmed { motor }),
                _ => {
                    let channel = path.channel().fresh_copy(compensate);
                    path.restart(channel, source);
                    Ok(())
                }
            }
        })?;
        self.forget_injection(index);
        Ok(Message::Done)
    }

    /// Whether a host may change or store anything now: every motor is at rest, and has been for long unless somebody at the board
    /// says that nobody flies.
    fn may_change(board: &mut impl ControlAccess) -> Result<(), Refusal> {
        at_rest(board)?;
        if board.is_bench_enabled() {
            return Ok(());
        }
        match board.tick(|tick| tick.not_rested()) {
            Some(motor) => Err(Refusal::NotRested { motor }),
            None => Ok(()),
        }
    }

    fn excite(&mut self, request: &ExciteRequest, board: &mut impl ControlAccess) -> Result<Message, Refusal> {
        let index = usize::from(request.motor);
        if index >= MOTORS {
            return Err(Refusal::UnknownMotor);
        }
        let limits = channel_settings(&self.settings, index);
        may_drive(board)?;
        let lines = request.lines.lines();
        let seconds = lines.period_s().saturating_mul(u32::from(request.periods));
        let max_duration_s = self.settings.excitation.max_duration_s;
        if seconds == 0 || seconds > u32::from(max_duration_s) {
            return Err(Refusal::TooLong { max_duration_s });
        }
        let (core_hz, loop_rate_hz) = (board.facts().clocks.core_hz, self.settings.loop_rate_hz);
        let ticks_per_period = loop_rate_hz.saturating_mul(lines.period_s());
        let percent = load::percent(lines.per_tick(ticks_per_period), loop_rate_hz, core_hz);
        if percent > MAX_LOAD_PERCENT {
            // Sets of lines are counted in hundreds.
            return Err(Refusal::TooSlow { lines: lines.count() as u16, loop_rate_hz, core_hz, percent });
        }
        let outside = Refusal::CommandOutsideLimits {
            min_command: limits.idle.to_bits(),
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
            host_drives_none(tick, None)?;
            // Making it took its time: pulses may have come up meanwhile.
            no_input_is_live(tick)?;
            tick.motor_mut(index).ok_or(Refusal::UnknownMotor)?.excite(excitation).map_err(refusal)
        })?;
        Ok(Message::Done)
    }

    fn record(&mut self, tag: u8, request: RecordRequest, board: &mut impl ControlAccess) -> Result<Message, Refusal> {
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
    fn inject(&mut self, tag: u8, request: &InjectRequest, board: &mut impl ControlAccess) -> Result<bool, Refusal> {
        let index = usize::from(request.motor);
        let injector = self.injectors.get_mut(index).ok_or(Refusal::UnknownMotor)?;
        let queue = self.queues.inject.get_mut(index).ok_or(Refusal::UnknownMotor)?;
        may_drive(board)?;
        // All at once: a tick in between may end the injection, and would never answer what is queued after it.
        board.tick(|tick| {
            let motor = tick.motor_mut(index).ok_or(Refusal::UnknownMotor)?;
            if motor.source() != Source::Inject {
                return Err(Refusal::NotInjecting);
            }
            injector.accept(tag, request)?;
            let samples = request.samples.as_slice();
            // A host that sends what cannot be used, or nothing, does not keep a motor running.
            if samples.is_empty() {
                return Ok(false);
            }
            motor.expect_commands();
            for &sample in samples {
                // The queue holds a whole window, and the injector accepts no more.
                let _ = queue.enqueue(Command::saturating_from_bits(sample));
            }
            Ok(true)
        })
    }

    /// A motor starts afresh: what was under way will not come to anything.
    fn forget_injection(&mut self, motor: usize) {
        let Some(injector) = self.injectors.get_mut(motor) else { return };
        for tag in core::mem::take(injector).tags() {
            // There is room for all that can be under way; whatever was pending before was sent, or is a few older ones.
            let _ = self.pending.push_back(PendingReply::NotInjecting(tag));
        }
        if let Some(outputs) = self.queues.outputs.get_mut(motor) {
            while outputs.dequeue().is_some() {}
        }
    }

    /// A recording that is being stopped is stopped: another one begins.
    fn settle_stop(&mut self) {
        if let Some(tag) = self.stopping.take() {
            let _ = self.pending.push_back(PendingReply::Done(tag));
        }
    }
}

/// Whether the host may drive a motor: a deliberate act at the board, chosen settings, and no flight controller at any of
/// the inputs, armed or not, with which somebody may mean to fly.
fn may_drive(board: &mut impl ControlAccess) -> Result<(), Refusal> {
    if !board.is_bench_enabled() {
        return Err(Refusal::BenchDisabled);
    }
    board.tick(|tick| {
        if tick.outputs() == Outputs::Low {
            return Err(Refusal::NoSettings);
        }
        no_input_is_live(tick)
    })
}

fn no_input_is_live(tick: &Tick) -> Result<(), Refusal> {
    match tick.motors().iter().position(Motor::is_input_live) {
        // A motor's index.
        Some(motor) => Err(Refusal::InputLive { motor: motor as u8 }),
        None => Ok(()),
    }
}

/// The host drives one motor at a time: that is what somebody at the bench watches, and what the load is computed for.
/// `except`: an injection into this motor does not count.
fn host_drives_none(tick: &Tick, except: Option<usize>) -> Result<(), Refusal> {
    for (index, motor) in tick.motors().iter().enumerate() {
        if matches!(motor.channel().state(), State::Excitation(_)) {
            return Err(Refusal::Exciting);
        }
        if motor.is_injected() && except != Some(index) {
            // A motor's index.
            return Err(Refusal::Injecting { motor: index as u8 });
        }
    }
    Ok(())
}

/// Every motor stays at rest until [`Tick::resume`].
fn pause(board: &mut impl ControlAccess) -> Result<(), Refusal> {
    board.tick(Tick::pause).map_err(|motor| Refusal::NotDisarmed { motor })
}

fn at_rest(board: &mut impl ControlAccess) -> Result<(), Refusal> {
    match board.tick(|tick| tick.turning()) {
        Some(motor) => Err(Refusal::NotDisarmed { motor }),
        None => Ok(()),
    }
}
