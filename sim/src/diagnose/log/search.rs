//! The search for effects where records do not repeat.
//!
//! The steps are those of `explain`; what differs is how a kind is judged. What a model misses of a log is not noise but its own
//! error, whose size is not known beforehand and shrinks as effects are found. So each explanation is judged by the errors that it
//! leaves itself (`errors`): a generalized likelihood ratio, on all steps and on what the splits hold out.
//!
//! Staircases show fewer kinds than periodic records do, each from its best start.

use super::split::Folds;
use crate::diagnose::explain::{ALIKE, Explanation, FIRST_STEPS, Found, LEAST_WORTH, Search, Tried, by_worth};
use crate::diagnose::fit::{Fit, Screening, fit_in, surprise};
use crate::diagnose::hypothesis::{Candidate, GRID, Hypothesis};
use crate::diagnose::scan::Scan;
use crate::diagnose::trial::{Purpose, Trials};
use crate::plant::effect::Kind;
use crate::record::Output;

/// Most effects that are named: a staircase goes through the whole range of a motor, where more shows than around one command.
const MOST_EFFECTS: usize = 5;
/// How many kinds are finished and judged by what is held out, after a few steps of a search of each.
const MOST_FINISHED: usize = 3;
/// Steps of a search that finishes: the misfit is of models and not of noise, so the last digits mean nothing.
const LAST_STEPS: usize = 8;
/// Kinds whose only trace on levels that are reached in steps larger than they are is where these settle. A static map is off
/// there for many reasons, all of which they would explain.
const SHIFT_LEVELS: [&str; 3] = ["dead_band", "backlash", "command_quantization"];
/// A hold of frames that steps, seconds apart, are not tied to is a delay by all that they show.
const HIDDEN: [&str; 1] = ["esc_frame_hold"];
/// Kinds that the force on a stand shows and the speed does not.
const IN_FORCE_ONLY: [&str; 2] = ["inflow_lead", "stand_resonance"];
/// Kinds that it takes two clocks for: command and response of a log are stamped by one.
const OF_TWO_CLOCKS: [&str; 1] = ["clock_skew"];

impl Trials {
    /// Whether any record does not repeat.
    pub fn has_logs(&self) -> bool {
        self.trials.iter().any(|trial| trial.log.is_some())
    }

    /// Whether the records can show a kind.
    fn can_show(&self, kind: &Kind) -> bool {
        let is = |kinds: &[&str]| kinds.contains(&kind.id);
        // One whose response jumps about as its value moves puts the few levels of a staircase anywhere as its value is turned.
        let only_shifts =
            is(&SHIFT_LEVELS) || is(&HIDDEN) || kind.parameters.iter().any(|parameter| parameter.pieces > GRID);
        let any_moves = self.trials.iter().any(|trial| trial.log.as_ref().is_none_or(|log| !log.begins_settled));
        let any_repeats = self.trials.iter().any(|trial| trial.log.is_none());
        (any_moves || !only_shifts)
            && (any_repeats || !is(&OF_TWO_CLOCKS))
            && (self.output == Output::ThrustN || !is(&IN_FORCE_ONLY))
    }

    /// With the errors that a hypothesis leaves.
    pub fn weighed_by(&self, hypothesis: &Hypothesis) -> Option<Self> {
        let mut weighed = self.clone();
        for trial in weighed.trials.iter_mut().filter(|trial| trial.log.is_some()) {
            trial.weigh_by(self, hypothesis)?;
        }
        Some(weighed)
    }
}

/// An explanation with the errors that it leaves.
struct Judged {
    trials: Trials,
    fit: Fit,
    /// Minus twice the log likelihood, but for a constant.
    surprise: f64,
}

impl Judged {
    /// Fits once more with the errors that `fit` leaves.
    fn of(trials: &Trials, fit: &Fit, steps: usize) -> Option<Self> {
        let weighed = trials.weighed_by(&fit.hypothesis)?;
        let fit = fit_in(&weighed, &fit.hypothesis, true, steps)?;
        let trials = weighed.weighed_by(&fit.hypothesis)?;
        let surprise = surprise(&trials, &fit.hypothesis, Purpose::Fit)?;
        Some(Self { trials, fit, surprise })
    }
}

impl Search<'_> {
    /// Finds the effects.
    pub(in crate::diagnose) fn explain_logs(&mut self, base: &Hypothesis) -> Option<Explanation> {
        if self.trials.trials.iter().any(|trial| trial.log.is_none()) {
            self.tell_what_was_before(base);
            self.take_hum_out(base)?;
        }
        let before = self.settle(base, true)?;
        let mut current = before.clone();
        let mut first_tried = Vec::new();
        let mut alternatives: Vec<(&'static Kind, Vec<&'static Kind>)> = Vec::new();
        while alternatives.len() < MOST_EFFECTS {
            let named: Vec<&'static Kind> = alternatives.iter().map(|(kind, _)| *kind).collect();
            let tried = self.tries_on_logs(&current, &named);
            if alternatives.is_empty() {
                first_tried.clone_from(&tried);
            }
            // Something like an effect, but larger than it can be, is none of the catalog; nor is one that may as well not be
            // there.
            let is_one = |tried: &&Tried| {
                let hypothesis = &tried.fit.hypothesis;
                let last = hypothesis.effects.len() - 1;
                hypothesis.effects[last].is_plausible() && tried.fit.excludes_absence(last)
            };
            let tried: Vec<&Tried> = tried.iter().filter(is_one).collect();
            let Some(best) = tried.first().filter(|best| best.worth() >= LEAST_WORTH) else { break };
            let alike = tried.iter().skip(1).filter(|other| best.worth() - other.worth() < ALIKE);
            alternatives.push((best.kind, alike.map(|other| other.kind).collect()));
            current = self.settle(&best.fit.hypothesis.clone(), true)?;
        }
        let (after, found) = self.eliminate(current, &alternatives)?;
        Some(Explanation { before, after, found, tried: first_tried })
    }

    /// Kinds that improve on `from`, best first.
    fn tries_on_logs(&self, from: &Fit, named: &[&'static Kind]) -> Vec<Tried> {
        let Some(screening) = Screening::new(&self.trials, from) else { return Vec::new() };
        let Some(scan) = Scan::new(&self.trials, from) else { return Vec::new() };
        let kinds = self.catalog.kinds().filter(|kind| kind.id != "parameter_error" && !named.contains(kind));
        let mut screened: Vec<(f64, Hypothesis, &'static Kind)> = Vec::new();
        for kind in kinds.filter(|kind| self.trials.can_show(kind)) {
            screened.extend(self.screen(&screening, &scan, from, kind).into_iter().next());
            (self.progress)();
        }
        let Some(before) = self.judged(from) else { return Vec::new() };
        let mut followed: Vec<(Judged, &'static Kind)> = Vec::new();
        for (_, start, kind) in screened {
            let fit = fit_in(&self.trials, &start, true, FIRST_STEPS);
            followed
                .extend(fit.and_then(|fit| Judged::of(&self.trials, &fit, FIRST_STEPS)).map(|judged| (judged, kind)));
            (self.progress)();
        }
        followed.sort_by(|a, b| a.0.surprise.total_cmp(&b.0.surprise));
        let folds = Folds::of(&before.trials, from);
        let finished = followed.into_iter().take(MOST_FINISHED).filter_map(|(judged, kind)| {
            let judged = Judged::of(&judged.trials, &judged.fit, LAST_STEPS)?;
            (self.progress)();
            let tried = tried(&before, &folds, judged, kind);
            Some(tried)
        });
        let mut all: Vec<Tried> = finished.collect();
        all.sort_by(by_worth);
        all
    }

    fn judged(&self, fit: &Fit) -> Option<Judged> {
        let surprise = surprise(&self.trials, &fit.hypothesis, Purpose::Fit)?;
        Some(Judged { trials: self.trials.clone(), fit: fit.clone(), surprise })
    }

    /// Drops one after the other what the others make redundant. Nothing is exchanged, and what would have done as well is taken
    /// from when each was found.
    fn eliminate(
        &mut self,
        mut current: Fit,
        alternatives: &[(&'static Kind, Vec<&'static Kind>)],
    ) -> Option<(Fit, Vec<Found>)> {
        loop {
            let now = self.judged(&current)?;
            let mut found: Vec<Found> = Vec::new();
            for (effect, candidate) in current.hypothesis.effects.iter().enumerate() {
                let rest = fit_in(&self.trials, &current.hypothesis.without(effect), true, LAST_STEPS)?;
                let rest = Judged::of(&self.trials, &rest, FIRST_STEPS)?;
                let folds = Folds::of(&rest.trials, &rest.fit);
                let with = Judged { trials: now.trials.clone(), fit: now.fit.clone(), ..now };
                let worth = tried(&rest, &folds, with, candidate.kind).worth();
                let others = alternatives.iter().find(|(kind, _)| *kind == candidate.kind);
                let is_free = |kind: &&Kind| current.hypothesis.effects.iter().all(|effect| effect.kind != *kind);
                let alternatives = others
                    .map_or_else(Vec::new, |(_, others)| others.iter().filter(|kind| is_free(kind)).copied().collect());
                found.push(Found { kind: candidate.kind, worth, alternatives });
                (self.progress)();
            }
            let least = (0..found.len()).min_by(|a, b| found[*a].worth.total_cmp(&found[*b].worth));
            match least {
                Some(least) if found[least].worth < LEAST_WORTH => {
                    current = self.settle(&current.hypothesis.without(least), true)?;
                }
                _ => return Some((current, found)),
            }
        }
    }
}

/// What the last effect of a judged explanation is worth.
fn tried(before: &Judged, folds: &Folds, with: Judged, kind: &'static Kind) -> Tried {
    let fitted_gain = 0.5 * (before.surprise - with.surprise);
    let held_out_gain = folds.gain(&with.trials, &with.fit.hypothesis).unwrap_or(0.0);
    Tried { kind, fit: with.fit, fitted_gain, held_out_gain, parameters: Candidate::searched(kind).count() }
}
