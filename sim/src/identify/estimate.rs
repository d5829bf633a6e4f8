//! A number with its uncertainty.

use super::statistics::t_quantile;

/// An estimated parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The estimate.
    pub value: f64,
    /// Its standard error, from a noise variance that was itself estimated.
    pub std: f64,
    /// Degrees of freedom of that noise variance; infinite when the variance is known.
    pub dof: f64,
}

impl Estimate {
    /// The two-sided interval that covers the truth with this probability (0..1): Student's t with
    /// the degrees of freedom of the noise variance.
    #[must_use]
    pub fn interval(&self, probability: f64) -> (f64, f64) {
        let reach = self.std * t_quantile(0.5 + 0.5 * probability, self.dof);
        (self.value - reach, self.value + reach)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_uses_students_t() {
        let estimate = |dof| Estimate { value: 10.0, std: 1.0, dof }.interval(0.95);
        // Tables: 2.0860 for 20 degrees of freedom, 1.9600 for the normal distribution.
        assert!((estimate(20.0).1 - 12.0860).abs() < 1e-4);
        assert!((estimate(f64::INFINITY).0 - 8.0400).abs() < 1e-4);
    }
}
