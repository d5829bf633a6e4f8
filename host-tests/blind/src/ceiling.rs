//! What can be told of a case at all: whether the truth, in the generator's own model, explains its data better than
//! every rival does.

use serde::{Deserialize, Serialize};

use super::case::{Case, Class, Columns, Given};
use super::fit::Fitter;
use super::kind::Kind;
use super::motor::Motor;

/// How much better, in log likelihood, the truth must be than a rival to be told from it.
pub const MARGIN: f64 = 5.0;

/// Which rivals are fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rivals {
    /// None: what can be told stays unknown.
    None,
    /// Those that are known to be confused with the truth.
    Family,
    /// Every kind.
    All,
}

/// Log likelihoods of a case, less that of the truth's own fit: below zero is worse.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Ceiling {
    /// With the base parameters alone.
    pub nothing: f64,
    /// With each rival, by name.
    pub rivals: Vec<(String, f64)>,
}

impl Ceiling {
    /// Whether the effect shows in the data at all.
    #[must_use]
    pub fn is_visible(&self) -> bool {
        self.nothing <= -MARGIN
    }

    /// Whether the truth beats every rival by the margin.
    #[must_use]
    pub fn is_told(&self) -> bool {
        self.is_visible() && self.rivals.iter().all(|(_, difference)| *difference <= -MARGIN)
    }

    /// Whether the likelihood would choose the truth: it beats every rival at all.
    #[must_use]
    pub fn prefers_truth(&self) -> bool {
        self.nothing < 0.0 && self.rivals.iter().all(|(_, difference)| *difference < 0.0)
    }
}

/// The ceiling of a case; of an empty one and of one outside the catalog there is none.
///
/// Where the model given to the tool is stale, its numbers are the truth's rival: with them held, no other kind may do
/// as well as new numbers do. Of a pair, each of the two alone is a rival.
#[must_use]
pub fn ceiling(case: &Case, columns: &[Columns], which: Rivals) -> Option<Ceiling> {
    if which == Rivals::None {
        return None;
    }
    let mut fitter = Fitter::new(case, columns);
    match case.class {
        Class::Empty | Class::Outside => None,
        Class::Pair => {
            let kinds: Vec<Kind> = case.effects.iter().map(|effect| effect.kind).collect();
            let truth = fitter.best(&kinds, None).log_likelihood;
            let nothing = fitter.best(&[], None).log_likelihood - truth;
            let rivals = kinds
                .iter()
                .map(|kind| (kind.name().to_owned(), fitter.best(&[*kind], None).log_likelihood - truth))
                .collect();
            Some(Ceiling { nothing, rivals })
        }
        Class::Single(kind) => {
            let frozen = match &case.given {
                Given::Stale(errors) => Some(stale(&case.motor, errors)),
                Given::Nothing | Given::Right => None,
            };
            let kinds: &[Kind] = if kind == Kind::ParameterError { &[] } else { &[kind] };
            let truth = fitter.best(kinds, None).log_likelihood;
            let nothing = fitter.best(&[], frozen.as_ref()).log_likelihood - truth;
            let rivals: Vec<Kind> = match which {
                Rivals::None => Vec::new(),
                Rivals::Family => kind.confused_with().to_vec(),
                Rivals::All => Kind::ALL.to_vec(),
            };
            let rivals = rivals
                .into_iter()
                .filter(|rival| *rival != kind && *rival != Kind::ParameterError)
                .map(|rival| (rival.name().to_owned(), fitter.best(&[rival], frozen.as_ref()).log_likelihood - truth))
                .collect();
            Some(Ceiling { nothing, rivals })
        }
    }
}

/// The motor as the stale model has it.
#[must_use]
pub fn stale(motor: &Motor, errors: &[(f64, f64)]) -> Motor {
    let mut motor = motor.clone();
    for (point, (gain, time)) in motor.points.iter_mut().zip(errors) {
        point.gain_n *= 1.0 + gain;
        point.time_constant_s *= 1.0 + time;
    }
    motor
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ceiling(nothing: f64, rival: f64) -> Ceiling {
        Ceiling { nothing, rivals: vec![("dead_band".to_owned(), rival)] }
    }

    #[test]
    fn told_means_better_than_nothing_and_than_every_rival_by_the_margin() {
        assert!(ceiling(-5.0, -5.0).is_told());
        assert!(!ceiling(-50.0, -4.9).is_told() && ceiling(-50.0, -4.9).prefers_truth());
        assert!(!ceiling(-4.9, -50.0).is_visible() && !ceiling(-4.9, -50.0).is_told());
        assert!(!ceiling(-50.0, 0.1).prefers_truth());
    }
}
