//! Standard errors when the noise variances are sample variances.
//!
//! Write `nu` for the complex degrees of freedom behind each line's variance `s_k^2`. In place of the true weights
//! `1 / sigma_k^2` the fit has `1 / s_k^2`, which (Pintelon & Schoukens, 2012, section 12.3)
//!
//! - are `nu / (nu - 1)` times too large on average, so `(J'J)^-1` comes out too small by as much, and the residual's
//!   chi-square too large;
//! - scatter, so the estimate is less efficient, by `(nu - 1) / (nu - 2)` in variance.
//!
//! Together the covariance is `nu / (nu - 2)` times `(J'J)^-1`, if the variances of all lines are independent. Pooling
//! over `L` lines makes them move together. In the limit where one pool holds all lines that matter, the weights
//! have a common factor: nothing is lost, and the error is Student's with `2 nu` degrees of freedom. In between, with
//! information from `n` independent pools, the same two factors are raised in proportion to `1 - 1 / n`, and the degrees
//! of freedom are `2 nu n`. `n` is found for each estimated quantity from the lines that it draws on.

use nalgebra::{DMatrix, DVector};

use super::Estimate;

/// What is known of the noise variances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NoiseKnowledge {
    /// Complex degrees of freedom of each line's variance.
    pub(crate) dof: f64,
    /// Lines whose variances were pooled.
    pub(crate) pooled: f64,
}

impl NoiseKnowledge {
    /// By how much the squared residual is too large on average.
    pub(crate) fn residual_inflation(&self) -> f64 {
        if self.dof.is_finite() { self.dof / (self.dof - 1.0) } else { 1.0 }
    }

    /// By how much the product of two squared residuals of one pool is too large on average, over the square of
    /// [`Self::residual_inflation`]: their common weight scatters.
    pub(crate) fn product_inflation(&self) -> f64 {
        if self.dof.is_finite() { (self.dof - 1.0) / (self.dof - 2.0) } else { 1.0 }
    }

    /// Degrees of freedom of all variances together.
    pub(crate) fn total_dof(&self, lines: usize) -> f64 {
        2.0 * self.dof * (lines as f64 / self.pooled).max(1.0)
    }

    /// Variance inflation and degrees of freedom of a quantity that draws on `lines` lines.
    fn inflation_and_dof(&self, lines: f64) -> (f64, f64) {
        if self.dof.is_infinite() {
            return (1.0, f64::INFINITY);
        }
        let pools = (lines / self.pooled).max(1.0);
        let share = 1.0 - 1.0 / pools;
        let inflation = (1.0 + share / (self.dof - 1.0)) * (1.0 + share / (self.dof - 2.0));
        (inflation, 2.0 * self.dof * pools)
    }
}

/// The parameters' uncertainty, and that of whatever is computed from them.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Uncertainty {
    /// `(J'J)^-1`.
    unit: DMatrix<f64>,
    jacobian: DMatrix<f64>,
    noise: NoiseKnowledge,
}

impl Uncertainty {
    pub(crate) fn new(unit: DMatrix<f64>, jacobian: DMatrix<f64>, noise: NoiseKnowledge) -> Self {
        Self { unit, jacobian, noise }
    }

    /// A quantity of this value whose derivatives by the parameters are `gradient`.
    pub(crate) fn estimate(&self, value: f64, gradient: &DVector<f64>) -> Estimate {
        let direction = &self.unit * gradient;
        let variance = gradient.dot(&direction);
        let (inflation, dof) = self.inflation_along(&direction);
        Estimate { value, std: (variance * inflation).max(0.0).sqrt(), dof }
    }

    /// The parameter at this place.
    pub(crate) fn parameter(&self, value: f64, place: usize) -> Estimate {
        let mut gradient = DVector::zeros(self.unit.nrows());
        gradient[place] = 1.0;
        self.estimate(value, &gradient)
    }

    /// Variance inflation and degrees of freedom of the parameter at this place.
    pub(crate) fn inflation_of_parameter(&self, place: usize) -> (f64, f64) {
        self.inflation_along(&self.unit.column(place).into_owned())
    }

    /// The same of a quantity whose gradient, times `unit`, is `direction`.
    fn inflation_along(&self, direction: &DVector<f64>) -> (f64, f64) {
        // What each line contributes to the variance; the effective number of lines follows from its spread.
        let by_part = &self.jacobian * direction;
        let (mut sum, mut squares) = (0.0, 0.0);
        for parts in by_part.as_slice().chunks_exact(2) {
            let share = parts[0] * parts[0] + parts[1] * parts[1];
            sum += share;
            squares += share * share;
        }
        let lines = if squares > 0.0 { sum * sum / squares } else { 1.0 };
        self.noise.inflation_and_dof(lines)
    }

    /// Covariance of the parameters, with the inflation of quantities that draw on all lines.
    pub(crate) fn covariance(&self) -> DMatrix<f64> {
        let (inflation, _) = self.noise.inflation_and_dof(0.5 * self.jacobian.nrows() as f64);
        &self.unit * inflation
    }
}
