//! `rotorlead identify`

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use miette::WrapErr as _;
use rotorlead_answer::Report;
use rotorlead_identify::error::IdentifyError;
use rotorlead_identify::identification::IdentifyOptions;
use rotorlead_identify::lag::first_order::FirstOrderOptions;
use rotorlead_identify::lag::steps::StepsError;
use rotorlead_identify::stand::StandModel;
use rotorlead_records::files::{check_writable, printable};
use rotorlead_records::{Experiment, Finding};
use rotorlead_results::{IdentifyResult, transform};
use serde_json::json;

use super::identify_align::{AlignOptions, Aligned};
use super::identify_stand::{self, StandArguments};
use super::log_arguments::with_other_excitation;
use super::measured::Measured;
use super::out_option::model_written;
use super::outcome::{JsonOption, Outcome};
use super::report_option::ReportOption;
use super::{UsageError, progress, report_pages};

/// Finds the lag at each level from the records of an experiment, or from a log
///
/// A log is read as `rotorlead import` reads it, and nothing of it is written.
///
/// Multisine records are fitted in the frequency domain, one lag per nominal command, and judged on square waves. They may
/// be of any length: one whose file is longer than 32 MiB is taken period by period as it is read, with the same result.
/// Without any, a step or staircase record is fitted in time, one lag per level and direction; without those too, chirps are
/// fitted in the frequency domain, one lag per nominal command.
#[derive(Args, Debug)]
pub struct Identify {
    #[command(flatten)]
    measured: Measured,
    /// Where the model goes; it is shown alone unless given
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Whether a dead time is part of the lag at multisine records
    #[arg(long, value_enum, default_value_t = Delay::Auto)]
    delay: Delay,
    /// Identify the stand instead of a motor: `command` is the force put in, in newtons, by a hammer or a shaker
    #[arg(long, conflicts_with_all = ["stand_model", "delay", "align"])]
    stand: bool,
    #[command(flatten)]
    of_stand: StandArguments,
    /// A stand identified with --stand, which is divided out of multisine records
    #[arg(long, value_name = "FILE")]
    stand_model: Option<PathBuf>,
    #[command(flatten)]
    align: AlignOptions,
    #[command(flatten)]
    pub(super) report: ReportOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

/// Whether a dead time is fitted.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Delay {
    /// Where the records show one, by a likelihood ratio test at 1 %
    Auto,
    /// Never
    None,
    /// Wherever the best one is above zero
    Fit,
}

impl Identify {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        if self.stand {
            return identify_stand::run(self.measured.folder()?, self.out.as_deref(), &self.of_stand, &self.report);
        }
        self.out.as_deref().map_or(Ok(()), check_writable)?;
        self.report.check()?;
        let delay_level = match self.delay {
            Delay::Auto => FirstOrderOptions::default().delay_level,
            Delay::None => 0.0,
            Delay::Fit => 1.0,
        };
        let stand = self.stand_model.as_deref().map(StandModel::read).transpose()?;
        let nothing = || format!("nothing was identified from `{}`", self.measured.path().display());
        let (aligned, found) =
            progress::over_files("identifying", &[self.measured.path()], || -> miette::Result<_> {
                let mut aligned = self.align.read(&self.measured)?;
                self.measured.choose_output(&mut aligned.experiment)?;
                let long = transform(&aligned.experiment, &aligned.long).wrap_err_with(nothing)?;
                let options = IdentifyOptions { delay_level, stand: stand.as_ref(), long: &long };
                // How logs were read and merged may say why nothing comes of them.
                let mut found = IdentifyResult::identify(&aligned.experiment, &options)
                    .inspect_err(|_| eprint!("{}", printable(&aligned.text)))
                    .map_err(|error| not_identified(error, aligned.logs.is_some()))
                    .wrap_err_with(nothing)?;
                let provenance = found.identification.model.provenance.iter_mut();
                provenance.for_each(|from| from.records_crc32 = Experiment::checksum(self.measured.path()));
                Ok((aligned, found))
            })?;
        let Aligned { experiment, text: of_logs, detail, warnings, alignments, logs, .. } = aligned;
        self.out.as_deref().map_or(Ok(()), |out| found.identification.model.write(out))?;

        let mut answer = found.answer(&experiment);
        let of_merging = warnings.into_iter().map(|warning| Finding::warning(warning, None));
        answer.findings.splice(0..0, of_merging);
        answer.values.insert("alignment".to_owned(), json!(alignments));
        answer.values.extend(logs.map(|logs| ("logs".to_owned(), json!(logs))));
        let mut written = model_written(self.out.as_deref());
        written.push_str(&self.report.write(|| {
            let stand = self.stand_model.as_deref().map(|stand| report_pages::file("Stand, divided out", stand));
            let model = self.out.as_deref().map(|out| report_pages::file("Model", out));
            let facts =
                [report_pages::records(&experiment, self.measured.path()), stand.into_iter().chain(model).collect()];
            Report {
                facts: facts.concat(),
                sections: found.sections(&answer, &experiment),
                ..report_pages::answer_page("Identification", format!("Identification of {}", experiment.name), &answer)
            }
        })?);
        Ok(Outcome::from_answer(&answer, &written).after(&of_logs, &detail))
    }
}

/// That no stand is divided out of steps is said of the option, and so is what a log does not say of its excitation.
pub(super) fn not_identified(error: IdentifyError, is_of_log: bool) -> miette::Report {
    match error {
        IdentifyError::NoRecord { .. }
        | IdentifyError::Free { .. }
        | IdentifyError::Steps(StepsError::NoPlateaus { .. })
            if is_of_log =>
        {
            with_other_excitation(error)
        }
        IdentifyError::StandOfSteps => UsageError::new(
            "--stand-model is for multisine records, and this experiment has none",
            "leave --stand-model out: steps are fitted in time, through the stand as it is",
        )
        .into(),
        error => error.into(),
    }
}
