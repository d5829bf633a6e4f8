//! `--redesign` of `rotorlead diagnose`: a compensator from the improved model, and whether it is to be used.

use std::path::PathBuf;

use clap::Args;
use rotorlead_answer::{Answer, Section};
use rotorlead_design::redesign::{RedesignOptions, redesign};
use rotorlead_diagnose::Diagnosis;
use rotorlead_plant::bench::PAPER_AMPLITUDE;
use rotorlead_records::files::{AcceptedRange, check_writable};
use rotorlead_results::{Chosen, design_section, redesign_answer};
use serde_json::json;

use super::UsageError;
use super::parameters::{DesignArguments, number};
use super::progress;
use super::replacement::written_to;

/// What is asked of a redesign.
#[derive(Args, Debug)]
pub struct RedesignArguments {
    /// Design the compensator again from the improved model, and predict the bandwidth with the effects present; refuses
    /// to speed up an actuator whose limits it would pass
    #[arg(long)]
    redesign: bool,
    /// Where the compensator goes, for --redesign
    #[arg(long, value_name = "FILE", requires = "redesign")]
    out_compensator: Option<PathBuf>,
    /// Peak deviation of the command for which the prediction is made, for --redesign; 0.05 unless given
    #[arg(long, value_name = "U", requires = "redesign", value_parser = number(AcceptedRange::AMPLITUDE), allow_negative_numbers = true)]
    at_amplitude: Option<f64>,
    #[command(flatten)]
    parameters: DesignArguments,
}

/// What came of it.
pub struct Redesigned {
    /// Whether the compensator is to be used.
    pub answer: Answer,
    /// For a report, with the compensator's own.
    pub sections: Vec<Section>,
    /// What was written.
    pub written: String,
}

impl RedesignArguments {
    /// Refuses options that need `--redesign` without it, and files that cannot be written.
    pub fn check(&self) -> miette::Result<()> {
        if self.parameters.is_given() && !self.redesign {
            return Err(UsageError::new(
                "--kind and the parameters of a compensator are those of a redesign",
                "add --redesign, or leave them out",
            )
            .into());
        }
        self.parameters.request()?;
        Ok(self.out_compensator.as_deref().map_or(Ok(()), check_writable)?)
    }

    /// Designs for the model that was found, where that is asked for. `esc_frame_hz` is that of the experiment.
    pub fn run(&self, found: &Diagnosis, esc_frame_hz: Option<f64>) -> miette::Result<Option<Redesigned>> {
        if !self.redesign {
            return Ok(None);
        }
        let amplitude = self.at_amplitude.unwrap_or(PAPER_AMPLITUDE);
        let Chosen { options: design, findings, .. } = self.parameters.request()?.chosen_or_lead(&found.model);
        let options = RedesignOptions { design, amplitude, esc_frame_hz };
        let bar = progress::estimate("designing", found.model.points.len() as u64);
        let redesigned = redesign(&found.model, &options, &|| progress::step(&bar));
        bar.finish_and_clear();
        let mut answer = redesign_answer(found, redesigned.as_ref(), amplitude);
        answer.findings.extend(findings);
        let to_use = redesigned.as_ref().ok().filter(|redesigned| !redesigned.is_refused());
        let design = to_use.map(|redesigned| &redesigned.full.design);
        let out = self.out_compensator.as_deref();
        let written = match (design, out) {
            (Some(design), Some(out)) => {
                design.write(out)?;
                format!("{}\n", written_to(out))
            }
            (None, Some(out)) => format!("Nothing is written to {}\n", out.display()),
            (_, None) => String::new(),
        };
        answer.values.insert("written".to_owned(), json!(design.and(out).is_some()));
        let designed = design.map(|design| design_section(design, &found.model));
        let sections = std::iter::once(answer.section()).chain(designed).collect();
        Ok(Some(Redesigned { answer, sections, written }))
    }
}
