//! Which of the explanations is named: a choice by the fitted column and by stated rules. The held-out column has no say in
//! it.

use super::explanation::{Explanation, Scope, Standing};
use super::likelihood::Likelihood;

/// Explanations whose log likelihoods differ by no more than this cannot be separated.
const INDISTINCT: f64 = 2.0;

/// Marks the chosen explanation and its alternatives; gives the place of the chosen one.
///
/// Of the explanations with fewer numbers than data, those count that gain more log likelihood than their numbers cost, whose
/// size is not its null value by its 95 % interval, and which leave no more than the known noise. Among those within
/// [`INDISTINCT`] of the best, the one with the fewest numbers is named, and among these the first in the order of the
/// catalog, which begins with wrong numbers. Where there is none, the first that reproduces every bandwidth with a number
/// at each: it says what would explain them, not that it does.
///
/// `asked` is the name of one that is to be chosen instead.
pub(super) fn choose(found: &mut [Explanation], likelihood: &Likelihood, asked: Option<&str>) -> Option<usize> {
    let chosen = match asked {
        Some(name) => found.iter().position(|one| one.name() == name),
        None => by_rule(found, likelihood),
    }?;
    let least = found[chosen].gain - INDISTINCT;
    for (index, one) in found.iter_mut().enumerate() {
        one.standing = match one.scope {
            _ if index == chosen => Standing::Chosen,
            Scope::Each => Standing::Alternative,
            // A choice with a number at each leaves nothing, which no other can: those that may be noise stay.
            Scope::All if one.gain >= least || (one.score > Some(0.0) && is_left_to_noise(one, likelihood)) => {
                Standing::Alternative
            }
            Scope::All => Standing::Worse,
        };
    }
    Some(chosen)
}

fn by_rule(found: &[Explanation], likelihood: &Likelihood) -> Option<usize> {
    let candidates = || {
        let all = found.iter().enumerate();
        all.filter_map(|(index, one)| one.score.filter(|_| is_seen(one, likelihood)).map(|score| (index, score)))
    };
    let best = candidates().map(|(_, score)| score).fold(f64::NEG_INFINITY, f64::max);
    candidates()
        .filter(|(_, score)| *score >= best - INDISTINCT)
        .min_by_key(|(index, _)| (found[*index].numbers, *index))
        .map(|(index, _)| index)
        .or_else(|| found.iter().position(|one| one.scope == Scope::Each))
}

/// Whether the fitted column shows that it is there.
fn is_seen(one: &Explanation, likelihood: &Likelihood) -> bool {
    let size = one.parameters.first().is_some_and(|(parameter, size)| size.excludes(parameter.null));
    size && one.score > Some(0.0) && is_left_to_noise(one, likelihood)
}

/// Whether it leaves no more than the known noise, where that is known.
fn is_left_to_noise(one: &Explanation, likelihood: &Likelihood) -> bool {
    let left = one.fitted_rms.powi(2) * likelihood.count as f64;
    likelihood.is_noise(left, likelihood.count, one.numbers).unwrap_or(true)
}
