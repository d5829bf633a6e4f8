//! The correction of an inverse by the speed that the ESCs say: the whole controller with frames of DShot at both ends, and ESCs that
//! answer with the speeds of a simulated rotor.

use host_tests::board::{CRYSTAL, TestBoard, facts};
use host_tests::flash::Flash;
use host_tests::pole_at;
use rotorlead::design::{CurvePoint, RotorCurve, SpeedCurve};
use rotorlead::dshot::{
    Checksum, Content, Frame, REPLY_BITS, Reply, ReplyWindow, Value, WINDOW_LEVELS, WORD_LEVELS, Word,
};
use rotorlead::settings::{CompensatorKind, MOTORS, Pulse, PulseProtocol, Settings, Store};
use rotorlead::throttle::Command;

const LOOP_HZ: f64 = 5000.0;
/// Frames at 2500 Hz.
const FRAME_TICKS: u64 = 2;
/// The commands between which the speeds are known.
const RANGE: (f64, f64) = (0.2, 0.8);

/// Time constants of a motor with a propeller of 5 inches.
fn curve() -> [CurvePoint; 2] {
    [CurvePoint { command: 0.2, tau_s: 0.07 }, CurvePoint { command: 0.8, tau_s: 0.03 }]
}

/// Electrical revolutions per minute at a command when the motor was identified.
fn identified(command: f64) -> f64 {
    1e4 + 1.6e5 * command - 5e4 * command * command
}

fn settings(compensator: CompensatorKind) -> Settings {
    let mut settings = Settings {
        compensator,
        input: Pulse { protocol: PulseProtocol::Dshot600, frame_hz: 2500 },
        output: Pulse { protocol: PulseProtocol::Dshot600Bidirectional, frame_hz: 2500 },
        ..Settings::default()
    };
    let [from, to] = [RANGE.0, RANGE.1].map(Command::saturating_from_f64);
    let speeds = [RANGE.0, 0.5, RANGE.1].map(|command| identified(command) as u32);
    for motor in &mut settings.motors {
        motor.compensate = true;
        motor.curve = RotorCurve::through(&curve()).ok();
    }
    settings.speeds = [Some(SpeedCurve::new(from, to, speeds)); MOTORS];
    settings
}

/// What is otherwise than it was when the motor was identified.
#[derive(Clone, Copy)]
struct Change {
    /// Supply voltage: a command has the speed of one so much smaller.
    voltage: f64,
    /// Speed, whatever the command.
    speed: f64,
    /// Time constants.
    lag: f64,
}

const AS_IDENTIFIED: Change = Change { voltage: 1.0, speed: 1.0, lag: 1.0 };
const SAG: Change = Change { voltage: 0.85, ..AS_IDENTIFIED };

/// What happens to replies.
#[derive(Clone, Copy)]
struct Line {
    /// Part of them that is lost.
    lost: f64,
    /// Scatter of a turn, rms over its time.
    noise: f64,
}

const CLEAN: Line = Line { lost: 0.0, noise: 0.0 };

struct Flight {
    board: TestBoard,
    change: Change,
    line: Line,
    /// The command whose steady speed the rotor has, and the one that it got last.
    v: f64,
    u: f64,
    reply: Option<u32>,
    ticks: u64,
    random: u64,
    /// Outputs of motor 0, frame by frame.
    outputs: Vec<f64>,
}

impl Flight {
    /// At rest at 0.5, armed a moment ago.
    fn new(compensator: CompensatorKind, change: Change, line: Line) -> Self {
        Self::with(settings(compensator), change, line)
    }

    fn with(settings: Settings, change: Change, line: Line) -> Self {
        let mut store = Store::new(Flash::<4096>::blank(), Flash::<4096>::SECTORS);
        store.save(&settings.validate().unwrap()).unwrap();
        let (board, _, _) = TestBoard::start(store, facts(CRYSTAL));
        let mut flight = Self {
            board,
            change,
            line,
            v: 0.0,
            u: 0.0,
            reply: None,
            ticks: 0,
            random: 0x2545_f491_4f6c_dd1d,
            outputs: Vec::new(),
        };
        (0..20).for_each(|_| flight.tick(0.0));
        (0..10).for_each(|_| flight.tick(0.5));
        flight.v = 0.5;
        flight
    }

    /// From 0 to 1. Marsaglia, Xorshift RNGs, 2003.
    fn uniform(&mut self) -> f64 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        self.random as f64 / u64::MAX as f64
    }

    fn erpm(&self) -> f64 {
        self.change.speed * identified(self.change.voltage * self.v)
    }

    /// The speed over what a rotor at rest at `command` had when it was identified.
    fn speed_over(&self, command: f64) -> f64 {
        self.erpm() / identified(command)
    }

    fn gain(&mut self) -> f64 {
        self.board.tick_mut().motors()[0].channel().gain()
    }

    /// The gain that is right at a command: `k` for which the rotor turns as it did.
    fn right(&self, command: f64) -> f64 {
        let wanted = identified(command) / self.change.speed;
        let (mut low, mut high) = (0.5, 2.0);
        for _ in 0..60 {
            let middle = (low + high) / 2.0;
            if identified(self.change.voltage * middle * command) < wanted { low = middle } else { high = middle }
        }
        low
    }

    fn value(command: f64) -> Value {
        if command > 0.0 { Value::from_command(Command::saturating_from_f64(command)) } else { Value::new(0).unwrap() }
    }

    /// One control tick, with a frame at the input where one is due.
    fn tick(&mut self, command: f64) {
        let is_framed = self.ticks.is_multiple_of(FRAME_TICKS);
        self.ticks += 1;
        let tau_s = self.change.lag / pole_at(&curve(), self.v);
        self.v += (self.u - self.v) * (1.0 - (-1.0 / (LOOP_HZ * tau_s)).exp());
        if is_framed {
            let frame = Frame::new(Self::value(command), false, Checksum::Normal);
            let reply = self.reply;
            let parts = self.board.control.parts_mut();
            for motor in 0..4 {
                parts.input_frames.words[motor].push_back(Word::from(frame));
                parts.outputs.windows[motor].extend(reply.map(window));
            }
        }
        let readings = self.board.inputs.poll();
        self.board.control.run(readings, true);
        let sent: Vec<Frame> =
            self.board.control.parts_mut().outputs.sent.iter_mut().flat_map(std::mem::take).collect();
        let Some(frame) = sent.first() else { return };
        self.u = match frame.value().content() {
            Content::Throttle(command) => command.to_f64(),
            _ => 0.0,
        };
        self.outputs.push(self.u);
        // What the ESC says behind this frame is there when the next one goes out.
        let (lost, noise) = (self.uniform() < self.line.lost, self.normal());
        let period_us = 60e6 / self.erpm() * (1.0 + self.line.noise * noise);
        self.reply = (!lost).then(|| Reply::from_period_us(Some(period_us as u32)).to_levels());
    }

    /// Sum of twelve uniform numbers.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    fn run(&mut self, seconds: f64, mut command: impl FnMut(f64) -> f64) {
        for tick in 0..(seconds * LOOP_HZ) as u64 {
            self.tick(command(tick as f64 / LOOP_HZ));
        }
    }

    /// Largest change from one output frame to the next since `first`.
    fn largest_step(&self, first: usize) -> f64 {
        self.outputs[first..].windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max)
    }
}

/// What a line is behind a frame when the ESC says this some 30 us later.
fn window(levels: u32) -> ReplyWindow {
    let behind = WINDOW_LEVELS - REPLY_BITS - 23;
    let levels = !(u64::from(!levels & ((1 << REPLY_BITS) - 1)) << behind);
    ReplyWindow::new((levels >> WORD_LEVELS) as u32, levels as u32)
}

/// A reply rounds a turn down to a part in 256 at most, which reads as a speed that is too high by so much.
const RESOLUTION: f64 = 1.0 / 256.0;
/// What the frames of the outputs resolve, 2000 steps.
const STEP: f64 = 1.0 / 2000.0;

#[test]
fn a_sagging_battery_is_made_up_for_within_seconds() {
    let mut plain = Flight::new(CompensatorKind::Inverse, SAG, CLEAN);
    plain.run(20.0, |_| 0.5);
    let mut flight = Flight::new(CompensatorKind::Rpm, SAG, CLEAN);
    let right = flight.right(0.5);
    // The time to 63 % of the way.
    let mut reached_s = None;
    for tick in 0..100_000 {
        flight.tick(0.5);
        if reached_s.is_none() && flight.gain() > 1.0 + (right - 1.0) * 0.632 {
            reached_s = Some(f64::from(tick) / LOOP_HZ);
        }
    }
    let (before, after, reached_s) = (plain.speed_over(0.5) - 1.0, flight.speed_over(0.5) - 1.0, reached_s.unwrap());
    println!(
        "sag 15 %: speed {before:+.4} before, {after:+.5} after; gain {:.4} of {right:.4}; 63 % in {reached_s:.2} s",
        flight.gain()
    );
    println!("largest step of the output {:.2e}", flight.largest_step(10));
    assert!(before < -0.1 && after.abs() < RESOLUTION);
    // One over 0.5 rad/s times the elasticity, 0.7; a tenth more far from where it settles.
    assert!((2.8..3.2).contains(&reached_s), "{reached_s}");
}

#[test]
fn another_propeller_keeps_its_speed_and_its_bandwidth() {
    let propeller = Change { speed: 0.93, lag: 1.2, ..AS_IDENTIFIED };
    let mut bandwidths = Vec::new();
    for kind in [CompensatorKind::Inverse, CompensatorKind::Rpm] {
        let mut flight = Flight::new(kind, propeller, CLEAN);
        flight.run(12.0, |_| 0.5);
        let (gain, right) = (flight.gain(), flight.right(0.5));
        println!("{kind:?}: speed {:+.4}, gain {gain:.4} of {right:.4}", flight.speed_over(0.5) - 1.0);
        if kind == CompensatorKind::Rpm {
            assert!((flight.speed_over(0.5) - 1.0).abs() < RESOLUTION);
        }
        // The answer to sines of small amplitude, over that to a slow one.
        let mut answer = |omega: f64| {
            let periods = (omega * 1.5 / std::f64::consts::TAU).ceil().max(2.0);
            let seconds = periods * std::f64::consts::TAU / omega;
            let sine = |t: f64| 0.5 + 0.02 * (omega * t).sin();
            flight.run(seconds, sine);
            let (mut in_phase, mut quadrature) = (0.0, 0.0);
            for tick in 0..(seconds * LOOP_HZ) as u64 {
                let t = tick as f64 / LOOP_HZ;
                flight.tick(sine(t));
                in_phase += flight.erpm() * (omega * t).sin();
                quadrature += flight.erpm() * (omega * t).cos();
            }
            f64::hypot(in_phase, quadrature) / (seconds * LOOP_HZ)
        };
        let slow = answer(6.0);
        let bandwidth =
            (20..200).map(|step| 2.0 * f64::from(step)).find(|&omega| answer(omega) < slow * 0.5_f64.sqrt());
        bandwidths.push(bandwidth.unwrap());
    }
    println!("bandwidth {bandwidths:?} rad/s");
    assert!(bandwidths[1] >= bandwidths[0] - 2.0);
}

#[test]
fn lost_replies_freeze_the_gain_and_it_returns_to_one_without_a_bump() {
    let mut flight = Flight::new(CompensatorKind::Rpm, SAG, Line { lost: 0.3, ..CLEAN });
    flight.run(15.0, |_| 0.5);
    let right = flight.right(0.5);
    println!("30 % of the replies lost: gain {:.4} of {right:.4}", flight.gain());
    assert!((flight.speed_over(0.5) - 1.0).abs() < RESOLUTION);
    flight.line.lost = 1.0;
    flight.run(0.02, |_| 0.5);
    let (held, first) = (flight.gain(), flight.outputs.len());
    flight.run(0.95, |_| 0.5);
    assert_eq!(flight.gain(), held, "held for a second");
    flight.run(2.05, |_| 0.5);
    let part = (flight.gain() - 1.0) / (held - 1.0);
    println!("2 s into the return {part:.3} are left");
    flight.run(40.0, |_| 0.5);
    println!("at last {}, largest step of the output {:.2e}", flight.gain(), flight.largest_step(first));
    assert!((part - (-1.0_f64).exp()).abs() < 0.02);
    assert_eq!(flight.gain(), 1.0, "the plain inverse, to the last bit");
    assert!(flight.largest_step(first) < 1.01 * STEP);
}

#[test]
fn noise_of_the_replies_is_averaged() {
    let mut flight = Flight::new(CompensatorKind::Rpm, AS_IDENTIFIED, Line { noise: 0.01, ..CLEAN });
    flight.run(10.0, |_| 0.5);
    let mut gains = Vec::new();
    for _ in 0..150_000 {
        flight.tick(0.5);
        gains.push(flight.gain());
    }
    let mean = gains.iter().sum::<f64>() / gains.len() as f64;
    let rms = (gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() / gains.len() as f64).sqrt();
    println!("noise of 1 %: gain {mean:.5}, rms {rms:.2e}");
    assert!(rms < 5e-4 && (mean - 1.0).abs() < 2.0 * RESOLUTION);
}

/// Ten sines up to 20 Hz, 10 % rms together.
fn busy(t: f64) -> f64 {
    let sum: f64 =
        (1..=10).map(|n| (std::f64::consts::TAU * 2.0 * f64::from(n) * t + 2.4 * f64::from(n * n)).sin()).sum();
    0.5 + 0.05 * sum / 5.0_f64.sqrt()
}

#[test]
fn commands_that_change_all_the_time_do_not_move_the_gain() {
    for (change, right) in [(AS_IDENTIFIED, 1.0), (SAG, 1.0 / 0.85), (Change { lag: 1.25, ..AS_IDENTIFIED }, 1.0)] {
        let mut flight = Flight::new(CompensatorKind::Rpm, change, CLEAN);
        flight.run(15.0, busy);
        let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
        for tick in 0..50_000 {
            flight.tick(busy(f64::from(tick) / LOOP_HZ));
            let gain = flight.gain() / right;
            (least, most) = (least.min(gain), most.max(gain));
        }
        println!(
            "busy commands, lag {}, voltage {}: gain {least:.4} to {most:.4} of what is right",
            change.lag, change.voltage
        );
        assert!(least > 0.99 && most < 1.01, "{least} {most}");
    }
}

#[test]
fn nothing_winds_up_at_the_limits_of_the_output() {
    const HIGHEST: f64 = 0.85;
    let mut settings = settings(CompensatorKind::Rpm);
    settings.motors[0].max = Command::saturating_from_f64(HIGHEST).to_bits();
    let mut flight = Flight::with(settings, SAG, CLEAN);
    // A sag for which the output has no room: 0.93 would be right.
    flight.run(15.0, |_| 0.79);
    assert!((flight.u - HIGHEST).abs() < 1e-3, "{}", flight.u);
    let at_limit = flight.gain();
    println!("gain with the output at its limit {at_limit:.4}, where {:.4} is right", 1.0 / 0.85);
    assert!((at_limit * 0.85 - 1.0).abs() < 2.0 * RESOLUTION, "{at_limit}");
    flight.change = AS_IDENTIFIED;
    let first = flight.outputs.len();
    flight.run(15.0, |_| 0.5);
    println!("back with a full battery: gain {:.4}, largest step {:.3}", flight.gain(), flight.largest_step(first));
    assert!((flight.speed_over(0.5) - 1.0).abs() < RESOLUTION);
}

#[test]
fn the_gain_has_bounds_and_faults_do_not_reach_them() {
    // A sag of 30 % is more than is made up for.
    for (change, bound) in
        [(Change { voltage: 0.7, ..AS_IDENTIFIED }, 1.25), (Change { voltage: 1.4, ..AS_IDENTIFIED }, 0.8)]
    {
        let mut flight = Flight::new(CompensatorKind::Rpm, change, CLEAN);
        flight.run(20.0, |_| 0.5);
        println!("voltage {}: gain {:.5}, speed {:+.3}", change.voltage, flight.gain(), flight.speed_over(0.5) - 1.0);
        assert!((flight.gain() - bound).abs() < 1e-8);
    }
    // A rotor that starts from rest, one that stands, and commands at which nothing is known.
    let mut flight = Flight::new(CompensatorKind::Rpm, AS_IDENTIFIED, CLEAN);
    flight.v = 0.0;
    flight.run(0.5, |_| 0.5);
    println!("half a second after a start from rest: gain {:.4}", flight.gain());
    assert!((flight.gain() - 1.0).abs() < 0.02);
    flight.change.speed = 0.02;
    flight.run(3.0, |_| 0.5);
    assert!((flight.gain() - 1.0).abs() < 0.02, "it stands");
    let mut flight = Flight::new(CompensatorKind::Rpm, SAG, CLEAN);
    for beyond in [0.9, 0.1] {
        flight.run(1.0, |_| beyond);
        let held = flight.gain();
        flight.run(5.0, |_| beyond);
        assert_eq!(flight.gain(), held, "no speed is known at {beyond}");
    }
}
