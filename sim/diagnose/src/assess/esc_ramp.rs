//! How fast an ESC lets its command change: as found, or how fast at least.
//!
//! Where a limit of the rate is named and holds the command back in a direction, its values say how fast. Where none does, a limit may
//! still be there that the records are too slow or too small to show. So it is put in at a given rate, all else follows, and the rate is
//! lowered until the chi-square has risen by what a value at the end of its 95 % interval costs: a limit slower than that would have been
//! seen. What another effect does may in truth be done by a ramp, so that each is left out in turn: a rate is excluded where no such model
//! allows it. Where more than noise is left of the records, a rise has to be larger by as much.

use std::fmt;
use std::sync::OnceLock;

use rotorlead_numerics::statistics::STANDARD_ERRORS_OF_95_PERCENT;
use rotorlead_plant::effect::slew_limit;

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
/// Nor does one that is so many times as fast as that of the other direction. Derived: at the slowest ramp of an ESC, 0.25 1/s, it takes
/// 13 ms over the range, fewer than any rotor's lag; and a search of the ratio, which goes to a thousand, has room.
const FREE: f64 = 300.0;

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
    /// A slower one is excluded with 95 %, 1/s; `None` where the records exclude none.
    pub low_per_s: Option<f64>,
    /// A faster one is, 1/s; `None` where there may be no ramp.
    pub high_per_s: Option<f64>,
}

/// What was fitted, and to what: enough to ask more of it later.
#[derive(Clone)]
pub(crate) struct Fitted {
    likelihood: Likelihood,
    fit: Fit,
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
    pub fn new(likelihood: &Likelihood, fit: &Fit) -> Self {
        Self { likelihood: likelihood.clone(), fit: fit.clone(), esc_ramp: OnceLock::new() }
    }

    /// What the records say of the ramps of the ESC.
    pub fn esc_ramp(&self) -> EscRamp {
        *self.esc_ramp.get_or_init(|| Profile::new(self).map_or(EscRamp::UNKNOWN, |profile| profile.ramp()))
    }
}

/// One of both directions, by its place among the values of a limit.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Direction {
    Up,
    Down,
}

/// The chi-square by the rate of a limit in one direction.
struct Profile<'a> {
    fitted: &'a Fitted,
    /// What else the model has, and the same without each of its effects.
    others: Vec<Hypothesis>,
    /// The rates of the limit up and down, 1/s; [`NO_LIMIT_PER_S`] where none is known.
    rates_per_s: [f64; 2],
    /// By how much the chi-square rises at the end of an interval.
    rise: f64,
}

impl<'a> Profile<'a> {
    fn new(fitted: &'a Fitted) -> Option<Self> {
        let hypothesis = &fitted.fit.hypothesis;
        let named = hypothesis.effects.iter().position(|effect| effect.kind.id == slew_limit::ID);
        let rest = named.map_or_else(|| hypothesis.clone(), |effect| hypothesis.without(effect));
        let left_out = (0..rest.effects.len()).map(|effect| rest.without(effect));
        let others = std::iter::once(rest.clone()).chain(left_out).collect();
        let excess = fitted.likelihood.excess(hypothesis, Split::Train);
        let beyond_noise = if excess.expected > 0.0 { (excess.sum / excess.expected).max(1.0) } else { 1.0 };
        let rise = STANDARD_ERRORS_OF_95_PERCENT.powi(2) * beyond_noise;
        let mut profile = Self { fitted, others, rates_per_s: [NO_LIMIT_PER_S; 2], rise };
        if let Some(effect) = named {
            let &[up_per_s, ratio] = &hypothesis.effects[effect].values[..] else { return None };
            profile.rates_per_s = [up_per_s, up_per_s * ratio];
            // A limit that the records would not miss in a direction is none there.
            let is_missed = [Direction::Up, Direction::Down].map(|direction| {
                profile.at(direction, NO_LIMIT_PER_S, 0).is_some_and(|without| without > fitted.fit.chi_square + rise)
            });
            for (rate_per_s, is_missed) in profile.rates_per_s.iter_mut().zip(is_missed) {
                *rate_per_s = if is_missed { *rate_per_s } else { NO_LIMIT_PER_S };
            }
        }
        Some(profile)
    }

    fn ramp(&self) -> EscRamp {
        let [up, down] = [Direction::Up, Direction::Down].map(|direction| match self.rates_per_s[direction as usize] {
            NO_LIMIT_PER_S => self.excluded(direction),
            rate_per_s => RampRate::found(rate_per_s, self.std(direction)),
        });
        EscRamp { up, down }
    }

    /// Standard deviation of the logarithm of a rate that was found. The logarithms of the rate up and of the ratio are what was searched.
    fn std(&self, direction: Direction) -> f64 {
        let fit = &self.fitted.fit;
        let Some(effect) = fit.hypothesis.effects.iter().position(|effect| effect.kind.id == slew_limit::ID) else {
            return f64::INFINITY;
        };
        let [up, ratio] = [0, 1].map(|value| Coordinate::Effect { effect, value });
        let std = match direction {
            Direction::Up => fit.std(up),
            // A ratio that was not searched is that of the catalog's law, one.
            Direction::Down => fit
                .pair_covariance([up, ratio])
                .map_or(fit.std(up), |covariance| Some(covariance.sum().max(0.0).sqrt())),
        };
        std.unwrap_or(f64::INFINITY)
    }

    /// The chi-square with a limit at this rate in one direction, as found in the other, with one of the other models.
    fn at(&self, direction: Direction, rate_per_s: f64, other: usize) -> Option<f64> {
        let mut rates_per_s = self.rates_per_s;
        rates_per_s[direction as usize] = rate_per_s;
        let slower_per_s = rates_per_s[0].min(rates_per_s[1]);
        let [up_per_s, down_per_s] = rates_per_s.map(|rate_per_s| rate_per_s.min(FREE * slower_per_s));
        let limit = Candidate::new(&slew_limit::KIND, vec![up_per_s, down_per_s / up_per_s]);
        let hypothesis = self.others[other].with(limit);
        let effect = hypothesis.effects.len() - 1;
        let mut coordinates = hypothesis.coordinates(true);
        coordinates.retain(|at| !matches!(at, Coordinate::Effect { effect: of, .. } if *of == effect));
        // A limit in the other direction follows as well: by the ratio where the rate up is held, by both rates in proportion where the
        // one down is, which it moves by no more than it is uncertain itself.
        if rates_per_s[1 - direction as usize] < NO_LIMIT_PER_S {
            coordinates.push(Coordinate::Effect { effect, value: 1 - direction as usize });
        }
        fit_coordinates(&self.fitted.likelihood, &hypothesis, coordinates, MOST_STEPS).map(|fit| fit.chi_square)
    }

    /// The slowest rate that the records allow in a direction that has no limit, with all effects or without one of them.
    fn excluded(&self, direction: Direction) -> RampRate {
        let Some(without) = self.at(direction, NO_LIMIT_PER_S, 0) else { return RampRate::UNKNOWN };
        let is_excluded = |rate_per_s: f64| {
            (0..self.others.len())
                .all(|other| self.at(direction, rate_per_s, other).is_some_and(|with| with > without + self.rise))
        };
        let (slowest, fastest) = RATES_PER_S;
        let (mut rate, mut allowed) = (fastest, None);
        while !is_excluded(rate) {
            if rate <= slowest {
                return RampRate::UNKNOWN;
            }
            allowed = Some(rate);
            rate = (rate / SLOWER).max(slowest);
        }
        let (mut low, mut high) = (rate, allowed.unwrap_or(fastest));
        for _ in 0..HALVINGS {
            let middle = (low * high).sqrt();
            if is_excluded(middle) { low = middle } else { high = middle }
        }
        RampRate { low_per_s: Some(low), ..RampRate::UNKNOWN }
    }
}

impl EscRamp {
    const UNKNOWN: Self = Self { up: RampRate::UNKNOWN, down: RampRate::UNKNOWN };
}

impl RampRate {
    const UNKNOWN: Self = Self { rate_per_s: None, low_per_s: None, high_per_s: None };

    fn found(rate_per_s: f64, std_of_logarithm: f64) -> Self {
        let reach = STANDARD_ERRORS_OF_95_PERCENT * std_of_logarithm;
        let end = |sign: f64| Some(rate_per_s * (sign * reach).exp()).filter(|end| end.is_finite() && *end > 0.0);
        Self { rate_per_s: Some(rate_per_s), low_per_s: end(-1.0), high_per_s: end(1.0) }
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
    fn a_ramp_in_one_direction_alone_is_found_and_the_other_direction_has_none() {
        // Down at a thousandth of the rate up, and up at a thousandth of the one down.
        for (rate_per_s, ratio) in [(0.6, 1e3), (600.0, 1e-3)] {
            let effect = format!(
                "[[effect]]\nkind = \"slew_limit\"\nparameters = {{ rate_per_s = {rate_per_s}, down_ratio = {ratio} }}\n"
            );
            let EscRamp { up, down } = ramp(&effect);
            let (limited, free) = if ratio > 1.0 { (up, down) } else { (down, up) };
            let [low, high] = [limited.low_per_s, limited.high_per_s].map(Option::unwrap);
            assert!(low < 0.6 && 0.6 < high && high < 1.2 * low, "{ratio}: {limited:?}");
            assert!(free.rate_per_s.is_none() && free.low_per_s.is_some_and(|low| low > 0.6), "{ratio}: {free:?}");
        }
    }

    #[test]
    fn what_is_excluded_along_with_another_effect_holds_for_the_ramp_that_is_there() {
        const UNEQUAL: &str = "[[effect]]\nkind = \"asymmetric_lag\"\nparameters = { ratio = 1.6 }\n";
        for direction in [ramp(UNEQUAL).up, ramp(UNEQUAL).down] {
            assert!(
                direction.rate_per_s.is_none() && direction.low_per_s.is_some_and(|low| low > 0.6),
                "{direction:?}"
            );
        }
        for rate_per_s in [0.6, 2.0, 6.0] {
            let limit = format!("[[effect]]\nkind = \"slew_limit\"\nparameters = {{ rate_per_s = {rate_per_s} }}\n");
            let EscRamp { up, down } = ramp(&format!("{limit}{UNEQUAL}"));
            for direction in [up, down] {
                let [low, high] = [direction.low_per_s.unwrap_or(0.0), direction.high_per_s.unwrap_or(f64::INFINITY)];
                assert!(low < rate_per_s && rate_per_s < high, "{rate_per_s}: {direction:?}");
            }
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
