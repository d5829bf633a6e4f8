//! `rotorlead import`

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use miette::miette;
use rotorlead_records::files::{FileError, OutputFolder};
use rotorlead_records::import::{FORMATS, ImportOptions};
use rotorlead_records::{Experiment, FleetList, FleetLog, Output};
use rotorlead_results::{Logs, called_alike};
use serde_json::json;

use super::log_arguments::{LogArguments, bytes, logs_text, responses};
use super::outcome::{JsonOption, Outcome};
use super::parameters::RoleArgument;
use super::progress;

/// Takes logs of other tools as an experiment
///
/// The format is recognized by the content; the list of formats stands at the end. Each log becomes one record. Shows every column of a
/// log and which of them were taken.
///
/// The columns of a table are recognized by names that say quantity and unit, such as `time_ms`, `Throttle (%)`, `thrust [g]` or
/// `rpm`; where they do not, --column says it. One unit is guessed, and said to be: that of a command whose numbers fit one alone,
/// 0..1, percent, pulse widths or DShot. What a table cannot say either is what drove the command: --excitation says that. Several
/// logs of one kind of run are given at once, others are added with --append; with --fleet each becomes an experiment of its own.
///
/// A flight is refused: where the commands of several motors move, each in its own way, a controller answers what the motors do.
///
/// A table of steady points, one in each row, becomes a record of the excitation `steady`: it gives a static map and no lag.
#[derive(Args, Debug)]
#[command(after_long_help = formats())]
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
    /// Make an experiment of each log, and of each motor in it that moves, and the list of them that `rotorlead fleet` reads
    #[arg(long, conflicts_with_all = ["append", "name", "no_command"])]
    fleet: bool,
    /// What to call the experiment; unless given, the log's file name, and of several logs the folder's
    #[arg(long, conflicts_with = "append")]
    name: Option<String>,
    /// The command was logged apart, on another clock: take the log without it. `rotorlead identify --align` merges the two
    #[arg(long, conflicts_with_all = ["pulse_us", "append"])]
    no_command: bool,
    /// What the records are for; the tools choose unless given
    #[arg(long, value_enum, conflicts_with = "fleet")]
    role: Option<RoleArgument>,
    /// Which of the two is the response, where a log has both; the summary says which it is and why
    #[arg(long, alias = "output", value_name = "RESPONSE", value_parser = responses())]
    response: Option<Output>,
    #[command(flatten)]
    logs: LogArguments,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

/// Which logs are read, for the end of the help.
fn formats() -> String {
    FORMATS.iter().fold(String::from("Formats that are recognized:"), |list, format| list + "\n  - " + format.title)
}

impl Import {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        let is_added = self.append && Experiment::is_at(&self.out);
        if !self.append && Experiment::is_at(&self.out) {
            let help = "--append adds to the experiment in it; or give another folder: nothing is overwritten";
            return Err(miette!(help = help, "the folder `{}` exists and is not empty", self.out.display()));
        }
        let options = ImportOptions {
            name: self.name.clone(),
            output: self.response,
            without_command: self.no_command,
            ..self.logs.options()
        };
        if self.fleet {
            return self.write_fleet(&options);
        }
        // To read and to write each take about as long.
        let bar = progress::estimate("importing", 2 * self.files.iter().map(|file| bytes(file)).sum::<u64>());
        let mut logs = self.logs.read(&self.files, &options, &bar)?;
        if let (None, [_, _, ..], Some(folder)) = (&self.name, &self.files[..], self.out.file_name()) {
            logs.experiment.name = folder.to_string_lossy().into_owned();
        }
        let role = self.role.map(RoleArgument::role);
        logs.experiment.records.iter_mut().for_each(|record| record.role = role);
        let text = logs_text(&logs);
        let Logs { experiment, summaries, findings } = logs;
        let is_added = self.write(experiment, is_added)?;
        bar.finish_and_clear();
        let done = if is_added { "Added to" } else { "Written to" };
        let text = format!("{text}\n{done} {}\n", self.out.display());
        Ok(Outcome::new(text, &json!({ "folder": self.out, "logs": summaries, "findings": findings })))
    }

    /// Writes the experiment, or adds it to the one that is there; whether it was added.
    fn write(&self, experiment: Experiment, mut is_added: bool) -> miette::Result<bool> {
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
            experiment.with_rates_from(&self.out)?.append_to(&self.out)?;
        }
        Ok(is_added)
    }

    /// Writes a folder of experiments, one for each log, with the list that `rotorlead fleet` reads. All of it, or nothing.
    fn write_fleet(&self, options: &ImportOptions) -> miette::Result<Outcome> {
        let folder = OutputFolder::create(&self.out)?;
        let bar = progress::estimate("importing", self.files.iter().map(|file| bytes(file)).sum());
        let (mut text, mut list) = (String::new(), FleetList { logs: Vec::new() });
        let (mut summaries, mut findings) = (Vec::new(), Vec::new());
        for file in &self.files {
            for log in self.logs.read_motors(file, options, &bar)? {
                text.push_str(&logs_text(&log));
                text.push('\n');
                // As its record is called, which is a name on every system.
                let record = &log.experiment.records[0].file;
                let name = record.strip_suffix(".csv").unwrap_or(record).to_owned();
                if list.logs.iter().any(|other| other.folder == name) {
                    return Err(called_alike(record));
                }
                log.experiment.write_below(&folder, &name)?;
                list.logs.push(FleetLog { motor: name.clone(), folder: name, date: None });
                summaries.extend(log.summaries);
                findings.extend(log.findings);
            }
        }
        list.write_into(&folder)?;
        folder.commit()?;
        bar.finish_and_clear();
        writeln!(
            text,
            "Written to {}: {} logs, and fleet.csv, in which each is a motor of its own;\n  name the motor there, and the date, of \
             logs of one motor",
            self.out.display(),
            list.logs.len()
        )
        .expect("a string takes all");
        Ok(Outcome::new(text, &json!({ "folder": self.out, "logs": summaries, "findings": findings })))
    }
}
