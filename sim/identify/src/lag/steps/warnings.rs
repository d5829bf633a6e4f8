//! Which warnings a fit gives.

use std::collections::BTreeMap;

use rotorlead_plant::Lagged;
use rotorlead_records::{Output, Record};

use super::fit::LagFit;
use super::plateaus::{Plateau, PlateauState};
use super::step::{Step, StepFault};
use super::{CURVED_PROBABILITY, Direction, LeftOut, Level, Run, StepsWarning, TimeConstantCurve};
use crate::estimate::Estimate;
use crate::rows::gaps::rows_after_gaps;
use crate::rows::ripple::Ripple;

/// A standard deviation between steps above this share is reported. Chosen: a third of the most that logs of thrust stands show, 0.15; a
/// compensator hardly changes with less.
const SCATTER: f64 = 0.05;
/// A level is as good as settled after this many time constants. Chosen: 0.7 %, `e^-5`, of the step is still to come.
const SETTLED_TIME_CONSTANTS: f64 = 5.0;

/// What is odd about the rows.
pub(super) fn check_runs(record: &Record, output: Output, runs: &[Run]) -> Vec<StepsWarning> {
    let mut warnings = Vec::new();
    let all = super::find_plateaus(record, output, &runs[0].clean);
    let highest =
        all.iter().filter(|p| p.state == PlateauState::Running).map(|p| p.mean).fold(f64::MIN_POSITIVE, f64::max);
    let mut part = |from: usize, until: usize| {
        if from >= until {
            return;
        }
        // The level that a run begins with may reach back before it, to where it has not settled.
        let is_alone = |p: &&Plateau| p.state == PlateauState::Running && p.rows.start >= from && p.rows.end <= until;
        let inside = || all.iter().filter(|p| p.rows.start < until && p.rows.end > from);
        let idle = inside().filter(|p| p.state == PlateauState::Idle).map(|p| p.mean / highest).reduce(f64::max);
        let frozen = inside().find(|p| p.state == PlateauState::Frozen);
        let reason = match (frozen, idle) {
            (Some(frozen), _) => LeftOut::Frozen { at: frozen.mean },
            _ if inside().any(|p| is_alone(&p)) => LeftOut::Short,
            (None, Some(share)) => LeftOut::Idle { share },
            (None, None) if inside().any(|p| p.state == PlateauState::NotSteady) => LeftOut::NotSteady,
            // Of the level that a run begins with, what comes before it has settled.
            (None, None) if inside().all(|p| p.state == PlateauState::Running) => LeftOut::NotSteady,
            (None, None) => LeftOut::Short,
        };
        warnings.push(StepsWarning::PartLeftOut {
            from_s: (from > 0).then(|| record.time_s[from]),
            until_s: record.time_s.get(until).copied(),
            reason,
        });
    };
    let mut from = 0;
    for run in runs {
        part(from, run.rows().start);
        from = run.rows().end;
    }
    part(from, record.time_s.len());
    let spikes = runs.iter().flat_map(|run| &run.spike[run.rows()]).filter(|spike| **spike).count();
    if spikes > 0 {
        let response = record.response(output).unwrap_or_default();
        let ripple = Ripple::find(&record.time_s, response, &runs[0].clean, &runs[0].spike);
        let column = output.column();
        warnings.push(match ripple {
            Some(Ripple { frequency_hz, off_by }) => {
                StepsWarning::Ripple { rows: spikes, column, frequency_hz, off_by }
            }
            None => StepsWarning::Spikes { rows: spikes, column },
        });
    }
    for run in runs {
        for limit in &run.limits {
            let stands = |p: &&Plateau| p.limited && run.clean[p.rows.clone()].contains(&limit.at);
            let commands = run.plateaus.iter().filter(stands).map(|p| p.command);
            let (low, high) = commands.fold((1.0_f64, 0.0_f64), |(low, high), u| (low.min(u), high.max(u)));
            warnings.push(StepsWarning::Limited { rows: limit.rows, at: limit.at, commands: (low, high) });
        }
    }
    warnings
}

/// What is odd about the steps.
pub(super) fn check_steps(record: &Record, runs: &[Run], steps: &[Step]) -> Vec<StepsWarning> {
    let mut warnings = Vec::new();
    let mut reasons: BTreeMap<&'static str, usize> = BTreeMap::new();
    for fault in steps.iter().filter_map(|step| step.fault) {
        let reason = match fault {
            StepFault::CommandInGap { .. } => "the command changes within a gap of the log",
            StepFault::ResponseInGap { .. } => "the response moves within a gap of the log",
            StepFault::Unsettled => "the response had not settled before",
            StepFault::Short => "a level is too short",
            StepFault::Hidden { .. } => "too small for the noise, or against the command",
            StepFault::Uncertain { .. } => "the time constant is hardly known",
            // Said apart, or no loss.
            StepFault::Limited | StepFault::Contradicts { .. } | StepFault::NotNeeded => continue,
        };
        *reasons.entry(reason).or_default() += 1;
    }
    if !reasons.is_empty() {
        let count = reasons.values().sum();
        let said: Vec<String> = reasons.iter().map(|(reason, count)| format!("{reason} ({count})")).collect();
        warnings.push(StepsWarning::StepsLeftOut { count, of: steps.len(), reasons: said.join(", ") });
    }
    for step in steps {
        if let Some(StepFault::Contradicts { ratio }) = step.fault {
            let commands = (step.from, step.to);
            warnings.push(StepsWarning::Contradicts { at_s: step.at_s, commands, ratio });
        }
    }
    let gaps = rows_after_gaps(&record.time_s);
    let inside = |row: &&usize| runs.iter().any(|run| run.rows().contains(*row) && run.rows().start < **row);
    let lengths = gaps.iter().filter(inside).map(|&row| record.time_s[row] - record.time_s[row - 1]);
    let (count, longest_s) = lengths.fold((0, 0.0_f64), |(count, longest), gap| (count + 1, longest.max(gap)));
    if count > 0 {
        let steps = steps.iter().filter(|step| step.is_in_gap()).count();
        warnings.push(StepsWarning::Gaps { count, longest_s, steps });
    }
    warnings
}

/// What is odd about the levels and the lag.
pub(super) fn check_fit(levels: &[Level], lag: &LagFit, curve: Option<&TimeConstantCurve>) -> Vec<StepsWarning> {
    let mut warnings = Vec::new();
    if let Some(curve) = curve {
        let count = levels.iter().filter(|level| !curve.holds(level.command)).count();
        if count > 0 {
            warnings.push(StepsWarning::Beyond { count, range: curve.range });
        }
        // Of few steps it is taken from other motors.
        if curve.between_std > SCATTER && curve.dof().is_finite() {
            warnings.push(StepsWarning::Scattered { share: curve.between_std });
        }
        warnings.extend(curve.asymmetry().map(|ratio| StepsWarning::Asymmetric { ratio }));
    }
    let without_gain = levels.iter().filter(|level| level.gain.is_none());
    warnings.extend(without_gain.map(|&Level { command, falls, .. }| match falls {
        true => StepsWarning::NotRising { command },
        false => StepsWarning::NoGain { command },
    }));
    match lag.lagged {
        Lagged::SquareRoot => {
            let average = |way| Some(curve?.average(way)?.value);
            let time_constants_s = [Direction::Up, Direction::Down].map(average);
            warnings.push(StepsWarning::Square { time_constants_s });
        }
        Lagged::Response if lag.is_curved(CURVED_PROBABILITY) => {
            let Estimate { value: curvature, std, .. } = lag.curvature;
            warnings.push(StepsWarning::Curved { curvature, std });
        }
        Lagged::Response => {}
    }
    if lag.delay_s.value < -lag.most_lead_s && lag.delay_s.excludes(-lag.most_lead_s) {
        warnings.push(StepsWarning::NegativeDelay { delay_s: lag.delay_s.value });
    }
    warnings
}

/// Plateaus that are left before the response settles, as the curve says.
pub(super) fn not_settled(
    record: &Record,
    plateaus: &[Plateau],
    curve: Option<&TimeConstantCurve>,
) -> Option<StepsWarning> {
    let curve = curve?;
    let (mut slowest_s, mut least) = (0.0_f64, f64::INFINITY);
    let (mut count, mut of) = (0, 0);
    // A plateau that a run begins with begins where it has settled.
    for plateau in plateaus.iter().filter(|p| p.direction.is_some() && p.state == PlateauState::Running) {
        let at = plateau.command.clamp(curve.range.0, curve.range.1);
        let tau_s = curve.toward(at, plateau.direction?).value;
        let held = (record.time_s[plateau.rows.end - 1] - record.time_s[plateau.rows.start]) / tau_s;
        slowest_s = slowest_s.max(tau_s);
        of += 1;
        if held < SETTLED_TIME_CONSTANTS {
            count += 1;
            least = least.min(held);
        }
    }
    let needed_s = SETTLED_TIME_CONSTANTS * slowest_s;
    (count > 0).then_some(StepsWarning::NotSettled { count, of, least, needed_s })
}
