//! What the report of a single answer says at its top, and of what parts it is made.

use std::path::Path;

use rotorlead_answer::{Answer, Fact, Report};
use rotorlead_records::Experiment;

use crate::experiment::experiment_facts;

/// A report of one answer, without commands that repeat it.
#[must_use]
pub fn answer_page(kind: &str, title: impl Into<String>, answer: &Answer) -> Report {
    Report {
        kind: kind.to_owned(),
        title: title.into(),
        verdict: answer.verdict.clone(),
        facts: Vec::new(),
        warnings: answer.warnings(),
        sections: vec![answer.section()],
        commands: Vec::new(),
    }
}

/// A fact about a file.
#[must_use]
pub fn file_fact(name: &str, path: &Path) -> Fact {
    Fact::new(name, path.display().to_string())
}

/// The version, for reports that rest on no records.
#[must_use]
pub fn version_fact() -> Fact {
    Fact::new("Version", format!("Rotorlead {}", env!("CARGO_PKG_VERSION")))
}

/// Facts about an experiment that was read from `source`, a folder or a log.
#[must_use]
pub fn records_facts(experiment: &Experiment, source: &Path) -> Vec<Fact> {
    let mut facts = experiment_facts(experiment, &source.display().to_string());
    facts.extend(Experiment::checksum(source).map(|sum| Fact::new("CRC-32 of these files", sum)));
    facts
}
