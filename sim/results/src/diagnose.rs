//! What a diagnosis finds.

use rotorlead_diagnose::Diagnosis;
use serde::Serialize;
use serde_json::Value;

#[derive(Serialize)]
struct Values<'a> {
    #[serde(flatten)]
    found: &'a Diagnosis,
    next_experiment: Option<String>,
}

/// The diagnosis, and the experiment that would say more. What is not known is null.
///
/// # Panics
/// Never: keys are text.
#[must_use]
pub fn diagnosis_json(found: &Diagnosis) -> Value {
    let next_experiment = found.next_experiment().map(|next| next.words);
    serde_json::to_value(Values { found, next_experiment }).expect("keys are text, and no value fails to be written")
}
