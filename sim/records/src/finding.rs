//! One thing that is wrong with a folder.

use miette::Diagnostic;
use serde::Serialize;

/// Whether an identification goes on in spite of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// `rotorlead identify` refuses the folder as it is.
    Error,
    /// It does not, and its numbers may be less accurate.
    Warning,
}

/// What a finding is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Topic {
    /// A file that is missing, cannot be read, or is in no record.
    Files,
    /// When rows come: gaps, uneven or slow ones, another rate than stated.
    Sampling,
    /// The unit of `time_s`.
    TimeUnit,
    /// The unit of `command`.
    CommandUnit,
    /// The unit of the response.
    ResponseUnit,
    /// A response that falls where the command rises.
    Sign,
    /// A column that stands on a limit.
    Saturation,
    /// How many periods there are, and whether they are ones.
    Periods,
    /// The command: constant, around another level or of another amplitude than stated.
    Command,
    /// The response: constant, jumping, stopped.
    Response,
    /// A model that does not explain a response to within its noise.
    GoodnessOfFit,
    /// Which records are fitted, and which are for validation.
    Roles,
    /// Whatever else an identification has to say.
    Identification,
}

/// Something wrong, with what to do about it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Whether an identification goes on.
    pub severity: Severity,
    /// What it is about.
    pub topic: Topic,
    /// The record's file; `None` where it is about no single record.
    pub file: Option<String>,
    /// The row of numbers, from one, the header line apart, where it is about one.
    pub row: Option<usize>,
    /// What is wrong, with the names of file and column.
    pub message: String,
    /// What to do; `None` where the message says it.
    pub remedy: Option<String>,
}

impl Finding {
    /// Of an error or a warning, in its words.
    pub fn new(severity: Severity, topic: Topic, file: Option<&str>, error: &dyn Diagnostic) -> Self {
        Self {
            severity,
            topic,
            file: file.map(str::to_owned),
            row: None,
            message: error.to_string(),
            remedy: error.help().map(|help| help.to_string()),
        }
    }

    /// What is wrong, and behind a semicolon what to do about it.
    #[must_use]
    pub fn sentence(&self) -> String {
        match &self.remedy {
            Some(remedy) => format!("{}; {remedy}", self.message),
            None => self.message.clone(),
        }
    }

    /// A warning of an identification, in words.
    #[must_use]
    pub fn warning(message: String, remedy: Option<String>) -> Self {
        Self { severity: Severity::Warning, topic: Topic::Identification, file: None, row: None, message, remedy }
    }

    /// The same about a row, counted from one.
    #[must_use]
    pub fn at_row(mut self, row: Option<usize>) -> Self {
        self.row = row;
        self
    }

    /// Whether it makes all numbers of a record others than they say: a unit or a sign.
    #[must_use]
    pub fn is_grave(&self) -> bool {
        matches!(self.topic, Topic::TimeUnit | Topic::CommandUnit | Topic::ResponseUnit | Topic::Sign)
    }

    /// Whether it is about the same thing of the same file.
    #[must_use]
    pub fn is_about(&self, file: Option<&str>, topic: Topic) -> bool {
        self.topic == topic && self.file.as_deref() == file
    }
}
