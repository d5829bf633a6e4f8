//! `rotorlead device tune`: from the motors of a vehicle to their compensator, without a stand.

use std::io::BufRead;
use std::path::{Path, PathBuf};

use clap::Args;
use rotorlead_answer::words::warning;
use rotorlead_device::{Header, Keeper, Sensors, Session};
use rotorlead_records::files::{AcceptedRange, OutputFolder};
use rotorlead_tune::{Operator, OptionsFault, TuneOptions, Tuning, is_yes};

use super::excite::{PlayBar, PlayedArguments};
use super::folder::ExperimentFolder;
use super::record::Sensor;
use crate::UsageError;
use crate::outcome::Outcome;
use crate::parameters::{KindName, PurposeOption, number};

#[derive(Args, Debug)]
pub(super) struct Tune {
    /// The folder that is made: of each motor its records, its model and its compensator
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// The motors, from 0; one after the other
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', default_value = "0,1,2,3")]
    motors: Vec<u8>,
    /// Commands around which to play, from the lowest on: those of a flight
    #[arg(long, value_name = "U,U,...", value_delimiter = ',', required = true, value_parser = number(AcceptedRange::DUTY))]
    nominal: Vec<f64>,
    /// The speed that no motor may reach, revolutions per minute: by its maker's table, with its propeller, at the highest of the commands,
    /// and a tenth more. Beyond it all stops
    #[arg(long, value_name = "RPM", value_parser = number(AcceptedRange::NUMBER), requires = "motor_poles", required_unless_present = "newtons_per_count")]
    most_rpm: Option<f64>,
    #[command(flatten)]
    played: PlayedArguments,
    #[command(flatten)]
    sensor: Sensor,
    /// The compensator; what is recommended for the purpose unless given
    #[arg(long, value_enum)]
    kind: Option<KindName>,
    #[command(flatten)]
    purpose: PurposeOption,
    /// Have the inverse go by the ESCs' replies in flight (`compensator rpm`): battery and propeller then change the speed no more. Of two
    /// commands or more
    #[arg(long, requires = "motor_poles")]
    rpm: bool,
    /// Also take motors that were judged as ready within limits; the limits are shown before anything is set
    #[arg(long)]
    accept_limits: bool,
    /// Answer every question with yes, for a script that has seen to it
    #[arg(long)]
    yes: bool,
}

impl Tune {
    pub(super) fn run(&self, session: &mut Session) -> miette::Result<Outcome> {
        let options = TuneOptions {
            motors: self.motors.clone(),
            nominal: self.nominal.clone(),
            signal: self.played.signal(),
            sensors: Sensors { most_rpm: self.most_rpm, ..self.sensor.unchecked() },
            kind: self.kind.map(KindName::kind),
            purpose: self.purpose.purpose(),
            rpm: self.rpm,
            accept_limits: self.accept_limits,
        };
        options.levels().map_err(|OptionsFault { message, help }| UsageError { message, help })?;
        let mut terminal = Terminal { out: &self.out, yes: self.yes, bar: PlayBar::default() };
        let Tuning { summary, warnings, json } = options.tune(session, &mut terminal)?;
        // It was shown before a question that was asked.
        let mut text = if self.yes { summary } else { String::new() };
        text.extend(warnings.iter().map(|sentence| warning(sentence)));
        text += &format!("Set and saved. Take the jumper out before a flight.\nWritten to {}\n", self.out.display());
        Ok(Outcome::new(text, &json))
    }
}

/// Somebody at a terminal, and a folder.
struct Terminal<'a> {
    out: &'a Path,
    /// Whether every question is answered with yes.
    yes: bool,
    bar: PlayBar,
}

impl Operator for Terminal<'_> {
    fn announce(&mut self, what: &str) {
        eprintln!("{what}");
    }

    fn propose(&mut self, summary: &str) {
        if !self.yes {
            eprint!("{summary}");
        }
    }

    fn is_confirmed(&mut self, question: &str) -> bool {
        self.yes || is_confirmed(question, &mut std::io::stdin().lock(), &mut std::io::stderr())
    }

    fn prepare(&mut self) -> miette::Result<String> {
        OutputFolder::create(self.out)?.commit()?;
        Ok(self.out.display().to_string())
    }

    fn keeper(&mut self, motor: u8, header: Header) -> miette::Result<Box<dyn Keeper>> {
        Ok(Box::new(ExperimentFolder::new(&self.out.join(format!("motor{motor}")), header)?))
    }

    fn playing(&self, _motor: u8, _nominal: f64, rows: usize, total: usize) {
        self.bar.show(rows, total);
    }
}

/// Whether the answer to a question is yes, in full.
fn is_confirmed(question: &str, answers: &mut impl BufRead, out: &mut impl std::io::Write) -> bool {
    let mut answer = String::new();
    let is_asked = write!(out, "{question} Type yes: ").and_then(|()| out.flush()).is_ok();
    is_asked && answers.read_line(&mut answer).is_ok() && is_yes(&answer)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_question_says_what_to_type() {
        for (answer, is_confirmed_by) in [("yes\n", true), ("y\n", false), ("", false)] {
            let mut out = Vec::new();
            assert_eq!(is_confirmed("Is it?", &mut answer.as_bytes(), &mut out), is_confirmed_by, "{answer:?}");
            assert_eq!(String::from_utf8(out).unwrap(), "Is it? Type yes: ");
        }
    }
}
