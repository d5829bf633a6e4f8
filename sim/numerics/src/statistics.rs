//! Quantiles and tails of the distributions that the tests and intervals use.

use statrs::distribution::{ContinuousCDF, Normal, StudentsT};
use statrs::function::beta::checked_beta_reg;

/// Standard errors to either end of an interval of 95 %: the normal quantile at 97.5 %.
pub const STANDARD_ERRORS_OF_95_PERCENT: f64 = 1.96;

/// Quantile of Student's t distribution; of the normal distribution for infinite degrees of freedom.
#[must_use]
pub fn t_quantile(probability: f64, dof: f64) -> f64 {
    if dof > 1e4 {
        // Up to 0.999 the quantiles agree to 1e-3; the library's t loses digits to cancellation up there.
        Normal::standard().inverse_cdf(probability)
    } else {
        StudentsT::new(0.0, 1.0, dof).map_or(f64::NAN, |t| t.inverse_cdf(probability))
    }
}

/// `P(F > ratio)` for `F(dof, noise_dof)`; one for a ratio that is not a number, since such a
/// ratio rejects nothing.
#[must_use]
pub fn f_upper_tail(ratio: f64, dof: f64, noise_dof: f64) -> f64 {
    if ratio.is_nan() || ratio <= 0.0 {
        return 1.0;
    }
    // Beyond a million the denominator is as good as known: its standard deviation is sqrt(2 / 1e6), 0.14 %.
    let noise_dof = noise_dof.min(1e6);
    // The library's own tail unwraps; this is the same function with the error in hand.
    checked_beta_reg(0.5 * noise_dof, 0.5 * dof, noise_dof / (noise_dof + dof * ratio)).unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_and_tails_agree_with_the_tables() {
        // NIST/SEMATECH e-Handbook of Statistical Methods, table 1.3.6.7.2, which has three decimals.
        for (probability, dof, quantile) in [
            (0.90, 1.0, 3.078),
            (0.95, 1.0, 6.314),
            (0.975, 1.0, 12.706),
            (0.975, 2.0, 4.303),
            (0.99, 3.0, 4.541),
            (0.975, 5.0, 2.571),
            (0.995, 5.0, 4.032),
            (0.975, 10.0, 2.228),
            (0.975, 30.0, 2.042),
            (0.999, 30.0, 3.385),
            (0.95, 100.0, 1.660),
            (0.975, 100.0, 1.984),
            (0.975, f64::INFINITY, 1.960),
            (0.999, f64::INFINITY, 3.090),
        ] {
            assert!((t_quantile(probability, dof) - quantile).abs() < 5.01e-4, "{probability} {dof}");
            assert!((t_quantile(1.0 - probability, dof) + quantile).abs() < 5.01e-4, "{probability} {dof}");
        }
        assert!((t_quantile(0.975, 20.0) - 2.085_963).abs() < 1e-6);
        assert!((t_quantile(0.975, f64::INFINITY) - 1.959_964).abs() < 1e-6);
        assert!((f_upper_tail(3.492_828, 2.0, 20.0) - 0.05).abs() < 1e-6);
        assert!((f_upper_tail(3.841_459, 1.0, f64::INFINITY) - 0.05).abs() < 1e-5);
    }

    #[test]
    fn the_step_to_the_normal_distribution_is_small() {
        for probability in [0.9, 0.975, 0.999] {
            let (below, above) = (t_quantile(probability, 1e4), t_quantile(probability, 1.001e4));
            assert!(below > above && below - above < 1e-3, "{probability}: {below} {above}");
        }
    }

    #[test]
    fn ratios_that_are_no_numbers_reject_nothing() {
        assert_eq!(f_upper_tail(f64::NAN, 2.0, 20.0), 1.0);
        assert_eq!(f_upper_tail(-1.0, 2.0, 20.0), 1.0);
        assert_eq!(f_upper_tail(f64::INFINITY, 2.0, 20.0), 0.0);
    }
}
