//! Logs of other tools, taken as an [`Experiment`].
//!
//! The format is recognized by the content, as one of [`FORMATS`]. What was found in a log, what of it was taken and as what, and what was done to the rows and their
//! times is in the [`ImportSummary`].

mod binary_columns;
mod blackbox;
mod blackbox_csv;
mod blackbox_frames;
mod crazyflie;
mod dataflash;
mod dataflash_messages;
mod described;
mod error;
mod esc32;
mod flight;
mod flight_stand;
mod foreign;
mod format;
mod glitches;
mod held;
mod mat;
mod mat5;
mod missing;
mod plain;
mod quantity;
mod rcbenchmark;
mod redact;
mod stamps;
mod summary;
mod table;
mod tare;
mod typed;
mod ulog;
mod ulog_messages;
mod unused;
mod vesc;

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

pub use error::{ImportError, Place};
pub use format::{FORMATS, LogFormat};
pub use missing::{EXCITATIONS, MissingOption, shell_word};
pub use quantity::{ColumnChoice, Quantity, Unit};
pub use redact::{Dropped, Redacted, redact, redact_bytes};
pub use stamps::{GAP_INTERVALS, spread_bursts};
pub use summary::{ColumnUse, DroppedRows, ImportSummary, Timing};
pub use typed::{IMPORT_OPTIONS, import_seconds, motor_poles};
pub use unused::OptionsFault;

use super::{CommandLog, Excitation, Experiment, Output, Record, Setpoints};
use described::Described;
use format::{Dialect, Reader};
use plain::PlainTable;

/// What a log does not say of itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportOptions {
    /// What to call the experiment; the log's file name where absent.
    pub name: Option<String>,
    /// Pulse widths in microseconds that mean command 0 and command 1, for logs whose command is a pulse width. Where absent 1000 and
    /// 2000, or what a log's own parameters say.
    pub esc_signal_us: Option<(f64, f64)>,
    /// Which motor to take of an autopilot's log, from 1; the first where absent. Of a DataFlash log with chirps, which do not say
    /// whose they are, it is the chirp that is taken where absent.
    pub motor: Option<usize>,
    /// Which log, or chirp, to take of a file that has several, from 1; the longest where absent.
    pub log: Option<usize>,
    /// Which column of a table is what, where its names do not say it; at most one for a quantity.
    pub columns: Vec<ColumnChoice>,
    /// The part to take, in seconds from the first row: from the first of the two on, and before the second.
    pub seconds: Option<(f64, f64)>,
    /// Which column is the response, where the log has both.
    pub output: Option<Output>,
    /// Whether the command was logged apart, so that none is taken of this log.
    pub without_command: bool,
    /// Whether the mean thrust of the motor at rest is subtracted: a stand that was not set to zero.
    pub tare: bool,
    /// How many poles the motor has, for a speed in electrical revolutions.
    pub motor_poles: Option<u32>,
    /// How many rows a second a table without times has, evenly spaced.
    pub rate_hz: Option<f64>,
    /// What drove the command. A plain table needs it, unless its rows are steady points; other logs are staircases where absent.
    pub excitation: Option<Excitation>,
    /// The period of an excitation that has one, seconds.
    pub period_s: Option<f64>,
    /// The command around which it was run, 0..1; found from the rows where absent.
    pub nominal: Option<f64>,
    /// Peak deviation of the command, 0..1; found from the rows where absent.
    pub amplitude: Option<f64>,
}

impl ImportOptions {
    /// The stated pulse widths of command 0 and 1, or those of a standard ESC, microseconds.
    fn pulse_range(&self) -> (f64, f64) {
        self.esc_signal_us.unwrap_or((1000.0, 2000.0))
    }
}

/// A log, taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Import {
    /// One record, or one for each motor of a flight; response in revolutions per minute unless the log has thrust.
    pub experiment: Experiment,
    /// What was done to get it.
    pub summary: ImportSummary,
}

/// Rows under which a log is no recording.
const MIN_ROWS: usize = 100;
/// Steady points under which there is no static map: a curve of three coefficients goes through any three.
const MIN_STEADY_POINTS: usize = 4;
/// Rows further apart are of another unit of time, or of no recording of a motor, seconds.
const LONGEST_INTERVAL_S: f64 = 10.0;
/// A recording that lasts longer is in another unit of time: a day, seconds.
const LONGEST_RECORD_S: f64 = 86_400.0;
/// Motors that a vehicle may have. Standard: ArduPilot's and PX4's frames have at most twelve.
const MOST_MOTORS: usize = 12;
/// Bytes of the longest log, which is read whole.
const LONGEST_LOG: u64 = 1_000_000_000;

/// Takes a log whose format is recognized by its content.
///
/// # Errors
/// [`ImportError`]: unreadable file, unknown format, missing or unclear column, text in a number column, command
/// outside its range or constant, time that runs backwards, too few rows, numbers that cannot be, a damaged binary file.
pub fn import(file: &Path, options: &ImportOptions) -> Result<Import, ImportError> {
    import_bytes(file, &read_log(file)?, options)
}

/// The bytes of a log.
fn read_log(file: &Path) -> Result<Vec<u8>, ImportError> {
    if file.is_dir() {
        return Err(ImportError::not_a_log(
            file,
            ": it is a folder, and no log",
            "give the logs in it, each by its name",
        ));
    }
    let mut bytes = Vec::new();
    File::open(file)
        .and_then(|log| log.take(LONGEST_LOG + 1).read_to_end(&mut bytes))
        .map_err(|source| ImportError::Read { file: file.into(), source })?;
    if bytes.len() as u64 > LONGEST_LOG {
        let remedy = "cut the part that holds the run out of it with the logger's own tools";
        return Err(ImportError::not_a_log(file, format!(": longer than {} MB", LONGEST_LOG / 1_000_000), remedy));
    }
    Ok(bytes)
}

/// [`import`] of each motor of a log that moves, unless [`ImportOptions::motor`] says which: an experiment each.
///
/// # Errors
/// As [`import`]; where a motor that moves cannot be taken, nothing is.
pub fn import_motors(file: &Path, options: &ImportOptions) -> Result<Vec<Import>, ImportError> {
    let first = import(file, options)?;
    if options.motor.is_some() || !first.summary.has_motors {
        return Ok(vec![first]);
    }
    let mut motors = Vec::new();
    for motor in 1..=MOST_MOTORS {
        // Some logs number their motors with gaps.
        match import(file, &ImportOptions { motor: Some(motor), ..options.clone() }) {
            Ok(mut taken) => {
                let [record] = &mut taken.experiment.records[..] else { unreachable!("a log is a record") };
                let stem = record.file.strip_suffix(".csv").unwrap_or(&record.file);
                record.file = format!("{stem}_motor{motor}.csv");
                motors.push(taken);
            }
            Err(ImportError::Missing { .. } | ImportError::ConstantCommand { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    // Of a log of one motor that says no number, that one is all.
    Ok(if motors.len() > 1 { motors } else { vec![first] })
}

/// [`import`] of a log that is in memory. `file` is what messages call it.
///
/// Memory stays within a fixed multiple of the log's length, whatever the log says of itself.
///
/// # Errors
/// As [`import`].
pub fn import_bytes(file: &Path, bytes: &[u8], options: &ImportOptions) -> Result<Import, ImportError> {
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(ImportError::not_a_log(file, ": the file is empty", "copy or export the log again"));
    }
    let (low_us, high_us) = options.pulse_range();
    if !(low_us.is_finite() && high_us.is_finite() && low_us < high_us) {
        return Err(ImportError::SignalRange { low_us, high_us });
    }
    let is_flight = options.excitation == Some(Excitation::Flight);
    if is_flight && options.motor.is_none() {
        let options = ImportOptions { motor: Some(1), ..options.clone() };
        let taken = take(file, bytes, &options)?;
        if taken.summary.has_motors {
            return take_vehicle(file, bytes, &options, taken);
        }
    }
    let taken = take(file, bytes, options)?;
    let may_be_another = taken.summary.has_motors;
    match taken.into_import(file, options) {
        Err(ImportError::ConstantCommand { command, rows, .. }) if may_be_another => {
            take_moving_motor(file, bytes, options, ImportError::ConstantCommand { file: file.into(), command, rows })
        }
        imported => imported,
    }
}

/// Takes all motors of a flight, the first of which was `taken`: a record of each.
fn take_vehicle(file: &Path, bytes: &[u8], options: &ImportOptions, taken: Taken) -> Result<Import, ImportError> {
    let mut import = taken.into_import(file, options)?;
    for motor in 2..=MOST_MOTORS {
        let options = ImportOptions { motor: Some(motor), ..options.clone() };
        match take(file, bytes, &options) {
            Ok(taken) => import.experiment.records.extend(taken.into_import(file, &options)?.experiment.records),
            Err(ImportError::Missing { .. }) => break,
            Err(error) => return Err(error),
        }
    }
    let motors = import.experiment.records.len();
    import
        .summary
        .notes
        .push(format!("{motors} motors are taken, a record of each: the rows and columns here are those of motor 1"));
    Ok(import)
}

/// Takes the only motor that moves where the first one stands still and none was asked for; names those that move where one was, or there
/// are several; the error `still` where none does.
fn take_moving_motor(
    file: &Path,
    bytes: &[u8],
    options: &ImportOptions,
    still: ImportError,
) -> Result<Import, ImportError> {
    // One at a time, so that memory stays that of one.
    let taken = |motor: usize| {
        let options = ImportOptions { motor: Some(motor), ..options.clone() };
        take(file, bytes, &options).and_then(|taken| taken.into_import(file, &options))
    };
    let asked = options.motor.unwrap_or(1);
    let moving: Vec<usize> = (1..=MOST_MOTORS).filter(|motor| *motor != asked && taken(*motor).is_ok()).collect();
    match (&moving[..], options.motor) {
        ([], _) => Err(still),
        (&[motor], None) => {
            let mut import = taken(motor)?;
            import.summary.notes.push(format!("motor 1 stands still: taken is motor {motor}, the only one that moves"));
            Ok(import)
        }
        (&[motor], Some(_)) => {
            let problem = format!(": motor {asked} stands still, and motor {motor} moves");
            Err(ImportError::missing(file, problem, format!("`--motor {motor}` takes the one that moves")))
        }
        (&[first, ..], _) => {
            let motors = moving.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
            let problem = format!(": motor {asked} stands still, and motors {motors} move");
            Err(ImportError::missing(file, problem, format!("say which one to take, as in `--motor {first}`")))
        }
    }
}

/// Takes a log as the first format that recognizes it.
fn take(file: &Path, bytes: &[u8], options: &ImportOptions) -> Result<Taken, ImportError> {
    for format in FORMATS {
        if let Reader::Bytes { read, .. } = format.reader
            && let Some(taken) = read(file, bytes, options)?
        {
            return Ok(taken);
        }
    }
    foreign::refuse(file, bytes)?;
    let (text, encoding) = foreign::text(file, bytes)?;
    let mut taken = take_text(file, &text, options)?;
    taken.summary.notes.extend(encoding.map(|encoding| format!("the log is {encoding} text, and was read as such")));
    Ok(taken)
}

/// The names of the columns of a table of text, for who has to say what they are; none of anything else.
#[must_use]
pub fn table_columns(file: &Path, bytes: &[u8]) -> Vec<String> {
    let text = foreign::text(file, bytes).ok();
    let plain = text.as_ref().and_then(|(text, _)| PlainTable::parse(file, text).ok());
    plain.map_or_else(Vec::new, |plain| plain.table.header.iter().map(ToString::to_string).collect())
}

fn take_text(file: &Path, text: &str, options: &ImportOptions) -> Result<Taken, ImportError> {
    for format in FORMATS {
        if let Reader::Text(read) = format.reader
            && let Some(taken) = read(file, text, options)?
        {
            return Ok(taken);
        }
    }
    let mut plain = PlainTable::parse(file, text)?;
    plain.motor_poles = options.motor_poles;
    let (format, dialect) = table_format(&plain.table.header);
    plain.dialect = dialect;
    plain.notes.extend(dialect.note.map(String::from));
    plain::take_table(plain, options, format)
}

/// The format of a table with these columns, and what is known of it.
fn table_format(header: &[String]) -> (&'static LogFormat, &'static Dialect) {
    let as_table = |format: &'static LogFormat| match format.reader {
        Reader::Table { is_header, dialect } if is_header(header) => Some((format, dialect)),
        _ => None,
    };
    FORMATS.into_iter().find_map(as_table).unwrap_or((&plain::FORMAT, &Dialect::PLAIN))
}

/// What a format's reader hands over: columns of equal length, and how they came about.
struct Taken {
    time_s: Vec<f64>,
    command: Vec<f64>,
    /// The command on stamps of its own: seconds from the first row, and 0..1, from the one in force there on; nothing where it was logged
    /// in the rows.
    own_command: Vec<(f64, f64)>,
    thrust_n: Option<Vec<f64>>,
    rpm: Option<Vec<f64>>,
    voltage_v: Option<Vec<f64>>,
    current_a: Option<Vec<f64>>,
    setpoints: Setpoints,
    /// Rows per second where evenly spaced without a gap.
    sample_rate_hz: Option<f64>,
    /// Rate of the controller that set the command, hertz, where the log says it.
    loop_rate_hz: Option<f64>,
    /// Which of the two is the response.
    output: Output,
    /// What drives logs of this kind, unless stated.
    usual: Option<Excitation>,
    summary: ImportSummary,
}

impl Taken {
    fn into_import(mut self, file: &Path, options: &ImportOptions) -> Result<Import, ImportError> {
        if options.without_command {
            self.command.clear();
            self.own_command.clear();
        }
        self.leave_out_glitches()?;
        self.cut(options)?;
        self.check_response(options)?;
        self.tare(options)?;
        let stem = file.file_stem().map_or_else(|| "log".into(), |s| s.to_string_lossy().into_owned());
        let Described { excitation, period_s, nominal, amplitude, note } = self.described(options)?;
        self.check_times(excitation)?;
        self.summary.notes.extend(note);
        let file_name = record_file(&stem, options);
        let command_log = self.command_log(&file_name, excitation);
        if let Some(log) = &command_log {
            self.command = log.at_rows(&self.time_s, excitation);
        }
        let record = Record {
            file: file_name,
            nominal,
            excitation,
            period_s,
            amplitude,
            compensated: false,
            compensator: None,
            role: None,
            time_s: self.time_s,
            command: self.command,
            command_log,
            thrust_n: self.thrust_n,
            rpm: self.rpm,
            esc_command: None,
            voltage_v: self.voltage_v,
            current_a: self.current_a,
            setpoints: self.setpoints,
        };
        Ok(Import {
            experiment: Experiment {
                name: options.name.clone().unwrap_or(stem),
                output: self.output,
                sample_rate_hz: self.sample_rate_hz,
                esc_frame_hz: None,
                // On a bench the command is seldom the loop's.
                command_rate_hz: self.loop_rate_hz.filter(|_| excitation == Excitation::Flight),
                records: vec![record],
            },
            summary: self.summary,
        })
    }
}

impl Taken {
    /// Every column that has a number for each row.
    fn columns_of_rows(&mut self) -> impl Iterator<Item = &mut Vec<f64>> {
        let optional = [&mut self.thrust_n, &mut self.rpm, &mut self.voltage_v, &mut self.current_a];
        let all = [&mut self.time_s, &mut self.command].into_iter().chain(optional.into_iter().flatten());
        all.chain(self.setpoints.columns_mut()).filter(|column| !column.is_empty())
    }

    /// Makes the response what is asked for, which has to be there.
    fn check_response(&mut self, options: &ImportOptions) -> Result<(), ImportError> {
        self.output = options.output.unwrap_or(self.output);
        let response = match self.output {
            Output::ThrustN => &self.thrust_n,
            Output::Rpm => &self.rpm,
        };
        if response.is_none() {
            let columns = self.summary.columns.iter().map(|column| format!("`{}`", column.name)).collect::<Vec<_>>();
            return Err(ImportError::no_such_output(&self.summary.file, self.output.column(), &columns.join(", ")));
        }
        Ok(())
    }

    /// The command on stamps of its own, where the rows do not say all of it: where it changes between two of them.
    fn command_log(&self, record_file: &str, excitation: Excitation) -> Option<CommandLog> {
        if excitation == Excitation::Steady {
            return None;
        }
        let (first_s, last_s) = (self.time_s.first()?, self.time_s.last()?);
        let own = &self.own_command;
        let first = own.partition_point(|(time, _)| time <= first_s).checked_sub(1)?;
        let mut own = own[first..own.partition_point(|(time, _)| time <= last_s).max(first)].to_vec();
        // Of several at one stamp the last holds.
        own.dedup_by(|next, before| {
            let is_same = next.0 <= before.0;
            before.1 = if is_same { next.1 } else { before.1 };
            is_same
        });
        let (time_s, command) = own.into_iter().unzip();
        let file = format!("{}_command.csv", record_file.trim_end_matches(".csv"));
        let log = CommandLog { file, time_s, command };
        let changes = (1..self.command.len()).filter(|&row| self.command[row] != self.command[row - 1]);
        let mut stamps = changes.map(|row| self.time_s[row]);
        let is_between = stamps.any(|stamp| log.time_s[log.last_change(stamp)] != stamp);
        is_between.then_some(log)
    }

    /// Refuses rows so far apart that their times are in another unit. Steady points are as far apart as it took to reach them.
    fn check_times(&self, excitation: Excitation) -> Result<(), ImportError> {
        let (interval_s, _) = stamps::typical_and_longest(&self.time_s);
        let lasts_s = self.time_s.last().copied().unwrap_or(0.0);
        if excitation == Excitation::Steady || (interval_s <= LONGEST_INTERVAL_S && lasts_s <= LONGEST_RECORD_S) {
            return Ok(());
        }
        let taken_as_time = |column: &&ColumnUse| column.taken_as.as_deref() == Some("time_s");
        let column = self.summary.columns.iter().find(taken_as_time).map_or("time", |column| column.name.as_str());
        let hours = lasts_s / 3600.0;
        Err(ImportError::value(
            &self.summary.file,
            format!("column `{column}`"),
            format!("rows {interval_s} s apart that last {hours:.1} hours are no recording of a motor"),
            format!(
                "its unit is another: state it, as in `--column time='{column}:ms'`; where each row is a steady point, say so with \
                 `--excitation steady`"
            ),
        ))
    }
}

/// What a record is called: as its log, from which second on where that is stated, and the motor of a flight.
fn record_file(stem: &str, options: &ImportOptions) -> String {
    let part = options.seconds.map(|(from_s, _)| format!("_{from_s}s")).unwrap_or_default();
    let is_flight = options.excitation == Some(Excitation::Flight);
    let motor = options.motor.filter(|_| is_flight).map(|motor| format!("_motor{motor}")).unwrap_or_default();
    // What not every system allows in a name.
    let stem: String = stem.chars().map(|c| if ['\\', ':', '/'].contains(&c) { '_' } else { c }).collect();
    format!("{stem}{part}{motor}.csv")
}
