//! The diagnosis of an experiment, from its records to what is said of them.

use rotorlead_identify::estimate::Estimate;
use rotorlead_identify::lag::multisine::{PeriodicOptions, identify_periodic};
use rotorlead_identify::validate::same_output;
use rotorlead_numerics::sample::median;
use rotorlead_plant::effect::Parameter;
use rotorlead_plant::effect::parameter_error;
use rotorlead_plant::{ActiveEffect, Catalog, Lag, Model, OperatingCurve, Point, StaticMap};
use rotorlead_records::Experiment;

use crate::assess::conditions::Conditions;
use crate::assess::esc_ramp::Fitted;
use crate::assess::lateness::Lateness;
use crate::assess::minor::{self, MinorEffect};
use crate::assess::verdict::{Evidence, Finding, Verdict};
use crate::assess::{gap, gaps, locate, plateau_gap, steadiness, timing};
use crate::data::columns::Column;
use crate::data::dataset::{Dataset, PreparedRecord};
use crate::data::split::Split;
use crate::error::DiagnoseError;
use crate::estimate::{first_lag, fit};
use crate::likelihood::hold_delay;
use crate::likelihood::{InitialCondition, Likelihood};
use crate::model::candidate;
use crate::model::hypothesis::{BasePoint, Coordinate, Hypothesis};
use crate::outcome::{Diagnosis, NamedEffect, TriedKind};
use crate::policy::POLICY;
use crate::select::decision::Decision;
use crate::select::explanation::{Explanation, FoundEffect};
use crate::select::prior_model::{self, ParameterMismatch};
use crate::select::search::Search;
use crate::select::tried::Tried;
use crate::square_of_speed;
use crate::through_levels;

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
    let found = diagnose_with_map(experiment, options)?;
    let square = || {
        // A given model is of thrust.
        let [thrust, roots] =
            options.model.is_none().then(|| square_of_speed::as_speeds(experiment, &found)).flatten()?;
        let of_thrust = diagnose_with_map(&thrust, options).ok()?;
        square_of_speed::explained((&found, &of_thrust), &roots, diagnose_with_map(&roots, options).ok()?)
    };
    Ok(square().unwrap_or(found))
}

/// [`diagnose`] of the response as it is; with the command through the measured map, where that explains more.
fn diagnose_with_map(experiment: &Experiment, options: &Options) -> Result<Diagnosis, DiagnoseError> {
    let found = diagnose_response(experiment, options, None)?;
    let through = || {
        let curve = through_levels::measured_curve(experiment, &found)?;
        let through = diagnose_response(experiment, options, Some(curve)).ok()?;
        through.gap.explains_more_than(found.gap).then_some(through)
    };
    Ok(through().unwrap_or(found))
}

/// [`diagnose`] with lags around the nominal commands, or through a `measured` curve of levels.
fn diagnose_response(
    experiment: &Experiment,
    options: &Options,
    measured: Option<(OperatingCurve, Vec<Lag>)>,
) -> Result<Diagnosis, DiagnoseError> {
    let mut data = Dataset::new(experiment, options.model.is_some())?;
    data.check_fitted()?;
    let given = options.model.map(|model| data.curve_through(model)).transpose()?.flatten();
    data.curve = given.or(measured);
    let base = first_model(experiment, &data, options.model)?;
    let lags = Hypothesis::from_lags(base.clone());
    let no_lag = DiagnoseError::NoFit { what: "a first-order lag" };
    let Some(mut search) = Search::prepared(&data, &lags, (options.catalog, options.progress), true) else {
        return Err(no_lag);
    };
    let explanation = search.explain(&lags).ok_or(no_lag)?;
    let (Explanation { before, mut after, found, tried, weak_evidence, decisions }, mut wrong) = match options.model {
        Some(_) => prior_model::compared(&mut search, &data, &base, explanation)
            .ok_or(DiagnoseError::NoFit { what: "the given lags" })?,
        None => (explanation, None),
    };
    // Weighed by the noise that the best explanation leaves.
    let likelihood = &search.likelihood;
    let data = &*likelihood.data;
    let with_minor = after.hypothesis.clone();
    // Of what does not repeat the search itself drops what adds nothing: what is left there is the model's own error, and no noise.
    let (found, mut minor) = match data.has_logs() {
        true => (found, Vec::new()),
        false => without_minor(likelihood, &mut after, found, options.model.is_some()),
    };
    let excess = |hypothesis| likelihood.excess(hypothesis, Split::Train);
    let (excess_before, mut excess_after) = (excess(&before.hypothesis), excess(&after.hypothesis));
    if found.is_empty() {
        // What does not matter may be significant, and still be all there is.
        excess_after = excess(&with_minor);
    }
    let steadiness = steadiness::steadiness(likelihood, &after.hypothesis);
    let timing = timing::timing(likelihood, &after.hypothesis);
    let refitted = options.model.is_none();
    let mut gaps = gaps::compute_gaps(likelihood, &before.hypothesis, &after.hypothesis, refitted);
    let own = likelihood.with_errors_from(&before.hypothesis);
    let fitted_residual = own.as_ref().and_then(|own| {
        plateau_gap::PlateauResidual::compute((own, &before.hypothesis), (likelihood, &after.hypothesis), Split::Train)
    });
    let fitted_residual = fitted_residual.unwrap_or_default().shares();
    let evidence = Evidence {
        finding: match (found.is_empty(), &wrong) {
            (false, _) => Finding::Effects,
            (true, Some(_)) => Finding::Numbers,
            (true, None) => Finding::Nothing,
        },
        excess: (excess_before, excess_after),
        gap: gaps.total,
        unsure: gap::unsure(likelihood, &after, if gaps.held_out { Split::Holdout } else { Split::Train }),
        steadiness,
        is_timely: timing.is_steady(),
        // The share that is left of a log is not that of noise.
        is_minor: !data.has_logs() && likelihood.excess_share(&after.hypothesis, Split::Train) < POLICY.minor,
        is_rejected: found.is_empty() && rejected(likelihood, &before, &tried, &mut minor),
        residual_of_logs: data.has_logs().then(|| [fitted_residual, gaps.residual.shares()]),
    };
    let verdict = evidence.verdict();
    let found = if verdict == Verdict::Unknown {
        (after, excess_after) = (before.clone(), excess_before);
        // By the errors of the lags alone, as these are judged.
        let by_lags = own.as_ref().unwrap_or(likelihood);
        gaps = gaps::compute_gaps(by_lags, &before.hypothesis, &after.hypothesis, refitted);
        wrong = None;
        // They were so beside what is not believed.
        minor.clear();
        Vec::new()
    } else {
        found
    };
    let gaps::Gaps { total: gap, records, splits, held_out, .. } = gaps;
    gap.check()?;
    let mut effects = Vec::new();
    for (index, found) in found.into_iter().enumerate() {
        // The rest fitted again may run off where nothing was fitted; the rest as it is then does better.
        let without = after.hypothesis.without(index);
        let refitted = fit::fit(likelihood, &without, true).map(|fit| fit.hypothesis);
        let of = |rest| gaps::compute_gaps(likelihood, rest, &after.hypothesis, true).total;
        let as_it_is = of(&without);
        let alone = refitted.as_ref().map(of).filter(|gap| gap.before < as_it_is.before).unwrap_or(as_it_is);
        effects.push(NamedEffect {
            kind: found.kind,
            parameters: estimates(likelihood, &after, index),
            evidence: found.score,
            alternatives: found.alternatives,
            odds: found.odds,
            reservation: after.hypothesis.effects[index].beyond_range(0.0),
            gap_before: alone.before,
            gap_after: alone.after,
        });
    }
    let model = improved(options.model, likelihood, &after, &effects);
    if let Some(ParameterMismatch { evidence, parameters, given }) = wrong
        && let Some(kind) = options.catalog.find(parameter_error::ID)
    {
        let alone = gaps::compute_gaps(likelihood, &given, &after.hypothesis, false).total;
        let parameters = kind.parameters.iter().zip(parameters).collect();
        let (gap_before, gap_after) = (alone.before, alone.after);
        effects.push(NamedEffect {
            kind,
            parameters,
            evidence,
            alternatives: Vec::new(),
            odds: Vec::new(),
            reservation: None,
            gap_before,
            gap_after,
        });
    }
    effects.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
    Ok(Diagnosis {
        verdict,
        is_of_given: options.model.is_some(),
        has_free_map: data.records.iter().any(PreparedRecord::has_free_map),
        lateness: Lateness::estimate(likelihood, &after.hypothesis),
        decisions: decided(decisions, verdict, &evidence),
        weak_evidence: if verdict == Verdict::Agrees { weak_evidence } else { Vec::new() },
        needs_steady_start: likelihood.initial_condition == InitialCondition::Steady && verdict != Verdict::Unknown,
        locations: locate::locate(likelihood, &before.hypothesis),
        tried: tried
            .iter()
            .map(|tried| TriedKind {
                kind: tried.kind,
                fitted_gain: tried.fitted_gain,
                held_out_gain: tried.held_out_gain,
                score: tried.score,
            })
            .collect(),
        model,
        effects,
        minor,
        gap,
        splits,
        fitted: gap::compute_gap(likelihood, &before.hypothesis, &after.hypothesis, Split::Train).0,
        cut: data.records.iter().filter_map(|record| Some(record.log.as_ref()?.cut.clone())).collect(),
        columns: columns(data),
        left_out: data.left_out.clone(),
        conditions: Conditions::from_experiment(experiment, likelihood),
        last_fit: Fitted::new(likelihood, &after),
        map: locate::map(likelihood, &before.hypothesis, &after.hypothesis),
        square_of_speed: None,
        residual: gap::residual(likelihood, &records, &before.hypothesis, &after.hypothesis, held_out),
        records,
        held_out,
        excess: (excess_before, excess_after),
        steadiness,
        timing,
        policy: POLICY,
    })
}

/// The effects that matter, and those that do not, which are taken out of the fit: the least of them first, since it may be another's
/// shadow. Where a model `is_given` its lags stay as they are in `after`.
fn without_minor(
    likelihood: &Likelihood,
    after: &mut fit::Fit,
    mut found: Vec<FoundEffect>,
    is_given: bool,
) -> (Vec<FoundEffect>, Vec<MinorEffect>) {
    let mut minor = Vec::new();
    while !found.is_empty() {
        let of_effect = |effect: usize| {
            let without = after.hypothesis.without(effect);
            let mut fitted = fit::fit(likelihood, &without, true)?;
            if is_given {
                // How well the lags are known stays what it is with them free.
                fitted.hypothesis = fit::fit(likelihood, &without, false)?.hypothesis;
            }
            let without = fitted;
            Some((minor::share(likelihood, &after.hypothesis, &without.hypothesis), effect, without))
        };
        let mut shares: Vec<_> = (0..found.len()).filter_map(of_effect).collect();
        shares.sort_by(|a, b| b.0.total_cmp(&a.0));
        let Some((share, effect, without)) = shares.pop() else { break };
        if share >= POLICY.minor {
            break;
        }
        let FoundEffect { kind, score: evidence, .. } = found.remove(effect);
        minor.push(MinorEffect { kind, evidence, share });
        *after = without;
    }
    minor.sort_by(|a: &MinorEffect, b| b.evidence.total_cmp(&a.evidence));
    (found, minor)
}

/// Whether a kind that was tried beside the lags alone scores enough for a name and matters. Where those that score enough do not matter,
/// the best of them is the only one of `minor`. Where there are some, they have been tried beside each other, and these are their
/// shadows.
fn rejected(likelihood: &Likelihood, before: &fit::Fit, tried: &[Tried], minor: &mut Vec<MinorEffect>) -> bool {
    if !minor.is_empty() {
        return false;
    }
    let of_tried = |tried: &Tried| MinorEffect {
        kind: tried.kind,
        evidence: tried.score,
        share: minor::share(likelihood, &tried.fit.hypothesis, &before.hypothesis),
    };
    let scored: Vec<MinorEffect> = tried.iter().filter(|tried| tried.scores_enough()).map(of_tried).collect();
    let is_rejected = scored.iter().any(|one| one.share >= POLICY.minor);
    minor.extend(scored.first().copied().filter(|_| !is_rejected));
    is_rejected
}

/// What became of each kind in the end, those that were added first: where no explanation was accepted, nothing was added.
fn decided(mut decisions: Vec<Decision>, verdict: Verdict, evidence: &Evidence) -> Vec<Decision> {
    decisions.sort_by_key(|decision| !decision.is_added);
    if verdict == Verdict::Unknown {
        for decision in decisions.iter_mut().filter(|decision| decision.is_added) {
            (decision.is_added, decision.failed) = (false, vec![evidence.why_unknown()]);
        }
    }
    decisions
}

/// The lags to begin with: the given model's, or those that the records show.
pub(crate) fn first_model(
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
    let is_periodic = |record: &PreparedRecord| record.log.is_none();
    let mut found: Vec<(f64, Lag)> = Vec::new();
    if data.records.iter().any(is_periodic) {
        let identified = identify_periodic(experiment, &PeriodicOptions::default())?;
        found.extend(identified.points().iter().map(|point| (point.nominal, point.lag())));
    }
    for record in data.records.iter().filter(|record| !is_periodic(record)) {
        found.extend(first_lag::first_lag(record).map(|lag| (record.nominal, lag)));
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

/// A lag whose numbers differ by more than this factor from the usual ones is no place to begin: an effect has spoiled it. Chosen: lags of
/// the paper's motor differ by 2.3 in all from 0.40 to 0.65. Lower, a wide range of commands is cut; higher, a spoiled lag is taken.
const UNUSUAL: f64 = 3.0;

/// The medians over all nominal commands.
fn usual_lag(found: &[(f64, Lag)]) -> Option<Lag> {
    let usual = |number: fn(&Lag) -> f64| median(found.iter().map(|(_, lag)| number(lag)));
    let (gain, time_constant_s) = (usual(|lag| lag.gain)?, usual(|lag| lag.time_constant_s)?);
    (gain != 0.0 && time_constant_s > 0.0).then_some(Lag { gain, time_constant_s, delay_s: 0.0 })
}

/// The values of an effect with their standard errors.
fn estimates(likelihood: &Likelihood, fit: &fit::Fit, effect: usize) -> Vec<(&'static Parameter, Estimate)> {
    let candidate = &fit.hypothesis.effects[effect];
    let estimate = |(value, parameter): (usize, &'static Parameter)| {
        let slope = candidate::slope(parameter, candidate.values[value]);
        let coordinate = Coordinate::Effect { effect, value };
        let std = if candidate.is_non_smooth() || !candidate.phases.is_empty() {
            Some(candidate.profiled_std)
        } else {
            fit.std(coordinate).map(|std| hold_delay::with_scatter(likelihood, &fit.hypothesis, candidate, std))
        };
        (parameter, Estimate::normal(candidate.values[value], std.unwrap_or(f64::INFINITY) * slope.abs()))
    };
    candidate.numbers().map(estimate).collect()
}

/// Columns beside the response in any record.
fn columns(data: &Dataset) -> Vec<Column> {
    let any = |column: &Column| data.records.iter().any(|record| record.columns().any(|there| there == *column));
    [Column::Speed, Column::Voltage].into_iter().filter(any).collect()
}

/// The model with the lags and effects of a fit.
fn improved(model: Option<&Model>, likelihood: &Likelihood, fit: &fit::Fit, effects: &[NamedEffect]) -> Model {
    let points =
        likelihood.data.nominals.iter().zip(&fit.hypothesis.base).enumerate().map(|(index, (nominal, base))| {
            let lag = Lag { gain: base.gain, time_constant_s: base.time_constant_s, delay_s: base.delay_s };
            let mut point = Point::new(*nominal, lag);
            point.gain_std = fit.std(Coordinate::Gain(index)).map(|std| std * base.gain.abs());
            point.time_constant_s_std = fit.std(Coordinate::TimeConstant(index)).map(|std| std * base.time_constant_s);
            point
        });
    let effects = effects.iter().zip(&fit.hypothesis.effects).filter_map(|(named, candidate)| {
        let mut std = vec![f64::NAN; candidate.values.len()];
        for (parameter, estimate) in named.parameters.iter().filter(|(_, estimate)| estimate.std.is_finite()) {
            let place = named.kind.parameters.iter().position(|other| other.name == parameter.name)?;
            std[place] = estimate.std;
        }
        Some(ActiveEffect::new(named.kind, candidate.values.clone()).ok()?.to_effect(&std))
    });
    let (points, static_map) = match (model, &likelihood.data.curve) {
        (Some(model), Some((_, given)))
            if likelihood.data.records.iter().any(|record| likelihood.data.operating_curve(record).is_some()) =>
        {
            scaled(model, &fit.hypothesis.base[0], given[0])
        }
        _ => (points.collect(), model.and_then(|model| model.static_map.clone())),
    };
    Model { format: 1, points, static_map, time_constant_curve: None, effects: effects.collect(), provenance: None }
}

/// The points and the map of a model over many levels, all off by as much as the numbers at one command.
fn scaled(model: &Model, found: &BasePoint, given: Lag) -> (Vec<Point>, Option<StaticMap>) {
    let (gain, slower) = (found.gain / given.gain, found.time_constant_s / given.time_constant_s);
    let point = |point: &Point| {
        let lag =
            Lag { gain: point.gain * gain, time_constant_s: point.time_constant_s * slower, delay_s: point.delay_s };
        Point::new(point.nominal, lag)
    };
    let map = model.static_map.as_ref().map(|map| StaticMap {
        response: map.response.iter().map(|response| response * gain).collect(),
        polynomial: None,
        ..map.clone()
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
            let is_fitted = |record: &PreparedRecord| record.point == point && record.is_fitted();
            if !self.records.iter().any(is_fitted) {
                return Err(DiagnoseError::NominalWithoutFit { nominal: *nominal });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{likelihood, records};

    fn found(effects: &str) -> Diagnosis {
        let catalog = Catalog::standard();
        diagnose(&records(effects, 0.05, 1), &Options { model: None, catalog: &catalog, progress: &|| {} }).unwrap()
    }

    const SLOW: &str = "[[effect]]\nkind = \"asymmetric_lag\"\nparameters = { ratio = 1.6 }\n";

    const SKEWED: &str = "[[effect]]\nkind = \"clock_skew\"\nparameters = { skew_ppm = 30.0 }\n";

    #[test]
    fn what_is_significant_and_changes_little_is_minor() {
        let skewed = found(SKEWED);
        assert_eq!((skewed.verdict, skewed.effects.len(), skewed.minor.len()), (Verdict::Agrees, 0, 1), "{skewed:?}");
        let MinorEffect { kind, evidence, share } = skewed.minor[0];
        assert!(kind.id == "clock_skew" && evidence > 7.0 && share < POLICY.minor, "{:?}", skewed.minor);
        assert!(skewed.model.effects.is_empty());
    }

    #[test]
    fn shadows_of_what_does_not_matter_reject_nothing() {
        let (likelihood, base) = likelihood(&records(SLOW, 0.05, 1));
        let catalog = Catalog::standard();
        let mut search = Search { likelihood, catalog: &catalog, progress: &|| {}, lags: true };
        let Explanation { before, tried, .. } = search.explain(&Hypothesis::from_lags(base)).unwrap();
        let rejected = |minor: &mut Vec<MinorEffect>| rejected(&search.likelihood, &before, &tried, minor);
        assert!(rejected(&mut Vec::new()));
        let found = MinorEffect { kind: tried[0].kind, evidence: 50.0, share: 0.5 * POLICY.minor };
        let mut minor = vec![found];
        assert!(!rejected(&mut minor));
        assert_eq!(minor, [found]);
    }

    #[test]
    fn what_changes_little_beside_an_effect_is_minor() {
        let both = found(&[SLOW, SKEWED].concat());
        let named: Vec<&str> = both.effects.iter().map(|effect| effect.kind.id).collect();
        assert_eq!((both.verdict, named), (Verdict::Named, vec!["asymmetric_lag"]), "{:?}", both.minor);
        let minor: Vec<&str> = both.minor.iter().map(|minor| minor.kind.id).collect();
        assert_eq!(minor, ["clock_skew"]);
    }

    #[test]
    fn an_effect_that_is_larger_than_it_should_be_is_named_with_its_reservation() {
        let large = "[[effect]]\nkind = \"gain_drift\"\nparameters = { drift = -0.4, time_s = 60.0 }\n";
        let found = found(large);
        assert!(found.minor.is_empty(), "{:?}", found.minor);
        let drift = &found.effects[0];
        assert_eq!((drift.kind.id, found.effects.len(), found.verdict), ("gain_drift", 1, Verdict::Named));
        assert!(drift.reservation.as_ref().is_some_and(|why| why.contains("expected")), "{:?}", drift.parameters);
        assert!(found.gap.after < 0.5 * found.gap.before, "{:?}", found.gap);
    }
}
