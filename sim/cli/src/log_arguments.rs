//! What a log does not say of itself, and logs read with that.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser as _};
use indicatif::ProgressBar;
use miette::{Diagnostic as _, miette};
use rotorlead_answer::{Cell, Column, Table};
use rotorlead_records::files::AcceptedRange;
use rotorlead_records::import::{
    ColumnChoice, ColumnUse, EXCITATIONS, ImportError, ImportOptions, ImportSummary, MissingOption, OptionsFault,
    import, import_motors, import_seconds, motor_poles,
};
use rotorlead_records::{Excitation, Output};
use rotorlead_results::Logs;

use super::UsageError;
use super::parameters::{number, range};
use super::report_option::this_command_with;
use rotorlead_answer::words::{remark, width, wrapped};

/// What is in a log, for every command that reads one.
#[derive(Args, Debug)]
pub struct LogArguments {
    /// What a column is, as in --column time=t:ms; once for each quantity
    ///
    /// QUANTITY is time (UNIT s, ms, us, ns or clock: hh:mm:ss), command (us, percent, dshot, duty, or whole numbers as 0..255, 0..1023,
    /// 0..4095, 0..8191 or 0..65535), thrust (N, gf, kgf, lbf or ozf), rpm (rpm, rev/s, rad/s, erpm or erpm/100: electrical revolutions, with --motor-poles), voltage (V, mV) or current (A, mA). A
    /// minus before the unit turns the sign: thrust=load:-gf. Rows in which such a column is blank are left out.
    #[arg(long, value_name = "QUANTITY=HEADER:UNIT")]
    column: Vec<ColumnChoice>,
    /// Subtract the mean thrust at rest, of the rows at zero command before the run or else after it
    #[arg(long)]
    tare: bool,
    /// What drove the command
    ///
    /// Needed for a plain table; unless given, chirp for an autopilot's chirps, random where the command switches at random, and staircase for
    /// other logs. `steady`: each row is a
    /// steady point of its own, as in a table of averages.
    #[arg(long, value_name = "KIND", value_parser = excitations())]
    excitation: Option<Excitation>,
    /// Period of a multisine, square or triangle, in seconds
    #[arg(long = "period", alias = "period-s", value_name = "SECONDS", value_parser = number(AcceptedRange::DURATION_S), allow_negative_numbers = true)]
    period_s: Option<f64>,
    /// Command around which it was run, 0..1; found from the command's column unless given
    #[arg(long, value_name = "COMMAND", value_parser = number(AcceptedRange::DUTY), allow_negative_numbers = true)]
    nominal: Option<f64>,
    /// How far the command goes to either side of it, 0..1; found from the command's column unless given
    #[arg(long, value_name = "COMMAND", value_parser = number(AcceptedRange::AMPLITUDE), allow_negative_numbers = true)]
    amplitude: Option<f64>,
    /// Which part of the log to take, in seconds from its first row; all of it unless given
    #[arg(long, value_name = "FROM..TO", value_parser = import_seconds, allow_hyphen_values = true)]
    seconds: Option<(f64, f64)>,
    /// Pulse widths in microseconds that mean 0 and 1, where the log's command is a pulse width; 1000..2000 unless given, or what
    /// the log's own parameters say
    #[arg(long, value_name = "LOW..HIGH", value_parser = range(AcceptedRange::PULSE_US), allow_hyphen_values = true)]
    pulse_us: Option<(f64, f64)>,
    /// How many poles the motor has, which a speed in electrical revolutions needs: the magnets of its rotor
    #[arg(long, value_name = "N", value_parser = motor_poles::<u32>)]
    motor_poles: Option<u32>,
    /// How many rows a second a table without times has, evenly spaced
    #[arg(long, value_name = "HZ", value_parser = number(AcceptedRange::SAMPLE_RATE_HZ), allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Which motor to take of a log of several, from 1; unless given the first, or the one of a chirp that says no motor
    #[arg(long, value_name = "N")]
    motor: Option<usize>,
    /// Which log to take of an autopilot's file that has several, or which chirp, from 1; the longest unless given
    #[arg(long, value_name = "N")]
    log: Option<usize>,
}

impl LogArguments {
    /// The same for the importer. What the command itself says, such as the response, is added to that.
    pub fn options(&self) -> ImportOptions {
        ImportOptions {
            esc_signal_us: self.pulse_us,
            motor: self.motor,
            motor_poles: self.motor_poles,
            rate_hz: self.rate,
            log: self.log,
            columns: self.column.clone(),
            tare: self.tare,
            seconds: self.seconds,
            excitation: self.excitation,
            period_s: self.period_s,
            nominal: self.nominal,
            amplitude: self.amplitude,
            ..ImportOptions::default()
        }
    }

    /// Reads logs into one experiment, with a record of each. `bar` goes on by the bytes read.
    pub fn read(&self, files: &[PathBuf], options: &ImportOptions, bar: &ProgressBar) -> miette::Result<Logs> {
        check(options)?;
        Logs::read(files, !options.without_command, |file| {
            let log = import(file, options).map_err(with_next_command)?;
            check_use(options, file, &log.summary)?;
            bar.inc(bytes(file));
            Ok(log)
        })
    }

    /// Reads a log into an experiment for each of its motors that moves.
    pub fn read_motors(&self, file: &Path, options: &ImportOptions, bar: &ProgressBar) -> miette::Result<Vec<Logs>> {
        check(options)?;
        let motors = import_motors(file, options).map_err(with_next_command)?;
        motors.iter().try_for_each(|log| check_use(options, file, &log.summary))?;
        bar.inc(bytes(file));
        let with_command = !options.without_command;
        Ok(motors.into_iter().map(|log| Logs::new(log.experiment, vec![log.summary], with_command)).collect())
    }

    /// Refuses options about a log where an experiment's folder is given.
    pub fn refuse_with(&self, folder: &Path) -> Result<(), UsageError> {
        let given = [
            (!self.column.is_empty(), "--column"),
            (self.tare, "--tare"),
            (self.excitation.is_some(), "--excitation"),
            (self.period_s.is_some(), "--period"),
            (self.nominal.is_some(), "--nominal"),
            (self.amplitude.is_some(), "--amplitude"),
            (self.seconds.is_some(), "--seconds"),
            (self.pulse_us.is_some(), "--pulse-us"),
            (self.motor.is_some(), "--motor"),
            (self.motor_poles.is_some(), "--motor-poles"),
            (self.rate.is_some(), "--rate"),
            (self.log.is_some(), "--log"),
        ];
        given.into_iter().find(|(is_given, _)| *is_given).map_or(Ok(()), |(_, option)| {
            let message = format!(
                "{option} says what is in a log, and `{}` is taken as an experiment's folder",
                folder.display()
            );
            Err(UsageError::new(message, format!("leave {option} out: experiment.toml says it; or give a log")))
        })
    }
}

/// Refuses options that do not go together, whatever the logs are.
pub fn check(options: &ImportOptions) -> Result<(), UsageError> {
    options.check().map_err(|OptionsFault { message, help, missing }| {
        let help = if missing.is_empty() { help } else { next_command(&help, &missing) };
        UsageError::new(message, help)
    })
}

/// Refuses options that the log has no use for.
fn check_use(options: &ImportOptions, file: &Path, log: &ImportSummary) -> Result<(), UsageError> {
    options.unused_in(log).map_or(Ok(()), |(option, reason)| {
        let message = format!("{option} does not go with `{}`: {reason}", file.display());
        Err(UsageError::new(message, format!("leave {option} out")))
    })
}

/// What was found in each log, taken and guessed, in words.
pub fn logs_text(logs: &Logs) -> String {
    in_words(logs, |summary| describe(summary) + &notes(summary))
}

/// What of that bears on the numbers.
pub fn logs_in_short(logs: &Logs) -> String {
    in_words(logs, |summary| taken(summary) + &notes(summary))
}

fn in_words(logs: &Logs, of: impl Fn(&ImportSummary) -> String) -> String {
    let mut text = logs.summaries.iter().map(of).collect::<Vec<_>>().join("\n");
    if !logs.findings.is_empty() {
        text.push('\n');
        text.extend(logs.findings.iter().map(remark));
    }
    text
}

/// The length of a log; zero where it cannot be read, of which reading it complains.
pub fn bytes(file: &Path) -> u64 {
    file.metadata().map_or(0, |file| file.len())
}

/// What only options can say, with the command line that has them all. Where no column is in question, they are missing there, and
/// nothing is wrong with the log.
fn with_next_command(error: ImportError) -> miette::Report {
    let missing = error.missing_options();
    if missing.is_empty() {
        return error.into();
    }
    let help = next_command(&error.help().map(|help| help.to_string()).unwrap_or_default(), &missing);
    if missing.iter().any(|option| option.name == "--column") {
        return miette!(help = help, "{error}");
    }
    UsageError::new(error.to_string(), help).into()
}

/// The error of a log whose excitation is another, with the command line that says so.
pub fn with_other_excitation(error: impl std::fmt::Display) -> miette::Report {
    let remedy = format!("say what was played where it is another: {EXCITATIONS}");
    miette!(help = next_command(&remedy, &[MissingOption::excitation()]), "{error}")
}

/// A remedy with the whole command.
fn next_command(remedy: &str, missing: &[MissingOption]) -> String {
    format!("{remedy}. The whole command, with what is in capitals filled in:\n{}", this_command_with(missing))
}

/// How many rows there are.
fn taken(summary: &ImportSummary) -> String {
    format!("{}: {} of {} rows taken\n", summary.file.display(), summary.rows_taken, summary.rows_read)
}

/// What a reader may have guessed.
fn notes(summary: &ImportSummary) -> String {
    summary.notes.iter().map(|note| format!("\nnote: {}\n", wrapped(note, width() - 6, "      "))).collect()
}

/// Rows, timing and columns.
fn describe(summary: &ImportSummary) -> String {
    let mut text = taken(summary);
    let mut say = |line: String| {
        text.push_str(&line);
        text.push('\n');
    };
    for dropped in &summary.dropped {
        let rows = if dropped.rows == 1 { "row" } else { "rows" };
        say(format!(
            "  {}",
            wrapped(&format!("{} {rows} left out: {}", dropped.rows, dropped.reason), width() - 4, "    ")
        ));
    }
    let timing = &summary.timing;
    say(format!("  {}", wrapped(&format!("{:.1} rows/s; {}", timing.rate_hz, timing.method), width() - 4, "    ")));
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
    text
}

/// The names of the two responses.
pub fn responses() -> impl clap::builder::TypedValueParser<Value = Output> {
    let all = [Output::ThrustN, Output::Rpm];
    PossibleValuesParser::new(all.map(Output::option)).map(move |name| {
        all.into_iter().find(|output| output.option() == name).expect("the parser knows these names alone")
    })
}

fn excitations() -> impl clap::builder::TypedValueParser<Value = Excitation> {
    let named = |name: &str| Excitation::ALL.into_iter().find(|excitation| excitation.name() == name);
    PossibleValuesParser::new(Excitation::ALL.map(Excitation::name))
        .map(move |name| named(&name).expect("the parser knows these names alone"))
}
