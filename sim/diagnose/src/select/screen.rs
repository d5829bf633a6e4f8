//! Screening: the gain that each kind promises over a fit, by score tests, before any search.

use rayon::prelude::*;
use rotorlead_plant::effect::{Kind, Linearity, Shows, Site};
use rotorlead_records::Output;

use crate::data::dataset::{Dataset, PreparedRecord};
use crate::estimate::fit::Fit;
use crate::estimate::score_test::ScoreTest;
use crate::likelihood::Likelihood;
use crate::model::candidate::Candidate;
use crate::model::hypothesis::Hypothesis;
use crate::policy::POLICY;
use crate::propose::scan::Scan;
use crate::propose::{self, collapsed};
use crate::select::search::Search;

/// Share of the least score that the screening has to promise. Chosen: the screening may promise a third too little. Lower, more fits are
/// in vain; higher, effects whose promise is too low are never fitted.
const PROMISED: f64 = 0.7;
/// Kinds that are fitted after the screening. Chosen: more than a third of all, so that a kind need not promise most to be fitted. Fewer
/// may lose the truth; more cost only time.
const MOST_FITTED: usize = 7;
/// Starts of each. Chosen: two minima of a kind, as of a small effect and of a large one. More cost only time.
const MOST_STARTS: usize = 2;
/// Kinds that are followed in any case. Chosen: the first promise may be another's shadow, and its second too. More cost only time.
const MOST_FINISHED: usize = 3;
/// Starts of a kind that are looked at on all records. Chosen: one more than are fitted, as one may fall out there. More cost only time.
const MOST_LOOKED_AT_AGAIN: usize = 3;
/// How often the screening halves the distance to the neighbors of the best start. Derived: a twelfth of the range becomes `2^-3` of that,
/// 1 %, from where a fit finds the rest.
const CLOSER_LOOKS: usize = 3;
/// How often the screening looks around in a narrow valley. Derived: the steps of the last look are `4^-5`, 0.001, of a piece, and within
/// a piece the response is smooth.
const VALLEY_LOOKS: i32 = 5;
/// In how many steps to either side. Chosen: eight places a look; more cost time, fewer take more looks.
const VALLEY_STEPS: u32 = 4;
/// How much nearer each time. Derived: one over the steps, so that a look reaches to the neighbors of the best.
const VALLEY_NARROWING: f64 = 0.25;

/// The predicted chi-square with a start of a kind, and the hypothesis that it leads to.
pub(crate) type Screened = (f64, Hypothesis, &'static Kind);

/// A kind that promises less than this part of what the best does at a first look is not looked at more closely, nor are more kinds
/// than are fitted. Chosen: closer looks may double a promise, not make it ten times as large. Lower costs time.
const CLOSER: f64 = 0.1;

/// Records, and a score test on them.
pub(crate) struct Look<'a, 'b> {
    likelihood: &'b Likelihood,
    score_test: ScoreTest<'a>,
    /// The chi-square of the fit to which kinds are added.
    before: f64,
}

impl<'a, 'b> Look<'a, 'b> {
    /// At all that `likelihood` compares, beside `from`. `None` where its derivatives are not defined.
    pub fn new(likelihood: &'b Likelihood, from: &'a Fit) -> Option<Self> {
        let score_test = ScoreTest::new(likelihood, from)?;
        let before = score_test.before();
        Some(Self { likelihood, score_test, before })
    }

    /// What a start would leave, and where it leads.
    pub fn at(&self, start: Candidate, is_misaligned: bool) -> Option<(f64, Candidate, Hypothesis)> {
        // Where the alignment has taken over much of a delay, a start that brings its own is evaluated without it too: the
        // linearization does not hold that far.
        let with = self.score_test.predict(self.likelihood, &start, false);
        let without = is_misaligned.then(|| self.score_test.predict(self.likelihood, &start, true)).flatten();
        let (left, moved) = [with, without].into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some((left, start, moved))
    }
}

/// Starts of a kind that were looked at.
struct Looked<'a, 'b, 'c> {
    kind: &'static Kind,
    /// What it was looked at by.
    by: &'c Look<'a, 'b>,
    is_misaligned: bool,
    is_in_valley: bool,
    /// What each would leave, and where it leads, best first.
    evaluated: Vec<(f64, Candidate, Hypothesis)>,
}

impl Looked<'_, '_, '_> {
    fn look(&mut self, starts: Vec<Candidate>) {
        let looked = starts.into_par_iter().filter_map(|start| self.by.at(start, self.is_misaligned));
        self.evaluated.par_extend(looked.collect::<Vec<_>>());
        self.evaluated.sort_by(|a, b| a.0.total_cmp(&b.0));
    }

    /// Looks where a parabola through the best of them and its neighbors is least, of which one may be where the effect vanishes: an
    /// effect that is much smaller than all starts is seen by that.
    fn look_at_vertex(&mut self, from: &Fit) {
        let nothing = Candidate::new(self.kind, self.kind.null());
        if nothing.has_coordinates() {
            self.evaluated.push((self.by.before, nothing.clone(), from.hypothesis.with(nothing)));
            self.evaluated.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        self.look(Candidate::vertex(&self.evaluated).into_iter().collect());
    }

    /// Share of the chi-square that the best of them would remove.
    fn promise(&self) -> f64 {
        self.evaluated.first().map_or(0.0, |best| 1.0 - best.0 / self.by.before)
    }

    /// Looks around the best of them where the kind has a single value: a limit is felt only where the commands are.
    fn look_closer(&mut self) {
        if self.is_in_valley {
            // Down into the lowest.
            for round in 0..VALLEY_LOOKS {
                let Some(best) = self.evaluated.first().map(|best| best.1.clone()) else { break };
                self.look(best.around(VALLEY_NARROWING.powi(round), VALLEY_STEPS));
            }
        } else if Candidate::searched(self.kind).count() == 1 {
            for _ in 0..CLOSER_LOOKS {
                self.look(Candidate::around_best(&self.evaluated));
            }
            self.look(Candidate::vertex(&self.evaluated).into_iter().collect());
        }
    }

    /// The best `count` of them by all records.
    fn by_all(mut self, all: &Look, count: usize) -> Vec<Screened> {
        let nothing = self.kind.null();
        self.evaluated.retain(|(_, start, _)| start.values != nothing);
        if !std::ptr::eq(self.by.likelihood, all.likelihood) {
            self.evaluated.truncate(count);
            let starts = self.evaluated.into_iter().map(|(_, start, _)| start);
            self.evaluated = starts.filter_map(|start| all.at(start, self.is_misaligned)).collect();
            self.evaluated.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        self.evaluated.into_iter().map(|(left, _, moved)| (left, moved, self.kind)).collect()
    }
}

impl Search<'_> {
    /// Starts of all kinds but those to `exclude`, each with the chi-square predicted by the linearization at `from`, best first.
    ///
    /// All are evaluated on a part of the records, if there is one that shows most; those that promise something there are evaluated more
    /// closely, and the best on all records.
    pub fn screened(&self, from: &Fit, exclude: &[&'static Kind]) -> Vec<Screened> {
        let lifted = self.lags.then(|| collapsed::lifted(&self.likelihood, from)).flatten();
        let part = self.likelihood.for_first_look();
        let mut screened = Vec::new();
        for near in std::iter::once(from).chain(&lifted) {
            let Some(all) = Look::new(&self.likelihood, near) else { continue };
            let Some(scan) = Scan::new(&self.likelihood, near) else { continue };
            let first = part.as_ref().and_then(|part| Look::new(part, near));
            let kinds = self.catalog.kinds().filter(|kind| kind.site != Site::Base && !exclude.contains(kind));
            let mut looked: Vec<Looked> = kinds
                .filter(|kind| self.likelihood.data.can_show(kind))
                .map(|kind| {
                    (self.progress)();
                    self.looked(&all, first.as_ref(), &scan, near, kind)
                })
                .collect();
            looked.sort_by(|a, b| b.promise().total_cmp(&a.promise()));
            let least = CLOSER * looked.first().map_or(0.0, Looked::promise);
            for (place, mut kind) in looked.into_iter().enumerate() {
                let promises = place < MOST_FITTED && kind.promise() >= least;
                if promises {
                    kind.look_closer();
                }
                screened.extend(kind.by_all(&all, if promises { MOST_LOOKED_AT_AGAIN } else { 1 }));
                (self.progress)();
            }
        }
        screened.sort_by(|a: &Screened, b| a.0.total_cmp(&b.0));
        screened
    }

    /// The starts to search from beside `from`. Where records do not repeat what is left is no noise, and promises say little: there is
    /// one of each kind.
    pub fn starts(&self, from: &Fit, screened: &[Screened], part_of_best: f64) -> Vec<Hypothesis> {
        match self.likelihood.data.has_logs() {
            true => best_of_each(screened),
            false => promising(from, screened, part_of_best),
        }
    }

    /// The starts of a kind, looked at by `first` where that is there and shows it, and else by `all`.
    fn looked<'a, 'b, 'c>(
        &self,
        all: &'c Look<'a, 'b>,
        first: Option<&'c Look<'a, 'b>>,
        scan: &Scan,
        from: &Fit,
        kind: &'static Kind,
    ) -> Looked<'a, 'b, 'c> {
        // What is slow shows over all of a record.
        let first = first.filter(|_| kind.linearity != Linearity::Absent || kind.site <= Site::Rotor);
        let starts = propose::proposal_for(kind).starts(&self.likelihood, from, scan, kind);
        let is_misaligned = from.has_time_offset(&self.likelihood);
        let (is_in_valley, by) = (starts.is_in_valley, first.unwrap_or(all));
        let mut looked = Looked { kind, by, is_misaligned, is_in_valley, evaluated: Vec::new() };
        looked.look(starts.candidates);
        if Candidate::searched(kind).count() == 1 {
            looked.look_at_vertex(from);
        }
        looked
    }
}

impl Dataset {
    /// Whether the records can show a kind.
    pub(crate) fn can_show(&self, kind: &Kind) -> bool {
        match kind.shows {
            // A static map that is free has no curvature left to find.
            Shows::Anywhere if kind.site == Site::Map => !self.records.iter().all(PreparedRecord::has_free_map),
            Shows::Anywhere => true,
            Shows::OverLevels => self.has_logs(),
            Shows::BetweenLevels => self.records.iter().any(|record| !record.starts_settled()),
            Shows::BetweenClocks => self.has_periodic(),
            Shows::InForce => self.output == Output::ThrustN,
        }
    }
}

/// The best start of each kind.
fn best_of_each(screened: &[Screened]) -> Vec<Hypothesis> {
    let is_first =
        |(place, (.., kind)): &(usize, &Screened)| screened[..*place].iter().all(|(.., other)| other != kind);
    screened.iter().enumerate().filter(is_first).map(|(_, (_, start, _))| start.clone()).collect()
}

/// The starts to search from, of those that were screened, the most promising first: of kinds that promise at least this part of the
/// best, and of a few in any case.
fn promising(from: &Fit, screened: &[Screened], part_of_best: f64) -> Vec<Hypothesis> {
    // A gain of log likelihood is half the decrease of the chi-square.
    let best = screened.first().map_or(0.0, |best| from.chi_square - best.0);
    let mut chosen: Vec<(&Hypothesis, &'static Kind)> = Vec::new();
    let mut kinds: Vec<&'static Kind> = Vec::new();
    for (left, start, kind) in screened {
        let gain = from.chi_square - left;
        let is_new = !kinds.contains(kind);
        let is_behind =
            is_new && (kinds.len() >= MOST_FITTED || kinds.len() >= MOST_FINISHED && gain < part_of_best * best);
        // What promises much less than has to be there is not searched.
        if gain < 2.0 * PROMISED * POLICY.least_score || is_behind {
            continue;
        }
        let of_kind = chosen.iter().filter(|(_, other)| other == kind).filter_map(|(other, _)| other.effects.last());
        let is_known = start.effects.last().is_some_and(|start| of_kind.clone().any(|other| start.is_near(other)));
        if of_kind.count() >= MOST_STARTS || is_known {
            continue;
        }
        if is_new {
            kinds.push(kind);
        }
        chosen.push((start, kind));
    }
    chosen.into_iter().map(|(start, _)| start.clone()).collect()
}
