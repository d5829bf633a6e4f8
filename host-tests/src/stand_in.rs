//! A controller behind a TCP port: the library's own start, tick and [`RequestHandler`] with a simulated thrust sensor, a clock that
//! may run faster than time, a line that may be slow, and faults on request.
//!
//! What the host's programs talk to here is what they talk to on the board, but for the hardware.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rotorlead::capture::Signal;
use rotorlead::controller::RequestHandler;
use rotorlead::link::{
    FRAME_BYTES, INJECT_WINDOW, Message, NO_TURN, NOTICE_VERSION, Receiver, Request, Sensed, Series, Tagged, VERSION,
    encode,
};
use rotorlead::settings::{MOTORS, Store, Validated};
use rotorlead::throttle::Command;

use crate::board::{CRYSTAL, TestBoard, facts};
use crate::flash::Flash;
use crate::fuzz::frame;

const SECTOR: usize = 2048;
/// Bytes of the board's receive queue; what does not fit is lost.
const RECEIVE_QUEUE: usize = 2048;
/// A thread that was put aside for longer does not make up for it: the controller's time stands still instead, or a
/// busy machine would look like a silent host.
const LONGEST_STEP: Duration = Duration::from_millis(20);
/// How long the first of two requests waits for the second one, where [`Pace::needs_full_window`].
const STARVED_AFTER: Duration = Duration::from_millis(300);

/// What is wrong with a controller or its line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Trouble {
    /// Nothing.
    #[default]
    None,
    /// Nothing is stored in its flash: nobody has chosen the settings.
    BlankFlash,
    /// It receives and does not answer.
    Silent,
    /// It speaks another version.
    OtherVersion,
    /// The tenth record of each recording is lost.
    LosesARecord,
    /// Noise in front of every frame.
    Noise,
    /// One output, of the injected sample of this number, is off by a step of 2^-29.
    WrongOutput(u32),
    /// One recorded command, of this row, is off by a step of 2^-29.
    WrongRow(u32),
    /// The line breaks in place of this record or block of outputs, counted from 0.
    Vanishes(u32),
    /// Keep-alives do not reach it.
    LosesKeepAlives,
    /// It falls silent in place of this record or block of outputs, counted from 0.
    FallsSilent(u32),
}

/// How fast everything goes.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Seconds of the controller per second. The dead-man counts seconds of the host all the same.
    pub speed: f64,
    /// Injected commands are consumed as they come, instead of at the loop's rate.
    pub eager: bool,
    /// Bytes per second that the line carries each way.
    pub bytes_per_s: Option<f64>,
    /// A block of injected commands is consumed only when the window is full. [`StandIn::starved`] counts the blocks
    /// for which it did not become so.
    pub needs_full_window: bool,
}

impl Default for Pace {
    fn default() -> Self {
        Self { speed: 1.0, eager: true, bytes_per_s: None, needs_full_window: false }
    }
}

/// What is around the controller.
pub struct Stand {
    /// Time in seconds, to what the input of motor 0 has.
    pub input: Box<dyn FnMut(f64) -> Signal>,
    /// Of each motor that there is, the command that went to its ESC until now, and the time in seconds, to what is measured of it.
    pub motors: Vec<Box<dyn FnMut(f64, f64) -> Sensed>>,
}

/// What is measured where there is no motor.
const NOTHING: Sensed = Sensed { adc: 0, turn_us: NO_TURN };

/// Timer ticks per second of the input's pulses.
pub use crate::line::TIMER_HZ;

/// A controller that listens until it is dropped, and takes one connection after the other.
pub struct StandIn {
    address: String,
    stop: Arc<AtomicBool>,
    starved: Arc<AtomicUsize>,
    thread: Option<JoinHandle<()>>,
}

impl StandIn {
    /// Starts one, on a stand that is made where it is used.
    ///
    /// # Panics
    /// When this machine has no port left.
    #[must_use]
    pub fn start(trouble: Trouble, pace: Pace, stand: impl FnOnce() -> Stand + Send + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        listener.set_nonblocking(true).expect("a listener may not block");
        let address = format!("tcp:{}", listener.local_addr().expect("a bound listener has an address"));
        let (stop, starved) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicUsize::new(0)));
        let (seen, count) = (Arc::clone(&stop), Arc::clone(&starved));
        let thread = std::thread::spawn(move || {
            let mut controller = Controller::new(trouble, pace, stand(), count);
            while !seen.load(Ordering::Relaxed) {
                match listener.accept() {
                    Ok((line, _)) => controller.serve(line, &seen),
                    Err(_) => std::thread::sleep(Duration::from_millis(2)),
                }
            }
        });
        Self { address, stop, starved, thread: Some(thread) }
    }

    /// `tcp:127.0.0.1:PORT`
    #[must_use]
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Blocks of injected commands that waited in vain for another one behind them.
    #[must_use]
    pub fn starved(&self) -> usize {
        self.starved.load(Ordering::Relaxed)
    }
}

impl Drop for StandIn {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let joined = self.thread.take().map(JoinHandle::join);
        if let Some(Err(panic)) = joined
            && !std::thread::panicking()
        {
            std::panic::resume_unwind(panic);
        }
    }
}

struct Controller {
    trouble: Trouble,
    pace: Pace,
    stand: Stand,
    board: TestBoard,
    handler: RequestHandler<Flash<SECTOR>>,
    receiver: Receiver<Request>,
    /// Blocks of injected commands that were taken from the line and not given to the request handler, and the first one's age.
    held: VecDeque<Tagged<Request>>,
    held_since: Instant,
    starved: Arc<AtomicUsize>,
    /// Frames of records and blocks of outputs, since the start and since the recording or injection began.
    streamed: u32,
    of_this: u32,
    /// The host's seconds since its last sign of life.
    silent: Duration,
    outputs: [f64; MOTORS],
    ticks: u64,
    to_send: VecDeque<u8>,
    gone: bool,
    mute: bool,
}

impl Controller {
    fn new(trouble: Trouble, pace: Pace, stand: Stand, starved: Arc<AtomicUsize>) -> Self {
        let mut store = Store::new(Flash::blank(), Flash::<SECTOR>::SECTORS);
        if trouble != Trouble::BlankFlash {
            store.save(&Validated::default()).expect("a flash without faults");
        }
        let (board, handler, _) = TestBoard::start(store, facts(CRYSTAL));
        Self {
            trouble,
            pace,
            stand,
            board,
            handler,
            receiver: Receiver::new(),
            held: VecDeque::new(),
            held_since: Instant::now(),
            starved,
            streamed: 0,
            of_this: 0,
            silent: Duration::ZERO,
            outputs: [0.0; MOTORS],
            ticks: 0,
            to_send: VecDeque::new(),
            gone: false,
            mute: trouble == Trouble::Silent,
        }
    }

    /// Talks on `line` until it is closed.
    fn serve(&mut self, mut line: TcpStream, stop: &AtomicBool) {
        line.set_nonblocking(false).expect("a line may block");
        line.set_nodelay(true).expect("a line may be prompt");
        line.set_read_timeout(Some(Duration::from_millis(1))).expect("a line may have a time limit");
        self.to_send.clear();
        let mut arriving = VecDeque::new();
        let (mut carried_in, mut carried_out, mut due) = (0.0, 0.0, 0.0);
        let mut last = Instant::now();
        let mut bytes = [0; 4096];
        while !stop.load(Ordering::Relaxed) && !self.gone {
            match line.read(&mut bytes) {
                Ok(0) => return,
                Ok(length) => arriving.extend(&bytes[..length]),
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(_) => return,
            }
            let step = last.elapsed().min(LONGEST_STEP);
            last = Instant::now();
            self.silent += step;
            for byte in carry(&mut arriving, &mut carried_in, self.pace.bytes_per_s, step) {
                if let Some(request) = self.receiver.push(byte) {
                    self.take(request);
                }
            }
            self.release();
            due += step.as_secs_f64() * self.pace.speed * f64::from(self.handler.settings().loop_rate_hz);
            while due >= 1.0 {
                // The recorder's queue holds more than so many.
                let ticks = due.min(100.0) as u32;
                due -= f64::from(ticks);
                self.run(ticks);
            }
            self.poll();
            let out: Vec<u8> = carry(&mut self.to_send, &mut carried_out, self.pace.bytes_per_s, step).collect();
            if line.write_all(&out).is_err() {
                return;
            }
        }
    }

    fn take(&mut self, request: Tagged<Request>) {
        if self.trouble == Trouble::LosesKeepAlives && request.message == Request::KeepAlive {
            return;
        }
        if matches!(request.message, Request::KeepAlive | Request::Excite(_)) {
            self.silent = Duration::ZERO;
        }
        if self.pace.needs_full_window && matches!(request.message, Request::Inject(_)) {
            if self.held.is_empty() {
                self.held_since = Instant::now();
            }
            self.held.push_back(request);
            self.release();
        } else {
            self.answer(request);
        }
    }

    /// Gives held blocks to the request handler: the first as soon as another is behind it, or when that takes too long.
    fn release(&mut self) {
        while self.held.len() >= INJECT_WINDOW || (!self.held.is_empty() && self.held_since.elapsed() > STARVED_AFTER) {
            if self.held.len() < INJECT_WINDOW {
                self.starved.fetch_add(1, Ordering::Relaxed);
            }
            let Some(request) = self.held.pop_front() else { return };
            self.held_since = Instant::now();
            self.answer(request);
        }
    }

    fn answer(&mut self, request: Tagged<Request>) {
        let injected = match &request.message {
            Request::Inject(request) => request.samples.len(),
            _ => 0,
        };
        // Where a recording starts, so do the numbers of its frames.
        if matches!(request.message, Request::Record(Some(_)) | Request::SetMode { .. }) {
            self.of_this = 0;
        }
        let faults = *self.receiver.faults();
        match self.handler.answer(request, faults, &mut self.board) {
            Some(answer) => self.send(answer),
            None if self.pace.eager && injected > 0 => self.run(injected as u32),
            None => {}
        }
    }

    fn run(&mut self, ticks: u32) {
        // Faster than time, a keep-alive is good for as long as it would be for the host.
        if self.pace.speed > 1.0 && self.silent < Duration::from_millis(200) {
            self.board.tick_mut().keep_alive();
        }
        let rate_hz = f64::from(self.handler.settings().loop_rate_hz);
        for _ in 0..ticks {
            self.ticks += 1;
            let time_s = self.ticks as f64 / rate_hz;
            let motors = self.stand.motors.iter_mut().zip(self.outputs);
            let sensed: Vec<Sensed> = motors.map(|(motor, output)| motor(output, time_s)).collect();
            let signals = [(self.stand.input)(time_s), Signal::Nothing, Signal::Nothing, Signal::Nothing];
            let measured = |motor: usize| sensed.get(motor).copied().unwrap_or(NOTHING);
            let outputs = self.board.tick_mut().run(signals.map(Into::into), measured);
            self.outputs = outputs.map(|output| output.command().unwrap_or(Command::ZERO).to_f64());
        }
        self.poll();
    }

    fn poll(&mut self) {
        while let Some(message) = self.handler.poll() {
            self.send(message);
        }
    }

    fn send(&mut self, Tagged { tag, mut message }: Tagged<Message>) {
        if matches!(message, Message::Injected(_) | Message::Record(_)) {
            self.streamed += 1;
            self.of_this += 1;
            match self.trouble {
                Trouble::LosesARecord if self.of_this == 10 => return,
                Trouble::Vanishes(after) if self.streamed > after => self.gone = true,
                Trouble::FallsSilent(after) if self.streamed > after => self.mute = true,
                _ => {}
            }
        }
        match (&mut message, self.trouble) {
            (Message::Injected(injected), Trouble::WrongOutput(at)) => {
                spoil(&mut injected.outputs, at.wrapping_sub(injected.first));
            }
            (Message::Record(record), Trouble::WrongRow(at)) => {
                spoil(&mut record.before, at.wrapping_sub(record.first_tick / u32::from(record.divisor)));
            }
            _ => {}
        }
        if self.gone || self.mute {
            return;
        }
        if self.trouble == Trouble::Noise {
            self.to_send.extend([3, 1, 4, 1, 5, 9, 2, 6, 0, 7, 7]);
        }
        if self.trouble == Trouble::OtherVersion {
            self.to_send.extend(frame(NOTICE_VERSION, tag, &[VERSION + 1]));
            return;
        }
        let mut frame = [0; FRAME_BYTES];
        let length = encode(tag, &message, &mut frame).expect("a message fits its frame");
        self.to_send.extend(&frame[..length]);
    }
}

/// The bytes that a line has carried in `step`: all, or as many as its rate allows.
fn carry<'a>(
    waiting: &'a mut VecDeque<u8>,
    credit: &mut f64,
    bytes_per_s: Option<f64>,
    step: Duration,
) -> impl Iterator<Item = u8> + 'a {
    let count = match bytes_per_s {
        None => waiting.len(),
        Some(rate) => {
            // An idle line saves nothing up.
            *credit = if waiting.is_empty() { 0.0 } else { *credit + rate * step.as_secs_f64() };
            let count = waiting.len().min(*credit as usize).min(RECEIVE_QUEUE);
            *credit -= count as f64;
            count
        }
    };
    waiting.drain(..count)
}

/// Changes sample `index`, where there is one, by a step.
fn spoil<const N: usize>(samples: &mut Series<N>, index: u32) {
    let mut copy = samples.as_slice().to_vec();
    if let Some(sample) = copy.get_mut(index as usize) {
        *sample = Command::saturating_from_bits(*sample ^ 1).to_bits();
        *samples = Series::try_from(&copy[..]).expect("it is as long as it was");
    }
}
