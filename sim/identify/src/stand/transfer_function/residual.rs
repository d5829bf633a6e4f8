//! What the residual says of the model.
//!
//! Three tests, each with its tail probability where the model is the truth and the noise is independent from line to line:
//!
//! - **Power**: chi-square of the residual against its degrees of freedom.
//! - **Whiteness**: the correlation of the residual with itself one to some lines further. A structure that is too simple
//!   leaves a residual that changes slowly over the lines (Pintelon & Schoukens, 2012, section 11.5).
//! - **Independence of the input**: the response from the input to the residual, in time. Its value at lag `t` is
//!   `Re sum r_k e^(j w_k t)` with `r_k` the normalized residual; a model that leaves out dynamics leaves a response at
//!   small lags (Ljung, 1999, section 16.6). What the fit has taken out of the residual is accounted for: the test is
//!   that of the residual's part outside the Jacobian's range.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use num_complex::Complex64;
use rotorlead_numerics::least_squares::Solution;
use rotorlead_numerics::statistics::f_upper_tail;

use super::data::WeightedLines;
use crate::estimate::uncertainty::NoiseKnowledge;

/// Neighbors of the whiteness test, and lags of the independence test. Chosen: dynamics that are left out correlate over a few lines and
/// show in the first lags; more lags dilute the test, fewer miss a slow change.
const LAGS: usize = 10;

/// What the residual says of the model. Tail probabilities are small where the model is wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResidualTests {
    /// `2 sum |residual|^2 / s^2`: chi-square with [`Self::degrees_of_freedom`], were the variances known.
    pub chi_square: f64,
    /// Two per line less the number of parameters.
    pub degrees_of_freedom: f64,
    /// Chi-square over its expectation, with the variances estimated as they are: one for a right model.
    pub reduced_chi_square: f64,
    /// Tail probability of [`Self::reduced_chi_square`].
    pub power_p_value: f64,
    /// Tail probability of the residual's correlation over neighboring lines.
    pub whiteness_p_value: f64,
    /// Tail probability of the residual's response to the input.
    pub input_independence_p_value: f64,
}

impl ResidualTests {
    pub(super) fn compute(data: &WeightedLines, solution: &Solution, noise: &NoiseKnowledge) -> Self {
        let degrees_of_freedom = (2 * data.len() - solution.parameters.len()) as f64;
        let inflation = noise.residual_inflation();
        let reduced_chi_square = solution.sum_of_squares / degrees_of_freedom / inflation;
        let total_dof = noise.total_dof(data.len());
        Self {
            chi_square: solution.sum_of_squares,
            degrees_of_freedom,
            reduced_chi_square,
            power_p_value: f_upper_tail(reduced_chi_square, degrees_of_freedom, total_dof),
            whiteness_p_value: whiteness(&solution.residuals, noise.product_inflation()),
            input_independence_p_value: input_independence(data, solution, inflation, total_dof),
        }
    }
}

/// The correlation at lag `l`, over the residual's power, has variance `1 / (2 n)` in each of its parts, times what the
/// scatter of the weights adds.
fn whiteness(residuals: &[f64], product_inflation: f64) -> f64 {
    let r: Vec<Complex64> = residuals.chunks_exact(2).map(|p| Complex64::new(p[0], p[1])).collect();
    // Chosen: at the longest lag three quarters of the lines still have a partner.
    let lags = LAGS.min(r.len() / 4);
    let power = r.iter().map(Complex64::norm_sqr).sum::<f64>() / r.len() as f64;
    if lags == 0 || power == 0.0 {
        return 1.0;
    }
    let chi_square: f64 = (1..=lags)
        .map(|lag| {
            let correlation: Complex64 = r.iter().zip(&r[lag..]).map(|(a, b)| a.conj() * b).sum();
            2.0 * correlation.norm_sqr() / (power * power * (r.len() - lag) as f64)
        })
        .sum();
    let dof = 2.0 * lags as f64;
    f_upper_tail(chi_square / dof / product_inflation, dof, f64::INFINITY)
}

fn input_independence(data: &WeightedLines, solution: &Solution, inflation: f64, total_dof: f64) -> f64 {
    let Some(covariance) = &solution.unit_covariance else { return 1.0 };
    // Lags half a period of the top line apart: closer ones show nothing more.
    let step = std::f64::consts::PI / data.top_rad_s();
    let probes = DMatrix::from_fn(2 * data.len(), LAGS, |row, lag| {
        let k = row / 2;
        let probe = Complex64::cis(-data.omega_rad_s[k] * step * lag as f64);
        if row % 2 == 0 { probe.re } else { probe.im }
    });
    let jacobian = &solution.jacobian;
    let outside = &probes - jacobian * (covariance * jacobian.tr_mul(&probes));
    let response = outside.tr_mul(&DVector::from_column_slice(&solution.residuals));
    let eigen = SymmetricEigen::new(outside.tr_mul(&outside));
    let largest = eigen.eigenvalues.max();
    let (mut chi_square, mut rank) = (0.0, 0.0);
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        // What the fit has taken out altogether cannot be tested. Chosen: a thousandth of the longest probe, squared.
        if *value > 1e-6 * largest {
            chi_square += vector.dot(&response).powi(2) / value;
            rank += 1.0;
        }
    }
    if rank == 0.0 { 1.0 } else { f_upper_tail(chi_square / rank / inflation, rank, total_dof) }
}
