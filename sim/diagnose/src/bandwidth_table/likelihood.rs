//! What a calibration is worth.

/// Bandwidths that agree to this part, RMS, agree, where nothing is known of their errors.
const AGREEING: f64 = 0.01;
/// Tables are printed to this part; no chi-square below it means anything.
const PRINTED: f64 = 1e-4;
/// A sum of squares is too large for noise from so many standard deviations of it on.
const SIGNIFICANT: f64 = 5.0;

/// Log likelihoods of the fitted column.
#[derive(Clone, Copy, Debug)]
pub(super) struct Likelihood {
    /// Relative standard error of a measured bandwidth, where it is known. Otherwise what a calibration with fewer numbers
    /// than data leaves is taken for noise.
    pub accuracy: Option<f64>,
    /// Values in the fitted column.
    pub count: usize,
    /// Their sum of squares of `ln(measured / simulated)` with the model as it was given.
    pub before: f64,
}

impl Likelihood {
    /// By how much the log likelihood grows when the sum of squares becomes `after`: of normal errors with the known
    /// standard error, or with the one that maximizes it.
    pub(super) fn gain(&self, after: f64) -> f64 {
        match self.accuracy {
            Some(std) => 0.5 * (self.before - after) / (std * std),
            None => {
                let floor = self.count as f64 * PRINTED * PRINTED;
                0.5 * self.count as f64 * (self.before.max(floor) / after.max(floor)).ln()
            }
        }
    }

    /// What has to be taken off for `numbers` that were fitted: Akaike's criterion, with its correction for few data where
    /// the noise is one more of them (Hurvich & Tsai, Biometrika 76, 1989). Infinite where there are too few data.
    pub(super) fn penalty(&self, numbers: usize) -> f64 {
        if self.accuracy.is_some() {
            return numbers as f64;
        }
        let criterion = |numbers: usize| {
            let fitted = numbers + 1;
            if self.count <= fitted + 1 {
                return f64::INFINITY;
            }
            let (fitted, rest) = (fitted as f64, (self.count - fitted - 1) as f64);
            fitted + fitted * (fitted + 1.0) / rest
        };
        if criterion(numbers).is_finite() { criterion(numbers) - criterion(0) } else { f64::INFINITY }
    }

    /// Whether `sum` over `count` squares, `numbers` of which were used up, is what the known errors leave. Where they are not
    /// known nothing can be said.
    pub(super) fn is_noise(&self, sum: f64, count: usize, numbers: usize) -> Option<bool> {
        let std = self.accuracy?;
        let expected = count.saturating_sub(numbers) as f64;
        Some(sum / (std * std) - expected <= SIGNIFICANT * (2.0 * expected).sqrt())
    }

    /// Whether bandwidths with this sum of squares agree.
    pub(super) fn agrees(&self, sum: f64, count: usize) -> bool {
        self.is_noise(sum, count, 0).unwrap_or(sum <= count as f64 * AGREEING * AGREEING)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_cost_what_the_criterion_says() {
        let likelihood = |accuracy, count| Likelihood { accuracy, count, before: 1.0 };
        assert_eq!(likelihood(Some(0.02), 2).penalty(3), 3.0);
        // Half of 2 K + 2 K (K + 1) / (n - K - 1), with K = 2 and 1 for n = 6.
        assert!((likelihood(None, 6).penalty(1) - 2.5).abs() < 1e-12);
        assert!((likelihood(None, 6).penalty(2) - 7.5).abs() < 1e-12);
        assert_eq!(likelihood(None, 3).penalty(1), f64::INFINITY);
        assert!((likelihood(None, 6).gain(0.25) - 3.0 * 4.0_f64.ln()).abs() < 1e-12);
        assert!((likelihood(Some(0.1), 6).gain(0.25) - 37.5).abs() < 1e-12);
    }

    #[test]
    fn known_errors_decide_what_agrees() {
        let likelihood = |accuracy| Likelihood { accuracy, count: 6, before: 1.0 };
        // Twelve errors of 5 % each.
        assert!(likelihood(Some(0.05)).agrees(12.0 * 0.0025, 12));
        assert!(!likelihood(Some(0.02)).agrees(12.0 * 0.0025, 12));
        assert!(!likelihood(None).agrees(12.0 * 0.0025, 12));
        assert!(likelihood(None).agrees(12.0 * 0.000_081, 12));
    }
}
