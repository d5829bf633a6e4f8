//! A number with its uncertainty.

pub(crate) mod uncertainty;

use rotorlead_numerics::statistics::t_quantile;
use serde::ser::SerializeStruct as _;
use serde::{Serialize, Serializer};

/// Relative standard error above which a time constant is not known. Derived: its 95 % interval is a factor of exp(1.96 x 0.35) = 2 to
/// either side.
pub(crate) const MAX_RELATIVE_STD: f64 = 0.35;

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

/// With its 95 % interval.
impl Serialize for Estimate {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut values = serializer.serialize_struct("Estimate", 3)?;
        values.serialize_field("value", &self.value)?;
        values.serialize_field("std", &self.std)?;
        values.serialize_field("interval", &self.interval(0.95))?;
        values.end()
    }
}

impl Estimate {
    /// An estimate whose noise is known so well that its error is normal.
    #[must_use]
    pub fn normal(value: f64, std: f64) -> Self {
        Self { value, std, dof: f64::INFINITY }
    }

    /// The two-sided interval that covers the truth with this probability (0..1): Student's t with
    /// the degrees of freedom of the noise variance.
    #[must_use]
    pub fn interval(&self, probability: f64) -> (f64, f64) {
        let reach = self.reach(probability);
        (self.value - reach, self.value + reach)
    }

    /// The same for a value whose sign is sure and whose standard error grows with it, such as a time constant, a
    /// corner frequency or a damping ratio: the error of the logarithm is closer to Student's t, and the interval misses the
    /// truth as often above as below. The two intervals differ in the square of the relative standard error.
    #[must_use]
    pub fn interval_of_logarithm(&self, probability: f64) -> (f64, f64) {
        let factor = (self.reach(probability) / self.value.abs()).exp();
        let (near, far) = (self.value / factor, self.value * factor);
        (near.min(far), near.max(far))
    }

    /// Whether its 95 % interval leaves `value` out.
    #[must_use]
    pub fn excludes(&self, value: f64) -> bool {
        (self.value - value).abs() > self.reach(0.95)
    }

    /// How far the interval reaches to either side.
    fn reach(&self, probability: f64) -> f64 {
        self.std * t_quantile(0.5 + 0.5 * probability, self.dof)
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

    #[test]
    fn the_interval_of_a_logarithm_has_the_value_in_its_geometric_middle() {
        let (low, high) = Estimate::normal(0.1, 0.02).interval_of_logarithm(0.95);
        assert!((low * high - 0.01).abs() < 1e-15);
        assert!(((high / low).ln() - 2.0 * 1.959_964 * 0.2).abs() < 1e-6);
        assert_eq!(Estimate::normal(-0.1, 0.02).interval_of_logarithm(0.95), (-high, -low));
    }

    #[test]
    fn what_is_outside_the_interval_is_excluded() {
        let estimate = Estimate::normal(1.0, 0.1);
        assert!(!estimate.excludes(1.195) && !estimate.excludes(0.805));
        assert!(estimate.excludes(1.197) && estimate.excludes(0.803));
    }
}
