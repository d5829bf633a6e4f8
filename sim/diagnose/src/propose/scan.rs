//! A kind whose response jumps about as its value moves has a narrow valley around the right one, and others elsewhere: a
//! coarse grid steps over it. One period of one record, and the first-order lags of its nominal command, are enough to see
//! where it may be.

use rayon::prelude::*;
use rotorlead_plant::effect::Kind;
use rotorlead_records::Excitation;

use crate::data::dataset::PreparedRecord;
use crate::data::split::Split;
use crate::estimate::fit::Fit;
use crate::estimate::score_test::ScoreTest;
use crate::likelihood::Likelihood;
use crate::model::candidate::Candidate;

/// Valleys of each record that are looked at on all records. Chosen: one record ranks nearly equal valleys by its noise. Fewer may lose
/// the right one; more cost only time.
const VALLEYS: usize = 6;

/// Records for scans, with what the lags would do to each.
pub(crate) struct Scan<'a> {
    records: Vec<(Likelihood, ScoreTest<'a>)>,
}

impl<'a> Scan<'a> {
    /// On the largest record of each excitation near the middle nominal command that is fitted; there the command goes through
    /// most levels. Multisines and triangles go through many, and each has valleys that the other does not show; the two levels
    /// of a square wave count where there is nothing else. `None` where the derivatives
    /// of the lags are not defined.
    pub fn new(likelihood: &Likelihood, from: &'a Fit) -> Option<Self> {
        let is_fitted = |record: &&PreparedRecord| likelihood.has(record, Split::Train);
        let middle = 0.5 * (likelihood.data.nominals.first()? + likelihood.data.nominals.last()?);
        let off = |record: &PreparedRecord| (record.nominal - middle).abs() - record.amplitude;
        let largest = |is_one: &dyn Fn(Excitation) -> bool| {
            // A log stands on few levels: there are no valleys but these.
            let those = likelihood
                .data
                .records
                .iter()
                .filter(|record| likelihood.periodic(record).is_some())
                .filter(is_fitted)
                .filter(|record| is_one(record.excitation));
            those.min_by(|a, b| off(a).total_cmp(&off(b)))
        };
        let mut chosen: Vec<&PreparedRecord> = [Excitation::Multisine, Excitation::Triangle]
            .into_iter()
            .filter_map(|excitation| largest(&|other| other == excitation))
            .collect();
        if chosen.is_empty() {
            chosen.extend(largest(&|_| true));
        }
        let records: Option<Vec<_>> = chosen
            .into_iter()
            .map(|record| {
                let of_record = likelihood.first_period(&[record]);
                let score_test = ScoreTest::new(&of_record, from)?;
                Some((of_record, score_test))
            })
            .collect();
        Some(Self { records: records? })
    }

    /// Those of many candidates that leave least, `count` of each record.
    pub fn least(&self, candidates: &[Candidate], count: usize) -> Vec<Candidate> {
        let of_record = |(likelihood, score_test): &(Likelihood, ScoreTest)| {
            let looked = candidates.par_iter().filter_map(|candidate| {
                score_test.predict(likelihood, candidate, false).map(|(left, _)| (left, candidate))
            });
            let mut looked: Vec<(f64, &Candidate)> = looked.collect();
            looked.sort_by(|a, b| a.0.total_cmp(&b.0));
            looked.into_iter().take(count).map(|(_, candidate)| candidate.clone()).collect::<Vec<_>>()
        };
        self.records.iter().flat_map(of_record).collect()
    }

    /// The lowest valleys of a kind over the plausible range of its value. Empty for kinds without such.
    pub fn valleys(&self, kind: &'static Kind, coarse: u32) -> Vec<Candidate> {
        let pieces = Candidate::searched(kind).map(|(_, parameter)| parameter.pieces).max().unwrap_or(0);
        if pieces <= coarse {
            return Vec::new();
        }
        let candidates = Candidate::grid(kind, pieces);
        let mut found: Vec<Candidate> = Vec::new();
        for (likelihood, score_test) in &self.records {
            let left: Vec<f64> = candidates
                .par_iter()
                .map(|candidate| {
                    score_test.predict(likelihood, candidate, false).map_or(f64::INFINITY, |(left, _)| left)
                })
                .collect();
            let at = |place: usize| left.get(place).copied().unwrap_or(f64::INFINITY);
            let is_valley = |place: &usize| at(*place) <= at(place.wrapping_sub(1)) && at(*place) < at(place + 1);
            let mut valleys: Vec<usize> = (0..left.len()).filter(is_valley).collect();
            valleys.sort_by(|a, b| at(*a).total_cmp(&at(*b)));
            found.extend(valleys.into_iter().take(VALLEYS).map(|place| candidates[place].clone()));
        }
        found
    }
}
