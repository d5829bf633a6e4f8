//! Screening: what each kind promises beside a fit, by score tests, before any search.

use rayon::prelude::*;
use rotorlead_plant::effect::{Kind, Linearity, Shows, Site};

use crate::estimate::fit::Fit;
use crate::estimate::score_test::ScoreTest;
use crate::likelihood::Likelihood;
use crate::model::candidate::Candidate;
use crate::model::hypothesis::Hypothesis;
use crate::propose::scan::Scan;
use crate::propose::{self, collapsed};
use crate::select::explain::Search;

/// Starts of a kind that are looked at on all records.
const MOST_LOOKED_AT_AGAIN: usize = 3;
/// How often the screening halves the distance to the neighbors of the best start.
const CLOSER_LOOKS: usize = 3;
/// How often the screening looks around in a narrow valley, in how many steps to either side, and how much nearer each time.
const VALLEY_LOOKS: i32 = 5;
const VALLEY_STEPS: u32 = 4;
const VALLEY_NARROWING: f64 = 0.25;

/// What a start of a kind would leave of the chi-square, and the hypothesis that it leads to.
pub(crate) type Screened = (f64, Hypothesis, &'static Kind);

/// A part of the records, and a score test on it.
pub(crate) struct FirstLook<'a> {
    likelihood: Likelihood,
    score_test: ScoreTest<'a>,
}

impl Search<'_> {
    /// Starts of all kinds but those to `exclude`, with what they would leave beside `from` as far as the linearization holds, best first.
    pub fn screened(&self, from: &Fit, exclude: &[&'static Kind]) -> Vec<Screened> {
        let lifted = self.lags.then(|| collapsed::lifted(&self.likelihood, from)).flatten();
        let mut screened = Vec::new();
        for near in std::iter::once(from).chain(&lifted) {
            let Some(score_test) = ScoreTest::new(&self.likelihood, near) else { continue };
            let Some(scan) = Scan::new(&self.likelihood, near) else { continue };
            let first_look = self.likelihood.for_first_look().and_then(|likelihood| {
                let score_test = ScoreTest::new(&likelihood, near)?;
                Some(FirstLook { likelihood, score_test })
            });
            let kinds = self.catalog.kinds().filter(|kind| kind.site != Site::Base && !exclude.contains(kind));
            for kind in kinds.filter(|kind| kind.shows != Shows::OverLevels) {
                screened.extend(self.screen((&score_test, first_look.as_ref()), &scan, near, kind));
                (self.progress)();
            }
        }
        screened.sort_by(|a: &Screened, b| a.0.total_cmp(&b.0));
        screened
    }

    /// Starts of a kind with what they would leave. Around the best of a single value it looks closer: a limit is felt only
    /// where the commands are.
    ///
    /// All that is looked at by `first_look`, where there is one, which is quick; what is best there by `score_test`.
    pub fn screen(
        &self,
        (score_test, first_look): (&ScoreTest, Option<&FirstLook>),
        scan: &Scan,
        from: &Fit,
        kind: &'static Kind,
    ) -> Vec<Screened> {
        // Where the alignment has taken over much of a delay, a start that brings its own is evaluated without it too: so far the
        // linearization does not hold.
        let has_time_offset = from.has_time_offset(&self.likelihood);
        // What is slow shows over all of a record.
        let first_look = first_look.filter(|_| kind.linearity != Linearity::Absent || kind.site <= Site::Rotor);
        let evaluate = |(likelihood, score_test): (&Likelihood, &ScoreTest), start: &Candidate| {
            let with = score_test.predict(likelihood, start, false);
            let without = has_time_offset.then(|| score_test.predict(likelihood, start, true)).flatten();
            [with, without].into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0))
        };
        let by_all = (&self.likelihood, score_test);
        let by = first_look.map_or(by_all, |look| (&look.likelihood, &look.score_test));
        let mut evaluated: Vec<(f64, Candidate, Hypothesis)> = Vec::new();
        let look = |evaluated: &mut Vec<(f64, Candidate, Hypothesis)>, starts: Vec<Candidate>| {
            let looked = |start: Candidate| evaluate(by, &start).map(|(left, moved)| (left, start, moved));
            evaluated.par_extend(starts.into_par_iter().filter_map(looked));
            evaluated.sort_by(|a, b| a.0.total_cmp(&b.0));
        };
        let starts = propose::of(kind).starts(&self.likelihood, from, scan, kind);
        look(&mut evaluated, starts.candidates);
        if starts.is_in_valley {
            // Down into the lowest.
            for round in 0..VALLEY_LOOKS {
                let Some(best) = evaluated.first().map(|best| best.1.clone()) else { break };
                look(&mut evaluated, best.around(VALLEY_NARROWING.powi(round), VALLEY_STEPS));
            }
        } else if Candidate::searched(kind).count() == 1 {
            for _ in 0..CLOSER_LOOKS {
                let between = Candidate::around_best(&evaluated);
                look(&mut evaluated, between);
            }
            let vertex = Candidate::vertex(&evaluated);
            look(&mut evaluated, vertex.into_iter().collect());
        }
        if first_look.is_some() {
            evaluated.truncate(MOST_LOOKED_AT_AGAIN);
            let starts = evaluated.into_iter().map(|(_, start, _)| start);
            evaluated =
                starts.filter_map(|start| evaluate(by_all, &start).map(|(left, moved)| (left, start, moved))).collect();
            evaluated.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        evaluated.into_iter().map(|(left, _, moved)| (left, moved, kind)).collect()
    }
}
