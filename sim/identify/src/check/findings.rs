//! All findings of a folder, each said once.

use miette::Diagnostic;
use rotorlead_records::{Finding, Severity, Topic};

use crate::error::IdentifyError;

/// What was found, in the order in which it was.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings(Vec<Finding>);

impl Findings {
    /// Adds one.
    pub fn push(&mut self, finding: Finding) {
        self.0.push(finding);
    }

    /// Adds several.
    pub fn extend(&mut self, findings: impl IntoIterator<Item = Finding>) {
        self.0.extend(findings);
    }

    /// Takes in what an identification refused. Where the rows have shown the cause already, that is an error now, and
    /// nothing is said twice.
    pub fn refuse(&mut self, error: &IdentifyError) {
        let file = error.file();
        let (topic, causes) = error.topic_and_causes();
        let is_cause = |finding: &&mut Finding| causes.iter().any(|topic| finding.is_about(file, *topic));
        match self.0.iter_mut().filter(|_| file.is_some()).find(is_cause) {
            Some(cause) => cause.severity = Severity::Error,
            None => self.push(Finding::new(Severity::Error, topic, file, error).at_row(error.row())),
        }
    }

    /// Takes in what an identification warned of, unless the rows have shown it already.
    pub fn warn(&mut self, warning: Finding) {
        // A gain is of a nominal command, where the rows speak of its records.
        let is_known = |finding: &Finding| finding.topic == warning.topic;
        if warning.topic != Topic::Sign || !self.0.iter().any(is_known) {
            self.push(warning);
        }
    }

    /// Adds any other refusal.
    pub fn refuse_other(&mut self, topic: Topic, file: Option<&str>, error: &dyn Diagnostic) {
        self.push(Finding::new(Severity::Error, topic, file, error));
    }

    /// Errors first, each in the order in which they were found.
    #[must_use]
    pub fn sorted(mut self) -> Vec<Finding> {
        self.0.sort_by_key(|finding| finding.severity);
        self.0
    }
}
