//! Effects that show only in how records begin.
//!
//! What a motor did before its record is not known, so the response at the begin of a record is free. Curvature ahead of the lag turns
//! a square wave into another one of the same levels around another mean: with the begin free, nothing of it is left to see. A motor
//! that had run at the nominal command for long begins there, though, and then comes to the other mean.
//!
//! Whether it had is asked of the records together. With `x_r` what record `r` is off at its begin, in parts of its swing, and `v_r`
//! the variance of that by noise, `x_r` is normal with variance `s^2 + v_r`, and `s`, how badly the experiment was begun, is the same for
//! all. Minus twice the log likelihood, next to that of begins that may be anything, is
//!
//! ```text
//! min over s of  sum x_r^2 / (s^2 + v_r) + ln (1 + s^2 / v_r)
//! ```
//!
//! An effect with which `s` vanishes is better by the logarithm, and by no more: that all begins are off for reasons of their own stays
//! possible.

use super::evidence::evidence;
use super::pool::Member;
use crate::data::dataset::PreparedRecord;
use crate::estimate::fit::{Fit, fit};
use crate::likelihood::excess::Excess;
use crate::likelihood::{InitialCondition, Likelihood};
use crate::model::hypothesis::Hypothesis;
use crate::policy::POLICY;
use crate::select::explanation::FoundEffect;
use crate::select::search::Search;

/// Smallest scatter that is tried, in parts of the swing. Chosen: well below what is ever seen; less is the scatter of 0, which is tried
/// too.
const LEAST_SCATTER: f64 = 1e-4;
/// Decades from there on. Derived: they reach ten swings, beyond a begin anywhere within the response.
const DECADES: usize = 5;
/// Scatters to a decade. Derived: half a step, 0.058 in the logarithm, is `2 * 0.058^2`, 0.007, off the minimum for each record, where
/// evidence counts in units.
const PER_DECADE: usize = 20;

/// What a record is off at its begin, in parts of its swing, and the variance of that by noise.
struct Off {
    part: f64,
    variance: f64,
}

/// What the records are off at their begins.
fn off(likelihood: &Likelihood, hypothesis: &Hypothesis) -> Vec<Off> {
    let of_record = |record: &PreparedRecord| {
        let swing = hypothesis.base[record.point].gain.abs() * record.amplitude;
        let (off, variance) = likelihood.periodic(record)?.off_at_start(hypothesis)?;
        Some(Off { part: off / swing, variance: variance / (swing * swing) })
    };
    likelihood.data.records.iter().filter_map(of_record).collect()
}

/// Whether the begins are off by noise alone.
fn are_as_before(off: &[Off]) -> bool {
    Excess { sum: deviance_at(off, 0.0), expected: off.len() as f64 }.is_noise()
}

fn deviance_at(off: &[Off], scatter: f64) -> f64 {
    let of_record = |Off { part, variance }: &Off| {
        part * part / (scatter * scatter + variance) + (scatter * scatter / variance).ln_1p()
    };
    off.iter().map(of_record).sum()
}

/// Minus twice the log likelihood of the begins, with the scatter that makes it least.
fn deviance(off: &[Off]) -> f64 {
    let scatter = |step: usize| LEAST_SCATTER * 10_f64.powf(step as f64 / PER_DECADE as f64);
    let scatters = std::iter::once(0.0).chain((0..=DECADES * PER_DECADE).map(scatter));
    scatters.map(|scatter| deviance_at(off, scatter)).fold(f64::INFINITY, f64::min)
}

impl Search<'_> {
    /// The effects with which all records begin where they should, where they do not with the lags alone, `before`. From then on the
    /// begins are compared. `None` where there are none. In the noise that `before` was fitted in.
    pub fn explain_starts(&self, before: &Fit) -> Option<(Member, Vec<FoundEffect>)> {
        let off_before = off(&self.likelihood, &before.hypothesis);
        if are_as_before(&off_before) {
            return None;
        }
        let mut steady = self.on(self.likelihood.clone());
        steady.likelihood.initial_condition = InitialCondition::Steady;
        let (pool, _) = steady.beam(&before.hypothesis)?;
        let (after, mut found) = steady.chosen(&pool)?;
        let off_after = off(&self.likelihood, &after.fit.hypothesis);
        if found.is_empty() || !are_as_before(&off_after) {
            return None;
        }
        // Next to begins that may be anything.
        let free = |hypothesis: &Hypothesis| {
            fit(&self.likelihood, hypothesis, self.lags).map(|fit| evidence(&self.likelihood, &fit))
        };
        let of_begins = 0.5 * (deviance(&off_before) - deviance(&off_after));
        let score = free(&after.fit.hypothesis)? - free(&before.hypothesis)? + of_begins;
        found.iter_mut().for_each(|found| found.score = found.score.min(score));
        (score >= POLICY.least_score).then_some((after, found))
    }
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::Catalog;
    use rotorlead_records::Experiment;

    use super::*;
    use crate::testing::{likelihood, records};

    const CURVED: &str = "[[effect]]\nkind = \"quadratic_thrust\"\nparameters = { curvature_per_duty = 4.0 }\n";

    fn found(records: &Experiment) -> Vec<(&'static str, f64)> {
        let (likelihood, base) = likelihood(records);
        let catalog = Catalog::standard();
        let mut search = Search { likelihood, catalog: &catalog, progress: &|| {}, lags: true };
        let explanation = search.explain(&Hypothesis::from_lags(base)).unwrap();
        explanation.found.iter().map(|found| (found.kind.id, found.score)).collect()
    }

    /// Thrust that decays from `off` newtons at the begin of each record.
    fn begun_badly(mut records: Experiment, off: [f64; 6]) -> Experiment {
        for (record, off) in records.records.iter_mut().zip(off) {
            let begin_s = record.time_s[0];
            let decays = record.time_s.iter().map(|time_s| off * (-(time_s - begin_s) / 0.1).exp());
            record.thrust_n.as_mut().unwrap().iter_mut().zip(decays).for_each(|(thrust, decay)| *thrust += decay);
        }
        records
    }

    #[test]
    fn curvature_that_shows_only_in_how_square_waves_begin_is_named_for_no_more_than_that_says() {
        let found = found(&records(CURVED, 0.005, 2));
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].0, "quadratic_thrust");
        // The curve moves the mean by a tenth of a newton, which is some 40 standard deviations of noise: each of four begins is
        // worth ln 40 and a half, the choice of a kind and its value cost some of it, and the multisines say little.
        assert!((7.0..4.0 * (40_f64.ln() + 0.5)).contains(&found[0].1), "{}", found[0].1);
    }

    #[test]
    fn begins_that_are_off_for_reasons_of_their_own_name_nothing() {
        let off = [0.1, -0.08, 0.02, -0.06, 0.12, 0.05];
        assert_eq!(found(&begun_badly(records("", 0.005, 2), off)), []);
    }

    #[test]
    fn a_scatter_of_nothing_is_the_best_for_begins_that_are_off_by_noise() {
        let off = |part: f64| Off { part, variance: 1e-4 };
        let noise = [off(0.01), off(-0.008), off(0.005), off(0.012)];
        assert!(are_as_before(&noise));
        assert!((deviance(&noise) - deviance_at(&noise, 0.0)).abs() < 1e-12);
        // One record by a hundred standard deviations costs the logarithm of that: x^2 / (s^2 + v) is 1, and ln (s^2 / v) 9.2.
        let far = [off(1.0)];
        assert!(!are_as_before(&far));
        assert!((deviance(&far) - (1.0 + 1e4_f64.ln())).abs() < 0.01, "{}", deviance(&far));
    }
}
