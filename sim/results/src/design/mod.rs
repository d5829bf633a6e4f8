//! What a design is, and what is predicted of it.

mod findings;
pub(crate) mod tables;

pub use tables::{design_section, in_short};

use rotorlead_answer::{Answer, Tone, Verdict};
use rotorlead_design::redesign::KindOptions;
use rotorlead_design::{
    Chain, CompensatorError, DesignedInverse, Latency, MOST_OVER_REFERENCE, Setting, design, design_inverse,
};
use rotorlead_plant::{CompensatorDesign, Model};
use rotorlead_records::Finding;
use rotorlead_vehicle::{Purpose, Recommendation};
use serde_json::{Map, Value, json};

use super::bandwidth::{BandwidthResult, predicted_bandwidth};
use super::caveats::{doubts_in_short, judged};
use super::recommendation::recommendation_table;
use super::request::{Chosen, DesignRequest, RequestError};
use crate::json_object::json_object;

/// A compensator with what its design says of it.
// There is one of them.
#[allow(clippy::large_enum_variant)]
pub enum Designed {
    /// A lead.
    Lead(rotorlead::design::LeadDesign),
    /// An inverse.
    Inverse(DesignedInverse),
}

impl Designed {
    /// Designs for `model`.
    ///
    /// # Errors
    /// [`CompensatorError`] where no compensator can be made of it.
    pub fn design(model: &Model, options: &KindOptions) -> Result<Self, CompensatorError> {
        match options {
            KindOptions::Lead(options) => design(model, options).map(Self::Lead),
            KindOptions::Inverse(options) => design_inverse(model, options).map(Self::Inverse),
        }
    }

    /// What runs, designed for `model`.
    #[must_use]
    pub fn compensator(&self, model: &Model) -> CompensatorDesign {
        let design: CompensatorDesign = match self {
            Self::Lead(design) => (*design).into(),
            Self::Inverse(designed) => designed.compensator.clone().into(),
        };
        design.designed_for(model)
    }
}

/// A design, and what is predicted of it.
pub struct DesignResult {
    /// What was designed.
    pub designed: Designed,
    /// What runs.
    pub compensator: CompensatorDesign,
    /// What it makes of the model.
    pub bandwidth: BandwidthResult,
    /// What it was chosen from; `None` where its kind was asked for.
    pub recommendation: Option<Recommendation>,
    /// What is to be known before it flies, beside what the model was judged to be.
    pub findings: Vec<Finding>,
}

impl DesignRequest {
    /// Designs for `model` what is asked for, or what is recommended for `purpose`, and predicts what comes of it.
    ///
    /// # Errors
    /// Where none is recommended, or the kind cannot be designed.
    pub fn design(&self, model: &Model, purpose: Purpose, latency: Latency) -> Result<DesignResult, RequestError> {
        DesignResult::design(model, self.chosen(model, purpose, None)?, latency)
    }
}

impl DesignResult {
    /// Designs what was `chosen` for `model`, and predicts what comes of it.
    ///
    /// # Errors
    /// When it cannot be designed, or the model is impossible.
    pub fn design(model: &Model, chosen: Chosen, latency: Latency) -> Result<Self, RequestError> {
        let Chosen { options, recommendation, findings } = chosen;
        let designed = Designed::design(model, &options)?;
        let compensator = designed.compensator(model);
        let bandwidth = BandwidthResult::predict(model, Chain::Designed(&compensator), latency)?;
        let findings = [bandwidth.findings.clone(), findings, findings::doubts(model, &designed)].concat();
        Ok(Self { designed, compensator, bandwidth, recommendation, findings })
    }

    /// The answer, for the model that it was designed for.
    #[must_use]
    pub fn answer(&self, model: &Model) -> Answer {
        let mut of_design = design_section(&self.compensator, model);
        let of_bandwidth = self.bandwidth.section(Chain::Designed(&self.compensator));
        let findings: Vec<Finding> = judged(model).into_iter().chain(self.findings.clone()).collect();
        let compared = self.recommendation.iter().map(recommendation_table);
        if let (Designed::Inverse(inverse), Some(table)) = (&self.designed, of_design.tables.first_mut()) {
            table.notes.push(within_intervals(inverse));
        }
        Answer {
            name: "compensator",
            title: "Compensator",
            text: Vec::new(),
            verdict: self.verdict(model, &findings),
            findings,
            tables: compared.chain(of_design.tables).chain(of_bandwidth.tables).collect(),
            figures: [of_design.figures, of_bandwidth.figures].concat(),
            values: self.values(),
        }
    }

    /// What is designed, what it does to the bandwidths, and how much room it takes.
    fn verdict(&self, model: &Model, findings: &[Finding]) -> Verdict {
        let tone = if findings.is_empty() { Tone::Good } else { Tone::Attention };
        let room = format!(
            "A step of the command becomes up to {:.2} times as large: leave room for it, or the command is clipped.",
            self.compensator.step_peak()
        );
        let lead = if self.compensator.as_lead().is_some() { "lead, " } else { "" };
        Verdict::new(tone, format!("Designed: {lead}{}.", in_short(&self.compensator))).with(
            doubts_in_short(model, &self.bandwidth.points, &self.bandwidth.phases)
                .into_iter()
                .chain([predicted_bandwidth(&self.bandwidth.points), room])
                .collect(),
        )
    }

    /// For programs: what the file holds, and what its check and the predictions say. What is not known is null.
    fn values(&self) -> Map<String, Value> {
        let mut values = json_object(&self.compensator.stored());
        for key in ["slew_per_s", "provenance"] {
            values.entry(key).or_insert(Value::Null);
        }
        values.extend(json_object(&match &self.designed {
            Designed::Lead(design) => {
                let check = design.check();
                json!({
                    "worst_deviation_db": check.worst_deviation_db,
                    "pole_radii": check.pole_radii,
                    "l1_gain": check.l1_gain,
                })
            }
            Designed::Inverse(inverse) => json!({
                "setting": setting_name(inverse.setting),
                // The lowest and the highest command at which the time constant was measured.
                "measured": inverse.measured,
                // Where the response may exceed the reference model most, and by which factor.
                "worst": { "nominal": inverse.worst.0, "over_reference": inverse.worst.1 },
                "rounding_error": inverse.compensator.design().rounding_error(),
            }),
        }));
        values.extend(json_object(&json!({
            "step_peak": self.compensator.step_peak(),
            "command_noise_gain": self.compensator.command_noise_gain(),
            "recommend": self.recommendation,
        })));
        values.extend(self.bandwidth.values(Chain::Designed(&self.compensator)));
        values
    }
}

/// How far an inverse may exceed its reference model.
fn within_intervals(designed: &DesignedInverse) -> String {
    let (nominal, factor) = designed.worst;
    format!(
        "Setting {}: by the intervals of the time constants the response is at most {factor:.3} times that of the reference model, at \
         command {nominal:.3}; {MOST_OVER_REFERENCE} is allowed.",
        setting_name(designed.setting)
    )
}

/// A setting of an inverse as the command line names it.
fn setting_name(setting: Setting) -> &'static str {
    match setting {
        Setting::Exact => "exact",
        Setting::Robust => "robust",
    }
}
