//! Does the model leave more than noise?
//!
//! The residual of the true model has the noise's power. The power ratio of the two follows an F distribution if the model is true.
//! The degrees of freedom are the effective ones of the noise, as the record shows it: fewer than the rows if it is colored. The
//! model's own parameters count as known; those of a fit to as many data raise the ratio by as little as their number over that of the
//! degrees of freedom.
//!
//! The test has two sides. No model leaves less than the noise, so that a ratio that the noise is hardly ever as far below 1 says that the
//! noise was taken wrongly: as too loud, or as so many independent numbers where a sensor repeats its readings.

use num_complex::Complex64;
use rotorlead_numerics::statistics::f_upper_tail;

use crate::goodness_of_fit::{MODEL_LEVEL, power_over_noise};
use crate::spectra::SpectralLine;

/// What a model leaves of a record, beside its noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResidualPower {
    /// Power of what is left over that of the noise; about 1 for the true model. At lines each is weighted by its noise, in
    /// time each row counts alike.
    pub power_ratio: f64,
    /// How likely a true model leaves as much by chance.
    pub p_value: f64,
}

impl ResidualPower {
    /// From the mean powers `residual` and `noise` of independent numbers, with their degrees of freedom; `None` where the noise does
    /// not show.
    pub(super) fn compute(residual: f64, dof: f64, noise: f64, noise_dof: f64) -> Option<Self> {
        let power_ratio = power_over_noise(residual / noise)?;
        Some(Self { power_ratio, p_value: f_upper_tail(power_ratio, dof, noise_dof) })
    }

    /// Whether less is left than the noise could leave, so that the noise is not what it seems. At the level of all tests of one model, so
    /// that one sound record in a thousand is said to.
    #[must_use]
    pub fn is_below_noise(&self) -> bool {
        self.p_value > 1.0 - MODEL_LEVEL
    }

    /// Lines of a spectrum beside the response over command that is `expected` of each.
    ///
    /// The variances are estimates: they make the weighted sum `v / (v - 2)` times too large on average, with `v` the degrees
    /// of freedom of each. Neighbors share them, so that all lines have as many as there are windows of pooling.
    pub(super) fn at_lines(lines: &[SpectralLine], expected: &[Complex64]) -> Option<Self> {
        let largest = lines.iter().map(|line| line.ratio().norm()).fold(0.0, f64::max);
        // The rounding of what has no noise. Chosen: 1e-8, about the square root of a double's rounding unit.
        let rounding = (1e-8 * largest).powi(2);
        let weighted = |(line, expected): (&SpectralLine, &Complex64)| {
            (line.ratio() - expected).norm_sqr() / line.ratio_variance().max(rounding)
        };
        let count = lines.len() as f64;
        let residual = lines.iter().zip(expected).map(weighted).sum::<f64>() / count;
        let line_dof = lines.iter().map(|line| line.dof).fold(f64::INFINITY, f64::min);
        // Derived: `v / (v - 2)` is 5 at 2.5 and has no end at 2; below, the ratio is judged as mildly as at 2.5.
        let inflation = if line_dof > 2.5 { 1.0 / (1.0 - 2.0 / line_dof) } else { 5.0 };
        let windows = (2.0 * count / line_dof).max(1.0);
        Self::compute(residual, 2.0 * count, inflation, windows * line_dof)
    }
}
