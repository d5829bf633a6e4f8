//! Logs of other tools, read into one experiment.

use std::path::{Path, PathBuf};

use miette::miette;
use rotorlead_identify::check::check_record;
use rotorlead_records::import::{Import, ImportSummary};
use rotorlead_records::{Experiment, Finding};

/// Logs that were read.
pub struct Logs {
    /// A record of each.
    pub experiment: Experiment,
    /// What was found in each, and what of it was taken.
    pub summaries: Vec<ImportSummary>,
    /// What of the records an identification refuses.
    pub findings: Vec<Finding>,
}

impl Logs {
    /// Reads logs into one experiment, with a record of each. `import` reads one. Records whose command is in another log are
    /// not looked at before it is merged: `with_command` says that they are.
    ///
    /// # Errors
    /// Those of `import`; where no log is given, two logs have different responses, or two records would have one name.
    pub fn read(
        files: &[PathBuf],
        with_command: bool,
        mut import: impl FnMut(&Path) -> miette::Result<Import>,
    ) -> miette::Result<Self> {
        let (mut whole, mut summaries): (Option<Experiment>, Vec<ImportSummary>) = (None, Vec::new());
        for file in files {
            let log = import(file)?;
            match &mut whole {
                None => whole = Some(log.experiment),
                Some(whole) => join(whole, log.experiment, &summaries[0].file, file)?,
            }
            summaries.push(log.summary);
        }
        let experiment = whole.ok_or_else(|| miette!(help = "give one or more", "no log is given"))?;
        Ok(Self::new(experiment, summaries, with_command))
    }

    /// An experiment that was read from logs, and what it would be refused for.
    #[must_use]
    pub fn new(experiment: Experiment, summaries: Vec<ImportSummary>, with_command: bool) -> Self {
        // What else may be wrong is for `rotorlead check`, which sees all records together.
        let records = experiment.records.iter().filter(|_| with_command).enumerate();
        let findings = records.flat_map(|(place, record)| {
            // All motors of a flight are of one log.
            let log = summaries.get(place).unwrap_or(&summaries[0]);
            let found = check_record(&experiment, record, false).into_iter().filter(Finding::is_grave);
            found.map(|finding| log.with_source(finding, experiment.output.column())).collect::<Vec<_>>()
        });
        Self { findings: findings.collect(), experiment, summaries }
    }
}

/// Adds the record of `added`, a log, to those of the logs before it, of which the first is `first`.
fn join(whole: &mut Experiment, added: Experiment, first: &Path, file: &Path) -> miette::Result<()> {
    if added.output != whole.output {
        return Err(miette!(
            help = "choose one with --response, import them into different folders, or state with --column what is missing",
            "`{}` and `{}` do not have the same response: it is the thrust of one and the rpm of the other",
            first.display(),
            file.display()
        ));
    }
    // Rates that are measured differ; each record's times say its own.
    if added.sample_rate_hz != whole.sample_rate_hz {
        whole.sample_rate_hz = None;
    }
    for record in added.records {
        if whole.records.iter().any(|other| other.file == record.file) {
            return Err(called_alike(&record.file));
        }
        whole.records.push(record);
    }
    Ok(())
}

/// Two logs of one name.
#[must_use]
pub fn called_alike(name: &str) -> miette::Report {
    miette!(
        help = "give one of the logs another name: a record is called as its log",
        "two records would be called `{name}`"
    )
}
