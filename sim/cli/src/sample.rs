//! `rotorlead sample`

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use rotorlead_answer::words::paragraph;
use rotorlead_records::files::{check_writable, write_file};
use rotorlead_records::import::shell_word;
use serde_json::json;

use super::outcome::{JsonOption, Outcome};
use super::replacement::{self, Typed, written_to};

/// Writes a log to try the program on, or lists those that it has
///
/// The logs are in this program. All are made up: those of the thrust stand are simulated, that of the autopilot is written by a
/// script, as ArduPilot writes such logs.
#[derive(Args, Debug)]
pub struct Sample {
    /// The log; all are listed unless given
    #[arg(value_name = "NAME")]
    log: Option<SampleLog>,
    /// Where it goes; into the current folder under its own name unless given
    #[arg(long, value_name = "FILE", requires = "log")]
    out: Option<PathBuf>,
    #[arg(from_global)]
    force: bool,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

/// A log that is in the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum SampleLog {
    /// A staircase of the throttle on a thrust stand, simulated: all that a log alone can tell
    #[value(name = "staircase.csv", alias = "staircase")]
    Staircase,
    /// A second run of that motor, simulated: held out of the fit, it turns "measure again" into "ready"
    #[value(name = "second-run.csv", alias = "second-run")]
    SecondRun,
    /// The same motor behind an ESC with a setting that nobody knows of, simulated: for the diagnosis to find
    #[value(name = "hidden.csv", alias = "hidden")]
    Hidden,
    /// A chirp as ArduPilot logs it, made up: a model without a thrust stand
    #[value(name = "chirp.bin", alias = "chirp")]
    Chirp,
}

impl SampleLog {
    /// The file.
    fn bytes(self) -> &'static [u8] {
        match self {
            Self::Staircase => include_bytes!("../samples/staircase.csv"),
            Self::SecondRun => include_bytes!("../samples/second-run.csv"),
            Self::Hidden => include_bytes!("../samples/hidden.csv"),
            Self::Chirp => include_bytes!("../samples/chirp.bin"),
        }
    }

    /// What to do with it, where it lies in the current folder.
    fn commands(self) -> &'static [&'static str] {
        match self {
            Self::Staircase => &["rotorlead report staircase.csv --open"],
            Self::SecondRun => {
                // The first run is the sample above.
                &[
                    "rotorlead sample staircase.csv",
                    "rotorlead import staircase.csv --out stand",
                    "rotorlead import second-run.csv --append --role validate --out stand",
                    "rotorlead identify stand",
                ]
            }
            Self::Hidden => &["rotorlead report hidden.csv --open"],
            Self::Chirp => &["rotorlead identify chirp.bin"],
        }
    }

    fn name(self) -> String {
        self.to_possible_value().expect("none is skipped").get_name().to_owned()
    }

    /// What it is good for.
    fn purpose(self) -> String {
        self.to_possible_value().expect("none is skipped").get_help().map(ToString::to_string).unwrap_or_default()
    }

    /// Whether a file is one of them, so that nothing is lost with it.
    pub(super) fn is_one(path: &Path) -> bool {
        let largest = Self::value_variants().iter().map(|log| log.bytes().len() as u64).max();
        // A log of gigabytes is not read for that.
        path.metadata().is_ok_and(|file| Some(file.len()) <= largest)
            && std::fs::read(path).is_ok_and(|found| Self::value_variants().iter().any(|log| log.bytes() == found))
    }
}

impl Sample {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        self.log.map_or_else(|| Ok(list()), |log| self.write(log))
    }

    fn write(&self, log: SampleLog) -> miette::Result<Outcome> {
        let own_name = PathBuf::from(log.name());
        let out = self.out.as_ref().unwrap_or(&own_name);
        if self.out.is_none() && !self.force {
            replacement::check(out, "--out", Typed::Nothing, ("sample", "out"))?;
        }
        check_writable(out)?;
        let written = written_to(out);
        write_file(out, log.bytes())?;
        let called = shell_word(&out.to_string_lossy()).into_owned();
        let commands: Vec<String> =
            log.commands().iter().map(|command| command.replace(&log.name(), &called)).collect();
        let text = format!("{written}\n\nTo go on:\n\n  {}\n", commands.join("\n  "));
        Ok(Outcome::new(text, &json!({ "name": log.name(), "out": out, "commands": commands })))
    }
}

/// What there is.
fn list() -> Outcome {
    let logs = SampleLog::value_variants();
    let mut text = String::new();
    for log in logs {
        let _ = write!(text, "{}\n{}", log.name(), paragraph(&format!("  {}", log.purpose()), "  "));
    }
    text.push_str("\nTo write one: rotorlead sample staircase.csv\n");
    let json: Vec<_> = logs
        .iter()
        .map(|log| json!({ "name": log.name(), "purpose": log.purpose(), "bytes": log.bytes().len(), "commands": log.commands() }))
        .collect();
    Outcome::new(text, &json!({ "samples": json }))
}
