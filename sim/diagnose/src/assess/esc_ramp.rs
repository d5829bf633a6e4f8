//! How fast an ESC lets its command change: as found, or how fast at least.
//!
//! Where a limit of the rate is named, its values say it. Where none is, a limit may still be there that the records are too slow or too
//! small to show. So it is put in at a given rate, all else follows, and the rate is lowered until the chi-square has risen by what a value
//! at the end of its 95 % interval costs: a limit slower than that would have been seen. Beside another effect, or where something is left
//! that has no name, nothing is excluded: a ramp may be what these stand for.

use std::fmt;
use std::sync::OnceLock;

use rotorlead_numerics::statistics::STANDARD_ERRORS_OF_95_PERCENT;
use rotorlead_plant::effect::slew_limit;

use crate::assess::verdict::Verdict;
use crate::data::split::Split;
use crate::estimate::fit::{Fit, MOST_STEPS, fit_coordinates};
use crate::likelihood::Likelihood;
use crate::model::candidate::Candidate;
use crate::model::hypothesis::{Coordinate, Hypothesis};

/// The rates that are tried, parts of the range in a second. Standard: ESCs have ramps of 0.025 to 16 % in a millisecond, 0.25 to 160; a
/// rate below the slowest takes minutes over the range.
const RATES_PER_S: (f64, f64) = (0.01, 160.0);
/// Each is so many times slower than the one before, until one is excluded. Chosen: six lead from end to end; more cost fits.
const SLOWER: f64 = 5.0;
/// Halvings between the first rate that is excluded and the last one that is not, by their logarithm. Derived: five leave a thirty-second
/// of a factor of five, 5 %.
const HALVINGS: usize = 5;
/// A rate that limits nothing, 1/s. Derived: over the whole range it takes 0.1 ms, half a frame of a control loop of 5 kHz.
const NO_LIMIT_PER_S: f64 = 1e4;
/// Limits the other direction nowhere: the ratio of both rates at the end of what is possible.
const FREE: f64 = 1e3;

/// The ramps of an ESC, parts of the range in a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EscRamp {
    /// Of a command that rises.
    pub up: RampRate,
    /// Of one that falls.
    pub down: RampRate,
}

/// The ramp of one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RampRate {
    /// As found, 1/s; `None` where no ramp shows.
    pub rate_per_s: Option<f64>,
    /// A slower one is excluded with 95 %, 1/s; `None` where the records exclude none, or another effect may stand for a ramp.
    pub low_per_s: Option<f64>,
    /// A faster one is, 1/s; `None` where there may be no ramp.
    pub high_per_s: Option<f64>,
}

/// What was fitted, and to what: enough to ask more of it later.
#[derive(Clone)]
pub(crate) struct Fitted {
    likelihood: Likelihood,
    fit: Fit,
    /// Whether nothing but noise is left.
    is_explained: bool,
    /// Once it was asked for.
    esc_ramp: OnceLock<EscRamp>,
}

impl fmt::Debug for Fitted {
    /// Without the records, which are long.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Fitted").finish_non_exhaustive()
    }
}

impl Fitted {
    pub fn new(likelihood: &Likelihood, fit: &Fit, verdict: Verdict) -> Self {
        let is_explained = matches!(verdict, Verdict::Agrees | Verdict::Named);
        Self { likelihood: likelihood.clone(), fit: fit.clone(), is_explained, esc_ramp: OnceLock::new() }
    }

    /// What the records say of the ramps of the ESC.
    pub fn esc_ramp(&self) -> EscRamp {
        *self.esc_ramp.get_or_init(|| self.search())
    }

    fn search(&self) -> EscRamp {
        let effects = &self.fit.hypothesis.effects;
        match effects.iter().position(|effect| effect.kind.id == slew_limit::ID) {
            Some(effect) => self.found(effect),
            None if !self.is_explained || !effects.is_empty() => {
                EscRamp { up: RampRate::unknown(), down: RampRate::unknown() }
            }
            None => EscRamp {
                up: self.excluded(|rate| [rate, FREE]),
                down: self.excluded(|rate| [rate * FREE, 1.0 / FREE]),
            },
        }
    }

    /// The rates of the limit that was found. Their logarithms are what was searched.
    fn found(&self, effect: usize) -> EscRamp {
        let values = &self.fit.hypothesis.effects[effect].values;
        let [up, ratio] = [0, 1].map(|value| Coordinate::Effect { effect, value });
        let std_up = self.fit.std(up).unwrap_or(f64::INFINITY);
        // A ratio that was not searched is that of the catalog's law, one.
        let std_down = match self.fit.pair_covariance([up, ratio]) {
            Some(covariance) => covariance.sum().max(0.0).sqrt(),
            None => std_up,
        };
        EscRamp { up: RampRate::found(values[0], std_up), down: RampRate::found(values[0] * values[1], std_down) }
    }

    /// The slowest rate that the records allow, of limits with these `values`.
    fn excluded(&self, values: impl Fn(f64) -> [f64; 2]) -> RampRate {
        let hypothesis = &self.fit.hypothesis;
        let coordinates = hypothesis.coordinates(true);
        let chi_square = |hypothesis: &Hypothesis| {
            fit_coordinates(&self.likelihood, hypothesis, coordinates.clone(), MOST_STEPS).map(|fit| fit.chi_square)
        };
        let excess = self.likelihood.excess(hypothesis, Split::Train);
        // More than noise is left of a model that is not exact; a rise has to be larger by as much.
        let beyond_noise = if excess.expected > 0.0 { (excess.sum / excess.expected).max(1.0) } else { 1.0 };
        let rise = STANDARD_ERRORS_OF_95_PERCENT.powi(2) * beyond_noise;
        let limited =
            |rate: f64| chi_square(&hypothesis.with(Candidate::new(&slew_limit::KIND, values(rate).to_vec())));
        // One that limits nothing, so that both are simulated in the same way.
        let Some(without) = limited(NO_LIMIT_PER_S) else { return RampRate::unknown() };
        let is_excluded = |rate: f64| limited(rate).is_some_and(|with| with > without + rise);
        let (slowest, fastest) = RATES_PER_S;
        let (mut rate, mut allowed) = (fastest, None);
        while !is_excluded(rate) {
            if rate <= slowest {
                return RampRate::unknown();
            }
            allowed = Some(rate);
            rate = (rate / SLOWER).max(slowest);
        }
        let (mut low, mut high) = (rate, allowed.unwrap_or(fastest));
        for _ in 0..HALVINGS {
            let middle = (low * high).sqrt();
            if is_excluded(middle) { low = middle } else { high = middle }
        }
        RampRate { rate_per_s: None, low_per_s: Some(low), high_per_s: None }
    }
}

impl RampRate {
    fn found(rate_per_s: f64, std_of_logarithm: f64) -> Self {
        let reach = STANDARD_ERRORS_OF_95_PERCENT * std_of_logarithm;
        let end = |sign: f64| Some(rate_per_s * (sign * reach).exp()).filter(|end| end.is_finite() && *end > 0.0);
        Self { rate_per_s: Some(rate_per_s), low_per_s: end(-1.0), high_per_s: end(1.0) }
    }

    fn unknown() -> Self {
        Self { rate_per_s: None, low_per_s: None, high_per_s: None }
    }
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::Catalog;

    use crate::testing::records;
    use crate::{EscRamp, Options, diagnose};

    fn ramp(effects: &str) -> EscRamp {
        let catalog = Catalog::standard();
        let options = Options { model: None, catalog: &catalog, progress: &|| {} };
        diagnose(&records(effects, 0.05, 1), &options).unwrap().esc_ramp()
    }

    #[test]
    fn a_ramp_is_found_in_both_directions_within_its_interval() {
        let found = ramp("[[effect]]\nkind = \"slew_limit\"\nparameters = { rate_per_s = 0.6, down_ratio = 0.5 }\n");
        for (direction, truth) in [(found.up, 0.6), (found.down, 0.3)] {
            let [low, high] = [direction.low_per_s, direction.high_per_s].map(Option::unwrap);
            assert!(low < truth && truth < high && high < 1.2 * low, "{direction:?} is not {truth}");
        }
    }

    #[test]
    fn beside_another_effect_none_is_excluded() {
        let found = ramp("[[effect]]\nkind = \"asymmetric_lag\"\nparameters = { ratio = 1.6 }\n");
        for direction in [found.up, found.down] {
            assert!(direction.rate_per_s.is_none() && direction.low_per_s.is_none(), "{direction:?}");
        }
    }

    #[test]
    fn where_none_is_what_would_have_been_seen_is_excluded() {
        let found = ramp("");
        for direction in [found.up, found.down] {
            assert!(direction.rate_per_s.is_none() && direction.high_per_s.is_none(), "{direction:?}");
            // Records that show 0.6 exclude it.
            assert!(direction.low_per_s.is_some_and(|low| low > 0.6), "{direction:?}");
        }
    }
}
