//! `rotorlead identify`

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use miette::{IntoDiagnostic as _, WrapErr as _};
use rotorlead_answer::{Report, Section, Table};
use rotorlead_identify::stand::StandModel;
use rotorlead_identify::steps::LawComparison;
use rotorlead_identify::{FirstOrderOptions, Identification, IdentifyError, IdentifyOptions, Lags};
use rotorlead_records::files::{check_writable, printable};
use rotorlead_records::{Experiment, Output};
use rotorlead_results::{
    IdentifyResult, excitation_section, identification_section, identification_tables, recommendation_table, refused,
    to_fly, transform,
};
use serde_json::json;

use super::identify_align::{AlignOptions, Aligned};
use super::identify_stand::{self, StandArguments};
use super::identify_tables::{fitted_chirps, held_out, staircase};
use super::outcome::{JsonOption, Outcome, paragraph, warning_lines};
use super::report_option::ReportOption;
use super::{WrongUse, identify_laws, identify_map, progress, report_pages};

/// Printed below the lags.
const STANDARD_ERRORS: &str = "  tau is the time constant; +- is one standard error, of the noise alone.\n";

/// Warnings that are printed; what further ones say changes the answer less.
const MOST_WARNINGS: usize = 4;

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
        let Aligned { experiment, text: of_alignment, mut warnings, alignments, .. } = aligned;
        let identified = &found.identification;
        identified.model.write(&self.out)?;

        warnings.extend(found.warnings.iter().cloned());
        let (of_lags, mut detail) = tables(&experiment, identified, found.laws.as_ref());
        let mut text = paragraph(&found.headline, "  ");
        text.extend(found.judgement.limits.iter().map(|reason| paragraph(&format!("- {reason}"), "  ")));
        if let Some(recommendation) = &found.recommendation {
            text.extend(to_fly(recommendation).iter().map(|sentence| paragraph(&format!("- {sentence}"), "  ")));
            detail.push('\n');
            detail.push_str(&recommendation_table(recommendation).text());
            detail.extend(refused(recommendation).iter().map(|sentence| paragraph(sentence, "  ")));
        }
        if let Some(other) = &found.other_output {
            text.push_str(&paragraph(&other.sentence(experiment.output), "  "));
        }
        if !of_alignment.is_empty() {
            text.push('\n');
            text.push_str(of_alignment.trim_end_matches('\n'));
            text.push('\n');
        }
        text.push('\n');
        text.push_str(&of_lags);
        if !warnings.is_empty() {
            text.push('\n');
        }
        let (first, folded) = warnings.split_at(warnings.len().min(MOST_WARNINGS));
        text.extend(first.iter().map(|warning| warning_lines(warning)));
        if !folded.is_empty() {
            writeln!(text, "{} further warnings, of less weight: --verbose prints them", folded.len())
                .into_diagnostic()?;
            detail.push('\n');
            detail.extend(folded.iter().map(|warning| warning_lines(warning)));
        }
        writeln!(text, "\nWritten to {}", self.out.display()).into_diagnostic()?;
        text.push_str(&self.report.write(|| {
            let verdict = report_pages::identified(&identified.model, &found.judgement, warnings.len());
            let stand = self.stand_model.as_deref().map(|stand| report_pages::file("Stand, divided out", stand));
            let written = report_pages::file("Model", &self.out);
            Report {
                facts: [
                    report_pages::records(&experiment, &self.experiment),
                    stand.into_iter().chain([written]).collect(),
                ]
                .concat(),
                warnings: warnings.clone(),
                sections: sections(&experiment, identified),
                ..report_pages::report("Identification", format!("Identification of {}", experiment.name), verdict)
            }
        })?);
        let mut values = found.values();
        values.warnings = warnings;
        values.alignment = alignments.map(|alignments| json!(alignments));
        Ok(Outcome::new(text, &values).with_detail(detail))
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

/// The parts of a report: what was played, and what came out.
pub fn sections(experiment: &Experiment, identified: &Identification) -> Vec<Section> {
    vec![identification_section(identified, experiment), excitation_section(experiment)]
}

/// The lags, and the other tables as detail.
fn tables(experiment: &Experiment, identified: &Identification, laws: Option<&LawComparison>) -> (String, String) {
    let tables = identification_tables(identified, experiment.output);
    let [of_lags, others @ ..] = &tables[..] else { unreachable!("the lags are there in any case") };
    // The model's derived numbers are left to the report.
    let shown = [
        "u_nom",
        "gain",
        "time_constant_ms",
        "lower",
        "upper",
        "delay_ms",
        "time_constant_up_ms",
        "fit_up_percent",
        "time_constant_down_ms",
        "fit_down_percent",
        "fit_frequency_percent",
        "fit_square_percent",
        "reduced_chi_square",
    ];
    let of_lags = of_lags.select(&shown).text();
    let text = match &identified.lags {
        Lags::Multisines(found) => of_lags + STANDARD_ERRORS + &held_out(experiment, found),
        Lags::Chirps(found) => of_lags + STANDARD_ERRORS + &fitted_chirps(found),
        Lags::Steps(fit) => staircase(fit) + &of_lags,
        Lags::None => String::new(),
    };
    let laws = laws.map(identify_laws::describe);
    let map = identified.static_map.as_ref().map(|(_, fit)| identify_map::describe(fit, experiment.output));
    let detail: Vec<String> = laws.into_iter().chain(others.iter().map(Table::text)).collect();
    let detail = detail.join("\n") + &map.unwrap_or_default();
    // A static map is all that there is to say then.
    if matches!(identified.lags, Lags::None) { (detail, String::new()) } else { (text, detail) }
}
