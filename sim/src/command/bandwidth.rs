//! `rotorlead bandwidth`

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use miette::WrapErr as _;
use rotorlead::design::LeadParameters;
use serde_json::json;

use super::outcome::{JsonOption, Outcome};
use super::parameters::{DesignArguments, positive};
use super::progress;
use crate::design::{Chain, bandwidths_with, read_compensator};
use crate::identify::{IdentifyError, MeasuredBandwidth, PeriodicOptions, identify_periodic};
use crate::plant::effect::Linearity;
use crate::plant::{ActiveEffect, Model};
use crate::record::Experiment;
use crate::report::{bandwidth_json, bandwidth_table, measured_json, measured_table};

/// Bootstrap draws behind the interval of a measured bandwidth.
pub const RESAMPLES: usize = 1000;
/// Where they start.
const SEED: u64 = 1;

/// Predicts the bandwidth at each point of a model, with and without a compensator, and measures it on records
///
/// The bandwidth is the smallest frequency at which the response is 3 dB (exactly) under its static value. Without
/// --compensator one is designed from the model, as `rotorlead design` would.
#[derive(Args, Debug)]
pub struct Bandwidth {
    /// The model, as `rotorlead identify` writes it
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// The compensator, as `rotorlead design` writes it
    #[arg(long, value_name = "FILE", conflicts_with_all = ["lead", "omega_g", "damping", "loop_rate", "prewarp"])]
    compensator: Option<PathBuf>,
    /// A continuous compensator by its parameters: zero and poles in rad/s, and damping
    #[arg(long, value_name = "ZERO,POLES,DAMPING", value_parser = lead, allow_hyphen_values = true, conflicts_with_all = ["sampled", "omega_g", "damping", "loop_rate", "prewarp"])]
    lead: Option<LeadParameters>,
    /// Count the filter with its rounded coefficients, and the holds of its loop and of the ESC
    #[arg(long)]
    sampled: bool,
    /// Rate at which the ESC takes over a command, for --sampled; what the model was identified with unless given
    #[arg(long, value_name = "HZ", requires = "sampled", value_parser = positive, allow_negative_numbers = true)]
    esc_frame: Option<f64>,
    /// Also measure the bandwidths of this experiment's multisine records; may be given several times
    #[arg(long, value_name = "DIR")]
    records: Vec<PathBuf>,
    #[command(flatten)]
    parameters: DesignArguments,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl Bandwidth {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        let model = Model::read(&self.model)?;
        let effects = ActiveEffect::of_model(&model)?;
        let points = match &self.lead {
            Some(lead) => bandwidths_with(&model, &effects, Chain::Continuous(lead)),
            None => {
                let design = match &self.compensator {
                    Some(file) => read_compensator(file)?,
                    None => self.parameters.design(&model, &self.model)?,
                };
                let identified = model.provenance.as_ref().and_then(|provenance| provenance.esc_frame_hz);
                let esc_frame_hz = self.esc_frame.or(identified);
                bandwidths_with(
                    &model,
                    &effects,
                    if self.sampled {
                        Chain::Sampled { design: &design, esc_frame_hz }
                    } else {
                        Chain::Continuous(design.lead())
                    },
                )
            }
        };
        let mut text = bandwidth_table(&points);
        text.push_str(&counted_effects(&effects));
        let mut json = json!({ "points": bandwidth_json(&points) });
        if !effects.is_empty() {
            let left_out = effects.iter().map(ActiveEffect::kind).filter(|kind| kind.linearity == Linearity::Absent);
            json["left_out"] = left_out.map(|kind| kind.id).collect();
        }
        if !self.records.is_empty() {
            let measured = self.measure()?;
            text.push('\n');
            text.push_str(&measured_table(&measured));
            json["measured"] = measured_json(&measured);
        }
        Ok(Outcome { text, json })
    }

    /// The bandwidths that the records show.
    fn measure(&self) -> miette::Result<Vec<MeasuredBandwidth>> {
        let mut measured = Vec::new();
        for folder in &self.records {
            let experiment = Experiment::read(folder)?;
            let bar = progress::spinner("measuring");
            let of = || -> Result<_, IdentifyError> {
                identify_periodic(&experiment, &PeriodicOptions::default())?.bandwidths(RESAMPLES, SEED)
            };
            measured.extend(of().map_err(miette::Report::from).wrap_err_with(|| format!("`{}`", folder.display()))?);
            bar.finish_and_clear();
        }
        Ok(measured)
    }
}

/// What of the model's effects is in the bandwidths; nothing for a model without any.
fn counted_effects(effects: &[ActiveEffect]) -> String {
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
    let numbers: Vec<f64> = text
        .split(',')
        .map(|part| part.trim().parse().map_err(|_| format!("`{part}` is not a number")))
        .collect::<Result<_, _>>()?;
    match numbers[..] {
        [omega_z_rad_s, omega_f_rad_s, damping] if numbers.iter().all(|number| *number > 0.0 && number.is_finite()) => {
            LeadParameters { omega_z_rad_s, omega_f_rad_s, damping }.checked().map_err(|error| error.to_string())
        }
        _ => Err(String::from(
            "three numbers above zero are needed: zero and poles in rad/s, and damping, as in 14.13,94.2,0.707",
        )),
    }
}
