//! The search for effects where records do not repeat.
//!
//! The steps are those of `explain`; what differs is how a kind is evaluated. What a model misses of a log is not noise but its own
//! error, whose size is not known beforehand and shrinks as effects are found. So each explanation is evaluated by the errors that it
//! leaves itself (`errors`): a generalized likelihood ratio, on all steps and on what the splits hold out.
//!
//! Staircases show fewer kinds than periodic records do, each from its best start.

use rotorlead_plant::effect::{Kind, Parameter, Shows, Site};
use rotorlead_records::Output;

use super::folds::Folds;
use crate::assess::gap::gaps;
use crate::assess::lateness::LOGGER_ROWS;
use crate::data::dataset::{Dataset, Record, Split};
use crate::estimate::fit::{Fit, fit_in};
use crate::likelihood::Likelihood;
use crate::model::candidate::Candidate;
use crate::model::hypothesis::Hypothesis;
use crate::propose::scan::Scan;
use crate::select::decision::Decision;
use crate::select::explain::{Explanation, Found, Search};
use crate::select::policy::{
    ALIKE, FIRST_STEPS, LAST_STEPS, LEAST_SCORE_IN_LOGS, MOST_EFFECTS, MOST_FINISHED, parsimony_rank,
};
use crate::select::screen::Look;
use crate::select::tried::{Tried, by_score, complexity_penalty};

impl Dataset {
    /// Whether the records can show a kind.
    fn can_show(&self, kind: &Kind) -> bool {
        match kind.shows {
            // A static map that is free has no curvature left to find.
            Shows::Anywhere if kind.site == Site::Map => !self.records.iter().all(Record::has_free_map),
            Shows::Anywhere | Shows::OverLevels => true,
            Shows::BetweenLevels => self.records.iter().any(|record| !record.goes_from_level_to_level()),
            Shows::BetweenClocks => self.has_periodic(),
            Shows::InForce => self.output == Output::ThrustN,
        }
    }

    /// Which value of an effect lies beyond its plausible range. A delay in a log is that of the logger as well, which stamps up to
    /// some rows late.
    fn implausible(&self, hypothesis: &Hypothesis) -> Option<String> {
        let candidate = hypothesis.effects.last()?;
        let mut own = candidate.clone();
        if candidate.kind.site == Site::Line {
            let row_s = self.records.iter().map(|record| record.rate_hz.recip()).fold(0.0, f64::max);
            own.values[0] = (own.values[0] - LOGGER_ROWS * row_s).max(own.kind.parameters[0].plausible.0);
        }
        // Two lags in a row are the same in either order: the longer one is the rotor's.
        let lag_s = hypothesis.base.iter().map(|point| point.time_constant_s).fold(f64::INFINITY, f64::min);
        let is_second = |parameter: &Parameter| parameter.unit == "s" && parameter.null == 0.0;
        let longer = |(index, parameter): (usize, &'static Parameter)| {
            let value = own.values[index];
            (own.kind.site > Site::Rotor && is_second(parameter) && value > lag_s).then(|| {
                format!(
                    "plausible range: {} {value:.4} s, expected less than the rotor's lag of {lag_s:.4} s",
                    parameter.name
                )
            })
        };
        own.beyond_range(|_| 0.0).or_else(|| Candidate::searched(candidate.kind).find_map(longer))
    }
}

/// A kind that was dropped again, and the test that it fails beside the others.
type Dropped = (&'static Kind, String);

/// A kind that was added, with those that would have done as well.
struct Named {
    kind: &'static Kind,
    alternatives: Vec<&'static Kind>,
}

/// An explanation with the errors that it leaves.
struct Evaluated {
    likelihood: Likelihood,
    fit: Fit,
    /// Minus twice the log likelihood, but for a constant.
    deviance: f64,
}

impl Evaluated {
    /// Fits once more with the errors that `fit` leaves.
    fn of(likelihood: &Likelihood, fit: &Fit, steps: usize) -> Option<Self> {
        let weighed = likelihood.with_errors_of(&fit.hypothesis)?;
        let fit = fit_in(&weighed, &fit.hypothesis, true, steps)?;
        let likelihood = weighed.with_errors_of(&fit.hypothesis)?;
        let deviance = likelihood.deviance(&fit.hypothesis, Split::Train)?;
        Some(Self { likelihood, fit, deviance })
    }
}

impl Search<'_> {
    /// Finds the effects.
    pub(crate) fn explain_logs(&mut self, base: &Hypothesis) -> Option<Explanation> {
        let before = self.settle(&base.clone().of_what_shows(&self.likelihood.data), true)?;
        let mut current = before.clone();
        let mut first_tried = None;
        let mut named: Vec<Named> = Vec::new();
        let mut dropped: Vec<&'static Kind> = Vec::new();
        let mut decisions: Vec<Decision> = Vec::new();
        loop {
            current = self.extend(current, &mut named, &dropped, (&mut first_tried, &mut decisions))?;
            let (after, found, redundant) = self.eliminate(current, &named)?;
            if redundant.is_empty() {
                let tried = first_tried.unwrap_or_default();
                return Some(Explanation { before, after, found, tried, weak_evidence: Vec::new(), decisions });
            }
            for (kind, why) in &redundant {
                for decision in decisions.iter_mut().filter(|decision| decision.kind.id == kind.id) {
                    (decision.is_added, decision.failed) = (false, vec![why.clone()]);
                }
            }
            let redundant: Vec<&'static Kind> = redundant.into_iter().map(|(kind, _)| kind).collect();
            // What stood in the place of others is gone, and does not come back: the search ends.
            named.retain(|named| !redundant.contains(&named.kind));
            dropped.extend(redundant);
            current = after;
        }
    }

    /// Adds effects to `current` one at a time as long as any is worth it.
    fn extend(
        &mut self,
        mut current: Fit,
        named: &mut Vec<Named>,
        dropped: &[&'static Kind],
        (first_tried, decisions): (&mut Option<Vec<Tried>>, &mut Vec<Decision>),
    ) -> Option<Fit> {
        while named.len() < MOST_EFFECTS {
            let exclude: Vec<&'static Kind> =
                named.iter().map(|named| named.kind).chain(dropped.iter().copied()).collect();
            let beside: Vec<&'static Kind> = named.iter().map(|named| named.kind).collect();
            let (tried, others) = self.tries_on_logs(&current, &exclude);
            first_tried.get_or_insert_with(|| tried.clone());
            let judged: Vec<(&Tried, Vec<String>)> = tried.iter().map(|tried| (tried, self.failed(tried))).collect();
            // The first of those that are equally simple scores highest.
            let passed = judged.iter().filter(|(_, failed)| failed.is_empty()).map(|(tried, _)| *tried);
            let best = passed.clone().min_by_key(|tried| parsimony_rank(tried.kind));
            // What is tried beside more is known better.
            let is_again = |kind: &Kind| {
                tried.iter().any(|tried| tried.kind.id == kind.id)
                    || others.iter().any(|(other, _)| other.id == kind.id)
            };
            decisions.retain(|decision| decision.is_added || !is_again(decision.kind));
            for (tried, failed) in &judged {
                let is_best = best.is_some_and(|best| best.kind == tried.kind);
                let mut decision = Decision::of(tried, &beside, failed.clone());
                decision.is_added = is_best;
                decisions.push(decision);
            }
            let is_first = |kind: &Kind| decisions.iter().all(|decision| decision.kind.id != kind.id);
            let further: Vec<Decision> = others
                .iter()
                .filter(|(kind, _)| is_first(kind))
                .map(|(kind, fitted_gain)| Decision {
                    kind,
                    beside: beside.clone(),
                    fitted_gain: *fitted_gain,
                    held_out_gain: None,
                    score: None,
                    failed: vec![format!("training gain: behind the {MOST_FINISHED} that gain most")],
                    is_added: false,
                })
                .collect();
            decisions.extend(further);
            let Some(best) = best else { break };
            let is_alike = |other: &&Tried| other.kind != best.kind && (best.score() - other.score()).abs() < ALIKE;
            let alternatives = passed.filter(is_alike).map(|other| other.kind).collect();
            named.push(Named { kind: best.kind, alternatives });
            current = self.settle(&best.fit.hypothesis.clone(), true)?;
        }
        Some(current)
    }

    /// The tests that a kind fails which was tried to the end. Something like an effect, but larger than it can be, is none of the
    /// catalog; nor is one that may as well not be there.
    fn failed(&self, tried: &Tried) -> Vec<String> {
        let hypothesis = &tried.fit.hypothesis;
        let last = hypothesis.effects.len() - 1;
        let mut failed = Vec::new();
        if tried.score() < LEAST_SCORE_IN_LOGS {
            failed.push(format!("score: below {LEAST_SCORE_IN_LOGS}"));
        }
        if tried.held_out_gain < 0.0 {
            failed.push("held-out gain: below 0".to_owned());
        }
        failed.extend(self.likelihood.data.implausible(hypothesis));
        if !tried.fit.excludes_absence(last) {
            failed.push("95 % interval: includes no effect".to_owned());
        }
        failed
    }

    /// Kinds that were tried beside `from` to the end, best first, and what the others gained on what is fitted.
    fn tries_on_logs(&self, from: &Fit, exclude: &[&'static Kind]) -> (Vec<Tried>, Vec<(&'static Kind, f64)>) {
        let nothing = || (Vec::new(), Vec::new());
        let Some(look) = Look::new(&self.likelihood, from) else { return nothing() };
        let Some(scan) = Scan::new(&self.likelihood, from) else { return nothing() };
        let kinds = self.catalog.kinds().filter(|kind| kind.site != Site::Base && !exclude.contains(kind));
        let mut screened: Vec<(f64, Hypothesis, &'static Kind)> = Vec::new();
        for kind in kinds.filter(|kind| self.likelihood.data.can_show(kind)) {
            screened.extend(self.screen(&look, &scan, from, kind));
            (self.progress)();
        }
        let Some(before) = self.evaluated(from) else { return nothing() };
        let mut followed: Vec<(Evaluated, &'static Kind)> = Vec::new();
        for (_, start, kind) in screened {
            let fit = fit_in(&self.likelihood, &start, true, FIRST_STEPS);
            followed.extend(
                fit.and_then(|fit| Evaluated::of(&self.likelihood, &fit, FIRST_STEPS))
                    .map(|evaluated| (evaluated, kind)),
            );
            (self.progress)();
        }
        followed.sort_by(|a, b| a.0.deviance.total_cmp(&b.0.deviance));
        let folds = Folds::of(&before.likelihood, from);
        let mut others = Vec::new();
        let mut all: Vec<Tried> = Vec::new();
        for (place, (evaluated, kind)) in followed.into_iter().enumerate() {
            if place >= MOST_FINISHED && parsimony_rank(kind) >= 2 {
                others.push((kind, 0.5 * (before.deviance - evaluated.deviance)));
                continue;
            }
            let evaluated = Evaluated::of(&evaluated.likelihood, &evaluated.fit, LAST_STEPS);
            (self.progress)();
            all.extend(evaluated.map(|evaluated| tried(&before, &folds, evaluated, kind)));
        }
        all.sort_by(by_score);
        (all, others)
    }

    fn evaluated(&self, fit: &Fit) -> Option<Evaluated> {
        let deviance = self.likelihood.deviance(&fit.hypothesis, Split::Train)?;
        Some(Evaluated { likelihood: self.likelihood.clone(), fit: fit.clone(), deviance })
    }

    /// Drops one after the other what the others make redundant, or what may as well not be there beside them, and what makes the
    /// held-out gap wider: each with why. Nothing is exchanged, and what would have done as well is taken from when each was found.
    fn eliminate(&mut self, mut current: Fit, named: &[Named]) -> Option<(Fit, Vec<Found>, Vec<Dropped>)> {
        let mut redundant = Vec::new();
        loop {
            let now = self.evaluated(&current)?;
            let (mut found, mut fails) = (Vec::new(), Vec::new());
            for (effect, candidate) in current.hypothesis.effects.iter().enumerate() {
                let rest = fit_in(&self.likelihood, &current.hypothesis.without(effect), true, LAST_STEPS)?;
                let gap = gaps(&self.likelihood, &rest.hypothesis, &current.hypothesis, true).total;
                let rest = Evaluated::of(&self.likelihood, &rest, FIRST_STEPS)?;
                let folds = Folds::of(&rest.likelihood, &rest.fit);
                let with = Evaluated { likelihood: now.likelihood.clone(), fit: now.fit.clone(), ..now };
                let tried = tried(&rest, &folds, with, candidate.kind);
                let named = named.iter().find(|named| named.kind == candidate.kind);
                let is_free = |kind: &&Kind| current.hypothesis.effects.iter().all(|effect| effect.kind != *kind);
                let alternatives = named.map_or_else(Vec::new, |named| {
                    named.alternatives.iter().filter(|kind| is_free(kind)).copied().collect()
                });
                found.push(Found { kind: candidate.kind, score: tried.score(), alternatives });
                fails.push(if !is_worth_it(&tried) {
                    Some("score: too little beside the others".to_owned())
                } else if !current.excludes_absence(effect) {
                    Some("95 % interval: includes no effect beside the others".to_owned())
                } else {
                    let wider = format!(
                        "held-out gap: {:.2} % without it, {:.2} % with it",
                        100.0 * gap.before,
                        100.0 * gap.after
                    );
                    (gap.after > gap.before).then_some(wider)
                });
                (self.progress)();
            }
            let failing = fails.into_iter().enumerate().filter_map(|(effect, why)| Some((effect, why?)));
            let Some((least, why)) = failing.min_by(|a, b| found[a.0].score.total_cmp(&found[b.0].score)) else {
                return Some((current, found, redundant));
            };
            redundant.push((found[least].kind, why));
            current = self.settle(&current.hypothesis.without(least), true)?;
        }
    }
}

/// Whether an effect is worth a name, and what was held out bears it out.
fn is_worth_it(tried: &Tried) -> bool {
    tried.score() >= LEAST_SCORE_IN_LOGS && tried.held_out_gain >= 0.0
}

/// What the last effect of a evaluated explanation is worth.
fn tried(before: &Evaluated, folds: &Folds, with: Evaluated, kind: &'static Kind) -> Tried {
    let fitted_gain = 0.5 * (before.deviance - with.deviance);
    let held_out_gain = folds.gain(&with.likelihood, &with.fit.hypothesis).unwrap_or(0.0);
    Tried { kind, fit: with.fit, fitted_gain, held_out_gain, complexity_penalty: complexity_penalty(kind) }
}
