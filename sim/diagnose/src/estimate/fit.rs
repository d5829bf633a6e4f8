//! Least squares of white residuals over all records at once.
//!
//! Each record's residual depends on its own lag and on the effects, so derivatives are taken record by record and summed
//! up into the normal equations: memory does not grow with the number of records.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use rotorlead_numerics::least_squares::{self, Damping, Decrease, NormalEquations, SearchEnd, Strategy};
use rotorlead_numerics::normal_equations::scaled_inverse;
use rotorlead_numerics::statistics::STANDARD_ERRORS_OF_95_PERCENT;
use rotorlead_plant::effect::Site;

use crate::estimate::linearization::{EFFECT_STEP, Linearization, SMOOTH_STEP};
use crate::likelihood::Likelihood;
use crate::model::candidate::{Candidate, slope};
use crate::model::hypothesis::{Coordinate, Hypothesis};

/// Most steps of a search. Chosen: damped steps that converge end sooner, by what they gain. It bounds those that creep along a valley;
/// more cost only time.
pub(crate) const MOST_STEPS: usize = 25;
/// A search ends where a step gains less than this in the sum of squares. Derived: a fifth of what one parameter gains by chance, the mean
/// of a chi-square of one degree of freedom. Lower costs steps that decide nothing.
const ENOUGH: f64 = 0.2;
/// Added to the unit diagonal of the normal equations for the covariance. Chosen: far above rounding; what has no effect at all has a
/// standard error of 1e5, and what has some its own.
const RIDGE: f64 = 1e-10;
/// Distances at which a better value is looked for where the chi-square has kinks, in coordinates. Chosen: from 3 % of a value or range
/// down to the order of the finest step, in factors of three; other starts are farther off. More cost only time.
const LOOKS: [f64; 5] = [0.03, 0.01, 3e-3, 1e-3, 3e-4];
/// How often. Chosen: each goes on only where it gains; it bounds a walk from kink to kink. More cost only time.
const MOST_LOOKS: usize = 8;

/// A hypothesis fitted to the records.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    /// With the values that fit best.
    pub hypothesis: Hypothesis,
    /// Sum of squares of the white residual over what is fitted.
    pub chi_square: f64,
    /// What was searched.
    pub coordinates: Vec<Coordinate>,
    /// Products of the derivatives by them: the inverse of their covariance.
    pub information: DMatrix<f64>,
    /// Covariance of the coordinates.
    pub covariance: Option<DMatrix<f64>>,
}

/// Searches the values of `start` that fit best; the lags only where `lags` says so. `None` where `start` is impossible.
pub(crate) fn fit(likelihood: &Likelihood, start: &Hypothesis, lags: bool) -> Option<Fit> {
    fit_in(likelihood, start, lags, MOST_STEPS)
}

/// The same in so many steps at most.
///
/// Derivatives cost several simulations, a step along them one: they serve for more steps as long as these gain at least half
/// of what they promise.
pub(crate) fn fit_in(likelihood: &Likelihood, start: &Hypothesis, lags: bool, most_steps: usize) -> Option<Fit> {
    fit_coordinates(likelihood, start, start.coordinates(lags), most_steps)
}

/// [`fit_in`] for what is `behind` another hypothesis, in log likelihood: given up where at its pace it cannot catch up.
pub(crate) fn fit_behind(
    likelihood: &Likelihood,
    start: &Hypothesis,
    lags: bool,
    behind: f64,
    most_steps: usize,
) -> Option<Fit> {
    let enough = ENOUGH.max(2.0 * behind / most_steps as f64);
    search(likelihood, start, start.coordinates(lags), Pace { most_steps, enough })
}

/// The same of these coordinates alone.
pub(crate) fn fit_coordinates(
    likelihood: &Likelihood,
    start: &Hypothesis,
    coordinates: Vec<Coordinate>,
    most_steps: usize,
) -> Option<Fit> {
    search(likelihood, start, coordinates, Pace { most_steps, enough: ENOUGH })
}

/// How long a search goes on.
#[derive(Clone, Copy)]
struct Pace {
    most_steps: usize,
    /// What a step has to gain in the sum of squares for another one to follow.
    enough: f64,
}

fn search(likelihood: &Likelihood, start: &Hypothesis, coordinates: Vec<Coordinate>, pace: Pace) -> Option<Fit> {
    let has_effects = coordinates.iter().any(|coordinate| matches!(coordinate, Coordinate::Effect { .. }));
    let mut found = descend(likelihood, start, coordinates, EFFECT_STEP, pace)?;
    if has_effects && pace.most_steps >= MOST_STEPS {
        found = descend(likelihood, &found.at.hypothesis, found.linearization.coordinates, SMOOTH_STEP, pace)?;
        for _ in 0..MOST_LOOKS {
            let Some(at) = look_around(likelihood, &found) else { break };
            let other = descend(likelihood, &at, found.linearization.coordinates.clone(), SMOOTH_STEP, pace)?;
            // It was evaluated to first order only.
            if other.at.sum >= found.at.sum {
                break;
            }
            found = other;
        }
    }
    let Linearization { coordinates, matrix, .. } = found.linearization;
    Some(Fit {
        hypothesis: found.at.hypothesis,
        chi_square: found.at.sum,
        covariance: scaled_inverse(&matrix, RIDGE),
        information: matrix,
        coordinates,
    })
}

/// A better hypothesis near the end of a search, found by moving one value that acts on the command: where levels of the command reach
/// or leave a limit the chi-square has kinks, at which a search by derivatives ends. All other values follow to first order. `None`
/// if there is none.
fn look_around(likelihood: &Likelihood, found: &Descent) -> Option<Hypothesis> {
    let acts_on_command = |coordinate: &&Coordinate| match coordinate {
        Coordinate::Effect { effect, .. } => found.at.hypothesis.effects[*effect].kind.site <= Site::Command,
        _ => false,
    };
    let mut best: Option<(f64, Hypothesis)> = None;
    for &coordinate in found.linearization.coordinates.iter().filter(acts_on_command) {
        let others = found.linearization.coordinates.iter().copied().filter(|other| *other != coordinate).collect();
        let linearization = Linearization::at(likelihood, &found.at.hypothesis, others)?;
        let here = found.at.hypothesis.get(coordinate);
        for distance in LOOKS.into_iter().flat_map(|distance| [-distance, distance]) {
            let mut moved = found.at.hypothesis.clone();
            moved.set(coordinate, here + distance);
            let Some((chi_square, there)) = linearization.predict(likelihood, &moved) else { continue };
            if chi_square < best.as_ref().map_or(found.at.sum - ENOUGH, |best| best.0) {
                best = Some((chi_square, there));
            }
        }
    }
    best.map(|(_, there)| there)
}

/// Where a search ended.
type Descent = SearchEnd<FitPoint, Linearization>;

/// A hypothesis, its sum of squares, and half the derivatives of it by the last linearization.
struct FitPoint {
    hypothesis: Hypothesis,
    sum: f64,
    gradient: DVector<f64>,
}

/// Sum of squares of the white residuals, by these coordinates.
struct WhiteResiduals<'a> {
    likelihood: &'a Likelihood,
    coordinates: Vec<Coordinate>,
    effect_step: f64,
}

impl NormalEquations for WhiteResiduals<'_> {
    type Point = FitPoint;
    type Linearization = Linearization;

    fn linearize(&self, at: &mut FitPoint) -> Option<Linearization> {
        let coordinates = self.coordinates.clone();
        let linearization = Linearization::with_step(self.likelihood, &at.hypothesis, coordinates, self.effect_step)?;
        (at.sum, at.gradient) = linearization.slope_here(self.likelihood, &at.hypothesis)?;
        Some(linearization)
    }

    fn matrix<'a>(&self, linearization: &'a Linearization) -> &'a DMatrix<f64> {
        &linearization.matrix
    }

    fn moved(&self, from: &FitPoint, step: &DVector<f64>, linearization: &Linearization) -> Option<FitPoint> {
        let hypothesis = linearization.moved(&from.hypothesis, step);
        let (sum, gradient) = linearization.slope(self.likelihood, &hypothesis)?;
        Some(FitPoint { hypothesis, sum, gradient })
    }

    fn is_at_bound(&self, at: &FitPoint, parameter: usize, step: f64) -> bool {
        let coordinate = self.coordinates[parameter];
        let here = at.hypothesis.get(coordinate);
        let mut moved = at.hypothesis.clone();
        moved.set(coordinate, here + step);
        moved.get(coordinate) == here
    }

    fn sum_of_squares(&self, at: &FitPoint) -> f64 {
        at.sum
    }

    fn gradient(&self, at: &FitPoint, _: &Linearization) -> DVector<f64> {
        at.gradient.clone()
    }
}

fn descend(
    likelihood: &Likelihood,
    start: &Hypothesis,
    coordinates: Vec<Coordinate>,
    effect_step: f64,
    Pace { most_steps, enough }: Pace,
) -> Option<Descent> {
    let strategy = Strategy {
        iterations: most_steps,
        decrease: Decrease::Absolute(enough),
        damping: Damping::Factors,
        reuses_jacobian: true,
    };
    let start = FitPoint { hypothesis: start.clone(), sum: f64::NAN, gradient: DVector::zeros(0) };
    least_squares::search(&WhiteResiduals { likelihood, coordinates, effect_step }, start, &strategy)
}

impl Fit {
    /// Squared length of a change of two coordinates in their standard errors and correlation. `None` where they were not
    /// searched.
    pub fn distance(&self, coordinates: [Coordinate; 2], off: [f64; 2]) -> Option<f64> {
        let off = Vector2::from(off);
        Some(off.dot(&(self.pair_covariance(coordinates)?.try_inverse()? * off)))
    }

    /// Covariance of two coordinates, whatever the others are. `None` where they were not searched.
    pub fn pair_covariance(&self, coordinates: [Coordinate; 2]) -> Option<Matrix2<f64>> {
        let covariance = self.covariance.as_ref()?;
        let [i, j] = coordinates.map(|one| self.coordinates.iter().position(|other| *other == one));
        let (i, j) = (i?, j?);
        Some(Matrix2::new(covariance[(i, i)], covariance[(i, j)], covariance[(j, i)], covariance[(j, j)]))
    }

    /// Whether the interval of 95 % of a value of an effect excludes that at which the effect vanishes. Of a sag that is all resistance
    /// the slow part may well be none.
    pub fn excludes_absence(&self, effect: usize) -> bool {
        let candidate = &self.hypothesis.effects[effect];
        let vanishes = Candidate::searched(candidate.kind).filter(|(_, parameter)| parameter.null.is_finite());
        let mut excludes = vanishes.map(|(value, parameter)| {
            let std = self.std(Coordinate::Effect { effect, value }).unwrap_or(f64::INFINITY);
            let std = std * slope(parameter, candidate.values[value]).abs();
            (candidate.values[value] - parameter.null).abs() > STANDARD_ERRORS_OF_95_PERCENT * std
        });
        // A limit vanishes at no number.
        excludes.next().is_none_or(|first| first || excludes.any(|excludes| excludes))
    }

    /// Whether the interval of 95 % of the shape of an effect excludes that of the catalog's law.
    pub fn excludes_shape(&self, effect: usize) -> bool {
        let candidate = &self.hypothesis.effects[effect];
        candidate.kind.shape().is_some_and(|(value, shape)| {
            let neutral = shape.default().unwrap_or(shape.null);
            let std = self.std(Coordinate::Effect { effect, value }).unwrap_or(f64::INFINITY);
            let std = std * slope(shape, candidate.values[value]).abs();
            (candidate.values[value] - neutral).abs() > STANDARD_ERRORS_OF_95_PERCENT * std
        })
    }

    /// Standard deviation of a coordinate, by the noise.
    pub fn std(&self, coordinate: Coordinate) -> Option<f64> {
        let place = self.coordinates.iter().position(|other| *other == coordinate)?;
        let variance = self.covariance.as_ref()?[(place, place)];
        (variance >= 0.0).then(|| variance.sqrt())
    }

    /// Whether its alignment is off by more than the rows leave open. Standard: two standard deviations, 95.4 % of a normal distribution.
    pub fn has_time_offset(&self, likelihood: &Likelihood) -> bool {
        self.hypothesis.time_offset_s.abs() > 2.0 * likelihood.time_offset_std()
    }

    /// Derivatives around it. `None` where they are not defined.
    pub fn linearization(&self, likelihood: &Likelihood) -> Option<Linearization> {
        Linearization::at(likelihood, &self.hypothesis, self.coordinates.clone())
    }
}
