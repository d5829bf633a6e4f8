//! Confidence bands of a frequency response.
//!
//! The error of a line is circular complex normal with a variance that is itself an average of `v`
//! complex samples, so `|dG|^2 / variance` follows F(2, 2 v) (Pintelon & Schoukens, section 2.4; chi-square
//! with two degrees of freedom where the variance is known). Its quantile has a closed form, since
//! `P(F > x) = (1 + x / v)^-v`.

use rotorlead_numerics::statistics::t_quantile;

use super::{FrequencyResponse, ResponseLine};

impl FrequencyResponse {
    /// Radius of the disc around `line.response` that covers the truth with this probability (0..1), at this
    /// line alone.
    #[must_use]
    pub fn confidence_radius(&self, line: &ResponseLine, probability: f64) -> f64 {
        let dof = self.degrees_of_freedom;
        let without = (1.0 - probability).ln();
        // Both are v (q^(-1/v) - 1) for q = 1 - probability, which is -ln q in the limit.
        let quantile = if dof.is_finite() { dof * (-without / dof).exp_m1() } else { -without };
        (quantile * line.variance).sqrt()
    }

    /// The magnitudes that cover `|G|` with this probability (0..1): half of the variance is radial, and Student's
    /// t has its degrees of freedom. Not below zero.
    #[must_use]
    pub fn magnitude_interval(&self, line: &ResponseLine, probability: f64) -> (f64, f64) {
        let reach = self.reach(line, probability);
        let magnitude = line.response.norm();
        ((magnitude - reach).max(0.0), magnitude + reach)
    }

    /// The same for the phase in radians; all phases where noise hides it.
    #[must_use]
    pub fn phase_interval_rad(&self, line: &ResponseLine, probability: f64) -> (f64, f64) {
        let share = self.reach(line, probability) / line.response.norm();
        let reach = if share < 1.0 { share.asin() } else { std::f64::consts::PI };
        let phase = line.response.arg();
        (phase - reach, phase + reach)
    }

    /// How far a line reaches to either side along one direction.
    fn reach(&self, line: &ResponseLine, probability: f64) -> f64 {
        t_quantile(0.5 + 0.5 * probability, 2.0 * self.degrees_of_freedom) * (0.5 * line.variance).sqrt()
    }
}
