//! The interrupts of the application: the image that would be flashed, driven through its own registers.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::Duration;

use emulator::{Debugger, Process};
use rotorlead::capture::{Decoder, Level, PULSES_TO_LIVE};
use rotorlead::channel::{COMMANDS_TO_ARM, Channel, Excitation, ExcitationRequest, Input, Phase, State};
use rotorlead::controller::{self, Frames, Plan, channel_settings};
use rotorlead::design::{CurvePoint, RotorCurve};
use rotorlead::link::{ExciteRequest, FRAME_BYTES, LineSet, Message, Receiver, RecordRequest, Request, Source, encode};
use rotorlead::settings::{CompensatorKind, Pulse, PulseProtocol, Settings, Validated};
use rotorlead::throttle::{Command, PulseScale};

use super::inputs::{INPUTS, Inputs};
use super::machine::Machine;
use super::trace::{Cost, Locked, interrupted_at, locks, trace, trace_lock};
use crate::image::Image;
use crate::run::Result;

/// The capture of the inputs, the control task, and the link's bytes, as the vector table has them.
const CAPTURE: &str = "TIM2";
const TICK: &str = "SysTick";
const LINK: &str = "USART3";
/// TIM3 puts out the pulses.
const TIM3_PRESCALER: u32 = 0x4000_0428;
const TIM3_WIDTHS: u32 = 0x4000_0434;
/// Where an interrupt is made pending, and the bit of TIM2's there.
const INTERRUPT_SET_PENDING: u32 = 0xE000_E200;
const TIM2_PENDING: u32 = 1 << 28;
/// Priorities of the interrupts, a byte each by their numbers, and that of SysTick. The upper 4 bits of each count.
const INTERRUPT_PRIORITIES: u32 = 0xE000_E400;
const USART3: u32 = 39;
const TIM2: u32 = 28;
const SYSTICK_PRIORITY: u32 = 0xE000_ED23;
const PRIORITY_UNUSED_BITS: u32 = 4;
/// The link's control, its bits that have the UART ask for bytes to send, and how often and for how long it is looked for
/// the last one.
const USART3_CONTROL: u32 = 0x4000_480C;
const USART3_SENDS: u32 = 1 << 7 | 1 << 6;
const LAST_BYTE_LOOKS: u32 = 200;
const LAST_BYTE_LOOK: Duration = Duration::from_millis(5);
/// SysTick's control, and the core's register in which a request of its interrupt is taken back.
const SYSTICK_CONTROL: u32 = 0xE000_E010;
const SYSTICK_ON: u32 = 0b111;
const INTERRUPT_CONTROL: u32 = 0xE000_ED04;
const SYSTICK_NOT_PENDING: u32 = 1 << 25;

/// Frames until an input is live and its motor disarmed: the first pulse that counts is the second one.
const DISARMED_FRAMES: u32 = PULSES_TO_LIVE as u32 + 2;
/// Frames that are measured while armed. The command steps in each, so that the compensator works.
const ARMED_FRAMES: u32 = 2;
/// Frames with one command until it is kept for a reset: that takes 12 ticks at most.
const KEPT_FRAMES: u32 = 8;
/// Bytes of the link that are measured: those of a short request and the begin of its answer.
const LINK_BYTES: u32 = 40;
/// Bytes each way at once that are measured.
const BUSY_BYTES: u32 = 4;
/// Other interrupts that may have begun before they are alone.
const LAST_OTHERS: u32 = 2;

/// Ticks of an excitation that are measured: a round of what is not done in every tick. And those after which it must play.
const EXCITATION_TICKS: u32 = 9;
const RAMP_TICKS: u32 = 100;
/// A rate at which a core at 16 MHz plays every set of lines. What a tick executes depends on it by the lines that it sums alone.
const EXCITATION_RATE_HZ: u32 = 1200;
/// How long the lowest priority is given for a request, once nothing else runs.
const REQUEST_LIMIT: Duration = Duration::from_secs(3);

/// Pulses at the inputs: OneShot125 at a frame of 2 and a half ticks, so that little time passes without one. Those of the
/// outputs follow them.
const INPUT: Pulse = Pulse { protocol: PulseProtocol::OneShot125, frame_hz: 2000 };
const OUTPUT: Pulse = Pulse { protocol: PulseProtocol::OneShot125, frame_hz: 2200 };
/// Their widths in microseconds: disarmed, and armed by turns.
const DISARMED_US: u32 = 125;
const ARMED_US: [u32; 2] = [187, 192];
/// A motor that is armed for no longer than this is not held, and its ticks are those that arm: with the commands that do, so many
/// frames.
const HOLD_MS: u16 = 2;
const ARMING_FRAMES: u32 = COMMANDS_TO_ARM as u32 + 2 * HOLD_MS as u32 + 3;

/// Of several runs of an interrupt.
#[derive(Clone, Copy, Debug, Default)]
pub struct Costs {
    runs: u32,
    instructions: u32,
    /// The one with the most instructions.
    pub worst: Cost,
    /// The longest locks.
    pub locked: Locked,
    /// The latest taking of a byte of the link.
    pub byte_taken: u32,
}

impl Costs {
    fn add(&mut self, cost: Cost) {
        self.runs += 1;
        self.instructions += cost.instructions;
        self.locked = self.locked.max(cost.locked);
        self.byte_taken = self.byte_taken.max(cost.byte_taken);
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
    /// The control tick with four motors armed. The longest is that in which all four have a new pulse.
    pub tick_4ch: Costs,
    /// The ticks around that in which all four arm, which starts their filters.
    pub tick_arming: Costs,
    /// The same two with the inverse in each path.
    pub tick_4ch_inverse: Costs,
    /// [`Self::tick_4ch`] with a lead that has a slew limit.
    pub tick_4ch_slew: Costs,
    pub tick_arming_inverse: Costs,
    /// The capture of an edge of one input, and of edges of all four at once.
    pub capture_1: Costs,
    pub capture_4: Costs,
    /// A byte of the link.
    pub link_byte: Costs,
    /// A byte each way in one interrupt, and one that was lost: the longest that there is.
    pub link_both: Costs,
    /// The control tick of an excitation that is recorded, which sums so many lines.
    pub excitations: [(u32, Costs); 2],
    /// The same with the inverse in the path, and the more lines.
    pub excitation_inverse: (u32, Costs),
    /// What the lowest priority locks for a request in flight, and for those that are refused unless all motors are at rest.
    pub requests: Locked,
    pub requests_at_rest: Locked,
    /// Control ticks per second.
    pub loop_rate_hz: u32,
}

impl Interrupts {
    /// Cycles of one line more, estimated.
    pub fn cycles_per_line(&self) -> f64 {
        let [(few, cheap), (many, dear)] = &self.excitations;
        f64::from(dear.worst.cycles - cheap.worst.cycles) / f64::from(many - few)
    }
}

/// Commands of the paper's operating points, and the motor's poles there, rad/s (Table 1).
const PAPER_POLES_RAD_S: [(f64, f64); 6] =
    [(0.40, 6.2758), (0.45, 7.3524), (0.50, 9.2889), (0.55, 9.9130), (0.60, 11.7439), (0.65, 14.1275)];

/// Where a start and the handler of faults begin.
const RESET: &str = "Reset";
const FAULT: &str = "HardFault";
/// What judges the clock.
const JUDGES_CLOCK: &str = "rotorlead::controller::clock::ClockReport::tells_pulses_apart";
/// A function that says yes: `movs r0, #1` and `bx lr`.
const YES: u32 = 0x4770_2001;

/// Measures them.
pub fn measure(image_path: &Path, image: &Image) -> Result<Interrupts> {
    let settings = flight_settings();
    let mut stand = Stand::new(image_path, image, &settings)?;
    check_priorities(&mut stand.debugger)?;
    let one = [true, false, false, false];
    stand.fly(one, DISARMED_US, DISARMED_FRAMES)?;
    let one = stand.fly_armed(one)?;
    let four = [true; INPUTS];
    stand.fly(four, DISARMED_US, DISARMED_FRAMES)?;
    let four = stand.fly_armed(four)?;
    let (link_byte, link_both) = stand.link_bytes()?;
    drop(stand);
    resume_after_fault(image_path, image)?;
    let slew = Settings { slew_per_s: Settings::default().slew_per_s, ..flight_settings() };
    let slew = measure_limited(image_path, image, &slew)?;
    let inverse = measure_limited(image_path, image, &with_inverse(flight_settings())?)?;
    let (requests, requests_at_rest) = measure_requests(image_path, image)?;
    Ok(Interrupts {
        tick_1ch: one.ticks,
        tick_4ch: four.ticks,
        tick_arming: four.arming,
        tick_4ch_slew: slew.ticks,
        tick_4ch_inverse: inverse.ticks,
        tick_arming_inverse: inverse.arming,
        capture_1: one.captures,
        capture_4: four.captures,
        link_byte,
        link_both,
        excitations: [
            measure_excitation(image_path, image, &excitation_settings(), LineSet::Odd30Hz)?,
            measure_excitation(image_path, image, &excitation_settings(), LineSet::Odd45Hz)?,
        ],
        excitation_inverse: measure_excitation(
            image_path,
            image,
            &with_inverse(excitation_settings())?,
            LineSet::Odd45Hz,
        )?,
        requests,
        requests_at_rest,
        loop_rate_hz: settings.loop_rate_hz,
    })
}

/// Settings of a flight with the lead without a slew limit in every path, and a hold that is soon earned.
fn flight_settings() -> Settings {
    let mut settings = Settings { input: INPUT, output: OUTPUT, slew_per_s: 0.0, ..Settings::default() };
    settings.motors.iter_mut().for_each(|motor| (motor.compensate, motor.hold_ms) = (true, HOLD_MS));
    settings
}

/// The same settings with the inverse of the paper's motors.
pub(super) fn with_inverse(mut settings: Settings) -> Result<Settings> {
    let points = PAPER_POLES_RAD_S.map(|(command, pole)| CurvePoint { command, tau_s: 1.0 / pole });
    let curve = RotorCurve::through(&points).map_err(|error| error.to_string())?;
    settings.compensator = CompensatorKind::Inverse;
    settings.slew_per_s = Settings::default().slew_per_s;
    settings.motors.iter_mut().for_each(|motor| motor.curve = Some(curve));
    Ok(settings)
}

/// Ticks of four motors with a slew limit in every path. The commands step by more than it allows in a tick, so that it limits
/// some outputs.
fn measure_limited(image_path: &Path, image: &Image, settings: &Settings) -> Result<Flight> {
    let mut stand = Stand::new(image_path, image, settings)?;
    let four = [true; INPUTS];
    stand.fly(four, DISARMED_US, DISARMED_FRAMES)?;
    stand.fly_armed(four)
}

/// A fault in flight: the first tick after it puts out the commands that came last.
fn resume_after_fault(image_path: &Path, image: &Image) -> Result {
    let mut stand = Stand::new(image_path, image, &flight_settings())?;
    let four = [true; INPUTS];
    stand.fly(four, DISARMED_US, DISARMED_FRAMES)?;
    stand.fly_armed(four)?;
    stand.fly(four, ARMED_US[1], KEPT_FRAMES)?;
    let held = stand.library.output_scale.to_width_ticks(stand.command(ARMED_US[1]).into());
    stand.fault()?;
    stand.arrive(stand.handlers.tick, TICK)?;
    stand.run_interrupt()?;
    check_widths(&mut stand.debugger, [held; INPUTS])?;
    println!("after a fault in flight the first tick puts out the last commands, pulses of {held} counts");
    Ok(())
}

/// Runs while `meanwhile` asks over the link, and on until the controller has nothing more to send: the interrupt of an
/// answer's last byte comes after the byte.
fn converse<T>(debugger: &mut Debugger, meanwhile: impl FnOnce() -> Result<T>) -> Result<T> {
    let result = debugger.run_during(meanwhile)?;
    for _ in 0..LAST_BYTE_LOOKS {
        if debugger.read(USART3_CONTROL)? & USART3_SENDS == 0 {
            return Ok(result);
        }
        debugger.run_during(|| {
            std::thread::sleep(LAST_BYTE_LOOK);
            Ok(())
        })?;
    }
    Err(format!("{LINK} does not come to the end of an answer"))
}

/// Sets them over the link, and gives the frequency of the timers.
fn set(debugger: &mut Debugger, link: &mut TcpStream, settings: &Settings) -> Result<u32> {
    converse(debugger, || {
        match ask(link, &Request::SetSettings(settings.clone()))? {
            Message::SettingsTaken(_) => {}
            other => return Err(format!("the controller does not take the settings: {other:?}")),
        }
        match ask(link, &Request::Info)? {
            Message::Info(info) => Ok(info.timer_hz),
            other => Err(format!("the controller answers with {other:?}")),
        }
    })
}

/// Stops the control ticks.
fn stop_ticks(debugger: &mut Debugger) -> Result {
    debugger.store(SYSTICK_CONTROL, 0)?;
    debugger.store(INTERRUPT_CONTROL, SYSTICK_NOT_PENDING)
}

/// For an excitation that begins soon after it was asked for.
fn excitation_settings() -> Settings {
    let mut settings = Settings { loop_rate_hz: EXCITATION_RATE_HZ, ..Settings::default() };
    settings.motors.iter_mut().for_each(|motor| motor.compensate = true);
    settings.excitation.arm_ms = 0;
    settings.excitation.ramp_ms = 100;
    settings
}

fn excite_request(lines: LineSet) -> ExciteRequest {
    let bits = |command| Command::saturating_from_f64(command).to_bits();
    ExciteRequest { motor: 0, lines, nominal: bits(0.2), amplitude: bits(0.05), periods: 1 }
}

/// Number of the lines, and what control ticks cost in which motor 0 plays them, through its compensator, and is recorded.
/// Its pulses are held against the library's.
fn measure_excitation(image_path: &Path, image: &Image, settings: &Settings, lines: LineSet) -> Result<(u32, Costs)> {
    let Machine { mut debugger, mut link, qemu: _qemu } = Machine::start(image_path)?;
    let handlers = Handlers::from_image(image)?;
    debugger.run_to(handlers.tick)?;
    let timer_hz = set(&mut debugger, &mut link, settings)?;
    // The first tick that is measured is the excitation's first.
    stop_ticks(&mut debugger)?;
    let request = excite_request(lines);
    converse(&mut debugger, || {
        for request in [Request::Record(Some(RecordRequest { motor: 0, divisor: 1 })), Request::Excite(request)] {
            match ask(&mut link, &request)? {
                Message::Done => {}
                other => return Err(format!("the controller answers {request:?} with {other:?}")),
            }
        }
        Ok(())
    })?;
    for handler in [handlers.tick, handlers.link] {
        debugger.add_breakpoint(handler)?;
    }
    debugger.store(SYSTICK_CONTROL, SYSTICK_ON)?;

    let settings = settings.clone().validate().map_err(|error| error.to_string())?;
    let mut library = Library::new(&settings, timer_hz)?;
    let checked = ExcitationRequest {
        lines: lines.lines(),
        nominal: Command::saturating_from_bits(request.nominal),
        amplitude: Command::saturating_from_bits(request.amplitude),
        duration_ticks: lines.lines().period_s() * settings.loop_rate_hz,
    };
    let excitation = Excitation::new(&channel_settings(&settings, 0), &checked, f64::from(settings.loop_rate_hz));
    let [channel, ..] = &mut library.channels;
    let excitation = excitation.map_err(|error| error.to_string())?;
    channel.start_excitation(excitation).map_err(|error| error.to_string())?;

    let mut inputs = Inputs::default();
    let mut costs = Costs::default();
    let mut ticks = 0;
    while costs.runs < EXCITATION_TICKS {
        let at = debugger.run()?.pc();
        let back = interrupted_at(&mut debugger)?;
        let cost = trace(&mut debugger, image, &[back, handlers.tick, handlers.capture, handlers.link], &mut inputs)?;
        if at != handlers.tick {
            continue;
        }
        ticks += 1;
        if library.channels[0].state() == State::Excitation(Phase::Playing) {
            costs.add(cost);
        } else if ticks > RAMP_TICKS {
            return Err(format!("after {ticks} ticks the excitation does not play"));
        }
        check_widths(&mut debugger, library.tick(0))?;
    }
    let ticks_per_period = lines.lines().period_s() * settings.loop_rate_hz;
    Ok((lines.lines().per_tick(ticks_per_period) as u32, costs))
}

/// What the lowest priority locks for requests in flight, and for those that need every motor at rest.
fn measure_requests(image_path: &Path, image: &Image) -> Result<(Locked, Locked)> {
    let Machine { mut debugger, mut link, qemu: _qemu } = Machine::start(image_path)?;
    let tick = image.function_named(TICK).map(|index| image.functions[index].address);
    debugger.run_to(tick.ok_or_else(|| format!("the image has no interrupt {TICK}"))?)?;
    let settings = excitation_settings();
    set(&mut debugger, &mut link, &settings)?;
    stop_ticks(&mut debugger)?;
    let begins = locks(image);
    if begins.is_empty() {
        return Err("the image has no locks".to_owned());
    }
    for begin in begins {
        debugger.add_breakpoint(begin)?;
    }
    let record = RecordRequest { motor: 0, divisor: 1 };
    let in_flight = [
        Request::Info,
        Request::Faults,
        Request::Record(Some(record)),
        Request::Record(None),
        Request::KeepAlive,
        Request::StopExcitation,
    ];
    let at_rest = [
        Request::SetSettings(settings),
        Request::SetMode { motor: 0, source: Source::Inject, compensate: true },
        Request::SetMode { motor: 0, source: Source::Pulse, compensate: true },
        Request::Excite(excite_request(LineSet::Odd45Hz)),
    ];
    let mut of = |requests: &[Request]| {
        let mut longest = Locked::default();
        for request in requests {
            send(&mut link, request)?;
            let mut locks = 0;
            while debugger.run_within(REQUEST_LIMIT)?.is_some() {
                let cost = trace_lock(&mut debugger, image, &mut Inputs::default())?;
                longest = longest.max(cost.locked);
                locks += 1;
            }
            if locks == 0 {
                return Err(format!("nothing is locked for {request:?}"));
            }
        }
        Ok::<_, String>(longest)
    };
    Ok((of(&in_flight)?, of(&at_rest)?))
}

/// A byte of the link interrupts the captures, and those the tick: what `controller::load` computes rests on it. In the
/// core's registers the lower number goes first.
fn check_priorities(debugger: &mut Debugger) -> Result {
    let mut priority = |name: &str, address: u32| {
        let word = debugger.read(address & !3)?;
        let priority = (word >> (8 * (address & 3)) & 0xFF) >> PRIORITY_UNUSED_BITS;
        println!("priority of {name}: {priority}, 0 goes first");
        Ok::<_, String>(priority)
    };
    let byte = priority(LINK, INTERRUPT_PRIORITIES + USART3)?;
    let capture = priority(CAPTURE, INTERRUPT_PRIORITIES + TIM2)?;
    let tick = priority(TICK, SYSTICK_PRIORITY)?;
    if byte < capture && capture < tick {
        return Ok(());
    }
    Err(format!("{LINK} must go before {CAPTURE}, and that before {TICK}: set them so in src/main.rs"))
}

/// The outputs must be as wide as the library's.
fn check_widths(debugger: &mut Debugger, expected: [u32; INPUTS]) -> Result {
    for (output, expected) in (0..).zip(expected) {
        let width = debugger.read(TIM3_WIDTHS + 4 * output)?;
        if width != expected {
            return Err(format!("output {output} is {width} counts wide, and {expected} by the library"));
        }
    }
    Ok(())
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
    plan: Plan,
    output_scale: PulseScale,
    frames: Frames,
}

impl Library {
    fn new(settings: &Validated, timer_hz: u32) -> Result<Self> {
        let filters = controller::filters(settings).map_err(|error| error.to_string())?;
        let plan = Plan::new(settings, timer_hz, true).ok_or("the timers do not suit the settings")?;
        let pulses = plan.input.timing().zip(plan.output.pulses());
        let (timing, (output_scale, frames)) = pulses.ok_or("what is measured has pulses in and out")?;
        Ok(Self {
            decoders: std::array::from_fn(|_| Decoder::new(timing)),
            channels: controller::channels(settings, filters).ok_or("the settings contradict each other")?,
            plan,
            output_scale,
            frames,
        })
    }

    fn tick(&mut self, now: u32) -> [u32; INPUTS] {
        let mut widths = [0; INPUTS];
        for ((decoder, channel), width) in self.decoders.iter_mut().zip(&mut self.channels).zip(&mut widths) {
            let input = Input::from_reading(decoder.poll(now).into(), &self.plan.input_scale);
            *width = self.output_scale.to_width_ticks(channel.tick(input));
        }
        widths
    }
}

/// The application with pulses at its inputs.
struct Stand<'a> {
    debugger: Debugger,
    link: TcpStream,
    image: &'a Image,
    handlers: Handlers,
    inputs: Inputs,
    counts_per_us: u32,
    counts_per_tick: u32,
    counts_per_frame: u32,
    /// From now to the rise of the next pulses.
    until_frame: u32,
    library: Library,
    _qemu: Process,
}

impl<'a> Stand<'a> {
    /// A controller that runs with these settings, and has a clock that it trusts.
    fn new(image_path: &Path, image: &'a Image, settings: &Settings) -> Result<Self> {
        let Machine { mut debugger, mut link, qemu } = Machine::start(image_path)?;
        let handlers = Handlers::from_image(image)?;
        debugger.run_to(handlers.tick)?;
        trust_clock(&mut debugger, image)?;
        let timer_hz = set(&mut debugger, &mut link, settings)?;
        let settings = settings.clone().validate().map_err(|error| error.to_string())?;
        let library = Library::new(&settings, timer_hz)?;
        let divider = debugger.read(TIM3_PRESCALER)? + 1;
        if divider != library.frames.divider {
            return Err(format!("the outputs' timer is divided by {divider}, and by the plan by {:?}", library.frames));
        }
        for handler in [handlers.tick, handlers.capture, handlers.link] {
            debugger.add_breakpoint(handler)?;
        }
        Ok(Self {
            debugger,
            link,
            image,
            handlers,
            inputs: Inputs::default(),
            counts_per_us: timer_hz / 1_000_000,
            counts_per_tick: timer_hz / settings.loop_rate_hz,
            counts_per_frame: timer_hz / u32::from(settings.input.frame_hz),
            until_frame: 0,
            library,
            _qemu: qemu,
        })
    }

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

    /// What a pulse means.
    fn command(&self, width_us: u32) -> Command {
        self.library.plan.input_scale.to_command(width_us * self.counts_per_us)
    }

    /// Sends the core to its handler of faults, and on into the start after it.
    fn fault(&mut self) -> Result {
        self.debugger.add_breakpoint(function_address(self.image, RESET)?)?;
        self.debugger.jump(function_address(self.image, FAULT)?)?;
        self.arrive(function_address(self.image, RESET)?, RESET)?;
        self.debugger.remove_breakpoint(function_address(self.image, RESET)?)?;
        trust_clock(&mut self.debugger, self.image)
    }

    /// As [`Self::fly`], with commands that step up and down.
    fn fly_armed(&mut self, who: [bool; INPUTS]) -> Result<Flight> {
        let (arming, _) = self.fly(who, ARMED_US[1], ARMING_FRAMES)?;
        let (mut ticks, mut captures) = (Costs::default(), Costs::default());
        for frame in 0..ARMED_FRAMES {
            let (tick, capture) = self.fly(who, ARMED_US[frame as usize % 2], 1)?;
            ticks.merge(tick);
            captures.merge(capture);
        }
        for (channel, _) in self.library.channels.iter().zip(who).filter(|(_, who)| *who) {
            if channel.state() != State::Armed {
                return Err(format!("a motor that was to fly is {:?}", channel.state()));
            }
        }
        Ok(Flight { arming, ticks, captures })
    }

    fn run_tick(&mut self) -> Result<Cost> {
        self.arrive(self.handlers.tick, TICK)?;
        let cost = self.run_interrupt()?;
        check_widths(&mut self.debugger, self.library.tick(self.inputs.now))?;
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

    /// Interrupts of the link during a request and its answer, the last with work both ways.
    ///
    /// The ticks are switched off: the emulated time runs on while the debugger thinks, so that on a fast machine the
    /// next tick is due whenever one ends, and the task that writes the answer never gets its turn.
    fn link_bytes(&mut self) -> Result<(Costs, Costs)> {
        stop_ticks(&mut self.debugger)?;
        send(&mut self.link, &Request::Info)?;
        let (mut one_way, mut both_ways) = (Costs::default(), Costs::default());
        for _ in 0..LINK_BYTES + BUSY_BYTES + LAST_OTHERS {
            self.inputs.link_is_busy = one_way.runs == LINK_BYTES;
            let at = self.next_interrupt()?;
            let cost = self.run_interrupt()?;
            if at == self.handlers.link {
                if self.inputs.link_is_busy { both_ways.add(cost) } else { one_way.add(cost) }
            }
            if both_ways.runs == BUSY_BYTES {
                return Ok((one_way, both_ways));
            }
        }
        Err("other interrupts came instead of the link's".to_owned())
    }
}

/// The first instruction of a function.
fn function_address(image: &Image, name: &str) -> Result<u32> {
    let index = image.function_named(name).ok_or_else(|| format!("the image has no function {name}"))?;
    Ok(image.functions[index].address)
}

/// The emulator has no crystal, and its timers a clock of their own. Without a good clock the application does not let pulses arm.
fn trust_clock(debugger: &mut Debugger, image: &Image) -> Result {
    debugger.set_words(function_address(image, JUDGES_CLOCK)?, &[YES])
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

impl Handlers {
    fn from_image(image: &Image) -> Result<Self> {
        let address = |name| function_address(image, name);
        Ok(Self { tick: address(TICK)?, capture: address(CAPTURE)?, link: address(LINK)? })
    }
}

impl Costs {
    fn merge(&mut self, other: Self) {
        self.runs += other.runs;
        self.instructions += other.instructions;
        self.locked = self.locked.max(other.locked);
        self.byte_taken = self.byte_taken.max(other.byte_taken);
        if other.worst.instructions > self.worst.instructions {
            self.worst = other.worst;
        }
    }
}
