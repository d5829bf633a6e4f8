//! `rotorlead fleet`

use std::path::{Path, PathBuf};

use clap::Args;
use rotorlead_answer::Report;
use rotorlead_assess::fleet::{FleetMember, FleetParameter, compare};
use rotorlead_plant::Model;
use rotorlead_records::files::FileError;
use rotorlead_records::{FLEET_LIST, FleetList, FleetLog, Output};
use rotorlead_results::{EscRampValues, FleetRow, fleet_answer};
use serde::Deserialize;

use super::outcome::{JsonOption, Outcome};
use super::report_option::ReportOption;
use super::report_pages;

/// What `rotorlead identify --out` wrote beside a log.
pub(super) const MODEL: &str = "model.toml";
/// What `rotorlead diagnose --json` wrote beside a log.
pub(super) const DIAGNOSIS: &str = "diagnose.json";

/// Compares many logs: each motor with the others, each log with its motor's, and over months
///
/// DIR has `fleet.csv`, a row for each log with its folder, motor and date, and in each folder the `model.toml` that `rotorlead
/// identify` made of it, and where it was diagnosed `diagnose.json`. A log without a model is listed, and not compared. Each log is
/// identified by itself, so that runs of many go to whatever runs many things: docs/fleet.md shows some.
#[derive(Args, Debug)]
pub struct Fleet {
    /// The fleet's folder
    #[arg(value_name = "DIR")]
    fleet: PathBuf,
    #[command(flatten)]
    pub(super) report: ReportOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

/// A log, read.
struct Read {
    row: FleetRow,
    log: FleetMember,
    output: Option<Output>,
}

impl Fleet {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        self.report.check()?;
        if self.fleet.exists() && !self.fleet.join(FLEET_LIST).is_file() {
            return Err(miette::miette!(
                help = "rotorlead import LOG... --fleet --out DIR makes such a folder of logs; docs/fleet.md says what it holds",
                "`{}` is no folder of a fleet: there is no {FLEET_LIST} in it",
                self.fleet.display()
            ));
        }
        let list = FleetList::read(&self.fleet)?;
        let read: Vec<Read> = list.logs.iter().map(|log| read(&self.fleet, log)).collect();
        let output = common_output(&read)?;
        let (rows, logs): (Vec<FleetRow>, Vec<FleetMember>) = read.into_iter().map(|read| (read.row, read.log)).unzip();
        let [time_constants, gains] =
            [FleetParameter::TimeConstant, FleetParameter::Gain].map(|quantity| compare(&logs, quantity));
        let (time_constants, gains) = (time_constants.map_err(self.few(&logs))?, gains.map_err(self.few(&logs))?);

        let answer = fleet_answer(&rows, &time_constants, &gains, output);
        let written = self.report.write(|| Report {
            facts: vec![report_pages::file("Fleet", &self.fleet)],
            ..report_pages::answer_page("Fleet", format!("{} logs", rows.len()), &answer)
        })?;
        Ok(Outcome::from_answer(&answer, &written))
    }

    fn few<E: std::error::Error + Send + Sync + 'static>(&self, logs: &[FleetMember]) -> impl Fn(E) -> miette::Report {
        let with_model = logs.iter().filter(|log| !log.points.is_empty()).count();
        let (fleet, count) = (self.fleet.display().to_string(), logs.len());
        let help = if with_model < count {
            "identify each log first: rotorlead identify DIR/LOG --out DIR/LOG/model.toml"
        } else {
            "a fleet is three logs or more that share commands; two are compared by rotorlead compare A B"
        };
        move |error| miette::miette!(help = help, "`{fleet}`: {error}; {with_model} of its {count} logs have a {MODEL}")
    }
}

/// Reads what was found of a log. One without a model has no points, and a file that is damaged is said in its note: the others go
/// on.
fn read(fleet: &Path, listed: &FleetLog) -> Read {
    let folder = listed.path(fleet);
    let mut notes = Vec::new();
    let mut log = FleetMember { motor: listed.motor.clone(), day: listed.day(), points: Vec::new() };
    let mut output = None;
    match Model::read_with_map_alone(&folder.join(MODEL)) {
        Ok(model) => {
            log = FleetMember::new(log.motor, log.day, &model);
            if model.points.is_empty() {
                notes.push(format!("{MODEL} has a static map, and no lag"));
            }
            output = model.provenance.map(|provenance| provenance.output);
        }
        Err(FileError::Missing { .. }) => notes.push(format!("not identified: no {MODEL}")),
        Err(error) => notes.push(format!("{MODEL} is no model: {error}")),
    }
    let diagnosed = diagnosis(&folder.join(DIAGNOSIS));
    let esc_ramp = diagnosed.as_ref().ok().and_then(|found| found.as_ref()?.esc_ramp);
    notes.extend(diagnosed.map_or_else(Some, |found| found.and_then(|found| found.in_short())));
    Read {
        row: FleetRow {
            log: listed.folder.clone(),
            motor: listed.motor.clone(),
            date: listed.date.map_or_else(String::new, |date| date.to_string()),
            note: notes.join(", "),
            esc_ramp,
        },
        log,
        output,
    }
}

/// What a diagnosis said, of all that it wrote.
#[derive(Deserialize)]
struct Diagnosed {
    verdict: String,
    effects: Vec<Effect>,
    #[serde(default)]
    esc_ramp: Option<EscRampValues>,
}

#[derive(Deserialize)]
struct Effect {
    kind: String,
}

/// The diagnosis of a log; `None` where there is none.
///
/// # Errors
/// Why it cannot be read.
fn diagnosis(path: &Path) -> Result<Option<Diagnosed>, String> {
    let text = match std::fs::read(path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(format!("{DIAGNOSIS} cannot be read: {error}")),
    };
    let found = serde_json::from_slice::<Diagnosed>(&text).ok();
    let found = found.filter(|found| found.esc_ramp.is_none_or(EscRampValues::is_possible));
    found.map(Some).ok_or_else(|| format!("{DIAGNOSIS} is not what `rotorlead diagnose --json` writes"))
}

impl Diagnosed {
    /// In a word or two; `None` where there is nothing to say.
    fn in_short(&self) -> Option<String> {
        let kinds: Vec<&str> = self.effects.iter().map(|effect| effect.kind.as_str()).collect();
        match (self.verdict.as_str(), kinds.as_slice()) {
            ("agrees", _) => None,
            (verdict, []) => Some(format!("diagnosis: {verdict}")),
            (verdict, kinds) => Some(format!("diagnosis: {verdict} {}", kinds.join(" + "))),
        }
    }
}

/// The response of all logs, as far as their models say it: gains of thrust and of speed are not compared.
fn common_output(read: &[Read]) -> miette::Result<Option<Output>> {
    let first = |output| read.iter().find(|read| read.output == Some(output));
    if let (Some(thrust), Some(speed)) = (first(Output::ThrustN), first(Output::Rpm)) {
        return Err(miette::miette!(
            help = "list logs of thrust and logs of speed in folders of their own",
            "the response of `{}` is thrust, and that of `{}` speed: their gains cannot be compared",
            thrust.row.log,
            speed.row.log
        ));
    }
    Ok(read.iter().find_map(|read| read.output))
}
