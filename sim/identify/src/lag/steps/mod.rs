//! Models from staircases: steps between levels of constant command.
//!
//! [`fit_staircase`] takes a record through these stages, one file each:
//!
//! 1. readings that no rotor can have made are set aside (`rows::spikes`);
//! 2. plateaus are found, and of them the runs on which the motor runs steadily; start-up, idling and
//!    stopping are cut off by that rule (`plateaus`, `run`), and levels on which the response stands on a limit are
//!    marked (`clipped_plateaus`);
//! 3. steps that carry no lag are left out, each with its reason (`step`, `step_gaps`);
//! 4. a lag is fitted to each of the others, with a common delay (`problem` and `fit`), in closed form (`response`), with
//!    standard errors that know the noise's color and that of the time stamps (`uncertainty`); of a sensor that is slower than the
//!    rows, each reading counts once, as a momentary value or as a mean (`averaging`);
//! 5. a smooth curve of the time constant over operating points is laid through them, which finds steps that contradict the
//!    others, and what they differ by beyond their own errors (`curve`);
//! 6. levels get their static response, slope and time constants (`levels`);
//! 7. the runs are simulated with that (`simulated`) and compared (here).
//!
//! Whether one lag will do, or its time constant depends on speed or direction, is what the diagnosis asks.
//!
//! # Which law for large steps
//! Small steps up have one time constant each. A large step down crosses many levels, and a motor with drag is faster on
//! the upper ones. How much is in `k` ([`StaircaseFit::curvature`]), which is estimated, one for the record; time constants
//! are always those of small motions about the level that the step leads to. Fixing `k` at a motor's value would move the
//! residual of the large steps into their time constants where something else starts them more gently, and make up and down
//! differ where they do not.
//!
//! Thrust that is the square of a speed with a first-order lag has a curvature too, which is another at each level. So where thrust is
//! curved, the same fit is made with its square root as what lags ([`Lagged`]). It is taken, with a first-order lag, where the root is not
//! curved, and the curvature of thrust gains no more on it than a parameter does by chance. Rows, noise and levels are those of thrust in both.

mod averaging;
mod clipped_plateaus;
mod curve;
pub(crate) mod error;
mod fit;
mod levels;
mod model;
mod plateaus;
mod problem;
mod response;
mod run;
mod simulated;
mod step;
mod step_gaps;
mod uncertainty;
mod warning;
mod warnings;
mod weights;

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use serde::ser::SerializeStruct as _;
use serde::{Serialize, Serializer};

pub use averaging::Averaging;
pub use curve::TimeConstantCurve;
pub use error::StepsError;
pub use levels::{Branch, Level};
pub use plateaus::Direction;
pub use warning::{LeftOut, StepsWarning};

use rotorlead_plant::Lagged;
use rotorlead_records::{CommandLog, Output, Record};

use crate::estimate::{Estimate, MAX_RELATIVE_STD};
use crate::goodness_of_fit::{fit_percent, percent_with_residual, spread};
use crate::rows::readings::mean_over;
use curve::StepTimeConstant;
use fit::{CURVATURE_KNOWN, FIRST_ORDER, LagFit, StepRows};
use levels::map_response;
pub use plateaus::{Plateau, PlateauState, SAME_LEVEL};
pub use run::Run;
pub(crate) use run::find_plateaus;
use simulated::{LevelAndDelay, simulate_run};
pub use step::{Step, StepFault, StepLag};

/// Probability of the interval of a curvature that has to leave out zero for steps to be called curved. Standard: that of every interval
/// here, 95 %.
const CURVED_PROBABILITY: f64 = 0.95;
/// And for the square to be refused. Chosen: once it explains a curvature of thrust that is known to be one, a true square is refused once
/// in 1000 records.
const SQUARE_PROBABILITY: f64 = 0.999;
/// Twice the logarithm of the likelihood ratio that a curvature gains where there is none. Derived: the chi-square of one degree of freedom
/// at [`SQUARE_PROBABILITY`].
const CURVATURE_BY_CHANCE: f64 = 10.83;

/// A lag toward a static map, as a staircase shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct StaircaseFit {
    /// The record's file.
    pub record: String,
    /// Which column was fitted.
    pub output: Output,
    /// What lags: the response, or where it is thrust its square root. Time constants, delay and curvature are of that, levels and
    /// gains of the response.
    pub lagged: Lagged,
    /// The rows on which the motor runs steadily: one range or more, parted by stops and idling.
    pub runs: Vec<Range<usize>>,
    /// All steps of these runs, in time, each with its lag or the reason why it has none.
    pub steps: Vec<Step>,
    /// The time constant over operating points; `None` where no step has one that is known.
    pub curve: Option<TimeConstantCurve>,
    /// The levels, by increasing command.
    pub levels: Vec<Level>,
    /// The direction in which more levels were seen; gains and the static map are taken from it.
    pub main_direction: Direction,
    /// Delay of all steps in seconds, as logged: from the stamp of the new command's first row, or from half an interval before its own
    /// in a log that repeats its commands. The log may stamp late by up to a row, so it can be negative. Half an ESC frame is taken off
    /// where the frame is known.
    pub delay_s: Estimate,
    /// Standard deviation of single steps' delays about [`Self::delay_s`], seconds: in which part of a row
    /// or of a frame the command changed.
    pub onset_std_s: f64,
    /// Standard deviation of the rows' time stamps, seconds: jitter, and whatever a lag does not explain of the way from
    /// level to level.
    pub stamp_std_s: f64,
    /// Curvature of the lag: how much faster a large step down starts than a first-order lag, relative to the ratio of the
    /// excess to the highest level, at the median time constant. 0 for a first-order lag, about 1/2 with drag.
    pub curvature: Estimate,
    /// `100 (1 - ||y - yhat|| / ||y - mean(y)||)` of the runs, each simulated from its first row on with one
    /// static map, one delay and the curve of time constants.
    pub fit_percent: f64,
    /// The same with spikes.
    pub fit_percent_with_spikes: f64,
    /// The same without spikes, when every plateau has its own level and every step its own onset: what the
    /// lag alone fails to explain.
    pub fit_percent_own_levels: f64,
    /// The same of a perfect model: what the scatter of settled rows leaves.
    pub ceiling_percent: f64,
    /// The simulated response over [`Self::runs`], one run behind the other.
    pub simulated: Vec<f64>,
    /// What is odd about the record.
    pub warnings: Vec<StepsWarning>,
}

impl Serialize for StaircaseFit {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut values = serializer.serialize_struct("StaircaseFit", 9)?;
        values.serialize_field("record", &self.record)?;
        values.serialize_field("lagged", &self.lagged)?;
        values.serialize_field("delay_s", &self.delay_s.value)?;
        values.serialize_field("delay_s_std", &self.delay_s.std)?;
        values.serialize_field("fit_percent", &self.fit_percent)?;
        values.serialize_field("fit_percent_with_spikes", &self.fit_percent_with_spikes)?;
        values.serialize_field("ceiling_percent", &self.ceiling_percent)?;
        values.serialize_field("levels", &self.levels)?;
        values.serialize_field("steps", &self.steps)?;
        values.end()
    }
}

/// Fits a lag toward a static map to a staircase.
///
/// `esc_frame_hz` is the rate at which the ESC takes commands over, where it is known: half a frame of the
/// delay is then the frame's.
///
/// # Errors
/// [`StepsError`]: no response, a command that never changes, a motor that never runs steadily, no step
/// that carries a lag.
pub fn fit_staircase(record: &Record, output: Output, esc_frame_hz: Option<f64>) -> Result<StaircaseFit, StepsError> {
    let raw = checked_response(record, output)?;
    let runs = Run::all(record, output)?;
    let steps = step::find_steps(&record.time_s, &runs);
    let (y, without_reading) = (runs[0].clean.clone(), runs[0].rows_without_reading());
    let data = StepRows {
        name: &record.file,
        time_s: &record.time_s,
        y: &y,
        without_reading: &without_reading,
        mean_s: 0.0,
        lagged: Lagged::Response,
        curvature: CURVATURE_KNOWN,
        late_s: record.command_log.as_ref().map(CommandLog::resolution_s),
    };
    let frame_s = esc_frame_hz.filter(|&hz| hz > 0.0).map_or(0.0, |hz| 1.0 / hz);
    let limit = runs.iter().find_map(|run| run.limits.first());
    let fit = |lagged, curvature| {
        averaging::fit(&StepRows { lagged, curvature, ..data }, &runs, &steps, frame_s).map_err(|error| {
            match (error, limit) {
                (StepsError::NoUsableStep { record, .. }, Some(limit)) => StepsError::AtLimit { record, at: limit.at },
                (error, _) => error,
            }
        })
    };
    let of_response = fit(Lagged::Response, CURVATURE_KNOWN)?;
    let square = || {
        if output != Output::ThrustN
            || !of_response.0.is_curved(CURVED_PROBABILITY)
            || fit(Lagged::SquareRoot, CURVATURE_KNOWN).ok()?.0.is_curved(SQUARE_PROBABILITY)
        {
            return None;
        }
        let square = fit(Lagged::SquareRoot, FIRST_ORDER).ok()?;
        (square.0.chi_square.gain_of(of_response.0.chi_square) < CURVATURE_BY_CHANCE).then_some(square)
    };
    let (lag, mut steps, readings) = square().unwrap_or(of_response);
    let curve = join(&mut steps, &lag);
    let plateaus: Vec<Plateau> = runs.iter().flat_map(|run| &run.plateaus).cloned().collect();
    let (levels, main_direction) = levels::levels(&plateaus, &steps, curve.as_ref());

    // Those first that change the answer most.
    let mut warnings = warnings::check_steps(record, &runs, &steps);
    warnings.extend(warnings::not_settled(record, &plateaus, curve.as_ref()));
    warnings.extend(warnings::check_fit(&levels, &lag, curve.as_ref()));
    warnings.extend(warnings::check_runs(record, output, &runs));
    warnings.extend(readings.map(|readings| readings.warning(output.column())));
    let mean_s = readings.map_or(0.0, |readings| readings.mean_s());

    let common = |plateau: &Plateau, _: Option<&StepLag>| {
        // A limit is no level of the motor, but all that is known there.
        let level = if plateau.limited { plateau.mean } else { map_response(&levels, main_direction, plateau.command) };
        (level, lag.delay_s.value)
    };
    let own = |plateau: &Plateau, step: Option<&StepLag>| {
        let level = if plateau.state == PlateauState::Short { common(plateau, None).0 } else { plateau.mean };
        step.map_or((level, lag.delay_s.value), |step| (step.after, step.delay_s))
    };
    let simulate = |level: &LevelAndDelay<'_>| -> Vec<f64> {
        let run = |run: &Run| {
            let momentary = simulate_run(run, &record.time_s, &steps, &lag, curve.as_ref(), level);
            if mean_s > 0.0 { mean_over(&record.time_s[run.rows()], &momentary, mean_s) } else { momentary }
        };
        runs.iter().flat_map(run).collect()
    };
    let simulated = simulate(&common);
    let own_levels = simulate(&own);
    let rows: Vec<usize> = runs.iter().flat_map(Run::rows).collect();
    let shown: Vec<bool> = runs.iter().flat_map(Run::unclipped_rows).collect();
    let nothing = step::rows_without_lag(without_reading.clone(), &runs, &steps);
    let clean = |k: usize| shown[k] && !nothing[rows[k]];
    let ceiling = || {
        let noise = plateaus.iter().flat_map(|p| std::iter::repeat_n(p.std * p.std, p.rows.len()));
        let left = noise.enumerate().filter(|&(k, _)| clean(k)).map(|(_, variance)| variance).sum();
        let kept: Vec<f64> = (0..rows.len()).filter(|&k| clean(k)).map(|k| y[rows[k]]).collect();
        percent_with_residual(left, spread(&kept))
    };
    let percent = |of: &[f64], simulated: &[f64], kept: &dyn Fn(usize) -> bool| {
        let pairs = (0..rows.len()).filter(|&k| kept(k)).map(|k| (of[rows[k]], simulated[k]));
        let (y, simulated): (Vec<f64>, Vec<f64>) = pairs.unzip();
        // Minus infinity for a response that is constant, which runs with a usable step are not.
        fit_percent(&y, &simulated).unwrap_or(f64::NEG_INFINITY)
    };
    Ok(StaircaseFit {
        record: record.file.clone(),
        output,
        lagged: lag.lagged,
        fit_percent: percent(&y, &simulated, &clean),
        fit_percent_with_spikes: percent(raw, &simulated, &|k| shown[k]),
        fit_percent_own_levels: percent(&y, &own_levels, &clean),
        ceiling_percent: ceiling(),
        delay_s: Estimate { value: lag.delay_s.value - 0.5 * frame_s, ..lag.delay_s },
        onset_std_s: lag.onset_std_s,
        stamp_std_s: lag.stamp_std_s,
        curvature: lag.curvature,
        runs: runs.iter().map(Run::rows).collect(),
        steps,
        curve,
        levels,
        main_direction,
        simulated,
        warnings,
    })
}

/// Lays the curve through the steps; marks those that are hardly known or contradict the others, and widens the intervals of
/// all by what they differ by.
fn join(steps: &mut [Step], lag: &LagFit) -> Option<TimeConstantCurve> {
    let fitted: Vec<usize> = (0..steps.len()).filter(|&k| steps[k].lag.is_some()).collect();
    let mut known = Vec::new();
    for (place, &k) in fitted.iter().enumerate() {
        let relative_std = lag.covariance[(place, place)].sqrt();
        if relative_std <= MAX_RELATIVE_STD {
            known.push(place);
        } else {
            steps[k].fault = Some(StepFault::Uncertain { relative_std });
        }
    }
    let reading = |&place: &usize| {
        let step = &steps[fitted[place]];
        let log_tau = step.lag.map_or(f64::NAN, |lag| lag.time_constant_s.value.ln());
        StepTimeConstant { command: step.to, direction: step.direction(), log_tau }
    };
    let readings: Vec<StepTimeConstant> = known.iter().map(reading).collect();
    let covariance = DMatrix::from_fn(known.len(), known.len(), |i, j| lag.covariance[(known[i], known[j])]);
    let resolution_shift = DVector::from_fn(known.len(), |i, _| lag.resolution_shift[known[i]]);
    let (curve, left_out) = TimeConstantCurve::fit(&readings, &covariance, &resolution_shift)?;
    for (place, ratio) in left_out {
        steps[fitted[known[place]]].fault = Some(StepFault::Contradicts { ratio });
    }
    for &k in &fitted {
        let Some(lag) = &mut steps[k].lag else { continue };
        let tau = &mut lag.time_constant_s;
        tau.std = tau.std.hypot(tau.value * curve.between_std);
        if curve.between_std > 0.0 {
            tau.dof = curve.dof();
        }
    }
    Some(curve)
}

fn checked_response(record: &Record, output: Output) -> Result<&[f64], StepsError> {
    let y = record
        .response(output)
        .ok_or_else(|| StepsError::NoResponse { record: record.file.clone(), column: output.column() })?;
    let columns = [&record.time_s[..], &record.command, y];
    let finite = columns.iter().all(|c| c.iter().all(|v| v.is_finite()));
    let even = columns.iter().all(|c| c.len() == y.len());
    let forward = record.time_s.is_sorted_by(|a, b| a < b);
    if finite && even && forward { Ok(y) } else { Err(StepsError::Malformed { record: record.file.clone() }) }
}
