//! What can be wrong with a log, and what to do about it.

use std::fmt;
use std::path::PathBuf;

use miette::Diagnostic;
use thiserror::Error;

use super::format::LogFormat;
use super::missing::{EXCITATIONS, MissingOption};
use crate::files::shown;

/// Where a row of a log is, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Line of a text.
    Line(u64),
    /// Sample of a binary log.
    Sample(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(number) => write!(formatter, "line {number}"),
            Self::Sample(number) => write!(formatter, "sample {number}"),
        }
    }
}

/// Why a log was not taken. Every variant names the file and, where there is one, the line and the
/// column.
#[derive(Debug, Error, Diagnostic)]
pub enum ImportError {
    /// The file could not be read.
    #[error("{}: cannot be read", file.display())]
    #[diagnostic(help("check the path and the permissions"))]
    Read {
        /// The log.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// More than is read into memory.
    #[error("{}: longer than {} MB", file.display(), most / 1_000_000)]
    #[diagnostic(help("cut the part that holds the run out of it with the logger's own tools"))]
    TooLong {
        /// The log.
        file: PathBuf,
        /// The greatest length, bytes.
        most: u64,
    },
    /// A folder is given for a log.
    #[error("{}: it is a folder, and no log", file.display())]
    #[diagnostic(help("give the logs in it, each by its name"))]
    Folder {
        /// The folder.
        file: PathBuf,
    },
    /// A file of another kind.
    #[error("{}: {kind}, and no log", file.display())]
    #[diagnostic(help("{remedy}"))]
    NoLog {
        /// The file.
        file: PathBuf,
        /// What it is.
        kind: &'static str,
        /// How a log comes of it.
        remedy: &'static str,
    },
    /// Nothing but a header, or less.
    #[error("{}: {rows} usable row(s); at least {needed} are needed", file.display())]
    #[diagnostic(help(
        "check that the recording ran while the command was on; where each row is a steady point, say so with \
         `--excitation steady`: four are enough"
    ))]
    TooFewRows {
        /// The log.
        file: PathBuf,
        /// Rows that could be used.
        rows: usize,
        /// Rows that are needed.
        needed: usize,
    },
    /// The part that was asked for is not in the log.
    #[error("{}: {rows} row(s) from {from_s} to {to_s} s; the log ends {lasts_s:.1} s behind its first row", file.display())]
    #[diagnostic(help("give --seconds a part that lies in the log; they are counted from its first row"))]
    OutsideLog {
        /// The log.
        file: PathBuf,
        /// Where the part begins, seconds.
        from_s: f64,
        /// Where it ends, seconds.
        to_s: f64,
        /// Rows in it.
        rows: usize,
        /// The log's last row, seconds.
        lasts_s: f64,
    },
    /// There is nothing in the file.
    #[error("{}: the file is empty", file.display())]
    #[diagnostic(help("copy or export the log again"))]
    Empty {
        /// The log.
        file: PathBuf,
    },
    /// The command never changes.
    #[error("{}: the command is {command} in all of the {rows} rows taken, so nothing can be identified from it", file.display())]
    #[diagnostic(help(
        "record again with levels or an excitation, which `rotorlead excite --out excitation.csv` designs; where the log does have them, it may be cut short or hold another run"
    ))]
    ConstantCommand {
        /// The log.
        file: PathBuf,
        /// The command, 0..1.
        command: f64,
        /// Rows taken.
        rows: usize,
    },
    /// The first motor stands still, and several others move.
    #[error("{}: motor 1 stands still, and motors {motors} move", file.display())]
    #[diagnostic(help("say which one to take, as in `--motor 2`"))]
    SeveralMotors {
        /// The log.
        file: PathBuf,
        /// Their numbers, from 1.
        motors: String,
    },
    /// There are no rows of numbers.
    #[error("{}: no known log format, and no table: no line of it has two numbers. It begins with: {header}", file.display())]
    #[diagnostic(help("known: {}. Export the log again as one of them", LogFormat::titles()))]
    UnknownFormat {
        /// The log.
        file: PathBuf,
        /// The start of its first line.
        header: String,
    },
    /// Bytes among the text that are none.
    #[error(
        "{}, line {line}: the byte {byte:#04x} belongs in no text: the file is damaged, or a binary log that is not known",
        file.display()
    )]
    #[diagnostic(help("copy the file again, or export it as one of these: {}", LogFormat::titles()))]
    NotText {
        /// The log.
        file: PathBuf,
        /// Line, from 1.
        line: usize,
        /// The first such byte.
        byte: u8,
    },
    /// A plain table whose names do not say what is what.
    #[error("{}{problem}", file.display())]
    #[diagnostic(help("{remedy}"))]
    UnclearColumns {
        /// The log.
        file: PathBuf,
        /// What the names do not say, behind the line of the names where there is one.
        problem: String,
        /// All columns, and the options that would tell it.
        remedy: String,
        /// Those options.
        missing: Vec<MissingOption>,
    },
    /// A column is stated that is not there.
    #[error("{}: there is no column `{column}`", file.display())]
    #[diagnostic(help("the columns are {columns}: give one of these to --column, capitals and blanks as they are"))]
    NoSuchColumn {
        /// The log.
        file: PathBuf,
        /// The column.
        column: String,
        /// All columns.
        columns: String,
    },
    /// A column is stated of which there are two.
    #[error("{}: two columns are called `{column}`", file.display())]
    #[diagnostic(help("rename one of them in the header"))]
    SameName {
        /// The log.
        file: PathBuf,
        /// Their name.
        column: String,
    },
    /// A plain table does not say what drove its command.
    #[error("{}: the log does not say what drove the command", file.display())]
    #[diagnostic(help("say it with `{}`: {EXCITATIONS}", MissingOption::excitation()))]
    NoExcitation {
        /// The log.
        file: PathBuf,
    },
    /// An autopilot's log does not say which pulse widths mean no and full command.
    #[error("{}: no parameter says which pulse widths mean no and full command", file.display())]
    #[diagnostic(help(
        "state them with --pulse-us LOW..HIGH, as the ESC was calibrated; a log has them as MOT_PWM_MIN and MOT_PWM_MAX (Q_M_PWM_MIN \
         and Q_M_PWM_MAX of a quadplane, SERVOn_MIN and SERVOn_MAX of a plane's throttle), where these are not 0; PX4's are PWM_MAIN_MINn and PWM_MAIN_MAXn, and 0..1999 with \
         DShot"
    ))]
    NoPulseRange {
        /// The log.
        file: PathBuf,
    },
    /// A flight, whose commands are those of a controller.
    #[error(
        "{}: a flight, and no bench run: while the command of motor {motor} moves, so does that of {others}, each in its own way",
        file.display()
    )]
    #[diagnostic(help(
        "a controller answers what the motors do, so that a lag of such a record is that of its loop: run one motor at a time on a \
         bench, by the motor test of the configurator or the actuator chirp applet; --seconds takes the part of a log that is such a \
         run, and `--excitation free` takes the log as a record that no lag is fitted to"
    ))]
    Flight {
        /// The log.
        file: PathBuf,
        /// The motor that was asked for, from 1.
        motor: usize,
        /// The others that move: what they are, and their numbers from 1.
        others: String,
    },
    /// A column that the format always has is missing.
    #[error("{}, line 1: column `{column}` is missing", file.display())]
    #[diagnostic(help("record the log again with this column switched on"))]
    MissingColumn {
        /// The log.
        file: PathBuf,
        /// The column.
        column: String,
    },
    /// Text where a number belongs.
    #[error("{}, {line}, column `{column}`: `{text}` is not a finite number", file.display())]
    #[diagnostic(help("correct the value, or delete the row if it is a remark or a damaged line"))]
    NotANumber {
        /// The log.
        file: PathBuf,
        /// Where it is.
        line: Place,
        /// The column.
        column: String,
        /// What is there.
        text: String,
    },
    /// The header stands among the rows.
    #[error("{}, {line}: the header stands here once more", file.display())]
    #[diagnostic(help("two logs are in one file: cut it there and import the parts one by one"))]
    SecondHeader {
        /// The log.
        file: PathBuf,
        /// Where it is.
        line: Place,
    },
    /// A comma that may be a decimal mark or a separator of thousands.
    #[error("{}, {line}, column `{column}`: `{text}` may be a number of thousands or have a decimal comma", file.display())]
    #[diagnostic(help("export the log with decimal points and without separators of thousands"))]
    UnclearComma {
        /// The log.
        file: PathBuf,
        /// Where it is.
        line: Place,
        /// The column.
        column: String,
        /// What is there.
        text: String,
    },
    /// A value is missing between rows that have it.
    #[error("{}, {line}, column `{column}`: {found}, though rows before and after have a value", file.display())]
    #[diagnostic(help("delete the row, or cut the log there and import the parts one by one"))]
    Blank {
        /// The log.
        file: PathBuf,
        /// Where it is.
        line: Place,
        /// The column.
        column: String,
        /// What is there.
        found: String,
    },
    /// A column that is needed has hardly a number.
    #[error("{}, {line}, column `{column}`: empty, as in {blank} of {rows} rows", file.display())]
    #[diagnostic(help(
        "a column that is asked for, or that is the response, needs a number in more than half of the rows: choose another \
         with --response or --column, or record it at the rate of the other columns"
    ))]
    MostlyBlank {
        /// The log.
        file: PathBuf,
        /// The first row without a number.
        line: Place,
        /// The column.
        column: String,
        /// Rows without a number.
        blank: usize,
        /// Rows.
        rows: usize,
    },
    /// The command is blank throughout.
    #[error("{}, column `{column}`: empty in all {rows} rows, so the log does not have the command", file.display())]
    #[diagnostic(help(
        "record with the output switched on; where the command was logged apart, `rotorlead import --no-command` takes the log \
         without it, and `rotorlead identify --align LOG` merges the two"
    ))]
    NoCommand {
        /// The log.
        file: PathBuf,
        /// The column.
        column: String,
        /// Rows.
        rows: usize,
    },
    /// A response is asked for that the log does not have.
    #[error("{}: no column was taken as {output}, which is to be the response", file.display())]
    #[diagnostic(help("name its column with --column, or choose the other response with --response"))]
    NoSuchOutput {
        /// The log.
        file: PathBuf,
        /// The column of the record.
        output: &'static str,
    },
    /// There is no thrust at rest to take the zero from.
    #[error("{}: --tare needs {needed}, and {problem}", file.display())]
    #[diagnostic(help("leave --tare out, or record with the motor at rest for a second before the run"))]
    NoRest {
        /// The log.
        file: PathBuf,
        /// What the zero is taken from.
        needed: &'static str,
        /// What there is instead.
        problem: String,
    },
    /// Times that are in another unit than was taken.
    #[error(
        "{}, column `{column}`: rows {interval_s} s apart that last {:.1} hours are no recording of a motor",
        file.display(),
        lasts_s / 3600.0
    )]
    #[diagnostic(help(
        "its unit is another: state it, as in `--column time='{column}:ms'`; where each row is a steady point, say so with \
         `--excitation steady`"
    ))]
    TimeUnit {
        /// The log.
        file: PathBuf,
        /// The column of the times.
        column: String,
        /// The median interval, seconds.
        interval_s: f64,
        /// The last row, seconds.
        lasts_s: f64,
    },
    /// A number that no motor of a multicopter reaches.
    #[error("{}, {line}, column `{column}`: {problem}, which cannot be", file.display())]
    #[diagnostic(help(
        "where its unit is another, state it with `{remedy}`; where the value is a glitch, delete the row"
    ))]
    Impossible {
        /// The log.
        file: PathBuf,
        /// Where it is.
        line: Place,
        /// The column.
        column: String,
        /// What is there, in the unit that it was taken in, and the most that can be.
        problem: String,
        /// The option that states another unit.
        remedy: String,
    },
    /// Speeds of a binary log that no motor of a multicopter reaches.
    #[error("{}, `{column}`: {problem}, which no rotor reaches", file.display())]
    #[diagnostic(help("its unit or the number of poles is another; glitches are left out where they are few"))]
    ImpossibleSpeed {
        /// The log.
        file: PathBuf,
        /// The field.
        column: String,
        /// How many there are.
        problem: String,
    },
    /// A command outside the range that is normalized to 0..1.
    #[error("{}, {line}, column `{column}`: {} is outside {low}..{high}", file.display(), shown(*value))]
    #[diagnostic(help(
        "where the command is a pulse width, state the ESC's range (zero and full command) with --pulse-us; else its unit is \
         another than its column says"
    ))]
    OutOfRange {
        /// The log.
        file: PathBuf,
        /// Where it is.
        line: Place,
        /// The column.
        column: String,
        /// What is there.
        value: f64,
        /// What becomes 0.
        low: f64,
        /// What becomes 1.
        high: f64,
    },
    /// A time stamp that cannot be read.
    #[error("{}, {line}, column `{column}`: `{text}` is not a time stamp", file.display())]
    #[diagnostic(help("expected `YYYY-MM-DD hh:mm:ss:mmm`; correct it or delete the row"))]
    TimeStamp {
        /// The log.
        file: PathBuf,
        /// Where it is.
        line: Place,
        /// The column.
        column: String,
        /// What is there.
        text: String,
    },
    /// Time runs backwards by more than rows can overtake each other.
    #[error("{}, {line}, column `{column}`: time runs backwards by {} s", file.display(), shown(*by_s))]
    #[diagnostic(help(
        "this looks like two logs in one file: cut it there and import the parts one by one; where each row is a steady point, \
         say so with `--excitation steady`"
    ))]
    TimeRunsBack {
        /// The log.
        file: PathBuf,
        /// Where it is.
        line: Place,
        /// The column.
        column: String,
        /// By how much, in seconds.
        by_s: f64,
    },
    /// The stamps of a log whose rows should be evenly spaced do not lie near any even grid.
    #[error(
        "{}: the time stamps miss an even grid of {interval_s} s by {residual_rms_s} s RMS",
        file.display()
    )]
    #[diagnostic(help("rows are missing in many places; record again with a faster link, or cut out the good part"))]
    NotEven {
        /// The log.
        file: PathBuf,
        /// The interval that fits best, in seconds.
        interval_s: f64,
        /// RMS distance of the stamps from it, in seconds.
        residual_rms_s: f64,
    },
    /// A binary log that is cut short or damaged.
    #[error("{}, byte {offset}: {problem}", file.display())]
    #[diagnostic(help("copy or save the file again: it is cut short or damaged"))]
    Damaged {
        /// The log.
        file: PathBuf,
        /// Where the part begins that cannot be read.
        offset: usize,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// A MATLAB file of version 7.3, which is another format.
    #[error("{}: a MATLAB file of version 7.3 (HDF5)", file.display())]
    #[diagnostic(help("save it again in MATLAB with `save(file, '-v7')`"))]
    Hdf5 {
        /// The log.
        file: PathBuf,
    },
    /// A variable or field that cannot be what its name says.
    #[error("{}, variable `{name}`: {problem}", file.display())]
    #[diagnostic(help("{remedy}"))]
    Variable {
        /// The log.
        file: PathBuf,
        /// The variable.
        name: String,
        /// What it is, and what is needed.
        problem: String,
        /// What to save in its place.
        remedy: String,
    },
    /// A flight log without a topic that is needed, or without that motor.
    #[error("{}: nothing logged for `{signal}` of motor {motor}", file.display())]
    #[diagnostic(help("needed is {known}; switch that topic on in the logger, or state a motor that is there"))]
    MissingTopic {
        /// The log.
        file: PathBuf,
        /// The column of the record.
        signal: &'static str,
        /// What can stand for it.
        known: String,
        /// The motor, from 1.
        motor: usize,
    },
    /// A flight log whose headers do not say what a number of it means, or say what cannot be taken.
    #[error("{}, header `{header}`: {problem}", file.display())]
    #[diagnostic(help("{remedy}"))]
    Header {
        /// The log.
        file: PathBuf,
        /// The header.
        header: &'static str,
        /// What is wrong with it.
        problem: String,
        /// What to do about it.
        remedy: &'static str,
    },
    /// A rate is stated of a table that has times.
    #[error("{}, column `{column}`: has the times of the rows, beside which no --rate is needed", file.display())]
    #[diagnostic(help("leave --rate out; where these are no times, say which column has them with --column"))]
    RateBesideTimes {
        /// The log.
        file: PathBuf,
        /// The column of the times.
        column: String,
    },
    /// A log of that number, in a file that has fewer.
    #[error("{}: there is no log {log} in it, but {logs}", file.display())]
    #[diagnostic(help("logs, or the chirps of a DataFlash log, are numbered from 1, in the order of the file"))]
    NoSuchLog {
        /// The file.
        file: PathBuf,
        /// The log that was asked for.
        log: usize,
        /// How many there are.
        logs: usize,
    },
    /// A vector that cannot be a column.
    #[error("{}, vector `{name}`: {problem}", file.display())]
    #[diagnostic(help("all columns need one number per row: save or record the log again"))]
    Vector {
        /// The log.
        file: PathBuf,
        /// The vector.
        name: String,
        /// What is wrong with it.
        problem: String,
    },
    /// A number of a binary log that cannot be used.
    #[error("{}, `{name}`, sample {number}: {}: {problem}", file.display(), shown(*value))]
    #[diagnostic(help("cut the log there and import the parts one by one, or correct the sample"))]
    Sample {
        /// The log.
        file: PathBuf,
        /// The vector or field.
        name: String,
        /// Which sample, the first being 1.
        number: usize,
        /// What is there.
        value: f64,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// A command of a binary log outside the range that is normalized to 0..1.
    #[error("{}, `{name}`, sample {number}: {} is outside {low}..{high}", file.display(), shown(*value))]
    #[diagnostic(help(
        "state the ESC's range where the command is a pulse width; a vector's unit is taken from its name: `command` is \
         0..1, `command_percent` 0..100, `command_us` a pulse width"
    ))]
    SampleOutOfRange {
        /// The log.
        file: PathBuf,
        /// The vector or field.
        name: String,
        /// Which sample, the first being 1.
        number: usize,
        /// What is there.
        value: f64,
        /// What becomes 0.
        low: f64,
        /// What becomes 1.
        high: f64,
    },
    /// The stated range of the ESC signal is no range.
    #[error("the ESC signal's range {low_us}..{high_us} µs is empty or not finite")]
    #[diagnostic(help("give zero command and full command in microseconds, such as 1000 and 2000"))]
    SignalRange {
        /// What should become 0.
        low_us: f64,
        /// What should become 1.
        high_us: f64,
    },
}

impl ImportError {
    /// The options that would say what the log does not, each with a word in capitals where a value belongs; none where that is not
    /// what is wrong.
    #[must_use]
    pub fn missing_options(&self) -> Vec<MissingOption> {
        match self {
            Self::UnclearColumns { missing, .. } => missing.clone(),
            Self::NoExcitation { .. } => vec![MissingOption::excitation()],
            Self::NoPulseRange { .. } => vec![MissingOption::pulse_us()],
            _ => Vec::new(),
        }
    }
}
