//! What makes the residual of uneven rows white, where model errors and noise are correlated in time.
//!
//! The residual is taken as the sum of two parts:
//!
//! ```text
//! r(t_k) = x(t_k) + e_k
//! dx = -x/tau dt + sqrt(2 sigma^2 / tau) dW       what a model misses for longer than a row (Ornstein and Uhlenbeck 1930)
//! var e_k = w^2 + (j dy/dt)^2                     noise of a row, and what a model misses while the response moves
//! ```
//!
//! A static map is off by one thing before a change of the command and by another after it: there `x` forgets a part of what it
//! was, as in a time `v tau` (`v` at most 5, which forgets all). While the response moves, a model is off in proportion to its
//! slope, as if moments were known to `j` only.
//!
//! The innovations of its Kalman filter, each over its standard deviation, are white, and minus half the sum of their squares is
//! the log likelihood but for a constant (Schweppe 1965). The step from row to row is exact for any interval, so nothing is
//! resampled, and rows that are left out make one longer interval. The filter is linear in the residual: its gains depend on
//! the times alone and are computed once.
//!
//! `sigma`, `tau`, `v`, `w` and `j` are those of greatest likelihood for the residual of the best explanation so far. A static map
//! that is wrong by the same on each of 40 plateaus then counts about as 40 observations, not as 15 000 rows.

/// The noise and error that a residual is taken to have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::diagnose) struct Correlation {
    /// Standard deviation of the slow part, response units.
    pub sigma: f64,
    /// Its correlation time, seconds.
    pub tau_s: f64,
    /// What it forgets where the command changes, in correlation times.
    pub forgets: f64,
    /// Standard deviation of a row's own noise.
    pub white: f64,
    /// Standard deviation of a row's moment, seconds.
    pub jitter_s: f64,
}

/// Correlation times are searched from and to these, seconds.
const TAU_RANGE_S: (f64, f64) = (0.02, 300.0);
/// The same of what is forgotten where the command changes.
const FORGETS_RANGE: (f64, f64) = (0.01, 5.0);
/// How fine the search becomes, in logarithms.
const FINEST: f64 = 0.06;
/// A part below this share of the residual, or of the most that it may be, is none.
const LEAST_SHARE: f64 = 1e-3;

impl Correlation {
    /// White noise of a standard deviation.
    pub fn white(std: f64) -> Self {
        Self { sigma: 0.0, tau_s: 1.0, forgets: 0.0, white: std, jitter_s: 0.0 }
    }

    /// That of greatest likelihood for a residual at rows; `floor` is the least noise of a row that is believed, `jitter_s` the
    /// most that moments may be off.
    pub fn of(rows: &Rows, residual: &[f64], floor: f64, jitter_s: f64) -> Self {
        let n = residual.len().max(1) as f64;
        let spread = (residual.iter().map(|r| r * r).sum::<f64>() / n).sqrt().max(floor);
        // Everything in logarithms; the jitter as a share of the most.
        let of = |p: [f64; 5]| {
            let [sigma, tau_s, white, share, forgets] = p.map(f64::exp);
            Self { sigma, tau_s, forgets, white, jitter_s: share * jitter_s }
        };
        let judge = |p: [f64; 5]| {
            let filter = Filter::new(of(p), rows);
            filter.apply(residual).iter().map(|z| z * z).sum::<f64>() + filter.log_variances()
        };
        let ranges = [
            (LEAST_SHARE * spread, 10.0 * spread),
            TAU_RANGE_S,
            (floor, 2.0 * spread),
            (LEAST_SHARE, if jitter_s > 0.0 { 1.0 } else { LEAST_SHARE }),
            FORGETS_RANGE,
        ];
        let ranges = ranges.map(|(from, to)| (from.ln(), to.ln()));
        let mut at = [spread.ln(), 1.0, (0.2 * spread).max(floor).ln(), 0.2_f64.ln().min(ranges[3].1), 0.0];
        let mut best = judge(at);
        let mut step = 1.6;
        while step > FINEST {
            let mut moved = false;
            for (index, sign) in (0..at.len()).flat_map(|index| [(index, 1.0), (index, -1.0)]) {
                let mut there = at;
                there[index] = (at[index] + sign * step).clamp(ranges[index].0, ranges[index].1);
                if there == at {
                    continue;
                }
                let judged = judge(there);
                if judged < best {
                    (at, best, moved) = (there, judged, true);
                }
            }
            if !moved {
                step *= 0.5;
            }
        }
        of(at)
    }
}

/// What a filter has to know of the rows.
#[derive(Clone, Debug, Default)]
pub(in crate::diagnose) struct Rows {
    /// When, seconds, increasing.
    pub time_s: Vec<f64>,
    /// Slope of the response there, per second.
    pub slope: Vec<f64>,
    /// Whether the command changed since the row before.
    pub changed: Vec<bool>,
}

/// The Kalman filter of a correlation at given rows.
#[derive(Clone, Debug, Default)]
pub(in crate::diagnose) struct Filter {
    /// By how much the slow part has decayed since the row before, its gain there, and one over the innovation's standard
    /// deviation.
    steps: Vec<(f64, f64, f64)>,
}

impl Filter {
    /// At rows.
    pub fn new(correlation: Correlation, rows: &Rows) -> Self {
        let stationary = correlation.sigma.powi(2);
        let mut variance = stationary;
        let mut before_s = rows.time_s.first().copied().unwrap_or(0.0);
        let step = |((&time_s, &slope), &changed): ((&f64, &f64), &bool)| {
            let forgets = if changed { correlation.forgets } else { 0.0 };
            let decay = (-(time_s - before_s) / correlation.tau_s - forgets).exp();
            before_s = time_s;
            let predicted = stationary + decay * decay * (variance - stationary);
            let own = correlation.white.powi(2) + (correlation.jitter_s * slope).powi(2);
            let innovation = predicted + own;
            let gain = predicted / innovation;
            variance = own * gain;
            (decay, gain, innovation.sqrt().recip())
        };
        Self { steps: rows.time_s.iter().zip(&rows.slope).zip(&rows.changed).map(step).collect() }
    }

    /// White values of a residual at the rows.
    pub fn apply(&self, residual: &[f64]) -> Vec<f64> {
        let mut slow = 0.0;
        let white = |(&(decay, gain, weight), r): (&(f64, f64, f64), &f64)| {
            slow *= decay;
            let innovation = r - slow;
            slow += gain * innovation;
            innovation * weight
        };
        self.steps.iter().zip(residual).map(white).collect()
    }

    /// Sum of the logarithms of the innovations' variances.
    fn log_variances(&self) -> f64 {
        self.steps.iter().map(|(_, _, weight)| -2.0 * weight.ln()).sum()
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution as _, StandardNormal};

    use super::*;

    /// Rows 4 to 16 ms apart.
    fn uneven(count: usize, random: &mut ChaCha8Rng) -> Vec<f64> {
        let mut now_s = 0.0;
        let next = |_| {
            now_s += random.random_range(0.004..0.016);
            now_s
        };
        (0..count).map(next).collect()
    }

    fn rows(time_s: Vec<f64>) -> Rows {
        let count = time_s.len();
        Rows { time_s, slope: vec![0.0; count], changed: vec![false; count] }
    }

    fn normal(random: &mut ChaCha8Rng) -> f64 {
        StandardNormal.sample(random)
    }

    #[test]
    fn innovations_of_such_a_residual_are_white_and_its_numbers_are_found() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let time_s = uneven(8000, &mut random);
        let truth = Correlation { sigma: 3.0, tau_s: 0.5, forgets: 0.0, white: 1.0, jitter_s: 0.0 };
        let (mut slow, mut before_s) = (truth.sigma * normal(&mut random), time_s[0]);
        let residual: Vec<f64> = time_s
            .iter()
            .map(|&t| {
                let decay = (-(t - before_s) / truth.tau_s).exp();
                before_s = t;
                slow = decay * slow + truth.sigma * (1.0 - decay * decay).sqrt() * normal(&mut random);
                slow + truth.white * normal(&mut random)
            })
            .collect();
        let rows = rows(time_s);
        let white = Filter::new(truth, &rows).apply(&residual);
        let n = white.len() as f64;
        let at = |lag: usize| white.iter().zip(&white[lag..]).map(|(a, b)| a * b).sum::<f64>() / n;
        assert!((at(0) - 1.0).abs() < 5.0 * (2.0 / n).sqrt(), "{}", at(0));
        for lag in 1..6 {
            assert!(at(lag).abs() < 5.0 / n.sqrt(), "{lag}: {}", at(lag));
        }
        let found = Correlation::of(&rows, &residual, 1e-6, 0.0);
        assert!(
            (found.sigma / truth.sigma).ln().abs() < 0.35 && (found.tau_s / truth.tau_s).ln().abs() < 0.5,
            "{found:?}"
        );
        assert!((found.white / truth.white).ln().abs() < 0.1, "{found:?}");
    }

    #[test]
    fn an_offset_that_stays_counts_as_one_observation_not_as_many() {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let time_s = uneven(1000, &mut random);
        let mut rows = rows(time_s);
        let slow = Correlation { sigma: 1.0, tau_s: 1e3, forgets: 5.0, white: 0.01, jitter_s: 0.0 };
        let information =
            |rows: &Rows| Filter::new(slow, rows).apply(&vec![1.0; 1000]).iter().map(|z| z * z).sum::<f64>();
        assert!((0.9..1.2).contains(&information(&rows)), "{}", information(&rows));
        // On three plateaus as three.
        (rows.changed[300], rows.changed[700]) = (true, true);
        assert!((2.7..3.3).contains(&information(&rows)), "{}", information(&rows));
    }
}
