//! A Pico in rp2040js with the image that is flashed: its USB plug is a TCP port, and ESCs with rotors answer at its outputs.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use emulator::rp2040::{
    Bytes, CYCLES_PER_S, Drive, Edge, Flash, Live, Plug, PlugEvent, Question, Region, Responder, Run, Trace, reply,
};
use rotorlead::dshot::{Checksum, Frame, REPLY_BITS, Speed};
use rotorlead::settings::{DEAD_MAN_MS, Settings};
use rotorlead_rp2040::generated::FLASH_START;

use crate::pins::{self, JUMPER, OUTPUT_1, us};
use crate::rotor::{Rotor, TurningRotor};

/// When the controller answers for sure, and the host has set it up.
const STARTED: u64 = 37_500_000;
/// For how long the host's bytes wait for the chip, and the chip's for the host.
const SLICE: Duration = Duration::from_millis(1);
/// A host that has sent nothing for so many slices while a motor turns may be held up by its own machine, and the emulated time waits for it;
/// one that goes on sending nothing is silent.
const HELD_UP_SLICES: u32 = DEAD_MAN_MS / 2;
const SILENT: Duration = Duration::from_secs(3);
/// What ESCs take from the end of a frame to the reply.
const ESC_DELAY_US: f64 = 30.0;
/// Slices for which motors may go on turning when the host is gone: two seconds.
const MOST_SLICES: u32 = 2000;
/// Falls of a line in a frame.
const FRAME_BITS: u32 = 16;
/// Cycles by which an edge may be off.
const SLACK: u64 = 4;
/// Those with replies.
const SPEEDS: [Speed; 3] = [Speed::Dshot150, Speed::Dshot300, Speed::Dshot600];

/// The ESCs at the outputs, with their rotors.
struct Escs(Vec<(TurningRotor, Arc<Motor>)>);

/// What has come to a motor.
#[derive(Debug, Default)]
pub struct Motor {
    /// The last command, and the highest, in millionths.
    last: AtomicU32,
    most: AtomicU32,
}

impl Motor {
    /// The last command.
    #[must_use]
    pub fn last(&self) -> f64 {
        1e-6 * f64::from(self.last.load(Ordering::Relaxed))
    }

    /// The highest command since the start.
    #[must_use]
    pub fn most(&self) -> f64 {
        1e-6 * f64::from(self.most.load(Ordering::Relaxed))
    }
}

impl Escs {
    fn is_turning(&self) -> bool {
        self.0.iter().any(|(_, motor)| motor.last() > 0.0)
    }

    /// What an ESC does behind a frame; nothing behind one that it does not understand.
    fn answer(&mut self, question: &Question) -> Vec<Drive> {
        self.reply(question).unwrap_or_default()
    }

    fn reply(&mut self, question: &Question) -> Option<Vec<Drive>> {
        let [fall, _, next, ..] = question.edges[..] else { return None };
        let (rotor, motor) = self.0.get_mut(usize::from(fall.pin.checked_sub(OUTPUT_1)?))?;
        let bit = next.cycle - fall.cycle;
        let speed = SPEEDS.into_iter().find(|speed| pins::bit_cycles(*speed).abs_diff(bit) <= SLACK)?;
        // The line idles high: the frame is in its lows.
        let lows = question.edges.iter().map(|edge| Edge { is_high: !edge.is_high, ..*edge });
        let frames = pins::frames_in(lows, u64::MAX, speed, SLACK as f64).ok()?;
        let frame = Frame::from_bits(frames.first()?.1, Checksum::Inverted).ok()?;
        let said = rotor.run(motor.last(), fall.cycle as f64 / CYCLES_PER_S as f64);
        let command = (1e6 * frame.value().command().to_f64()).round() as u32;
        motor.last.store(command, Ordering::Relaxed);
        motor.most.fetch_max(command, Ordering::Relaxed);
        Some(reply(speed.bits_per_s(), said?.to_levels(), REPLY_BITS, us(ESC_DELAY_US), 1.0))
    }
}

/// A Pico that runs until it is dropped, while somebody is connected to it.
pub struct LivePico {
    address: String,
    motors: Vec<Arc<Motor>>,
    wishes: Arc<Wishes>,
    thread: Option<JoinHandle<()>>,
}

/// What the test wants of it, and what it has seen.
#[derive(Default)]
struct Wishes {
    stop: AtomicBool,
    unplug: AtomicBool,
    /// Without its power for a moment; taken back when it has started again.
    restart: AtomicBool,
    without_jumper: AtomicBool,
    /// How long motors went on turning behind that, microseconds; [`STILL_TURNING`] before.
    turned_us: AtomicU32,
    /// How long it has run.
    cycles: AtomicU64,
}

const STILL_TURNING: u32 = u32::MAX;

impl LivePico {
    /// Starts one with its jumper fitted, with these settings in its flash or none, and with these rotors from the first output on. Port 0 is
    /// any that is free.
    ///
    /// # Panics
    /// When there is no such port.
    #[must_use]
    pub fn start(port: u16, settings: Option<&Settings>, rotors: &[Rotor]) -> Self {
        let listener = TcpListener::bind(("127.0.0.1", port)).expect("a free port");
        listener.set_nonblocking(true).expect("a listener may not block");
        let address = format!("tcp:{}", listener.local_addr().expect("a bound listener has an address"));
        let wishes = Arc::new(Wishes { turned_us: AtomicU32::new(STILL_TURNING), ..Wishes::default() });
        let motors: Vec<Arc<Motor>> = rotors.iter().map(|_| Arc::default()).collect();
        let escs = Escs(rotors.iter().map(|rotor| rotor.at_rest()).zip(motors.iter().cloned()).collect());
        let (seen, flash) = (Arc::clone(&wishes), settings.map(pins::stored));
        let thread = std::thread::spawn(move || Running::new(flash, escs).serve(&listener, &seen));
        Self { address, motors, wishes, thread: Some(thread) }
    }

    /// `tcp:127.0.0.1:PORT`
    #[must_use]
    pub fn address(&self) -> &str {
        &self.address
    }

    /// What has come to a motor.
    #[must_use]
    pub fn motor(&self, motor: usize) -> &Motor {
        &self.motors[motor]
    }

    /// Whether it has not failed.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }

    /// How long it has run, emulated seconds.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.wishes.cycles.load(Ordering::Relaxed) as f64 / CYCLES_PER_S as f64
    }

    /// The last command of each motor.
    #[must_use]
    pub fn commands(&self) -> Vec<f64> {
        self.motors.iter().map(|motor| motor.last()).collect()
    }

    /// Takes the plug out, for good.
    pub fn unplug(&self) {
        self.wishes.unplug.store(true, Ordering::Relaxed);
    }

    /// Takes the jumper out, or puts it back.
    pub fn fit_jumper(&self, is_fitted: bool) {
        self.wishes.without_jumper.store(!is_fitted, Ordering::Relaxed);
    }

    /// Takes the power away and gives it back, and waits until the chip has started with what is in its flash. Whoever is connected is
    /// disconnected.
    pub fn restart(&self) {
        self.wishes.restart.store(true, Ordering::Relaxed);
        while self.wishes.restart.load(Ordering::Relaxed) && self.is_running() {
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// How many emulated milliseconds after that the last motor was stopped; `None` where one was not.
    #[must_use]
    pub fn turned_ms(&self) -> Option<f64> {
        let turned_us = self.wishes.turned_us.load(Ordering::Relaxed);
        (turned_us != STILL_TURNING).then(|| 1e-3 * f64::from(turned_us))
    }
}

impl Drop for LivePico {
    fn drop(&mut self) {
        self.wishes.stop.store(true, Ordering::Relaxed);
        let joined = self.thread.take().map(JoinHandle::join);
        if let Some(Err(panic)) = joined
            && !std::thread::panicking()
        {
            std::panic::resume_unwind(panic);
        }
    }
}

/// The chip, and what answers it.
struct Running {
    pico: Live,
    escs: Escs,
    is_jumper_fitted: bool,
}

impl Running {
    fn new(flash: Option<Flash>, mut escs: Escs) -> Self {
        let pico = Self::start(flash, &mut escs);
        Self { pico, escs, is_jumper_fitted: true }
    }

    fn start(flash: Option<Flash>, escs: &mut Escs) -> Live {
        let mut run = Run::new(pins::image(), STARTED);
        run.flash.extend(flash);
        run.inputs.push(Edge { cycle: 0, pin: JUMPER, is_high: false });
        run.plug.push(Plug { cycle: 0, what: PlugEvent::Plugged });
        let pins = (OUTPUT_1..).take(escs.0.len());
        run.responders = pins.map(|pin| Responder { pin, falls: FRAME_BITS, answers: None }).collect();
        let started = Live::start(&run, |question| escs.answer(question));
        let (pico, trace) = started.unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(trace.usb_set_ups.len(), 1, "the host has set the device up");
        pico
    }

    /// Starts again with what is in the part of the flash that has the settings.
    fn restart(&mut self) {
        let settings = pins::stored(&Settings::default());
        let region = Region { address: FLASH_START + settings.offset, length: settings.bytes.len() as u32 };
        let mut trace = self.advance(|run, _| run.memory.push(region));
        let bytes = trace.memory.pop().expect("the region was asked for");
        self.pico = Self::start(Some(Flash { bytes, ..settings }), &mut self.escs);
        self.is_jumper_fitted = true;
    }

    /// One client after the other.
    fn serve(&mut self, listener: &TcpListener, wishes: &Wishes) {
        while !wishes.stop.load(Ordering::Relaxed) {
            if wishes.restart.load(Ordering::Relaxed) {
                self.restart();
                wishes.restart.store(false, Ordering::Relaxed);
            }
            match listener.accept() {
                Ok((line, _)) => self.talk(line, wishes),
                Err(_) => std::thread::sleep(Duration::from_millis(2)),
            }
        }
    }

    /// Until the client has gone, or the plug.
    fn talk(&mut self, mut line: TcpStream, wishes: &Wishes) {
        line.set_nonblocking(true).expect("a line may not block");
        let (mut heard, mut silent_slices) = (Instant::now(), 0);
        while !wishes.stop.load(Ordering::Relaxed) {
            if wishes.unplug.load(Ordering::Relaxed) {
                drop(line);
                return self.run_down(wishes);
            }
            if wishes.restart.load(Ordering::Relaxed) {
                return;
            }
            let started = Instant::now();
            let Some(bytes) = received(&mut line) else { return };
            silent_slices += 1;
            if !bytes.is_empty() {
                (heard, silent_slices) = (Instant::now(), 0);
            } else if self.escs.is_turning() && silent_slices > HELD_UP_SLICES && heard.elapsed() < SILENT {
                std::thread::sleep(SLICE);
                continue;
            }
            let is_jumper_fitted = !wishes.without_jumper.load(Ordering::Relaxed);
            let moves = std::mem::replace(&mut self.is_jumper_fitted, is_jumper_fitted) != is_jumper_fitted;
            let trace = self.advance(|run, cycle| {
                run.inputs.extend(moves.then_some(Edge { cycle, pin: JUMPER, is_high: !is_jumper_fitted }));
                if !bytes.is_empty() {
                    run.usb_in.push(Bytes { cycle, bytes });
                }
            });
            wishes.cycles.store(trace.cycles, Ordering::Relaxed);
            if !sent(&mut line, &trace.usb) {
                return;
            }
            // No faster than time, which the host's keep-alives go by.
            std::thread::sleep(SLICE.saturating_sub(started.elapsed()));
        }
    }

    /// With the plug taken out, until the motors stand.
    fn run_down(&mut self, wishes: &Wishes) {
        let mut first = true;
        for slices in 1..MOST_SLICES {
            self.advance(|run, cycle| {
                let what = PlugEvent::Unplugged;
                run.plug.extend(std::mem::take(&mut first).then_some(Plug { cycle, what }));
            });
            if !self.escs.is_turning() {
                return wishes.turned_us.store(SLICE.as_micros() as u32 * slices, Ordering::Relaxed);
            }
        }
    }

    fn advance(&mut self, happens: impl FnOnce(&mut Run, u64)) -> Trace {
        let trace = self.pico.advance(us(SLICE.as_micros() as f64), happens, |question| self.escs.answer(question));
        let trace = trace.unwrap_or_else(|error| panic!("{error}"));
        assert!(trace.faults.is_empty() && trace.resets.is_empty() && trace.conflicts.is_empty(), "{trace:?}");
        trace
    }
}

/// What has come since; `None` where the other side is gone.
fn received(line: &mut TcpStream) -> Option<Vec<u8>> {
    let mut bytes = vec![0; 4096];
    match line.read(&mut bytes) {
        Ok(0) => None,
        Ok(length) => {
            bytes.truncate(length);
            Some(bytes)
        }
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Some(Vec::new()),
        Err(_) => None,
    }
}

/// Whether all of it has gone.
fn sent(line: &mut TcpStream, mut bytes: &[u8]) -> bool {
    while !bytes.is_empty() {
        match line.write(bytes) {
            Ok(length) => bytes = &bytes[length..],
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
                std::thread::sleep(Duration::from_millis(1));
            }
            Err(_) => return false,
        }
    }
    true
}
