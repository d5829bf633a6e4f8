//! A kind whose response jumps about as its value moves has a narrow valley around the right one, and others elsewhere: a
//! coarse grid steps over it. One period of one record, and the first-order lags of its nominal command, are enough to see
//! where it may be.

use rayon::prelude::*;

use super::fit::{Fit, Screening};
use super::hypothesis::Candidate;
use super::trial::{Purpose, Trial, Trials};
use crate::plant::effect::Kind;
use crate::record::Excitation;

/// Valleys that are looked at on all records.
const VALLEYS: usize = 6;

/// A record for scans, with what the lags would do to it.
pub(super) struct Scan<'a> {
    trials: Trials,
    screening: Screening<'a>,
}

impl<'a> Scan<'a> {
    /// On the largest multisine near the middle nominal command that is fitted; there the command goes through most levels.
    /// `None` where nothing is.
    pub fn new(all: &Trials, from: &'a Fit) -> Option<Self> {
        let is_fitted = |trial: &&Trial| trial.end_of(Some(Purpose::Fit)) > 0;
        let middle = 0.5 * (all.nominals.first()? + all.nominals.last()?);
        let order = |trial: &&Trial| {
            (trial.excitation != Excitation::Multisine, (trial.nominal - middle).abs() - trial.amplitude)
        };
        let trial = all.trials.iter().filter(is_fitted).min_by(|a, b| {
            let (a, b) = (order(a), order(b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        })?;
        let trials = Trials { trials: vec![trial.with_one_period_fitted()], ..all.clone() };
        let screening = Screening::new(&trials, from)?;
        Some(Self { trials, screening })
    }

    /// The lowest valleys of a kind over the plausible range of its value. Empty for kinds without such.
    pub fn valleys(&self, kind: &'static Kind, coarse: u32) -> Vec<Candidate> {
        let pieces = Candidate::searched(kind).map(|(_, parameter)| parameter.pieces).max().unwrap_or(0);
        if pieces <= coarse {
            return Vec::new();
        }
        // A log stands on few levels: there are no valleys but these.
        if self.trials.has_logs() {
            return Vec::new();
        }
        let candidates = Candidate::grid(kind, pieces);
        let left: Vec<f64> = candidates
            .par_iter()
            .map(|candidate| {
                let judged = self.screening.judge(&self.trials, candidate, false);
                judged.map_or(f64::INFINITY, |(left, _)| left)
            })
            .collect();
        let at = |place: usize| left.get(place).copied().unwrap_or(f64::INFINITY);
        let is_valley = |place: &usize| at(*place) <= at(place.wrapping_sub(1)) && at(*place) < at(place + 1);
        let mut valleys: Vec<usize> = (0..left.len()).filter(is_valley).collect();
        valleys.sort_by(|a, b| at(*a).total_cmp(&at(*b)));
        valleys.into_iter().take(VALLEYS).map(|place| candidates[place].clone()).collect()
    }
}
