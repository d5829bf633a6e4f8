//! `rotorlead bandwidth`

use std::path::PathBuf;

use clap::Args;
use miette::WrapErr as _;
use rotorlead::design::{DEFAULT_LOOP_RATE_HZ, LeadParameters};
use rotorlead_answer::{Fact, Report};
use rotorlead_design::{Chain, steps};
use rotorlead_plant::{CompensatorDesign, Model};
use rotorlead_records::Experiment;
use rotorlead_records::files::AcceptedRange;
use rotorlead_results::{BandwidthResult, Chosen, Designed, MeasuredRecords, deviations, in_short};

use super::latency::LatencyArguments;
use super::model_argument::ModelArgument;
use super::outcome::{JsonOption, Outcome};
use super::parameters::{DesignArguments, number};
use super::report_option::ReportOption;
use super::{progress, report_pages};

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
    #[command(flatten)]
    model: ModelArgument,
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
    #[arg(long, value_name = "HZ", requires = "sampled", value_parser = number(AcceptedRange::ESC_FRAME_HZ), allow_negative_numbers = true)]
    esc_frame: Option<f64>,
    /// Also simulate steps of these sizes, up and down, through the controller's own filter with its limits and the ESC's frames
    #[arg(long, value_name = "SIZE", value_delimiter = ',', conflicts_with = "lead", value_parser = number(AcceptedRange::AMPLITUDE), allow_negative_numbers = true)]
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
    pub(super) report: ReportOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl Bandwidth {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        self.report.check()?;
        // Before files are read: it may be wrong use.
        let request = self.parameters.request()?;
        self.latency.latency(request.loop_rate_hz())?;
        let model = Model::read(self.model.path())?;
        let (design, of_design) = match (&self.lead, &self.compensator) {
            (Some(_), _) => (None, Vec::new()),
            (None, Some(file)) => (Some(CompensatorDesign::read(file)?), Vec::new()),
            (None, None) => {
                let Chosen { options, findings, .. } = request.chosen_or_lead(&model);
                let designed = Designed::design(&model, &options)
                    .map_err(miette::Report::from)
                    .wrap_err_with(|| format!("`{}` gives no compensator", self.model.path().display()))?;
                (Some(designed.compensator(&model)), findings)
            }
        };
        let identified = model.provenance.as_ref().and_then(|provenance| provenance.esc_frame_hz);
        let esc_frame_hz = self.esc_frame.or(identified);
        let chain = match (&design, &self.lead) {
            (Some(design), _) if self.sampled => Chain::Sampled { design, esc_frame_hz },
            (Some(design), _) => Chain::Designed(design),
            (None, lead) => Chain::Continuous(lead.as_ref().expect("one is designed where none is given")),
        };
        let loop_rate_hz = design.as_ref().map_or(DEFAULT_LOOP_RATE_HZ, CompensatorDesign::loop_rate_hz);
        let mut found = BandwidthResult::predict(&model, chain, self.latency.latency(loop_rate_hz)?)?;
        found.findings.splice(0..0, of_design);
        let not_simulated = || format!("`{}` cannot be simulated", self.model.path().display());
        if let Some(design) = design.as_ref().filter(|_| !self.steps.is_empty()) {
            found.steps = Some(steps(&model, design, esc_frame_hz, &self.steps).wrap_err_with(not_simulated)?);
        }
        if let Some(design) = design.as_ref().filter(|_| self.robustness) {
            let bar = progress::bar("deviating", 0);
            let progress = |count: usize| {
                bar.set_length(count as u64);
                || bar.inc(1)
            };
            found.robustness = Some(deviations(&model, design, esc_frame_hz, progress).wrap_err_with(not_simulated)?);
            bar.finish_and_clear();
        }
        if !self.records.is_empty() {
            let mut measured = MeasuredRecords::default();
            for folder in &self.records {
                measured.extend(progress::over_files("measuring", &[folder], || -> miette::Result<_> {
                    MeasuredRecords::from_experiment(&Experiment::read(folder)?)
                        .map_err(miette::Report::from)
                        .wrap_err_with(|| format!("`{}`", folder.display()))
                })?);
            }
            found.measured = Some(measured);
        }
        let answer = found.answer(&model, chain);
        let report = self.report.write(|| {
            let parameters = match (&design, &self.lead) {
                (Some(design), _) => in_short(design),
                (None, Some(lead)) => format!(
                    "zero {:.4} rad/s, poles {:.4} rad/s, damping {:.4}",
                    lead.omega_z_rad_s, lead.omega_f_rad_s, lead.damping
                ),
                (None, None) => String::new(),
            };
            let compensator = self.compensator.as_deref().map(|file| report_pages::file("Compensator", file));
            let mut facts = vec![report_pages::file("Model", self.model.path())];
            facts.push(compensator.unwrap_or_else(|| Fact::new("Compensator", parameters)));
            facts.extend(self.records.iter().map(|folder| report_pages::file("Records", folder)));
            facts.push(report_pages::version());
            let title = format!("Bandwidths of {}", self.model.path().display());
            Report { facts, ..report_pages::answer_page("Bandwidth", title, &answer) }
        })?;
        Ok(Outcome::from_answer(&answer, &report))
    }
}

fn lead(text: &str) -> Result<LeadParameters, String> {
    let remedy = "give three numbers: zero and poles in rad/s, and damping, as in 14.13,94.2,0.707";
    let [zero, poles, damping] = text.split(',').map(str::trim).collect::<Vec<_>>()[..] else {
        return Err(remedy.to_owned());
    };
    let rad_s = number(AcceptedRange::FREQUENCY_RAD_S);
    let lead = LeadParameters {
        omega_z_rad_s: rad_s(zero)?,
        omega_f_rad_s: rad_s(poles)?,
        damping: number(AcceptedRange::DAMPING)(damping)?,
    };
    lead.checked().map_err(|error| error.to_string())
}
