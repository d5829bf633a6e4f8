//! Maximum-likelihood fit of a first-order lag to frequency responses.
//!
//! The model is the paper's (1) with an optional dead time, seen through the holds:
//!
//! ```text
//! G_k(theta) = F_k sum_n H_n(w_k) K e^(-j w_n Td) / (1 + j w_n tau),   theta = (K, tau, Td)
//! ```
//!
//! with `H_n`, `w_n` the images of line `k` ([`super::HoldChain::images`]) and `F_k` a known filter
//! in front of the actuator. Noise at the lines of a periodic record is circular complex normal and
//! independent, so the likelihood is largest where `sum |G_k - G_k(theta)|^2 / s_k^2` is smallest
//! (Pintelon & Schoukens, 2012, section 9.11), and the covariance is `inv(2 Re(J^H S^-1 J))`. It is
//! enlarged by `v / (v - 2)`, since variances `s_k^2` with `v` degrees of freedom stand in for
//! the true ones.
//!
//! The dead time starts at zero. It is kept in the model when it is positive and the likelihood
//! ratio rejects zero at the stated level: the cost's decrease, in units of its expectation, against
//! F(1, v).

use nalgebra::{Matrix3, Vector3};
use num_complex::Complex64;

use super::statistics::f_upper_tail;
use super::{Estimate, HoldChain, IdentifyError, Image, Line};
use crate::plant::Lag;

/// One frequency at which the response is known.
#[derive(Clone, Debug, PartialEq)]
pub struct FitLine {
    /// Frequency in rad/s.
    pub omega_rad_s: f64,
    /// Response over command.
    pub response: Complex64,
    /// Its noise variance.
    pub variance: f64,
    /// Degrees of freedom of `variance`.
    pub dof: f64,
    /// Which frequencies the actuator sees on this line, with what weight: holds and known filter.
    pub images: Vec<Image>,
}

impl FitLine {
    /// A line of a spectrum behind the holds of its record.
    #[must_use]
    pub fn new(line: &Line, holds: &HoldChain) -> Self {
        Self {
            omega_rad_s: line.omega_rad_s,
            response: line.ratio(),
            variance: line.ratio_variance(),
            dof: line.dof,
            images: holds.images(line.omega_rad_s),
        }
    }

    /// The same line with a filter of this response in front of the holds.
    ///
    /// The filter shapes the command's samples, before any hold makes images of them: all images
    /// carry its response at the line itself.
    #[must_use]
    pub fn behind(mut self, filter: Complex64) -> Self {
        for image in &mut self.images {
            image.weight *= filter;
        }
        self
    }

    /// What the rows show of an actuator with this response (argument in rad/s), holds and filter included.
    #[must_use]
    pub fn seen(&self, actuator: impl Fn(f64) -> Complex64) -> Complex64 {
        self.images.iter().map(|image| image.weight * actuator(image.omega_rad_s)).sum()
    }
}

/// How the fit is done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstOrderOptions {
    /// Level of the test that admits a dead time, 0..1; zero keeps the dead time at zero, one admits every positive one.
    pub delay_level: f64,
    /// The largest dead time that is looked for, seconds.
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
        self.parameters().plant(omega_rad_s)
    }

    /// What the rows of `line` would show, holds and filter included.
    #[must_use]
    pub fn response_at(&self, line: &FitLine) -> Complex64 {
        self.parameters().at(line)
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

    fn parameters(&self) -> Parameters {
        Parameters(Vector3::new(self.gain.value, self.time_constant_s.value, self.delay_s.map_or(0.0, |d| d.value)))
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
    if !(0.0..=10.0).contains(&options.max_delay_s) {
        return Err(IdentifyError::Setting { name: "max_delay_s", value: options.max_delay_s, range: "0 to 10 s" });
    }
    if lines.len() < 3 {
        return Err(IdentifyError::TooFewLines { lines: lines.len(), parameters: 3 });
    }
    let lines = &with_usable_variances(lines)?;
    let noise_dof = lines.iter().map(|line| line.dof).fold(f64::INFINITY, f64::min);
    // Expectation of 1 / s^2 over 1 / sigma^2 (chi-square's inverse); it has none below two.
    let inflation = if noise_dof > 2.5 { 1.0 / (1.0 - 2.0 / noise_dof) } else { 5.0 };

    // A long dead time leaves the plain lag without an optimum, so its failure is not yet an end.
    let plain = search(lines, start(lines, 0.0), false);
    let (best, delay_p_value) = if options.delay_level > 0.0 {
        let delayed = search(lines, start_with_delay(lines, options.max_delay_s), true);
        choose(plain, delayed, options.delay_level, |gain| f_upper_tail(2.0 * gain / inflation, 1.0, noise_dof))?
    } else {
        (plain?, None)
    };

    let has_delay = best.has_delay;
    let covariance = best.covariance(lines)? * inflation;
    let estimate =
        |i: usize| Estimate { value: best.parameters.0[i], std: covariance[(i, i)].max(0.0).sqrt(), dof: noise_dof };
    let chi_square = 2.0 * best.cost;
    let residual_dof = 2.0 * lines.len() as f64 - if has_delay { 3.0 } else { 2.0 };
    let reduced_chi_square = chi_square / residual_dof / inflation;
    // Pooling moves noise between neighbours but keeps its sum, so the residual is compared with
    // all of the noise's degrees of freedom, not with one window's.
    let windows = (2.0 * lines.len() as f64 / noise_dof).max(1.0);
    Ok(FirstOrderFit {
        gain: estimate(0),
        time_constant_s: estimate(1),
        delay_s: has_delay.then(|| estimate(2)),
        delay_p_value,
        covariance: std::array::from_fn(|i| std::array::from_fn(|j| covariance[(i, j)])),
        chi_square,
        residual_dof,
        reduced_chi_square,
        model_p_value: f_upper_tail(reduced_chi_square, residual_dof, windows * noise_dof),
    })
}

/// The delayed lag where it has a positive dead time and `tail` of the cost's decrease is below the
/// level; the plain one otherwise. Also that tail probability.
fn choose(
    plain: Result<Optimum, IdentifyError>,
    delayed: Result<Optimum, IdentifyError>,
    level: f64,
    tail: impl Fn(f64) -> f64,
) -> Result<(Optimum, Option<f64>), IdentifyError> {
    match (plain, delayed) {
        (Ok(plain), Err(_)) => Ok((plain, None)),
        (Err(_), Ok(delayed)) if delayed.parameters.delay_s() > 0.0 => Ok((delayed, Some(0.0))),
        (Err(error), _) => Err(error),
        (Ok(plain), Ok(delayed)) => {
            let p = if delayed.parameters.delay_s() > 0.0 { tail(plain.cost - delayed.cost) } else { 1.0 };
            Ok((if p < level { delayed } else { plain }, Some(p)))
        }
    }
}

/// Refuses lines that are not numbers; gives noise-free ones the rounding error as their noise.
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

/// `K`, `tau` and `Td`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Parameters(Vector3<f64>);

impl Parameters {
    fn delay_s(self) -> f64 {
        self.0[2]
    }

    fn plant(self, omega: f64) -> Complex64 {
        let [gain, tau, delay] = self.0.into();
        let x = omega * tau;
        let lag = Complex64::new(1.0, -x) * (gain / (1.0 + x * x));
        if delay == 0.0 { lag } else { lag * Complex64::cis(-omega * delay) }
    }

    fn at(self, line: &FitLine) -> Complex64 {
        line.seen(|omega| self.plant(omega))
    }

    /// The response and its derivatives by `K`, `tau` and `Td`.
    fn derivatives(self, line: &FitLine) -> (Complex64, [Complex64; 3]) {
        let [gain, tau, delay] = self.0.into();
        let (mut value, mut by_tau, mut by_delay) = (Complex64::ZERO, Complex64::ZERO, Complex64::ZERO);
        for image in &line.images {
            let s = Complex64::new(0.0, image.omega_rad_s);
            let x = image.omega_rad_s * tau;
            let lag = Complex64::new(1.0, -x) / (1.0 + x * x);
            let mut part = image.weight * lag * gain;
            if delay != 0.0 {
                part *= Complex64::cis(-image.omega_rad_s * delay);
            }
            value += part;
            by_tau -= part * lag * s;
            by_delay -= part * s;
        }
        (value, [value / gain, by_tau, by_delay])
    }
}

/// Where a search ended.
#[derive(Clone, Debug)]
struct Optimum {
    parameters: Parameters,
    has_delay: bool,
    /// `sum |residual|^2 / s^2`.
    cost: f64,
}

impl Optimum {
    fn covariance(&self, lines: &[FitLine]) -> Result<Matrix3<f64>, IdentifyError> {
        let (normal, _, _) = normal_equations(lines, self.parameters, self.has_delay);
        let scale = column_scale(&normal);
        let scaled = scale * normal * scale;
        let inverse =
            scaled.try_inverse().ok_or(IdentifyError::NoFit { reason: "the lines do not tell gain and lag apart" })?;
        let mut covariance = scale * inverse * scale * 0.5;
        if !self.has_delay {
            covariance[(2, 2)] = 0.0; // its unit diagonal only kept the matrix invertible
        }
        Ok(covariance)
    }
}

/// `Re(J^H S^-1 J)`, `Re(J^H S^-1 r)` and the cost. A parameter that is not searched has a unit
/// diagonal and no gradient.
fn normal_equations(lines: &[FitLine], parameters: Parameters, with_delay: bool) -> (Matrix3<f64>, Vector3<f64>, f64) {
    let (mut normal, mut gradient, mut cost) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
    for line in lines {
        let (value, mut derivatives) = parameters.derivatives(line);
        if !with_delay {
            derivatives[2] = Complex64::ZERO;
        }
        let residual = line.response - value;
        cost += residual.norm_sqr() / line.variance;
        for i in 0..3 {
            gradient[i] += (derivatives[i].conj() * residual).re / line.variance;
            for j in 0..3 {
                normal[(i, j)] += (derivatives[i].conj() * derivatives[j]).re / line.variance;
            }
        }
    }
    if !with_delay {
        normal[(2, 2)] = 1.0;
    }
    (normal, gradient, cost)
}

fn column_scale(normal: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::from_diagonal(&normal.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 1.0 }))
}

/// Levenberg-Marquardt with Marquardt's scaling; a step to a time constant of zero or less is
/// refused like one that raises the cost.
fn search(
    lines: &[FitLine],
    start: Result<Parameters, IdentifyError>,
    has_delay: bool,
) -> Result<Optimum, IdentifyError> {
    let mut parameters = start?;
    let mut damping = 1e-3;
    let (mut normal, mut gradient, mut cost) = normal_equations(lines, parameters, has_delay);
    for _ in 0..100 {
        let scale = column_scale(&normal);
        let damped = scale * normal * scale + Matrix3::identity() * damping;
        let step = damped
            .cholesky()
            .map(|c| scale * c.solve(&(scale * gradient)))
            .ok_or(IdentifyError::NoFit { reason: "the lines do not tell gain and lag apart" })?;
        let next = Parameters(parameters.0 + step);
        let trial = (next.0[1] > 0.0).then(|| normal_equations(lines, next, has_delay));
        // The decrease that a linear model would still bring, in units of the noise.
        let promised = gradient.dot(&step);
        match trial {
            Some((n, g, c)) if c <= cost => {
                (parameters, normal, gradient, cost) = (next, n, g, c);
                damping = (damping * 0.1).max(1e-12);
            }
            _ => damping *= 10.0,
        }
        if promised <= 1e-8 * (1.0 + 1e-3 * cost) {
            return Ok(Optimum { parameters, has_delay, cost });
        }
        if damping > 1e12 {
            break;
        }
    }
    if damping > 1e12 && cost.is_finite() {
        // No step lowers the cost any more: an optimum to the last digit.
        return Ok(Optimum { parameters, has_delay, cost });
    }
    Err(IdentifyError::NoFit { reason: "the search did not settle in 100 steps" })
}

/// Starting values for a given dead time from a linear problem (Levy): with `G` freed of holds,
/// `K - j w tau G = G`, weighted by the noise; then once more with the first denominator divided out
/// (Sanathanan & Koerner), which takes away most of the bias at high frequency.
fn start(lines: &[FitLine], delay_s: f64) -> Result<Parameters, IdentifyError> {
    let mut tau = 0.0;
    let mut gain = f64::NAN;
    for _ in 0..3 {
        // Normal equations of the two real unknowns.
        let (mut n11, mut n12, mut n22, mut r1, mut r2) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for line in lines {
            let s = Complex64::new(0.0, line.omega_rad_s);
            let known =
                line.images.first().map_or(Complex64::ONE, |i| i.weight) * Complex64::cis(-line.omega_rad_s * delay_s);
            let weight = known.norm_sqr() / line.variance / (1.0 + s * tau).norm_sqr();
            let response = line.response / known;
            let by_tau = -s * response;
            n11 += weight;
            n12 += weight * by_tau.re;
            n22 += weight * by_tau.norm_sqr();
            r1 += weight * response.re;
            r2 += weight * (by_tau.conj() * response).re;
        }
        let determinant = n11 * n22 - n12 * n12;
        gain = (n22 * r1 - n12 * r2) / determinant;
        tau = (n11 * r2 - n12 * r1) / determinant;
        if tau.is_nan() || tau <= 0.0 {
            break;
        }
    }
    if !(tau > 0.0 && gain.is_finite()) {
        // Too noisy, or no lag: start in the middle of the lines with the gain of the lowest.
        let lowest = &lines[0];
        tau = lines.len() as f64 / lines.iter().map(|l| l.omega_rad_s).sum::<f64>();
        gain = lowest.response.norm() * lowest.response.re.signum();
    }
    if gain == 0.0 || !gain.is_finite() {
        return Err(IdentifyError::NoFit { reason: "the response is zero" });
    }
    Ok(Parameters(Vector3::new(gain, tau, delay_s)))
}

/// The best start over a grid of dead times, an eighth of the highest line's period apart: the cost
/// has one minimum per half period.
fn start_with_delay(lines: &[FitLine], max_delay_s: f64) -> Result<Parameters, IdentifyError> {
    let top = lines.iter().map(|line| line.omega_rad_s).fold(0.0, f64::max);
    let step = std::f64::consts::TAU / top / 8.0;
    let count = (max_delay_s / step).ceil().min(1000.0) as usize;
    let cost = |parameters: Parameters| {
        lines
            .iter()
            .map(|line| {
                let known = line.images.first().map_or(Complex64::ONE, |i| i.weight);
                let model = known * parameters.plant(line.omega_rad_s);
                (line.response - model).norm_sqr() / line.variance
            })
            .sum::<f64>()
    };
    (0..=count)
        .map(|i| start(lines, step * i as f64))
        .filter_map(Result::ok)
        .map(|parameters| (cost(parameters), parameters))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, parameters)| parameters)
        .ok_or(IdentifyError::NoFit { reason: "the response is zero" })
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    fn chain() -> HoldChain {
        HoldChain::new(1000.0, Some(5000.0), Some(600.0)).unwrap()
    }

    /// 150 lines of a lag with relative noise `noise` of the static gain.
    fn lines(truth: Parameters, noise: f64, seed: u64) -> Vec<FitLine> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let chain = chain();
        let std = noise * truth.0[0].abs();
        (0..150)
            .map(|k| {
                let omega_rad_s = std::f64::consts::TAU * (0.1 + 0.2 * f64::from(k));
                let images = chain.images(omega_rad_s);
                let mut line =
                    FitLine { omega_rad_s, response: Complex64::ZERO, variance: std * std, dof: f64::INFINITY, images };
                let n = Complex64::new(normal(), normal()) * std / 2f64.sqrt();
                line.response = truth.at(&line) + n;
                line
            })
            .collect()
    }

    fn truth(gain: f64, tau: f64, delay: f64) -> Parameters {
        Parameters(Vector3::new(gain, tau, delay))
    }

    #[test]
    fn the_jacobian_is_the_derivative() {
        let at = truth(10.0, 0.1, 0.004);
        for line in &lines(at, 0.0, 1) {
            let (_, derivatives) = at.derivatives(line);
            for (i, derivative) in derivatives.into_iter().enumerate() {
                let h = 1e-6 * at.0[i];
                let (mut up, mut down) = (at, at);
                up.0[i] += h;
                down.0[i] -= h;
                let numeric = (up.at(line) - down.at(line)) / (2.0 * h);
                assert!((derivative - numeric).norm() < 1e-7 * (1.0 + numeric.norm()));
            }
        }
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
