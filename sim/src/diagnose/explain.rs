//! Explain: which effects of the catalog the misfit asks for.
//!
//! Every kind is tried at its starts, with the lags moved along to first order; the promising ones are fitted jointly with
//! the lags on the fitted stretches. What a kind is worth is its gain of log likelihood there, less what the search would gain
//! by chance ([`price`]), plus its gain on the held-out stretches, where parameters cannot help themselves. Effects are added one
//! at a time; each is then tried again in the presence of the others, exchanged where another kind serves better there, and
//! dropped where the others make it redundant.

use std::cmp::Ordering;

use super::candidate::{Candidate, GRID};
use super::fit::{Fit, fit, fit_behind, fit_in};
use super::hypothesis::Hypothesis;
use super::locate::excess;
use super::profile::{MOVES, settle_jumps};
use super::residual::misfit;
use super::scan::Scan;
use super::screening::Screening;
use super::steadiness::steadiness;
use super::suspicion::{self, Suspect};
use super::trial::{Before, Purpose, Trial, Trials};
use super::{clips, collapsed, frames, grid, resonance, waits, witness};
use crate::identify::offset_and_start;
use crate::plant::Catalog;
use crate::plant::effect::{Kind, Parameter, Shows};

/// Most effects that are named.
const MOST_EFFECTS: usize = 3;
/// So many effects that leave more than this part of the misfit are no explanation, and none is looked for.
const ENOUGH_EFFECTS: usize = 2;
const HOPELESS: f64 = 0.15;
/// An effect is named for at least this worth: with 17 kinds to choose from, and two values each, noise alone gives as much
/// once in thousands of experiments.
pub(super) const LEAST_WORTH: f64 = 10.0;
/// Of that, what is fitted has to bring this much by itself. What is held out can gain by accident: where a nominal command was
/// fitted to little, anything that moves its lag may move it nearer.
const LEAST_PAID: f64 = 0.5 * LEAST_WORTH;
/// Kinds within this of the best are told apart by chance only.
pub(super) const ALIKE: f64 = 5.0;
/// How many kinds are fitted after the screening, and from which share of the best gain on.
const MOST_FITTED: usize = 7;
const PROMISING: f64 = 0.2;
/// Share of the least worth that the screening has to promise.
const PROMISED: f64 = 0.7;
/// Starts that are followed of one kind.
const MOST_STARTS: usize = 2;
/// Steps after which the kinds are compared; after these so many go on, and all that are close.
pub(super) const FIRST_STEPS: usize = 3;
/// Steps between two estimates of the noise.
const SETTLING_STEPS: usize = 10;
/// A decay at the begin of a record that is more than this part of the response's swing, and this many times the one that the
/// record would have otherwise, says that it was taken in another way than the rest.
const DECAYS: f64 = 0.2;
const OTHER_DECAY: f64 = 3.0;
/// Changes that stand alone and say this of frames, in log likelihood, say that there are none.
const ALL_ALIKE: f64 = -3.0;
/// What was worth less than this part of the best is not tried again.
const AGAIN: f64 = 0.2;
/// How often the screening halves the distance to the neighbors of the best start.
const CLOSER_LOOKS: usize = 3;
const MOST_FINISHED: usize = 3;
/// How often the screening looks around in a narrow valley, in how many steps to either side, and how much nearer each time.
const VALLEY_LOOKS: i32 = 5;
const VALLEY_STEPS: u32 = 4;
const VALLEY_NARROWING: f64 = 0.25;

/// What a start of a kind would leave of the misfit, and the hypothesis that it leads to.
pub(super) type Screened = (f64, Hypothesis, &'static Kind);

/// A kind with what it would be worth.
#[derive(Clone, Debug)]
pub(super) struct Tried {
    /// The kind.
    pub kind: &'static Kind,
    /// The fit with it; its effect is the last one.
    pub fit: Fit,
    /// Gain of log likelihood over what is fitted.
    pub fitted_gain: f64,
    /// Gain of log likelihood over what is held out.
    pub held_out_gain: f64,
    /// What the search itself would gain by chance: see [`price`].
    pub price: f64,
    /// What the columns beside the response say for it, over the best of those between which they were asked; 0 or less.
    pub witnessed: f64,
}

impl Tried {
    /// Whether no value lies farther from where the effect vanishes than any actuator of its kind is plausible to have it.
    pub fn is_plausible(&self) -> bool {
        self.fit.is_plausible()
    }

    /// Whether it is worth enough.
    pub fn is_worth_a_name(&self) -> bool {
        self.worth() >= LEAST_WORTH && self.is_paid()
    }

    /// Something like an effect, but larger than it can be, is none of the catalog.
    fn may_be_named(&self) -> bool {
        self.is_worth_a_name() && self.is_plausible()
    }

    /// Whether it gains enough on what is fitted, whatever it does for what is held out.
    pub fn is_paid(&self) -> bool {
        self.fitted_gain - self.price >= LEAST_PAID
    }

    /// What it is worth, in units of log likelihood.
    pub fn worth(&self) -> f64 {
        self.fitted_gain - self.price + self.held_out_gain + self.witnessed
    }
}

/// The decay at the begin of a record that `hypothesis` leaves, and what it leaves beside that and an offset.
pub(super) fn aligned(all: &Trials, trial: &Trial, hypothesis: &Hypothesis) -> Option<(f64, Vec<f64>)> {
    let rows = trial.end_of(None);
    let simulated = hypothesis.simulate(all, trial, rows).ok()?;
    let (time_s, measured) = (&trial.time_s[..rows], &trial.measured[..rows]);
    let tau_s = hypothesis.base[trial.point].time_constant_s;
    let (offset, start) = offset_and_start(time_s, measured, &simulated, tau_s);
    let decay = |time: &f64| (-(time - time_s[0]) / tau_s).exp();
    let moved = simulated.iter().zip(time_s).map(|(model, time)| model + offset + start * decay(time));
    Some((start, measured.iter().zip(moved).map(|(y, model)| y - model).collect()))
}

/// What a search for a kind would gain on average where there is nothing: one for each number that it moves (Akaike 1974). Where
/// the response jumps about as the value moves, or a peak is narrow, each of many places is a trial of its own, and the best of `n`
/// trials has `ln n` more (the tail of the log likelihood's gain by chance is exponential).
pub(super) fn price(kind: &'static Kind) -> f64 {
    let of_value = |parameter: &Parameter| {
        let places = if grid::is_grid(kind) { grid::lines(parameter).len() as u32 } else { parameter.pieces };
        1.0 + if parameter.pieces > GRID { f64::from(places).ln() } else { 0.0 }
    };
    let of_values: f64 = Candidate::searched(kind).map(|(_, parameter)| of_value(parameter)).sum();
    of_values + if resonance::is_mode(kind) { (resonance::frequencies(kind) as f64).ln() } else { 0.0 }
}

/// The most valuable first, of those that may be named.
pub(super) fn by_worth(a: &Tried, b: &Tried) -> Ordering {
    b.is_paid().cmp(&a.is_paid()).then(b.worth().total_cmp(&a.worth()))
}

/// An effect that was found.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// The kind.
    pub kind: &'static Kind,
    /// What it is worth beside the others that were found.
    pub worth: f64,
    /// Others that would do as well in its place.
    pub alternatives: Vec<&'static Kind>,
}

/// What was found, with the fit of all of it.
#[derive(Clone, Debug)]
pub(super) struct Explanation {
    /// The lags alone.
    pub before: Fit,
    /// With the effects, in the order of `found`.
    pub after: Fit,
    /// The effects, the most valuable first.
    pub found: Vec<Found>,
    /// What was tried beside the lags alone, best first.
    pub tried: Vec<Tried>,
    /// What the records lean to beside the lags alone.
    pub suspected: Vec<Suspect>,
}

impl Explanation {
    /// That nothing explains what `before` leaves.
    fn of_nothing(before: Fit, tried: Vec<Tried>, suspected: Vec<Suspect>) -> Self {
        Self { after: before.clone(), before, found: Vec::new(), tried, suspected }
    }
}

/// Everything that may be tried, and on what.
pub(super) struct Search<'a> {
    /// The records.
    pub trials: Trials,
    /// The kinds.
    pub catalog: &'a Catalog,
    /// Told whenever a step is done.
    pub progress: &'a dyn Fn(),
    /// Whether the lags are fitted along.
    pub lags: bool,
}

impl Search<'_> {
    /// Takes the noise from what `fit` leaves and fits it again with that. Twice, since weights and fit depend on each other.
    pub fn settle(&mut self, start: &Hypothesis, lags: bool) -> Option<Fit> {
        let mut hypothesis = start.clone();
        for _ in 0..2 {
            self.weigh(&hypothesis);
            hypothesis = fit_in(&self.trials, &hypothesis, lags, SETTLING_STEPS)?.hypothesis;
        }
        self.weigh(&hypothesis);
        fit(&self.trials, &hypothesis, lags)
    }

    fn weigh(&mut self, hypothesis: &Hypothesis) {
        let all = self.trials.clone();
        for trial in &mut self.trials.trials {
            if trial.log.is_none()
                && let Some((_, left)) = aligned(&all, trial, hypothesis)
            {
                trial.weigh(&left);
            }
            // Impossible hypotheses never get here.
            let _ = trial.weigh_by(&all, hypothesis);
        }
    }

    /// Takes mains hum out of all records.
    pub fn take_hum_out(&mut self, base: &Hypothesis) -> Option<()> {
        let lags = fit(&self.trials, base, self.lags)?.hypothesis;
        let all = self.trials.clone();
        for trial in self.trials.trials.iter_mut().filter(|trial| trial.log.is_none()) {
            if let Some((_, left)) = aligned(&all, trial, &lags) {
                trial.take_hum_out(&left);
            }
        }
        Some(())
    }

    /// Finds out what was before the records: that which leaves less of a decay at their begins. Noise leaves some too, and records
    /// of one experiment are taken in one way: only a decay that is large beside the response makes one an exception.
    pub fn tell_what_was_before(&mut self, hypothesis: &Hypothesis) {
        const EITHER: [Before; 2] = [Before::Rest, Before::Periods];
        let all = self.trials.clone();
        let decays_of = |trial: &mut Trial| {
            let swing = hypothesis.base[trial.point].gain.abs() * trial.amplitude;
            EITHER.map(|before| {
                trial.before = before;
                aligned(&all, trial, hypothesis).map_or(f64::INFINITY, |(decay, _)| decay.abs() / swing)
            })
        };
        let periodic = || 0..all.trials.len();
        let decays: Vec<Option<[f64; 2]>> = periodic()
            .map(|place| {
                let trial = &mut self.trials.trials[place];
                trial.log.is_none().then(|| decays_of(trial))
            })
            .collect();
        let squares = |way: usize| decays.iter().flatten().map(|decays| decays[way] * decays[way]).sum::<f64>();
        let usual = usize::from(squares(1) < squares(0));
        for (trial, decays) in self.trials.trials.iter_mut().zip(&decays) {
            let Some(decays) = decays else { continue };
            let (own, other) = (decays[usual], decays[1 - usual]);
            let is_other = own > DECAYS && own > OTHER_DECAY * other;
            trial.before = EITHER[if is_other { 1 - usual } else { usual }];
        }
    }

    /// Starts of all kinds but those to `exclude`, with what they would leave beside `from` as far as the tangent holds, best first.
    fn screened(&self, from: &Fit, exclude: &[&'static Kind]) -> Vec<Screened> {
        let lifted = self.lags.then(|| collapsed::lifted(&self.trials, from)).flatten();
        let mut screened = Vec::new();
        for near in std::iter::once(from).chain(&lifted) {
            let Some(screening) = Screening::new(&self.trials, near) else { continue };
            let Some(scan) = Scan::new(&self.trials, near) else { continue };
            let kinds = self.catalog.kinds().filter(|kind| kind.id != "parameter_error" && !exclude.contains(kind));
            for kind in kinds.filter(|kind| kind.shows != Shows::OverLevels) {
                screened.extend(self.screen(&screening, &scan, near, kind));
                (self.progress)();
            }
        }
        screened.sort_by(|a: &Screened, b| a.0.total_cmp(&b.0));
        screened
    }

    /// Kinds that improve on `from`, best first.
    fn tries(&self, from: &Fit, exclude: &[&'static Kind]) -> Vec<Tried> {
        self.tries_of(from, self.screened(from, exclude))
    }

    /// Kinds that improve on `from` of those that were screened, best first.
    fn tries_of(&self, from: &Fit, screened: Vec<Screened>) -> Vec<Tried> {
        let best = screened.first().map_or(0.0, |best| from.misfit - best.0);
        let mut kinds: Vec<(&'static Kind, usize)> = Vec::new();
        let mut tried: Vec<Tried> = Vec::new();
        for (left, start, kind) in screened {
            let place = kinds.iter().position(|(other, _)| *other == kind);
            let gain = from.misfit - left;
            // What promises much less than has to be there is not worth a search; a gain of log likelihood is half of this.
            if gain < 2.0 * PROMISED * LEAST_WORTH || (gain < PROMISING * best && place.is_none() && kinds.len() >= 3) {
                continue;
            }
            let place = match place {
                Some(place) => place,
                None if kinds.len() < MOST_FITTED => {
                    kinds.push((kind, 0));
                    kinds.len() - 1
                }
                None => continue,
            };
            let followed = &mut kinds[place].1;
            if *followed >= MOST_STARTS {
                continue;
            }
            *followed += 1;
            let Some(fit) = fit_in(&self.trials, &start, self.lags, FIRST_STEPS) else { continue };
            let found = self.tried(from, fit, kind, price(kind));
            match tried.iter_mut().find(|other| other.kind == kind) {
                Some(other) if found.fitted_gain > other.fitted_gain => *other = found,
                Some(_) => {}
                None => tried.push(found),
            }
            (self.progress)();
        }
        tried.sort_by(by_worth);
        let best = tried.first().map_or(0.0, Tried::worth);
        for (place, tried) in tried.iter_mut().enumerate() {
            if place < MOST_FINISHED || best - tried.worth() < MOST_FINISHED as f64 * ALIKE {
                let start = tried.fit.hypothesis.clone();
                if let Some(finished) = self.attempt(from, &start, tried.kind, best - tried.worth()) {
                    *tried = finished;
                }
                (self.progress)();
            }
        }
        self.hear(&mut tried);
        // A hold whose frames do not show is, by all that is known, a delay.
        let hidden = |tried: &Tried| tried.fit.hypothesis.effects.last().is_some_and(Candidate::is_hidden_hold);
        if let Some(delay) = tried.iter().position(|tried| tried.kind.id == "transport_delay")
            && tried.first().is_some_and(hidden)
            && tried[0].worth() - tried[delay].worth() < ALIKE
        {
            tried[..=delay].rotate_right(1);
        }
        tried
    }

    /// Lets the columns beside the response speak where kinds, the best first, are within chance of the best.
    fn hear(&self, tried: &mut [Tried]) {
        tried.iter_mut().for_each(|tried| tried.witnessed = 0.0);
        tried.sort_by(by_worth);
        let alike = tried.iter().take_while(|other| tried[0].worth() - other.worth() < ALIKE).count();
        let hypotheses: Vec<&Hypothesis> = tried[..alike].iter().map(|tried| &tried.fit.hypothesis).collect();
        let Some(gains) = (alike > 1).then(|| witness::heard(&self.trials, &hypotheses)).flatten() else { return };
        tried[..alike].iter_mut().zip(gains).for_each(|(tried, gain)| tried.witnessed = gain);
        tried.sort_by(by_worth);
    }

    /// Starts of a kind with what they would leave. Around the best of a single value it looks closer: a limit is felt only
    /// where the commands are.
    pub fn screen(&self, screening: &Screening, scan: &Scan, from: &Fit, kind: &'static Kind) -> Vec<Screened> {
        // Where the alignment has taken over much of a delay, a start that brings its own is judged without it too: so far the
        // tangent does not hold.
        let is_late = from.is_late(&self.trials);
        let judge = |start: &Candidate| {
            let with = screening.judge(&self.trials, start, false);
            let without = is_late.then(|| screening.judge(&self.trials, start, true)).flatten();
            [with, without].into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0))
        };
        let mut judged: Vec<(f64, Candidate, Hypothesis)> = Vec::new();
        let look = |judged: &mut Vec<(f64, Candidate, Hypothesis)>, starts: Vec<Candidate>| {
            let looked = starts.into_iter().filter_map(|start| judge(&start).map(|(left, moved)| (left, start, moved)));
            judged.extend(looked);
            judged.sort_by(|a, b| a.0.total_cmp(&b.0));
        };
        let valleys =
            if grid::is_grid(kind) { grid::steps(&self.trials, from, kind) } else { scan.valleys(kind, GRID) };
        let is_jumping = !valleys.is_empty();
        let modes = if resonance::is_mode(kind) { resonance::modes(&self.trials, from, kind) } else { Vec::new() };
        let starts = [valleys, modes].into_iter().find(|starts| !starts.is_empty());
        look(&mut judged, starts.unwrap_or_else(|| Candidate::starts(kind, self.trials.has_logs())));
        look(&mut judged, clips::starts(&self.trials, kind));
        if is_jumping {
            // Down into the lowest.
            for round in 0..VALLEY_LOOKS {
                let Some(best) = judged.first().map(|best| best.1.clone()) else { break };
                look(&mut judged, best.around(VALLEY_NARROWING.powi(round), VALLEY_STEPS));
            }
        } else if Candidate::searched(kind).count() == 1 {
            for _ in 0..CLOSER_LOOKS {
                let between = Candidate::around_best(&judged);
                look(&mut judged, between);
            }
            let vertex = Candidate::vertex(&judged);
            look(&mut judged, vertex.into_iter().collect());
        }
        judged.into_iter().map(|(left, _, moved)| (left, moved, kind)).collect()
    }

    /// A kind searched to the end, which is `behind` the best of all in worth so far.
    fn attempt(&self, from: &Fit, start: &Hypothesis, kind: &'static Kind, behind: f64) -> Option<Tried> {
        let fit = self.whole(fit_behind(&self.trials, start, self.lags, behind)?);
        let mean = self.tried(from, fit, kind, price(kind));
        // Where the frames lie is looked for once their rate is about known.
        let anywhere = |effect: &Candidate| effect.kind == kind && effect.has_frames() && effect.phases.is_empty();
        let effect = mean.fit.hypothesis.effects.iter().position(anywhere);
        // Where single changes wait alike there are no frames to be found.
        let waits = |_: &usize| waits::evidence(&self.trials, &mean.fit.hypothesis, Purpose::Fit) > ALL_ALIKE;
        let framed = effect.filter(waits).and_then(|effect| {
            let framed = frames::find(&self.trials, &mean.fit, effect, behind)?;
            let framed = self::fit(&self.trials, &framed, self.lags)?;
            let fit = self::fit(&self.trials, &frames::polish(&self.trials, &framed, effect)?, self.lags)?;
            // A phase for each record, beside the rate.
            Some(self.tried(from, fit, kind, price(kind) + self.trials.trials.len() as f64))
        });
        let is_missed = effect.is_some_and(|effect| {
            frames::are_missed(&self.trials, &mean.fit, effect, framed.as_ref().map(|framed| framed.fit.misfit))
        });
        let best = framed.filter(|framed| framed.worth() > mean.worth()).unwrap_or(mean);
        // What is not there cannot be had at any price.
        Some(if is_missed { Tried { price: f64::INFINITY, ..best } } else { best })
    }

    /// `found` with the steps of a grid such that they make a whole range, where that fits as well: what is fitted may not say on
    /// which side of a step a command lies that is held out.
    fn whole(&self, found: Fit) -> Fit {
        let last = found.hypothesis.effects.last().and_then(grid::whole);
        let whole = last.and_then(|last| {
            let mut whole = found.hypothesis.clone();
            *whole.effects.last_mut()? = last;
            fit(&self.trials, &whole, self.lags)
        });
        whole.filter(|whole| whole.misfit < found.misfit + MOVES).unwrap_or(found)
    }

    fn tried(&self, from: &Fit, fit: Fit, kind: &'static Kind, price: f64) -> Tried {
        let waits = |purpose| {
            let of = |hypothesis| waits::evidence(&self.trials, hypothesis, purpose);
            of(&fit.hypothesis) - of(&from.hypothesis)
        };
        let fitted_gain = 0.5 * (from.misfit - fit.misfit) + waits(Purpose::Fit);
        let held_out_gain = self.held_out_gain(&from.hypothesis, &fit.hypothesis) + waits(Purpose::HeldOut);
        Tried { kind, fit, fitted_gain, held_out_gain, price, witnessed: 0.0 }
    }

    /// By how much the log likelihood of what is held out grows.
    fn held_out_gain(&self, from: &Hypothesis, to: &Hypothesis) -> f64 {
        let left = |hypothesis| misfit(&self.trials, hypothesis, Purpose::HeldOut);
        match (left(from), left(to)) {
            (Some(from), Some(to)) => 0.5 * (from - to),
            _ => f64::NEG_INFINITY,
        }
    }

    /// The part of the misfit of `before` that `fit` leaves; 0 where it leaves no more than noise.
    fn leaves(&self, fit: &Fit, before: &Fit) -> f64 {
        let left = |fit: &Fit| excess(&self.trials, &fit.hypothesis, Purpose::Fit);
        if left(fit).is_noise() { 0.0 } else { left(fit).over() / left(before).over() }
    }

    /// Finds the effects.
    pub fn explain(&mut self, base: &Hypothesis) -> Option<Explanation> {
        if self.trials.trials.iter().any(|trial| trial.log.is_some()) {
            return self.explain_logs(base);
        }
        self.tell_what_was_before(base);
        self.take_hum_out(base)?;
        let before = self.settle(base, self.lags)?;
        let mut current = before.clone();
        let mut effects: Vec<Tried> = Vec::new();
        let (mut first_tried, mut last_tried, mut suspected) = (Vec::new(), Vec::new(), Vec::new());
        let mut has_to_explain_all = false;
        while effects.len() < MOST_EFFECTS {
            let named: Vec<&'static Kind> = effects.iter().map(|effect| effect.kind).collect();
            let screened = self.screened(&current, &named);
            let promised = effects.is_empty().then(|| suspicion::promised(&current, &screened));
            let tried = self.tries_of(&current, screened);
            if let Some(promised) = promised {
                suspected = suspicion::suspected(promised, &tried);
                first_tried.clone_from(&tried);
            }
            // Before the noise is taken from what it leaves, which may be long.
            let best = tried.iter().find(|tried| tried.is_worth_a_name());
            if effects.len() + 1 == ENOUGH_EFFECTS
                && best.is_some_and(|best| self.leaves(&best.fit, &before) > 2.0 * HOPELESS)
            {
                return Some(Explanation::of_nothing(before, first_tried, suspected));
            }
            let Some(step) = self.next_effect(&tried, effects.is_empty()) else { break };
            has_to_explain_all |= step.is_detour;
            last_tried = tried;
            effects.push(step.tried);
            current = self.in_frames(step.fit)?;
            if effects.len() >= ENOUGH_EFFECTS {
                match self.leaves(&current, &before) {
                    0.0 => break,
                    part if part > HOPELESS => {
                        return Some(Explanation::of_nothing(before, first_tried, suspected));
                    }
                    _ => {}
                }
            }
        }
        let (after, found) = match &effects[..] {
            // Nothing beside which it could look different.
            [only] => {
                let others = first_tried.iter().filter(|other| other.kind != only.kind && other.may_be_named());
                let alike = |other: &&Tried| only.worth() - other.worth() < ALIKE;
                let alternatives = others.filter(alike).map(|other| other.kind).collect();
                (current, vec![Found { kind: only.kind, worth: only.worth(), alternatives }])
            }
            _ => self.review(current, last_tried)?,
        };
        let explains_all = |fit: &Fit| {
            excess(&self.trials, &fit.hypothesis, Purpose::Fit).is_noise()
                && steadiness(&self.trials, &fit.hypothesis).is_noise()
        };
        if has_to_explain_all && !explains_all(&after) {
            return Some(Explanation::of_nothing(before, first_tried, suspected));
        }
        let after = settle_jumps(&self.trials, after)?;
        Some(Explanation { before, after, found, tried: first_tried, suspected })
    }

    /// `found` with the frames of its last effect where all records have them. A rate that is off by a part of a frame over a record
    /// leaves more than a further effect does, which would be looked for in vain.
    fn in_frames(&mut self, found: Fit) -> Option<Fit> {
        if found.hypothesis.effects.last().is_none_or(|effect| effect.phases.is_empty()) {
            return Some(found);
        }
        let sharp = settle_jumps(&self.trials, found)?;
        self.settle(&sharp.hypothesis, self.lags)
    }

    /// Kinds that were tried beside `from`, as it was found then, by the noise of now: those that may be the best.
    fn again(&self, from: &Fit, tried: &[Tried]) -> Vec<Tried> {
        let best = tried.first().map_or(0.0, Tried::worth);
        let is_near = |other: &&Tried| other.worth() > AGAIN * best;
        let near = tried.iter().filter(is_near).take(MOST_FINISHED);
        let mut again: Vec<Tried> = near
            .filter_map(|tried| self.attempt(from, &tried.fit.hypothesis, tried.kind, best - tried.worth()))
            .collect();
        self.hear(&mut again);
        again
    }

    /// Tries each effect again beside the others: drops it, exchanges it, or keeps it with what would do as well. Beside the last
    /// one nothing has changed since `last_tried`, as long as the others stay.
    fn review(&mut self, mut current: Fit, last_tried: Vec<Tried>) -> Option<(Fit, Vec<Found>)> {
        let mut last_tried = Some(last_tried);
        let mut found: Vec<Option<Found>> = vec![None; current.hypothesis.effects.len()];
        let mut effect = 0;
        let mut exchanges = 0;
        while effect < current.hypothesis.effects.len() {
            let kind = current.hypothesis.effects[effect].kind;
            let rest = fit(&self.trials, &current.hypothesis.without(effect), self.lags)?;
            let others: Vec<&'static Kind> = rest.hypothesis.effects.iter().map(|other| other.kind).collect();
            let is_last = effect + 1 == current.hypothesis.effects.len();
            let mut tried = match last_tried.take_if(|_| is_last) {
                Some(tried) => self.again(&rest, &tried),
                None => self.tries(&rest, &others),
            };
            // The fit that it has may be better than what the search from the rest finds.
            if let Some(own) = self.attempt(&rest, &current.hypothesis, kind, 0.0) {
                tried.retain(|other| other.kind != kind || other.worth() > own.worth());
                if !tried.iter().any(|other| other.kind == kind) {
                    tried.push(own);
                }
                self.hear(&mut tried);
            }
            let most = tried.first().map_or(0.0, Tried::worth);
            let Some(best) = tried.iter().find(|best| best.may_be_named() && most - best.worth() < ALIKE) else {
                current = rest;
                found.remove(effect);
                last_tried = None;
                continue;
            };
            if best.kind != kind && exchanges < MOST_EFFECTS {
                exchanges += 1;
                last_tried = None;
                current = self.settle(&best.fit.hypothesis.clone(), self.lags)?;
                // The new one is the last; all are judged beside it.
                found = vec![None; current.hypothesis.effects.len()];
                effect = 0;
                continue;
            }
            let others = tried.iter().filter(|other| other.kind != kind && other.may_be_named());
            let alternatives =
                others.filter(|other| best.worth() - other.worth() < ALIKE).map(|other| other.kind).collect();
            found[effect] = Some(Found { kind, worth: best.worth(), alternatives });
            effect += 1;
        }
        let mut order: Vec<usize> = (0..found.len()).collect();
        let worth = |effect: usize| found[effect].as_ref().map_or(0.0, |found| found.worth);
        order.sort_by(|a, b| worth(*b).total_cmp(&worth(*a)));
        let mut sorted = current.hypothesis.clone();
        sorted.effects = order.iter().map(|&effect| current.hypothesis.effects[effect].clone()).collect();
        let after = fit(&self.trials, &sorted, self.lags)?;
        Some((after, order.into_iter().filter_map(|effect| found[effect].clone()).collect()))
    }
}
