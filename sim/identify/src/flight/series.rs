//! One motor of a flight as the fit takes it: an input at every moment, and samples of the speed.

use std::ops::Range;

use rotorlead_numerics::sample::{mean, median};
use rotorlead_records::{Experiment, Record};

use crate::error::IdentifyError;
use crate::rows::columns::response_column;
use crate::rows::gaps::{rows_after_intervals, usual_interval_s};

use super::error::FlightError;
use super::{telemetry, vehicle};

/// Samples per second at most. Chosen: five samples in the 20 ms of a fast motor, whose corner at 8 Hz is a sixteenth of half the rate; more rows
/// are averaged, which costs nothing of the band and takes their quantization down.
pub(super) const SAMPLE_RATE_HZ: f64 = 250.0;
/// An interval of more usual ones than this is a gap, behind which the motor's state is not known. Chosen: of a lost row or two at 500 rows a
/// second the command is known well enough by a straight line; for longer a controller has moved it.
pub(super) const GAP_INTERVALS: f64 = 5.0;
/// Rows further apart than this say too little of what the controller commanded between them. Chosen: a rate loop moves its command up to some
/// 100 Hz, and simulated flights were looked at down to 500 rows a second.
const LONGEST_INTERVAL_S: f64 = 0.0025;
/// Time that is left out behind a gap, an idle command or a saturated one, s. Chosen: three time constants of a usual motor of 40 ms, after
/// which 5 % is left of what was not known, and the noise model takes the rest.
const SETTLE_S: f64 = 0.12;
/// A command this near to the end of its range is saturated. Chosen: ten steps of DShot.
const NEAR_END: f64 = 0.005;
/// Share of the rows at the least command from which on that is an idle command. Chosen: a minimum that is passed through is seen once or
/// twice; airmode's idle is held.
const LEAST_IDLE_SHARE: f64 = 5e-4;
/// Memory of the slow part of the supply, s. Chosen: far above a motor's time constant, so that sag which the motor's own current makes
/// stays in its response, and below the time in which a battery empties.
const SUPPLY_S: f64 = 1.0;
/// Samples that runs must have together. Chosen: eight seconds at the full rate, 80 or so independent looks at a lag.
pub(super) const FEWEST_SAMPLES: usize = 2000;
/// The shortest run that is used, in samples: its first ones serve the noise model.
pub(super) const SHORTEST_RUN: usize = 60;

/// The least range by which the static map is scaled. Chosen: a few steps of a command.
const LEAST_SPREAD: f64 = 0.02;
/// Ranges of the command, relative to the center, from which on the static map is a parabola and a cubic. Chosen: over less, a bend is not
/// told from the noise.
pub(super) const BENDS: [f64; 2] = [0.1, 0.4];

/// Rows averaged to one sample.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    pub(super) rows: Range<usize>,
    pub(super) rpm: f64,
}

/// What the fit takes of one motor.
#[derive(Clone, Debug)]
pub(super) struct Series {
    pub(super) time_s: Vec<f64>,
    /// The usual interval of rows, s.
    pub(super) step_s: f64,
    /// Rows at which the state is not known.
    pub(super) starts: Vec<usize>,
    /// Command times the slow part of the supply over its mean, at each row.
    pub(super) input: Vec<f64>,
    /// What the rest of the vehicle does, of each sample: its own terms of the speed.
    pub(super) vehicle: Vec<Vec<f64>>,
    /// Whether the command goes on between rows (a loop faster than the log), and does not hold.
    pub(super) is_sampled: bool,
    pub(super) samples: Vec<Sample>,
    /// Samples without a gap between them, by their places.
    pub(super) runs: Vec<Range<usize>>,
    /// Command level about which the model is written: the median in use.
    pub(super) center: f64,
    /// Levels between which 90 % of the samples lie.
    pub(super) range: (f64, f64),
    /// Rows of one report, one where each row has its own.
    pub(super) report_rows: usize,
}

impl Series {
    /// Takes a record.
    pub(super) fn from_record(experiment: &Experiment, record: &Record) -> Result<Self, IdentifyError> {
        let rpm = response_column(record, experiment.output)?;
        let time_s = record.time_s.clone();
        let refuse = |error: FlightError| Err(IdentifyError::from(error));
        let step_s = usual_interval_s(&time_s).unwrap_or(0.0);
        if step_s > LONGEST_INTERVAL_S {
            let (file, interval_ms) = (record.file.clone(), 1e3 * step_s);
            return refuse(FlightError::TooSlow { file, interval_ms, longest_ms: 1e3 * LONGEST_INTERVAL_S });
        }
        let starts: Vec<usize> = std::iter::once(0).chain(rows_after_intervals(&time_s, GAP_INTERVALS)).collect();
        let input = match slow_supply(record) {
            Some(slow) => record.command.iter().zip(&slow).map(|(command, part)| command * part).collect(),
            None => record.command.clone(),
        };
        let usable = usable(record, rpm, &starts);
        let report_rows = telemetry::report_rows(rpm);
        let samples = match report_rows {
            1 => averaged(rpm, step_s, &starts),
            held => telemetry::fresh(rpm, held, &starts),
        };
        let vehicle = vehicle::terms(experiment, record, &samples);
        let runs = runs(&samples, &usable, &starts);
        let count: usize = runs.iter().map(Range::len).sum();
        let sample_s = sample_interval_s(&samples, &time_s).unwrap_or(step_s);
        let needed = FEWEST_SAMPLES;
        if count < needed {
            let file = record.file.clone();
            return refuse(FlightError::TooShort {
                file,
                usable_s: count as f64 * sample_s,
                needed_s: needed as f64 * sample_s,
            });
        }
        let mut levels: Vec<f64> =
            runs.iter().flat_map(|run| &samples[run.clone()]).map(|sample| input[sample.rows.start]).collect();
        levels.sort_by(f64::total_cmp);
        let quantile = |part: f64| levels[(part * (levels.len() - 1) as f64) as usize];
        let is_sampled = experiment.command_rate_hz.is_some_and(|rate_hz| rate_hz * step_s > 1.5);
        Ok(Self {
            step_s,
            starts,
            is_sampled,
            center: quantile(0.5),
            range: (quantile(0.05), quantile(0.95)),
            time_s,
            input,
            vehicle,
            samples,
            runs,
            report_rows,
        })
    }

    /// A range of the command that counts as one in the static map.
    pub(super) fn spread(&self) -> f64 {
        (self.range.1 - self.range.0).max(LEAST_SPREAD)
    }

    /// Degree of the static map over the range of the command.
    pub(super) fn degree(&self) -> usize {
        let range = (self.range.1 - self.range.0) / self.center;
        1 + BENDS.iter().filter(|bend| range > **bend).count()
    }

    /// Speeds of the samples, rpm.
    pub(super) fn rpm(&self) -> Vec<f64> {
        self.samples.iter().map(|sample| sample.rpm).collect()
    }

    /// The mean of an `input` of rows, `delay_s` ago, from the row before each to it; nothing for the first.
    ///
    /// What a faster loop did between two rows of the log is taken as a straight line; a command that changes with the rows holds.
    pub(super) fn delayed_means(&self, input: &[f64], delay_s: f64, out: &mut Vec<f64>) {
        let times = &self.time_s;
        let rows = times.len();
        let mut integral = Vec::with_capacity(rows);
        integral.push(0.0);
        for row in 1..rows {
            let held = match self.is_sampled {
                true => 0.5 * (input[row - 1] + input[row]),
                false => input[row - 1],
            };
            integral.push(integral[row - 1] + held * (times[row] - times[row - 1]));
        }
        let mut place = 0;
        let mut at = |time: f64| {
            while place + 2 < rows && times[place + 1] <= time {
                place += 1;
            }
            let since = time - times[place];
            let mut value = input[place] * since;
            if self.is_sampled && since > 0.0 {
                value += 0.5 * (input[place + 1] - input[place]) * since * since / (times[place + 1] - times[place]);
            }
            integral[place] + value
        };
        out.clear();
        out.push(input[0]);
        let mut before = at(times[0] - delay_s);
        for row in 1..rows {
            let now = at(times[row] - delay_s);
            out.push((now - before) / (times[row] - times[row - 1]));
            before = now;
        }
    }
}

/// The slow part of the supply relative to its mean, at each row; `None` where it was not logged.
fn slow_supply(record: &Record) -> Option<Vec<f64>> {
    let voltage = record.voltage_v.as_deref().filter(|voltage| voltage.iter().all(|v| *v > 0.0))?;
    let mean_v = mean(voltage);
    let times = &record.time_s;
    let part = |row: usize| -(-(times[row] - times[row - 1]) / SUPPLY_S).exp_m1();
    // Forth and back, so that it does not lag.
    let mut slow: Vec<f64> = voltage.iter().map(|volts| volts / mean_v).collect();
    for row in 1..slow.len() {
        slow[row] = slow[row - 1] + (slow[row] - slow[row - 1]) * part(row);
    }
    for row in (1..slow.len()).rev() {
        slow[row - 1] = slow[row] + (slow[row - 1] - slow[row]) * part(row);
    }
    Some(slow)
}

/// Rows on which the motor runs and its ESC does what it is told, some time after any other.
fn usable(record: &Record, rpm: &[f64], starts: &[usize]) -> Vec<bool> {
    let command = &record.command;
    let least = command.iter().copied().fold(f64::INFINITY, f64::min);
    let at_least = command.iter().filter(|u| **u <= least + NEAR_END).count();
    let is_idle_held = at_least as f64 > LEAST_IDLE_SHARE * command.len() as f64;
    let idle = if is_idle_held { least + NEAR_END } else { 0.0 };
    let mut since_s = f64::NEG_INFINITY;
    let mut next = starts.iter().peekable();
    let mut usable = Vec::with_capacity(command.len());
    for row in 0..command.len() {
        let is_start = next.next_if(|start| **start == row).is_some();
        let runs = command[row] > idle && command[row] < 1.0 - NEAR_END && rpm[row] > 0.0;
        if is_start || !runs {
            since_s = record.time_s[row];
        }
        usable.push(runs && record.time_s[row] - since_s >= SETTLE_S);
    }
    usable
}

/// Means over as many rows as make [`SAMPLE_RATE_HZ`].
fn averaged(rpm: &[f64], step_s: f64, starts: &[usize]) -> Vec<Sample> {
    let width = ((1.0 / (SAMPLE_RATE_HZ * step_s)).round() as usize).max(1);
    let ends = starts.iter().skip(1).copied().chain([rpm.len()]);
    let mut samples = Vec::new();
    for (&start, end) in starts.iter().zip(ends) {
        for first in (start..end.saturating_sub(width - 1)).step_by(width) {
            let rows = first..first + width;
            samples.push(Sample { rpm: mean(&rpm[rows.clone()]), rows });
        }
    }
    samples
}

/// Samples that follow each other, and all of whose rows are usable.
fn runs(samples: &[Sample], usable: &[bool], starts: &[usize]) -> Vec<Range<usize>> {
    let is_good = |sample: &Sample| usable[sample.rows.clone()].iter().all(|usable| *usable);
    let mut runs: Vec<Range<usize>> = Vec::new();
    for (place, sample) in samples.iter().enumerate() {
        if !is_good(sample) {
            continue;
        }
        match runs.last_mut() {
            Some(run) if run.end == place && starts.binary_search(&sample.rows.start).is_err() => run.end = place + 1,
            _ => runs.push(place..place + 1),
        }
    }
    runs.retain(|run| run.len() >= SHORTEST_RUN);
    runs
}

fn sample_interval_s(samples: &[Sample], time_s: &[f64]) -> Option<f64> {
    median(samples.windows(2).map(|pair| time_s[pair[1].rows.start] - time_s[pair[0].rows.start]))
}
