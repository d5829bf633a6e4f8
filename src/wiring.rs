//! Which part of the board feeds which part of the library.

use core::sync::atomic::{AtomicBool, Ordering};

use heapless::spsc::{Consumer, Producer};
use rotorlead::capture::{Decoder, Faults as InputFaults, Level, Timing};
use rotorlead::channel::Channel;
use rotorlead::controller::{
    self, Counts, Desk, DeskQueues, Facts, INJECT_QUEUE, Motor, MotorQueues, RECORD_QUEUE, Tick,
};
use rotorlead::link::{MotorFaults, Refusal, Sample};
use rotorlead::settings::{MOTORS, Origin, Store, Validated};
use rotorlead::throttle::{Command, PulseScale};
use rtic::Mutex;

use crate::board::capture::{Capture, Edge};
use crate::board::clocks::{ClockReport, Source};
use crate::board::control_timer::ControlTimer;
use crate::board::outputs::Outputs;
use crate::board::serial::Serial;
use crate::board::settings_flash::{COPIES, SettingsFlash};
use crate::board::thrust_adc::ThrustAdc;
use crate::board::{Board, Watchdog};

/// Longest time that the idle task may be away, milliseconds: the design of a filter, or a save.
const IDLE_LIMIT_MS: u32 = 20_000;

/// One over the time in which the watchdog has settled on a new limit, and has been fed.
const WATCHDOG_SETTLES_HZ: u32 = 500;

/// Whether the clock tells a disarmed pulse from an armed one. Without the crystal a stop pulse of 1000 µs may read as
/// 1080 µs. Nobody may arm by that, so every pulse then counts as an armed one, which a motor does not turn on that has
/// not been seen disarmed, and which ends an excitation or an injection.
static PULSES_ARE_EXACT: AtomicBool = AtomicBool::new(false);

/// The inputs and what decodes them.
pub struct Inputs {
    capture: Capture,
    decoders: [Decoder; MOTORS],
}

impl Inputs {
    /// Gives the edges that were captured to their decoders.
    #[inline]
    pub fn capture(&mut self) {
        let edges = self.capture.take();
        for (decoder, edge) in self.decoders.iter_mut().zip(edges) {
            let Some(Edge { timestamp, high, overcapture }) = edge else { continue };
            if overcapture {
                decoder.overcapture();
            }
            decoder.edge(timestamp, if high { Level::High } else { Level::Low });
        }
        if self.any_masked() {
            self.listen();
        }
    }

    /// Whether an interrupt is off or to be off: all others are on.
    #[inline]
    fn any_masked(&self) -> bool {
        self.decoders.iter().any(Decoder::is_masked)
    }

    #[inline]
    fn listen(&mut self) {
        self.capture.listen(self.decoders.each_ref().map(|decoder| !decoder.is_masked()));
    }

    fn faults(&self) -> [MotorFaults; MOTORS] {
        self.decoders.each_ref().map(|decoder| {
            let InputFaults { glitches, missing_edges, out_of_range, too_soon, floods, losses } = decoder.faults();
            MotorFaults { glitches, missing_edges, out_of_range, too_soon, lost: losses, masked: floods }
        })
    }
}

/// What the control task has.
pub struct Control {
    tick: Tick,
    outputs: Outputs,
    output_scale: PulseScale,
    timer: ControlTimer,
    thrust_adc: ThrustAdc,
    watchdog: Watchdog,
    missed: u32,
    /// The tick that was the last to miss.
    last_missed: u32,
    idle_away_ticks: u32,
    idle_limit_ticks: u32,
}

impl Control {
    /// One tick.
    #[inline]
    pub fn run(&mut self, inputs: &mut Inputs, idle_lives: bool) {
        self.thrust_adc.start();
        let now = inputs.capture.now();
        let were_masked = inputs.any_masked();
        let signals = inputs.decoders.iter_mut().map(|decoder| decoder.poll(now));
        let commands = self.tick.run(signals, || self.thrust_adc.read());
        if were_masked {
            inputs.listen();
        }
        #[cfg(feature = "planted-panic")]
        let _ = {
            use core::hint::black_box;
            let beyond = commands[0].to_bits() > Command::ONE.to_bits() / 2;
            black_box(commands[black_box(if beyond { MOTORS } else { 0 })])
        };
        self.outputs.set(commands.map(|command| self.output_scale.to_ticks(command)));
        self.idle_away_ticks = if idle_lives { 0 } else { self.idle_away_ticks.saturating_add(1) };
        if self.idle_away_ticks < self.idle_limit_ticks {
            self.watchdog.feed();
        }
        if self.timer.is_due() {
            self.late();
        }
    }
}

impl Control {
    /// The next tick is due already. Where that goes on, nothing of lower priority runs, and a host could not stop an
    /// excitation: it ends with the second miss in a row.
    #[cold]
    fn late(&mut self) {
        self.missed = self.missed.wrapping_add(1);
        let now = self.tick.ticks();
        if now.wrapping_sub(self.last_missed) == 1 {
            self.tick.stop_excitation();
        }
        self.last_missed = now;
    }
}

/// What came of the start.
pub struct Parts {
    /// For capture and control.
    pub inputs: Inputs,
    /// For the control task.
    pub control: Control,
    /// For the link's interrupt.
    pub serial: Option<Serial>,
    /// For the idle task.
    pub desk: Desk<SettingsFlash>,
    /// What the board knows of itself.
    pub facts: Facts,
    /// Where the settings come from.
    pub origin: Origin,
}

/// Everything that the settings mean for the board.
struct Plan {
    timing: Timing,
    input_scale: PulseScale,
    output_scale: PulseScale,
}

impl Plan {
    /// `None` where a timer does not suit the pulses, which it does for every clock that the board may run on.
    fn new(settings: &Validated, timer_hz: u32, outputs: &Outputs) -> Option<Self> {
        let input = settings.input.protocol();
        let frame_hz = u32::from(settings.output.frame_hz);
        let counter_hz = outputs.counter_hz(frame_hz);
        let output_scale = PulseScale::new(settings.output.protocol(), counter_hz).ok()?;
        // A pulse without a gap behind it would be a line that is always high.
        if output_scale.high_ticks() >= counter_hz / frame_hz.max(1) {
            return None;
        }
        let input_scale = if PULSES_ARE_EXACT.load(Ordering::Relaxed) {
            PulseScale::new(input, timer_hz).ok()?
        } else {
            PulseScale::FULL
        };
        Some(Self { timing: Timing::new(input, timer_hz, settings.loop_rate_hz).ok()?, input_scale, output_scale })
    }
}

/// Both ends of a queue.
pub type Ends<T, const N: usize> = (Producer<'static, T, N>, Consumer<'static, T, N>);

/// Loads the settings, computes the filter, and starts the control task.
pub fn start(
    board: Board,
    inject: [Ends<Command, INJECT_QUEUE>; MOTORS],
    outputs: [Ends<Command, INJECT_QUEUE>; MOTORS],
    samples: Ends<Sample, RECORD_QUEUE>,
) -> Parts {
    let ClockReport { source, core_hz, timer_hz, timer_as_promised } = board.clocks;
    PULSES_ARE_EXACT.store(source == Source::CrystalPll && timer_as_promised, Ordering::Relaxed);
    let facts = Facts { clock: source.into(), core_hz, timer_hz, reset: board.start_reason.into() };
    let mut store = Store::new(board.flash, COPIES);
    let loaded = store.load();
    let usable = |settings: &Validated| {
        let coefficients = controller::coefficients(settings).ok()?;
        let channels = controller::channels(settings, coefficients)?;
        Some((coefficients, channels, Plan::new(settings, timer_hz, &board.outputs)?))
    };
    let (settings, origin, (coefficients, channels, plan)) = match usable(&loaded.settings) {
        Some(found) => (loaded.settings, loaded.origin, found),
        None => {
            let settings = Validated::default();
            // A test of the host runs through every clock that `clocks::measure` may give.
            let found = usable(&settings).expect("the defaults suit every clock of the board");
            (settings, Origin::DefaultsBad, found)
        }
    };

    let (inject_in, inject_out) = unzip(inject);
    let (outputs_in, outputs_out) = unzip(outputs);
    let (samples_in, samples_out) = samples;
    let queues = zip(inject_out, outputs_in).map(|(inject, outputs)| MotorQueues { inject, outputs });
    let motors = zip(channels, queues).map(|(channel, queues)| Motor::new(channel, queues));
    let mut control = Control {
        tick: Tick::new(motors, plan.input_scale, settings.loop_rate_hz, samples_in),
        outputs: board.outputs,
        output_scale: plan.output_scale,
        timer: board.control_timer,
        thrust_adc: board.thrust_adc,
        watchdog: board.watchdog,
        missed: 0,
        last_missed: 0,
        idle_away_ticks: 0,
        idle_limit_ticks: 0,
    };
    control.set_rates(&settings);
    control.watchdog.tighten();
    control.timer.start();
    let queues = DeskQueues { inject: inject_in, outputs: outputs_out, samples: samples_out };
    let decoders = [const { () }; MOTORS].map(|()| Decoder::new(plan.timing));
    Parts {
        inputs: Inputs { capture: board.capture, decoders },
        control,
        serial: board.serial,
        desk: Desk::new(settings, origin, coefficients, store, queues),
        facts,
        origin,
    }
}

impl Control {
    fn set_rates(&mut self, settings: &Validated) {
        self.outputs.set_frame_rate(u32::from(settings.output.frame_hz));
        self.timer.set_rate(settings.loop_rate_hz);
        self.idle_limit_ticks = settings.loop_rate_hz.saturating_mul(IDLE_LIMIT_MS / 1000);
    }
}

fn unzip<A, B>(pairs: [(A, B); MOTORS]) -> ([A; MOTORS], [B; MOTORS]) {
    let [(a, e), (b, f), (c, g), (d, h)] = pairs;
    ([a, b, c, d], [e, f, g, h])
}

fn zip<A, B>(left: [A; MOTORS], right: [B; MOTORS]) -> [(A, B); MOTORS] {
    let ([a, b, c, d], [e, f, g, h]) = (left, right);
    [(a, e), (b, f), (c, g), (d, h)]
}

/// The board as the desk reaches it, from the idle task.
pub struct Wires<I, C, S> {
    /// The inputs.
    pub inputs: I,
    /// The control task's state.
    pub control: C,
    /// The UART.
    pub serial: S,
    /// What the board knows of itself.
    pub facts: Facts,
}

impl<I, C, S> controller::Board for Wires<I, C, S>
where
    I: Mutex<T = Inputs>,
    C: Mutex<T = Control>,
    S: Mutex<T = Option<Serial>>,
{
    fn tick<R>(&mut self, f: impl FnOnce(&mut Tick) -> R) -> R {
        self.control.lock(|control| f(&mut control.tick))
    }

    fn reconfigure(&mut self, settings: &Validated, channels: [Channel; MOTORS]) -> Result<(), Refusal> {
        let timer_hz = self.facts.timer_hz;
        let plan = self.control.lock(|control| Plan::new(settings, timer_hz, &control.outputs));
        let plan = plan.ok_or(Refusal::Design)?;
        // At once, or a tick would read pulses of one protocol on the scale of the other.
        self.inputs.lock(|inputs| {
            self.control.lock(|control| {
                control.set_rates(settings);
                control.output_scale = plan.output_scale;
                control.tick.reconfigure(channels, plan.input_scale, settings.loop_rate_hz);
            });
            inputs.decoders.iter_mut().for_each(|decoder| *decoder = Decoder::new(plan.timing));
            inputs.listen();
        });
        Ok(())
    }

    fn flash_stalls(&mut self, stalls: bool) {
        self.control.lock(|control| if stalls { control.watchdog.relax() } else { control.watchdog.tighten() });
        // The watchdog takes its new limit over within 5 periods of its own clock (RM0090, 21.4.4), 0.3 ms; then a control
        // tick must feed it once by the new one.
        cortex_m::asm::delay(self.facts.core_hz / WATCHDOG_SETTLES_HZ);
    }

    fn facts(&mut self) -> Facts {
        self.facts
    }

    fn counts(&mut self) -> Counts {
        Counts {
            link_overruns: self.serial.lock(|serial| serial.as_ref().map_or(0, |serial| serial.lost)),
            missed_deadlines: self.control.lock(|control| control.missed),
            motors: self.inputs.lock(|inputs| inputs.faults()),
        }
    }
}
