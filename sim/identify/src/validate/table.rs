//! The paper's Table 2, from records.

use rotorlead_records::{Excitation, SAME_NOMINAL};

use super::{RecordValidation, Role};

/// % fit, and what a perfect model would score.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitBesideCeiling {
    /// % fit.
    pub fit_percent: f64,
    /// % fit that noise leaves to the true model; `None` where a record does not show its noise.
    pub ceiling_percent: Option<f64>,
}

/// A row of Table 2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableRow {
    /// The nominal command.
    pub nominal: f64,
    /// Of the frequency response.
    pub frequency: Option<FitBesideCeiling>,
    /// On the square wave.
    pub square: Option<FitBesideCeiling>,
}

/// % fit in frequency and on square waves by nominal command, of records without compensator: the mean over those whose
/// role is `validate` where there are any, over all otherwise.
#[must_use]
pub fn table_2(records: &[RecordValidation]) -> Vec<TableRow> {
    let mut nominals: Vec<f64> = records.iter().map(|record| record.nominal).collect();
    nominals.sort_by(f64::total_cmp);
    nominals.dedup_by(|a, b| *a - *b < SAME_NOMINAL);
    let row = |nominal: f64| {
        let of = |excitation: Excitation| {
            let at = |record: &&RecordValidation| {
                (record.nominal - nominal).abs() < SAME_NOMINAL
                    && record.excitation == excitation
                    && !record.compensated
            };
            mean(&records.iter().filter(at).collect::<Vec<_>>())
        };
        TableRow { nominal, frequency: of(Excitation::Multisine), square: of(Excitation::Square) }
    };
    let rows = nominals.into_iter().map(row);
    rows.filter(|row| row.frequency.is_some() || row.square.is_some()).collect()
}

fn mean(records: &[&RecordValidation]) -> Option<FitBesideCeiling> {
    let held_out = records.iter().any(|record| record.role == Some(Role::Validate));
    let judged = || records.iter().filter(|record| !held_out || record.role == Some(Role::Validate));
    let count = judged().count() as f64;
    let fit_percent = judged().map(|record| record.fit_percent).sum::<f64>() / count;
    let ceiling: Option<f64> = judged().map(|record| record.ceiling_percent).sum();
    (count > 0.0).then(|| FitBesideCeiling { fit_percent, ceiling_percent: ceiling.map(|sum| sum / count) })
}
