//! Nonlinear least squares by damped Gauss-Newton steps (Levenberg 1944, Marquardt 1963).
//!
//! Minimizes `S(p) = sum r_i(p)^2`. Each step solves `(J'J + lambda D) dp = -J'r`, where `J` has the derivatives of the
//! residuals and `D` a diagonal with the units of `J'J`, so that the steps do not depend on the parameters' units.
//! [`Damping`] says how `lambda` and `D` are chosen.
//!
//! [`minimize`] is for residuals that fit into memory with their Jacobian ([`Residuals`]). [`search`] needs the normal
//! equations alone ([`NormalEquations`]), which may be summed up part by part, and may use a Jacobian for several steps.
//!
//! The normal equations square the condition number, so parameters should be chosen so that a unit step of each means
//! something alike: logarithms for time constants, for example.

use nalgebra::{DMatrix, DVector};

use super::normal_equations::{damped_step, floored_diagonal, scaled_inverse};

/// First value of `lambda`. Standard: 1e-6 for a start that is trusted, 1e-3 or 1 for another (Madsen, Nielsen and Tingleff, Methods for
/// Non-Linear Least Squares Problems, 2004).
const FIRST_DAMPING: f64 = 1e-3;
/// A Jacobian serves for another step where the last one gained at least this share of what it predicted. Chosen: lower wastes steps on a
/// poor Jacobian, higher computes Jacobians for little; the end of the search is the same.
const MIN_REUSE_GAIN_RATIO: f64 = 0.5;

/// A sum of squares by its normal equations.
pub trait NormalEquations {
    /// Values of all parameters, with what is kept of the residuals there.
    type Point;

    /// The derivatives of the residuals, as far as they are kept, with `J'J`.
    type Linearization;

    /// The derivatives at a point, whose gradient is by them from then on. `None` where they are not defined.
    fn linearize(&self, at: &mut Self::Point) -> Option<Self::Linearization>;

    /// `J'J`.
    fn matrix<'a>(&self, linearization: &'a Self::Linearization) -> &'a DMatrix<f64>;

    /// The point a step away, or as much of the step as bounds allow. `None` where the model is not defined there.
    fn moved(
        &self,
        from: &Self::Point,
        step: &DVector<f64>,
        linearization: &Self::Linearization,
    ) -> Option<Self::Point>;

    /// Whether a bound keeps a parameter where it is when a step would move it by so much. The others then step without it.
    fn is_at_bound(&self, _at: &Self::Point, _parameter: usize, _step: f64) -> bool {
        false
    }

    /// `S` at a point.
    fn sum_of_squares(&self, at: &Self::Point) -> f64;

    /// `J'r`, half the gradient of `S`: the residuals are those at the point, `J` may be from a point nearby.
    fn gradient(&self, at: &Self::Point, linearization: &Self::Linearization) -> DVector<f64>;
}

/// How a search proceeds and when it stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strategy {
    /// Most steps tried, accepted or not.
    pub iterations: usize,
    /// Decrease of `S` in a step below which the search has converged.
    pub decrease: Decrease,
    /// How steps are damped.
    pub damping: Damping,
    /// Whether a Jacobian serves for further steps as long as these gain at least half of what it predicts: for derivatives
    /// that cost much more than residuals.
    pub reuses_jacobian: bool,
}

/// A least decrease of the sum of squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Decrease {
    /// As a share of the sum.
    Relative(f64),
    /// In units of the sum, for residuals whose variance is known.
    Absolute(f64),
}

impl Decrease {
    fn in_units(self, sum: f64) -> f64 {
        match self {
            Self::Relative(share) => share * sum,
            Self::Absolute(decrease) => decrease,
        }
    }
}

/// How `lambda` follows the success of steps, and what `D` is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Damping {
    /// `lambda` by how much of the predicted decrease came true (Nielsen, Damping parameter in Marquardt's method, 1999);
    /// `D` is the largest diagonal of `J'J` so far (Moré 1978).
    GainRatio,
    /// A fifth of `lambda` after each success and ten times after each failure, from `1e-9` to `1e3`; `D` is the diagonal of
    /// `J'J`. For sums of squares with kinks, where a poor gain says little of the next step. Chosen: ten after Marquardt; at 1e-9 a
    /// step is Gauss-Newton's to rounding, and above 1e3 it is a thousandth of one and the search ends.
    Factors,
}

/// Where a search ended.
#[derive(Clone, Debug)]
pub struct SearchEnd<P, L> {
    /// The best point.
    pub at: P,
    /// The last linearization: at the point, or one step before it where Jacobians serve for several steps.
    pub linearization: L,
    /// Whether `S` stopped decreasing before the steps ran out.
    pub converged: bool,
    /// Steps tried.
    pub iterations: usize,
}

/// Searches from a point. `None` where the model or its derivatives are not defined there.
pub fn search<N: NormalEquations>(
    model: &N,
    start: N::Point,
    strategy: &Strategy,
) -> Option<SearchEnd<N::Point, N::Linearization>> {
    let mut at = start;
    let mut linearization = model.linearize(&mut at)?;
    let mut sum = model.sum_of_squares(&at);
    if !sum.is_finite() {
        return None;
    }
    let mut gradient = model.gradient(&at, &linearization);
    let mut damping = CurrentDamping::new(strategy.damping);
    let mut is_fresh = true;
    let mut converged = sum == 0.0;
    let mut iterations = 0;
    while !converged && iterations < strategy.iterations {
        iterations += 1;
        let matrix = model.matrix(&linearization);
        let least = strategy.decrease.in_units(sum);
        let is_at_bound = |parameter: usize, step: f64| model.is_at_bound(&at, parameter, step);
        let Some(step) = damping.free_step(matrix, &gradient, is_at_bound) else {
            if damping.raise() {
                continue;
            }
            break;
        };
        let predicted = -(2.0 * gradient.dot(&step) + step.dot(&(matrix * &step)));
        let moved = model.moved(&at, &step, &linearization);
        let gain = moved.as_ref().map_or(f64::NEG_INFINITY, |moved| sum - model.sum_of_squares(moved));
        let ratio = gain / predicted;
        let ends = is_fresh && gain <= least;
        let serves_on = strategy.reuses_jacobian && (ends || (ratio >= MIN_REUSE_GAIN_RATIO && gain > least));
        let accepted = moved.filter(|_| ratio > 0.0).and_then(|mut moved| {
            let next = if serves_on { None } else { Some(model.linearize(&mut moved)?) };
            Some((moved, next))
        });
        if let Some((moved, next)) = accepted {
            at = moved;
            is_fresh = next.is_some();
            linearization = next.unwrap_or(linearization);
            converged = ends;
            damping.lower(ratio);
        } else if is_fresh {
            // Not even the linear model promises a decrease: this is the minimum to rounding.
            converged = predicted.abs() <= least;
            if !damping.raise() {
                break;
            }
            continue;
        } else {
            linearization = model.linearize(&mut at)?;
            is_fresh = true;
        }
        sum = model.sum_of_squares(&at);
        gradient = model.gradient(&at, &linearization);
    }
    Some(SearchEnd { at, linearization, converged, iterations })
}

/// `lambda` and `D` as a search has left them.
struct CurrentDamping {
    rule: Damping,
    lambda: f64,
    growth: f64,
    scale: DVector<f64>,
}

impl CurrentDamping {
    fn new(rule: Damping) -> Self {
        Self { rule, lambda: FIRST_DAMPING, growth: 2.0, scale: DVector::zeros(0) }
    }

    /// [`Self::step`] over the parameters whose bounds are not active. With active ones left in, the other parameters would be moved to
    /// suit a change that cannot happen.
    fn free_step(
        &mut self,
        matrix: &DMatrix<f64>,
        gradient: &DVector<f64>,
        is_at_bound: impl Fn(usize, f64) -> bool,
    ) -> Option<DVector<f64>> {
        let (mut matrix, mut gradient) = (matrix.clone(), gradient.clone());
        loop {
            let step = self.step(&matrix, &gradient)?;
            let blocked: Vec<usize> =
                (0..step.len()).filter(|i| step[*i] != 0.0 && is_at_bound(*i, step[*i])).collect();
            if blocked.is_empty() {
                return Some(step);
            }
            for place in blocked {
                let own = matrix[(place, place)];
                matrix.row_mut(place).fill(0.0);
                matrix.column_mut(place).fill(0.0);
                matrix[(place, place)] = own;
                gradient[place] = 0.0;
            }
        }
    }

    fn step(&mut self, matrix: &DMatrix<f64>, gradient: &DVector<f64>) -> Option<DVector<f64>> {
        self.scale = match self.rule {
            Damping::GainRatio if self.scale.is_empty() => matrix.diagonal(),
            Damping::GainRatio => self.scale.sup(&matrix.diagonal()),
            Damping::Factors => floored_diagonal(matrix),
        };
        damped_step(matrix, gradient, &self.scale, self.lambda)
    }

    /// After a step with this ratio of true to predicted decrease.
    fn lower(&mut self, ratio: f64) {
        match self.rule {
            Damping::GainRatio => self.lambda *= f64::max(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0).powi(3)),
            Damping::Factors => self.lambda = (self.lambda * 0.2).max(1e-9),
        }
        self.growth = 2.0;
    }

    /// After a step that failed. Whether another one is worth it.
    fn raise(&mut self) -> bool {
        match self.rule {
            Damping::GainRatio => {
                self.lambda *= self.growth;
                self.growth *= 2.0;
                true
            }
            Damping::Factors => {
                self.lambda *= 10.0;
                self.lambda <= 1e3
            }
        }
    }
}

/// Residuals as a function of the parameters.
pub trait Residuals {
    /// Number of residuals.
    fn count(&self) -> usize;

    /// Writes the residuals (model minus data, weighted if wanted) at `parameters` into `out`. `false`
    /// where the model is not defined there; the search then takes a shorter step.
    fn evaluate(&self, parameters: &[f64], out: &mut [f64]) -> bool;

    /// Writes the derivatives, row per residual and column per parameter, into `out`. Central
    /// differences unless the model knows better. `false` as for [`Residuals::evaluate`].
    fn jacobian(&self, parameters: &[f64], out: &mut DMatrix<f64>) -> bool {
        let mut at = parameters.to_vec();
        let mut ahead = vec![0.0; self.count()];
        let mut behind = vec![0.0; self.count()];
        for (j, &p) in parameters.iter().enumerate() {
            // The cube root of the rounding unit balances rounding against the cubic term.
            let step = f64::EPSILON.cbrt() * p.abs().max(self.typical(j));
            at[j] = p + step;
            let ok = self.evaluate(&at, &mut ahead);
            at[j] = p - step;
            if !(ok && self.evaluate(&at, &mut behind)) {
                return false;
            }
            at[j] = p;
            for ((d, a), b) in out.column_mut(j).iter_mut().zip(&ahead).zip(&behind) {
                *d = (a - b) / (2.0 * step);
            }
        }
        true
    }

    /// A magnitude that parameter `index` has or may have; sizes the difference step where the
    /// parameter is near zero.
    fn typical(&self, _index: usize) -> f64 {
        1.0
    }
}

/// When [`minimize`] stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoppingCriteria {
    /// Most steps tried, accepted or not.
    pub iterations: usize,
    /// Relative decrease of the sum of squares below which the search has converged.
    pub decrease: f64,
}

/// Chosen: a step below the decrease moves a parameter by a millionth of its standard error times the root of the residuals' number, near
/// rounding. A search that converges does so in tens of steps; a hundred end the others.
impl Default for StoppingCriteria {
    fn default() -> Self {
        Self { iterations: 100, decrease: 1e-12 }
    }
}

/// Where the search ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// The parameters.
    pub parameters: Vec<f64>,
    /// Residuals there.
    pub residuals: Vec<f64>,
    /// Derivatives there, row per residual and column per parameter.
    pub jacobian: DMatrix<f64>,
    /// Sum of squared residuals.
    pub sum_of_squares: f64,
    /// `(J'J)^-1`: the parameters' covariance for residuals of unit variance that are independent.
    /// Multiply by the residuals' variance, or use [`Solution::covariance_with`] when they are not
    /// independent. `None` where the data leave a combination of parameters undetermined.
    pub unit_covariance: Option<DMatrix<f64>>,
    /// Whether the sum stopped decreasing before the steps ran out.
    pub converged: bool,
    /// Steps tried.
    pub iterations: usize,
}

impl Solution {
    /// Covariance for residuals whose covariance matrix maps `J` to `noise_times_jacobian`:
    /// `(J'J)^-1 J' (R J) (J'J)^-1` (Ljung, section 9.4). Takes the product because `R` itself is too
    /// large to hold.
    #[must_use]
    pub fn covariance_with(&self, noise_times_jacobian: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let unit = self.unit_covariance.as_ref()?;
        Some(unit * (self.jacobian.transpose() * noise_times_jacobian) * unit)
    }
}

/// Searches from `start`. `None` when the model or its derivatives are not defined there.
#[must_use]
pub fn minimize(model: &impl Residuals, start: &[f64], limits: StoppingCriteria) -> Option<Solution> {
    let model = InMemory(model);
    let strategy = Strategy {
        iterations: limits.iterations,
        decrease: Decrease::Relative(limits.decrease),
        damping: Damping::GainRatio,
        reuses_jacobian: false,
    };
    let SearchEnd { at, linearization, converged, iterations } =
        search(&model, model.point(start.to_vec())?, &strategy)?;
    let InMemoryJacobian { jacobian, matrix } = linearization;
    Some(Solution {
        parameters: at.parameters,
        residuals: at.residuals.data.into(),
        jacobian,
        sum_of_squares: at.sum_of_squares,
        unit_covariance: scaled_inverse(&matrix, 0.0),
        converged,
        iterations,
    })
}

/// Residuals with their whole Jacobian.
struct InMemory<'a, R>(&'a R);

struct InMemoryPoint {
    parameters: Vec<f64>,
    residuals: DVector<f64>,
    sum_of_squares: f64,
}

struct InMemoryJacobian {
    jacobian: DMatrix<f64>,
    matrix: DMatrix<f64>,
}

impl<R: Residuals> InMemory<'_, R> {
    fn point(&self, parameters: Vec<f64>) -> Option<InMemoryPoint> {
        let mut residuals = DVector::zeros(self.0.count());
        let is_defined = self.0.evaluate(&parameters, residuals.as_mut_slice());
        let sum_of_squares = residuals.iter().map(|r| r * r).sum();
        is_defined.then_some(InMemoryPoint { parameters, residuals, sum_of_squares })
    }
}

impl<R: Residuals> NormalEquations for InMemory<'_, R> {
    type Point = InMemoryPoint;
    type Linearization = InMemoryJacobian;

    fn linearize(&self, at: &mut InMemoryPoint) -> Option<InMemoryJacobian> {
        let mut jacobian = DMatrix::zeros(at.residuals.len(), at.parameters.len());
        let is_defined = self.0.jacobian(&at.parameters, &mut jacobian);
        is_defined.then(|| InMemoryJacobian { matrix: jacobian.tr_mul(&jacobian), jacobian })
    }

    fn matrix<'a>(&self, linearization: &'a InMemoryJacobian) -> &'a DMatrix<f64> {
        &linearization.matrix
    }

    fn moved(&self, from: &InMemoryPoint, step: &DVector<f64>, _: &InMemoryJacobian) -> Option<InMemoryPoint> {
        self.point(from.parameters.iter().zip(step.iter()).map(|(at, step)| at + step).collect())
    }

    fn sum_of_squares(&self, at: &InMemoryPoint) -> f64 {
        at.sum_of_squares
    }

    fn gradient(&self, at: &InMemoryPoint, linearization: &InMemoryJacobian) -> DVector<f64> {
        linearization.jacobian.tr_mul(&at.residuals)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Residuals by a function of the parameters, which is `None` where they are not defined.
    struct By<F>(F);

    impl<const N: usize, F: Fn(&[f64]) -> Option<[f64; N]>> Residuals for By<F> {
        fn count(&self) -> usize {
            N
        }

        fn evaluate(&self, parameters: &[f64], out: &mut [f64]) -> bool {
            (self.0)(parameters).map(|residuals| out.copy_from_slice(&residuals)).is_some()
        }
    }

    #[test]
    fn what_the_data_do_not_determine_has_no_covariance() {
        let sums = By(|p: &[f64]| Some([0.0, 1.0, 2.0].map(|data| p[0] + p[1] - data)));
        let solution = minimize(&sums, &[0.3, 0.1], StoppingCriteria::default()).unwrap();
        assert!((solution.parameters[0] + solution.parameters[1] - 1.0).abs() < 1e-9, "{solution:?}");
        // Rounding may leave a variance, which then is that of a number without any significant digit.
        assert!(solution.unit_covariance.is_none_or(|covariance| covariance[(0, 0)] > 1e6));
    }

    #[test]
    fn a_step_to_where_the_model_is_not_defined_becomes_shorter() {
        // The first Gauss-Newton step from 10 leads to -13.
        let logarithm = By(|p: &[f64]| (p[0] > 0.0).then(|| [p[0].ln()]));
        let solution = minimize(&logarithm, &[10.0], StoppingCriteria::default()).unwrap();
        assert!(solution.converged && (solution.parameters[0] - 1.0).abs() < 1e-6, "{solution:?}");
        assert_eq!(minimize(&logarithm, &[-1.0], StoppingCriteria::default()), None);
    }

    #[test]
    fn a_search_stops_at_its_limit_of_steps_and_says_so() {
        let cubic = By(|p: &[f64]| Some([p[0].powi(3)]));
        let solution = minimize(&cubic, &[1.0], StoppingCriteria { iterations: 3, decrease: 0.0 }).unwrap();
        assert!(!solution.converged && solution.iterations == 3, "{solution:?}");
    }

    /// `(p - 3)^2` with `p` bounded to 2.
    struct Bounded;

    impl NormalEquations for Bounded {
        type Point = f64;
        type Linearization = DMatrix<f64>;

        fn linearize(&self, _: &mut f64) -> Option<DMatrix<f64>> {
            Some(DMatrix::identity(1, 1))
        }

        fn matrix<'a>(&self, linearization: &'a DMatrix<f64>) -> &'a DMatrix<f64> {
            linearization
        }

        fn moved(&self, from: &f64, step: &DVector<f64>, _: &DMatrix<f64>) -> Option<f64> {
            Some((from + step[0]).min(2.0))
        }

        fn sum_of_squares(&self, at: &f64) -> f64 {
            (at - 3.0).powi(2)
        }

        fn gradient(&self, at: &f64, _: &DMatrix<f64>) -> DVector<f64> {
            DVector::from_element(1, at - 3.0)
        }
    }

    /// `(p - 1)^2 + (p + q + 1)^2` with `q` at least 0: best at `p = q = 0`, and a step that lets `q` go moves `p` to 1.
    struct HeldBack;

    impl NormalEquations for HeldBack {
        type Point = [f64; 2];
        type Linearization = DMatrix<f64>;

        fn linearize(&self, _: &mut [f64; 2]) -> Option<DMatrix<f64>> {
            Some(DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 1.0, 1.0]))
        }

        fn matrix<'a>(&self, linearization: &'a DMatrix<f64>) -> &'a DMatrix<f64> {
            linearization
        }

        fn moved(&self, [p, q]: &[f64; 2], step: &DVector<f64>, _: &DMatrix<f64>) -> Option<[f64; 2]> {
            Some([p + step[0], (q + step[1]).max(0.0)])
        }

        fn is_at_bound(&self, [_, q]: &[f64; 2], parameter: usize, step: f64) -> bool {
            parameter == 1 && *q == 0.0 && step < 0.0
        }

        fn sum_of_squares(&self, [p, q]: &[f64; 2]) -> f64 {
            (p - 1.0).powi(2) + (p + q + 1.0).powi(2)
        }

        fn gradient(&self, [p, q]: &[f64; 2], _: &DMatrix<f64>) -> DVector<f64> {
            DVector::from_column_slice(&[2.0 * p + q, p + q + 1.0])
        }
    }

    #[test]
    fn a_parameter_at_its_bound_does_not_lead_the_others_astray() {
        let decrease = Decrease::Absolute(1e-9);
        let strategy = Strategy { iterations: 50, decrease, damping: Damping::Factors, reuses_jacobian: false };
        let found = search(&HeldBack, [-0.5, 0.0], &strategy).unwrap();
        assert!(found.at[0].abs() < 1e-4 && found.at[1] == 0.0, "{found:?}");
        assert!(found.converged && found.iterations < 6, "{found:?}");
    }

    #[test]
    fn a_search_ends_at_a_bound() {
        for reuses_jacobian in [false, true] {
            let decrease = Decrease::Absolute(1e-6);
            let strategy = Strategy { iterations: 50, decrease, damping: Damping::Factors, reuses_jacobian };
            let found = search(&Bounded, 0.0, &strategy).unwrap();
            assert_eq!(found.at, 2.0);
            assert!(found.iterations < 50, "{found:?}");
        }
    }
}
