//! What a design is, and what is predicted of it.

use rotorlead_identify::design::redesign::KindOptions;
use rotorlead_identify::design::{
    BandwidthPoint, Chain, ChainPhase, CompensatorError, DesignedInverse, Latency, REACH, Setting, bandwidths_with,
    chain_phases, design, design_inverse,
};
use rotorlead_plant::{
    ActiveEffect, CommandNoiseGain, CompensatorDesign, CompensatorProvenance, LeadFile, Model, StoredCoefficients,
    StoredCompensator, Word,
};
use rotorlead_records::Finding;
use rotorlead_vehicle::Recommendation;
use serde::Serialize;
use serde_json::Value;

use super::bandwidths::{BandwidthValues, bandwidth_values};
use super::latency::latency_json;
use super::lost_gain::lost_gain;
use super::sections::fastest_point;

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
    pub fn of(model: &Model, options: &KindOptions) -> Result<Self, CompensatorError> {
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
    /// The bandwidths at each point of the model.
    pub points: Vec<BandwidthPoint>,
    /// The phases of the whole chain there.
    pub phases: Vec<ChainPhase>,
    /// The pure delays that they count.
    pub latency: Latency,
    /// What is to be known before it flies.
    pub warnings: Vec<String>,
    /// What it was chosen from; `None` where its kind was asked for.
    pub recommendation: Option<Recommendation>,
}

/// The result for programs.
// There is one of them.
#[allow(clippy::large_enum_variant)]
#[derive(Serialize)]
#[serde(untagged)]
pub enum DesignValues {
    /// Of a lead.
    Lead(LeadValues),
    /// Of an inverse.
    Inverse(InverseValues),
}

/// Of a lead.
#[derive(Serialize)]
pub struct LeadValues {
    zero_rad_s: f64,
    pole_rad_s: f64,
    damping: f64,
    loop_rate_hz: f64,
    /// Null where there is no limit.
    slew_per_s: Option<f64>,
    coefficients: StoredCoefficients,
    provenance: Option<CompensatorProvenance>,
    warnings: Vec<String>,
    worst_deviation_db: f64,
    pole_radii: [f64; 2],
    l1_gain: f64,
    step_peak: f64,
    command_noise_gain: [CommandNoiseGain; 3],
    points: Vec<BandwidthValues>,
    latency: Value,
    /// Null where the kind was asked for.
    recommend: Option<Recommendation>,
}

/// Of an inverse.
#[derive(Serialize)]
pub struct InverseValues {
    #[serde(flatten)]
    stored: StoredCompensator,
    setting: &'static str,
    /// The lowest and the highest command at which the time constant was measured.
    measured: [f64; 2],
    /// Where the response may exceed the reference model most, and by which factor.
    worst: Worst,
    rounding_error: f64,
    step_peak: f64,
    command_noise_gain: [CommandNoiseGain; 3],
    warnings: Vec<String>,
    points: Vec<BandwidthValues>,
    latency: Value,
    /// Null where the kind was asked for.
    recommend: Option<Recommendation>,
}

#[derive(Serialize)]
struct Worst {
    nominal: f64,
    over_reference: f64,
}

impl DesignResult {
    /// Predicts what `designed` makes of `model`, whose effects are `effects`.
    #[must_use]
    pub fn of(model: &Model, effects: &[ActiveEffect], designed: Designed, latency: Latency) -> Self {
        let compensator = designed.compensator(model);
        let chain = Chain::Designed(&compensator);
        let points = bandwidths_with(model, effects, chain);
        let phases = chain_phases(model, effects, chain, &latency, &points);
        let doubts = match &designed {
            Designed::Lead(_) => uncertain_zero(model).into_iter().collect(),
            Designed::Inverse(inverse) => doubts(model, inverse),
        };
        let judged = judged(model).map(|finding| format!("warning: {}", finding.sentence()));
        let warnings = judged.into_iter().chain(doubts).chain(lost_gain(&points, &phases)).collect();
        Self { designed, compensator, points, phases, latency, warnings, recommendation: None }
    }

    /// The result for programs. What is not known is null.
    #[must_use]
    pub fn values(&self) -> DesignValues {
        let Self { designed, compensator, phases, latency, .. } = self;
        let (points, latency) =
            (bandwidth_values(&self.points, phases), latency_json(latency, Chain::Designed(compensator), phases));
        let warnings = self.warnings.clone();
        let recommend = self.recommendation.clone();
        match (designed, compensator.stored()) {
            (Designed::Lead(design), StoredCompensator::Lead(LeadFile { coefficients, provenance, .. })) => {
                let (check, lead) = (design.check(), design.lead());
                DesignValues::Lead(LeadValues {
                    zero_rad_s: lead.omega_z_rad_s,
                    pole_rad_s: lead.omega_f_rad_s,
                    damping: lead.damping,
                    loop_rate_hz: design.loop_rate_hz(),
                    slew_per_s: design.slew_per_s(),
                    coefficients,
                    provenance,
                    warnings,
                    worst_deviation_db: check.worst_deviation_db,
                    pole_radii: check.pole_radii,
                    l1_gain: check.l1_gain,
                    step_peak: check.step_peak,
                    command_noise_gain: compensator.command_noise_gain(),
                    points,
                    latency,
                    recommend,
                })
            }
            (Designed::Lead(_), StoredCompensator::Inverse(_)) => unreachable!("a lead is stored as one"),
            (Designed::Inverse(inverse), stored) => DesignValues::Inverse(InverseValues {
                stored,
                setting: setting_name(inverse.setting),
                measured: inverse.measured.into(),
                worst: Worst { nominal: inverse.worst.0, over_reference: inverse.worst.1 },
                rounding_error: inverse.compensator.design().rounding_error(),
                step_peak: compensator.step_peak(),
                command_noise_gain: compensator.command_noise_gain(),
                warnings,
                points,
                latency,
                recommend,
            }),
        }
    }
}

/// Said of a model that is not ready: whatever is built on it rests on that.
#[must_use]
pub fn judged(model: &Model) -> Option<Finding> {
    let judgement = model.judgement().filter(|judgement| judgement.state != Word::Ready)?;
    Some(Finding::warning(format!("the model was judged when it was identified, as {judgement}"), None))
}

/// Said of a compensator whose file names another model: what is predicted with this one holds for another motor.
#[must_use]
pub fn of_another_model(compensator: &CompensatorDesign, model: &Model) -> Option<String> {
    let (named, this) = (compensator.provenance.as_ref()?, CompensatorProvenance::new(model));
    (named.model_crc32 != this.model_crc32).then(|| {
        format!(
            "warning: the compensator was designed for {named}, and this is {this}: design it for this one, or give the model that it \
             was designed for"
        )
    })
}

/// A setting of an inverse as the command line names it.
#[must_use]
pub fn setting_name(setting: Setting) -> &'static str {
    match setting {
        Setting::Exact => "exact",
        Setting::Robust => "robust",
    }
}

/// What is to be known of an inverse before it flies.
fn doubts(model: &Model, designed: &DesignedInverse) -> Vec<String> {
    let range = designed.compensator.range();
    let ((from, to), (low, high)) = (range.compensated, designed.measured);
    let mut doubts = Vec::new();
    // To a millionth, as the default is.
    if from < low - REACH - 1e-6 || to > high + REACH + 1e-6 {
        doubts.push(format!(
            "warning: the inverse is in the path from {from:.3} to {to:.3}, and the time constant is measured from {low:.3} to {high:.3} \
             only. A table that is longer than the truth makes the rotor overshoot: measure there, or narrow --compensate-range"
        ));
    }
    if let Some(ratio) = model.time_constant_curve.as_ref().and_then(|curve| curve.down_over_up) {
        doubts.push(format!(
            "warning: steps down take {ratio:.2} times as long as steps up. The table has the time constants of the faster direction, so \
             that neither overshoots; the other one stays slower than the bandwidth says"
        ));
    }
    if range.slew_per_s.is_none() {
        doubts.push(
            "warning: no --slew is declared. Where the ESC has a limit the motor falls behind what the inverse reckons with, and \
             too fast a voltage step can break an ESC's lock. Without its settings at hand declare 20, 2 % per millisecond"
                .to_owned(),
        );
    }
    doubts
}

/// Standard error of the fastest time constant, as a part of it, above which a zero on its pole is doubtful: a tenth
/// moves the compensated response by about 1 dB.
const DOUBTFUL_PART: f64 = 0.1;

/// Said when the fastest pole is known badly: the fastest of many uncertain poles is likely to be so by chance.
fn uncertain_zero(model: &Model) -> Option<String> {
    let point = fastest_point(model)?;
    let part = point.time_constant_s_std.map(|std| std / point.time_constant_s).filter(|part| *part > DOUBTFUL_PART)?;
    Some(format!(
        "warning: the zero stands on the pole at u_nom {:.3}, whose standard error is {:.0} %. It may be the fastest by \
         chance, and then the other levels get too little lead. Measure there again, or remove its [[point]] from the model",
        point.nominal,
        100.0 * part
    ))
}
