//! Why nothing can be compared.

use miette::Diagnostic;
use rotorlead_identify::error::IdentifyError;
use rotorlead_identify::lag::steps::StepsError;
use rotorlead_plant::{ModelError, PlantError};
use rotorlead_records::RecordError;
use rotorlead_records::files::did_you_mean;
use thiserror::Error;

/// Data or a model from which no diagnosis follows.
#[derive(Clone, Debug, PartialEq, Error, Diagnostic)]
pub enum DiagnoseError {
    /// No record that can be compared.
    #[error("{experiment}: no record can be compared{}", reason.map(|reason| format!(": {reason}")).unwrap_or_default())]
    #[diagnostic(help(
        "record a multisine (`rotorlead excite` designs one), or hold each level of a staircase for at least a second, above the \
         command at which the motor starts"
    ))]
    NothingToCompare {
        /// The experiment's name.
        experiment: String,
        /// Why the first of them cannot; `None` where there is none.
        reason: Option<&'static str>,
    },
    /// A nominal command has no record that may be fitted.
    #[error("nominal command {nominal}: every record has role = \"validate\"")]
    #[diagnostic(help("give one of its records role = \"fit\" in experiment.toml, or take them out"))]
    NominalWithoutFit {
        /// The nominal command.
        nominal: f64,
    },
    /// The given model has effects already.
    #[error("the model has `{kind}` as an effect, and is to be judged as a lag")]
    #[diagnostic(help(
        "take its [[effect]] tables out, or leave --model out: effects are found anew from the records"
    ))]
    ModelHasEffects {
        /// The first of them.
        kind: String,
    },
    /// A model that lets everything pass has no bandwidth.
    #[error("the model has no {column} bandwidth at u_nom {nominal}: nothing is 3 dB down up to {limit_rad_s} rad/s")]
    #[diagnostic(help("check the time constants of the model's points: they are in seconds"))]
    NoBandwidth {
        /// The nominal command.
        nominal: f64,
        /// Which bandwidth.
        column: &'static str,
        /// How far it was searched.
        limit_rad_s: f64,
    },
    /// There is no explanation of that name.
    #[error("no explanation of these bandwidths is called `{name}`")]
    #[diagnostic(help("{}", explanations(name, known)))]
    NoSuchExplanation {
        /// The name.
        name: String,
        /// Those that there are.
        known: Vec<String>,
    },
    /// A model has no form for an explanation.
    #[error("`{explanation}` cannot be written as a model: {reason}")]
    #[diagnostic(help("leave --out-model out, or take another explanation with --take"))]
    NotInAModel {
        /// Its name.
        explanation: String,
        /// Why.
        reason: &'static str,
    },
    /// A record of steps has none.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Steps(#[from] StepsError),
    /// A record is not what it says.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Record(#[from] RecordError),
    /// The first model cannot be identified.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Identify(#[from] IdentifyError),
    /// The given model says nothing of a nominal command.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Model(#[from] ModelError),
    /// The given model cannot be simulated.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Plant(#[from] PlantError),
    /// Model and records are not of the same thing.
    #[error(
        "the model misses the response by {percent:.2e} % of its own RMS about its mean, expected less than 100 % or so"
    )]
    #[diagnostic(help(
        "check that the command is 0 to 1 and the response in N or rpm (`rotorlead check DIR` shows both), and that a model given \
         with --model is of this motor"
    ))]
    NoComparison {
        /// The gap.
        percent: f64,
    },
    /// The search found no value at which the model can be simulated.
    #[error("the model of {what} cannot be compared with these records")]
    #[diagnostic(help(
        "check the records' units, and the nominal commands of a model given with --model against theirs"
    ))]
    NoFit {
        /// Which model.
        what: &'static str,
    },
}

/// Those that there are, the one that may have been meant first.
fn explanations(name: &str, known: &[String]) -> String {
    if known.is_empty() {
        return "none was found".to_owned();
    }
    let meant = did_you_mean(name, known.iter().map(String::as_str)).map(|question| question + " ");
    format!("{}there are `{}`", meant.unwrap_or_default(), known.join("`, `"))
}
