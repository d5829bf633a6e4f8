//! How well a model explains records.

use rotorlead_answer::Section;
use rotorlead_identify::RecordValidation;
use rotorlead_records::Output;

use crate::validation::{figures_of, validation_by_nominal, validation_scores, verdict};

/// The scores, and the figures of every record.
#[must_use]
pub fn validation_section(records: &[RecordValidation], output: Output) -> Section {
    // For a terminal lines are broken, and go on further to the right; here each sentence and each record is a paragraph.
    let mut text: Vec<String> = Vec::new();
    for line in verdict(records).lines() {
        match text.last_mut() {
            Some(last)
                if line.starts_with("    ")
                    || !(last.ends_with('.') || last.ends_with(':') || line.starts_with("  ")) =>
            {
                last.push(' ');
                last.push_str(line.trim());
            }
            _ => text.push(line.trim().to_owned()),
        }
    }
    let figures = records.iter().map(|record| figures_of(record, output)).collect();
    let tables = [validation_scores(records)].into_iter().chain(validation_by_nominal(records)).collect();
    Section { text, tables, figures, ..Section::new("validation", "Validation") }
}
