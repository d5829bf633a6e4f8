//! Steps during which the logger stalls: none of them has a lag, however late the channel answers.

use std::fmt::Write as _;
use std::path::Path;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};
use rotorlead_identify::lag::steps::{StaircaseFit, StepFault, fit_staircase};
use rotorlead_records::import::{ImportOptions, import, import_bytes};
use rotorlead_records::shared_data::data;
use rotorlead_records::{Excitation, Experiment, Output};

/// Commands, each for two seconds.
const LEVELS: [f64; 9] = [0.2, 0.4, 0.7, 0.5, 0.3, 0.6, 0.4, 0.8, 0.2];

/// A logger that stalls after some of the commands.
struct Log {
    column: &'static str,
    interval_s: f64,
    dead_s: f64,
    tau_s: f64,
    noise_std: f64,
    /// The steps during which it stalls, counted from one.
    stalled: &'static [usize],
    /// When the stall begins, after the command, and how long it lasts.
    stall_s: (f64, f64),
    /// Rows after a stall whose readings are those that were in store.
    stale_rows: usize,
}

impl Log {
    fn response(&self, t: f64) -> f64 {
        let begin_s = |k: usize| 2.0 * k as f64 + self.dead_s;
        let mut y = LEVELS[0];
        for (k, pair) in LEVELS.windows(2).enumerate().map(|(k, pair)| (k + 1, pair)) {
            if t >= begin_s(k) {
                y = LEVELS[k] + (pair[0] - LEVELS[k]) * (-(t - begin_s(k)) / self.tau_s).exp();
            }
        }
        y
    }

    fn csv(&self, seed: u64) -> String {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let noise = Normal::new(0.0, self.noise_std).unwrap();
        let mut table = format!("time_s,command,{}\n", self.column);
        let (mut t, mut stale) = (0.0, (0_usize, 0.0));
        while t < 2.0 * LEVELS.len() as f64 {
            let step = (t / 2.0) as usize;
            let read_s = if stale.0 > 0 { stale.1 } else { t };
            stale.0 = stale.0.saturating_sub(1);
            let y = 10.0 * (self.response(read_s) + noise.sample(&mut rng));
            let y = if self.column == "rpm" { 1000.0 * y } else { y };
            writeln!(table, "{t:.5},{},{y:.5}", LEVELS[step]).unwrap();
            // Each command has a row at its moment.
            let next = (t + self.interval_s * rng.random_range(0.8..1.2)).min(2.0 * (step as f64 + 1.0));
            let stall = 2.0 * step as f64 + self.stall_s.0;
            let stalls = self.stalled.contains(&step) && (t..next).contains(&stall);
            t = if stalls { next + self.stall_s.1 } else { next };
            if stalls {
                stale = (self.stale_rows, next);
            }
        }
        table
    }

    fn fit(&self, seed: u64) -> StaircaseFit {
        let options = ImportOptions { excitation: Some(Excitation::Staircase), ..ImportOptions::default() };
        let log = import_bytes(Path::new("log.csv"), self.csv(seed).as_bytes(), &options).unwrap();
        fitted(&log.experiment)
    }

    /// Those steps are left out in which the log stalls, and the others have the lag of the channel.
    #[track_caller]
    fn assert_right(&self) {
        for seed in 1..=10 {
            let fit = self.fit(seed);
            assert_eq!(in_gap(&fit), self.stalled, "seed {seed}: {:?}", fit.steps);
            for (k, step) in fit.steps.iter().enumerate().filter(|(k, _)| !self.stalled.contains(&(k + 1))) {
                let tau = step.time_constant_s().unwrap_or_else(|| panic!("seed {seed}, step {}: {step:?}", k + 1));
                assert!((tau.value / self.tau_s - 1.0).abs() < 0.08, "seed {seed}: {tau:?} of {}", self.tau_s);
            }
            assert!((fit.delay_s.value - self.dead_s).abs() < 0.3 * self.interval_s, "seed {seed}: {:?}", fit.delay_s);
        }
    }
}

fn fitted(experiment: &Experiment) -> StaircaseFit {
    fit_staircase(&experiment.records[0], experiment.output, None).unwrap()
}

/// The steps that a gap hides, counted from one.
fn in_gap(fit: &StaircaseFit) -> Vec<usize> {
    let is_in_gap = |fault| matches!(fault, Some(StepFault::ResponseInGap { .. }));
    (1..).zip(&fit.steps).filter(|(_, step)| is_in_gap(step.fault)).map(|(k, _)| k).collect()
}

/// By hand the steps that the logger lets alone, all down, have 20.6 to 29 ms.
#[test]
fn a_thrust_that_comes_when_the_stall_is_nearly_over() {
    let Some(path) = data("cases/stall-thrust-up-steps/log.csv") else { return };
    let options = ImportOptions {
        excitation: Some(Excitation::Staircase),
        columns: vec!["command=ESC signal:dshot".parse().unwrap()],
        ..ImportOptions::default()
    };
    let log = import(&path, &options).unwrap();
    assert_eq!(log.experiment.output, Output::ThrustN);
    let fit = fitted(&log.experiment);
    assert_eq!(in_gap(&fit), [1, 7], "{:?}", fit.steps);
    let tau_ms: Vec<f64> = fit.steps.iter().filter_map(|step| Some(1e3 * step.time_constant_s()?.value)).collect();
    assert!(tau_ms.len() == 4 && tau_ms.iter().all(|tau| (20.0..30.0).contains(tau)), "{tau_ms:?}");
}

/// All of the stall is in the dead time, and what follows it is three rows old.
#[test]
fn a_stall_that_is_over_before_the_channel_answers() {
    Log {
        column: "thrust_n",
        interval_s: 0.005,
        dead_s: 0.15,
        tau_s: 0.04,
        noise_std: 0.002,
        stalled: &[1, 2, 5],
        stall_s: (0.0, 0.1),
        stale_rows: 3,
    }
    .assert_right();
}

/// The stall ends half way of the response, and its first readings are from before that.
#[test]
fn a_stall_in_which_a_speed_with_a_short_dead_time_moves() {
    Log {
        column: "rpm",
        interval_s: 0.01,
        dead_s: 0.02,
        tau_s: 0.06,
        noise_std: 0.004,
        stalled: &[2, 3, 6],
        stall_s: (0.0, 0.07),
        stale_rows: 2,
    }
    .assert_right();
}

/// The stall begins when the response has begun, and hides the half of it.
#[test]
fn a_stall_behind_the_first_readings_of_a_response() {
    Log {
        column: "thrust_n",
        interval_s: 0.008,
        dead_s: 0.06,
        tau_s: 0.05,
        noise_std: 0.003,
        stalled: &[4, 8],
        stall_s: (0.07, 0.06),
        stale_rows: 2,
    }
    .assert_right();
}

/// What the log loses when the response has arrived takes nothing from the lag.
#[test]
fn a_stall_on_a_settled_level_costs_no_step() {
    let log = Log {
        column: "thrust_n",
        interval_s: 0.008,
        dead_s: 0.06,
        tau_s: 0.05,
        noise_std: 0.003,
        stalled: &[1, 2, 3, 4, 5, 6, 7, 8],
        stall_s: (0.5, 0.1),
        stale_rows: 2,
    };
    for seed in 1..=10 {
        let fit = log.fit(seed);
        assert_eq!(in_gap(&fit), [0; 0]);
        assert_eq!(fit.steps.iter().filter(|step| step.time_constant_s().is_some()).count(), 8);
    }
}
