//! Two logs, two clocks: the delay and the skew between a command log and a response log.
//!
//! [`align`] finds how much later the response shows what the command said, and how much faster one clock runs; [`merge`]
//! makes one record of both. The stages, one file each:
//!
//! 1. the logs as they are: commands stand until the next row, responses have gaps (`logs`);
//! 2. correlation over all shifts and some skews says where to begin (`coarse`);
//! 3. delay, skew and a first-order lag are fitted together (`problem`), so that the lag is not taken for delay;
//! 4. the residual shows the color of the noise (`rotorlead_numerics::autoregression`), and the fit is done again on whitened rows:
//!    maximum likelihood, with standard errors that hold for colored noise.
//!
//! Where both logs have the response, it is what aligns them, without a lag; delay and skew then come from each second by itself
//! (`blocks`).
//!
//! # What cannot be identified
//! - **Latency from dead time.** Two logs show the sum of the offset between their clocks, the latency of both paths, the
//!   ESC's frame (half of one on average) and the actuator's own dead time. [`merge`] takes all of it away, but for what is
//!   known from elsewhere.
//! - **A second, shorter lag from delay.** A filter of time constant `T2` well below the lag's shows as a delay of about `T2`.
//! - **A lag that differs** with level or direction is fitted as one. The delay then moves by a part of the difference;
//!   the interval includes the residual, as noise, but not this shift.
//! - **One period from the next.** Where a repeated command is cut at both ends, [`AlignmentError::Ambiguous`] says so.

mod blocks;
mod coarse;
mod error;
mod logs;
mod merge;
mod problem;
mod rivals;

use serde::ser::SerializeStruct as _;
use serde::{Serialize, Serializer};
use std::fmt;
use std::ops::Range;

use nalgebra::DVector;
use rotorlead_numerics::autoregression::{fit_autoregression, whitened_rows};
use rotorlead_numerics::least_squares::{Residuals as _, Solution, StoppingCriteria, minimize};
use rotorlead_numerics::sample::mean;

pub use error::AlignmentError;
pub use logs::{CommandLog, ResponseLog};
pub use merge::{Merged, MergedRows, merge};

use crate::estimate::Estimate;
use crate::goodness_of_fit::fit_percent;
use coarse::Candidate;
use logs::{CommandSignal, DriveKind};
use problem::{AlignmentProblem, DELAY, GAIN, MOST_POWERS};

/// Where to search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlignmentOptions {
    /// Where the delay is expected, seconds of the response's clock less the command's: 0 for clocks that agree.
    pub near_s: f64,
    /// Greatest distance of the delay from `near_s`, either way, seconds; `None`: any at which half of the shorter log is
    /// in common.
    pub within_s: Option<f64>,
    /// Greatest difference of the clocks' rates, relative, below 0.5; 0 when both logs have one clock. `None`: what the logs allow
    /// to search, [`MAX_SKEW`] where a command drives a response and [`MAX_SKEW_OF_RESPONSES`] where both have the response.
    pub max_skew: Option<f64>,
}

/// Greatest skew that is searched where a command drives a response. Standard, by data sheets: a quartz is off by 1e-4 at most, a ceramic
/// resonator by up to this. An RC oscillator, off by 1e-2 and more, needs `max_skew`.
pub const MAX_SKEW: f64 = 5e-3;
/// Greatest skew that is searched where both logs have the response: of loggers that count their rows and not their time. Chosen: nearly
/// half more than the 1 in 12 that one was seen to be off by (`docs/identification.md`).
pub const MAX_SKEW_OF_RESPONSES: f64 = 0.12;

impl Default for AlignmentOptions {
    /// Any delay, and any skew that the logs allow to search.
    fn default() -> Self {
        Self { near_s: 0.0, within_s: None, max_skew: None }
    }
}

/// How the two clocks and the two logs are related.
#[derive(Clone, Debug, PartialEq)]
pub struct Alignment {
    /// How much later the response log shows what the command log says, at [`Self::reference_s`], seconds of the command's
    /// clock. Negative where
    /// the logger's clock is behind by more than the delay.
    pub delay_s: Estimate,
    /// How much faster the logger's clock runs than the command's, relative (1e-6 is 1 ppm); `None` where the record
    /// does not tell and the clocks were taken to be as fast.
    pub skew: Option<Estimate>,
    /// Where the delay is counted: the middle of the rows in common, on the logger's clock, seconds.
    pub reference_s: f64,
    /// Time constant of the lag that was fitted beside, seconds; `None` where the logs have the response in common, which follows
    /// itself without one.
    pub time_constant_s: Option<Estimate>,
    /// % fit of the lag behind its static polynomial, or of the one response by the other.
    pub fit_percent: f64,
    /// Rows of the response that were used.
    pub rows: usize,
    /// Gaps of the response log among them.
    pub gaps: usize,
    /// Order of the noise's autoregression; 0 for white noise.
    pub noise_order: usize,
    /// What is odd.
    pub warnings: Vec<AlignmentWarning>,
}

/// Delay and skew with their errors and 95 % intervals.
impl Serialize for Alignment {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut values = serializer.serialize_struct("Alignment", 11)?;
        values.serialize_field("delay_s", &self.delay_s.value)?;
        values.serialize_field("delay_s_std", &self.delay_s.std)?;
        values.serialize_field("delay_s_interval", &self.delay_s.interval(0.95))?;
        values.serialize_field("reference_s", &self.reference_s)?;
        values.serialize_field("skew", &self.skew.map(|skew| skew.value))?;
        values.serialize_field("skew_std", &self.skew.map(|skew| skew.std))?;
        values.serialize_field("skew_interval", &self.skew.map(|skew| skew.interval(0.95)))?;
        values.serialize_field("time_constant_s", &self.time_constant_s.map(|tau| tau.value))?;
        values.serialize_field("fit_percent", &self.fit_percent)?;
        values.serialize_field("rows", &self.rows)?;
        values.serialize_field("gaps", &self.gaps)?;
        values.end()
    }
}

/// What a reader of an alignment has to know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlignmentWarning {
    /// The logs do not tell the clocks' rates apart.
    NoSkew,
    /// The clocks differ by more than any oscillator is off by, so that one of the logs' times is none.
    NoClock {
        /// How much faster the response's clock runs, relative.
        skew: f64,
    },
    /// The lag is shorter than the time between rows.
    ShortLag {
        /// Time between rows, seconds.
        row_s: f64,
    },
}

impl fmt::Display for AlignmentWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NoSkew => write!(
                f,
                "the skew of the clocks cannot be distinguished from these logs; they were taken to run alike. Record steps near both ends"
            ),
            Self::NoClock { skew } => write!(
                f,
                "the response's clock is {} by {:.2} %, more than any clock is off by: one of the two logs does not have the time. The \
                 time constants are those of the command's clock; look which of the two agrees with a watch",
                if skew > 0.0 { "fast" } else { "slow" },
                1e2 * skew.abs()
            ),
            Self::ShortLag { row_s } => write!(
                f,
                "the response follows within one row, {:.1} ms: the delay is known to a row only. Log faster",
                1e3 * row_s
            ),
        }
    }
}

impl Alignment {
    /// The command's time whose command acts on the response at the logger's `response_time_s`.
    #[must_use]
    pub fn command_time_s(&self, response_time_s: f64) -> f64 {
        let skew = self.skew.map_or(0.0, |skew| skew.value);
        self.reference_s - self.delay_s.value + (response_time_s - self.reference_s) / (1.0 + skew)
    }
}

/// Fewest rows in common. Chosen: six for each of at most 8 parameters; fewer leave the color of the noise and the intervals to chance.
const LEAST_ROWS: usize = 50;
/// Time constants to begin with, seconds: those of small and of large rotors. Chosen: a factor of two about both covers 15 to 240 ms.
const STARTS_S: [f64; 2] = [0.03, 0.12];
/// Limits of the fits from each start. Chosen: enough to tell which one is in the right basin; the best one is then fitted to the end.
const FIRST_LOOK: StoppingCriteria = StoppingCriteria { iterations: 8, decrease: 1e-3 };
/// Limits of the fit. A row that a change passes leaves the search zigzagging by ever less. Derived: a step below `decrease` moves no
/// parameter of `n` rows by more than `sqrt(1e-8 n)` of its standard error, a hundredth at 10 000 rows. Chosen: a search that needs more
/// than 100 steps is refused.
const LIMITS: StoppingCriteria = StoppingCriteria { iterations: 100, decrease: 1e-8 };
/// Least Wald chi-square of the gains of logs that are related. Derived: at 3 degrees of freedom chance passes it with 6e-13, and with less
/// than 1e-5 anywhere in a search over 1e7 shifts and skews.
const RELATED: f64 = 60.0;
/// Two meters of one response agree to this % fit or better. Tuned on logs of real motors (`docs/identification.md`): two pairs of one run
/// agree to 94.5 and 95.2 %, and staircases of two different motors to 82.
const SAME_RUN_PERCENT: f64 = 90.0;
/// Largest standard error of a delay, seconds. Chosen: its 95 % interval reaches 0.1 s to either side, as far as the lag of a large rotor.
const VAGUE_S: f64 = 0.05;

/// Finds delay and skew.
///
/// # Errors
/// [`AlignmentError`]: logs that are malformed, constant, too short or not of the same run; a command that repeats, so that
/// two delays explain the logs alike; an interval that is too wide.
pub fn align(
    command: &CommandLog<'_>,
    response: &ResponseLog<'_>,
    options: &AlignmentOptions,
) -> Result<Alignment, AlignmentError> {
    command.check()?;
    response.check()?;
    let drive = command.drive();
    let max_skew = options.max_skew.unwrap_or(match drive.kind {
        DriveKind::Command => MAX_SKEW,
        DriveKind::Response => MAX_SKEW_OF_RESPONSES,
    });
    let candidates = coarse::candidates(command, &drive, response, options, max_skew);
    if candidates.is_empty() {
        return Err(match options.within_s {
            Some(within_s) => AlignmentError::NoOverlap { within_s, near_s: options.near_s },
            None => AlignmentError::NotRelated { log: response.name.into() },
        });
    }
    let parts: Vec<Overlap> = candidates.iter().map(|c| Overlap::between(command, response, c)).collect();
    if let Some(rows) = parts.iter().map(|part| part.time_s.len()).max().filter(|&rows| rows < LEAST_ROWS) {
        return Err(AlignmentError::TooShort { log: response.name.into(), rows, needed: LEAST_ROWS });
    }
    let not_converged = || AlignmentError::NotConverged { log: response.name.into() };
    let mut tried: Vec<(&Overlap, AlignmentProblem<'_>, Solution)> = parts
        .iter()
        .zip(&candidates)
        .filter(|(part, _)| part.time_s.len() >= LEAST_ROWS)
        .filter_map(|(part, candidate)| {
            let problem = part.problem(command, &drive, max_skew > 0.0);
            let solution = first_look(&problem, part, candidate)?;
            Some((part, problem, solution))
        })
        .collect();
    let variance = |solution: &Solution| solution.sum_of_squares / solution.residuals.len() as f64;
    tried.sort_by(|a, b| variance(&a.2).total_cmp(&variance(&b.2)));
    let mut tried = tried.into_iter();
    let (part, mut problem, look) = tried.next().ok_or_else(not_converged)?;
    let solution = refined(&mut problem, &look.parameters).ok_or_else(not_converged)?;

    // Of two delays that explain the logs alike neither is the delay.
    for (_, mut rival, look) in tried {
        let Some(found) = refined(&mut rival, &look.parameters) else { continue };
        // Both at the logger's time zero, as the rows in common differ and their middles with them.
        let delay_s = |problem: &AlignmentProblem<'_>, s: &Solution| {
            s.parameters[DELAY] - problem.skew(&s.parameters) * problem.reference_s
        };
        let (first_s, second_s) = (delay_s(&problem, &solution), delay_s(&rival, &found));
        // Chosen: within three time constants a lag makes up for a delay, and both are one minimum.
        let apart =
            (first_s - second_s).abs() > 3.0 * problem.time_constant_s(&solution.parameters).max(response.interval_s());
        if apart && rivals::alike((&problem, &solution), (&rival, &found)) {
            let (first_s, second_s) = (solution.parameters[DELAY], found.parameters[DELAY]);
            return Err(AlignmentError::Ambiguous { first_s, second_s });
        }
    }
    judged(response, options, max_skew, part, problem, solution)
}

/// The rows in common at a candidate's shift.
struct Overlap {
    time_s: Vec<f64>,
    response: Vec<f64>,
    runs: Vec<Range<usize>>,
    reference_s: f64,
    start_s: f64,
    /// The candidate's delay, at `reference_s`.
    delay_s: f64,
}

impl Overlap {
    fn between(command: &CommandLog<'_>, response: &ResponseLog<'_>, candidate: &Candidate) -> Self {
        let (start_s, end_s) = response.span_s();
        let middle_s = 0.5 * (start_s + end_s);
        let (from_s, to_s) = command.span_s();
        let at = |t: f64| middle_s - candidate.delay_s + (t - middle_s) / (1.0 + candidate.skew);
        let inside = |row: &usize| (from_s..=to_s).contains(&at(response.time_s[*row]));
        let mut runs = Vec::new();
        let (mut time_s, mut y) = (Vec::new(), Vec::new());
        for run in response.runs() {
            let start = time_s.len();
            for row in run.filter(inside) {
                time_s.push(response.time_s[row]);
                y.push(response.response[row]);
            }
            if time_s.len() > start {
                runs.push(start..time_s.len());
            }
        }
        let reference_s = match (time_s.first(), time_s.last()) {
            (Some(first), Some(last)) => 0.5 * (first + last),
            _ => middle_s,
        };
        let mean = mean(&y);
        let square: f64 = y.iter().map(|v| (v - mean) * (v - mean)).sum();
        let scale = (square / y.len().max(1) as f64).sqrt().max(f64::MIN_POSITIVE);
        y.iter_mut().for_each(|v| *v = (*v - mean) / scale);
        Self {
            start_s: time_s.first().map_or(from_s, |&t| at(t)),
            delay_s: candidate.delay_s + candidate.skew * (reference_s - middle_s),
            time_s,
            response: y,
            runs,
            reference_s,
        }
    }

    fn problem<'a>(
        &'a self,
        command: &'a CommandLog<'_>,
        drive: &'a CommandSignal,
        skew: bool,
    ) -> AlignmentProblem<'a> {
        AlignmentProblem {
            command_time_s: command.time_s,
            drive: &drive.values,
            kind: drive.kind,
            time_s: &self.time_s,
            response: &self.response,
            runs: &self.runs,
            start_s: self.start_s,
            reference_s: self.reference_s,
            powers: powers(drive),
            skew,
            color: Vec::new(),
        }
    }
}

/// As many powers as the command has levels to tell them, less one for the offset; of a response it is itself.
fn powers(drive: &CommandSignal) -> usize {
    if drive.kind == DriveKind::Response {
        return 1;
    }
    let mut levels: Vec<f64> = Vec::new();
    for &v in &drive.values {
        // Of a range from -1 to 1. Chosen: levels within a hundredth of the range show no curvature.
        if levels.iter().all(|level| (level - v).abs() > 0.02) {
            levels.push(v);
            if levels.len() > MOST_POWERS {
                break;
            }
        }
    }
    levels.len().saturating_sub(1).clamp(1, MOST_POWERS)
}

/// A few steps from each start; the best of them.
fn first_look(problem: &AlignmentProblem<'_>, part: &Overlap, candidate: &Candidate) -> Option<Solution> {
    let mut best: Option<Solution> = None;
    let starts_s = if problem.lag_index().is_some() { &STARTS_S[..] } else { &[0.0] };
    for &tau_s in starts_s {
        // The correlation peaks at the delay and most of the lag together. Chosen: 0.7 of it, which the fit corrects.
        let mut start = vec![0.0; problem.parameters()];
        start[DELAY] = part.delay_s - 0.7 * tau_s;
        if let Some(lag) = problem.lag_index() {
            start[lag] = tau_s.ln();
        }
        if problem.skew {
            start[problem.skew_index()] = candidate.skew;
        }
        let columns = problem.regressors(&start)?;
        let normal = columns.tr_mul(&columns);
        let right = columns.tr_mul(&DVector::from_column_slice(problem.response));
        // Columns are of the size of one: what is below 1e-9 is rounding, as of an initial state that has gone.
        let linear = rotorlead_numerics::linear::linear_least_squares(normal, &right, 1e-9)?;
        let (of_rows, initial) = linear.as_slice().split_at(1 + problem.powers);
        start[GAIN - 1..GAIN + problem.powers].copy_from_slice(of_rows);
        if let (Some(lag), Some(initial)) = (problem.lag_index(), initial.first()) {
            start[lag + 1] = *initial;
        }
        if let Some(found) = minimize(problem, &start, FIRST_LOOK)
            && best.as_ref().is_none_or(|b| found.sum_of_squares < b.sum_of_squares)
        {
            best = Some(found);
        }
    }
    best
}

/// The best fit of either kind. Two meters of one response differ by spikes and stamps and not by a stationary noise, whose color
/// would make wrong delays look like right ones: there it is least squares alone.
fn refined(problem: &mut AlignmentProblem<'_>, start: &[f64]) -> Option<Solution> {
    match problem.kind {
        DriveKind::Command => whitened(problem, start),
        DriveKind::Response => minimize(problem, start, LIMITS).filter(|solution| solution.converged),
    }
}

/// The maximum-likelihood fit: least squares, then twice the color of what is left and least squares on whitened rows.
fn whitened(problem: &mut AlignmentProblem<'_>, start: &[f64]) -> Option<Solution> {
    problem.color.clear();
    let mut solution = minimize(problem, start, LIMITS)?;
    // Chosen: the second color is estimated from the residual of a whitened fit, free of the bias of the first one; a third costs one
    // more fit.
    for _ in 0..2 {
        let at = solution.parameters.clone();
        let mut residuals = vec![0.0; problem.count()];
        problem.color.clear();
        if !problem.evaluate(&at, &mut residuals) {
            return None;
        }
        problem.color = fit_autoregression(&residuals[..problem.time_s.len()], problem.runs);
        if problem.color.is_empty() {
            return Some(solution).filter(|s| s.converged);
        }
        solution = minimize(problem, &at, LIMITS)?;
    }
    Some(solution).filter(|s| s.converged)
}

fn white_variance(problem: &AlignmentProblem<'_>, solution: &Solution) -> f64 {
    solution.sum_of_squares / degrees_of_freedom(problem)
}

fn degrees_of_freedom(problem: &AlignmentProblem<'_>) -> f64 {
    let rows = whitened_rows(problem.runs, problem.color.len());
    rows.saturating_sub(problem.parameters() + problem.color.len()).max(1) as f64
}

/// Refuses what the logs do not tell, and gives the rest its intervals.
fn judged(
    response: &ResponseLog<'_>,
    options: &AlignmentOptions,
    max_skew: f64,
    part: &Overlap,
    mut problem: AlignmentProblem<'_>,
    mut solution: Solution,
) -> Result<Alignment, AlignmentError> {
    let log = || response.name.to_owned();
    let mut warnings = Vec::new();
    if problem.skew {
        let index = problem.skew_index();
        let std =
            solution.unit_covariance.as_ref().map(|c| (c[(index, index)] * white_variance(&problem, &solution)).sqrt());
        // Chosen: two standard errors to either side are then more than all that is searched.
        if std.is_none_or(|std| std > 0.5 * max_skew) {
            let mut start = solution.parameters.clone();
            start.remove(index);
            problem.skew = false;
            warnings.push(AlignmentWarning::NoSkew);
            solution = whitened(&mut problem, &start).ok_or_else(|| AlignmentError::NotConverged { log: log() })?;
        }
    }
    let is_response = problem.kind == DriveKind::Response;
    let line = is_response.then(|| blocks::line(&problem, &solution.parameters)).flatten();
    match &line {
        Some(line) => solution.parameters.clone_from(&line.parameters),
        None if is_response => {
            let start = solution.parameters.clone();
            solution = whitened(&mut problem, &start).ok_or_else(|| AlignmentError::NotConverged { log: log() })?;
        }
        None => {}
    }
    let dof = degrees_of_freedom(&problem);
    let variance = white_variance(&problem, &solution);
    let covariance = solution.unit_covariance.as_ref().map(|c| c * variance);
    let covariance = covariance.ok_or_else(|| AlignmentError::NotRelated { log: log() })?;
    let gains = GAIN..GAIN + problem.powers;
    let gain = DVector::from_column_slice(&solution.parameters[gains.clone()]);
    let of_gains = covariance.view((GAIN, GAIN), (gains.len(), gains.len())).clone_owned();
    let wald = of_gains.cholesky().map(|c| gain.dot(&c.solve(&gain)));
    if !wald.is_some_and(|wald| wald > RELATED) {
        return Err(AlignmentError::NotRelated { log: log() });
    }
    let estimate = |index: usize| {
        let value = solution.parameters[index];
        match &line {
            Some(line) if index == DELAY => Estimate { value, std: line.delay_std_s, dof: line.dof },
            Some(line) => Estimate { value, std: line.skew_std, dof: line.dof },
            None => Estimate { value, std: covariance[(index, index)].sqrt(), dof },
        }
    };
    let mut delay_s = estimate(DELAY);
    let time_constant_s = problem.lag_index().map(|lag| {
        let (lag, tau_s) = (estimate(lag), solution.parameters[lag].exp());
        Estimate { value: tau_s, std: tau_s * lag.std, dof }
    });
    let row_s = response.interval_s();
    if time_constant_s.is_some_and(|tau_s| tau_s.value < row_s) {
        // Derived: anywhere within a row alike, which has a standard deviation of the row over sqrt(12).
        warnings.push(AlignmentWarning::ShortLag { row_s });
        delay_s.std = delay_s.std.hypot(row_s / 12f64.sqrt());
    }
    if delay_s.std.is_nan() || delay_s.std > VAGUE_S {
        return Err(AlignmentError::Undetermined { log: log(), std_s: delay_s.std });
    }
    let near_s = options.near_s;
    if let Some(within_s) = options.within_s.filter(|&within_s| (delay_s.value - near_s).abs() > within_s) {
        return Err(AlignmentError::NoOverlap { within_s, near_s });
    }
    let skew = problem.skew.then(|| estimate(problem.skew_index()));
    if let Some(skew) = skew.filter(|skew| skew.value.abs() > max_skew) {
        return Err(AlignmentError::SkewOutOfRange { ppm: 1e6 * skew.value, limit_ppm: 1e6 * max_skew });
    }
    if let Some(skew) = skew.filter(|skew| skew.value.abs() > MAX_SKEW) {
        warnings.push(AlignmentWarning::NoClock { skew: skew.value });
    }
    let noise_order = problem.color.len();
    problem.color.clear();
    let mut residuals = vec![0.0; problem.count()];
    problem.evaluate(&solution.parameters, &mut residuals);
    let modeled: Vec<f64> = part.response.iter().zip(&residuals).map(|(y, r)| y + r).collect();
    let fit_percent = fit_percent(&part.response, &modeled).unwrap_or(f64::NEG_INFINITY);
    if is_response && fit_percent < SAME_RUN_PERCENT {
        return Err(AlignmentError::OtherRun { log: log(), fit_percent });
    }
    Ok(Alignment {
        delay_s,
        skew,
        reference_s: part.reference_s,
        time_constant_s,
        fit_percent,
        rows: part.time_s.len(),
        gaps: part.runs.len() - 1,
        noise_order,
        warnings,
    })
}
