//! What the reports of single commands say at their top, and of what parts they are made.

use std::path::Path;

use rotorlead_answer::{Answer, Fact, Report, Verdict};
use rotorlead_records::Experiment;
use rotorlead_results::experiment_facts;

use super::report_option::this_command;

/// A report without parts.
pub fn report(kind: &str, title: impl Into<String>, verdict: Verdict) -> Report {
    Report {
        kind: kind.to_owned(),
        title: title.into(),
        verdict,
        facts: Vec::new(),
        warnings: Vec::new(),
        sections: Vec::new(),
        commands: vec![this_command()],
    }
}

/// A report of one answer.
pub fn answer_page(kind: &str, title: impl Into<String>, answer: &Answer) -> Report {
    Report {
        warnings: answer.warnings(),
        sections: vec![answer.section()],
        ..report(kind, title, answer.verdict.clone())
    }
}

/// A fact about a file.
pub fn file(name: &str, path: &Path) -> Fact {
    Fact::new(name, path.display().to_string())
}

/// The version, for reports that rest on no records.
pub fn version() -> Fact {
    Fact::new("Version", format!("Rotorlead {}", env!("CARGO_PKG_VERSION")))
}

/// Facts about an experiment that was read from `source`, a folder or a log.
pub fn records(experiment: &Experiment, source: &Path) -> Vec<Fact> {
    let mut facts = experiment_facts(experiment, &source.display().to_string());
    facts.extend(Experiment::checksum(source).map(|sum| Fact::new("CRC-32 of these files", sum)));
    facts
}
