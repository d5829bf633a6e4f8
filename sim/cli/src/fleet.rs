//! `rotorlead fleet`

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use rotorlead_answer::{Report, Tone, Verdict};
use rotorlead_identify::fleet::{Comparison, Drift, Log, LogPoint, Quantity, compare, share};
use rotorlead_plant::Model;
use rotorlead_records::files::FileError;
use rotorlead_records::{FleetList, FleetLog, Output};
use rotorlead_results::{FleetRow, fleet_section, logs_table, motors_table, usual_table};
use serde::{Deserialize, Serialize};

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
    report: ReportOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

/// A log, read.
struct Read {
    row: FleetRow,
    log: Log,
    output: Option<Output>,
}

impl Fleet {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        self.report.check()?;
        let list = FleetList::read(&self.fleet)?;
        let read: Vec<Read> = list.logs.iter().map(|log| read(&self.fleet, log)).collect();
        let output = common_output(&read)?;
        let (rows, logs): (Vec<FleetRow>, Vec<Log>) = read.into_iter().map(|read| (read.row, read.log)).unzip();
        let [time_constants, gains] = [Quantity::TimeConstant, Quantity::Gain].map(|quantity| compare(&logs, quantity));
        let (time_constants, gains) = (time_constants.map_err(self.few(&logs))?, gains.map_err(self.few(&logs))?);

        let values = Values::of(&rows, &logs, &time_constants, &gains);
        let verdict = verdict(&values);
        let mut text = String::new();
        for table in [usual_table(&time_constants, &gains, output), motors_table(&time_constants, &gains)] {
            writeln!(text, "{}", table.text()).expect("a string takes all");
        }
        let noted = rotorlead_answer::Table {
            rows: noted(&rows, &time_constants, &gains),
            ..logs_table(&rows, &time_constants, &gains)
        };
        if !noted.rows.is_empty() {
            writeln!(text, "{}", noted.text()).expect("a string takes all");
        }
        writeln!(text, "{}", verdict.headline).expect("a string takes all");
        text.push_str(&self.report.write(|| Report {
            facts: vec![report_pages::file("Fleet", &self.fleet)],
            sections: vec![fleet_section(&rows, &time_constants, &gains, output)],
            ..report_pages::report("Fleet", format!("{} logs", rows.len()), verdict.clone())
        })?);
        let detail = logs_table(&rows, &time_constants, &gains).text();
        Ok(Outcome::new(text, &values).with_detail(detail))
    }

    fn few<E: std::error::Error + Send + Sync + 'static>(&self, logs: &[Log]) -> impl Fn(E) -> miette::Report {
        let with_model = logs.iter().filter(|log| !log.points.is_empty()).count();
        let (fleet, count) = (self.fleet.display().to_string(), logs.len());
        move |error| {
            miette::miette!(
                help = "identify each log first: rotorlead identify DIR/LOG --out DIR/LOG/model.toml",
                "`{fleet}`: {error}; {with_model} of its {count} logs have a {MODEL}"
            )
        }
    }
}

/// Reads what was found of a log. One without a model has no points, and a file that is damaged is said in its note: the others go
/// on.
fn read(fleet: &Path, listed: &FleetLog) -> Read {
    let folder = listed.path(fleet);
    let mut notes = Vec::new();
    let (mut points, mut output) = (Vec::new(), None);
    match Model::read_with_map_alone(&folder.join(MODEL)) {
        Ok(model) => {
            points.extend(model.points.iter().filter(|point| point.gain != 0.0).map(|point| LogPoint {
                nominal: point.nominal,
                time_constant_s: point.time_constant_s,
                gain: point.gain,
            }));
            if model.points.is_empty() {
                notes.push(format!("{MODEL} has a static map, and no lag"));
            }
            output = model.provenance.map(|provenance| provenance.output);
        }
        Err(FileError::Missing { .. }) => notes.push(format!("not identified: no {MODEL}")),
        Err(error) => notes.push(format!("{MODEL} is no model: {error}")),
    }
    notes.extend(diagnosis(&folder.join(DIAGNOSIS)));
    Read {
        row: FleetRow {
            log: listed.folder.clone(),
            motor: listed.motor.clone(),
            date: listed.date.map_or_else(String::new, |date| date.to_string()),
            note: notes.join(", "),
        },
        log: Log { motor: listed.motor.clone(), day: listed.day(), points },
        output,
    }
}

/// What a diagnosis said, of all that it wrote.
#[derive(Deserialize)]
struct Diagnosed {
    verdict: String,
    effects: Vec<Effect>,
}

#[derive(Deserialize)]
struct Effect {
    kind: String,
}

/// The diagnosis in a word or two; `None` where there is none, or nothing to say.
fn diagnosis(path: &Path) -> Option<String> {
    let text = match std::fs::read(path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return None,
        Err(error) => return Some(format!("{DIAGNOSIS} cannot be read: {error}")),
    };
    let Ok(found) = serde_json::from_slice::<Diagnosed>(&text) else {
        return Some(format!("{DIAGNOSIS} is not what `rotorlead diagnose --json` writes"));
    };
    let kinds: Vec<&str> = found.effects.iter().map(|effect| effect.kind.as_str()).collect();
    match (found.verdict.as_str(), kinds.as_slice()) {
        ("agrees", _) => None,
        (verdict, []) => Some(format!("diagnosis: {verdict}")),
        (verdict, kinds) => Some(format!("diagnosis: {verdict} {}", kinds.join(" + "))),
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

/// The rows of logs of which something is to be said.
fn noted(rows: &[FleetRow], time_constants: &Comparison, gains: &Comparison) -> Vec<Vec<rotorlead_answer::Cell>> {
    let all = logs_table(rows, time_constants, gains).rows;
    all.into_iter().filter(|cells| cells.last().is_some_and(|note| !note.text.is_empty())).collect()
}

fn verdict(values: &Values) -> Verdict {
    let motors = |wanted: fn(&Deviation) -> bool| {
        values
            .motors
            .iter()
            .filter(|motor| wanted(&motor.time_constant) || motor.gain.as_ref().is_some_and(wanted))
            .count()
    };
    let drifting = motors(|deviation| deviation.drifts);
    let outlying = motors(|deviation| deviation.stands_out);
    let logs = values.logs.iter().filter(|log| log.stands_out).count();
    let missing = values.logs.iter().filter(|log| log.time_constant_share.is_none()).count();
    let count = |count: usize, one: &str, many: &str| format!("{count} {}", if count == 1 { one } else { many });
    let mut said = vec![
        format!(
            "{} of {}: {}, {}",
            count(values.logs.len(), "log", "logs"),
            count(values.motors.len(), "motor", "motors"),
            count(outlying, "motor stands out", "motors stand out"),
            count(drifting, "drifts", "drift")
        ),
        count(logs, "log stands out", "logs stand out"),
    ];
    said.extend((missing > 0).then(|| count(missing, "log was not compared", "logs were not compared")));
    let tone = if outlying + drifting + logs + missing > 0 { Tone::Attention } else { Tone::Good };
    Verdict::new(tone, format!("{}.", said.join("; ")))
}

/// What came out, for programs. Shares are of the usual value: 0.05 is 5 % more.
#[derive(Serialize)]
struct Values {
    levels: Vec<Level>,
    motors: Vec<Motor>,
    logs: Vec<LogValues>,
}

#[derive(Serialize)]
struct Level {
    nominal: f64,
    time_constant_s: f64,
    gain: f64,
}

#[derive(Serialize)]
struct Motor {
    motor: String,
    logs: usize,
    time_constant: Deviation,
    gain: Option<Deviation>,
}

#[derive(Serialize)]
struct Deviation {
    share: f64,
    score: Option<f64>,
    stands_out: bool,
    drift_share_per_month: Option<f64>,
    drift_interval: Option<[f64; 2]>,
    drift_p_value: Option<f64>,
    drifts: bool,
}

#[derive(Serialize)]
struct LogValues {
    log: String,
    motor: String,
    date: Option<String>,
    time_constant_share: Option<f64>,
    time_constant_score: Option<f64>,
    gain_share: Option<f64>,
    gain_score: Option<f64>,
    stands_out: bool,
    note: Option<String>,
}

impl Values {
    fn of(rows: &[FleetRow], logs: &[Log], time_constants: &Comparison, gains: &Comparison) -> Self {
        let deviation = |found: &Comparison, name: &str| {
            found.motors.get(name).map(|motor| Deviation {
                share: share(motor.deviation),
                score: motor.score,
                stands_out: motor.stands_out(),
                drift_share_per_month: motor.drift.map(|drift: Drift| drift.per_month),
                drift_interval: motor.drift.map(|drift| drift.interval),
                drift_p_value: motor.drift.map(|drift| drift.p_value),
                drifts: motor.drifts,
            })
        };
        let of_log = |(index, row): (usize, &FleetRow)| {
            let [tau, gain] = [time_constants, gains].map(|found| found.logs[index]);
            let known = |text: &str| (!text.is_empty()).then(|| text.to_owned());
            LogValues {
                log: row.log.clone(),
                motor: row.motor.clone(),
                date: known(&row.date),
                time_constant_share: tau.map(|log| share(log.deviation)),
                time_constant_score: tau.and_then(|log| log.score),
                gain_share: gain.map(|log| share(log.deviation)),
                gain_score: gain.and_then(|log| log.score),
                stands_out: [tau, gain].into_iter().flatten().any(|log| log.stands_out()),
                note: known(&row.note),
            }
        };
        let level = |(&(nominal, time_constant_s), &(_, gain)): (&(f64, f64), &(f64, f64))| Level {
            nominal,
            time_constant_s,
            gain,
        };
        Self {
            levels: time_constants.levels.iter().zip(&gains.levels).map(level).collect(),
            motors: time_constants
                .motors
                .iter()
                .filter_map(|(name, motor)| {
                    Some(Motor {
                        motor: name.clone(),
                        logs: motor.logs,
                        time_constant: deviation(time_constants, name)?,
                        gain: deviation(gains, name),
                    })
                })
                .collect(),
            logs: rows.iter().zip(logs).map(|(row, _)| row).enumerate().map(of_log).collect(),
        }
    }
}
