//! What ends the tuning.

use miette::Diagnostic;
use rotorlead::settings::Key;
use rotorlead_plant::Judgement;
use thiserror::Error;

/// Options that no motor can be tuned with.
#[derive(Clone, Debug, Error, Diagnostic, PartialEq, Eq)]
#[error("{message}")]
#[diagnostic(help("{help}"))]
pub struct OptionsFault {
    /// What is wrong, with the options as the command line calls them.
    pub message: String,
    /// What to do about it.
    pub help: String,
}

impl OptionsFault {
    pub(super) fn new(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { message: message.into(), help: help.into() }
    }
}

/// What ends the tuning.
#[derive(Debug, Error, Diagnostic)]
pub(super) enum TuneError {
    /// A question was not answered with yes.
    #[error("{question} was not answered with yes")]
    #[diagnostic(help("{done}"))]
    NotConfirmed { question: &'static str, done: &'static str },
    /// Motors would turn too fast.
    #[error(
        "motor {motor} turns at {rpm:.0} rpm at {nominal}, and by that at {expected:.0} at {next}: --most-rpm allows {most_rpm:.0}"
    )]
    #[diagnostic(help(
        "is its propeller on, and --motor-poles the number of its magnets? Else leave the higher commands out"
    ))]
    WouldBeTooFast { motor: u8, rpm: f64, nominal: f64, expected: f64, next: f64, most_rpm: f64 },
    /// Motors turn too slowly.
    #[error("motor {motor} turns at {rpm:.0} rpm at {nominal}, far from the {most_rpm:.0} of --most-rpm")]
    #[diagnostic(help(
        "is --motor-poles the number of its magnets? Else give --most-rpm by what the motor reaches at {nominal}"
    ))]
    TooSlow { motor: u8, rpm: f64, nominal: f64, most_rpm: f64 },
    /// Motors that have a compensator in their path already.
    #[error("motor {motor} has a compensator in its path{}", if *is_tuned { ", through which it would be measured" } else { ", and is not among --motors: all share one kind and its parameters" })]
    #[diagnostic(help("`rotorlead device set motor.{motor}.{compensate} false` takes it out: tuning puts in what it finds", compensate = Key::Compensate.name()))]
    HasCompensator { motor: usize, is_tuned: bool },
    /// The records allow no compensator.
    #[error("motor {motor} was judged, as {judgement}: no setting was changed")]
    #[diagnostic(help("its records are in `{folder}`: `rotorlead report` shows them"))]
    NotReady { motor: u8, judgement: Judgement, folder: String },
    /// Speeds that make no curve.
    #[error("the speeds of motor {motor} correct nothing: {reason}; no setting was changed")]
    #[diagnostic(help("give more commands with --nominal, or leave --rpm out"))]
    NoSpeeds { motor: u8, reason: String },
    /// A lead has no gain to correct.
    #[error("a lead is recommended, and --rpm corrects an inverse: no setting was changed")]
    #[diagnostic(help("--kind inverse, or leave --rpm out; the records are in `{folder}`"))]
    NoInverse { folder: String },
    /// Motors that are unlike each other.
    #[error("a lead is recommended for some of the motors, and an inverse for others")]
    #[diagnostic(help("choose one with --kind; the records are in `{folder}`"))]
    Mixed { folder: String },
}
