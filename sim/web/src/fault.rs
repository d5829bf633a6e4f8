//! What is wrong, for a page that asks for what is missing.

use miette::Diagnostic as _;
use rotorlead_identify::error::IdentifyError;
use rotorlead_identify::lag::steps::StepsError;
use rotorlead_records::files::FileError;
use rotorlead_records::import::{ImportError, MissingOption, OptionsFault};
use serde_json::{Value, json};

/// Why there is no answer, with what to do and what would help.
#[derive(Debug, Default)]
pub struct Fault {
    message: String,
    help: String,
    missing: Vec<MissingOption>,
    /// The columns of the log that is in question.
    columns: Vec<String>,
}

impl Fault {
    /// A sentence with what to do.
    pub fn new(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { message: message.into(), help: help.into(), ..Self::default() }
    }

    /// What a log does not say of itself, and which columns it has.
    pub fn from_log(error: &ImportError, columns: Vec<String>) -> Self {
        let help = error.help().map(|help| help.to_string()).unwrap_or_default();
        Self { message: error.to_string(), help, missing: error.missing_options(), columns }
    }

    /// Why nothing was identified. Of a log, what drove the command may be another than was taken.
    pub fn from_identification(error: IdentifyError, is_log: bool) -> Self {
        let may_be_another = matches!(
            error,
            IdentifyError::NoRecord { .. }
                | IdentifyError::Free { .. }
                | IdentifyError::Steps(StepsError::NoPlateaus { .. })
        );
        let missing = if is_log && may_be_another { vec![MissingOption::excitation()] } else { Vec::new() };
        Self { missing, ..miette::Report::from(error).into() }
    }

    /// For the page.
    pub fn json(&self) -> Value {
        let missing: Vec<Value> = self.missing.iter().map(missing).collect();
        json!({ "error": { "message": self.message, "help": self.help, "missing": missing, "columns": self.columns } })
    }
}

/// An option, and of a column what it would be and which one it may be.
fn missing(option: &MissingOption) -> Value {
    let (quantity, rest) = option.value.split_once('=').map_or((None, ""), |(quantity, rest)| (Some(quantity), rest));
    let header = rest.rsplit_once(':').map(|(header, _)| header).filter(|header| *header != "HEADER");
    json!({ "option": option.name.trim_start_matches("--"), "quantity": quantity, "header": header })
}

impl From<OptionsFault> for Fault {
    fn from(OptionsFault { message, help, missing }: OptionsFault) -> Self {
        Self { message, help, missing, columns: Vec::new() }
    }
}

impl From<miette::Report> for Fault {
    fn from(report: miette::Report) -> Self {
        let help = report.help().map(|help| help.to_string()).unwrap_or_default();
        let chain: Vec<String> = report.chain().map(|error| error.to_string()).collect();
        Self::new(chain.join(": "), help)
    }
}

impl From<FileError> for Fault {
    fn from(error: FileError) -> Self {
        miette::Report::from(error).into()
    }
}
