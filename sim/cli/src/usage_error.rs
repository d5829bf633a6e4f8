//! Options that make no sense together, which no single option's parser can tell.

use miette::Diagnostic;
use thiserror::Error;

/// Wrong use of the command line: exit status 2, as for an option that does not parse.
#[derive(Debug, Error, Diagnostic)]
#[error("{message}")]
#[diagnostic(help("{help}"))]
pub struct UsageError {
    /// What is wrong, with the options by name.
    pub message: String,
    /// What to do about it.
    pub help: String,
}

impl UsageError {
    /// Of any message and remedy.
    pub fn new(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { message: message.into(), help: help.into() }
    }
}
