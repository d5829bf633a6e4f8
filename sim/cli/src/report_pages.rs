//! What the reports of single commands say at their top, and the command that repeats them.

use rotorlead_answer::{Answer, Report, Verdict};
pub use rotorlead_results::{file_fact as file, records_facts as records, version_fact as version};

use super::report_option::this_command;

/// A report without parts.
pub fn report(kind: &str, title: impl Into<String>, verdict: Verdict) -> Report {
    Report { verdict, warnings: Vec::new(), sections: Vec::new(), ..answer_page(kind, title, &Answer::default()) }
}

/// A report of one answer.
pub fn answer_page(kind: &str, title: impl Into<String>, answer: &Answer) -> Report {
    Report { commands: vec![this_command()], ..rotorlead_results::answer_page(kind, title, answer) }
}
