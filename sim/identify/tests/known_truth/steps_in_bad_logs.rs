//! Staircases as bad loggers record them: the interval of every time constant that is printed holds the truth.
//!
//! The motor is simulated in closed form from event to event and shares no code with the fit. Each kind of log has one fault; 400
//! seeds each draw levels, plateaus, rows, dead time, noise and the fault anew.

use rand::{Rng, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};
use rotorlead_identify::lag::steps::{StaircaseFit, fit_staircase};
use rotorlead_records::import::spread_bursts;
use rotorlead_records::{Excitation, Output, Record};

const SEEDS: u64 = 400;

/// What is wrong with a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    /// Nothing but noise and uneven rows.
    None,
    /// The logger stalls for 60 to 120 ms shortly after three of five commands; its next reading is from before the stall.
    Stalls,
    /// Time stamps are off by 2 ms (standard deviation).
    Jitter,
    /// A fifth of the rows has the reading of the row before.
    RepeatedRows,
    /// Speed in steps of 60 rpm.
    Quantized,
    /// Even rows wait for the host and get its stamps in bursts of two to six, which the import spreads.
    Bursts,
    /// Some rows are missing where the command changes.
    MissingEdges,
    /// Some levels are held for five rows.
    ShortPlateaus,
    /// The command goes back to idle between, at 1 to 4 % of full speed.
    Idling,
}

const FAULTS: [Fault; 9] = [
    Fault::None,
    Fault::Stalls,
    Fault::Jitter,
    Fault::RepeatedRows,
    Fault::Quantized,
    Fault::Bursts,
    Fault::MissingEdges,
    Fault::ShortPlateaus,
    Fault::Idling,
];

/// A motor with a lag that depends on the operating point and the direction.
struct Motor {
    delay_s: f64,
    /// Time constant at command 0, up.
    slow_s: f64,
    /// By how much of it the time constant falls to full command.
    falls: f64,
    down_over_up: f64,
    idle_rpm: f64,
}

impl Motor {
    fn time_constant_s(&self, from: f64, to: f64) -> f64 {
        self.slow_s * (1.0 - self.falls * to) * if to < from { self.down_over_up } else { 1.0 }
    }

    fn level(&self, u: f64) -> f64 {
        if u < 0.05 { self.idle_rpm } else { 2000.0 + 24000.0 * u - 6000.0 * u * u }
    }
}

/// A log with its motor and what its noise allows.
struct Log {
    motor: Motor,
    record: Record,
    /// Steps between levels that settle: the first row, the commands, and the Cramer-Rao bound of the time constant,
    /// relative, with levels, delay and time constant unknown.
    steps: Vec<(f64, f64, f64, f64)>,
}

fn between(rng: &mut impl Rng, low: f64, high: f64) -> f64 {
    rng.random_range(low..high)
}

fn commands(fault: Fault, rng: &mut ChaCha8Rng) -> Vec<(f64, f64)> {
    let mut levels: Vec<(f64, f64)> = vec![(0.3, 1.5)];
    for _ in 0..rng.random_range(12..20) {
        let last = levels[levels.len() - 1].0;
        let mut next = last;
        while (next - last).abs() < 0.06 {
            next = (100.0 * between(rng, 0.12, 0.98)).round() / 100.0;
        }
        levels.push((next, between(rng, 0.7, 2.0)));
        if fault == Fault::ShortPlateaus && rng.random_bool(0.3) {
            levels.push(((next + 0.07).min(0.99), 0.0));
            levels.push((next - 0.05, between(rng, 0.7, 2.0)));
        }
        if fault == Fault::Idling && rng.random_bool(0.3) {
            levels.push((0.02, between(rng, 1.0, 2.0)));
            levels.push((between(rng, 0.2, 0.5), between(rng, 1.0, 2.0)));
        }
    }
    levels
}

fn log(fault: Fault, seed: u64) -> Log {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let motor = Motor {
        delay_s: between(&mut rng, 0.0, 0.035),
        slow_s: between(&mut rng, 0.03, 0.1),
        falls: between(&mut rng, 0.0, 0.6),
        down_over_up: between(&mut rng, 1.0, 1.4),
        idle_rpm: between(&mut rng, 200.0, 700.0),
    };
    let interval_s = between(&mut rng, 0.005, 0.012);
    let noise_std = between(&mut rng, 15.0, 120.0);
    let noise = Normal::new(0.0, noise_std).unwrap();
    let levels = commands(fault, &mut rng);

    // Rows and the command in each.
    let (mut time_s, mut command, mut first_rows) = (vec![], vec![], vec![]);
    let mut t = 0.0;
    for &(u, held_s) in &levels {
        first_rows.push(time_s.len());
        let until = t + held_s;
        let mut rows = 0;
        while t < until || rows < 5 {
            time_s.push(t);
            command.push(u);
            let uneven = if fault == Fault::Bursts { 1.0 } else { between(&mut rng, 0.8, 1.2) };
            t += interval_s * uneven;
            rows += 1;
        }
    }
    // The response, level by level.
    let mut rpm = vec![0.0; time_s.len()];
    let (mut now, mut w, mut level, mut tau) = (0.0, motor.level(levels[0].0), motor.level(levels[0].0), 1.0);
    let mut changes = (1..levels.len())
        .map(|k| {
            // The command is sent somewhere between the row before and the one that shows it.
            let row = first_rows[k];
            let sent = between(&mut rng, time_s[row - 1], time_s[row]);
            (sent + motor.delay_s, motor.level(levels[k].0), motor.time_constant_s(levels[k - 1].0, levels[k].0))
        })
        .collect::<Vec<_>>()
        .into_iter()
        .peekable();
    for (&t, rpm) in time_s.iter().zip(&mut rpm) {
        while let Some(change) = changes.next_if(|change| change.0 <= t) {
            w = level + (w - level) * (-(change.0 - now) / tau).exp();
            (now, level, tau) = change;
        }
        w = level + (w - level) * (-(t - now) / tau).exp();
        now = t;
        *rpm = w + noise.sample(&mut rng);
    }
    let mut kept = vec![true; time_s.len()];
    match fault {
        Fault::Stalls => {
            for &row in &first_rows[1..] {
                if rng.random_bool(0.6) {
                    let from = time_s[row] + between(&mut rng, 0.0, 0.03);
                    let until = from + between(&mut rng, 0.06, 0.12);
                    let inside: Vec<usize> =
                        (row + 1..time_s.len()).filter(|&k| (from..until).contains(&time_s[k])).collect();
                    inside.iter().for_each(|&k| kept[k] = false);
                    if let (Some(&first), Some(&last)) = (inside.first(), inside.last())
                        && last + 1 < rpm.len()
                    {
                        rpm[last + 1] = rpm[first];
                    }
                }
            }
        }
        Fault::Jitter => {
            let jitter = Normal::new(0.0, 0.002).unwrap();
            for k in 1..time_s.len() {
                time_s[k] = f64::max(time_s[k] + jitter.sample(&mut rng), time_s[k - 1] + 1e-4);
            }
        }
        Fault::RepeatedRows => {
            for k in 1..rpm.len() {
                if rng.random_bool(0.2) {
                    rpm[k] = rpm[k - 1];
                }
            }
        }
        Fault::Quantized => rpm.iter_mut().for_each(|rpm| *rpm = 60.0 * (*rpm / 60.0).round()),
        Fault::Bursts => {
            let mut rest = &mut time_s[..];
            while !rest.is_empty() {
                let count = rng.random_range(2..7).min(rest.len());
                let (burst, others) = std::mem::take(&mut rest).split_at_mut(count);
                burst.fill(burst[count - 1]);
                rest = others;
            }
            time_s = spread_bursts(&time_s).expect("stamps in bursts");
        }
        Fault::MissingEdges => {
            for &row in &first_rows[1..] {
                if rng.random_bool(0.3) {
                    let from = row - rng.random_range(1..4);
                    kept[from..row + rng.random_range(1..4)].fill(false);
                }
            }
        }
        Fault::None | Fault::ShortPlateaus | Fault::Idling => {}
    }
    let settles = |k: usize| levels[k].1 >= 0.5 && levels[k].0 > 0.05;
    let steps = (1..levels.len()).filter(|&k| settles(k) && settles(k - 1)).map(|k| {
        let (from, to) = (levels[k - 1].0, levels[k].0);
        let end = first_rows.get(k + 1).copied().unwrap_or(time_s.len());
        let rows = (first_rows[k]..end).filter(|&row| kept[row]).map(|row| time_s[row] - time_s[first_rows[k]]);
        let rise = motor.level(to) - motor.level(from);
        (time_s[first_rows[k]], from, to, bound(rows, &motor, motor.time_constant_s(from, to), rise / noise_std))
    });
    let steps = steps.collect();
    let only_kept =
        |values: Vec<f64>| values.into_iter().zip(&kept).filter(|(_, kept)| **kept).map(|(v, _)| v).collect();
    let record = Record {
        file: "log.csv".into(),
        nominal: 0.5,
        excitation: Excitation::Staircase,
        period_s: None,
        amplitude: None,
        compensated: false,
        compensator: None,
        role: None,
        time_s: only_kept(time_s),
        command: only_kept(command),
        thrust_n: None,
        rpm: Some(only_kept(rpm)),
        command_log: None,
        esc_command: None,
        voltage_v: None,
        current_a: None,
        setpoints: rotorlead_records::Setpoints::default(),
    };
    Log { motor, record, steps }
}

/// Relative Cramer-Rao bound of the time constant of a step of `rise` noise standard deviations, from rows at these times after
/// it, when the level after it, its delay and its time constant are unknown.
fn bound(times_s: impl Iterator<Item = f64>, motor: &Motor, tau_s: f64, rise: f64) -> f64 {
    let mut information = nalgebra::Matrix3::<f64>::zeros();
    for t in times_s {
        let x = (t - motor.delay_s) / tau_s;
        if x <= 0.0 {
            continue;
        }
        let decay = (-x).exp();
        // By the level after, the delay over tau, and the logarithm of tau.
        let gradient = nalgebra::Vector3::new(1.0 - decay, -rise * decay, -rise * x * decay);
        information += gradient * gradient.transpose();
    }
    information.try_inverse().map_or(f64::INFINITY, |covariance| covariance[(2, 2)].sqrt())
}

/// What intervals do over all logs of a fault.
#[derive(Debug, Default)]
struct Count {
    /// Steps with a time constant, and those whose 95 % interval holds the truth.
    steps: usize,
    steps_held: usize,
    /// Points of the model, and those whose band holds the truth.
    points: usize,
    points_held: usize,
    /// Logs in which half of the steps have a Cramer-Rao bound under 10 %, and those of them with a time constant.
    informative: usize,
    known: usize,
    /// Sum of the relative widths of the steps' intervals.
    width: f64,
    refused: usize,
}

impl Count {
    fn run(fault: Fault, seed: u64) -> Self {
        let log = log(fault, seed);
        let mut count = Self::default();
        let good = log.steps.iter().filter(|step| step.3 < 0.1).count();
        count.informative = usize::from(2 * good >= log.steps.len());
        let fit = match fit_staircase(&log.record, Output::Rpm, None) {
            Ok(fit) => fit,
            Err(_) => {
                count.refused = 1;
                return count;
            }
        };
        count.steps(&fit, &log.motor);
        count.points(&fit, &log.motor);
        count.known = usize::from(count.informative == 1 && count.steps > 0 && count.points > 0);
        count
    }

    fn steps(&mut self, fit: &StaircaseFit, motor: &Motor) {
        for step in &fit.steps {
            let Some(tau) = step.time_constant_s() else { continue };
            let (low, high) = tau.interval_of_logarithm(0.95);
            self.steps += 1;
            self.steps_held += usize::from((low..=high).contains(&motor.time_constant_s(step.from, step.to)));
            self.width += (high - low) / tau.value;
        }
    }

    fn points(&mut self, fit: &StaircaseFit, motor: &Motor) {
        let Some(curve) = &fit.curve else { return };
        for level in fit.levels.iter().filter(|level| curve.holds(level.command)) {
            let u = level.command;
            let truth = 2.0 / (1.0 / motor.time_constant_s(0.0, u) + 1.0 / motor.time_constant_s(1.0, u));
            let (low, high) = curve.at(u).interval_of_logarithm(0.95);
            self.points += 1;
            self.points_held += usize::from((low..=high).contains(&truth));
        }
    }

    fn add(self, other: Self) -> Self {
        Self {
            steps: self.steps + other.steps,
            steps_held: self.steps_held + other.steps_held,
            points: self.points + other.points,
            points_held: self.points_held + other.points_held,
            informative: self.informative + other.informative,
            known: self.known + other.known,
            width: self.width + other.width,
            refused: self.refused + other.refused,
        }
    }
}

#[test]
fn with_any_fault_of_a_log_the_intervals_of_time_constants_hold_the_truth() {
    let mut failed = Vec::new();
    for fault in FAULTS {
        let count = (0..SEEDS).into_par_iter().map(|seed| Count::run(fault, seed)).reduce(Count::default, Count::add);
        let share = |part: usize, all: usize| 100.0 * part as f64 / all as f64;
        let (steps, points) = (share(count.steps_held, count.steps), share(count.points_held, count.points));
        let known = share(count.known, count.informative);
        println!(
            "{fault:?}: {} steps, {steps:.1} % held, mean width {:.0} %; {} points, {points:.1} % held; known in {known:.1} % \
             of {} informative logs; {} refused",
            count.steps,
            100.0 * count.width / count.steps as f64,
            count.points,
            count.informative,
            count.refused
        );
        if !(90.0..=99.0).contains(&steps) || !(90.0..=99.0).contains(&points) || known < 80.0 {
            failed.push(format!("{fault:?}"));
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}
