//! Pulses in, pulses out.

use emulator::rp2040::{CYCLES_PER_S, Edge};
use host_tests::pins::{INPUT_1, Pulse, ms, us};
use host_tests::scenario::{LINES_BEGIN, Miss, Play, Proof, STARTED, Scenario, Target, first_after_start, hold};
use rotorlead::controller::Plan;
use rotorlead::settings::{Pulse as PulseSettings, PulseProtocol, Settings};
use rotorlead::throttle::Command;

/// Cycles of a control tick at 5 kHz.
const TICK: u64 = 25_000;

pub const CONSTANT_PULSES: Scenario = Scenario {
    name: "constant pulses pass, in every protocol and at all outputs",
    prove: constant_pulses,
    controls: &[("two inputs are swapped", swap_inputs), ("the pulses at an input are 0.1 us longer", lengthen)],
};

pub const STEP: Scenario = Scenario {
    name: "a step through the lead, beside double precision",
    prove: step,
    controls: &[("`omega_f` is 0.1 % higher", |play| {
        if let Some(settings) = &mut play.settings {
            settings.lead.omega_f_rad_s *= 1.001;
        }
    })],
};

pub const LATENCY: Scenario = Scenario {
    name: "pulses that go up and down, 400 Hz in, up to 450 Hz out: each goes out, and how late",
    prove: latency,
    controls: &[
        ("an edge is lost", lose_edge),
        ("frames do not follow", |play| {
            if let Some(settings) = &mut play.settings {
                settings.output.frame_hz = 400;
            }
        }),
    ],
};

/// The first two inputs change their places.
pub fn swap_inputs(play: &mut Play) {
    for edge in &mut play.edges {
        edge.pin = match edge.pin {
            INPUT_1 => INPUT_1 + 1,
            pin if pin == INPUT_1 + 1 => INPUT_1,
            pin => pin,
        };
    }
}

/// A fall of the first input does not come, 19 ms after the start.
pub fn lose_edge(play: &mut Play) {
    lose_fall(play, STARTED + ms(19.0));
}

/// The same 3 ms after the start, among instructions and before a motor is armed.
pub fn lose_bit(play: &mut Play) {
    lose_fall(play, STARTED + ms(3.0));
}

fn lose_fall(play: &mut Play, from: u64) {
    let is_lost = |edge: &Edge| edge.pin == INPUT_1 && !edge.is_high && edge.cycle > from;
    let lost = play.edges.iter().position(is_lost).expect("the line has edges");
    play.edges.remove(lost);
}

fn lengthen(play: &mut Play) {
    play.edges.iter_mut().filter(|edge| edge.pin == INPUT_1 && !edge.is_high).for_each(|edge| edge.cycle += us(0.1));
}

fn bits(command: f64) -> i32 {
    Command::saturating_from_f64(command).to_bits()
}

/// Standard PWM in and out, by a lead without a slew limit where `compensate`.
fn standard(compensate: bool) -> Settings {
    let pulse = |frame_hz| PulseSettings { protocol: PulseProtocol::StandardPwm, frame_hz };
    let (input, output) = (pulse(400), pulse(450));
    let mut settings = Settings { input, output, slew_per_s: 0.0, ..Settings::default() };
    settings.motors.iter_mut().for_each(|motor| motor.compensate = compensate);
    settings
}

fn constant_pulses(target: &dyn Target) -> Proof {
    let pulse = |protocol, frame_hz| PulseSettings { protocol, frame_hz };
    // Period and the widths of a stop and of half throttle, microseconds; those of the raw duty are shares of the frame.
    for (input, output, period_us, [stop_us, half_us]) in [
        (pulse(PulseProtocol::StandardPwm, 400), pulse(PulseProtocol::StandardPwm, 450), 2500.0, [1000.0, 1500.0]),
        (pulse(PulseProtocol::OneShot125, 2000), pulse(PulseProtocol::OneShot125, 2200), 500.0, [125.0, 187.4]),
        (pulse(PulseProtocol::StandardPwm, 400), pulse(PulseProtocol::OneShot125, 2000), 2500.0, [1000.0, 1504.0]),
        (pulse(PulseProtocol::RawDuty, 500), pulse(PulseProtocol::RawDuty, 500), 2000.0, [40.0, 1000.0]),
    ] {
        let mut settings = Settings { input, output, ..standard(false) };
        if output.protocol == PulseProtocol::RawDuty {
            settings.stop = bits(0.02);
            settings.motors.iter_mut().for_each(|motor| motor.max = bits(0.98));
        }
        let mut play = Play::new(&settings, STARTED + ms(60.0));
        let first = first_after_start(us(period_us));
        // Each input somewhat longer than the one before.
        let step_us =
            |motor: u8| f64::from(motor) * if input.protocol == PulseProtocol::OneShot125 { 1.0 } else { 8.0 };
        for motor in 0..4 {
            let armed_us = half_us + step_us(motor);
            play.pulses(motor, us(period_us), play.end, |n| if n < first { stop_us } else { armed_us });
        }
        let outcome = target.play(&play)?;
        let scale = match (input.protocol, output.protocol) {
            (PulseProtocol::StandardPwm, PulseProtocol::OneShot125) => 8.0,
            _ => 1.0,
        };
        for motor in 0..4 {
            let found = outcome.pulses(motor)?;
            let half: Vec<_> = found.iter().filter(|pulse| pulse.rise > STARTED + ms(10.0)).collect();
            hold(half.len() >= (50e3 / period_us) as usize - 2, || {
                format!("{output:?}, {motor}: {} pulses", half.len())
            })?;
            let expected = us((half_us + step_us(motor)) / scale);
            if let Some(wrong) = half.iter().find(|pulse| pulse.width != expected) {
                return Err(Miss::Wrong(format!("{output:?}, output {motor}: {wrong:?}, and not {expected}")));
            }
            let before: Vec<_> = found.iter().filter(|pulse| pulse.rise < STARTED).collect();
            hold(before.len() > 20, || format!("{output:?}, {motor}: {} stops", before.len()))?;
            if let Some(wrong) = before.iter().find(|pulse| pulse.width != us(stop_us / scale)) {
                return Err(Miss::Wrong(format!("{output:?}, output {motor}: {wrong:?} is no stop")));
            }
        }
    }
    Ok("to the cycle".to_owned())
}

/// Tustin's image of C(s) at 5 kHz in double precision, from rest at `from`: its output at each tick of a step to `to`.
fn lead(omega_f_rad_s: f64, from: f64, to: f64) -> impl Iterator<Item = f64> {
    let (omega_z, omega_f, zeta, k) = (14.1275, omega_f_rad_s, std::f64::consts::FRAC_1_SQRT_2, 2.0 * 5000.0);
    let a = [k * k + 2.0 * zeta * omega_f * k + omega_f * omega_f];
    let (a1, a2) = (2.0 * (omega_f * omega_f - k * k), k * k - 2.0 * zeta * omega_f * k + omega_f * omega_f);
    let gain = omega_f * omega_f;
    let (b0, b1, b2) = (gain * (k / omega_z + 1.0), 2.0 * gain, gain * (1.0 - k / omega_z));
    let (mut x, mut y) = ([from; 2], [from; 2]);
    std::iter::from_fn(move || {
        let new = (b0 * to + b1 * x[0] + b2 * x[1] - a1 * y[0] - a2 * y[1]) / a[0];
        (x, y) = ([to, x[0]], [new, y[0]]);
        Some(new)
    })
}

/// The pulses at the outputs after the pulse at the inputs that steps from 1400 to 1500 µs.
struct Step {
    pulses: [Vec<Pulse>; 4],
    /// Ticks from the step to the one whose output a pulse has, pulse by pulse.
    ticks: Vec<usize>,
    /// Cycles in a count of the outputs.
    count_cycles: f64,
}

impl Step {
    /// A flight controller that sends a pulse in every 12 ticks, which ends in the middle of one.
    fn play(target: &dyn Target) -> Result<Self, Miss> {
        let settings =
            Settings { input: PulseSettings { frame_hz: 417, ..Settings::default().input }, ..standard(true) };
        let period = 12 * TICK;
        let arms_at = first_after_start(period);
        let steps_at = arms_at + 40;
        let width_us = |n: u64| match n {
            n if n < arms_at => 1000.0,
            n if n < steps_at => 1400.0,
            _ => 1500.0,
        };
        let play = |late: u64, end: u64| {
            let mut play = Play::new(&settings, end);
            (0..4).for_each(|motor| play.pulses(motor, period, end, width_us));
            play.edges.iter_mut().filter(|edge| edge.cycle > 0).for_each(|edge| edge.cycle += late);
            target.play(&play)
        };
        // The phase of the ticks: outputs begin some thousand cycles after one.
        let first = play(0, STARTED)?.pulses(0)?;
        let Some(last) = first.last() else { return Err(Miss::Wrong("no pulses".to_owned())) };
        let tick_phase = (last.rise - 5000) % TICK;
        // Pulses of 1400 µs end after a quarter of a tick, and those of 1500 µs after three.
        let ends_at = (LINES_BEGIN + us(1500.0) + TICK - tick_phase) % TICK;
        let late = (3 * TICK / 4 + TICK - ends_at) % TICK;
        let outcome = play(late, STARTED + ms(420.0))?;
        let fall = LINES_BEGIN + late + steps_at * period + us(1500.0);
        let mut pulses = [const { Vec::new() }; 4];
        for (motor, pulses) in (0..4).zip(&mut pulses) {
            *pulses = outcome.pulses(motor)?;
            pulses.retain(|pulse| pulse.rise > fall);
        }
        let tick_of = |cycle: u64| (cycle + TICK - tick_phase) / TICK;
        let ticks = pulses[0].iter().map(|pulse| (tick_of(pulse.rise) - tick_of(fall) - 1) as usize).collect();
        let plan = Plan::new(&settings.validate().expect("valid"), 25_000_000, true).expect("pulses");
        let (_, frames) = plan.output.pulses().expect("pulses");
        Ok(Self { pulses, ticks, count_cycles: CYCLES_PER_S as f64 / f64::from(frames.counter_hz) })
    }

    /// The largest deviation of a pulse from what a filter gives that runs so many ticks early, counts.
    fn deviation(&self, omega_f_rad_s: f64, early: usize) -> f64 {
        let last = self.ticks.last().copied().unwrap_or(0);
        let outputs: Vec<f64> = lead(omega_f_rad_s, 0.4, 0.5).take(last + early + 1).collect();
        let counts = us(1000.0) as f64 / self.count_cycles;
        let deviation = |(pulse, tick): (&Pulse, &usize)| {
            let expected = counts * (1.0 + outputs[tick + early].clamp(0.05, 1.0));
            (pulse.width as f64 / self.count_cycles - expected).abs()
        };
        self.pulses.iter().flat_map(|pulses| pulses.iter().zip(&self.ticks).map(deviation)).fold(0.0, f64::max)
    }
}

fn step(target: &dyn Target) -> Proof {
    let step = Step::play(target)?;
    let is_whole = step.pulses.iter().all(|pulses| pulses.len() == step.ticks.len() && pulses.len() > 80);
    hold(is_whole, || format!("ticks {:?}", step.ticks))?;
    let omega_f = (14.1275 * 200.0 * std::f64::consts::PI).sqrt();
    let [exact, off, early] =
        [(omega_f, 0), (omega_f * 1.001, 0), (omega_f, 1)].map(|(omega, n)| step.deviation(omega, n));
    println!("  with omega_f 0.1 % higher {off:.1} counts off, a tick early {early:.1}");
    hold(exact <= 0.502, || format!("{exact} counts from double precision"))?;
    hold(off > 1.0 && early > 1.0, || format!("{off} and {early}: the check would not see errors"))?;
    Ok(format!("{exact:.3} counts of {} ns", 8.0 * step.count_cycles))
}

fn latency(target: &dyn Target) -> Proof {
    // A flight controller whose clock is 0.1 % off, so that its pulses drift through the ticks, and that goes up and down.
    let period = us(2502.5);
    let mut play = Play::new(&standard(false), STARTED + ms(600.0));
    let arms_at = first_after_start(period);
    let width_us = |n: u64| if n < arms_at { 1000.0 } else { 1060.0 + (n * 37 % 900) as f64 };
    (0..4).for_each(|motor| play.pulses(motor, period, play.end, width_us));
    let outcome = target.play(&play)?;
    let mut all_us: Vec<f64> = Vec::new();
    for motor in 0..4 {
        let found = outcome.pulses(motor)?;
        for n in arms_at + 3..(play.end - ms(10.0)) / period {
            let rise = LINES_BEGIN + n * period;
            // The width of each is its own among its neighbors; outputs count 80 ns.
            let out = found.iter().find(|pulse| pulse.rise > rise && pulse.width.abs_diff(us(width_us(n))) <= 6);
            let Some(out) = out else { return Err(Miss::Wrong(format!("the pulse at {rise} does not go out"))) };
            all_us.push((out.rise - rise) as f64 / 125.0);
        }
    }
    let mean_us = all_us.iter().sum::<f64>() / all_us.len() as f64;
    let most_us = all_us.iter().copied().fold(0.0, f64::max);
    // docs/firmware.md: 2.20 ms at most, without the run time of the tick, for pulses of up to 2 ms.
    hold(most_us <= 1960.0 + 202.0 + 45.0, || format!("{most_us} us late"))?;
    Ok(format!("{mean_us:.0} µs on average, {most_us:.0} at most"))
}
