//! `rotorlead identify`

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use miette::WrapErr as _;
use rotorlead_answer::Report;
use rotorlead_identify::stand::StandModel;
use rotorlead_identify::{FirstOrderOptions, IdentifyError, IdentifyOptions};
use rotorlead_records::files::{check_writable, printable};
use rotorlead_records::{Experiment, Finding, Output};
use rotorlead_results::{IdentifyResult, excitation_section, transform};
use serde_json::json;

use super::identify_align::{AlignOptions, Aligned};
use super::identify_stand::{self, StandArguments};
use super::outcome::{JsonOption, Outcome};
use super::report_option::ReportOption;
use super::{WrongUse, progress, report_pages};

/// Finds the lag at each level from the records of an experiment
///
/// Multisine records are fitted in the frequency domain, one lag per nominal command, and judged on square waves. They may
/// be of any length: one whose file is longer than 32 MiB is taken period by period as it is read, with the same result.
/// Without any, a step or staircase record is fitted in time, one lag per level and direction; without those too, chirps are
/// fitted in the frequency domain, one lag per nominal command.
#[derive(Args, Debug)]
pub struct Identify {
    /// The experiment's folder
    #[arg(value_name = "DIR")]
    experiment: PathBuf,
    /// Where the model goes
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
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
    /// Which column is the response; what the experiment says unless given
    #[arg(long, value_enum)]
    output: Option<Response>,
    #[command(flatten)]
    align: AlignOptions,
    #[command(flatten)]
    report: ReportOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

/// A column that may be the response.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Response {
    /// `thrust_n`
    Thrust,
    /// `rpm`
    Rpm,
}

impl From<Response> for Output {
    fn from(response: Response) -> Self {
        match response {
            Response::Thrust => Self::ThrustN,
            Response::Rpm => Self::Rpm,
        }
    }
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
            return identify_stand::run(&self.experiment, &self.out, &self.of_stand, &self.report);
        }
        check_writable(&self.out)?;
        self.report.check()?;
        let delay_level = match self.delay {
            Delay::Auto => FirstOrderOptions::default().delay_level,
            Delay::None => 0.0,
            Delay::Fit => 1.0,
        };
        let stand = self.stand_model.as_deref().map(StandModel::read).transpose()?;
        let nothing = || format!("nothing was identified from `{}`", self.experiment.display());
        let (aligned, found) = progress::of_files("identifying", &[&self.experiment], || -> miette::Result<_> {
            let mut aligned = self.align.read(&self.experiment)?;
            if let Some(output) = self.output {
                aligned.experiment.output = output.into();
                check_output(&aligned.experiment)?;
            }
            let long = transform(&aligned.experiment, &aligned.long).wrap_err_with(nothing)?;
            let options = IdentifyOptions { delay_level, stand: stand.as_ref(), long: &long };
            // How the logs were merged may say why nothing comes of them.
            let found = IdentifyResult::of(&aligned.experiment, &options)
                .inspect_err(|_| eprint!("{}", printable(&aligned.text)))
                .map_err(no_stand)
                .wrap_err_with(nothing)?;
            Ok((aligned, found))
        })?;
        let Aligned { experiment, text: of_alignment, warnings, alignments, .. } = aligned;
        found.identification.model.write(&self.out)?;

        let mut answer = found.answer(&experiment);
        let of_merging = warnings.into_iter().map(|warning| Finding::warning(warning, None));
        answer.findings.splice(0..0, of_merging);
        answer.values.insert("alignment".to_owned(), json!(alignments));
        let mut written = format!("Written to {}\n", self.out.display());
        written.push_str(&self.report.write(|| {
            let stand = self.stand_model.as_deref().map(|stand| report_pages::file("Stand, divided out", stand));
            let model = report_pages::file("Model", &self.out);
            let facts =
                [report_pages::records(&experiment, &self.experiment), stand.into_iter().chain([model]).collect()];
            Report {
                facts: facts.concat(),
                warnings: answer.warnings(),
                sections: vec![answer.section(), excitation_section(&experiment)],
                ..report_pages::report(
                    "Identification",
                    format!("Identification of {}", experiment.name),
                    answer.verdict.clone(),
                )
            }
        })?);
        Ok(Outcome::of(&answer, &written).after(&of_alignment))
    }
}

/// Refuses a response that is asked for and was not taken.
fn check_output(experiment: &Experiment) -> Result<(), WrongUse> {
    let column = experiment.output.column();
    experiment.records.iter().find(|record| record.response(experiment.output).is_none()).map_or(Ok(()), |record| {
        let message = format!("--output asks for `{column}`, and `{}` has no such column", record.file);
        let remedy = "leave --output out, or take the other response of the log with `rotorlead import --output`: where it is slower \
                      than the one that was taken, rows without it are left out";
        Err(WrongUse::new(message, remedy))
    })
}

/// That no stand is divided out of steps is said of the option.
fn no_stand(error: IdentifyError) -> miette::Report {
    match error {
        IdentifyError::StandOfSteps => WrongUse::new(
            "--stand-model is for multisine records, and this experiment has none",
            "leave --stand-model out: steps are fitted in time, through the stand as it is",
        )
        .into(),
        error => error.into(),
    }
}
