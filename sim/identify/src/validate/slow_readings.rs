//! The readings of a sensor that is slower than the rows, beside a model.

use rotorlead_records::Record;

use crate::rows::readings::{Readings, mean_over};

/// Which rows repeat a reading, and how far apart readings are; nothing where each row has its own.
#[derive(Default)]
pub(super) struct SlowReadings(Option<(Vec<bool>, f64)>);

/// A model beside a response: the fit, the model at the rows that are compared, and at all.
type Aligned = (Option<f64>, Vec<f64>, Vec<f64>);

impl SlowReadings {
    pub(super) fn find(record: &Record, response: &[f64]) -> Self {
        let found = Readings::find(&record.time_s, response);
        Self(found.map(|readings| (readings.repeats(response.len()), readings.interval_s)))
    }

    /// Whether a row repeats the reading of the one before.
    pub(super) fn repeats(&self, row: usize) -> bool {
        self.0.as_ref().is_some_and(|(repeats, _)| repeats[row])
    }

    /// The model beside the readings as what they are: momentary values, or means since the one before. Which of the two is nothing of
    /// the model, so that the better one counts.
    pub(super) fn better(&self, time_s: &[f64], model: Vec<f64>, aligned: impl Fn(Vec<f64>) -> Aligned) -> Aligned {
        let Some((_, interval_s)) = &self.0 else { return aligned(model) };
        let mean = aligned(mean_over(time_s, &model, *interval_s));
        let momentary = aligned(model);
        if mean.0 > momentary.0 { mean } else { momentary }
    }
}
