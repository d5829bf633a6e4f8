//! The residual of a model on records, against their noise.

use rotorlead_identify::validate::RecordValidation;

/// Probability that a true model is called wrong on any of the records. Chosen: one true model of 100 is refused; a smaller level
/// misses errors in short records, and long ones show any error at any level.
pub const SIGNIFICANCE: f64 = 0.01;
/// An error of the model below this, percent of the response, is not worth a word however sure it is. Chosen: the standard errors of a good
/// fit make errors of this order, and long records show smaller ones of any model.
pub const SMALLEST_ERROR_PERCENT: f64 = 1.0;

/// The records that show the model to be wrong by an amount worth a word, at a level that holds over all of them; `None` where no
/// record shows its noise. One of which less is left than noise does not
/// ([`judged_residual`](rotorlead_identify::validate::RecordValidation::judged_residual)).
///
/// A record shows it where the power that the model leaves over that of the noise has a tail probability below the level over
/// the number of records (Bonferroni), by [`ResidualPower`](rotorlead_identify::validate::ResidualPower).
#[must_use]
pub fn records_with_model_error(records: &[RecordValidation]) -> Option<Vec<&RecordValidation>> {
    let judged: Vec<&RecordValidation> = records.iter().filter(|record| record.judged_residual().is_some()).collect();
    let tested = judged.len() as f64;
    let shows_error = |record: &&RecordValidation| {
        record.judged_residual().is_some_and(|power| power.p_value * tested < SIGNIFICANCE)
            && record.model_error_percent().is_some_and(|error| error >= SMALLEST_ERROR_PERCENT)
    };
    (!judged.is_empty()).then(|| judged.into_iter().filter(shows_error).collect())
}

/// What a model gets wrong of a record, percent of its response; zero where nothing is known of it.
#[must_use]
pub fn error_percent(record: &RecordValidation) -> f64 {
    record.model_error_percent().unwrap_or(0.0)
}
