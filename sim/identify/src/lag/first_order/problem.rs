//! The weighted residuals of a lag at the lines as a function of its parameters, with derivatives.

use nalgebra::DMatrix;
use num_complex::Complex64;
use rotorlead_numerics::least_squares::{Residuals, Solution, StoppingCriteria, minimize};
use rotorlead_plant::Lag;

use super::FitLine;
use crate::error::IdentifyError;

/// The search ends when a step lowers chi-square, some hundreds, by less than this share: no parameter then moves by a
/// thousandth of its standard error. The iterations are chosen: they bound a search that does not settle, which is refused.
const LIMITS: StoppingCriteria = StoppingCriteria { iterations: 100, decrease: 1e-9 };

/// Real and imaginary parts of `(model - measured) / s` at each line, scaled to unit variance.
///
/// Parameters are `K`, `tau` and, where it is searched, `Td`.
pub(super) struct LagProblem<'a> {
    pub(super) lines: &'a [FitLine],
}

/// The lag of a parameter vector.
pub(super) fn to_lag(parameters: &[f64]) -> Lag {
    Lag { gain: parameters[0], time_constant_s: parameters[1], delay_s: parameters.get(2).copied().unwrap_or(0.0) }
}

/// Half of `variance` is in each part.
fn scale(line: &FitLine) -> f64 {
    (2.0 / line.variance).sqrt()
}

impl Residuals for LagProblem<'_> {
    fn count(&self) -> usize {
        2 * self.lines.len()
    }

    fn evaluate(&self, parameters: &[f64], out: &mut [f64]) -> bool {
        let lag = to_lag(parameters);
        for (line, parts) in self.lines.iter().zip(out.chunks_exact_mut(2)) {
            let residual = (line.seen(|omega| lag.frequency_response(omega)) - line.response) * scale(line);
            parts.copy_from_slice(&[residual.re, residual.im]);
        }
        lag.time_constant_s > 0.0
    }

    fn jacobian(&self, parameters: &[f64], out: &mut DMatrix<f64>) -> bool {
        let lag = to_lag(parameters);
        for (k, line) in self.lines.iter().enumerate() {
            let derivatives = derivatives(&lag, line);
            for (j, derivative) in derivatives.into_iter().enumerate().take(parameters.len()) {
                let derivative = derivative * scale(line);
                out[(2 * k, j)] = derivative.re;
                out[(2 * k + 1, j)] = derivative.im;
            }
        }
        lag.gain != 0.0
    }
}

/// Derivatives of what the rows show of `lag` at `line`, by gain, time constant and dead time.
fn derivatives(lag: &Lag, line: &FitLine) -> [Complex64; 3] {
    let (mut value, mut by_tau, mut by_delay) = (Complex64::ZERO, Complex64::ZERO, Complex64::ZERO);
    for image in &line.images {
        let s = Complex64::new(0.0, image.omega_rad_s);
        let part = image.weight * lag.frequency_response(image.omega_rad_s);
        value += part;
        let x = image.omega_rad_s * lag.time_constant_s;
        by_tau -= part * s * (Complex64::new(1.0, -x) / (1.0 + x * x));
        by_delay -= part * s;
    }
    [value / lag.gain, by_tau, by_delay]
}

/// The best lag from `start` on, its dead time searched or left at zero.
pub(super) fn search(lines: &[FitLine], start: &Lag, with_delay: bool) -> Result<Solution, IdentifyError> {
    let start = [start.gain, start.time_constant_s, start.delay_s];
    let solution = minimize(&LagProblem { lines }, &start[..if with_delay { 3 } else { 2 }], LIMITS)
        .ok_or(IdentifyError::NoFit { reason: "no starting value has a response" })?;
    if solution.converged {
        Ok(solution)
    } else {
        Err(IdentifyError::NoFit { reason: "the search did not settle in 100 steps" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lag::first_order::testing::lines;

    #[test]
    fn the_jacobian_is_the_derivative() {
        let at = [10.0, 0.1, 0.004];
        let lines = lines(to_lag(&at), 0.01, 1);
        let problem = LagProblem { lines: &lines };
        let (mut jacobian, mut up, mut down) = (DMatrix::zeros(300, 3), vec![0.0; 300], vec![0.0; 300]);
        assert!(problem.jacobian(&at, &mut jacobian));
        for j in 0..3 {
            let h = 1e-6 * at[j];
            let shifted = |by: f64| {
                let mut p = at;
                p[j] += by;
                p
            };
            assert!(problem.evaluate(&shifted(h), &mut up) && problem.evaluate(&shifted(-h), &mut down));
            for (k, (up, down)) in up.iter().zip(&down).enumerate() {
                let numeric = (up - down) / (2.0 * h);
                assert!((jacobian[(k, j)] - numeric).abs() < 1e-6 * jacobian.column(j).norm(), "{k} {j}");
            }
        }
    }
}
