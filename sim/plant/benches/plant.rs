//! Speed of the simulated stand, single-threaded: `cargo bench -p rotorlead-plant --bench plant`.
//!
//! Prints millions of ticks per second, the best of several runs: what the code can do, not what else the machine does.

use std::hint::black_box;
use std::num::NonZeroUsize;
use std::sync::OnceLock;
use std::time::Instant;

use rotorlead_plant::bench::{Plan, run_on};
use rotorlead_plant::{Actuator, Effect, EscTiming, FirstOrder, Law, Model, Noise, SensorNoise};

const TICKS: usize = 2_000_000;

const MODEL: &str = "
format = 1
[[point]]
nominal = 0.4
gain = 9.9955
time_constant_s = 0.159342
[[point]]
nominal = 0.5
gain = 10.1718
time_constant_s = 0.107656
delay_s = 0.0033
[[point]]
nominal = 0.65
gain = 16.1063
time_constant_s = 0.070784
";

fn main() -> miette::Result<()> {
    let model: Model = toml::from_str(MODEL).expect("the text above is a model");
    // A command that changes on every tick, as a multisine's does.
    let commands: Vec<f64> = (0..4096).map(|k| 0.5 + 0.05 * (f64::from(k) * 0.1).sin()).collect();
    let tick_s = 1.0 / 5000.0;
    // Intervals that differ from tick to tick, so that no exponential can be computed once for all.
    let intervals_s: Vec<f64> = (0..4096).map(|k| tick_s * (1.0 + f64::from(k) * 1e-6)).collect();

    let mut plant = FirstOrder::around(&model, 0.5)?;
    report("plant step, linear", |k| plant.advance(commands[k % 4096], intervals_s[k % 4096]));
    black_box(plant.response());

    let mut plant = FirstOrder::over_range(&model, 0.5)?;
    report("plant step, following the level", |k| plant.advance(commands[k % 4096], intervals_s[k % 4096]));
    black_box(plant.response());

    for (name, nominal, frame_hz) in [
        ("chain without frames and delay", 0.4, None),
        ("chain with 600 Hz frames", 0.4, Some(600.0)),
        ("chain with 600 Hz frames and delay", 0.5, Some(600.0)),
    ] {
        let timing = EscTiming { frame_hz, frame_phase: 0.0 };
        let mut actuator = Actuator::new(&model, Law::LinearAround(nominal), timing)?;
        let mut ticks = 0.0;
        report(name, |k| {
            ticks += 1.0;
            actuator.advance(commands[k % 4096], ticks * tick_s);
        });
        black_box(actuator.response());
    }

    for (name, effects) in [
        ("effect: saturation", &[("saturation", &[("max", 0.54)][..])][..]),
        ("effect: slew limit", &[("slew_limit", &[("rate_per_s", 20.0)])]),
        ("effect: second pole", &[("second_pole", &[("time_constant_s", 0.003)])]),
        ("effect: moving average", &[("moving_average", &[("window_s", 0.05)])]),
        (
            "effect: stand resonance",
            &[("stand_resonance", &[("participation", 0.5), ("frequency_hz", 30.0), ("damping", 0.05)])],
        ),
        ("effect: asymmetric lag", &[("asymmetric_lag", &[("ratio", 1.5)])]),
        ("effect: operating-point lag", &[("operating_point_lag", &[("exponent", 1.0)])]),
        ("effect: quadratic thrust", &[("quadratic_thrust", &[("curvature_per_duty", 3.0)])]),
        ("effect: supply sag", &[("supply_sag", &[("polarization_drop", 0.1), ("polarization_s", 1.0)])]),
        (
            "effects: three",
            &[
                ("slew_limit", &[("rate_per_s", 20.0)]),
                ("asymmetric_lag", &[("ratio", 1.5)]),
                ("second_pole", &[("time_constant_s", 0.003)]),
            ],
        ),
    ] {
        let mut with = model.clone();
        for (kind, parameters) in effects {
            let parameters = parameters.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
            with.effects.push(Effect { kind: (*kind).to_owned(), parameters, std: Default::default() });
        }
        for frame_hz in [None, Some(600.0)] {
            let timing = EscTiming { frame_hz, frame_phase: 0.0 };
            let mut actuator = Actuator::new(&with, Law::LinearAround(0.4), timing)?;
            let mut ticks = 0.0;
            let name = format!("{name}{}", if frame_hz.is_some() { ", frames" } else { "" });
            report(&name, |k| {
                ticks += 1.0;
                actuator.advance(commands[k % 4096], ticks * tick_s);
            });
            black_box(actuator.response());
        }
    }

    let mut noise = SensorNoise::new(Noise { sigma_n: 0.02, ..Noise::default() }, 1, 0)?;
    let mut sum = 0.0;
    report("sensor noise, per row", |k| sum += noise.sample(k as f64));
    black_box(sum);

    let plan = Plan::paper(&model);
    let start = Instant::now();
    let experiment = run_on(NonZeroUsize::MIN, &plan, &model, None, &|_| {})?;
    let elapsed_s = start.elapsed().as_secs_f64();
    let ticks: usize = experiment.records.iter().map(|r| r.time_s.len() * 5 * 5 / 4).sum();
    println!("{:<42} {:6.1} M ticks/s", "bench, the paper's plan", ticks as f64 / elapsed_s / 1e6);
    Ok(())
}

/// Time that this thread has had a processor for, seconds: other work of the machine is not in it. Where the system does not
/// say (other than Linux), the time of day.
fn processor_s() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    let start = START.get_or_init(Instant::now);
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    match text.split_whitespace().next().and_then(|field| field.parse::<f64>().ok()) {
        Some(nanoseconds) => nanoseconds * 1e-9,
        None => start.elapsed().as_secs_f64(),
    }
}

fn report(name: &str, mut step: impl FnMut(usize)) {
    let best_s = (0..5)
        .map(|_| {
            let start_s = processor_s();
            for k in 0..TICKS {
                step(k);
            }
            processor_s() - start_s
        })
        .fold(f64::INFINITY, f64::min);
    println!("{name:<42} {:6.1} M ticks/s", TICKS as f64 / best_s / 1e6);
}
