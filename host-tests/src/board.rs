//! A board in memory: what the traits of `rotorlead::controller::hardware` ask for, with everything open to a test.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard};

use embedded_storage::nor_flash::NorFlash;
use heapless::spsc::Queue;
use rotorlead::capture::Listening;
use rotorlead::channel::Channel;
use rotorlead::controller::hardware::{
    CaptureTimer, ControlHardware, ControlParts, Edge, InputFrameHardware, OutputHardware, RequestHardware,
    ThrustConverter, TickTimer, Watchdog,
};
use rotorlead::controller::{
    self, BoardFacts, ClockReport, Control, ControlAccess, ControlHandle, Counts, Ends, FrameRates, Inputs, Queues,
    RequestHandler, ResumeSource, Started, Tick,
};
use rotorlead::dshot::{Frame, Line, Offer, ReplyWindow, Word};
use rotorlead::link::{BrownOut, Clock, CrystalCheck, Refusal, ResetReason};
use rotorlead::settings::{MOTORS, Origin, Store, Validated};
use rtic_core::Exclusive;

use crate::line::TIMER_HZ;

/// The clocks of a board whose crystal runs.
pub const CRYSTAL: ClockReport = ClockReport {
    source: Clock::Crystal,
    core_hz: 168_000_000,
    timer_hz: TIMER_HZ,
    timer_as_promised: true,
    crystal: CrystalCheck::NotChecked,
};

/// The clocks of a board without a crystal, with its PLL.
pub const INTERNAL_PLL: ClockReport = ClockReport { source: Clock::InternalPll, ..CRYSTAL };

/// The clocks of a board on which nothing runs but the internal oscillator.
pub const INTERNAL: ClockReport =
    ClockReport { source: Clock::Internal, core_hz: 16_000_000, timer_hz: 16_000_000, ..CRYSTAL };

/// What a board with these clocks says of itself.
#[must_use]
pub const fn facts(clocks: ClockReport) -> BoardFacts {
    let (reset, brown_out) = (ResetReason::PowerOn, BrownOut::Level3);
    BoardFacts { clocks, reset, brown_out, speaks_dshot: true, has_boot_loader: true }
}

/// A timer whose count and edges a test sets, be it in use.
#[derive(Clone, Debug, Default)]
pub struct TestCapture(Arc<Mutex<Captured>>);

/// What a [`TestCapture`] has.
#[derive(Debug, Default)]
pub struct Captured {
    /// Its count.
    pub now: u32,
    /// What it has captured.
    pub edges: [Option<Edge>; MOTORS],
    /// Which edges of the inputs interrupt.
    pub listening: [Listening; MOTORS],
}

impl TestCapture {
    /// What it has.
    ///
    /// # Panics
    /// When a test has panicked with it.
    pub fn get(&self) -> MutexGuard<'_, Captured> {
        self.0.lock().expect("no test panics with it")
    }
}

impl CaptureTimer for TestCapture {
    fn now(&self) -> u32 {
        self.get().now
    }

    fn take(&mut self) -> [Option<Edge>; MOTORS] {
        std::mem::take(&mut self.get().edges)
    }

    fn listen(&mut self, inputs: [Listening; MOTORS]) {
        self.get().listening = inputs;
    }
}

/// The outputs. The counter of their timer goes as a test says.
#[derive(Debug, Default)]
pub struct TestOutputs {
    /// Divider, and counts of a frame.
    pub frames: (u32, u32),
    /// Counts since the frame began.
    pub count: u32,
    /// Widths that the next frame will have, and those of the one that runs.
    pub next_widths: [u32; MOTORS],
    /// Those of the frame that runs.
    pub widths: [u32; MOTORS],
    /// Times at which frames began, in counts since the start; while [`Self::advance`] is called.
    pub starts: Vec<u64>,
    /// The same with the widths of the pulses that began with each.
    pub pulses: Vec<(u64, [u32; MOTORS])>,
    /// Counts since the start.
    pub time: u64,
    /// Counts for which interrupts keep the control task from ending a frame that it has decided to end.
    pub interrupted: u32,
    /// What the outputs' lines have, where these have frames.
    pub line: Option<Line>,
    /// Frames that went out.
    pub sent: [Vec<Frame>; MOTORS],
    /// Whether the outputs take no frame now.
    pub is_busy: bool,
    /// What the outputs were behind frames, and was not taken yet.
    pub windows: [VecDeque<ReplyWindow>; MOTORS],
}

impl TestOutputs {
    /// Lets the counter go on by so many counts.
    pub fn advance(&mut self, counts: u32) {
        let mut left = counts;
        while left > 0 {
            let step = left.min(self.frames.1 - self.count);
            self.time += u64::from(step);
            self.count += step;
            left -= step;
            if self.count >= self.frames.1 {
                self.begin_frame();
            }
        }
    }

    fn begin_frame(&mut self) {
        assert!(
            self.widths.iter().all(|&width| self.count >= width),
            "a pulse is cut or made longer at {}",
            self.count
        );
        self.count = 0;
        self.widths = self.next_widths;
        self.starts.push(self.time);
        self.pulses.push((self.time, self.widths));
    }
}

impl OutputHardware for TestOutputs {
    fn set_frames(&mut self, divider: u32, counts: u32) {
        self.next_widths = [0; MOTORS];
        self.frames = (divider, counts);
        self.line = None;
    }

    fn set_widths(&mut self, counts: [u32; MOTORS]) {
        assert_eq!(self.line, None, "a width for outputs that have frames");
        self.next_widths = counts;
    }

    fn frame_count(&self) -> u32 {
        self.count
    }

    fn restart_frame(&mut self) {
        self.advance(self.interrupted);
        self.begin_frame();
    }

    fn end_frame_at(&mut self, counts: u32) {
        self.advance(self.interrupted);
        self.frames.1 = counts;
        if self.count >= counts {
            self.begin_frame();
        }
    }

    fn set_line(&mut self, line: Line) {
        self.next_widths = [0; MOTORS];
        self.line = Some(line);
    }

    fn can_send(&self, _: usize) -> bool {
        !self.is_busy
    }

    fn send(&mut self, motor: usize, frame: Frame) {
        assert!(self.line.is_some(), "a frame for outputs that have pulses");
        self.sent[motor].push(frame);
    }

    fn take_reply(&mut self, motor: usize) -> Option<ReplyWindow> {
        self.windows[motor].pop_front()
    }
}

/// Frames at the inputs.
#[derive(Debug, Default)]
pub struct TestInputFrames {
    /// What the lines have, where these have frames.
    pub line: Option<Line>,
    /// Words that were not taken yet.
    pub words: [VecDeque<Word>; MOTORS],
    /// Whether inputs have lost words since that was asked last.
    pub take_words_lost: [bool; MOTORS],
    /// What the inputs have offered, one after the other.
    pub offers: [Vec<Offer>; MOTORS],
    /// Whether the last of them went out.
    pub are_taken: [bool; MOTORS],
}

impl InputFrameHardware for TestInputFrames {
    fn set_line(&mut self, line: Option<Line>) {
        self.line = line;
        self.words = Default::default();
    }

    fn take_word(&mut self, motor: usize) -> Option<Word> {
        self.words[motor].pop_front()
    }

    fn take_words_lost(&mut self, motor: usize) -> bool {
        std::mem::take(&mut self.take_words_lost[motor])
    }

    fn offer_reply(&mut self, motor: usize, offer: Offer) {
        assert!(self.line.is_some_and(|line| line.is_bidirectional), "a reply on a line that has none");
        self.offers[motor].push(offer);
        self.are_taken[motor] = false;
    }

    fn is_offer_taken(&self, motor: usize) -> bool {
        self.are_taken[motor]
    }
}

/// The timer of the ticks, which a test makes.
#[derive(Debug, Default)]
pub struct TestTimer {
    /// Ticks per second.
    pub rate_hz: u32,
    /// Whether the next tick is due already.
    pub is_due: bool,
}

impl TickTimer for TestTimer {
    fn set_rate(&mut self, rate_hz: u32) {
        self.rate_hz = rate_hz;
    }

    fn start(&mut self) {}

    fn is_due(&self) -> bool {
        self.is_due
    }
}

/// The converter of the thrust sensor.
#[derive(Debug, Default)]
pub struct TestThrust {
    /// What it gives.
    pub reading: u16,
}

impl ThrustConverter for TestThrust {
    fn start(&mut self) {}

    fn read(&mut self) -> u16 {
        self.reading
    }
}

/// The watchdog.
#[derive(Debug)]
pub struct TestWatchdog {
    /// How often it was fed.
    pub feeds: u32,
    /// Whether it is patient.
    pub patient: bool,
}

impl Watchdog for TestWatchdog {
    fn feed(&mut self) {
        self.feeds += 1;
    }

    fn set_long_timeout(&mut self, patient: bool) {
        self.patient = patient;
    }
}

/// A board in memory, to the control task.
pub enum TestHardware {}

impl ControlHardware for TestHardware {
    type Outputs = TestOutputs;
    type InputFrames = TestInputFrames;
    type Timer = TestTimer;
    type Thrust = TestThrust;
    type Watchdog = TestWatchdog;
}

/// What the lowest priority asks of a board.
#[derive(Clone, Copy, Debug)]
pub struct TestStatus {
    /// What does not change.
    pub facts: BoardFacts,
    /// Whether the jumper is fitted.
    pub bench_enabled: bool,
    /// Bytes that the link has lost.
    pub overruns: u32,
}

impl RequestHardware for TestStatus {
    fn facts(&self) -> BoardFacts {
        self.facts
    }

    fn is_bench_enabled(&mut self) -> bool {
        self.bench_enabled
    }

    fn link_overruns(&self) -> u32 {
        self.overruns
    }

    fn wait_for_watchdog(&mut self) {}
}

/// The board and the controller's parts of the higher priorities.
pub struct TestBoard {
    /// The timer of the inputs.
    pub capture: TestCapture,
    /// The inputs.
    pub inputs: Inputs<TestCapture>,
    /// The control task.
    pub control: Control<TestHardware>,
    /// What the lowest priority asks.
    pub status: TestStatus,
}

impl TestBoard {
    /// Starts a controller with the jumper fitted, from what the flash holds.
    pub fn start<F: NorFlash>(store: Store<F>, facts: BoardFacts) -> (Self, RequestHandler<F>, Origin) {
        Self::start_after_reset(store, facts, None)
    }

    /// The same with memory that has survived a reset.
    pub fn start_after_reset<F: NorFlash>(
        store: Store<F>,
        facts: BoardFacts,
        resume_from: Option<ResumeSource>,
    ) -> (Self, RequestHandler<F>, Origin) {
        // Patient, so that a test sees that a start changes it.
        let capture = TestCapture::default();
        let parts = ControlParts {
            outputs: TestOutputs::default(),
            input_frames: TestInputFrames::default(),
            timer: TestTimer::default(),
            thrust: TestThrust::default(),
            watchdog: TestWatchdog { feeds: 0, patient: true },
        };
        let started: Started<TestCapture, TestHardware, F> =
            controller::start(capture.clone(), parts, store, &facts, queues(), resume_from);
        let Started { inputs, control, handler, origin } = started;
        let status = TestStatus { facts, bench_enabled: true, overruns: 0 };
        (Self { capture, inputs, control, status }, handler, origin)
    }

    /// The state of the control task.
    pub const fn tick_mut(&mut self) -> &mut Tick {
        self.control.tick_mut()
    }

    fn handle(
        &mut self,
    ) -> ControlHandle<'_, Exclusive<'_, Inputs<TestCapture>>, Exclusive<'_, Control<TestHardware>>, TestStatus> {
        ControlHandle {
            inputs: Exclusive(&mut self.inputs),
            control: Exclusive(&mut self.control),
            hardware: &mut self.status,
        }
    }
}

impl ControlAccess for TestBoard {
    fn tick<R>(&mut self, f: impl FnOnce(&mut Tick) -> R) -> R {
        self.handle().tick(f)
    }

    fn reconfigure(&mut self, settings: &Validated, channels: [Channel; MOTORS]) -> Result<(), Refusal> {
        self.handle().reconfigure(settings, channels)
    }

    fn flash_stalls(&mut self, stalls: bool) {
        self.handle().flash_stalls(stalls);
    }

    fn facts(&mut self) -> BoardFacts {
        self.handle().facts()
    }

    fn counts(&mut self) -> Counts {
        self.handle().counts()
    }

    fn frame_rates(&mut self, loop_rate_hz: u32) -> [FrameRates; MOTORS] {
        self.handle().frame_rates(loop_rate_hz)
    }

    fn is_bench_enabled(&mut self) -> bool {
        self.handle().is_bench_enabled()
    }
}

/// Queues that live for the rest of the process, as on the board.
#[must_use]
pub fn queues() -> Queues {
    Queues { inject: std::array::from_fn(|_| queue()), outputs: std::array::from_fn(|_| queue()), samples: queue() }
}

fn queue<T, const N: usize>() -> Ends<T, N> {
    Box::leak(Box::new(Queue::new())).split()
}
