//! What a lag with a dead time imitates well at the steps that it is fitted to: an ESC that ramps its command, a sensor that takes
//! means, and a filter behind it.
//!
//! At steps of one size a ramp and a mean look alike, as either lasts equally long at each of them. So all are tried against each other, and
//! against a dead time, which differs from them by where a response starts; one is named where it explains the most, and two where the
//! records cannot tell.

use rotorlead_diagnose::{Diagnosis, Options, diagnose};
use rotorlead_plant::effect::{moving_average, second_pole, slew_limit, transport_delay};
use rotorlead_plant::{Catalog, Model};
use rotorlead_records::Experiment;

use crate::remedy;

/// What is tried.
const RIVALS: [&str; 4] = [slew_limit::ID, transport_delay::ID, moving_average::ID, second_pole::ID];
/// What a model that has it is not asked for.
const IMITATED: [&str; 3] = [slew_limit::ID, moving_average::ID, second_pole::ID];
/// With the effect in the model, what is left beyond noise has to shrink to this part of its power. Chosen: it then explains more than all
/// else together; less would name what other effects imitate.
const SHRINKS_TO: f64 = 0.5;

/// An effect that explains most of what a lag misses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImitatedLag {
    kind: ImitatedKind,
    /// Whether the records cannot tell it from the other kind.
    is_ambiguous: bool,
}

/// Which.
#[derive(Clone, Copy, Debug, PartialEq)]
enum ImitatedKind {
    /// The ESC ramps its command, by so much of the range in a second.
    Ramp(f64),
    /// The sensor takes means over so many seconds.
    Mean(f64),
    /// A filter of the sensor, or another lag in series, has this time constant, seconds.
    Filter(f64),
}

impl ImitatedLag {
    /// The effect that explains the most of what the lags of `model` leave: of that which a diagnosis has `found`, if there was one. A
    /// model that has one of them is not asked.
    pub fn find(experiment: &Experiment, model: &Model, found: Option<&Diagnosis>) -> Option<Self> {
        if model.effects.iter().any(|effect| IMITATED.contains(&effect.kind.as_str())) {
            return None;
        }
        if let Some(found) = found {
            return Self::from_diagnosis(found);
        }
        let catalog = Catalog::standard().only(&RIVALS);
        Self::from_diagnosis(&diagnose(experiment, &Options { model: None, catalog: &catalog, progress: &|| () }).ok()?)
    }

    /// The one that is worth more than all else that is named, where most of what the lag misses is explained.
    fn from_diagnosis(found: &Diagnosis) -> Option<Self> {
        let effect = found.effects.first()?;
        let beyond_noise = |gap: f64| (gap * gap - found.gap.noise_floor * found.gap.noise_floor).max(0.0);
        if beyond_noise(found.gap.after) >= SHRINKS_TO * beyond_noise(found.gap.before) {
            return None;
        }
        let (_, value) = effect.parameters.first()?;
        let down_ratio = effect.parameters.iter().find(|(parameter, _)| parameter.name == "down_ratio");
        let (kind, other) = match effect.kind.id {
            slew_limit::ID => {
                let down_ratio = down_ratio.map_or(1.0, |(_, ratio)| ratio.value);
                (ImitatedKind::Ramp(slew_limit::slower_per_s(value.value, down_ratio)), moving_average::ID)
            }
            moving_average::ID => (ImitatedKind::Mean(value.value), slew_limit::ID),
            second_pole::ID => (ImitatedKind::Filter(value.value), moving_average::ID),
            _ => return None,
        };
        Some(Self { kind, is_ambiguous: effect.alternatives.iter().any(|kind| kind.id == other) })
    }

    /// Whether what was identified is then no lag of the motor; with a filter it still is one.
    pub fn is_no_lag(self) -> bool {
        !matches!(self.kind, ImitatedKind::Filter(_))
    }

    /// What it is.
    pub fn reason(self) -> String {
        let explains = "which explains most of what the lag misses";
        let cannot_tell = "the steps, which are of one size or nearly, cannot tell";
        match (self.kind, self.is_ambiguous) {
            (ImitatedKind::Ramp(rate_per_s), false) => {
                format!("the ESC seems to ramp its command, by {rate_per_s:.2} of the range in a second, {explains}")
            }
            (ImitatedKind::Mean(window_s), false) => {
                format!("the sensor seems to take means over {:.0} ms, {explains}", 1e3 * window_s)
            }
            (ImitatedKind::Filter(time_constant_s), false) => format!(
                "a second lag of {:.0} ms, as of a load cell's filter, is in series, {explains}",
                1e3 * time_constant_s
            ),
            (ImitatedKind::Filter(time_constant_s), true) => format!(
                "either a second lag of {:.0} ms, as of a load cell's filter, is in series, or the sensor takes means, {explains}",
                1e3 * time_constant_s
            ),
            (ImitatedKind::Ramp(rate_per_s), true) => format!(
                "either the ESC ramps its command, by {rate_per_s:.2} of the range in a second, or the sensor takes means, {explains}; \
                 {cannot_tell}"
            ),
            (ImitatedKind::Mean(window_s), true) => format!(
                "either the sensor takes means over {:.0} ms, or the ESC ramps its command, {explains}; {cannot_tell}",
                1e3 * window_s
            ),
        }
    }

    /// What to do about it.
    pub fn advice(self) -> &'static str {
        match (self.kind, self.is_ambiguous) {
            (ImitatedKind::Filter(_), _) => remedy(second_pole::ID),
            (_, true) => "record steps of several sizes: a ramp takes longer over larger ones, a mean does not",
            (ImitatedKind::Ramp(_), false) => remedy(slew_limit::ID),
            (ImitatedKind::Mean(_), false) => remedy(moving_average::ID),
        }
    }
}
