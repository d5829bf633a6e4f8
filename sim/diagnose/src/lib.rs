//! Where simulation and measurement disagree, which effect is missing, and how much smaller the gap becomes with it.
//!
//! Four steps, a file each: `locate` shares the chi-square out over frequency, nominal command, amplitude and more;
//! `explain` finds the effects of the catalog that the chi-square asks for; the improved [`Model`] has them; `gap` compares
//! both models with what was held out. All of it rests on white residuals (`whitening`): where only noise is left, their
//! sum of squares is a chi-square.

mod adjoint;
mod attempt;
mod auxiliary;
pub mod bandwidths;
mod candidate;
mod channel;
mod clips;
mod collapsed;
mod compensated;
mod dataset;
mod error;
mod explain;
mod fit;
mod frames;
mod gap;
mod hold_delay;
mod hum;
mod hypothesis;
mod isolated_steps;
mod linearization;
mod locate;
mod log;
mod next;
mod pair_search;
mod prediction;
mod prior_model;
mod profile;
mod quantizer_step;
mod residual;
mod resonance;
mod review;
mod scan;
mod score_test;
mod starts;
mod steadiness;
mod step;
#[cfg(test)]
mod testing;
mod timing;
mod tried;
mod verdict;
mod weak_evidence;
mod whitening;

use std::collections::BTreeMap;

pub use channel::Column;
pub use compensated::fill_in_esc_commands;
pub use dataset::LeftOut;
pub use error::DiagnoseError;
pub use gap::{Gap, RecordGap, Residual};
pub use locate::{Axis, Excess, Location, MapCell};
pub use log::{CutRows, Decision, Lateness, SplitGap};
pub use next::{Conditions, NextExperiment};
pub use steadiness::Steadiness;
pub use timing::Timing;
pub use verdict::Verdict;
pub use weak_evidence::WeakEvidence;

use rotorlead_identify::{Estimate, PeriodicOptions, identify_periodic, same_output};
use rotorlead_numerics::sample::median;
use rotorlead_plant::effect::Kind;
use rotorlead_plant::{Catalog, Effect, Lag, Model, OperatingCurve, Point};
use rotorlead_records::Experiment;

use serde::{Serialize, Serializer};

use candidate::Candidate;
use dataset::{Dataset, Split};
use explain::{Explanation, Search};
use hypothesis::{BasePoint, Coordinate, Hypothesis};
use prior_model::ParameterMismatch;
use verdict::Evidence;

/// An effect that is named.
#[derive(Clone, Debug, Serialize)]
pub struct NamedEffect {
    /// What it is.
    pub kind: &'static Kind,
    /// Its parameters in the order of the kind's; those that were not searched are left out.
    #[serde(serialize_with = "by_name")]
    pub parameters: Vec<(&'static rotorlead_plant::effect::Parameter, Estimate)>,
    /// Gain of log likelihood that it is worth beside the others.
    pub evidence: f64,
    /// Kinds that the data cannot tell from it.
    pub alternatives: Vec<&'static Kind>,
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
    /// The same over what was held out.
    pub held_out_gain: f64,
    /// What it is worth: both, less one per parameter.
    pub score: f64,
}

/// Parameters by their names, each with its standard error and unit.
///
/// # Errors
/// Those of the serializer.
pub fn by_name<S: Serializer>(
    parameters: &[(&'static rotorlead_plant::effect::Parameter, Estimate)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
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
    /// Where the chi-square of the first model lies.
    #[serde(rename = "where")]
    pub locations: Vec<Location>,
    /// The effects, the most valuable first.
    pub effects: Vec<NamedEffect>,
    /// What was tried alone, best first.
    pub tried: Vec<TriedKind>,
    /// What became of each kind, of records that do not repeat.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub decisions: Vec<Decision>,
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
    /// Whether what is left is steady, as noise is.
    pub steadiness: Steadiness,
    /// Whether the delay is the same at every step.
    pub timing: Timing,
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
}

/// How it is done.
#[derive(Clone, Copy)]
pub struct Options<'a> {
    /// The model to be evaluated; without one, the lags that `identify` finds.
    pub model: Option<&'a Model>,
    /// The kinds that may be named.
    pub catalog: &'a Catalog,
    /// Told whenever a step is done.
    pub progress: &'a dyn Fn(),
}

/// Diagnoses an experiment.
///
/// # Errors
/// [`DiagnoseError`].
///
/// # Examples
///
/// An ESC that follows its command at 0.6 of the range per second at most:
///
/// ```
/// use rotorlead_plant::bench::{Plan, run};
/// use rotorlead_diagnose::{Options, diagnose};
/// use rotorlead_plant::{Catalog, Model};
///
/// let actuator: Model = toml::from_str(
///     r#"
///     format = 1
///     [[point]]
///     nominal = 0.5
///     gain = 10.0
///     time_constant_s = 0.1
///     [[effect]]
///     kind = "slew_limit"
///     parameters = { rate_per_s = 0.6 }
///     "#,
/// )?;
/// let plan = Plan { loop_rate_hz: 200, sample_rate_hz: 200, esc_frame_hz: None, ..Plan::paper(&actuator) };
/// let records = run(&plan, &actuator, None, &|_| ())?;
///
/// let found = diagnose(&records, &Options { model: None, catalog: &Catalog::standard(), progress: &|| () })?;
/// assert_eq!(found.effects[0].kind.id, "slew_limit");
/// assert!(found.gap.after < 0.5 * found.gap.before);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn diagnose(experiment: &Experiment, options: &Options) -> Result<Diagnosis, DiagnoseError> {
    let mut data = Dataset::new(experiment, options.model.is_some())?;
    data.check_fitted()?;
    data.curve = options.model.map(|model| data.curve_through(model)).transpose()?.flatten();
    let base = first_model(experiment, &data, options.model)?;
    let untouched = options.model.map(|_| data.clone());
    let mut search = Search { data, catalog: options.catalog, progress: options.progress, lags: true };
    let explanation =
        search.explain(&Hypothesis::of_lags(base.clone())).ok_or(DiagnoseError::NoFit { what: "a first-order lag" })?;
    let (Explanation { before, mut after, found, tried, weak_evidence, decisions }, mut wrong) = match untouched {
        Some(untouched) => prior_model::compared(&mut search, untouched, &base, explanation)
            .ok_or(DiagnoseError::NoFit { what: "the given lags" })?,
        None => (explanation, None),
    };
    // Weighed by the noise that the best explanation leaves.
    let data = &search.data;
    let excess = |hypothesis| locate::excess(data, hypothesis, Split::Train);
    let (excess_before, mut excess_after) = (excess(&before.hypothesis), excess(&after.hypothesis));
    let steadiness = steadiness::steadiness(data, &after.hypothesis);
    let timing = timing::timing(data, &after.hypothesis);
    let refitted = options.model.is_none();
    let mut gaps = gap::gaps(data, &before.hypothesis, &after.hypothesis, refitted);
    let own = data.weighed_by(&before.hypothesis);
    let fitted_left =
        own.as_ref().and_then(|own| log::Left::of((own, &before.hypothesis), (data, &after.hypothesis), Split::Train));
    let fitted_left = fitted_left.unwrap_or_default().shares();
    let evidence = Evidence {
        found: !found.is_empty() || wrong.is_some(),
        numbers_alone: found.is_empty() && wrong.is_some(),
        excess: (excess_before, excess_after),
        gap: gaps.total,
        unsure: gap::unsure(data, &after, if gaps.held_out { Split::Holdout } else { Split::Train }),
        steadiness,
        is_timely: timing.is_steady(),
        left_of_logs: data.has_logs().then(|| [fitted_left, gaps.left.shares()]),
    };
    let verdict = evidence.verdict();
    let found = if verdict == Verdict::Unknown {
        (after, excess_after) = (before.clone(), excess_before);
        gaps = gap::gaps(data, &before.hypothesis, &after.hypothesis, refitted);
        wrong = None;
        Vec::new()
    } else {
        found
    };
    let gap::Gaps { total: gap, records, splits, held_out, .. } = gaps;
    gap.check()?;
    let mut effects = Vec::new();
    for (index, found) in found.into_iter().enumerate() {
        let without = after.hypothesis.without(index);
        let without = fit::fit(data, &without, true).map_or(without, |fit| fit.hypothesis);
        let alone = gap::gaps(data, &without, &after.hypothesis, true).total;
        effects.push(NamedEffect {
            kind: found.kind,
            parameters: estimates(data, &after, index),
            evidence: found.score,
            alternatives: found.alternatives,
            gap_before: alone.before,
            gap_after: alone.after,
        });
    }
    let model = improved(options.model, data, &after, &effects);
    if let Some(ParameterMismatch { evidence, parameters, given }) = wrong
        && let Some(kind) = options.catalog.find("parameter_error")
    {
        let alone = gap::gaps(data, &given, &after.hypothesis, false).total;
        let parameters = kind.parameters.iter().zip(parameters).collect();
        let (gap_before, gap_after) = (alone.before, alone.after);
        effects.push(NamedEffect { kind, parameters, evidence, alternatives: Vec::new(), gap_before, gap_after });
        effects.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
    }
    Ok(Diagnosis {
        verdict,
        is_of_given: options.model.is_some(),
        has_free_map: data.records.iter().any(|record| record.log.as_ref().is_some_and(|log| log.has_free_map)),
        lateness: Lateness::of(data, &after.hypothesis),
        decisions: decided(decisions, verdict, evidence.left_of_logs),
        weak_evidence: if verdict == Verdict::Agrees { weak_evidence } else { Vec::new() },
        needs_steady_start: data.initial_condition == dataset::InitialCondition::Steady && verdict != Verdict::Unknown,
        locations: locate::locate(data, &before.hypothesis),
        tried: tried
            .iter()
            .map(|tried| TriedKind {
                kind: tried.kind,
                fitted_gain: tried.fitted_gain,
                held_out_gain: tried.held_out_gain,
                score: tried.score(),
            })
            .collect(),
        model,
        effects,
        gap,
        splits,
        fitted: gap::of(data, &before.hypothesis, &after.hypothesis, Split::Train).0,
        cut: data.records.iter().filter_map(|record| Some(record.log.as_ref()?.cut.clone())).collect(),
        columns: columns(data),
        left_out: data.left_out.clone(),
        conditions: Conditions::of(experiment, data),
        map: locate::map(data, &before.hypothesis, &after.hypothesis),
        residual: gap::residual(data, &records, &before.hypothesis, &after.hypothesis, held_out),
        records,
        held_out,
        excess: (excess_before, excess_after),
        steadiness,
        timing,
    })
}

/// What became of each kind in the end, those that were added first: where no explanation was accepted, nothing was added.
fn decided(mut decisions: Vec<Decision>, verdict: Verdict, left: Option<[[f64; 2]; 2]>) -> Vec<Decision> {
    decisions.sort_by_key(|decision| !decision.is_added);
    if verdict != Verdict::Unknown {
        return decisions;
    }
    let [_, [levels, motion]] = left.unwrap_or([[1.0; 2]; 2]);
    for decision in decisions.iter_mut().filter(|decision| decision.is_added) {
        decision.is_added = false;
        decision.failed = vec![format!(
            "explanation: leaves {:.0} % of the power of the held-out levels and {:.0} % of that of the held-out motion, at most \
             {:.0} % of either accepted",
            100.0 * levels,
            100.0 * motion,
            100.0 * verdict::NONE_OF_LOGS
        )];
    }
    decisions
}

/// The lags to begin with: the given model's, or those that the records show.
fn first_model(
    experiment: &Experiment,
    data: &Dataset,
    model: Option<&Model>,
) -> Result<Vec<BasePoint>, DiagnoseError> {
    let of_lag = |lag: Lag| BasePoint { gain: lag.gain, time_constant_s: lag.time_constant_s, delay_s: lag.delay_s };
    if let Some(model) = model {
        same_output(experiment, model)?;
        if let Some(effect) = model.effects.first() {
            return Err(DiagnoseError::ModelHasEffects { kind: effect.kind.clone() });
        }
        return data.nominals.iter().map(|nominal| Ok(of_lag(model.at(*nominal)?))).collect();
    }
    let is_periodic = |record: &dataset::Record| record.log.is_none();
    let mut found: Vec<(f64, Lag)> = Vec::new();
    if data.records.iter().any(is_periodic) {
        let identified = identify_periodic(experiment, &PeriodicOptions::default())?;
        found.extend(identified.points().iter().map(|point| (point.nominal, point.lag())));
    }
    for record in data.records.iter().filter(|record| !is_periodic(record)) {
        found.extend(log::first_lag(record).map(|lag| (record.nominal, lag)));
    }
    let usual = usual_lag(&found).ok_or(DiagnoseError::NoFit { what: "a first-order lag" })?;
    let base = data.nominals.iter().map(|nominal| {
        let distance = |found: &&(f64, Lag)| (found.0 - nominal).abs();
        let near = found.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).map_or(usual, |(_, lag)| *lag);
        let is_unusual = |part: f64| !(1.0 / UNUSUAL..=UNUSUAL).contains(&part);
        let off = is_unusual(near.gain / usual.gain) || is_unusual(near.time_constant_s / usual.time_constant_s);
        // A delay is an effect, and has to be found.
        BasePoint { delay_s: 0.0, ..of_lag(if off { usual } else { near }) }
    });
    Ok(base.collect())
}

/// A lag whose numbers differ by more than this factor from the usual ones is no place to begin: an effect has spoiled it.
const UNUSUAL: f64 = 3.0;

/// The medians over all nominal commands.
fn usual_lag(found: &[(f64, Lag)]) -> Option<Lag> {
    let usual = |number: fn(&Lag) -> f64| median(found.iter().map(|(_, lag)| number(lag)));
    let (gain, time_constant_s) = (usual(|lag| lag.gain)?, usual(|lag| lag.time_constant_s)?);
    (gain != 0.0 && time_constant_s > 0.0).then_some(Lag { gain, time_constant_s, delay_s: 0.0 })
}

/// The values of an effect with their standard errors.
fn estimates(
    data: &Dataset,
    fit: &fit::Fit,
    effect: usize,
) -> Vec<(&'static rotorlead_plant::effect::Parameter, Estimate)> {
    let candidate = &fit.hypothesis.effects[effect];
    let searched = Candidate::searched(candidate.kind);
    let estimate = |(value, parameter): (usize, &'static rotorlead_plant::effect::Parameter)| {
        let slope = candidate::slope(parameter, candidate.values[value]);
        let coordinate = Coordinate::Effect { effect, value };
        let std = if candidate.is_non_smooth() || !candidate.phases.is_empty() {
            Some(candidate.profiled_std)
        } else {
            fit.std(coordinate).map(|std| hold_delay::with_scatter(data, &fit.hypothesis, candidate, std))
        };
        (parameter, Estimate::normal(candidate.values[value], std.unwrap_or(f64::INFINITY) * slope.abs()))
    };
    searched.map(estimate).collect()
}

/// Columns beside the response in any record.
fn columns(data: &Dataset) -> Vec<Column> {
    let any = |column: &Column| data.records.iter().any(|record| record.columns().any(|there| there == *column));
    [Column::Speed, Column::Voltage].into_iter().filter(any).collect()
}

/// The model with the lags and effects of a fit.
fn improved(model: Option<&Model>, data: &Dataset, fit: &fit::Fit, effects: &[NamedEffect]) -> Model {
    let points = data.nominals.iter().zip(&fit.hypothesis.base).enumerate().map(|(index, (nominal, base))| {
        let lag = Lag { gain: base.gain, time_constant_s: base.time_constant_s, delay_s: base.delay_s };
        let mut point = Point::new(*nominal, lag);
        point.gain_std = fit.std(Coordinate::Gain(index)).map(|std| std * base.gain.abs());
        point.time_constant_s_std = fit.std(Coordinate::TimeConstant(index)).map(|std| std * base.time_constant_s);
        point
    });
    let effects = effects.iter().zip(&fit.hypothesis.effects).map(|(named, candidate)| Effect {
        kind: named.kind.id.to_owned(),
        parameters: named
            .kind
            .parameters
            .iter()
            .zip(&candidate.values)
            .map(|(parameter, value)| (parameter.name.to_owned(), *value))
            .collect(),
        std: named
            .parameters
            .iter()
            .filter(|(_, estimate)| estimate.std.is_finite())
            .map(|(parameter, estimate)| (parameter.name.to_owned(), estimate.std))
            .collect::<BTreeMap<_, _>>(),
    });
    let (points, static_map) = match (model, &data.curve) {
        (Some(model), Some((_, given))) if data.records.iter().any(|record| data.curve_of(record).is_some()) => {
            scaled(model, &fit.hypothesis.base[0], given[0])
        }
        _ => (points.collect(), model.and_then(|model| model.static_map.clone())),
    };
    Model { format: 1, points, static_map, time_constant_curve: None, effects: effects.collect(), provenance: None }
}

/// The points and the map of a model over many levels, all off by as much as the numbers at one command.
fn scaled(model: &Model, found: &BasePoint, given: Lag) -> (Vec<Point>, Option<rotorlead_plant::StaticMap>) {
    let (gain, slower) = (found.gain / given.gain, found.time_constant_s / given.time_constant_s);
    let point = |point: &Point| {
        let lag =
            Lag { gain: point.gain * gain, time_constant_s: point.time_constant_s * slower, delay_s: point.delay_s };
        Point::new(point.nominal, lag)
    };
    let map = model.static_map.as_ref().map(|map| rotorlead_plant::StaticMap {
        response: map.response.iter().map(|response| response * gain).collect(),
        polynomial: None,
        command: map.command.clone(),
    });
    (model.points.iter().map(point).collect(), map)
}

impl Dataset {
    /// The curve of a model that says more than one level, for records that go through many.
    fn curve_through(&self, model: &Model) -> Result<Option<(OperatingCurve, Vec<Lag>)>, DiagnoseError> {
        if model.points.len() < 2 && model.static_map.is_none() {
            return Ok(None);
        }
        let curve = OperatingCurve::without_effects(model)?;
        let given = self.nominals.iter().map(|nominal| model.at(*nominal)).collect::<Result<_, _>>()?;
        Ok(Some((curve, given)))
    }

    /// Every nominal command needs something to fit.
    fn check_fitted(&self) -> Result<(), DiagnoseError> {
        for (point, nominal) in self.nominals.iter().enumerate() {
            let is_fitted = |record: &dataset::Record| record.point == point && record.end_of(Some(Split::Train)) > 0;
            if !self.records.iter().any(is_fitted) {
                return Err(DiagnoseError::NominalWithoutFit { nominal: *nominal });
            }
        }
        Ok(())
    }
}
