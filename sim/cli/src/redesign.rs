//! `--redesign` of `rotorlead diagnose`: a compensator from the improved model, and whether it is to be used.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use miette::Diagnostic as _;
use rotorlead_answer::Section;
use rotorlead_diagnose::{Diagnosis, Verdict};
use rotorlead_identify::design::redesign::{
    Compensated, Limit, PAPER_AMPLITUDE, Redesign, RedesignError, RedesignOptions, RedesignPoint, redesign,
};
use rotorlead_records::files::{FileError, Quantity, check_writable};
use rotorlead_results::{bandwidth_text, in_short, redesign_sections, redesign_table};
use serde::Serialize;

use super::WrongUse;
use super::parameters::{DesignArguments, number};
use super::progress;
use super::replaced::written_to;
use rotorlead_answer::words::wrapped;

/// Width of what is said.
const WIDTH: usize = 80;

const DESIGNED: &str = "A compensator is designed for the improved model.";
const REFUSED: &str = "The compensator is refused: it would ask for more than the actuator follows.";

/// What is asked of a redesign.
#[derive(Args, Debug)]
pub struct RedesignArguments {
    /// Design the compensator again from the improved model, and predict the bandwidth with the effects present; refuses
    /// to speed up an actuator whose limits it would pass
    #[arg(long, requires = "experiment")]
    redesign: bool,
    /// Where the compensator goes, for --redesign
    #[arg(long, value_name = "FILE", requires = "redesign")]
    out_compensator: Option<PathBuf>,
    /// Peak deviation of the command for which the prediction is made, for --redesign; 0.05 unless given
    #[arg(long, value_name = "U", requires = "redesign", value_parser = number(Quantity::AMPLITUDE), allow_negative_numbers = true)]
    at_amplitude: Option<f64>,
    #[command(flatten)]
    parameters: DesignArguments,
}

/// What came of it.
pub struct Redesigned {
    /// For people.
    pub text: String,
    /// For programs.
    pub values: Values,
    /// In a sentence, for the top of a report.
    pub verdict: &'static str,
    /// For a report.
    pub sections: Vec<Section>,
}

impl RedesignArguments {
    /// Refuses options that need `--redesign` without it, and files that cannot be written.
    pub fn check(&self) -> miette::Result<()> {
        if self.parameters.is_given() && !self.redesign {
            return Err(WrongUse::new(
                "--kind and the parameters of a compensator are those of a redesign",
                "add --redesign, or leave them out",
            )
            .into());
        }
        self.parameters.options()?;
        Ok(self.out_compensator.as_deref().map_or(Ok(()), check_writable)?)
    }

    /// Whether a redesign is asked for.
    pub fn is_given(&self) -> bool {
        self.redesign
    }

    /// Designs for the model that was found, where that is asked for. `esc_frame_hz` is that of the experiment.
    pub fn run(&self, found: &Diagnosis, esc_frame_hz: Option<f64>) -> miette::Result<Option<Redesigned>> {
        if !self.redesign {
            return Ok(None);
        }
        let amplitude = self.at_amplitude.unwrap_or(PAPER_AMPLITUDE);
        let options = RedesignOptions { design: self.parameters.options()?, amplitude, esc_frame_hz };
        let bar = progress::estimate("designing", found.model.points.len() as u64);
        let designed = redesign(&found.model, &options, &|| progress::step(&bar));
        bar.finish_and_clear();
        let mut redesigned = match designed {
            Ok(redesigned) => {
                let notes = notes(found, &redesigned);
                let written = self.write(&redesigned)?;
                let (name, verdict) =
                    if redesigned.is_refused() { ("refused", REFUSED) } else { ("designed", DESIGNED) };
                let said = said(&redesigned, amplitude, notes.clone());
                Redesigned {
                    text: words(&redesigned, amplitude, &notes),
                    verdict,
                    sections: redesign_sections(&redesigned, &found.model, amplitude, said),
                    values: Values {
                        verdict: name,
                        reasons: refusals(&redesigned),
                        designed: Some(Designed {
                            amplitude,
                            full: redesigned.full,
                            weaker: redesigned.weaker,
                            remarks: notes,
                        }),
                        written,
                    },
                }
            }
            Err(error) => not_designed(&error),
        };
        if let Some(out) = &self.out_compensator {
            let said = match redesigned.values.written {
                true => written_to(out),
                false => format!("Nothing is written to {}", out.display()),
            };
            let _ = writeln!(redesigned.text, "\n{said}");
        }
        Ok(Some(redesigned))
    }

    /// Writes the compensator that is to be used, and says whether there was one to write.
    fn write(&self, redesigned: &Redesign) -> Result<bool, FileError> {
        let Some(out) = self.out_compensator.as_deref().filter(|_| !redesigned.is_refused()) else { return Ok(false) };
        redesigned.full.design.write(out)?;
        Ok(true)
    }
}

fn not_designed(error: &RedesignError) -> Redesigned {
    let help = error.help().map(|help| format!(": {help}")).unwrap_or_default();
    let reason = format!("{error}{help}");
    Redesigned {
        text: format!("\nRedesign: none. {}\n", wrapped(&reason, WIDTH, "  ")),
        verdict: "No compensator can be designed for the improved model.",
        sections: vec![Section { text: vec![format!("None. {reason}")], ..Section::new("redesign", "Redesign") }],
        values: Values { verdict: "none", reasons: vec![reason], designed: None, written: false },
    }
}

/// What is to be said beyond the numbers: of the effects, and of what the diagnosis leaves open.
pub(super) fn notes(found: &Diagnosis, redesigned: &Redesign) -> Vec<String> {
    let mut notes = redesigned.remarks.clone();
    let others = || found.effects.iter().flat_map(|effect| &effect.alternatives);
    let bounds: Vec<&str> =
        others().map(|kind| kind.id).filter(|id| ["slew_limit", "saturation"].contains(id)).collect();
    if !bounds.is_empty() {
        notes.push(format!(
            "The records cannot exclude {}, which would limit what a lead can do. Do the next experiment first.",
            bounds.join(" or ")
        ));
    }
    match found.verdict {
        Verdict::Unknown => notes.push(
            "The model does not explain the records, and this prediction holds no better than it does.".to_owned(),
        ),
        Verdict::PartlyNamed => {
            notes.push("Something unexplained is left over, and is not in this prediction.".to_owned())
        }
        Verdict::Agrees | Verdict::Named => {}
    }
    notes
}

fn words(redesigned: &Redesign, amplitude: f64, notes: &[String]) -> String {
    let full = &redesigned.full;
    let mut text = String::new();
    let mut line = |line: &str| {
        text.push_str(line.trim_end());
        text.push('\n');
    };
    if redesigned.is_refused() {
        line(&format!("\nRedesign: refused at an amplitude of {amplitude}."));
        for refusal in refusals(redesigned) {
            line(&format!("  {}", wrapped(&refusal, WIDTH - 2, "    ")));
        }
        line("\nWhat the refused lead would do:");
    } else {
        line(&format!("\n{}", wrapped(&format!("Redesign: {}", in_short(&full.design)), WIDTH, "  ")));
    }
    line("");
    line(&redesign_table(full, amplitude).text());
    if redesigned.is_refused() {
        line(&wrapped(&strongest(redesigned), WIDTH, "  "));
    }
    if let Some(weaker) = &redesigned.weaker {
        line("");
        line(&redesign_table(weaker, amplitude).text());
    }
    for note in notes {
        line(&format!("  {}", wrapped(note, WIDTH - 2, "  ")));
    }
    text
}

/// The same as sentences for a report, which has the numbers in its tables.
fn said(redesigned: &Redesign, amplitude: f64, notes: Vec<String>) -> Vec<String> {
    let mut said = Vec::new();
    if redesigned.is_refused() {
        said.push(format!(
            "The lead is refused at an amplitude of {amplitude} duty; what it would do is shown all the same."
        ));
        said.extend(refusals(redesigned));
        said.push(strongest(redesigned));
    } else {
        said.push(format!(
            "The compensator is designed from the improved model. Its bandwidths are predicted for small deviations, and by sinusoids of \
             {amplitude} duty through the controller's own filter and the simulated actuator."
        ));
    }
    said.extend(notes);
    said
}

/// What there is in place of a lead that is refused.
fn strongest(redesigned: &Redesign) -> String {
    let weaker = redesigned.weaker.as_ref().and_then(|weaker| weaker.design.as_lead());
    let Some(lead) = weaker.map(|design| design.lead()) else {
        return "No weaker lead is worth having at this amplitude either.".to_owned();
    };
    format!(
        "The strongest lead that stays within the limits at this amplitude: --omega-g {:.1} (poles {:.2} rad/s)",
        (10.0 * lead.omega_g_rad_s()).floor() / 10.0,
        lead.omega_f_rad_s
    )
}

/// Why it is refused, at each point where it is.
pub(super) fn refusals(redesigned: &Redesign) -> Vec<String> {
    redesigned.full.points.iter().filter_map(|point| Some(refusal(point, point.passed()?))).collect()
}

fn refusal(point: &RedesignPoint, limit: &Limit) -> String {
    let nominal = point.small.nominal;
    let what = match limit.kind.id {
        "slew_limit" => format!("change faster than the {:.3} duty/s that are followed", limit.most),
        _ => format!("go farther than the {:.3} duty that are left up to the clip", limit.most),
    };
    let from = limit.passed_from_rad_s.unwrap_or_default();
    let largest = limit.largest_amplitude;
    let promised = bandwidth_text(point.small.compensated, 1);
    let alone = bandwidth_text(point.small.uncompensated, 1);
    let reached = bandwidth_text(point.chain.magnitude, 1);
    let reachable = limit.reachable_rad_s;
    format!(
        "u_nom {nominal:.3}: from {from:.1} rad/s on the compensated command would {what}. The {promised} rad/s that the lead \
         promises hold for amplitudes up to {largest:.4} duty; at {:.3} duty the chain reaches {reached} rad/s, and no \
         filter can make it much more than {reachable:.1} rad/s. Without one it is {alone} rad/s for small deviations.",
        point.amplitude
    )
}

/// What came of it, for programs.
#[derive(Serialize)]
pub struct Values {
    verdict: &'static str,
    reasons: Vec<String>,
    #[serde(flatten)]
    designed: Option<Designed>,
    written: bool,
}

/// A lead and its bandwidths, where one can be designed.
#[derive(Serialize)]
struct Designed {
    amplitude: f64,
    #[serde(flatten)]
    full: Compensated,
    weaker: Option<Compensated>,
    remarks: Vec<String>,
}
