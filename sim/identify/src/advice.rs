//! A warning in one sentence.

use miette::Diagnostic;

/// What is wrong, and behind a semicolon what to do about it, where it says so.
#[must_use]
pub fn with_advice(warning: &impl Diagnostic) -> String {
    match warning.help() {
        Some(help) => format!("{warning}; {help}"),
        None => warning.to_string(),
    }
}
