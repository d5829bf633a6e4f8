//! Nonlinear least squares by Levenberg-Marquardt.
//!
//! Minimizes `S(p) = sum r_i(p)^2`. Each step solves `(J'J + lambda D) dp = -J'r` with `D` the largest
//! diagonal of `J'J` seen so far (Moré 1978: the steps then do not depend on the parameters' units) and
//! `lambda` set by how much of the predicted decrease came true (Nielsen 1999). The normal equations
//! square the condition number, so parameters should be chosen so that a unit step of each means
//! something alike: logarithms for time constants, for example.

use nalgebra::{Cholesky, DMatrix, DVector};

/// A model's misfit as a function of its parameters.
pub trait Residuals {
    /// Number of residuals.
    fn count(&self) -> usize;

    /// Writes the residuals (model minus data, weighted if wanted) at `parameters` into `out`. `false`
    /// where the model is not defined there; the search then takes a shorter step.
    fn evaluate(&self, parameters: &[f64], out: &mut [f64]) -> bool;

    /// Writes the derivatives, row per residual and column per parameter, into `out`. Central
    /// differences unless the model knows better. `false` as for [`Residuals::evaluate`].
    fn jacobian(&self, parameters: &[f64], out: &mut DMatrix<f64>) -> bool {
        let mut at = parameters.to_vec();
        let mut ahead = vec![0.0; self.count()];
        let mut behind = vec![0.0; self.count()];
        for (j, &p) in parameters.iter().enumerate() {
            // The cube root of the rounding unit balances rounding against the cubic term.
            let step = f64::EPSILON.cbrt() * p.abs().max(self.typical(j));
            at[j] = p + step;
            let ok = self.evaluate(&at, &mut ahead);
            at[j] = p - step;
            if !(ok && self.evaluate(&at, &mut behind)) {
                return false;
            }
            at[j] = p;
            for ((d, a), b) in out.column_mut(j).iter_mut().zip(&ahead).zip(&behind) {
                *d = (a - b) / (2.0 * step);
            }
        }
        true
    }

    /// A magnitude that parameter `index` has or may have; sizes the difference step where the
    /// parameter is near zero.
    fn typical(&self, _index: usize) -> f64 {
        1.0
    }
}

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Most steps tried, accepted or not.
    pub iterations: usize,
    /// Relative decrease of the sum of squares below which the search has converged.
    pub decrease: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { iterations: 100, decrease: 1e-12 }
    }
}

/// Where the search ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// The parameters.
    pub parameters: Vec<f64>,
    /// Residuals there.
    pub residuals: Vec<f64>,
    /// Derivatives there, row per residual and column per parameter.
    pub jacobian: DMatrix<f64>,
    /// Sum of squared residuals.
    pub sum_of_squares: f64,
    /// `(J'J)^-1`: the parameters' covariance for residuals of unit variance that are independent.
    /// Multiply by the residuals' variance, or use [`Solution::covariance_of`] when they are not
    /// independent. `None` where the data leave a combination of parameters undetermined.
    pub unit_covariance: Option<DMatrix<f64>>,
    /// Whether the sum stopped decreasing before the steps ran out.
    pub converged: bool,
    /// Steps tried.
    pub iterations: usize,
}

impl Solution {
    /// Covariance for residuals whose covariance matrix maps `J` to `noise_times_jacobian`:
    /// `(J'J)^-1 J' (R J) (J'J)^-1` (Ljung, section 9.4). Takes the product because `R` itself is too
    /// large to hold.
    #[must_use]
    pub fn covariance_of(&self, noise_times_jacobian: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let unit = self.unit_covariance.as_ref()?;
        Some(unit * (self.jacobian.transpose() * noise_times_jacobian) * unit)
    }
}

/// Searches from `start`. `None` when the model or its derivatives are not defined there.
#[must_use]
pub fn minimize(model: &impl Residuals, start: &[f64], limits: Limits) -> Option<Solution> {
    let (n, m) = (model.count(), start.len());
    let mut at = start.to_vec();
    let mut residuals = vec![0.0; n];
    let mut jacobian = DMatrix::zeros(n, m);
    if !model.evaluate(&at, &mut residuals) || !model.jacobian(&at, &mut jacobian) {
        return None;
    }
    let mut sum = dot(&residuals);
    if !sum.is_finite() {
        return None;
    }
    let mut trial = vec![0.0; n];
    let mut scale = DVector::zeros(m);
    let (mut lambda, mut growth) = (1e-3, 2.0);
    let mut converged = sum == 0.0;
    let mut iterations = 0;
    let (mut normal, mut gradient) = normal_equations(&jacobian, &residuals);
    while !converged && iterations < limits.iterations {
        iterations += 1;
        for (s, d) in scale.iter_mut().zip(normal.diagonal().iter()) {
            *s = f64::max(*s, *d);
        }
        let mut damped = normal.clone();
        for (j, s) in scale.iter().enumerate() {
            // A parameter without any effect stays where it is.
            damped[(j, j)] += lambda * if *s > 0.0 { *s } else { 1.0 };
        }
        let Some(factor) = Cholesky::new(damped) else {
            lambda *= growth;
            growth *= 2.0;
            continue;
        };
        let step = -factor.solve(&gradient);
        let moved: Vec<f64> = at.iter().zip(step.iter()).map(|(a, d)| a + d).collect();
        let predicted = -(2.0 * gradient.dot(&step) + step.dot(&(&normal * &step)));
        let new_sum = if model.evaluate(&moved, &mut trial) { dot(&trial) } else { f64::INFINITY };
        let ratio = (sum - new_sum) / predicted;
        let mut next = DMatrix::zeros(0, 0);
        let accepted = ratio > 0.0 && {
            next = DMatrix::zeros(n, m);
            model.jacobian(&moved, &mut next)
        };
        if accepted {
            converged = sum - new_sum <= limits.decrease * sum;
            at = moved;
            sum = new_sum;
            std::mem::swap(&mut residuals, &mut trial);
            jacobian = next;
            (normal, gradient) = normal_equations(&jacobian, &residuals);
            lambda *= f64::max(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0).powi(3));
            growth = 2.0;
        } else {
            // Not even the linear model promises a decrease: this is the minimum to rounding.
            converged = predicted.abs() <= limits.decrease * sum;
            lambda *= growth;
            growth *= 2.0;
        }
    }
    Some(Solution {
        unit_covariance: scaled_inverse(&normal),
        parameters: at,
        residuals,
        jacobian,
        sum_of_squares: sum,
        converged,
        iterations,
    })
}

fn dot(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum()
}

fn normal_equations(jacobian: &DMatrix<f64>, residuals: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
    let normal = jacobian.tr_mul(jacobian);
    let gradient = jacobian.tr_mul(&DVector::from_column_slice(residuals));
    (normal, gradient)
}

/// Inverse of a positive definite matrix, with rows and columns scaled to a unit diagonal first so
/// that the parameters' units do not decide whether it exists.
fn scaled_inverse(normal: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale = normal.diagonal().map(|d| d.sqrt().recip());
    if !scale.iter().all(|s| s.is_finite()) {
        return None;
    }
    let scaled = DMatrix::from_fn(normal.nrows(), normal.ncols(), |i, j| normal[(i, j)] * scale[i] * scale[j]);
    let inverse = Cholesky::new(scaled)?.inverse();
    Some(DMatrix::from_fn(normal.nrows(), normal.ncols(), |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Misra1a;

    /// NIST StRD Misra1a: y = b1 (1 - exp(-b2 x)), with certified values.
    const MISRA1A: [(f64, f64); 14] = [
        (77.6, 10.07),
        (114.9, 14.73),
        (141.1, 17.94),
        (190.8, 23.93),
        (239.9, 29.61),
        (289.0, 35.18),
        (332.8, 40.02),
        (378.4, 44.82),
        (434.8, 50.76),
        (477.3, 55.05),
        (536.8, 61.01),
        (593.1, 66.40),
        (689.1, 75.47),
        (760.0, 81.78),
    ];

    impl Residuals for Misra1a {
        fn count(&self) -> usize {
            MISRA1A.len()
        }

        fn evaluate(&self, p: &[f64], out: &mut [f64]) -> bool {
            for (r, (x, y)) in out.iter_mut().zip(MISRA1A) {
                *r = p[0] * (1.0 - (-p[1] * x).exp()) - y;
            }
            p[1] > 0.0
        }

        fn typical(&self, index: usize) -> f64 {
            [100.0, 1e-3][index]
        }
    }

    #[test]
    fn certified_values_of_a_reference_problem() {
        let s = minimize(&Misra1a, &[500.0, 1e-4], Limits::default()).unwrap();
        assert!(s.converged);
        let relative = |value: f64, certified: f64| (value / certified - 1.0).abs();
        assert!(relative(s.parameters[0], 2.3894212918E+02) < 1e-6, "{s:?}");
        assert!(relative(s.parameters[1], 5.5015643181E-04) < 1e-6);
        assert!(relative(s.sum_of_squares, 1.2455138894E-01) < 1e-8);
        // S / (n - p) estimates the variance (Ljung, System Identification, 2nd ed., section 9.6).
        let variance = s.sum_of_squares / 12.0;
        let covariance = s.unit_covariance.as_ref().unwrap() * variance;
        assert!(relative(covariance[(0, 0)].sqrt(), 2.7070075241E+00) < 1e-5);
        assert!(relative(covariance[(1, 1)].sqrt(), 7.2668688436E-06) < 1e-5);
        // Independent residuals of equal variance are a special case of the general covariance.
        let general = s.covariance_of(&(&s.jacobian * variance)).unwrap();
        assert!((&general - &covariance).norm() < 1e-9 * covariance.norm());
    }

    struct Redundant;

    impl Residuals for Redundant {
        fn count(&self) -> usize {
            3
        }

        fn evaluate(&self, p: &[f64], out: &mut [f64]) -> bool {
            for (k, r) in out.iter_mut().enumerate() {
                *r = p[0] + p[1] - k as f64;
            }
            true
        }
    }

    #[test]
    fn what_the_data_do_not_determine_has_no_covariance() {
        let s = minimize(&Redundant, &[0.3, 0.1], Limits::default()).unwrap();
        assert!((s.parameters[0] + s.parameters[1] - 1.0).abs() < 1e-9);
        let known = s.unit_covariance.is_some_and(|c| c[(0, 0)] < 1e6);
        assert!(!known);
    }
}
