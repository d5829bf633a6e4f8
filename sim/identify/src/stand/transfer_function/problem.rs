//! The weighted residuals at the lines as a function of the sections' coefficients.

use nalgebra::DMatrix;
use num_complex::Complex64;
use rotorlead_numerics::least_squares::Residuals;

use super::data::WeightedLines;
use super::sections::Sections;

/// Real and imaginary parts of `(model - measured) / sigma`, scaled to unit variance each. Poles stay in the left half plane.
pub(super) struct SectionsProblem<'a> {
    pub(super) data: &'a WeightedLines,
    pub(super) sections: &'a Sections,
}

/// Half of the variance is in each part.
const PART: f64 = std::f64::consts::SQRT_2;

impl Residuals for SectionsProblem<'_> {
    fn count(&self) -> usize {
        2 * self.data.len()
    }

    fn evaluate(&self, parameters: &[f64], out: &mut [f64]) -> bool {
        if !self.sections.is_stable(parameters) {
            return false;
        }
        let data = self.data;
        for (k, parts) in out.chunks_exact_mut(2).enumerate() {
            let model = self.sections.response(parameters, data.omega_rad_s[k]);
            let residual = (model - data.response[k]) * (PART * data.weight[k]);
            parts.copy_from_slice(&[residual.re, residual.im]);
        }
        true
    }

    fn jacobian(&self, parameters: &[f64], out: &mut DMatrix<f64>) -> bool {
        let data = self.data;
        let mut gradient = vec![Complex64::ZERO; parameters.len()];
        for k in 0..data.len() {
            self.sections.gradient(parameters, data.omega_rad_s[k], &mut gradient);
            let scale = PART * data.weight[k];
            for (j, derivative) in gradient.iter().enumerate() {
                let derivative = derivative * scale;
                out[(2 * k, j)] = derivative.re;
                out[(2 * k + 1, j)] = derivative.im;
            }
        }
        out.iter().all(|value| value.is_finite())
    }
}
