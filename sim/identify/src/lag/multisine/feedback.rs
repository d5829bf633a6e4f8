//! Does the command follow the response's noise?
//!
//! Identification takes the command for given. In a closed loop it is not: a controller answers the noise of the response, and
//! what is then seen of the actuator is mixed with the inverse of the controller (Ljung, 1999, section 13.4). A periodic
//! record shows it. What of command and response does not repeat from period to period, `du` and `dy`, has on open loops
//! nothing in common but what passes the actuator. So
//!
//! ```text
//! v = dy - G du
//! ```
//!
//! is the response's own noise, and no later `du` knows of it. Both series are whitened, each by an autoregression, and
//! their correlations
//!
//! ```text
//! r_l = sum_k v_k du_(k+l) / sqrt(sum v^2 sum du^2),    l = 0 ... M - 1
//! ```
//!
//! are independent with variance `1 / n` where no loop is closed, `n` the rows less one period (Haugh, *Journal of the American
//! Statistical Association* 71, 1976): `n sum r_l^2` is chi-square with `M` degrees of freedom. Only lags at which the command comes
//! after the noise count: a model that is too simple, or noise on the record of the command, shows at the others.

use rotorlead_numerics::autoregression::{fit_autoregression, whiten};
use rotorlead_numerics::statistics::f_upper_tail;
use rotorlead_plant::Lag;

/// Rows after which a controller has answered. Chosen: fewer miss a slow loop, more dilute the test: the 0.1 % quantile of chi-square is
/// 30 with 10 lags and 73 with 40.
const LAGS: usize = 40;
/// A command of 0..1 that scatters by less than this repeats exactly. Chosen: far above the rounding of doubles, 1e-16, and far below a
/// step of the command, 5e-4 of DSHOT.
const ROUNDING: f64 = 1e-9;

/// Whether the command follows the response's noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FeedbackTest {
    /// How likely an open loop shows as much.
    pub p_value: f64,
    /// RMS of what of the command does not repeat, over the RMS of what does, percent.
    pub scatter_percent: f64,
}

impl FeedbackTest {
    /// Of whole periods of `length` rows, `row_s` seconds apart, of an actuator with this lag. `None` with fewer than two periods,
    /// or where the command repeats exactly, as from a file or a generator.
    pub(super) fn run(command: &[f64], response: &[f64], length: usize, row_s: f64, lag: &Lag) -> Option<Self> {
        let periods = command.len().min(response.len()) / length;
        if periods < 2 {
            return None;
        }
        let (mut du, repeats) = deviations(command, length, periods);
        let rms = |values: &[f64]| (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt();
        let scatter = rms(&du);
        if scatter < ROUNDING {
            return None;
        }
        let (dy, _) = deviations(response, length, periods);
        let mut v: Vec<f64> = dy.iter().zip(answer(&du, row_s, lag)).map(|(dy, through)| dy - through).collect();
        // All rows are without a gap.
        let whole = 0..du.len();
        let run = std::slice::from_ref(&whole);
        for series in [&mut du, &mut v] {
            let color = fit_autoregression(series, run);
            whiten(series, run, &color);
        }
        let scale = du.iter().map(|d| d * d).sum::<f64>() * v.iter().map(|v| v * v).sum::<f64>();
        let lags = LAGS.min(length);
        let squares: f64 =
            (0..lags).map(|lag| v.iter().zip(&du[lag..]).map(|(v, du)| v * du).sum::<f64>().powi(2)).sum();
        let rows = (length * (periods - 1)) as f64;
        let statistic = if scale > 0.0 { rows * squares / scale } else { 0.0 };
        Some(Self {
            p_value: f_upper_tail(statistic / lags as f64, lags as f64, f64::INFINITY),
            scatter_percent: 100.0 * scatter / repeats,
        })
    }
}

/// What does not repeat, row by row, and the RMS of what does about its mean.
fn deviations(column: &[f64], length: usize, periods: usize) -> (Vec<f64>, f64) {
    let count = periods as f64;
    let mean: Vec<f64> =
        (0..length).map(|row| (0..periods).map(|p| column[p * length + row]).sum::<f64>() / count).collect();
    let middle = mean.iter().sum::<f64>() / length as f64;
    let repeats = (mean.iter().map(|m| (m - middle).powi(2)).sum::<f64>() / length as f64).sqrt();
    let rest = column[..periods * length].iter().enumerate().map(|(k, value)| value - mean[k % length]).collect();
    (rest, repeats)
}

/// What the lag makes of commands that hold from row to row, from rest; its dead time in whole rows.
fn answer(command: &[f64], row_s: f64, lag: &Lag) -> Vec<f64> {
    let pole = (-row_s / lag.time_constant_s).exp();
    let dead_rows = (lag.delay_s / row_s).round().clamp(0.0, command.len() as f64) as usize;
    let mut state = 0.0;
    (0..command.len())
        .map(|row| {
            let now = state;
            let input = row.checked_sub(dead_rows).map_or(0.0, |at| command[at]);
            state = pole * state + (1.0 - pole) * lag.gain * input;
            now
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use rand::{RngExt as _, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    const LENGTH: usize = 500;
    const ROW_S: f64 = 0.01;
    const LAG: Lag = Lag { gain: 10.0, time_constant_s: 0.1, delay_s: 0.0 };

    /// Where the command's scatter comes from.
    #[derive(Clone, Copy)]
    enum Scatter {
        /// A controller of this gain on the response.
        Loop(f64),
        /// The commanding computer, of this size: it passes the actuator.
        Input(f64),
        /// The record of the command, of this size: it does not.
        Record(f64),
    }

    fn p_value(scatter: Scatter, periods: usize, memory: f64, seed: u64) -> f64 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut gauss = move || -> f64 { StandardNormal.sample(&mut rng) };
        let mut phases = ChaCha8Rng::seed_from_u64(7);
        let phases: Vec<f64> = (0..20).map(|_| phases.random_range(0.0..std::f64::consts::TAU)).collect();
        let pole = (-ROW_S / LAG.time_constant_s).exp();
        let (mut state, mut noise) = (0.0, 0.0);
        let (mut command, mut response) = (Vec::new(), Vec::new());
        for row in 0..(periods + 1) * LENGTH {
            let turn = std::f64::consts::TAU * row as f64 / LENGTH as f64;
            let sines = phases.iter().enumerate().map(|(k, p)| (turn * (2 * k + 1) as f64 + p).sin());
            noise = memory * noise + (1.0 - memory * memory).sqrt() * 0.02 * gauss();
            let y = state + noise;
            let (mut u, mut recorded) = (0.5 + 0.01 * sines.sum::<f64>(), 0.0);
            match scatter {
                Scatter::Loop(gain) => u -= gain * y,
                Scatter::Input(size) => u += size * gauss(),
                Scatter::Record(size) => recorded = size * gauss(),
            }
            state = pole * state + (1.0 - pole) * LAG.gain * u;
            if row >= LENGTH {
                command.push(u + recorded);
                response.push(y);
            }
        }
        FeedbackTest::run(&command, &response, LENGTH, ROW_S, &LAG).map_or(f64::NAN, |test| test.p_value)
    }

    #[test]
    fn a_closed_loop_is_seen_and_an_open_one_is_called_closed_as_often_as_the_level_says() {
        let repeats = 400;
        for (periods, memory) in [(2, 0.0), (4, 0.9)] {
            let below = |scatter: Scatter, level: f64| {
                (0..repeats).filter(|&seed| p_value(scatter, periods, memory, seed) < level).count()
            };
            // 400 at 0.05: 20, and 36 or more, or 6 or fewer, in one of 2500 repeats (binomial).
            for open in [Scatter::Input(1e-3), Scatter::Record(1e-3)] {
                let alarms = below(open, 0.05);
                println!("{periods} periods: {alarms} of {repeats}");
                assert!((7..36).contains(&alarms), "{alarms} of {repeats}");
            }
            for closed in [0.01, 0.1] {
                assert_eq!(below(Scatter::Loop(closed), 1e-3), repeats as usize, "{periods} {closed}");
            }
        }
    }

    #[test]
    fn a_command_that_repeats_has_nothing_to_test() {
        let command: Vec<f64> = (0..1000).map(|k| f64::from(k % 100)).collect();
        assert_eq!(FeedbackTest::run(&command, &command, 100, 0.01, &LAG), None);
        assert_eq!(FeedbackTest::run(&command[..150], &command[..150], 100, 0.01, &LAG), None);
    }
}
