//! Maximum-likelihood fit of a first-order lag to frequency responses.
//!
//! The model is the paper's (1) with an optional dead time, seen through the holds:
//!
//! ```text
//! G_k(theta) = F_k sum_n H_n(w_k) K e^(-j w_n Td) / (1 + j w_n tau),   theta = (K, tau, Td)
//! ```
//!
//! with `H_n`, `w_n` the images of line `k` ([`HoldChain::images`](crate::frequency_response::hold::HoldChain::images)) and `F_k` a known filter
//! in front of the actuator. Noise at the lines of a periodic record is circular complex normal and
//! independent, so the likelihood is largest where `sum |G_k - G_k(theta)|^2 / s_k^2` is smallest
//! (Pintelon & Schoukens, 2012, section 9.11), and the covariance is `inv(2 Re(J^H S^-1 J))`,
//! enlarged since sample variances `s_k^2` stand in for the true ones (`estimate::uncertainty`, as for rational transfer
//! functions; those have no images, and so a search of their own).
//!
//! The dead time starts at zero. It is kept in the model when it is positive and the likelihood
//! ratio rejects zero at the stated level: the cost's decrease, in units of its expectation, against
//! F(1, v), with `v` those of the dead time's own error.

mod line;
mod problem;
mod start;

use num_complex::Complex64;
use rotorlead_numerics::least_squares::Solution;
use rotorlead_numerics::statistics::f_upper_tail;
use rotorlead_plant::Lag;

use crate::error::IdentifyError;
use crate::estimate::Estimate;
use crate::estimate::uncertainty::{NoiseKnowledge, Uncertainty};
pub use line::FitLine;
use problem::{search, to_lag};
use start::start;

/// How the fit is done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstOrderOptions {
    /// Level of the test that admits a dead time, 0..1; zero keeps the dead time at zero, one admits every positive one. The default of
    /// 0.01 is chosen: a dead time of less than 2.6 of its standard errors (normal, two-sided) is left out.
    pub delay_level: f64,
    /// The largest dead time that is looked for, seconds. The default of 0.1 is chosen: a motor's, with an ESC's frame and telemetry, is
    /// shorter; a longer one is that of a log or of two clocks.
    pub max_delay_s: f64,
}

impl Default for FirstOrderOptions {
    fn default() -> Self {
        Self { delay_level: 0.01, max_delay_s: 0.1 }
    }
}

/// A first-order lag with its uncertainty.
#[derive(Clone, Debug, PartialEq)]
pub struct FirstOrderFit {
    /// Static gain `K`, response units per unit of command.
    pub gain: Estimate,
    /// Time constant `tau` in seconds.
    pub time_constant_s: Estimate,
    /// Dead time `Td` in seconds beyond the holds; `None` when zero explains the data.
    pub delay_s: Option<Estimate>,
    /// Tail probability of the likelihood ratio of zero dead time against the best one; one when
    /// the best one is not positive, `None` when it was not looked for.
    pub delay_p_value: Option<f64>,
    /// Covariance of `K`, `tau`, `Td`; the last row and column are zero without dead time.
    pub covariance: [[f64; 3]; 3],
    /// `2 sum |residual|^2 / s^2`: chi-square with [`Self::residual_dof`] degrees of freedom, were
    /// the variances known.
    pub chi_square: f64,
    /// Two per line less the number of parameters.
    pub residual_dof: f64,
    /// `chi_square / residual_dof`, divided by the `v / (v - 2)` that it expects with estimated
    /// variances: one where model and noise explain the data.
    pub reduced_chi_square: f64,
    /// Tail probability of `reduced_chi_square`; small when the model's structure is too simple.
    pub model_p_value: f64,
}

impl FirstOrderFit {
    /// The actuator's response `K e^(-j w Td) / (1 + j w tau)`, without holds.
    #[must_use]
    pub fn response(&self, omega_rad_s: f64) -> Complex64 {
        self.lag().frequency_response(omega_rad_s)
    }

    /// What the rows of `line` would show, holds and filter included.
    #[must_use]
    pub fn response_at(&self, line: &FitLine) -> Complex64 {
        line.seen(|omega_rad_s| self.response(omega_rad_s))
    }

    /// Its three numbers, with a dead time of zero where zero explains the data.
    #[must_use]
    pub fn lag(&self) -> Lag {
        Lag {
            gain: self.gain.value,
            time_constant_s: self.time_constant_s.value,
            delay_s: self.delay_s.map_or(0.0, |d| d.value),
        }
    }
}

/// Fits a first-order lag to the lines, of one record or several.
///
/// # Errors
/// [`IdentifyError::TooFewLines`] with fewer than three lines, [`IdentifyError::NoFit`] when a variance is
/// zero or the search finds no positive time constant, [`IdentifyError::Setting`] when an option is
/// outside its range.
pub fn fit_first_order(lines: &[FitLine], options: &FirstOrderOptions) -> Result<FirstOrderFit, IdentifyError> {
    if !(0.0..=1.0).contains(&options.delay_level) {
        return Err(IdentifyError::Setting { name: "delay_level", value: options.delay_level, range: "0 to 1" });
    }
    // Chosen: beyond 10 s it is a slip of the unit.
    if !(0.0..=10.0).contains(&options.max_delay_s) {
        return Err(IdentifyError::Setting { name: "max_delay_s", value: options.max_delay_s, range: "0 to 10 s" });
    }
    if lines.len() < 3 {
        return Err(IdentifyError::TooFewLines { lines: lines.len(), parameters: 3 });
    }
    let lines = &with_usable_variances(lines)?;
    let noise = noise_knowledge(lines);

    // A long dead time leaves the plain lag without an optimum, so its failure is not yet an end.
    let plain = start(lines, 0.0).and_then(|start| search(lines, &start, false));
    let (best, delay_p_value) = if options.delay_level > 0.0 {
        let delayed = start(lines, options.max_delay_s).and_then(|start| search(lines, &start, true));
        choose(plain, delayed, options.delay_level, |gain, delayed| {
            let (inflation, dof) =
                compute_uncertainty(delayed, noise).map_or((1.0, 1.0), |u| u.inflation_of_parameter(2));
            f_upper_tail(gain / inflation, 1.0, dof)
        })?
    } else {
        (plain?, None)
    };

    let has_delay = best.parameters.len() > 2;
    let uncertainty = compute_uncertainty(&best, noise)
        .ok_or(IdentifyError::NoFit { reason: "the lines do not tell gain and lag apart" })?;
    let estimate = |i: usize| uncertainty.parameter(best.parameters[i], i);
    let covariance = uncertainty.covariance();
    let chi_square = best.sum_of_squares;
    let residual_dof = 2.0 * lines.len() as f64 - if has_delay { 3.0 } else { 2.0 };
    let reduced_chi_square = chi_square / residual_dof / noise.residual_inflation();
    Ok(FirstOrderFit {
        gain: estimate(0),
        time_constant_s: estimate(1),
        delay_s: has_delay.then(|| estimate(2)),
        delay_p_value,
        covariance: std::array::from_fn(|i| std::array::from_fn(|j| covariance.get((i, j)).copied().unwrap_or(0.0))),
        chi_square,
        residual_dof,
        reduced_chi_square,
        model_p_value: f_upper_tail(reduced_chi_square, residual_dof, noise.total_dof(lines.len())),
    })
}

/// The parameters' uncertainty; `None` where the lines do not tell them apart.
fn compute_uncertainty(solution: &Solution, noise: NoiseKnowledge) -> Option<Uncertainty> {
    Some(Uncertainty::new(solution.unit_covariance.clone()?, solution.jacobian.clone(), noise))
}

/// The delayed lag where it has a positive dead time and `tail` of the decrease of chi-square to it is below the
/// level; the plain one otherwise. Also that tail probability.
fn choose(
    plain: Result<Solution, IdentifyError>,
    delayed: Result<Solution, IdentifyError>,
    level: f64,
    tail: impl Fn(f64, &Solution) -> f64,
) -> Result<(Solution, Option<f64>), IdentifyError> {
    let is_delay = |solution: &Solution| to_lag(&solution.parameters).delay_s > 0.0;
    match (plain, delayed) {
        (Ok(plain), Err(_)) => Ok((plain, None)),
        (Err(_), Ok(delayed)) if is_delay(&delayed) => Ok((delayed, Some(0.0))),
        (Err(error), _) => Err(error),
        (Ok(plain), Ok(delayed)) => {
            let gain = plain.sum_of_squares - delayed.sum_of_squares;
            let p = if is_delay(&delayed) { tail(gain, &delayed) } else { 1.0 };
            Ok((if p < level { delayed } else { plain }, Some(p)))
        }
    }
}

/// Refuses lines that are not numbers; gives noise-free ones the rounding error as their noise: 1e-8 of the largest response, the
/// square root of a double's resolution.
fn with_usable_variances(lines: &[FitLine]) -> Result<Vec<FitLine>, IdentifyError> {
    let largest = lines.iter().map(|line| line.response.norm()).fold(0.0, f64::max);
    let usable = largest > 0.0
        && lines.iter().all(|line| line.response.is_finite() && line.variance >= 0.0 && line.variance.is_finite());
    if !usable {
        return Err(IdentifyError::NoFit { reason: "the response or its noise is zero or not finite" });
    }
    let floor = (1e-8 * largest).powi(2);
    Ok(lines.iter().map(|line| FitLine { variance: line.variance.max(floor), ..line.clone() }).collect())
}

/// What is known of the noise of the least known of `lines`, one or more. Below three degrees of freedom, weights from samples have
/// no finite variance: three are then taken for it.
fn noise_knowledge(lines: &[FitLine]) -> NoiseKnowledge {
    let dof = lines.iter().map(|line| 0.5 * line.dof).fold(f64::INFINITY, f64::min);
    let pooled = lines.iter().map(|line| line.pooled).fold(1.0, f64::max);
    NoiseKnowledge { dof: dof.max(3.0), pooled }
}

#[cfg(test)]
mod testing {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::frequency_response::hold::HoldChain;

    fn chain() -> HoldChain {
        HoldChain::new(1000.0, Some(5000.0), Some(600.0)).unwrap()
    }

    /// 150 lines of a lag with relative noise `noise` of the static gain.
    pub(super) fn lines(truth: Lag, noise: f64, seed: u64) -> Vec<FitLine> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let chain = chain();
        let std = noise * truth.gain.abs();
        (0..150)
            .map(|k| {
                let omega_rad_s = std::f64::consts::TAU * (0.1 + 0.2 * f64::from(k));
                let images = chain.images(omega_rad_s);
                let (variance, dof, pooled) = (std * std, f64::INFINITY, 1.0);
                let mut line = FitLine { omega_rad_s, response: Complex64::ZERO, variance, dof, pooled, images };
                let n = Complex64::new(normal(), normal()) * std / 2f64.sqrt();
                line.response = line.seen(|omega| truth.frequency_response(omega)) + n;
                line
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::testing::lines;
    use super::*;

    fn truth(gain: f64, time_constant_s: f64, delay_s: f64) -> Lag {
        Lag { gain, time_constant_s, delay_s }
    }

    #[test]
    fn exact_data_give_the_exact_parameters() {
        // Also revolutions per minute, a negative gain, and delays beyond the top line's period.
        for (gain, tau, delay) in
            [(10.0, 0.1593, 0.0), (9e3, 0.02, 0.0), (-2.0, 0.3, 0.0), (10.0, 0.1, 0.026), (5.0, 0.05, 0.09)]
        {
            let fit = fit_first_order(&lines(truth(gain, tau, delay), 0.0, 1), &FirstOrderOptions::default()).unwrap();
            assert!((fit.gain.value / gain - 1.0).abs() < 1e-7, "{fit:?}");
            assert!((fit.time_constant_s.value / tau - 1.0).abs() < 1e-7, "{fit:?}");
            assert!((fit.delay_s.map_or(0.0, |d| d.value) - delay).abs() < 1e-9, "{fit:?}");
        }
    }

    #[test]
    fn errors_are_the_cramer_rao_bound_and_a_delay_is_admitted_at_its_level() {
        let options = FirstOrderOptions::default();
        let (mut squares, mut chi_square, mut delays) = ([0.0; 2], 0.0, 0);
        let runs = 1500;
        for seed in 0..runs {
            let fit = fit_first_order(&lines(truth(10.0, 0.1, 0.0), 0.01, seed), &options).unwrap();
            squares[0] += ((fit.gain.value - 10.0) / fit.gain.std).powi(2);
            squares[1] += ((fit.time_constant_s.value - 0.1) / fit.time_constant_s.std).powi(2);
            chi_square += fit.reduced_chi_square;
            delays += u32::from(fit.delay_s.is_some());
        }
        // Mean of 1500 squares: deviation sqrt(2 / 1500) = 0.037; of chi-square / 298: 0.0021.
        for square in squares {
            assert!((square / runs as f64 - 1.0).abs() < 0.13, "{squares:?}");
        }
        assert!((chi_square / runs as f64 - 1.0).abs() < 0.008, "{chi_square}");
        // One-sided at a two-sided level of 0.01: 7.5 of 1500, at most 18 in all but 1 of 2000.
        assert!(delays <= 18, "{delays}");
    }

    #[test]
    fn a_delay_is_found_within_its_interval_and_not_charged_to_the_lag() {
        let fit = fit_first_order(&lines(truth(10.0, 0.1, 0.005), 0.005, 7), &FirstOrderOptions::default()).unwrap();
        let delay = fit.delay_s.expect("5 ms are many standard errors");
        assert!((delay.value - 0.005).abs() < 3.5 * delay.std, "{delay:?}");
        assert!(delay.std < 5e-4, "{delay:?}");
        let tau = fit.time_constant_s;
        assert!((tau.value - 0.1).abs() < 3.5 * tau.std, "{tau:?}");
    }

    #[test]
    fn a_response_of_second_order_fails_the_chi_square() {
        let mut lines = lines(truth(10.0, 0.1, 0.0), 0.002, 3);
        for line in &mut lines {
            line.response /= Complex64::new(1.0, line.omega_rad_s * 0.02);
        }
        let options = FirstOrderOptions { delay_level: 0.0, ..FirstOrderOptions::default() };
        let fit = fit_first_order(&lines, &options).unwrap();
        assert!(fit.model_p_value < 1e-6 && fit.reduced_chi_square > 2.0, "{fit:?}");
    }

    #[test]
    fn nonsense_is_refused() {
        let mut good = lines(truth(10.0, 0.1, 0.0), 0.01, 3);
        let options = FirstOrderOptions::default();
        assert!(matches!(fit_first_order(&good[..2], &options), Err(IdentifyError::TooFewLines { lines: 2, .. })));
        assert!(fit_first_order(&good, &FirstOrderOptions { delay_level: 2.0, ..options }).is_err());
        good[3].response.re = f64::NAN;
        assert!(matches!(fit_first_order(&good, &options), Err(IdentifyError::NoFit { .. })));
    }
}
