//! Options that do not go together, or with a log.

use super::{ImportOptions, ImportSummary, MissingOption};

/// What is wrong with options, whatever the logs are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OptionsFault {
    /// What is wrong.
    pub message: String,
    /// What to do about it.
    pub help: String,
    /// What is missing.
    pub missing: Vec<MissingOption>,
}

impl ImportOptions {
    /// Refuses options that do not go together, whatever the logs are.
    ///
    /// # Errors
    /// Where two columns are stated of one quantity or the other way round, or a period without what repeats and the other way round.
    pub fn check(&self) -> Result<(), OptionsFault> {
        let fault = |message: String, help: &str, missing: &[MissingOption]| {
            Err(OptionsFault { message, help: help.to_owned(), missing: missing.to_vec() })
        };
        for (index, choice) in self.columns.iter().enumerate() {
            for other in &self.columns[..index] {
                if choice.quantity == other.quantity {
                    let message = format!("--column says twice which column is the {}", choice.quantity.name());
                    return fault(message, "leave one of the two out", &[]);
                }
                if choice.header == other.header {
                    let (one, two) = (other.quantity.name(), choice.quantity.name());
                    let message = format!("--column says that `{}` is both the {one} and the {two}", choice.header);
                    return fault(message, "leave one of the two out", &[]);
                }
            }
        }
        match (self.excitation.filter(|excitation| excitation.is_periodic()), self.period_s) {
            (Some(excitation), None) => fault(
                format!("--excitation {} needs --period", excitation.name()),
                "say after how many seconds the command repeats",
                &[MissingOption::period()],
            ),
            (None, Some(_)) => fault(
                "--period goes with --excitation multisine, square or triangle alone".to_owned(),
                "leave --period out, or say which of them the command is",
                &[],
            ),
            _ => Ok(()),
        }
    }

    /// The first option that a log has no use for, and why.
    #[must_use]
    pub fn unused_in(&self, log: &ImportSummary) -> Option<(&'static str, &'static str)> {
        let format = log.format;
        let no_table = "it is no table of text";
        [
            (self.motor.is_some() && !log.has_motors, "--motor", "it has one motor, and no column that says which"),
            (self.log.is_some() && !format.has_several_logs, "--log", "it is of a format that has one log in a file"),
            (
                self.esc_signal_us.is_some() && !log.pulse_widths,
                "--pulse-us",
                "its command is a duty already, no pulse width",
            ),
            (!self.columns.is_empty() && !format.has_stated_columns, "--column", no_table),
            (self.rate_hz.is_some() && !format.has_stated_columns, "--rate", "its rows have times"),
            (self.motor_poles.is_some() && !log.is_electrical, "--motor-poles", "its speed is the rotor's already"),
        ]
        .into_iter()
        .find_map(|(is_unused, option, reason)| is_unused.then_some((option, reason)))
    }
}
