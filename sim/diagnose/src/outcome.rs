//! What a diagnosis says.

use rotorlead_identify::estimate::Estimate;
use rotorlead_plant::Model;
use rotorlead_plant::effect::{Kind, Parameter};
use serde::{Serialize, Serializer};

use crate::assess::conditions::Conditions;
use crate::assess::esc_ramp::{EscRamp, Fitted};
use crate::assess::gap::{Gap, RecordGap, Residual};
use crate::assess::lateness::Lateness;
use crate::assess::locate::{Location, MapCell};
use crate::assess::minor::MinorEffect;
use crate::assess::plateau_gap::SplitGap;
use crate::assess::steadiness::Steadiness;
use crate::assess::timing::Timing;
use crate::assess::verdict::Verdict;
use crate::data::columns::Column;
use crate::data::dataset::LeftOut;
use crate::data::plateaus::groups::CutRows;
use crate::likelihood::excess::Excess;
use crate::policy::Policy;
use crate::select::decision::Decision;
use crate::select::weak_evidence::WeakEvidence;
use crate::square_of_speed::SquareOfSpeed;

/// An effect that is named.
#[derive(Clone, Debug, Serialize)]
pub struct NamedEffect {
    /// What it is.
    pub kind: &'static Kind,
    /// Its parameters in the order of the kind's; those that were not searched are left out.
    #[serde(serialize_with = "by_name")]
    pub parameters: Vec<(&'static Parameter, Estimate)>,
    /// Gain of log likelihood that it is worth beside the others.
    pub evidence: f64,
    /// Kinds that the data cannot tell from it.
    pub alternatives: Vec<&'static Kind>,
    /// The odds of it against each of these: the ratio of the evidence for both.
    pub odds: Vec<f64>,
    /// What speaks against it all the same.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reservation: Option<String>,
    /// Gap without it and with it, the others present.
    pub gap_before: f64,
    /// Gap with it.
    pub gap_after: f64,
}

/// A kind that was tried alone.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TriedKind {
    /// What it is.
    pub kind: &'static Kind,
    /// Gain of log likelihood over what was fitted.
    pub fitted_gain: f64,
    /// The same over what was held out; `None` where all is compared at once, as in records that repeat.
    pub held_out_gain: Option<f64>,
    /// What it is worth: both, less one per parameter and the places that were tried.
    pub score: f64,
}

/// Parameters by their names, each with its standard error and unit.
///
/// # Errors
/// Those of the serializer.
pub fn by_name<S: Serializer>(parameters: &[(&'static Parameter, Estimate)], serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct Value {
        value: f64,
        std: f64,
        unit: &'static str,
    }
    serializer.collect_map(parameters.iter().map(|(parameter, estimate)| {
        (parameter.name, Value { value: estimate.value, std: estimate.std, unit: parameter.unit })
    }))
}

/// A pair of what the first model and the last one leave.
fn before_and_after<S: Serializer>((before, after): &(Excess, Excess), serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map([("before", before), ("after", after)])
}

/// What holds where [`Diagnosis::needs_steady_start`].
pub const NEEDS_STEADY_START: &str = "Valid only if each record starts in steady state at u_nom.";

/// All that was found.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// In a word.
    pub verdict: Verdict,
    /// Whether a given model was evaluated; else what is before are the lags that fit best.
    #[serde(skip)]
    pub is_of_given: bool,
    /// Where the excess chi-square of the first model lies.
    #[serde(rename = "where")]
    pub locations: Vec<Location>,
    /// The effects, the most valuable first.
    pub effects: Vec<NamedEffect>,
    /// Effects that are significant and do not matter, in the order of their evidence. No model has them.
    pub minor: Vec<MinorEffect>,
    /// What was tried alone, best first.
    pub tried: Vec<TriedKind>,
    /// What became of each kind, of records that do not repeat.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub decisions: Vec<Decision>,
    /// That thrust is the square of a speed, where that explains more than what a lag of thrust needs beside it: effects, gaps and locations
    /// are then those of the square root of thrust.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub square_of_speed: Option<SquareOfSpeed>,
    /// Whose delay it is, where records that do not repeat show one.
    #[serde(rename = "delay", skip_serializing_if = "Option::is_none")]
    pub lateness: Option<Lateness>,
    /// Effects with weak evidence, where the records agree with the model.
    pub weak_evidence: Vec<WeakEvidence>,
    /// Whether the effects rest on how the records begin, too: see [`NEEDS_STEADY_START`].
    pub needs_steady_start: bool,
    /// The gap on what was held out. No number was fitted to it; which kinds are named rests on it too.
    pub gap: Gap,
    /// The same record by record.
    pub records: Vec<RecordGap>,
    /// The same on what each split of records that do not repeat holds out, both models fitted anew to the rest of it.
    pub splits: Vec<SplitGap>,
    /// The gap on what the models were fitted to.
    pub fitted: Gap,
    /// What was not compared of records that do not repeat.
    #[serde(rename = "rows_cut")]
    pub cut: Vec<CutRows>,
    /// Columns beside the response that had a say.
    pub columns: Vec<Column>,
    /// Records that were not compared.
    #[serde(rename = "not_compared")]
    pub left_out: Vec<LeftOut>,
    /// Whether the static map of logs is free, a number for each level.
    #[serde(skip)]
    pub has_free_map: bool,
    /// Whether anything was held out; otherwise the gaps are those of what was fitted.
    pub held_out: bool,
    /// What is left over noise, before and after.
    #[serde(serialize_with = "before_and_after")]
    pub excess: (Excess, Excess),
    /// Whether the residual is stationary, as noise is.
    pub steadiness: Steadiness,
    /// Whether the delay is the same at every step.
    pub timing: Timing,
    /// The criteria by which all this is said.
    pub policy: Policy,
    /// The improved model.
    #[serde(skip)]
    pub model: Model,
    /// What is left over frequency and nominal command, before and after.
    #[serde(skip)]
    pub map: Vec<MapCell>,
    /// What is left of one record, before and after.
    #[serde(skip)]
    pub residual: Option<Residual>,
    /// How the records were taken.
    #[serde(skip)]
    pub conditions: Conditions,
    /// What more can be asked of.
    #[serde(skip)]
    pub(crate) last_fit: Fitted,
}

impl Diagnosis {
    /// How fast the ESC lets its command change, or how fast at least. It takes some tens of fits.
    #[must_use]
    pub fn esc_ramp(&self) -> EscRamp {
        self.last_fit.esc_ramp()
    }
}
