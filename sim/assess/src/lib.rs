//! One judgement of a motor's model, of which every command, page and result is a view.
//!
//! [`assess`] compares a model with records, and says in one of four words whether a compensator may be built on it, with the
//! reasons. `rotorlead identify` writes the word into the model's file, where commands without records find it. The rules
//! are in `docs/judgement.md`.

mod gain;
mod ramp;
mod residual;

pub use residual::{LEVEL, error_percent, wrong};

use rotorlead_identify::{IdentifyError, RecordValidation, validate};
use rotorlead_plant::{Judgement, Model, Word};
use rotorlead_records::Experiment;

/// What a lag may miss of a response, percent, and still be one to design with: about what a compensator's own limits cost.
const LARGEST_ERROR_PERCENT: f64 = 5.0;
/// A time constant is known well enough to this part of it: by as much the gain of a lead at its zero is off, some 1 dB.
const LARGEST_STD: f64 = 0.1;

/// A model beside records.
#[derive(Clone, Debug)]
pub struct Assessment {
    /// Whether a compensator may be built on it.
    pub judgement: Judgement,
    /// How well it explains each record.
    pub records: Result<Vec<RecordValidation>, IdentifyError>,
}

/// Judges `model` by the records of `experiment`.
#[must_use]
pub fn assess(experiment: &Experiment, model: &Model) -> Assessment {
    let mut claims = Claims::default();
    if model.points.is_empty() {
        claims.add(
            Word::MeasureAgain,
            "the records show a static map alone: record a multisine or a staircase".to_owned(),
        );
        return Assessment { judgement: claims.judgement(), records: validate(experiment, model) };
    }
    let records = validate(experiment, model);
    match &records {
        Ok(records) => claims.of_residual(experiment, records),
        Err(error) => claims.add(Word::MeasureAgain, format!("the model was compared with no record: {error}")),
    }
    claims.of_points(model);
    claims.0.extend(gain::limits(model).into_iter().map(|limit| (Word::ReadyWithinLimits, limit)));
    Assessment { judgement: claims.judgement(), records }
}

/// What speaks against a model, each with the best word that it leaves.
#[derive(Default)]
struct Claims(Vec<(Word, String)>);

impl Claims {
    fn add(&mut self, word: Word, reason: String) {
        self.0.push((word, reason));
    }

    fn of_residual(&mut self, experiment: &Experiment, records: &[RecordValidation]) {
        let worst = |wrong: &[&RecordValidation]| {
            wrong.iter().copied().max_by(|a, b| error_percent(a).total_cmp(&error_percent(b))).cloned()
        };
        match wrong(records) {
            None if records.is_empty() => self.add(
                Word::MeasureAgain,
                "the records are too long to be compared as they are read: `rotorlead validate` compares them".to_owned(),
            ),
            None => self.add(
                Word::MeasureAgain,
                "no record shows its noise, so that nothing is known of what the lag leaves: hold levels for a second, or record \
                 more periods"
                    .to_owned(),
            ),
            Some(wrong) => {
                if let Some(record) = worst(&wrong) {
                    self.of_error(experiment, &record);
                }
            }
        }
        if !records.is_empty() && !records.iter().any(|record| record.fitted == Some(false)) {
            self.add(
                Word::MeasureAgain,
                "no record was held out: record a second run, and give it role = \"validate\"".to_owned(),
            );
        }
    }

    /// Of a record that shows the model to be wrong.
    fn of_error(&mut self, experiment: &Experiment, record: &RecordValidation) {
        let error = error_percent(record);
        let file = &record.file;
        if let Some(rate_per_s) = ramp::ramp_per_s(experiment) {
            let reason = format!(
                "the ESC ramps its command, by {rate_per_s:.2} of the range in a second, and the lag imitates that: turn the ramp \
                 off, or see `rotorlead diagnose`"
            );
            self.add(Word::NotALag, reason);
        } else if error > LARGEST_ERROR_PERCENT {
            let reason = format!(
                "the lag misses {error:.1} % of the response of {file}, more than its noise: `rotorlead diagnose` looks for what is \
                 missing"
            );
            self.add(Word::NotALag, reason);
        } else {
            let reason = format!("the lag misses {error:.1} % of the response of {file}, more than its noise");
            self.add(Word::ReadyWithinLimits, reason);
        }
    }

    /// Of the operating points.
    fn of_points(&mut self, model: &Model) {
        if let [point] = &model.points[..] {
            let reason = format!("the lag is known at u_nom {} alone: record at a second level", point.nominal);
            self.add(Word::MeasureAgain, reason);
        }
        let part = |point: &rotorlead_plant::Point| point.time_constant_s_std.unwrap_or(0.0) / point.time_constant_s;
        let worst = model.points.iter().max_by(|a, b| part(a).total_cmp(&part(b)));
        if let Some(point) = worst.filter(|point| part(point) > LARGEST_STD) {
            let reason = format!(
                "the time constant at u_nom {:.3} is known to {:.0} % only: record it longer, or with a larger amplitude",
                point.nominal,
                100.0 * part(point)
            );
            self.add(Word::MeasureAgain, reason);
        }
    }

    /// The worst word with all reasons, those of worse words first.
    fn judgement(mut self) -> Judgement {
        self.0.sort_by_key(|(word, _)| std::cmp::Reverse(*word));
        let word = self.0.first().map_or(Word::Ready, |(word, _)| *word);
        Judgement { word, reasons: self.0.into_iter().map(|(_, reason)| reason).collect() }
    }
}

#[cfg(test)]
mod tests;
