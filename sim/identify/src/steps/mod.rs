//! Models from staircases: steps between levels of constant command.
//!
//! [`fit_staircase`] takes a record through these stages, one file each:
//!
//! 1. readings that no rotor can have made are set aside (`spikes`);
//! 2. plateaus are found, and of them the longest run on which the motor runs steadily; start-up and
//!    stopping are cut off by that rule (`plateaus`, `run`), and levels on which the response stands on a limit are
//!    marked (`limits`);
//! 3. one lag is fitted to all steps at once (`problem` and `fit`), in closed form (`response`), with
//!    standard errors that know the noise's color (`uncertainty`);
//! 4. levels get their static response, slope and time constants (`levels`);
//! 5. the whole run is simulated and compared (here).
//!
//! Beside it, [`compare_laws`] asks whether one lag will do or its time constant depends on the speed (`law`, `splits`).
//!
//! # Which law for large steps
//! Small steps up have one time constant each. A large step down crosses many levels, and three laws are at
//! hand: the time constant of the level it leads to; that of the level it is at; and a motor with drag,
//! which lies between. All are one family in `k` ([`StaircaseFit::curvature`]): 0, 1 and up to 1/2. So
//! `k` is estimated, one for the record, and time constants are always those of small motions about
//! the level that the step leads to. It has to be estimated: on three logs of real motors it came out as
//! 0.09, 0.44 and -1.06. The last is no motor's; fixing it at a motor's value would move the residual of the large
//! steps into their time constants, and make up and down differ where they do not.

mod error;
mod fit;
mod law;
mod levels;
mod limits;
mod model;
mod plateaus;
mod problem;
mod response;
mod run;
mod spikes;
mod splits;
mod uncertainty;
mod warning;

use serde::ser::SerializeStruct as _;
use serde::{Serialize, Serializer};
use std::ops::Range;

pub use error::StepsError;
pub use law::{LagLaw, LawFit};
pub use levels::{Branch, Level};
pub use plateaus::Direction;
pub use splits::{HeldOut, LawComparison, SPLITS, Split, compare_laws};
pub use warning::{LeftOut, StepsWarning};

use rotorlead_records::{Output, Record};

use fit::{FittedStep, LagFit};

use super::Estimate;
use super::fit_percent::fit_percent;
pub use plateaus::{Plateau, SAME_LEVEL};
use problem::Data;
pub use problem::rows_after_gaps;
use response::{Segment, simulate};
pub use run::Run;
pub(super) use run::plateaus_of;
pub use spikes::without_spikes;

/// A lag toward a static map, as a staircase shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct StaircaseFit {
    /// The record's file.
    pub record: String,
    /// Which column was fitted.
    pub output: Output,
    /// The rows on which the motor runs steadily.
    pub rows: Range<usize>,
    /// The levels, by increasing command.
    pub levels: Vec<Level>,
    /// The direction in which more levels were seen; gains and the static map are taken from it.
    pub main_direction: Direction,
    /// Delay of all steps in seconds, as logged: from the time stamp of the first row with the new
    /// command. The log may stamp late by up to a row, so it can be negative. Half an ESC frame is taken
    /// off where the frame is known.
    pub delay_s: Estimate,
    /// Standard deviation of single steps' delays about [`Self::delay_s`], seconds: in which part of a row
    /// or of a frame the command changed.
    pub onset_std_s: f64,
    /// Curvature of the lag: how much faster a large step starts than a first-order lag, relative to the ratio of the
    /// excess to the level. 0 for a first-order lag, up to 1/2 with drag; below 0 when something makes it
    /// start more gently.
    pub curvature: Estimate,
    /// `100 (1 - ||y - yhat|| / ||y - mean(y)||)` of the run, simulated from its first row on with one
    /// static map, one delay and one time constant per level and direction.
    pub fit_percent: f64,
    /// The same with spikes.
    pub fit_percent_with_spikes: f64,
    /// The same without spikes, when every plateau has its own level and every step its own onset: what the
    /// lag alone fails to explain.
    pub fit_percent_own_levels: f64,
    /// The simulated response over [`Self::rows`].
    pub simulated: Vec<f64>,
    /// What is odd about the record.
    pub warnings: Vec<StepsWarning>,
}

impl Serialize for StaircaseFit {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut values = serializer.serialize_struct("StaircaseFit", 6)?;
        values.serialize_field("record", &self.record)?;
        values.serialize_field("delay_s", &self.delay_s.value)?;
        values.serialize_field("delay_s_std", &self.delay_s.std)?;
        values.serialize_field("fit_percent", &self.fit_percent)?;
        values.serialize_field("fit_percent_with_spikes", &self.fit_percent_with_spikes)?;
        values.serialize_field("levels", &self.levels)?;
        values.end()
    }
}

/// Relative standard error above which a time constant is no basis for a design.
pub(super) const MAX_RELATIVE_STD: f64 = 0.35;

/// Fits a lag toward a static map to a staircase.
///
/// `esc_frame_hz` is the rate at which the ESC takes commands over, where it is known: half a frame of the
/// delay is then the frame's.
///
/// # Errors
/// [`StepsError`]: no response, a command that never changes, a motor that never runs steadily, no step
/// out of the noise.
pub fn fit_staircase(record: &Record, output: Output, esc_frame_hz: Option<f64>) -> Result<StaircaseFit, StepsError> {
    let raw = checked_response(record, output)?;
    let run = Run::of(record, output)?;
    let rows = run.rows();
    let shown = run.rows_that_show();
    let mut warnings = warnings_of_run(record, &run);
    let Run { clean: y, spike, plateaus, limits, .. } = run;

    let data = Data { name: &record.file, time_s: &record.time_s, y: &y, spike: &spike };
    let frame_s = esc_frame_hz.filter(|&hz| hz > 0.0).map_or(0.0, |hz| 1.0 / hz);
    let lag = fit::fit(&data, &plateaus, frame_s).map_err(|error| match (error, limits.first()) {
        (StepsError::NoUsableStep { record }, Some(limit)) => StepsError::AtLimit { record, at: limit.at },
        (error, _) => error,
    })?;
    let (levels, main_direction) = levels::levels(&plateaus, &lag.groups);

    let time_s = &record.time_s[rows.clone()];
    let mut simulated = vec![0.0; rows.len()];
    let common = segments(&record.time_s, &plateaus, &lag, |_, plateau| {
        // A limit is no level of the motor, but all that is known there.
        let level = if plateau.limited { plateau.mean } else { map_response(&levels, main_direction, plateau.command) };
        (level, lag.delay_s.value)
    });
    let mut own_levels = simulated.clone();
    let own = segments(&record.time_s, &plateaus, &lag, |step, plateau| {
        step.map_or((plateau.mean, lag.delay_s.value), |s| (s.level, s.delay_s))
    });
    // The fit went through the same steps, so they have a response; should rounding say otherwise, the
    // percentages say so too.
    let _ = simulate(&common, lag.curvature.value, time_s, &mut simulated);
    let _ = simulate(&own, lag.curvature.value, time_s, &mut own_levels);
    let kept = |k: usize| shown[k] && !spike[rows.start + k];
    warnings.extend(warnings_of_fit(&levels, &lag));
    warnings.extend(gaps(record, &rows, &plateaus));
    warnings.extend(not_settled(record, &plateaus, &levels));
    Ok(StaircaseFit {
        record: record.file.clone(),
        output,
        fit_percent: percent(&y[rows.clone()], &simulated, kept),
        fit_percent_with_spikes: percent(&raw[rows.clone()], &simulated, |k| shown[k]),
        fit_percent_own_levels: percent(&y[rows.clone()], &own_levels, kept),
        delay_s: Estimate { value: lag.delay_s.value - 0.5 * frame_s, ..lag.delay_s },
        onset_std_s: lag.onset_std_s,
        curvature: lag.curvature,
        rows,
        levels,
        main_direction,
        simulated,
        warnings,
    })
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

/// The static map at a command: the main branch where it was seen there, else the other.
fn map_response(levels: &[Level], main: Direction, command: f64) -> f64 {
    let level = levels.iter().find(|l| (l.command - command).abs() <= SAME_LEVEL);
    level.and_then(|l| l.branch(main).or(l.up.as_ref()).or(l.down.as_ref())).map_or(0.0, |b| b.mean.value)
}

/// The run as the simulation takes it; `level_and_delay` gives both for each plateau and, where it was
/// fitted, the step that leads to it. A step that was not fitted is as fast as that to the nearest level.
fn segments(
    time_s: &[f64],
    plateaus: &[Plateau],
    lag: &LagFit,
    level_and_delay: impl Fn(Option<&FittedStep>, &Plateau) -> (f64, f64),
) -> Vec<Segment> {
    plateaus
        .iter()
        .enumerate()
        .map(|(k, plateau)| {
            let step = lag.steps.iter().find(|s| s.plateau == k);
            let (level, delay_s) = level_and_delay(step, plateau);
            let group = step.map(|s| &lag.groups[s.group]).or_else(|| {
                let far = |g: &fit::Group| (g.command - plateau.command).abs();
                lag.groups.iter().min_by(|a, b| far(a).total_cmp(&far(b)))
            });
            Segment {
                from_s: time_s[plateau.rows.start],
                level,
                time_constant_s: group.map_or(f64::NAN, |g| g.time_constant_s.value),
                delay_s,
            }
        })
        .collect()
}

/// % fit over the rows that are kept. Minus infinity for a response that is constant, which a run with a usable step is
/// not.
fn percent(y: &[f64], simulated: &[f64], kept: impl Fn(usize) -> bool) -> f64 {
    let (y, simulated): (Vec<f64>, Vec<f64>) = (0..y.len()).filter(|&k| kept(k)).map(|k| (y[k], simulated[k])).unzip();
    fit_percent(&y, &simulated).unwrap_or(f64::NEG_INFINITY)
}

/// Time constants in one direction further than this factor from their neighbors' are odd.
const ODD_FACTOR: f64 = 1.5;
/// Time constants up and down that differ by more than this factor, and by more than their errors, are
/// worth a word.
const ASYMMETRY_FACTOR: f64 = 1.2;

/// What is odd about the rows.
fn warnings_of_run(record: &Record, run: &Run) -> Vec<StepsWarning> {
    let mut warnings = Vec::new();
    let (rows, reason) = (run.rows(), run.left_out);
    let spikes = run.spike[rows.clone()].iter().filter(|&&s| s).count();
    if rows.start > 0 {
        let until_s = record.time_s[rows.start];
        warnings.push(StepsWarning::StartLeftOut { until_s, reason });
    }
    if let Some(&from_s) = record.time_s.get(rows.end) {
        warnings.push(StepsWarning::EndLeftOut { from_s, reason });
    }
    if spikes > 0 {
        warnings.push(StepsWarning::Spikes { rows: spikes });
    }
    for limit in &run.limits {
        let stands = |p: &&Plateau| p.limited && run.clean[p.rows.clone()].contains(&limit.at);
        let commands = run.plateaus.iter().filter(stands).map(|p| p.command);
        let (low, high) = commands.fold((1.0_f64, 0.0_f64), |(low, high), u| (low.min(u), high.max(u)));
        warnings.push(StepsWarning::Limited { rows: limit.rows, at: limit.at, commands: (low, high) });
    }
    warnings
}

/// What is odd about the levels and the lag.
fn warnings_of_fit(levels: &[Level], lag: &LagFit) -> Vec<StepsWarning> {
    let mut warnings = Vec::new();
    for level in levels {
        let command = level.command;
        if level.gain.is_none() {
            warnings.push(StepsWarning::NotRising { command });
        }
        match level.time_constant_s() {
            None if level.gain.is_some() => warnings.push(StepsWarning::NoStep { command }),
            Some(e) if e.std > MAX_RELATIVE_STD * e.value => {
                let relative_std = e.std / e.value;
                warnings.push(StepsWarning::Uncertain { command, relative_std });
            }
            _ => {}
        }
        if let (Some(up), Some(down)) = (level.up, level.down)
            && let (Some(up), Some(down)) = (up.time_constant_s, down.time_constant_s)
        {
            let ratio = down.value / up.value;
            let apart = Estimate::normal(down.value - up.value, down.std.hypot(up.std)).excludes(0.0);
            if apart && !(1.0 / ASYMMETRY_FACTOR..=ASYMMETRY_FACTOR).contains(&ratio) {
                warnings.push(StepsWarning::Asymmetric { command, ratio });
            }
        }
    }
    for direction in [Direction::Up, Direction::Down] {
        warnings.extend(odd_ones(levels, direction));
    }
    let curvature = lag.curvature;
    if curvature.excludes(0.0) {
        warnings.push(StepsWarning::Curved { curvature: curvature.value, std: curvature.std });
    }
    if lag.delay_s.value < 0.0 && lag.delay_s.excludes(0.0) {
        warnings.push(StepsWarning::NegativeDelay { delay_s: lag.delay_s.value });
    }
    warnings
}

/// Gaps of the log within the run.
fn gaps(record: &Record, rows: &Range<usize>, plateaus: &[Plateau]) -> Option<StepsWarning> {
    let (after, longest_s) = problem::rows_after_gaps(&record.time_s[rows.clone()]);
    let begins = |p: &&Plateau| p.rows.start > rows.start && after.binary_search(&(p.rows.start - rows.start)).is_ok();
    let steps = plateaus.iter().filter(begins).count();
    (!after.is_empty()).then_some(StepsWarning::Gaps { count: after.len(), longest_s, steps })
}

/// A level is as good as settled after this many time constants: e^-5, 0.7 %, is left.
const SETTLED_TIME_CONSTANTS: f64 = 5.0;

/// Plateaus that are left before the response settles, as their levels' time constants say.
fn not_settled(record: &Record, plateaus: &[Plateau], levels: &[Level]) -> Option<StepsWarning> {
    let time_constant_s = |plateau: &Plateau| {
        let level = levels.iter().find(|level| (level.command - plateau.command).abs() <= SAME_LEVEL)?;
        Some(level.time_constant_s()?.value)
    };
    let mut slowest_s = 0.0_f64;
    let (mut count, mut least) = (0, f64::INFINITY);
    // The first one begins where it has settled.
    for plateau in plateaus.iter().skip(1) {
        let Some(tau_s) = time_constant_s(plateau) else { continue };
        let held = (record.time_s[plateau.rows.end - 1] - record.time_s[plateau.rows.start]) / tau_s;
        slowest_s = slowest_s.max(tau_s);
        if held < SETTLED_TIME_CONSTANTS {
            count += 1;
            least = least.min(held);
        }
    }
    let needed_s = SETTLED_TIME_CONSTANTS * slowest_s;
    (count > 0).then_some(StepsWarning::NotSettled { count, of: plateaus.len() - 1, least, needed_s })
}

/// Levels whose time constant is far from those of the two levels on each side.
fn odd_ones(levels: &[Level], direction: Direction) -> Vec<StepsWarning> {
    let known: Vec<(f64, Estimate)> =
        levels.iter().filter_map(|l| Some((l.command, l.branch(direction)?.time_constant_s?))).collect();
    let mut odd = Vec::new();
    for (k, &(command, own)) in known.iter().enumerate() {
        let mut around: Vec<f64> =
            (k.saturating_sub(2)..(k + 3).min(known.len())).filter(|&i| i != k).map(|i| known[i].1.value).collect();
        if around.len() < 3 {
            continue;
        }
        around.sort_by(f64::total_cmp);
        let middle = around.len() / 2;
        let usual = 0.5 * (around[middle] + around[(around.len() - 1) / 2]);
        let ratio = own.value / usual;
        if own.excludes(usual) && !(1.0 / ODD_FACTOR..=ODD_FACTOR).contains(&ratio) {
            odd.push(StepsWarning::Odd { command, direction, ratio });
        }
    }
    odd
}
