//! Limits that few commands pass, and by little.
//!
//! A limit above all commands changes nothing, and one below many changes much: between both a grid over the plausible range
//! finds no slope that leads to a limit that cuts off the last hundredth of a square wave.

use rotorlead_plant::effect::Kind;

use super::scan::Scan;
use super::{ByPlausibleRange, Proposal, Starts};
use crate::data::dataset::PreparedRecord;
use crate::estimate::fit::Fit;
use crate::likelihood::Likelihood;
use crate::model::candidate::Candidate;

/// Parts of the amplitude that are cut off. Chosen: a hundredth, as little as shows, and a tenth, on the way to the grid over the range.
/// More cost only time.
const CUT_OFF: [f64; 2] = [0.01, 0.1];
/// Commands closer than this are the same. Chosen: below the grid of a 12-bit command, 2.4e-4, and above rounding.
const SAME: f64 = 1e-4;

/// A limit of the command.
pub(super) struct Limit;

impl Proposal for Limit {
    fn starts(&self, likelihood: &Likelihood, from: &Fit, scan: &Scan, kind: &'static Kind) -> Starts {
        let mut starts = ByPlausibleRange.starts(likelihood, from, scan, kind);
        if !likelihood.data.has_logs() {
            starts.candidates.extend(below_the_highest(likelihood, kind));
        }
        starts
    }
}

/// Limits a little below the highest commands of the records.
fn below_the_highest(likelihood: &Likelihood, kind: &'static Kind) -> Vec<Candidate> {
    let Some((place, _)) = Candidate::searched(kind).next() else { return Vec::new() };
    let top =
        |record: &PreparedRecord| (record.command.iter().copied().fold(f64::NEG_INFINITY, f64::max), record.amplitude);
    let mut tops: Vec<(f64, f64)> = likelihood.data.records.iter().map(top).collect();
    // The larger amplitude first where tops are the same.
    tops.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.total_cmp(&a.1)));
    tops.dedup_by(|a, b| a.0 - b.0 < SAME);
    let limits = tops.iter().flat_map(|(top, amplitude)| CUT_OFF.map(|part| top - part * amplitude));
    let limited = limits.map(|limit| {
        let mut values = kind.null();
        values[place] = limit;
        Candidate::new(kind, values)
    });
    limited.filter(|candidate| (kind.check)(&candidate.values).is_ok()).collect()
}
