//! `rotorlead import`

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::WrongUse;
use super::outcome::{JsonOption, Outcome, wrapped};
use super::parameters::range;
use crate::record::import::{ImportOptions, ImportSummary, LogFormat, import};

/// Takes the log of another tool as an experiment
///
/// Shows every column of the log and which of them were taken. Reads: RCbenchmark (Tyto) thrust-stand logs, the logs of
/// the AutoQuad ESC32, MATLAB files of named vectors (time, command, thrust or rpm), PX4 ULog, and Betaflight blackbox. The
/// format is told from the content.
#[derive(Args, Debug)]
pub struct Import {
    /// The log
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// The experiment's folder, which is made
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// What to call the experiment; the log's file name unless given
    #[arg(long)]
    name: Option<String>,
    /// Pulse widths in microseconds that mean 0 and 1, where the log's command is a pulse width; 1000..2000 unless given
    #[arg(long, value_name = "LOW..HIGH", value_parser = pulses, allow_hyphen_values = true)]
    pulse_us: Option<(f64, f64)>,
    /// Which motor to take of a flight log, from 1; the first unless given
    #[arg(long, value_name = "N")]
    motor: Option<usize>,
    /// Which log to take of a blackbox file that has several, from 1; the longest unless given
    #[arg(long, value_name = "N")]
    log: Option<usize>,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl Import {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        let mut options = ImportOptions { name: self.name.clone(), log: self.log, ..ImportOptions::default() };
        options.esc_signal_us = self.pulse_us.unwrap_or(options.esc_signal_us);
        options.motor = self.motor.unwrap_or(options.motor);
        let taken = import(&self.file, &options)?;
        let format = taken.summary.format;
        if self.motor.is_some() && !matches!(format, LogFormat::Ulog | LogFormat::Blackbox) {
            let message = format!("--motor does not go with `{}`: it is no flight log", self.file.display());
            return Err(WrongUse::new(message, "leave --motor out").into());
        }
        if self.log.is_some() && format != LogFormat::Blackbox {
            let message = format!("--log does not go with `{}`: it is no blackbox file", self.file.display());
            return Err(WrongUse::new(message, "leave --log out").into());
        }
        if self.pulse_us.is_some() && !taken.summary.pulse_widths {
            let message = format!(
                "--pulse-us does not go with `{}`: its command is a duty already, no pulse width",
                self.file.display()
            );
            return Err(WrongUse::new(message, "leave --pulse-us out").into());
        }
        taken.experiment.write(&self.out)?;
        let mut text = describe(&taken.summary);
        writeln!(text, "\nWritten to {}", self.out.display()).expect("a string takes all");
        Ok(Outcome { text, json: json!(taken.summary) })
    }
}

/// Columns of a terminal that sentences keep to.
const WIDTH: usize = 80;
/// Characters of a column's name beyond which the rest of its line is no longer aligned.
const LONGEST_NAME: usize = 31;

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
    let longest = summary.columns.iter().map(|column| column.name.chars().count()).max().unwrap_or(0);
    let width = longest.clamp("column".len(), LONGEST_NAME);
    say(format!("\n  {:<width$}  {:<11}  remark", "column", "taken as"));
    for column in &summary.columns {
        let taken = column.taken_as.as_deref().unwrap_or("-");
        let before = format!("  {:<width$}  {taken:<11}  ", column.name);
        let indent = " ".repeat(width + 17);
        say(before + &wrapped(&column.note, WIDTH - indent.len(), &indent));
    }
    for note in &summary.notes {
        say(format!("\nnote: {}", wrapped(note, WIDTH - 6, "      ")));
    }
    text
}

/// [`range`] of pulse widths, which are above zero.
fn pulses(text: &str) -> Result<(f64, f64), String> {
    match range(text)? {
        (low, _) if low < 0.0 => Err(String::from("a pulse is no shorter than 0 microseconds")),
        range => Ok(range),
    }
}
