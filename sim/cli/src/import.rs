//! `rotorlead import`

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser as _};
use miette::{Diagnostic as _, miette};
use rotorlead_answer::{Cell, Column, Table};
use rotorlead_identify::check::of_record;
use rotorlead_records::files::{FileError, Quantity};
use rotorlead_records::import::{
    ColumnChoice, ColumnUse, Import as Taken, ImportError, ImportOptions, ImportSummary, LogFormat, import,
};
use rotorlead_records::{Excitation, Experiment, Finding, Output};
use serde_json::json;

use super::WrongUse;
use super::check::words;
use super::outcome::{JsonOption, Outcome};
use super::parameters::{number, range};
use super::progress;
use rotorlead_answer::words::wrapped;

/// Takes logs of other tools as an experiment
///
/// Reads any table of numbers as text, with commas, semicolons, tabs or blanks between its columns; RCbenchmark (Tyto) thrust-stand
/// logs; the logs of the AutoQuad ESC32; MATLAB files of named vectors (time, command, thrust or rpm); PX4 ULog; ArduPilot
/// DataFlash (.bin), with the chirps of its actuator chirp applet; and Betaflight blackbox. The format is recognized by the content. Each log becomes one record. Shows every column of a log and which of
/// them were taken.
///
/// The columns of a table are recognized by names that say quantity and unit, such as `time_ms`, `Throttle (%)`, `thrust [g]` or
/// `rpm`; where they do not, --column says it. One unit is guessed, and said to be: that of a command whose numbers can be DShot's
/// alone. What a table cannot say either is what drove the command: --excitation says that. Several logs of one kind of run are
/// given at once, others are added with --append.
///
/// A flight is refused: where the commands of several motors move, each in its own way, a controller answers what the motors do.
///
/// A table of steady points, one in each row, becomes a record of the excitation `steady`: it gives a static map and no lag.
#[derive(Args, Debug)]
pub struct Import {
    /// The logs, each of which becomes a record
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// The experiment's folder, which is made
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// Add to the experiment in DIR, where there is one already
    #[arg(long)]
    append: bool,
    /// What to call the experiment; unless given, the log's file name, and of several logs the folder's
    #[arg(long, conflicts_with = "append")]
    name: Option<String>,
    /// What a column is: QUANTITY is time (UNIT s, ms, us or clock: hh:mm:ss), command (us, percent, dshot or duty), thrust (N, gf,
    /// kgf, lbf or ozf), rpm (rpm, rev/s or rad/s), voltage (V, mV) or current (A, mA); as in --column time=t:ms. A minus before
    /// the unit turns the sign: thrust=load:-gf. Rows in which such a column is blank are left out. May be given once for each
    /// quantity
    #[arg(long, value_name = "QUANTITY=HEADER:UNIT")]
    column: Vec<ColumnChoice>,
    /// The command was logged apart, on another clock: take the log without it. `rotorlead identify --align` merges the two
    #[arg(long, conflicts_with_all = ["pulse_us", "append"])]
    no_command: bool,
    /// Which of the two is the response, where a log has both; the summary says which it is and why
    #[arg(long, value_name = "RESPONSE", value_parser = outputs())]
    output: Option<Output>,
    /// Subtract the mean thrust at rest, of the rows at zero command before the run or else after it
    #[arg(long)]
    tare: bool,
    /// What drove the command; needed for a plain table, chirp for those of a DataFlash log and staircase for other logs unless given. `steady`: each row is a steady
    /// point of its own, as in a table of averages
    #[arg(long, value_name = "KIND", value_parser = excitations())]
    excitation: Option<Excitation>,
    /// Period of a multisine, square or triangle, in seconds
    #[arg(long, value_name = "SECONDS", value_parser = number(Quantity::DURATION_S), allow_negative_numbers = true)]
    period_s: Option<f64>,
    /// Command around which it was run, 0..1; found from the command's column unless given
    #[arg(long, value_name = "COMMAND", value_parser = number(Quantity::DUTY), allow_negative_numbers = true)]
    nominal: Option<f64>,
    /// How far the command goes to either side of it, 0..1; found from the command's column unless given
    #[arg(long, value_name = "COMMAND", value_parser = number(Quantity::AMPLITUDE), allow_negative_numbers = true)]
    amplitude: Option<f64>,
    /// Which part of the log to take, in seconds from its first row; all of it unless given
    #[arg(long, value_name = "FROM..TO", value_parser = seconds, allow_hyphen_values = true)]
    seconds: Option<(f64, f64)>,
    /// Pulse widths in microseconds that mean 0 and 1, where the log's command is a pulse width; 1000..2000 unless given, and of
    /// DataFlash what its parameters MOT_PWM_MIN and MOT_PWM_MAX say
    #[arg(long, value_name = "LOW..HIGH", value_parser = range(Quantity::PULSE_US), allow_hyphen_values = true)]
    pulse_us: Option<(f64, f64)>,
    /// Which motor to take of an autopilot's log, from 1; the first unless given, or the chirp of a DataFlash log that has one
    #[arg(long, value_name = "N")]
    motor: Option<usize>,
    /// Which log to take of a blackbox file that has several, or which chirp of a DataFlash log, from 1; the longest unless given
    #[arg(long, value_name = "N")]
    log: Option<usize>,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl Import {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        self.check()?;
        let mut is_added = self.append && Experiment::is_at(&self.out);
        if !self.append && Experiment::is_at(&self.out) {
            let help = "--append adds to the experiment in it; or give another folder: nothing is overwritten";
            return Err(miette!(help = help, "the folder `{}` exists and is not empty", self.out.display()));
        }
        let options = self.options();
        let mut logs = Vec::new();
        let bytes = |file: &PathBuf| file.metadata().map_or(0, |file| file.len());
        // To read and to write each take about as long.
        let bar = progress::estimate("importing", 2 * self.files.iter().map(bytes).sum::<u64>());
        for file in &self.files {
            let log = import(file, &options).map_err(wrong_use_or_log)?;
            self.check_options_of(file, &log.summary)?;
            logs.push(log);
            bar.inc(bytes(file));
        }
        let (mut experiment, summaries) = joined(logs)?;
        if let (None, [_, _, ..], Some(folder)) = (&self.name, &summaries[..], self.out.file_name()) {
            experiment.name = folder.to_string_lossy().into_owned();
        }
        // What else may be wrong is for `rotorlead check`, which sees all records together.
        // Of a log without its command that is after it is merged.
        let whole = experiment.records.iter().filter(|_| !self.no_command);
        let of_each = whole.flat_map(|record| of_record(&experiment, record, false));
        let findings: Vec<Finding> = of_each.filter(Finding::is_grave).collect();
        if !is_added && self.no_command {
            experiment.write_responses(&self.out)?;
        } else if !is_added {
            match experiment.write(&self.out) {
                // Another one that is to be added was faster to make the folder.
                Err(FileError::FolderInUse { .. }) if self.append && Experiment::is_at(&self.out) => is_added = true,
                written => written?,
            }
        }
        if is_added {
            experiment.with_rates_of(&self.out)?.append_to(&self.out)?;
        }
        bar.finish_and_clear();
        let mut text = summaries.iter().map(describe).collect::<Vec<_>>().join("\n");
        if !findings.is_empty() {
            text.push('\n');
            findings.iter().for_each(|finding| text.push_str(&words(finding)));
        }
        let done = if is_added { "Added to" } else { "Written to" };
        writeln!(text, "\n{done} {}", self.out.display()).expect("a string takes all");
        Ok(Outcome::new(text, &json!({ "folder": self.out, "logs": summaries, "findings": findings })))
    }

    fn options(&self) -> ImportOptions {
        ImportOptions {
            name: self.name.clone(),
            esc_signal_us: self.pulse_us,
            motor: self.motor,
            log: self.log,
            columns: self.column.clone(),
            output: self.output,
            without_command: self.no_command,
            tare: self.tare,
            seconds: self.seconds,
            excitation: self.excitation,
            period_s: self.period_s,
            nominal: self.nominal,
            amplitude: self.amplitude,
        }
    }

    /// Refuses options that do not go together, whatever the logs are.
    fn check(&self) -> Result<(), WrongUse> {
        for (index, choice) in self.column.iter().enumerate() {
            for other in &self.column[..index] {
                if choice.quantity == other.quantity {
                    let message = format!("--column says twice which column is the {}", choice.quantity.name());
                    return Err(WrongUse::new(message, "leave one of the two out"));
                }
                if choice.header == other.header {
                    let (one, two) = (other.quantity.name(), choice.quantity.name());
                    let message = format!("--column says that `{}` is both the {one} and the {two}", choice.header);
                    return Err(WrongUse::new(message, "leave one of the two out"));
                }
            }
        }
        let is_periodic = self.excitation.is_some_and(Excitation::is_periodic);
        match (self.excitation, self.period_s) {
            (Some(excitation), None) if is_periodic => Err(WrongUse::new(
                format!("--excitation {} needs --period-s", excitation.name()),
                "say after how many seconds the command repeats, as in --period-s 10",
            )),
            (_, Some(_)) if !is_periodic => Err(WrongUse::new(
                "--period-s goes with --excitation multisine, square or triangle alone",
                "leave --period-s out, or say which of them the command is",
            )),
            _ => Ok(()),
        }
    }

    /// Refuses options that the log has no use for.
    fn check_options_of(&self, file: &Path, log: &ImportSummary) -> Result<(), WrongUse> {
        let format = log.format;
        let refuse = |option: &str, reason: &str| {
            let message = format!("{option} does not go with `{}`: {reason}", file.display());
            Err(WrongUse::new(message, format!("leave {option} out")))
        };
        if self.motor.is_some() && !matches!(format, LogFormat::Ulog | LogFormat::Blackbox | LogFormat::DataFlash) {
            return refuse("--motor", "it is no autopilot's log");
        }
        if self.log.is_some() && !matches!(format, LogFormat::Blackbox | LogFormat::DataFlash) {
            return refuse("--log", "it is no blackbox file, and no DataFlash log");
        }
        if self.pulse_us.is_some() && !log.pulse_widths {
            return refuse("--pulse-us", "its command is a duty already, no pulse width");
        }
        if !self.column.is_empty() && !matches!(format, LogFormat::Plain | LogFormat::RcBenchmark) {
            return refuse("--column", "it is no table of text");
        }
        Ok(())
    }
}

/// What only an option can say is missing on the command line, not wrong with the log.
fn wrong_use_or_log(error: ImportError) -> miette::Report {
    let remedy = error.help().map(|help| help.to_string()).unwrap_or_default();
    match error {
        ImportError::NoExcitation { .. } | ImportError::NoPulseRange { .. } => {
            WrongUse::new(error.to_string(), remedy).into()
        }
        error => error.into(),
    }
}

/// The logs as one experiment.
fn joined(logs: Vec<Taken>) -> miette::Result<(Experiment, Vec<ImportSummary>)> {
    let (experiments, summaries): (Vec<Experiment>, Vec<ImportSummary>) =
        logs.into_iter().map(|log| (log.experiment, log.summary)).unzip();
    let mut whole: Option<Experiment> = None;
    for (experiment, summary) in experiments.into_iter().zip(&summaries) {
        let Some(whole) = &mut whole else {
            whole = Some(experiment);
            continue;
        };
        if experiment.output != whole.output {
            return Err(miette!(
                help = "choose one with --output, import them into different folders, or state with --column what is missing",
                "`{}` and `{}` do not have the same response: it is the thrust of one and the rpm of the other",
                summaries[0].file.display(),
                summary.file.display()
            ));
        }
        // Rates that are measured differ; each record's times say its own.
        if experiment.sample_rate_hz != whole.sample_rate_hz {
            whole.sample_rate_hz = None;
        }
        for record in experiment.records {
            if whole.records.iter().any(|other| other.file == record.file) {
                return Err(miette!(
                    help = "give one of the logs another name: a record is called as its log",
                    "two records would be called `{}`",
                    record.file
                ));
            }
            whole.records.push(record);
        }
    }
    let whole = whole.ok_or_else(|| WrongUse::new("no log is given", "give one or more"))?;
    Ok((whole, summaries))
}

/// Columns of a terminal that sentences keep to.
const WIDTH: usize = 80;

fn describe(summary: &ImportSummary) -> String {
    let mut text = String::new();
    let mut say = |line: String| {
        text.push_str(&line);
        text.push('\n');
    };
    say(format!("{}: {} of {} rows taken", summary.file.display(), summary.rows_taken, summary.rows_read));
    for dropped in &summary.dropped {
        let rows = if dropped.rows == 1 { "row" } else { "rows" };
        say(format!(
            "  {}",
            wrapped(&format!("{} {rows} left out: {}", dropped.rows, dropped.reason), WIDTH - 4, "    ")
        ));
    }
    let timing = &summary.timing;
    say(format!("  {}", wrapped(&format!("{:.1} rows/s; {}", timing.rate_hz, timing.method), WIDTH - 4, "    ")));
    if let (Some(rms), Some(max)) = (timing.residual_rms_s, timing.residual_max_s) {
        say(format!("  stamps are off the even grid by {:.1} ms RMS, {:.1} ms at most", 1e3 * rms, 1e3 * max));
    }
    if timing.rows_missing + timing.rows_reordered > 0 {
        say(format!("  {} rows missing, {} reordered", timing.rows_missing, timing.rows_reordered));
    }
    let row = |column: &ColumnUse| {
        [column.name.as_str(), column.taken_as.as_deref().unwrap_or("-"), &column.note].map(Cell::text).to_vec()
    };
    let columns = Table {
        name: "columns".to_owned(),
        caption: "Columns".to_owned(),
        columns: vec![
            Column::new("column", "column", ""),
            Column::new("taken_as", "taken as", ""),
            Column::new("remark", "remark", ""),
        ],
        rows: summary.columns.iter().map(row).collect(),
        ..Table::default()
    };
    say(format!("\n{}", columns.text().trim_end()));
    for note in &summary.notes {
        say(format!("\nnote: {}", wrapped(note, WIDTH - 6, "      ")));
    }
    text
}

/// [`range`] of seconds after a first row.
fn seconds(text: &str) -> Result<(f64, f64), String> {
    match range(Quantity::TIME_S)(text)? {
        (from, _) if from < 0.0 => Err(String::from("nothing is before the first row, which is at 0 seconds")),
        range => Ok(range),
    }
}

fn outputs() -> impl clap::builder::TypedValueParser<Value = Output> {
    PossibleValuesParser::new(["thrust", "rpm"])
        .map(|name| if name == "thrust" { Output::ThrustN } else { Output::Rpm })
}

fn excitations() -> impl clap::builder::TypedValueParser<Value = Excitation> {
    let named = |name: &str| Excitation::ALL.into_iter().find(|excitation| excitation.name() == name);
    PossibleValuesParser::new(Excitation::ALL.map(Excitation::name))
        .map(move |name| named(&name).expect("the parser knows these names alone"))
}
