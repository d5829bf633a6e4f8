//! The interrupts of the application: the image that would be flashed, driven through its own registers.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;

use rotorlead::capture::{Decoder, Level, PULSES_TO_LIVE, Timing};
use rotorlead::channel::{Channel, Input};
use rotorlead::controller;
use rotorlead::link::{FRAME_BYTES, Info, Message, Receiver, Request, encode};
use rotorlead::settings::{Pulse, PulseProtocol, Settings, Validated};
use rotorlead::throttle::PulseScale;

use super::debugger::Debugger;
use super::inputs::{INPUTS, Inputs};
use super::trace::{Cost, interrupted_at, trace};
use crate::firmware::{CAPTURE, LINK, TICK};
use crate::image::Image;
use crate::run::Result;

/// TIM3 puts out the pulses.
const TIM3_PRESCALER: u32 = 0x4000_0428;
const TIM3_WIDTHS: u32 = 0x4000_0434;
/// Where an interrupt is made pending, and the bit of TIM2's there.
const INTERRUPT_SET_PENDING: u32 = 0xE000_E200;
const TIM2_PENDING: u32 = 1 << 28;
/// SysTick's control, and the core's register in which a request of its interrupt is taken back.
const SYSTICK_CONTROL: u32 = 0xE000_E010;
const INTERRUPT_CONTROL: u32 = 0xE000_ED04;
const SYSTICK_NOT_PENDING: u32 = 1 << 25;

/// Frames until an input is live and disarmed.
const DISARMED_FRAMES: u32 = PULSES_TO_LIVE as u32;
/// Frames that are measured while armed. The command steps in each, so that the compensator works.
const ARMED_FRAMES: u32 = 2;
/// Bytes of the link that are measured: those of a short request and the begin of its answer.
const LINK_BYTES: u32 = 40;
/// Other interrupts that may have begun before they are alone.
const LAST_OTHERS: u32 = 2;

/// Pulses at the inputs: OneShot125 at a frame of 2 and a half ticks, so that little time passes without one.
const INPUT: Pulse = Pulse { protocol: PulseProtocol::OneShot125, frame_hz: 2000 };
/// Their widths in microseconds: disarmed, and armed by turns.
const DISARMED_US: u32 = 125;
const ARMED_US: [u32; 2] = [187, 192];

/// Of several runs of an interrupt.
#[derive(Clone, Copy, Debug, Default)]
pub struct Costs {
    runs: u32,
    instructions: u32,
    /// The dearest.
    pub worst: Cost,
}

impl Costs {
    fn add(&mut self, cost: Cost) {
        self.runs += 1;
        self.instructions += cost.instructions;
        if cost.instructions > self.worst.instructions {
            self.worst = cost;
        }
    }

    /// Mean number of instructions.
    pub fn mean(&self) -> f64 {
        f64::from(self.instructions) / f64::from(self.runs)
    }
}

/// What the application's interrupts cost.
#[derive(Clone, Copy, Debug)]
pub struct Interrupts {
    /// The control tick with one motor armed, and no signal at the others.
    pub tick_1ch: Costs,
    /// The control tick with four motors armed. The dearest is that in which all four have a new pulse.
    pub tick_4ch: Costs,
    /// The ticks around that in which all four arm, which starts their filters.
    pub tick_arming: Costs,
    /// The capture of an edge of one input, and of edges of all four at once.
    pub capture_1: Costs,
    pub capture_4: Costs,
    /// A byte of the link.
    pub link_byte: Costs,
    /// Control ticks per second.
    pub loop_rate_hz: u32,
}

/// The application's own mark that its clock tells pulses apart.
const PULSES_ARE_EXACT: &str = "rotorlead_firmware::wiring::PULSES_ARE_EXACT";

/// Measures them.
pub fn measure(image_path: &Path, image: &Image) -> Result<Interrupts> {
    let mut debugger = Debugger::start(image_path)?;
    let address = |name: &str| {
        let index = image.function_named(name).ok_or_else(|| format!("the image has no interrupt {name}"))?;
        Ok::<_, String>(image.functions[index].address)
    };
    let handlers = Handlers { tick: address(TICK)?, capture: address(CAPTURE)?, link: address(LINK)? };
    debugger.run_to(handlers.tick)?;
    // The emulator has no crystal, and without one the application does not let pulses arm.
    let exact = image.static_named(PULSES_ARE_EXACT).ok_or_else(|| format!("the image has no {PULSES_ARE_EXACT}"))?;
    debugger.set_byte(exact, 1)?;

    let mut settings = Settings::default();
    settings.motors.iter_mut().for_each(|motor| motor.compensate = true);
    settings.input = INPUT;
    // The emulator's timers run several times faster than the clock that the application found, and the longest pulses of
    // the default would not fit the 16 bits of theirs.
    settings.output.protocol = PulseProtocol::OneShot125;
    let info = debugger.run_during(|link| {
        match ask(link, &Request::SetSettings(settings.clone()))? {
            Message::SettingsTaken(_) => {}
            other => return Err(format!("the controller does not take the settings: {other:?}")),
        }
        match ask(link, &Request::Info)? {
            Message::Info(info) => Ok(info),
            other => Err(format!("the controller answers with {other:?}")),
        }
    })?;

    let settings = settings.validate().map_err(|error| error.to_string())?;
    let prescaler = debugger.read(TIM3_PRESCALER)?;
    let library = Library::new(&settings, &info, info.timer_hz / (prescaler + 1))?;
    for handler in [handlers.tick, handlers.capture, handlers.link] {
        debugger.add_breakpoint(handler)?;
    }
    let mut stand = Stand {
        debugger,
        image,
        handlers,
        inputs: Inputs::default(),
        counts_per_us: info.timer_hz / 1_000_000,
        counts_per_tick: info.timer_hz / settings.loop_rate_hz,
        counts_per_frame: info.timer_hz / u32::from(settings.input.frame_hz),
        until_frame: 0,
        library,
    };
    let one = [true, false, false, false];
    stand.fly(one, DISARMED_US, DISARMED_FRAMES)?;
    let one = stand.fly_armed(one)?;
    let four = [true; INPUTS];
    stand.fly(four, DISARMED_US, DISARMED_FRAMES)?;
    let four = stand.fly_armed(four)?;
    let link_byte = stand.link_bytes()?;
    Ok(Interrupts {
        tick_1ch: one.ticks,
        tick_4ch: four.ticks,
        tick_arming: four.arming,
        capture_1: one.captures,
        capture_4: four.captures,
        link_byte,
        loop_rate_hz: settings.loop_rate_hz,
    })
}

/// Sends a request, and waits for the first message.
fn ask(link: &mut TcpStream, request: &Request) -> Result<Message> {
    send(link, request)?;
    let mut receiver = Receiver::<Message>::new();
    let mut byte = [0];
    loop {
        link.read_exact(&mut byte).map_err(|error| format!("the emulated link: {error}"))?;
        if let Some(tagged) = receiver.push(byte[0]) {
            return Ok(tagged.message);
        }
    }
}

fn send(link: &mut TcpStream, request: &Request) -> Result {
    let mut frame = [0; FRAME_BYTES];
    let length = encode(1, request, &mut frame).map_err(|error| error.to_string())?;
    link.write_all(&frame[..length]).map_err(|error| format!("the emulated link: {error}"))
}

/// The same channels on this machine: what was measured must have computed what the library computes.
struct Library {
    decoders: [Decoder; INPUTS],
    channels: [Channel; INPUTS],
    input: PulseScale,
    output: PulseScale,
}

impl Library {
    fn new(settings: &Validated, info: &Info, output_hz: u32) -> Result<Self> {
        let input = settings.input.protocol();
        let timing = Timing::new(input, info.timer_hz, settings.loop_rate_hz).map_err(|error| error.to_string())?;
        let coefficients = controller::coefficients(settings).map_err(|error| error.to_string())?;
        Ok(Self {
            decoders: std::array::from_fn(|_| Decoder::new(timing)),
            channels: controller::channels(settings, coefficients).ok_or("the settings contradict each other")?,
            input: PulseScale::new(input, info.timer_hz).map_err(|error| error.to_string())?,
            output: PulseScale::new(settings.output.protocol(), output_hz).map_err(|error| error.to_string())?,
        })
    }

    fn tick(&mut self, now: u32) -> [u32; INPUTS] {
        let mut widths = [0; INPUTS];
        for ((decoder, channel), width) in self.decoders.iter_mut().zip(&mut self.channels).zip(&mut widths) {
            let input = Input::from_signal(decoder.poll(now), &self.input);
            *width = self.output.to_ticks(channel.tick(input));
        }
        widths
    }
}

/// The application with pulses at its inputs.
struct Stand<'a> {
    debugger: Debugger,
    image: &'a Image,
    handlers: Handlers,
    inputs: Inputs,
    counts_per_us: u32,
    counts_per_tick: u32,
    counts_per_frame: u32,
    /// From now to the rise of the next pulses.
    until_frame: u32,
    library: Library,
}

impl Stand<'_> {
    /// Pulses at some inputs, all at once, for so many frames: what the ticks and the captures cost.
    fn fly(&mut self, who: [bool; INPUTS], width_us: u32, frames: u32) -> Result<(Costs, Costs)> {
        let (mut ticks, mut captures) = (Costs::default(), Costs::default());
        for _ in 0..frames {
            let rise = self.until_frame;
            for (edge, high) in [(rise, true), (width_us * self.counts_per_us, false)] {
                let mut left = edge;
                // Ticks lie on whole multiples of their period.
                loop {
                    let to_tick = self.counts_per_tick - self.inputs.now % self.counts_per_tick;
                    if to_tick > left {
                        break;
                    }
                    left -= to_tick;
                    self.inputs.now += to_tick;
                    ticks.add(self.run_tick()?);
                }
                self.inputs.now += left;
                captures.add(self.run_capture(who, high)?);
            }
            self.until_frame = self.counts_per_frame - width_us * self.counts_per_us;
        }
        Ok((ticks, captures))
    }

    /// As [`Self::fly`], with commands that step up and down.
    fn fly_armed(&mut self, who: [bool; INPUTS]) -> Result<Flight> {
        // The first of these has the tick that arms.
        self.fly(who, ARMED_US[1], 1)?;
        let (arming, _) = self.fly(who, ARMED_US[1], 1)?;
        let (mut ticks, mut captures) = (Costs::default(), Costs::default());
        for frame in 0..ARMED_FRAMES {
            let (tick, capture) = self.fly(who, ARMED_US[frame as usize % 2], 1)?;
            ticks.merge(tick);
            captures.merge(capture);
        }
        Ok(Flight { arming, ticks, captures })
    }

    fn run_tick(&mut self) -> Result<Cost> {
        self.arrive(self.handlers.tick, TICK)?;
        let cost = self.run_interrupt()?;
        let expected = self.library.tick(self.inputs.now);
        for (output, expected) in (0..).zip(expected) {
            let width = self.debugger.read(TIM3_WIDTHS + 4 * output)?;
            if width != expected {
                return Err(format!("output {output} is {width} counts wide, and {expected} by the library"));
            }
        }
        Ok(cost)
    }

    fn run_capture(&mut self, who: [bool; INPUTS], high: bool) -> Result<Cost> {
        self.inputs.edges(who, high);
        for (decoder, _) in self.library.decoders.iter_mut().zip(who).filter(|(_, who)| *who) {
            decoder.edge(self.inputs.now, if high { Level::High } else { Level::Low });
        }
        self.debugger.store(INTERRUPT_SET_PENDING, TIM2_PENDING)?;
        self.arrive(self.handlers.capture, CAPTURE)?;
        let cost = self.run_interrupt()?;
        if self.inputs.pending() { Err("the capture interrupt leaves stamps behind".to_owned()) } else { Ok(cost) }
    }

    /// Goes to the first instruction of an interrupt, which must be the next one that comes.
    fn arrive(&mut self, address: u32, name: &str) -> Result {
        let at = self.next_interrupt()?;
        if at == address { Ok(()) } else { Err(format!("the core came to {at:#x} instead of {name}")) }
    }

    /// Goes to the first instruction of the next interrupt, where the core may be already.
    fn next_interrupt(&mut self) -> Result<u32> {
        Ok(self.debugger.run()?.pc())
    }

    /// Executes an interrupt from its first instruction on. Another may follow it directly.
    fn run_interrupt(&mut self) -> Result<Cost> {
        let Handlers { tick, capture, link } = self.handlers;
        let back = interrupted_at(&mut self.debugger)?;
        trace(&mut self.debugger, self.image, &[back, tick, capture, link], &mut self.inputs)
    }

    /// Interrupts of the link during a request and its answer.
    ///
    /// The ticks are switched off: the emulated time runs on while the debugger thinks, so that on a fast machine the
    /// next tick is due whenever one ends, and the task that writes the answer never gets its turn.
    fn link_bytes(&mut self) -> Result<Costs> {
        self.debugger.store(SYSTICK_CONTROL, 0)?;
        self.debugger.store(INTERRUPT_CONTROL, SYSTICK_NOT_PENDING)?;
        send(self.debugger.link(), &Request::Info)?;
        let mut costs = Costs::default();
        for _ in 0..LINK_BYTES + LAST_OTHERS {
            let at = self.next_interrupt()?;
            let cost = self.run_interrupt()?;
            if at == self.handlers.link {
                costs.add(cost);
            }
            if costs.runs == LINK_BYTES {
                return Ok(costs);
            }
        }
        Err("other interrupts came instead of the link's".to_owned())
    }
}

/// What an armed flight costs.
struct Flight {
    arming: Costs,
    ticks: Costs,
    captures: Costs,
}

/// First instructions of the interrupts.
#[derive(Clone, Copy, Debug)]
struct Handlers {
    tick: u32,
    capture: u32,
    link: u32,
}

impl Costs {
    fn merge(&mut self, other: Self) {
        self.runs += other.runs;
        self.instructions += other.instructions;
        if other.worst.instructions > self.worst.instructions {
            self.worst = other.worst;
        }
    }
}
