//! `rotorlead bandwidth`

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use miette::WrapErr as _;
use rotorlead::design::{DEFAULT_LOOP_RATE_HZ, LeadParameters};
use rotorlead_answer::{Fact, Report};
use rotorlead_identify::design::{Chain, StepPoint, bandwidths_with, chain_phases, steps};
use rotorlead_identify::{
    IdentifyError, MeasuredBandwidth, PeriodicIdentification, PeriodicOptions, identify_periodic,
};
use rotorlead_plant::effect::{Kind, Linearity};
use rotorlead_plant::{ActiveEffect, CompensatorDesign, Model};
use rotorlead_records::Experiment;
use rotorlead_records::files::Quantity;
use rotorlead_results::{
    BandwidthValues, bandwidth_section, bandwidth_table, bandwidth_values, in_short, judged, latency_json, lost_gain,
    measured_response, measured_table, of_another_model, simulated_response, simulation_and_experiment, steps_table,
};
use serde::Serialize;
use serde_json::Value;

use super::deviations::{self, Deviations};
use super::latency::{LatencyArguments, counted_delays, counted_holds};
use super::outcome::{JsonOption, Outcome, without_mark};
use super::parameters::{DesignArguments, number};
use super::report_option::ReportOption;
use super::{progress, report_pages};
use rotorlead_answer::words::paragraph;

/// Bootstrap draws behind the interval of a measured bandwidth.
pub const RESAMPLES: usize = 1000;
/// Where they start.
const SEED: u64 = 1;

/// Predicts the bandwidth at each point of a model, with and without a compensator, and measures it on records
///
/// The bandwidth is the smallest frequency at which the response is 3 dB (exactly) under its static value. Without
/// --compensator a lead is designed from the model, as `rotorlead design --kind lead` would. Beside each stands the phase there of the
/// whole chain, from the flight controller's pulse to the response, and the frequency at which that phase is -90 degrees:
/// the crossover of a rate controller has to lie below. Warns where dead time makes the gained bandwidth worthless: at the new
/// bandwidth it lags more than 1 rad alone, and the whole chain more than 90 degrees. Warns too where the compensator's file
/// names another model than this one.
#[derive(Args, Debug)]
pub struct Bandwidth {
    /// The model, as `rotorlead identify` writes it
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// The compensator, as `rotorlead design` writes it
    #[arg(long, value_name = "FILE", conflicts_with_all = ["lead", "kind", "omega_g", "damping", "loop_rate", "prewarp", "natural", "setting", "slew", "output_range", "compensate_range"])]
    compensator: Option<PathBuf>,
    /// A continuous compensator by its parameters: zero and poles in rad/s, and damping
    #[arg(long, value_name = "ZERO,POLES,DAMPING", value_parser = lead, allow_hyphen_values = true, conflicts_with_all = ["sampled", "kind", "omega_g", "damping", "loop_rate", "prewarp", "natural", "setting", "slew", "output_range", "compensate_range"])]
    lead: Option<LeadParameters>,
    /// Count the filter with its rounded coefficients, and the holds of its loop and of the ESC
    #[arg(long)]
    sampled: bool,
    /// Rate at which the ESC takes over a command, for --sampled; what the model was identified with unless given. Frames
    /// that follow the input's pulses come at --input-frame
    #[arg(long, value_name = "HZ", requires = "sampled", value_parser = number(Quantity::ESC_FRAME_HZ), allow_negative_numbers = true)]
    esc_frame: Option<f64>,
    /// Also simulate steps of these sizes, up and down, through the controller's own filter with its limits and the ESC's frames
    #[arg(long, value_name = "SIZE", value_delimiter = ',', conflicts_with = "lead", value_parser = number(Quantity::AMPLITUDE), allow_negative_numbers = true)]
    steps: Vec<f64>,
    /// Also simulate actuators that differ from the model (time constants, sag, delays, a second lag), beside the paper's lead
    #[arg(long, conflicts_with = "lead")]
    robustness: bool,
    /// Also measure the bandwidths of this experiment's multisine records; may be given several times
    #[arg(long, value_name = "DIR")]
    records: Vec<PathBuf>,
    #[command(flatten)]
    parameters: DesignArguments,
    #[command(flatten)]
    latency: LatencyArguments,
    #[command(flatten)]
    report: ReportOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

/// What came out, for programs.
#[derive(Serialize)]
struct Values {
    points: Vec<BandwidthValues>,
    latency: Value,
    warnings: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    steps: Option<Vec<StepPoint>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    robustness: Option<Vec<deviations::Values>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    left_out: Option<Vec<&'static Kind>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    measured: Option<Vec<MeasuredBandwidth>>,
}

impl Bandwidth {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        self.report.check()?;
        // Before files are read: it may be wrong use.
        self.latency.latency(DEFAULT_LOOP_RATE_HZ)?;
        self.parameters.options()?;
        let model = Model::read(&self.model)?;
        let effects = ActiveEffect::of_model(&model)?;
        let design = match (&self.lead, &self.compensator) {
            (Some(_), _) => None,
            (None, Some(file)) => Some(CompensatorDesign::read(file)?),
            (None, None) => Some(self.parameters.design(&model, &self.model)?.compensator(&model)),
        };
        let identified = model.provenance.as_ref().and_then(|provenance| provenance.esc_frame_hz);
        let esc_frame_hz = self.esc_frame.or(identified);
        let chain = match (&design, &self.lead) {
            (Some(design), _) if self.sampled => Chain::Sampled { design, esc_frame_hz },
            (Some(design), _) => Chain::Designed(design),
            (None, lead) => Chain::Continuous(lead.as_ref().expect("one is designed where none is given")),
        };
        let lead_at = |nominal: f64| match &design {
            Some(design) => design.lead_at(nominal),
            None => self.lead,
        };
        let points = bandwidths_with(&model, &effects, chain);
        let latency =
            self.latency.latency(design.as_ref().map_or(DEFAULT_LOOP_RATE_HZ, CompensatorDesign::loop_rate_hz))?;
        let phases = chain_phases(&model, &effects, chain, &latency, &points);
        let other = design.as_ref().and_then(|design| of_another_model(design, &model));
        let warnings: Vec<String> = other
            .into_iter()
            .chain(judged(&model).map(|finding| format!("warning: {}", finding.sentence())))
            .chain(lost_gain(&points, &phases))
            .collect();
        let mut text = bandwidth_table(&points, &phases).text();
        text.push_str(&counted_delays(&latency, &phases));
        text.push_str(&counted_holds(&latency, chain, &phases));
        text.push_str(&counted_effects(&effects));
        for warning in &warnings {
            writeln!(text, "\n{}", paragraph(warning, "  ").trim_end()).expect("a string takes all");
        }
        let not_simulated = || format!("`{}` cannot be simulated", self.model.display());
        let mut stepped = None;
        if let Some(design) = design.as_ref().filter(|_| !self.steps.is_empty()) {
            let found = steps(&model, design, esc_frame_hz, &self.steps).wrap_err_with(not_simulated)?;
            writeln!(text, "\n{}", steps_table(&found).text().trim_end()).expect("a string takes all");
            stepped = Some(found);
        }
        let differing = design.as_ref().filter(|_| self.robustness);
        let differing = differing.map(|design| Deviations::of(&model, design, esc_frame_hz)).transpose();
        let differing = differing.wrap_err_with(not_simulated)?;
        if let Some(differing) = &differing {
            writeln!(text, "\n{}", differing.table().text().trim_end()).expect("a string takes all");
        }
        let (mut measured, mut found) = (Vec::new(), Vec::new());
        if !self.records.is_empty() {
            (measured, found) = self.measure()?;
            text.push('\n');
            text.push_str(&measured_table(&measured).text());
        }
        text.push_str(&self.report.write(|| {
            let mut section = bandwidth_section(&points, &phases, &measured);
            section.figures.push(simulated_response(&model, &lead_at));
            section.tables.extend(stepped.as_deref().map(steps_table));
            section.tables.extend(differing.as_ref().map(Deviations::table));
            // Without and with compensator may be in different folders.
            let nominals = found.into_iter().flat_map(|found| found.nominals).collect();
            let all = PeriodicIdentification { nominals, warnings: Vec::new() };
            section.figures.extend(measured_response(&all, &all));
            section.figures.extend(design.as_ref().and_then(|design| simulation_and_experiment(&all, &all, design)));
            let mut facts = vec![report_pages::file("Model", &self.model)];
            let parameters = match (&design, &self.lead) {
                (Some(design), _) => in_short(design),
                (None, Some(lead)) => format!(
                    "zero {:.4} rad/s, poles {:.4} rad/s, damping {:.4}",
                    lead.omega_z_rad_s, lead.omega_f_rad_s, lead.damping
                ),
                (None, None) => String::new(),
            };
            facts.push(
                self.compensator
                    .as_deref()
                    .map_or(Fact::new("Compensator", parameters), |file| report_pages::file("Compensator", file)),
            );
            facts.extend(self.records.iter().map(|folder| report_pages::file("Records", folder)));
            facts.push(report_pages::version());
            let verdict = report_pages::faster_as_measured(&points, &measured);
            let title = format!("Bandwidths of {}", self.model.display());
            Report {
                facts,
                warnings: without_mark(&warnings),
                sections: vec![section],
                ..report_pages::report("Bandwidth", title, verdict)
            }
        })?);
        let left_out = effects.iter().map(ActiveEffect::kind).filter(|kind| kind.linearity == Linearity::Absent);
        let values = Values {
            points: bandwidth_values(&points, &phases),
            latency: latency_json(&latency, chain, &phases),
            warnings,
            steps: stepped,
            robustness: differing.as_ref().map(Deviations::values),
            left_out: (!effects.is_empty()).then(|| left_out.collect()),
            measured: (!self.records.is_empty()).then_some(measured),
        };
        Ok(Outcome::new(text, &values))
    }

    /// The bandwidths that the records show, and the responses behind them.
    fn measure(&self) -> miette::Result<(Vec<MeasuredBandwidth>, Vec<PeriodicIdentification>)> {
        let (mut measured, mut all) = (Vec::new(), Vec::new());
        for folder in &self.records {
            let (bandwidths, found) = progress::of_files("measuring", &[folder], || -> miette::Result<_> {
                let experiment = Experiment::read(folder)?;
                let of = || -> Result<_, IdentifyError> {
                    let found = identify_periodic(&experiment, &PeriodicOptions::default())?;
                    Ok((found.bandwidths(RESAMPLES, SEED)?, found))
                };
                of().map_err(miette::Report::from).wrap_err_with(|| format!("`{}`", folder.display()))
            })?;
            measured.extend(bandwidths);
            all.push(found);
        }
        Ok((measured, all))
    }
}

/// What of the model's effects is in the bandwidths; nothing for a model without any.
pub fn counted_effects(effects: &[ActiveEffect]) -> String {
    let ids = |counted: &dyn Fn(Linearity) -> bool| -> Vec<&str> {
        effects.iter().map(ActiveEffect::kind).filter(|kind| counted(kind.linearity)).map(|kind| kind.id).collect()
    };
    let mut text = String::new();
    for (ids, said) in [
        (ids(&|l| matches!(l, Linearity::Exact | Linearity::Mean)), "Counted"),
        (ids(&|l| l == Linearity::SmallSignal), "Counted for small deviations from u_nom only"),
        (ids(&|l| l == Linearity::Absent), "Left out, since it has no frequency response"),
    ] {
        if !ids.is_empty() {
            writeln!(text, "  {said}: {}", ids.join(", ")).expect("a string takes all");
        }
    }
    text
}

fn lead(text: &str) -> Result<LeadParameters, String> {
    let remedy = "give three numbers: zero and poles in rad/s, and damping, as in 14.13,94.2,0.707";
    let [zero, poles, damping] = text.split(',').map(str::trim).collect::<Vec<_>>()[..] else {
        return Err(remedy.to_owned());
    };
    let rad_s = number(Quantity::FREQUENCY_RAD_S);
    let lead = LeadParameters {
        omega_z_rad_s: rad_s(zero)?,
        omega_f_rad_s: rad_s(poles)?,
        damping: number(Quantity::DAMPING)(damping)?,
    };
    lead.checked().map_err(|error| error.to_string())
}
