//! Answers as a page shows them: the parts of a report.

use rotorlead_answer::{Answer, Report, Section, Verdict};
use rotorlead_report::{FigureError, Fragment, fragments};
use rotorlead_results::answer_page;
use serde_json::{Value, json};

use crate::fault::Fault;

/// A report in its parts.
pub fn page(report: &Report) -> Result<Value, Fault> {
    let parts = fragments(report)?;
    Ok(json!({
        "verdict": { "tone": report.verdict.tone, "html": parts.verdict },
        "sections": parts.sections,
        "warnings": parts.warnings,
        "done": parts.done,
        "commands": report.commands,
    }))
}

/// A verdict by itself.
pub fn verdict(verdict: &Verdict) -> Result<String, Fault> {
    let alone = Answer { verdict: verdict.clone(), ..Answer::default() };
    Ok(fragments(&answer_page("", "", &alone))?.verdict)
}

/// A section by itself.
pub fn section(section: &Section) -> Result<Value, Fault> {
    Ok(json!(Fragment::new(section)?))
}

impl From<FigureError> for Fault {
    fn from(error: FigureError) -> Self {
        miette::Report::from(error).into()
    }
}
