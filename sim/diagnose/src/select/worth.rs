//! What an effect is worth beside the others of a set, and what its worth rests on.
//!
//! What a model misses of records that do not repeat is its own error and no noise, so that the evidence alone overrates what fits such
//! an error by accident. There an effect is also asked for by steps that play no part in its fit, and may not as well be absent.

use rotorlead_plant::effect::{Parameter, Site};

use super::folds;
use super::pool::{Member, Pool, without};
use crate::assess::gaps::compute_gaps;
use crate::assess::lateness::LOGGER_ROWS;
use crate::estimate::fit::fit_in;
use crate::model::candidate::{AT_MOST_OFF, Candidate};
use crate::model::hypothesis::Hypothesis;
use crate::policy::POLICY;
use crate::select::search::Search;

/// Steps of a fit without one of the effects. Chosen: it starts at a fit and ends sooner where a step gains no more than chance; too few
/// would overrate the effect, more cost only time.
const WITHOUT: usize = 8;

/// What one effect of a set is worth.
#[derive(Clone, Debug)]
pub(crate) struct Worth {
    /// Log evidence that is lost without it.
    pub lost: f64,
    /// Log likelihood that is lost without it on what is fitted.
    pub fitted_gain: f64,
    /// The same on steps that are held out in turn, the mean; `None` where that was not asked.
    pub held_out_gain: Option<f64>,
    /// The others.
    pub rest: Member,
    /// The tests that it fails, in words.
    pub failed: Vec<String>,
}

impl Search<'_> {
    /// What an effect of a member is worth. `None` where nothing can be said without it.
    pub fn worth(&self, pool: &Pool, member: &Member, effect: usize) -> Option<Worth> {
        let hypothesis = &member.fit.hypothesis;
        let kinds = without(&member.kinds(), hypothesis.effects[effect].kind);
        let fitted =
            || fit_in(&self.likelihood, &hypothesis.without(effect), self.lags, WITHOUT).map(|fit| self.member(fit));
        let rest = pool.get(&kinds).filter(|rest| rest.is_possible()).cloned().or_else(fitted)?;
        let mut worth = Worth {
            lost: member.evidence - rest.evidence,
            fitted_gain: 0.5 * (rest.fit.chi_square - member.fit.chi_square),
            held_out_gain: None,
            rest,
            failed: Vec::new(),
        };
        if worth.lost < POLICY.least_score {
            worth.failed.push(format!("score: below {}", POLICY.least_score));
        } else if self.likelihood.data.has_logs() {
            self.ask_logs(member, effect, &mut worth);
        }
        Some(worth)
    }

    /// Whether each effect of a member passes every test.
    pub fn is_borne_out(&self, pool: &Pool, member: &Member) -> bool {
        (0..member.size()).all(|effect| self.worth(pool, member, effect).is_some_and(|worth| worth.failed.is_empty()))
    }

    /// The evidence that a name has to bring: more than chance, and more than what the law of another may be off by, where `best` is the
    /// best that all names together do.
    pub fn cost_of_a_name(&self, pool: &Pool, best: &Member) -> f64 {
        let whole = pool.get(&[]).map_or(0.0, |zero| best.evidence - zero.evidence);
        if self.likelihood.data.has_logs() {
            // What is left there is no law that is a little other, but whatever the levels are off by.
            POLICY.least_score
        } else if self.is_noise(&best.fit) {
            POLICY.least_score + POLICY.of_noise * whole
        } else {
            POLICY.least_score.max(POLICY.of_law * whole)
        }
    }

    fn ask_logs(&self, member: &Member, effect: usize, worth: &mut Worth) {
        let hypothesis = &member.fit.hypothesis;
        worth.held_out_gain = folds::gain(&self.likelihood, &worth.rest.fit.hypothesis, hypothesis);
        if worth.held_out_gain.is_some_and(|gain| gain < 0.0) {
            worth.failed.push("held-out gain: below 0".to_owned());
        }
        worth.failed.extend(self.implausible(hypothesis, effect, 0.0));
        if !member.fit.excludes_absence(effect) {
            worth.failed.push("95 % interval: includes no effect".to_owned());
        }
        let gap = compute_gaps(&self.likelihood, &worth.rest.fit.hypothesis, hypothesis, true).total;
        if gap.after > gap.before {
            let wider =
                format!("held-out gap: {:.2} % without it, {:.2} % with it", 100.0 * gap.before, 100.0 * gap.after);
            worth.failed.push(wider);
        }
    }
}

impl Search<'_> {
    /// Whether no value of a member lies farther from where its effect vanishes than any actuator is plausible to have it.
    pub fn is_plausible(&self, member: &Member) -> bool {
        let hypothesis = &member.fit.hypothesis;
        (0..member.size()).all(|effect| self.implausible(hypothesis, effect, AT_MOST_OFF).is_none())
    }

    /// Which value of an effect is implausible, lying beyond its range by more than this `part` of it. A delay in a log is that of the
    /// logger as well, which stamps up to some rows late.
    fn implausible(&self, hypothesis: &Hypothesis, effect: usize, part: f64) -> Option<String> {
        let mut own = hypothesis.effects[effect].clone();
        let data = &self.likelihood.data;
        if own.kind.site == Site::Line && data.has_logs() {
            let row_s = data.records.iter().map(|record| record.rate_hz.recip()).fold(0.0, f64::max);
            own.values[0] = (own.values[0] - LOGGER_ROWS * row_s).max(own.kind.parameters[0].plausible.0);
        }
        // Two lags in a row are the same in either order: the longer one is the rotor's.
        let lag_s = hypothesis.base.iter().map(|point| point.time_constant_s).fold(f64::INFINITY, f64::min);
        let longer = |(index, parameter): (usize, &'static Parameter)| {
            let value = own.values[index];
            (parameter.is_lag && value > lag_s).then(|| {
                format!(
                    "plausible range: {} {value:.4} s, expected less than the rotor's lag of {lag_s:.4} s",
                    parameter.name
                )
            })
        };
        own.beyond_range(part).or_else(|| Candidate::searched(own.kind).find_map(longer))
    }
}
