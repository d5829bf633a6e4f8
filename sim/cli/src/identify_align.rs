//! `rotorlead identify --align`: a command log and a response log that were recorded apart.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::WrapErr as _;
use rotorlead_identify::alignment::{
    Alignment, AlignmentOptions, CommandLog, Merged, MergedRows, ResponseLog, align, merge,
};
use rotorlead_identify::estimate::Estimate;
use rotorlead_records::files::AcceptedRange;
use rotorlead_records::import::ImportSummary;
use rotorlead_records::{Experiment, LONG_FILE, LongRecord, Output, Record, read_command_log};
use serde::Serialize;

use super::UsageError;
use super::measured::{Measured, Reading};
use super::parameters::number;

/// How logs are merged.
#[derive(Args, Debug)]
pub struct AlignOptions {
    /// A command log (CSV: time_s, command) on a clock of its own, to be merged with the record; once per record, in their order.
    /// The records then need no column `command`. Where the log has the record's response too, as an ESC's log has the speed, the
    /// two are aligned by that
    #[arg(long, value_name = "LOG")]
    align: Vec<PathBuf>,
    /// Where the delay is expected: the response's clock less the command's, in seconds, or `start` where the first rows of
    /// both logs are of the same moment, give or take --align-within. 0 unless given
    #[arg(long, value_name = "SECONDS|start", requires = "align_within", value_parser = near, allow_hyphen_values = true)]
    align_near: Option<Near>,
    /// Greatest distance of the delay from --align-near that is searched, seconds either way; without it, any
    #[arg(long, value_name = "SECONDS", requires = "align", value_parser = number(AcceptedRange::DURATION_S))]
    align_within: Option<f64>,
    /// The actuator's own dead time in seconds, where it is known from elsewhere: so much of the delay stays
    #[arg(long, value_name = "SECONDS", requires = "align", default_value_t = 0.0, value_parser = number(AcceptedRange::DELAY_S))]
    dead_time: f64,
    /// Where to write the merged experiment, which is made
    #[arg(long, value_name = "DIR", requires = "align")]
    merged: Option<PathBuf>,
}

/// Where a delay is expected.
#[derive(Clone, Copy, Debug)]
enum Near {
    /// At so many seconds.
    Delay(f64),
    /// Where the first rows of both logs coincide.
    Start,
}

/// What was found of one record, for programs.
#[derive(Serialize)]
pub struct AlignmentValues {
    file: String,
    #[serde(flatten)]
    alignment: Alignment,
    merged_rows: usize,
    left_out: usize,
}

/// An experiment with one clock.
pub struct Aligned {
    pub experiment: Experiment,
    /// Records whose rows stay on disk; none where logs were merged.
    pub long: Vec<LongRecord>,
    /// What was found in a log and of its clock, in words; empty for a folder where nothing was to be aligned.
    pub text: String,
    /// All that was found in a log.
    pub detail: String,
    pub warnings: Vec<String>,
    /// One per record; `None` where nothing was to be aligned.
    pub alignments: Option<Vec<AlignmentValues>>,
    /// What was found in a log; `None` for a folder.
    pub logs: Option<Vec<ImportSummary>>,
}

impl AlignOptions {
    /// Reads the experiment, and merges its command logs where there are any.
    pub fn read(&self, measured: &Measured) -> miette::Result<Aligned> {
        if self.align.is_empty() {
            let Reading { experiment, long, text, detail, logs } = measured.read(LONG_FILE)?;
            return Ok(Aligned { experiment, long, text, detail, warnings: Vec::new(), alignments: None, logs });
        }
        let Reading { mut experiment, mut text, detail, logs, .. } = measured.read_responses()?;
        let (given, records) = (self.align.len(), experiment.records.len());
        if given != records {
            let message =
                format!("--align is given {given} times, and `{}` has {records} records", measured.path().display());
            return Err(
                UsageError::new(message, "give one command log per record, in the order of experiment.toml").into()
            );
        }
        if !text.is_empty() {
            text.push('\n');
        }
        let (mut warnings, mut found) = (Vec::new(), Vec::new());
        let output = experiment.output;
        for (record, path) in experiment.records.iter_mut().zip(&self.align) {
            if record.compensated {
                let message = format!("`{}` is compensated: what the ESC got is not in a command log", record.file);
                return Err(UsageError::new(message, "log both commands with the response").into());
            }
            let (alignment, merged) = self.merge(record, path, output)?;
            describe(&mut text, (record, output), path, &alignment, &merged, self.dead_time);
            warnings.extend(alignment.warnings.iter().map(|warning| format!("{}: {warning}", record.file)));
            found.push(AlignmentValues {
                file: record.file.clone(),
                alignment,
                merged_rows: merged.time_s.len(),
                left_out: merged.left_out,
            });
            take(record, merged, output);
        }
        // The merged rows follow the command's clock.
        experiment.sample_rate_hz = None;
        if let Some(merged) = &self.merged {
            experiment.write(merged)?;
            writeln!(text, "merged records written to {}", merged.display()).expect("a string takes all");
        }
        text.push('\n');
        Ok(Aligned { experiment, long: Vec::new(), text, detail, warnings, alignments: Some(found), logs })
    }

    fn merge(&self, record: &Record, path: &Path, output: Output) -> miette::Result<(Alignment, Merged)> {
        let file = read_command_log(path)?;
        let name = path.display().to_string();
        let shared = file.response(output);
        let command = CommandLog { name: &name, time_s: &file.time_s, command: &file.command, response: shared };
        let response = record.response(output).unwrap_or_default();
        let response = ResponseLog { name: &record.file, time_s: &record.time_s, response };
        let near_s = match (self.align_near, record.time_s.first(), file.time_s.first()) {
            (Some(Near::Delay(near_s)), ..) => near_s,
            (Some(Near::Start), Some(response_s), Some(command_s)) => response_s - command_s,
            _ => 0.0,
        };
        let options = AlignmentOptions { near_s, within_s: self.align_within, ..AlignmentOptions::default() };
        let rows = if record.excitation.is_periodic() { MergedRows::OfCommand } else { MergedRows::OfResponse };
        let aligned = align(&command, &response, &options).and_then(|found| {
            Ok((merge(&command, &response, &beside(record, output), &found, rows, self.dead_time)?, found))
        });
        let (merged, alignment) = aligned
            .map_err(miette::Report::from)
            .wrap_err_with(|| format!("`{}` and `{}` were not aligned", record.file, path.display()))?;
        Ok((alignment, merged))
    }
}

/// The columns of a record beside its response, on the logger's clock.
fn beside(record: &Record, output: Output) -> Vec<&[f64]> {
    let other = match output {
        Output::ThrustN => &record.rpm,
        Output::Rpm => &record.thrust_n,
    };
    [other, &record.voltage_v, &record.current_a].into_iter().filter_map(Option::as_deref).collect()
}

/// Puts the merged columns in the record's place, and what their command says of a record that was without.
fn take(record: &mut Record, merged: Merged, output: Output) {
    let mut beside = merged.other_columns.into_iter();
    let (response, other) = match output {
        Output::ThrustN => (&mut record.thrust_n, &mut record.rpm),
        Output::Rpm => (&mut record.rpm, &mut record.thrust_n),
    };
    *response = Some(merged.response);
    for column in [other, &mut record.voltage_v, &mut record.current_a].into_iter().flatten() {
        *column = beside.next().unwrap_or_default();
    }
    record.esc_command = None;
    record.time_s = merged.time_s;
    record.command = merged.command;
    if !record.excitation.is_periodic() {
        let low = record.command.iter().copied().fold(f64::INFINITY, f64::min);
        let high = record.command.iter().copied().fold(0.0, f64::max);
        record.nominal = 0.5 * (low + high);
        record.amplitude = Some(0.5 * (high - low)).filter(|amplitude| *amplitude > 0.0);
    }
}

fn describe(
    text: &mut String,
    (record, output): (&Record, Output),
    path: &Path,
    found: &Alignment,
    merged: &Merged,
    dead_time_s: f64,
) {
    let mut say = |line: String| {
        text.push_str(&line);
        text.push('\n');
    };
    say(format!("{} with the commands of {}:", record.file, path.display()));
    say(format!(
        "  delay {} ms (95 %)\n    at {:.3} s of the response's clock",
        interval(found.delay_s, 1e3, 3),
        found.reference_s
    ));
    match found.skew {
        Some(skew) => say(format!("  the response's clock is faster by {} ppm (95 %)", interval(skew, 1e6, 1))),
        None => say(String::from("  the clocks were taken to run alike")),
    }
    let how = match found.time_constant_s {
        Some(tau_s) => format!("fitted with a lag of {:.1} ms", 1e3 * tau_s.value),
        None => format!("by the {} in both logs", output.column()),
    };
    say(format!(
        "  {how}, % fit {:.1}, noise of order {},\n    over {} rows with {} gaps",
        found.fit_percent, found.noise_order, found.rows, found.gaps
    ));
    say(format!(
        "  {} merged rows, {} left out for want of the other log;\n    \
         {:.1} ms of dead time stay in, the rest is taken for latency",
        merged.time_s.len(),
        merged.left_out,
        1e3 * dead_time_s
    ));
}

fn interval(estimate: Estimate, scale: f64, digits: usize) -> String {
    let (low, high) = estimate.interval(0.95);
    format!("{:.digits$} ({:.digits$} to {:.digits$})", scale * estimate.value, scale * low, scale * high)
}

fn near(text: &str) -> Result<Near, String> {
    if text == "start" {
        return Ok(Near::Start);
    }
    number(AcceptedRange::TIME_S)(text).map(Near::Delay).map_err(|error| format!("{error}; give seconds, or `start`"))
}
