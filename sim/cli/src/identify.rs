//! `rotorlead identify`

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use miette::{Diagnostic, IntoDiagnostic as _, WrapErr as _};
use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};
use rotorlead_identify::stand::StandModel;
use rotorlead_identify::static_map::{StaticMapFit, SteadyPoints};
use rotorlead_identify::steps::fit_staircase;
use rotorlead_identify::{
    ChirpIdentification, FirstOrderOptions, LongRecordError, PeriodicIdentification, PeriodicOptions, Spectrum,
    identify_chirps, identify_periodic, is_chirp_to_fit, with_advice,
};
use rotorlead_plant::{Model, Provenance};
use rotorlead_records::files::check_writable;
use rotorlead_records::{Excitation, Experiment, LongRecord, Record, Role};
use rotorlead_report::{
    Identification, Report, Section, distortion_json, distortion_table, excitation_section, identification_section,
};
use serde_json::{Value, json};
use thiserror::Error;

use super::identify_align::{AlignOptions, Aligned};
use super::identify_stand::{self, StandArguments};
use super::identify_tables::{fitted_chirps, held_out, periodic_table, point_json, staircase_json, staircase_table};
use super::outcome::{JsonOption, Outcome, warning_lines};
use super::report_option::ReportOption;
use super::{WrongUse, identify_intervals, identify_laws, identify_map, progress, report_pages};

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
    pub(super) out: PathBuf,
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

/// Why there is nothing to identify.
#[derive(Debug, Error, Diagnostic)]
pub(super) enum NothingToIdentify {
    #[error("{experiment}: no record of `excitation` multisine, step, staircase or chirp that may be fitted")]
    #[diagnostic(help(
        "record one (`rotorlead excite` designs a multisine), or correct `excitation` and `role` in experiment.toml"
    ))]
    NoRecord { experiment: String },
    #[error("{experiment}: {files} {verb} `free`, which does not say what was played")]
    #[diagnostic(help(
        "in its [[record]] of experiment.toml say what was: excitation = \"multisine\" or \"square\" with period_s in \
         seconds, excitation = \"step\" or \"staircase\""
    ))]
    Free { experiment: String, files: String, verb: &'static str },
    #[error("{experiment}: {count} step or staircase records without a role, and one model")]
    #[diagnostic(help("give the one to fit role = \"fit\" in experiment.toml, and the others role = \"validate\""))]
    Ambiguous { experiment: String, count: usize },
}

/// What was identified, by either way.
pub struct Identified {
    /// The model.
    pub model: Model,
    /// Its tables in words.
    pub text: String,
    /// What the user should know, a sentence each.
    pub warnings: Vec<String>,
    /// What only one way finds, for programs.
    pub detail: Value,
    /// Noise and nonlinear distortion by nominal command, for programs; null where records cannot tell.
    pub distortion: Value,
    /// Intervals by nominal command, for programs; null for steps.
    pub intervals: Value,
    /// The frequency responses behind the lags; `None` for steps.
    pub found: Option<PeriodicIdentification>,
    /// The static map with what it was fitted to, where records show one.
    pub static_map: Option<(SteadyPoints, StaticMapFit)>,
}

impl Identify {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        if self.stand {
            return identify_stand::run(&self.experiment, &self.out, &self.of_stand, &self.report);
        }
        check_writable(&self.out)?;
        self.report.check(Some(&self.out))?;
        let delay_level = match self.delay {
            Delay::Auto => FirstOrderOptions::default().delay_level,
            Delay::None => 0.0,
            Delay::Fit => 1.0,
        };
        let stand = self.stand_model.as_deref().map(StandModel::read).transpose()?;
        let nothing = || format!("nothing was identified from `{}`", self.experiment.display());
        let (aligned, mut identified, laws, static_map) =
            progress::of_files("identifying", &[&self.experiment], || -> miette::Result<_> {
                let aligned = self.align.read(&self.experiment)?;
                let long = transform(&aligned.experiment, &aligned.long).wrap_err_with(nothing)?;
                let mut identified =
                    identify(&aligned.experiment, &long, delay_level, stand.as_ref()).wrap_err_with(nothing)?;
                let laws = identify_laws::compare(&aligned.experiment, &mut identified);
                let static_map = identify_map::add(&aligned.experiment, &mut identified);
                Ok((aligned, identified, laws, static_map))
            })?;
        let Aligned { experiment, text: mut aligned_text, warnings: align_warnings, json: alignments, .. } = aligned;
        identified.model.write(&self.out)?;

        identified.warnings.splice(0..0, align_warnings);
        aligned_text.push_str(&identified.text);
        let mut text = aligned_text;
        if !identified.warnings.is_empty() {
            text.push('\n');
        }
        for warning in &identified.warnings {
            text.push_str(&warning_lines(warning));
        }
        writeln!(text, "\nWritten to {}", self.out.display()).into_diagnostic()?;
        text.push_str(&self.report.write(|| {
            let verdict = report_pages::identified(&identified.model, identified.warnings.len());
            let stand = self.stand_model.as_deref().map(|stand| report_pages::file("Stand, divided out", stand));
            let written = report_pages::file("Model", &self.out);
            Report {
                facts: [
                    report_pages::records(&experiment, &self.experiment),
                    stand.into_iter().chain([written]).collect(),
                ]
                .concat(),
                warnings: identified.warnings.clone(),
                sections: identified.sections(&experiment),
                ..report_pages::report("Identification", format!("Identification of {}", experiment.name), verdict)
            }
        })?);
        let json = json!({
            "points": identified.model.points.iter().map(point_json).collect::<Vec<_>>(),
            "warnings": identified.warnings,
            "detail": identified.detail,
            "distortion": identified.distortion,
            "intervals": identified.intervals,
            "alignment": alignments,
            "static_map": static_map,
            "laws": laws,
        });
        Ok(Outcome { text, json })
    }
}

impl Identified {
    /// The parts of a report: what was played, and what came out.
    pub fn sections(&self, experiment: &Experiment) -> Vec<Section> {
        let identification = Identification {
            output: experiment.output,
            model: &self.model,
            found: self.found.as_ref(),
            static_map: self.static_map.as_ref().map(|(points, fit)| (points, fit)),
        };
        vec![identification_section(&identification), excitation_section(experiment)]
    }
}

/// The spectra of records that stay on disk, side by side.
pub fn transform(experiment: &Experiment, long: &[LongRecord]) -> Result<Vec<(Record, Spectrum)>, LongRecordError> {
    let options = PeriodicOptions::default().spectrum;
    let spectra: Vec<_> = long
        .par_iter()
        .map(|record| Ok((record.header.clone(), Spectrum::of_long(experiment, record, &options)?)))
        .collect();
    // The error is that of the first faulty record, whichever is found first.
    spectra.into_iter().collect()
}

/// Identifies by what records there are; `long` are those that stay on disk.
pub fn identify(
    experiment: &Experiment,
    long: &[(Record, Spectrum)],
    delay_level: f64,
    stand: Option<&StandModel>,
) -> miette::Result<Identified> {
    let may_fit = |record: &&Record| record.role != Some(Role::Validate);
    let mut records = experiment.records.iter().chain(long.iter().map(|(record, _)| record));
    if records.by_ref().filter(may_fit).any(|record| record.excitation == Excitation::Multisine) {
        let options = PeriodicOptions {
            fit: FirstOrderOptions { delay_level, ..FirstOrderOptions::default() },
            stand,
            long,
            ..PeriodicOptions::default()
        };
        let found = identify_periodic(experiment, &options)?;
        return Ok(Identified {
            model: periodic_model(experiment, &found),
            text: periodic_table(experiment.output, &found) + &held_out(experiment, &found) + &distortion_table(&found),
            warnings: [periodic_warnings(&found), left_out(experiment, None)].concat(),
            detail: Value::Null,
            distortion: distortion_json(&found),
            intervals: identify_intervals::intervals_json(&found),
            found: Some(found),
            static_map: None,
        });
    }
    let is_steps = |record: &Record| matches!(record.excitation, Excitation::Step | Excitation::Staircase);
    let may_fit_steps = experiment.records.iter().filter(may_fit).any(is_steps);
    if !may_fit_steps && experiment.records.iter().any(is_chirp_to_fit) {
        return of_chirps(experiment, delay_level, stand);
    }
    let record = step_record(experiment)?;
    if stand.is_some() {
        return Err(WrongUse::new(
            "--stand-model is for multisine records, and this experiment has none",
            "leave --stand-model out: steps are fitted in time, through the stand as it is",
        )
        .into());
    }
    let fit = fit_staircase(record, experiment.output, experiment.esc_frame_hz)?;
    Ok(Identified {
        model: fit.to_model(env!("CARGO_PKG_VERSION"))?,
        text: staircase_table(&fit),
        warnings: fit.warnings.iter().map(ToString::to_string).chain(left_out(experiment, Some(record))).collect(),
        detail: staircase_json(&fit),
        distortion: Value::Null,
        intervals: Value::Null,
        found: None,
        static_map: None,
    })
}

/// Identifies from chirps.
fn of_chirps(experiment: &Experiment, delay_level: f64, stand: Option<&StandModel>) -> miette::Result<Identified> {
    let options = FirstOrderOptions { delay_level, ..FirstOrderOptions::default() };
    let ChirpIdentification { lags, files } = identify_chirps(experiment, &options, stand)?;
    let mut model = periodic_model(experiment, &lags);
    let text = periodic_table(experiment.output, &lags) + &fitted_chirps(&files);
    if let Some(provenance) = &mut model.provenance {
        provenance.records = files;
    }
    Ok(Identified {
        model,
        text,
        warnings: periodic_warnings(&lags),
        detail: Value::Null,
        distortion: Value::Null,
        intervals: identify_intervals::intervals_json(&lags),
        found: Some(lags),
        static_map: None,
    })
}

/// The one step or staircase record that is to be fitted.
pub(super) fn step_record(experiment: &Experiment) -> Result<&Record, NothingToIdentify> {
    let records = |role: Option<Role>| {
        experiment
            .records
            .iter()
            .filter(move |record| {
                matches!(record.excitation, Excitation::Step | Excitation::Staircase) && record.role == role
            })
            .collect::<Vec<_>>()
    };
    let (marked, unmarked) = (records(Some(Role::Fit)), records(None));
    let candidates = if marked.is_empty() { unmarked } else { marked };
    let name = || experiment.name.clone();
    match candidates[..] {
        [record] => Ok(record),
        [] => Err(nothing(experiment)),
        _ => Err(NothingToIdentify::Ambiguous { experiment: name(), count: candidates.len() }),
    }
}

/// Why there is no record to fit: those that do not say what was played are named.
fn nothing(experiment: &Experiment) -> NothingToIdentify {
    let free = experiment.records.iter().filter(|record| record.excitation == Excitation::Free);
    let files: Vec<&str> = free.map(|record| record.file.as_str()).collect();
    let name = experiment.name.clone();
    match files[..] {
        [] => NothingToIdentify::NoRecord { experiment: name },
        [file] => NothingToIdentify::Free { experiment: name, files: file.to_owned(), verb: "is" },
        _ => NothingToIdentify::Free { experiment: name, files: files.join(", "), verb: "are" },
    }
}

/// The model of a periodic identification.
pub fn periodic_model(experiment: &Experiment, found: &PeriodicIdentification) -> Model {
    Model {
        format: 1,
        points: found.points(),
        static_map: None,
        effects: Vec::new(),
        provenance: Some(Provenance {
            records: found.fitted_files().map(str::to_owned).collect(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            output: experiment.output,
            command_rate_hz: experiment.command_rate_hz,
            esc_frame_hz: experiment.esc_frame_hz,
        }),
    }
}

/// The records that a lag might be fitted to by another way, and are not: multisines were, or `fitted` was. Squares are
/// for validation.
fn left_out(experiment: &Experiment, fitted: Option<&Record>) -> Vec<String> {
    let reason =
        fitted.map_or_else(|| String::from("multisine records come first"), |r| format!("{} is fitted", r.file));
    let others = experiment.records.iter().filter(|record| fitted.is_none_or(|fitted| fitted.file != record.file));
    let may_fit = others.filter(|record| record.role != Some(Role::Validate));
    let sentence = |record: &Record| {
        let (what, levels) = match record.excitation {
            Excitation::Multisine | Excitation::Square => return None,
            Excitation::Step => ("a step", "; its levels are in the static map"),
            Excitation::Staircase => ("a staircase", "; its levels are in the static map"),
            Excitation::Triangle => ("a triangle", ""),
            Excitation::Chirp => ("a chirp", ""),
            Excitation::Free => ("`free`", ""),
        };
        Some(format!(
            "{} is {what}, and no lag is fitted to it: {reason}{levels}. Identify it in a folder of its own, or give it role = \"validate\"",
            record.file
        ))
    };
    may_fit.filter_map(sentence).collect()
}

fn periodic_warnings(found: &PeriodicIdentification) -> Vec<String> {
    let all = found.warnings.iter().chain(found.nominals.iter().flat_map(|nominal| &nominal.warnings));
    all.map(with_advice).collect()
}
