//! Maximum-likelihood fit of rational transfer functions to frequency responses.
//!
//! ```text
//! G(j w) = K B(j w) / A(j w)
//! ```
//!
//! with `A` and `B` polynomials with constant term one, in continuous time, and the poles in the left half plane. The
//! input is known, and the noise of the lines is circular complex normal and independent. The likelihood is then largest
//! where `sum |G_k - G(j w_k)|^2 / sigma_k^2` is smallest (Pintelon & Schoukens, *System Identification*, 2nd ed., 2012,
//! section 9.11), with sample variances in place of `sigma_k^2` (section 12.3 and `estimate::uncertainty`).
//!
//! The search starts from a consistent linear estimate (`start`) and moves sections of first and second order
//! (`sections`), so that it holds at order twelve and over several decades.

mod basis;
mod data;
pub(crate) mod error;
mod order;
mod problem;
mod residual;
mod root;
mod search;
mod sections;
mod start;
mod structure;
#[cfg(test)]
mod tests;
mod zeros_and_poles;

use nalgebra::DVector;
use num_complex::Complex64;

use self::data::WeightedLines;
use self::sections::Sections;
use crate::estimate::Estimate;
use crate::estimate::uncertainty::{NoiseKnowledge, Uncertainty};
use crate::frequency_response::FrequencyResponse;
pub use error::ParametricError;
pub use order::{OrderScore, OrderSelection, select_order};
pub use residual::ResidualTests;
pub use root::Root;
pub use structure::{MOST_POLES, Structure};
pub use zeros_and_poles::TransferFunction;

/// A transfer function with its uncertainty and what its residual says of it.
#[derive(Clone, Debug, PartialEq)]
pub struct ParametricFit {
    /// What was fitted.
    pub structure: Structure,
    /// The model.
    pub transfer_function: TransferFunction,
    /// Static gain, output units per input unit.
    pub gain: Estimate,
    /// Poles by frequency, a pair as one.
    pub poles: Vec<Root>,
    /// Zeros by frequency, a pair as one.
    pub zeros: Vec<Root>,
    /// What the residual says.
    pub residual: ResidualTests,
    sections: Sections,
    parameters: Vec<f64>,
    uncertainty: Uncertainty,
}

impl ParametricFit {
    /// The model's response at a frequency in rad/s.
    #[must_use]
    pub fn response(&self, omega_rad_s: f64) -> Complex64 {
        self.sections.response(&self.parameters, omega_rad_s)
    }

    /// Standard error of `ln |G / G(0)|` at a frequency in rad/s.
    #[must_use]
    pub fn attenuation_std(&self, omega_rad_s: f64) -> f64 {
        let mut gradient = vec![Complex64::ZERO; self.parameters.len()];
        let value = self.sections.gradient(&self.parameters, omega_rad_s, &mut gradient);
        let mut gradient = DVector::from_iterator(gradient.len(), gradient.iter().map(|g| (g / value).re));
        // The gain is common to both.
        gradient[0] = 0.0;
        self.uncertainty.estimate(0.0, &gradient).std
    }

    /// Undamped frequency in rad/s and damping ratio of a second-order denominator, which are defined for real poles
    /// too; `None` for other orders. For their intervals use [`Estimate::interval_of_logarithm`].
    #[must_use]
    pub fn second_order(&self) -> Option<(Estimate, Estimate)> {
        let (section, at) = self.sections.placed_poles().next()?;
        if self.structure.poles != 2 {
            return None;
        }
        let (c1, c2) = (self.parameters[at.start], self.parameters[at.start + 1]);
        if c2 <= 0.0 {
            return None;
        }
        let estimate = |value: f64, by_first: f64, by_second: f64| {
            let mut gradient = DVector::zeros(self.parameters.len());
            (gradient[at.start], gradient[at.start + 1]) = (by_first, by_second);
            self.uncertainty.estimate(value, &gradient)
        };
        let (frequency, damping) = (section.scale_rad_s / c2.sqrt(), 0.5 * c1 / c2.sqrt());
        Some((estimate(frequency, 0.0, -0.5 * frequency / c2), estimate(damping, 0.5 / c2.sqrt(), -0.5 * damping / c2)))
    }
}

/// Fits a model of `structure`.
///
/// # Errors
/// [`ParametricError`] when the structure is out of range, a line is unusable, the noise is known from too few samples, or no model is
/// found.
pub fn fit_parametric(response: &FrequencyResponse, structure: Structure) -> Result<ParametricFit, ParametricError> {
    structure.check(response.lines.len())?;
    fit(&WeightedLines::new(response)?, structure, response.noise_knowledge())
}

fn fit(data: &WeightedLines, structure: Structure, noise: NoiseKnowledge) -> Result<ParametricFit, ParametricError> {
    let search::BestFit { sections, solution } = search::search(data, structure)?;
    let residual = ResidualTests::compute(data, &solution, &noise);
    let unit = solution.unit_covariance.ok_or(ParametricError::NoFit {
        poles: structure.poles,
        zeros: structure.zeros,
        reason: "the lines do not tell its parameters apart",
    })?;
    let uncertainty = Uncertainty::new(unit, solution.jacobian, noise);
    let parameters = solution.parameters;
    let by_frequency = |mut roots: Vec<Root>| {
        roots.sort_by(|a, b| a.frequency_rad_s.value.total_cmp(&b.frequency_rad_s.value));
        roots
    };
    Ok(ParametricFit {
        structure,
        transfer_function: TransferFunction {
            gain: parameters[0],
            poles: sections.poles(&parameters),
            zeros: sections.zeros(&parameters),
        },
        gain: uncertainty.parameter(parameters[0], 0),
        poles: by_frequency(sections.placed_poles().flat_map(|p| root::roots(p, &parameters, &uncertainty)).collect()),
        zeros: by_frequency(sections.placed_zeros().flat_map(|p| root::roots(p, &parameters, &uncertainty)).collect()),
        residual,
        sections,
        parameters,
        uncertainty,
    })
}
