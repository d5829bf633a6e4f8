//! The smooth shape of a noise spectrum.
//!
//! A penalized cubic spline in `x = ln(bin + b)` is fitted to the logarithms of the sample variances (Eilers & Marx,
//! "Flexible smoothing with B-splines and penalties", *Statistical Science* 11, 1996; Pawitan & O'Sullivan, *J. Am. Stat.
//! Assoc.* 89, 1994, for spectra). Logarithms make a line with a thousand times its share pull no harder than a few lines
//! without any. The shift `b` is the width of the pool that the shape is for: the fewer lines of the lowest decade do not rule the
//! fit. Above it a decade takes the same few knots wherever it is, so that a few disturbed lines up there do not bend it.
//!
//! How stiff the spline is follows from the data. The logarithm of a variance of `dof` complex degrees of freedom scatters
//! with the known variance `trigamma(dof)`; the stiffness is the one with the largest marginal likelihood, the second
//! differences of the coefficients being normal (Wood, *Generalized Additive Models*, 2nd ed., 2017, section 6.2). White
//! noise gives a straight line; noise that falls by a low-pass of any corner is followed. The fit needs no scale:
//! [`super::pool`] finds that locally.

use std::f64::consts::LN_10;

use nalgebra::{Cholesky, DMatrix, DVector};

/// With fewer lines than this the shape is flat. Chosen: two pools of eleven lines; within so few, the spline would follow the scatter.
const FEWEST_LINES: usize = 20;
/// The shift `b` in mean distances of two lines: as many as [`super::pool`] takes together by default. Tuned on noise that falls by 35 dB
/// (the test below): with 5 the error of the logarithm is within 0.35, with 11 within 0.2.
const SHIFT_LINES: f64 = 11.0;
/// Distance of the knots in `x`, a factor of 1.5, `e^0.4`, in frequency. Chosen: finer than a low-pass bends; the stiffness, not the knots,
/// decides how smooth the shape is, so that finer ones change only time.
const KNOT_DISTANCE: f64 = 0.4;
/// Stiffness that is tried, decimal exponents: hardly any to a straight line. Chosen: the data of a knot weigh some 1 to 100, so that both
/// ends are far beyond.
const STIFFNESS: (f64, f64) = (-2.0, 6.0);
/// Steps from one to the other: half a decade each. Chosen: the likelihood changes little within a factor of three.
const STIFFNESS_STEPS: u32 = 16;

/// The shape at each of `bins` from the `sample` variances, of `dof` complex degrees of freedom each, of the lines that
/// `counts`.
pub(super) fn fit(sample: &[f64], bins: &[usize], dof: f64, counts: impl Fn(usize) -> bool) -> Vec<f64> {
    shifted(sample, bins, dof, SHIFT_LINES, counts)
}

/// The same with another shift `b`, in mean distances of two lines.
pub(super) fn shifted(
    sample: &[f64],
    bins: &[usize],
    dof: f64,
    shift_lines: f64,
    counts: impl Fn(usize) -> bool,
) -> Vec<f64> {
    let flat = || vec![1.0; sample.len()];
    // A line without any noise has no logarithm; it says nothing of the shape.
    let used: Vec<usize> = (0..sample.len()).filter(|&k| counts(k) && sample[k] > 0.0).collect();
    if used.len() < FEWEST_LINES {
        return flat();
    }
    let splines = Splines::over(bins, shift_lines);
    let count = splines.count;
    let (mut normal, mut moments) = (DMatrix::zeros(count, count), DVector::zeros(count));
    // Around the mean, so that rounding does not depend on the unit of the noise.
    let middle = used.iter().map(|&k| sample[k].ln()).sum::<f64>() / used.len() as f64;
    let precision = trigamma(dof).recip();
    for &k in &used {
        let (first, values) = splines.at(bins[k]);
        for (i, a) in values.iter().enumerate() {
            moments[first + i] += precision * a * (sample[k].ln() - middle);
            for (j, b) in values.iter().enumerate() {
                normal[(first + i, first + j)] += precision * a * b;
            }
        }
    }
    let Some(coefficients) = smoothest(&normal, &moments) else { return flat() };
    // A noise-free simulation has variances of 1e-35, whose exponential is still a number.
    let log_at = |bin: usize| {
        let (first, values) = splines.at(bin);
        middle + values.iter().zip(coefficients.iter().skip(first)).map(|(v, c)| v * c).sum::<f64>()
    };
    bins.iter().map(|&bin| log_at(bin).exp()).collect()
}

/// Coefficients of the stiffness with the largest marginal likelihood.
///
/// With the normal equations `N` and `r` of the data and `P = D'D` of the second differences, twice its negative logarithm
/// is `-r' A^-1 r + ln det A - rank(P) ln(stiffness)` with `A = N + stiffness P`, up to a constant.
fn smoothest(normal: &DMatrix<f64>, moments: &DVector<f64>) -> Option<DVector<f64>> {
    let count = moments.len();
    let differences = DMatrix::from_fn(count - 2, count, |i, j| match j.wrapping_sub(i) {
        0 | 2 => 1.0,
        1 => -2.0,
        _ => 0.0,
    });
    let penalty = differences.tr_mul(&differences);
    let (low, high) = STIFFNESS;
    (0..=STIFFNESS_STEPS)
        .filter_map(|step| {
            let log_stiffness = LN_10 * (low + (high - low) * f64::from(step) / f64::from(STIFFNESS_STEPS));
            let factor = Cholesky::new(normal + &penalty * log_stiffness.exp())?;
            let log_det = 2.0 * factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
            let coefficients = factor.solve(moments);
            let cost = log_det - coefficients.dot(moments) - (count - 2) as f64 * log_stiffness;
            Some((cost, coefficients))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, coefficients)| coefficients)
}

/// Cubic B-splines on evenly spaced knots in `x`.
struct Splines {
    shift: f64,
    low: f64,
    knots_per_x: f64,
    count: usize,
}

impl Splines {
    /// Over two or more increasing `bins`.
    fn over(bins: &[usize], shift_lines: f64) -> Self {
        let (first, last) = (bins[0] as f64, bins[bins.len() - 1] as f64);
        let shift = shift_lines * (last - first) / (bins.len() - 1) as f64;
        let low = (first + shift).ln();
        let range = (last + shift).ln() - low;
        let intervals = (range / KNOT_DISTANCE).ceil().max(1.0);
        // A range of ln(10^9) takes 52 intervals.
        Self { shift, low, knots_per_x: intervals / range, count: intervals as usize + 3 }
    }

    /// The first of the four splines that are not zero at `bin`, and their values.
    fn at(&self, bin: usize) -> (usize, [f64; 4]) {
        let place = ((bin as f64 + self.shift).ln() - self.low) * self.knots_per_x;
        let first = (place.max(0.0) as usize).min(self.count - 4);
        let t = place - first as f64;
        let (t2, t3) = (t * t, t * t * t);
        let u = 1.0 - t;
        let values = [u * u * u, 3.0 * t3 - 6.0 * t2 + 4.0, -3.0 * t3 + 3.0 * t2 + 3.0 * t + 1.0, t3];
        (first, values.map(|v| v / 6.0))
    }
}

/// `d^2 ln Gamma / dx^2` for `x > 0`: the variance of the logarithm of a gamma variable of shape `x`. By its recurrence and,
/// from 8 on, its asymptotic series (Abramowitz & Stegun, 6.4.6 and 6.4.12), to 1e-8.
fn trigamma(x: f64) -> f64 {
    let (mut at, mut sum) = (x, 0.0);
    while at < 8.0 {
        sum += 1.0 / (at * at);
        at += 1.0;
    }
    let inverse = 1.0 / at;
    let square = inverse * inverse;
    let series = 1.0 / 6.0 - square * (1.0 / 30.0 - square * (1.0 / 42.0 - square / 30.0));
    sum + inverse + 0.5 * square + inverse * square * series
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::Distribution;
    use rotorlead_numerics::sample::mean;

    use super::*;

    #[test]
    fn the_splines_sum_to_one_and_trigamma_agrees_with_the_tables() {
        let bins: Vec<usize> = (0..150).map(|k| 4 * k + 1).collect();
        let splines = Splines::over(&bins, SHIFT_LINES);
        for bin in bins {
            let (first, values) = splines.at(bin);
            assert!(first + 4 <= splines.count);
            assert!((values.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            assert!(values.iter().all(|v| *v > -1e-12), "{bin}: {values:?}");
        }
        // pi^2 / 6, pi^2 / 6 - 5 / 4, pi^2 / 2.
        assert!((trigamma(1.0) - 1.644_934_067).abs() < 1e-8);
        assert!((trigamma(3.0) - 0.394_934_067).abs() < 1e-8);
        assert!((trigamma(0.5) - 4.934_802_201).abs() < 1e-8);
    }

    /// Noise behind a low-pass of first order whose corner is at a sixtieth of the highest line: it falls by 35 dB.
    #[test]
    fn white_noise_is_flat_and_a_steep_fall_is_followed() {
        let bins: Vec<usize> = (0..150).map(|k| 4 * k + 1).collect();
        let gamma = rand_distr::Gamma::new(3.0, 1.0 / 3.0).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for (corner, worst) in [(f64::INFINITY, 0.1), (10.0, 0.2)] {
            let truth: Vec<f64> = bins.iter().map(|&b| 1.0 / (1.0 + (b as f64 / corner).powi(2))).collect();
            let runs = 300;
            let mut mean_square = vec![0.0; bins.len()];
            for _ in 0..runs {
                let sample: Vec<f64> = truth.iter().map(|t| t * gamma.sample(&mut rng)).collect();
                let shape = fit(&sample, &bins, 3.0, |_| true);
                // The scale is the pool's business.
                let off: Vec<f64> = shape.iter().zip(&truth).map(|(s, t)| (s / t).ln()).collect();
                let scale = mean(&off);
                for (square, off) in mean_square.iter_mut().zip(&off) {
                    *square += (off - scale).powi(2) / f64::from(runs);
                }
            }
            // The end is known from one side only.
            let inner = mean_square[3..].iter().fold(0.0, |a: f64, b| a.max(*b)).sqrt();
            println!("corner {corner}: at most {inner} off, {} at the lowest line", mean_square[0].sqrt());
            assert!(inner < 2.0 * worst && mean_square[75].sqrt() < worst, "{corner}");
        }
    }
}
