//! Numbers of a given model: kept where nothing is better, called wrong where others are.

use rotorlead_identify::estimate::Estimate;

use crate::data::dataset::Dataset;
use crate::data::split::Split;
use crate::estimate::fit::{Fit, fit};
use crate::likelihood::Likelihood;
use crate::model::hypothesis::{BasePoint, Coordinate, Hypothesis};
use crate::policy::POLICY;
use crate::select::explanation::Explanation;
use crate::select::search::Search;

/// A lag is another one than the given where its squared distance in standard errors is more than this. Standard: the quantile of a
/// chi-square of two degrees of freedom at 99 %, `2 ln 100`, so that noise alone exceeds it once in 100 times.
const IMPROVED: f64 = 9.2;

/// That the numbers of a given model are wrong.
pub(crate) struct ParameterMismatch {
    /// By how much the log likelihood grows with others, less one for each.
    pub evidence: f64,
    /// Mean relative errors of gain and time constant.
    pub parameters: [Estimate; 2],
    /// The given numbers with the effects that were found.
    pub given: Hypothesis,
}

/// What was found with the lags fitted along, beside the given lags: those are kept where the records do not improve on them, and
/// are what there was before.
///
/// Lags that were fitted to a single kind of record can take over what an effect does to it, and do worse than the given ones on what
/// was held out. Then effects are looked for beside the given lags, in the records as they are `untouched`. `None` where the given
/// lags cannot be simulated.
pub(crate) fn compared(
    search: &mut Search,
    untouched: &Dataset,
    base: &[BasePoint],
    mut explanation: Explanation,
) -> Option<(Explanation, Option<ParameterMismatch>)> {
    let given = Hypothesis { base: base.to_vec(), ..explanation.after.hypothesis.clone() };
    let with_effects = fit(&search.likelihood, &given, false)?;
    let mut wrong = wrong_numbers(base, &with_effects, &explanation.after);
    let of_lags = Hypothesis::from_lags(base.to_vec());
    if wrong.is_some()
        && explanation.found.is_empty()
        && let Some(other) = beside_given(search, untouched, &with_effects, &explanation.after)
    {
        (explanation, wrong) = (other, None);
    } else {
        // What was held out has to bear out that the numbers are others.
        let held_out = |fit: &Fit| search.likelihood.chi_square(&fit.hypothesis, Split::Holdout);
        if held_out(&explanation.after)? > held_out(&with_effects)? {
            wrong = None;
        }
        if wrong.is_none() {
            explanation.after = match explanation.found.is_empty() {
                true => with_effects,
                false => keep_given(&search.likelihood, base, explanation.after)?,
            };
        }
    }
    explanation.before = fit(&search.likelihood, &of_lags, false)?;
    Some((explanation, wrong))
}

/// Effects beside the `given` lags, where these do better than the `refitted` on what is held out, and the effects make them do better
/// on all there is. `None` where they do not, and for records that do not repeat, whose levels are free; the search then stands as
/// it was.
fn beside_given(search: &mut Search, untouched: &Dataset, given: &Fit, refitted: &Fit) -> Option<Explanation> {
    let half_of =
        |likelihood: &Likelihood, hypothesis: &Hypothesis, split| Some(0.5 * likelihood.chi_square(hypothesis, split)?);
    let held_out = |fit: &Fit| half_of(&search.likelihood, &fit.hypothesis, Split::Holdout);
    if search.likelihood.data.has_logs() || held_out(refitted)? - held_out(given)? < POLICY.least_score_of_numbers {
        return None;
    }
    let mut beside = Search::prepared(untouched, &given.hypothesis, (search.catalog, search.progress), false)?;
    let other = beside.explain(&given.hypothesis).filter(|other| !other.found.is_empty())?;
    let all = |hypothesis: &Hypothesis| {
        let parts = [Split::Train, Split::Holdout].map(|split| half_of(&beside.likelihood, hypothesis, split));
        Some(parts[0]? + parts[1]?)
    };
    let is_better = all(&refitted.hypothesis)? - all(&other.after.hypothesis)? >= POLICY.least_score_of_numbers;
    is_better.then(|| {
        search.likelihood = beside.likelihood;
        other
    })
}

/// `refitted` with the given lag wherever the records do not improve on it: a lag fitted to few of them would be worse on the
/// others. How well it is known is another matter, and stays as it is.
fn keep_given(likelihood: &Likelihood, given: &[BasePoint], refitted: Fit) -> Option<Fit> {
    let mut kept = refitted.hypothesis.clone();
    for (point, (found, given)) in kept.base.iter_mut().zip(given).enumerate() {
        let off = [(found.gain / given.gain).ln(), (found.time_constant_s / given.time_constant_s).ln()];
        let distance = refitted.distance([Coordinate::Gain(point), Coordinate::TimeConstant(point)], off);
        if distance.is_none_or(|distance| distance < IMPROVED) {
            *found = *given;
        }
    }
    let hypothesis = fit(likelihood, &kept, false)?.hypothesis;
    Some(Fit { hypothesis, ..refitted })
}

/// Whether a given model's numbers are wrong. `given` has the model's lags, `refitted` the best ones, both with the
/// effects that were found.
fn wrong_numbers(base: &[BasePoint], given: &Fit, refitted: &Fit) -> Option<ParameterMismatch> {
    let score = 0.5 * (given.chi_square - refitted.chi_square) - (2 * base.len()) as f64;
    let ratio = |number: fn(&BasePoint) -> f64, coordinate: fn(usize) -> Coordinate| {
        let of_points = base.iter().zip(&refitted.hypothesis.base).enumerate().map(|(point, (given, found))| {
            let std = refitted.std(coordinate(point)).unwrap_or(f64::INFINITY);
            // A number that is not known has next to no weight, and not none: all of them may be.
            (number(found) / number(given) - 1.0, std.powi(-2).max(1e-30))
        });
        let (sum, weight) =
            of_points.fold((0.0, 0.0), |(sum, total), (error, weight)| (sum + error * weight, total + weight));
        Estimate::normal(sum / weight, weight.sqrt().recip())
    };
    let gain = ratio(|point| point.gain, Coordinate::Gain);
    let time_constant = ratio(|point| point.time_constant_s, Coordinate::TimeConstant);
    let beside = !refitted.hypothesis.effects.is_empty();
    // What is not known cannot be wrong.
    let error = |estimate: &Estimate| if estimate.excludes(0.0) { estimate.value.abs() } else { 0.0 };
    let largest = error(&gain).max(error(&time_constant));
    let is_wrong =
        score > POLICY.least_score_of_numbers && largest > if beside { POLICY.least_error_beside } else { 0.0 };
    is_wrong.then(|| ParameterMismatch {
        evidence: score,
        parameters: [gain, time_constant],
        given: given.hypothesis.clone(),
    })
}
