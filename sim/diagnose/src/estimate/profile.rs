//! How far a value may be off on which the response depends in jumps.
//!
//! A dead band lets a command pass or not, a grid rounds it up or down, a frame comes before it or after: as such a value moves,
//! one command after the other changes sides. The chi-square is a stair with a step for each, its derivatives say nothing, and
//! the least of it is one of many steps that are nearly as low. What the records say of the value is the likelihood over all of
//! them: with `x` the coordinate, `S(x)` the chi-square with all else following, and `x*` where it is least,
//!
//! ```text
//! std^2 = integral (x - x*)^2 e^(-S(x)/2) dx / integral e^(-S(x)/2) dx
//! ```
//!
//! which is the curvature's standard error where `S` is a parabola.
//!
//! Where the steps are many and small, few points of the profile see all of them, and the tails are long ([`stair`]). The larger of
//! the two counts.

use super::{frame_rate, stair};
use crate::estimate::fit::{Fit, MOST_STEPS, fit_coordinates};
use crate::estimate::linearization::Linearization;
use crate::likelihood::Likelihood;
use crate::model::candidate::Candidate;
use crate::model::hypothesis::{Coordinate, Hypothesis};

/// How near the best value the profile begins, in coordinates. Chosen: a hundredth of a narrow likelihood, 1e-5 wide. Larger misses such
/// ones; smaller costs points.
const NEAREST: f64 = 1e-7;
/// How far it goes. Chosen: a whole range, or a factor of e. Beyond, a value is as good as unknown.
const FARTHEST: f64 = 1.0;
/// By which factor in a step. Derived: 24 doublings lead from the nearest to the farthest point. Less costs points; more steps over where
/// it rises.
const FARTHER: f64 = 2.0;
/// A likelihood of `e^(-LOST / 2)` of the largest counts for nothing. Derived: `e^-12`, 6e-6, adds 0.6 % to the variance even over ten
/// times the width.
const LOST: f64 = 24.0;
/// A stair may come down again: so many points in a row. Chosen: three doublings. More cost points; fewer end at a wall before a second
/// well.
const IN_A_ROW: usize = 3;
/// The value stays where it is unless another one leaves this much less. Standard: two standard errors, a chi-square of one degree of
/// freedom at 95.4 %. On a flat bottom any place is as good, and a command that stands still may lie on either side of a step for all that
/// the rest of them says.
pub(crate) const MOVES: f64 = 4.0;
/// Points that are filled in, each in the middle of the interval that may hold most of the likelihood. Chosen: with these the standard
/// error of a parabola is found to a tenth, as a test has it. Fewer are coarser; more cost only time.
const FILLED: usize = 120;
/// The ends of a profile lie below this part of its top, or it says nothing. Derived: a normal density is there 2.1 standard errors away.
/// Higher gives an interval where one side is open; lower gives none where it is all but closed.
const OPEN: f64 = 0.1;

/// The chi-square along one coordinate.
struct Profile {
    /// Coordinate and chi-square, by increasing coordinate.
    points: Vec<(f64, f64)>,
}

impl Profile {
    /// Around `center`. `evaluate` returns the chi-square at a coordinate; `None` where there is none.
    fn draw(center: f64, evaluate: impl Fn(f64) -> Option<f64>) -> Option<Self> {
        let mut points = vec![(center, evaluate(center)?)];
        for side in [-1.0, 1.0] {
            let (mut distance, mut lost) = (NEAREST, 0);
            while distance < FARTHEST && lost < IN_A_ROW {
                let at = center + side * distance;
                let chi_square = evaluate(at).unwrap_or(f64::INFINITY);
                let least = points.iter().map(|point| point.1).fold(f64::INFINITY, f64::min);
                lost = if chi_square > least + LOST { lost + 1 } else { 0 };
                points.push((at, chi_square));
                distance *= FARTHER;
            }
        }
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut profile = Self { points };
        for _ in 0..FILLED {
            let place = profile.widest();
            let at = 0.5 * (profile.points[place].0 + profile.points[place + 1].0);
            profile.points.insert(place + 1, (at, evaluate(at).unwrap_or(f64::INFINITY)));
        }
        Some(profile)
    }

    /// The coordinate of the least chi-square, and that chi-square.
    fn best(&self) -> (f64, f64) {
        let best = self.points.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        best.copied().unwrap_or((f64::NAN, f64::INFINITY))
    }

    fn likelihood(&self, point: (f64, f64)) -> f64 {
        (0.5 * (self.best().1 - point.1)).exp()
    }

    /// The interval that may hold most of the likelihood, by the place of its begin.
    fn widest(&self) -> usize {
        let least = self.best().1;
        let holds = |place: &usize| {
            let (from, to) = (self.points[*place], self.points[place + 1]);
            (to.0 - from.0) * (0.5 * (least - from.1.min(to.1))).exp()
        };
        let intervals = 0..self.points.len() - 1;
        intervals.max_by(|a, b| holds(a).total_cmp(&holds(b))).unwrap_or_default()
    }

    /// How well the best is known. `None` where the profile has not come down at its ends.
    fn std(&self) -> Option<f64> {
        Some(self.spread()?.max(self.by_rise()?))
    }

    /// By how far the chi-square has to go to rise by [`LOST`].
    fn by_rise(&self) -> Option<f64> {
        let (best, least) = self.best();
        let place = self.points.iter().position(|point| point.0 == best)?;
        let rise = |points: &mut dyn Iterator<Item = &(f64, f64)>| {
            let mut before = (best, least);
            for point in points {
                if point.1 > least + LOST {
                    let part = (least + LOST - before.1) / (point.1 - before.1);
                    return Some((before.0 + part * (point.0 - before.0) - best).abs());
                }
                before = *point;
            }
            None
        };
        let right = rise(&mut self.points[place..].iter());
        let left = rise(&mut self.points[..place].iter().rev());
        // Where one side does not rise so far, the other one says it.
        let sides: Vec<f64> = [left, right].into_iter().flatten().collect();
        (!sides.is_empty()).then(|| stair::std(sides.iter().sum::<f64>() / sides.len() as f64, LOST))
    }

    /// Root of the mean square distance from the best. `None` where the profile has not come down at its ends.
    fn spread(&self) -> Option<f64> {
        let best = self.best().0;
        if [*self.points.first()?, *self.points.last()?].into_iter().any(|end| self.likelihood(end) > OPEN) {
            return None;
        }
        let (mut sum, mut square) = (0.0, 0.0);
        for three in self.points.windows(3) {
            let weight = 0.5 * (three[2].0 - three[0].0) * self.likelihood(three[1]);
            sum += weight;
            square += weight * (three[1].0 - best).powi(2);
        }
        (sum > 0.0).then(|| (square / sum).sqrt())
    }
}

/// `fit` with every value on which the response depends in jumps where the records leave least, and how well it is known.
pub(crate) fn profile_non_smooth(likelihood: &Likelihood, fit: Fit) -> Option<Fit> {
    let jumping: Vec<(usize, usize)> = fit.hypothesis.effects.iter().enumerate().filter_map(jumping).collect();
    if jumping.is_empty() || likelihood.data.has_logs() {
        return Some(fit);
    }
    let is_non_smooth = |coordinate: &Coordinate| {
        jumping.iter().any(|&(effect, value)| *coordinate == Coordinate::Effect { effect, value })
    };
    let others: Vec<Coordinate> =
        fit.coordinates.iter().copied().filter(|coordinate| !is_non_smooth(coordinate)).collect();
    let mut settled = fit;
    for &(effect, value) in &jumping {
        let found = if settled.hypothesis.effects[effect].phases.is_empty() {
            settle(likelihood, &settled.hypothesis, Coordinate::Effect { effect, value }, &others)?
        } else {
            frame_rate::settle_rate(likelihood, &settled.hypothesis, effect)?
        };
        settled = fit_coordinates(likelihood, &found, others.clone(), MOST_STEPS)?;
    }
    Some(settled)
}

/// `known` with the coordinate where a profile is least, all others following.
fn settle(
    likelihood: &Likelihood,
    known: &Hypothesis,
    coordinate: Coordinate,
    others: &[Coordinate],
) -> Option<Hypothesis> {
    let Coordinate::Effect { effect, .. } = coordinate else { return None };
    let linearization = Linearization::at(likelihood, known, others.to_vec())?;
    let followed = |at: f64| {
        let mut moved = known.clone();
        moved.set(coordinate, at);
        linearization.predict(likelihood, &moved)
    };
    let profile = Profile::draw(known.get(coordinate), |at| followed(at).map(|(chi_square, _)| chi_square))?;
    // Not by way of its logarithm, whose rounding may take a command over a step.
    let (left_here, here) = linearization.predict(likelihood, known)?;
    let (at, least) = profile.best();
    let mut best = if left_here < least + MOVES { here } else { followed(at)?.1 };
    best.effects[effect].profiled_std = profile.std().unwrap_or(f64::INFINITY);
    Some(best)
}

/// An effect, and its value, with that one value on which the response depends in jumps.
fn jumping((effect, candidate): (usize, &Candidate)) -> Option<(usize, usize)> {
    let mut searched = Candidate::searched(candidate.kind);
    let (value, _) = searched.next().filter(|_| searched.next().is_none())?;
    (candidate.is_non_smooth() || !candidate.phases.is_empty()).then_some((effect, value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_parabola_it_is_the_curvatures_standard_error() {
        for std in [1e-5, 3e-4, 0.01] {
            // The fit lies a little beside the least.
            let chi_square = |at: f64| Some(7000.0 + ((at - 1.0) / std).powi(2));
            let profile = Profile::draw(1.0 + 0.3 * std, chi_square).unwrap();
            assert!((profile.best().0 - 1.0).abs() < 0.3 * std);
            assert!((profile.spread().unwrap() / std - 1.0).abs() < 0.1, "{:?} for {std}", profile.spread());
            // A walk that rises as far as the parabola is less sure.
            assert!((profile.std().unwrap() / std - 1.38).abs() < 0.1, "{:?} for {std}", profile.std());
        }
    }

    #[test]
    fn steps_that_are_nearly_as_low_count() {
        // Two wells of equal depth, 1e-3 apart, each 1e-5 wide.
        let chi_square = |at: f64| {
            let well = |place: f64| ((at - place) / 1e-5).powi(2);
            Some(well(0.0).min(well(1e-3)).min(500.0))
        };
        let profile = Profile {
            points: (-200..=1200).map(|k| f64::from(k) * 1e-6).map(|at| (at, chi_square(at).unwrap())).collect(),
        };
        let spread = profile.spread().unwrap();
        assert!((spread / (0.5e-6_f64).sqrt() - 1.0).abs() < 0.01, "{spread}");
    }

    #[test]
    fn a_chi_square_that_does_not_rise_says_nothing() {
        assert_eq!(Profile::draw(0.0, |_| Some(3.0)).unwrap().std(), None);
        assert!(Profile::draw(0.0, |_| None).is_none());
    }
}
