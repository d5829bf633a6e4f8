//! A compensator for an actuator with effects: what it promises, what the whole chain makes of that, and whether it is to be
//! used.
//!
//! The design is that of [`design`], from the lags alone: a lead hides lags. What the effects make of it is
//! predicted twice, by the linearized chain ([`bandwidths_with`], small deviations) and by sinusoids of a given amplitude
//! through the controller's own filter and the simulated actuator. Where an actuator is bounded in its command or in the
//! rate of it, and the lead would ask for more than that below the bandwidth that it promises, the lead is refused.

mod command_limits;
mod remarks;
mod slowest;
pub(super) mod sweep;

pub use command_limits::Limit;
pub use sweep::ChainBandwidth;

use rotorlead_plant::effect::{saturation, slew_limit};
use rotorlead_plant::{ActiveEffect, CompensatorDesign, FilterDesign, LinearChain, Model, PlantError, Point};
use serde::{Serialize, Serializer};

use command_limits::Bound;
use slowest::slowest_within_interval;
use sweep::Sweep;

use super::{
    BandwidthPoint, Chain, CompensatorError, DesignOptions, InverseOptions, bandwidths_with, design, design_inverse,
};
use rotorlead_identify::frequency_response::bandwidth::Bandwidth;

/// How far beyond the linear bandwidth the chain is searched. Chosen: a bandwidth farther up is reported as beyond; each factor
/// of 2.5 costs seven sinusoids.
const SEARCHED_BEYOND: f64 = 2.5;
/// A lead that gains less than this is not worth its noise. Chosen: a tenth is of the order of what a time constant is known to.
const LEAST_GAIN: f64 = 1.1;

/// Which kind of compensator, and what is asked of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KindOptions {
    /// A lead.
    Lead(DesignOptions),
    /// A conditioned inverse.
    Inverse(InverseOptions),
}

/// What is asked for beside the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RedesignOptions {
    /// The design.
    pub design: KindOptions,
    /// Peak deviation of the command ahead of the filter, 0..1. Near the ends of the command's range it is what room there is.
    pub amplitude: f64,
    /// Rate at which the ESC takes over a command, hertz.
    pub esc_frame_hz: Option<f64>,
}

/// The bandwidths at one nominal command, with all effects.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RedesignPoint {
    /// Of small deviations, as `rotorlead bandwidth` says them.
    #[serde(flatten)]
    pub small: BandwidthPoint,
    /// Amplitude of the sinusoids.
    pub amplitude: f64,
    /// Of sinusoids through the whole chain.
    #[serde(flatten)]
    pub chain: ChainBandwidth,
    /// The bandwidth to -3 dB of the same where the rotor is as slow as the records allow, at 95 %; `None` where the model does not say
    /// how well its time constants are known.
    #[serde(rename = "chain_at_least_rad_s")]
    pub at_least: Option<Bandwidth>,
    /// What the lead asks of each bound of the actuator.
    pub limits: Vec<Limit>,
}

impl RedesignPoint {
    /// The bound that the lead would pass below its bandwidth, where it gains anything there.
    #[must_use]
    pub fn passed(&self) -> Option<&Limit> {
        self.limits.iter().find(|limit| limit.passed_from_rad_s.is_some())
    }
}

/// A compensator with what it does at each point.
#[derive(Clone, Debug, Serialize)]
pub struct Compensated {
    /// The compensator.
    #[serde(rename = "compensator", serialize_with = "parameters")]
    pub design: CompensatorDesign,
    /// At each point of the model.
    pub points: Vec<RedesignPoint>,
}

/// The parameters of a compensator.
fn parameters<S: Serializer>(design: &CompensatorDesign, serializer: S) -> Result<S::Ok, S::Error> {
    let loop_rate = ("loop_rate_hz", design.loop_rate_hz());
    match &design.kind {
        FilterDesign::Lead(design) => {
            let lead = design.lead();
            serializer.collect_map([
                ("zero_rad_s", lead.omega_z_rad_s),
                ("pole_rad_s", lead.omega_f_rad_s),
                ("damping", lead.damping),
                ("omega_g_rad_s", lead.omega_g_rad_s()),
                loop_rate,
            ])
        }
        FilterDesign::Inverse(inverse) => {
            let (reference, range) = (inverse.design().reference(), inverse.range());
            let slew = range.slew_per_s.map(|slew_per_s| ("slew_per_s", slew_per_s));
            let rest = [
                ("natural_rad_s", reference.omega_f_rad_s),
                ("damping", reference.damping),
                ("min", range.min),
                ("max", range.max),
                loop_rate,
            ];
            serializer.collect_map(rest.into_iter().chain(slew))
        }
    }
}

impl Compensated {
    /// Whether no bound is passed.
    #[must_use]
    pub fn is_within_bounds(&self) -> bool {
        self.points.iter().all(|point| point.passed().is_none())
    }
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Redesign {
    /// What the options ask for. To be used only where [`Compensated::is_within_bounds`].
    pub full: Compensated,
    /// Where that is refused: the strongest lead that stays within the bounds and gains something, if there is one.
    pub weaker: Option<Compensated>,
    /// What is to be said of each effect.
    pub remarks: Vec<String>,
}

impl Redesign {
    /// Whether the full lead is refused.
    #[must_use]
    pub fn is_refused(&self) -> bool {
        !self.full.is_within_bounds()
    }
}

/// Why there is no redesign.
#[derive(Clone, Debug, PartialEq, thiserror::Error, miette::Diagnostic)]
pub enum RedesignError {
    /// No compensator can be designed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Compensator(#[from] CompensatorError),
    /// The model cannot be simulated.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Plant(#[from] PlantError),
}

/// Designs for `model` with its effects. The limits that they set are those of an inverse; a lead that would pass them is refused.
/// `progress` is called whenever a compensator is done at one of the model's points: at each once, and once more where a weaker lead
/// is looked for.
///
/// # Errors
/// [`RedesignError`].
pub fn redesign(model: &Model, options: &RedesignOptions, progress: &dyn Fn()) -> Result<Redesign, RedesignError> {
    let effects = ActiveEffect::from_model(model)?;
    let full = match &options.design.within(&effects) {
        KindOptions::Lead(options) => CompensatorDesign::from(design(model, options)?),
        KindOptions::Inverse(options) => design_inverse(model, options)?.compensator.into(),
    };
    let full = full.designed_for(model);
    let remarks = effects.iter().filter_map(|effect| remarks::remark(effect, &full)).collect();
    let flown = flown(model, &effects);
    let full = compensated(&flown, full, options, progress)?;
    let weaker = match &options.design {
        KindOptions::Lead(lead) if !full.is_within_bounds() => weaker(&flown, lead, options, progress)?,
        _ => None,
    };
    Ok(Redesign { full, weaker, remarks })
}

impl KindOptions {
    /// With the limits that `effects` set an inverse where they are closer than those that are declared.
    #[must_use]
    pub fn within(self, effects: &[ActiveEffect]) -> Self {
        match self {
            Self::Lead(_) => self,
            Self::Inverse(options) => Self::Inverse(limited(options, effects)),
        }
    }
}

fn limited(options: InverseOptions, effects: &[ActiveEffect]) -> InverseOptions {
    effects.iter().fold(options, |mut options, effect| {
        match effect.kind().id {
            slew_limit::ID => {
                let rate_per_s = effect.slew_per_s();
                options.slew_per_s = options.slew_per_s.into_iter().chain(rate_per_s).reduce(f64::min);
            }
            saturation::ID => {
                let (low, high) = options.range;
                let max = effect.value("max").map_or(high, |max| max.min(high));
                let min = effect.value("min").map_or(low, |min| min.max(low));
                options.range = (min, max);
            }
            _ => {}
        }
        options
    })
}

/// The model with the effects that it has in flight too.
fn flown(model: &Model, effects: &[ActiveEffect]) -> Model {
    let has_flown =
        |kind: &str| effects.iter().any(|effect| effect.kind().id == kind && remarks::persists_in_flight(effect));
    let mut flown = model.clone();
    flown.effects.retain(|effect| has_flown(&effect.kind));
    flown
}

fn compensated(
    model: &Model,
    design: CompensatorDesign,
    options: &RedesignOptions,
    progress: &dyn Fn(),
) -> Result<Compensated, PlantError> {
    let slowest = slowest_within_interval(model);
    let points = small_with_limits(model, &design, options)?
        .into_iter()
        .zip(&model.points)
        .map(|((small, amplitude, limits), point)| {
            let chain = |model: &Model| chain(model, &design, options, point, amplitude, small.compensated);
            let at_least = slowest.as_ref().map(chain).transpose()?.map(|chain| chain.magnitude);
            let chain = chain(model)?;
            progress();
            Ok(RedesignPoint { small, amplitude, chain, at_least, limits })
        })
        .collect::<Result<_, PlantError>>()?;
    Ok(Compensated { design, points })
}

type WithLimits = (BandwidthPoint, f64, Vec<Limit>);

/// What is known without a simulation: bandwidths of small deviations, amplitudes, and what is asked of the bounds.
fn small_with_limits(
    model: &Model,
    design: &CompensatorDesign,
    options: &RedesignOptions,
) -> Result<Vec<WithLimits>, PlantError> {
    let effects = ActiveEffect::from_model(model)?;
    let small = bandwidths_with(model, &effects, Chain::Designed(design));
    let with_limits = |small: BandwidthPoint| {
        let linear = LinearChain::from_model(model, small.nominal)?;
        let amplitude = options.amplitude.min(small.nominal).min(1.0 - small.nominal);
        let up_to = small.compensated.reached_rad_s();
        let limits = design.as_lead().map_or_else(Vec::new, |design| {
            let lead = |omega| design.lead().response(omega);
            let against =
                |bound: Bound| bound.against(amplitude, up_to, lead, |omega| linear.frequency_response(omega));
            Bound::from_effects(&effects, small.nominal).into_iter().map(against).collect()
        });
        Ok((small, amplitude, limits))
    };
    small.into_iter().map(with_limits).collect()
}

fn chain(
    model: &Model,
    design: &CompensatorDesign,
    options: &RedesignOptions,
    point: &Point,
    amplitude: f64,
    small: Bandwidth,
) -> Result<ChainBandwidth, PlantError> {
    let gain = LinearChain::from_model(model, point.nominal)?.frequency_response(0.0).re;
    if gain == 0.0 || amplitude == 0.0 {
        // Beyond a clip nothing moves.
        return Ok(ChainBandwidth { magnitude: Bandwidth::At(0.0), phase: Bandwidth::At(0.0) });
    }
    let sweep = Sweep {
        model,
        design,
        esc_frame_hz: options.esc_frame_hz,
        nominal: point.nominal,
        amplitude,
        time_constant_s: point.time_constant_s,
        supply: 1.0,
    };
    sweep.bandwidth(gain, (SEARCHED_BEYOND * small.reached_rad_s()).min(sweep.highest_rad_s()))
}

/// The strongest lead within the bounds, found by halving `omega_g` down to 1 %. Chosen: finer than a time constant is known.
fn weaker(
    model: &Model,
    lead: &DesignOptions,
    options: &RedesignOptions,
    progress: &dyn Fn(),
) -> Result<Option<Compensated>, PlantError> {
    let with =
        |omega_g_rad_s: f64| design(model, &DesignOptions { omega_g_rad_s, ..*lead }).ok().map(CompensatorDesign::from);
    let is_within = |design: &CompensatorDesign| -> Result<bool, PlantError> {
        let points = small_with_limits(model, design, options)?;
        Ok(points.iter().all(|(_, _, limits)| limits.iter().all(|limit| limit.passed_from_rad_s.is_none())))
    };
    let fastest = model.points.iter().map(|point| 1.0 / point.time_constant_s).fold(0.0, f64::max);
    let (mut low, mut high) = (fastest, lead.omega_g_rad_s);
    let mut best = None;
    while high - low > 0.01 * high {
        let middle = 0.5 * (low + high);
        match with(middle) {
            Some(design) if is_within(&design)? => {
                best = Some(design);
                low = middle;
            }
            Some(_) => high = middle,
            // Too near to the pole to be a lead.
            None => low = middle,
        }
    }
    let Some(best) = best else { return Ok(None) };
    let found = compensated(model, best, options, progress)?;
    let gains = |point: &RedesignPoint| {
        point.small.compensated.reached_rad_s() > LEAST_GAIN * point.small.uncompensated.reached_rad_s()
    };
    Ok(found.points.iter().any(gains).then_some(found))
}
