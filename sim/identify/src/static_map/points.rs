//! Steady responses: what a record says of the static map.

use std::ops::Range;

use rotorlead_numerics::sample::{extent, mean, variance};
use rotorlead_plant::StaticMap;
use rotorlead_records::{Excitation, Output, Record};

use crate::lag::steps::{Direction, Plateau, PlateauState, Run, SAME_LEVEL, StepsError, find_plateaus};
use crate::rows::resolution::{common_std, resolution};
use crate::rows::spikes::without_spikes;

/// A command and the response that it settles to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteadyPoint {
    /// The command, 0..1.
    pub command: f64,
    /// From which side it was reached.
    pub direction: Direction,
    /// Mean of the settled response.
    pub response: f64,
    /// Standard error of `response`, as its own rows tell it.
    pub std: f64,
    /// What of it the resolution of the readings makes, which is the same at each visit of a level.
    pub common_std: f64,
}

/// All that a record tells.
#[derive(Clone, Debug, PartialEq)]
pub struct SteadyPoints {
    /// Where the motor runs, in the order of the record.
    pub running: Vec<SteadyPoint>,
    /// The highest command below those at which it stands still.
    pub still: Option<f64>,
    /// What they are taken from.
    pub source: SteadySource,
}

/// What steady points are taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SteadySource {
    /// The settled rows of plateaus.
    Plateaus,
    /// Rows of a table that are averages each: how well they are known is not in the table.
    Averages,
    /// Bins of a ramp: commands then contain the lag, up and down with opposite signs.
    Ramp,
}

/// Bins of the command's range that a ramp is cut into. Chosen: many points for at most 8 parameters; wider bins blur a bend, narrower ones
/// have few rows.
const BINS: usize = 40;
/// Fewest rows of a bin that is used. Chosen: its variance, of 7 differences, is known to about a half, and with fewer rows not even that.
const ROWS_PER_BIN: usize = 8;
/// A ramp has at most as many changes of direction. Chosen: four times up and down; a multisine turns tens of times.
const REVERSALS: usize = 8;
/// And moves in at least this share of its rows. Chosen: steps move in a few rows of a hundred, a ramp in nearly all but for its rounding.
const MOVING: f64 = 0.5;
/// Below this share of the highest response the motor stands still. Chosen: above the offset of a load cell; a tenth of the highest speed
/// has as much of the thrust, so that a motor that idles slower may be taken for still.
const STILL_SHARE: f64 = 0.01;

/// Width of the bins of a ramp between two commands.
pub(super) fn bin_width(low: f64, high: f64) -> f64 {
    (high - low) / BINS as f64
}

impl SteadyPoints {
    /// Adds what another record of the same motor tells.
    pub fn join(&mut self, other: Self) {
        self.running.extend(other.running);
        self.still = match (self.still, other.still) {
            (Some(a), Some(b)) => Some(a.max(b)),
            (a, b) => a.or(b),
        };
        self.source = self.source.max(other.source);
    }

    /// The mean response of each level.
    #[must_use]
    pub fn levels(&self) -> StaticMap {
        let mut sums: Vec<(f64, f64, f64)> = Vec::new();
        let mut sorted = self.running.clone();
        sorted.sort_by(|a, b| a.command.total_cmp(&b.command));
        for point in sorted {
            match sums.last_mut().filter(|last| point.command - last.0 < SAME_LEVEL) {
                Some((_, sum, count)) => {
                    *sum += point.response;
                    *count += 1.0;
                }
                None => sums.push((point.command, point.response, 1.0)),
            }
        }
        StaticMap {
            command: sums.iter().map(|level| level.0).collect(),
            response: sums.iter().map(|level| level.1 / level.2).collect(),
            polynomial: None,
        }
    }

    /// The plateaus of a record, its rows where they are averages, or the bins of a ramp. `lag_s` is the delay and the time constant together, where known:
    /// a ramp's commands are taken from so much earlier.
    ///
    /// # Errors
    /// [`StepsError`] when the record has neither two plateaus in a row on which the motor runs nor a ramp.
    pub fn from_record(record: &Record, output: Output, lag_s: Option<f64>) -> Result<Self, StepsError> {
        if record.excitation == Excitation::Steady {
            return Self::from_averages(record, output);
        }
        match Run::all(record, output) {
            Ok(runs) => {
                let settles = |p: &&Plateau| p.state == PlateauState::Running;
                let plateaus = || runs.iter().flat_map(|run| &run.plateaus).filter(settles);
                let running = plateaus().map(point).collect();
                let all = find_plateaus(record, output, &runs[0].clean);
                let highest = plateaus().map(|p| p.mean).fold(0.0, f64::max);
                let lowest = plateaus().map(|p| p.command).fold(1.0, f64::min);
                // Chosen: four standard errors, 3e-5 of a normal distribution, above which a level runs.
                let stands = |p: &&Plateau| {
                    p.is_long(&record.time_s)
                        && p.command < lowest
                        && p.mean.abs() < STILL_SHARE * highest + 4.0 * p.mean_std
                };
                let still = all.iter().filter(stands).map(|p| p.command).reduce(f64::max);
                Ok(Self { running, still, source: SteadySource::Plateaus })
            }
            Err(error) => ramp(record, output, lag_s.unwrap_or(0.0)).ok_or(error),
        }
    }
}

impl SteadyPoints {
    /// The rows of a table of averages.
    fn from_averages(record: &Record, output: Output) -> Result<Self, StepsError> {
        let no_response = || StepsError::NoResponse { record: record.file.clone(), column: output.column() };
        let response = record.response(output).ok_or_else(no_response)?;
        let (_, highest) = extent(response);
        let stands = |response: f64| response.abs() < STILL_SHARE * highest;
        let rows = || record.command.iter().zip(response);
        let still = rows().filter(|(_, response)| stands(**response)).map(|(command, _)| *command);
        let mut before = f64::NEG_INFINITY;
        let point = |(&command, &response): (&f64, &f64)| {
            let direction = if command < before { Direction::Down } else { Direction::Up };
            before = command;
            // All alike: the table does not say better. Chosen: a percent of the highest; the fit scales it by what it leaves.
            SteadyPoint { command, direction, response, std: STILL_SHARE * highest, common_std: 0.0 }
        };
        let running: Vec<SteadyPoint> = rows().map(point).filter(|point| !stands(point.response)).collect();
        let lowest = running.iter().map(|point| point.command).fold(f64::INFINITY, f64::min);
        let still = still.filter(|command| *command < lowest).reduce(f64::max);
        Ok(Self { running, still, source: SteadySource::Averages })
    }
}

fn point(plateau: &Plateau) -> SteadyPoint {
    SteadyPoint {
        command: plateau.command,
        // The plateau that begins a record came from nowhere; it is like those reached from below.
        direction: plateau.direction.unwrap_or(Direction::Up),
        response: plateau.mean,
        std: plateau.mean_std,
        common_std: plateau.common_std,
    }
}

/// The bins of a ramp; `None` for a record that is none.
fn ramp(record: &Record, output: Output, lag_s: f64) -> Option<SteadyPoints> {
    let raw = record.response(output).filter(|y| y.len() == record.time_s.len())?;
    if record.command.len() != raw.len() || raw.len() < ROWS_PER_BIN || !raw.iter().all(|y| y.is_finite()) {
        return None;
    }
    let command = &record.command;
    let moves: Vec<f64> = command.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let moving = moves.iter().filter(|step| **step != 0.0).count();
    let signs: Vec<bool> = moves.iter().filter(|step| **step != 0.0).map(|step| *step > 0.0).collect();
    let reversals = signs.windows(2).filter(|pair| pair[0] != pair[1]).count();
    if (moving as f64) < MOVING * moves.len() as f64 || reversals > REVERSALS {
        return None;
    }
    let (clean, _) = without_spikes(raw);
    let low = command.iter().copied().fold(f64::INFINITY, f64::min);
    let high = command.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let width = bin_width(low, high);
    let bin_of = |u: f64| (((u - low) / width) as usize).min(BINS - 1);
    let direction_of = |row: usize| {
        let near = moves[..row.min(moves.len())].iter().rev().find(|step| **step != 0.0).or(moves.first());
        if near.is_some_and(|step| *step < 0.0) { Direction::Down } else { Direction::Up }
    };
    // Row whose command acts at a time.
    let at = |t: f64| record.time_s.partition_point(|&s| s <= t - lag_s).checked_sub(1);
    let highest = clean.iter().copied().fold(0.0, f64::max);
    let resolution = resolution(&clean);
    let mut points = Vec::new();
    let mut still: Option<f64> = None;
    let mut close = |rows: Range<usize>, direction: Direction| {
        if rows.len() < ROWS_PER_BIN {
            return;
        }
        let commands: Vec<f64> =
            rows.clone().filter_map(|row| at(record.time_s[row])).map(|row| command[row]).collect();
        if commands.len() < rows.len() {
            return;
        }
        let command = mean(&commands);
        let response = mean(&clean[rows.clone()]);
        // About the straight line in the bin, whose slope is that of the map.
        let differences: Vec<f64> = clean[rows.clone()].windows(2).map(|pair| pair[1] - pair[0]).collect();
        let std = variance(&differences).sqrt() / 2f64.sqrt() / (rows.len() as f64).sqrt();
        if response < STILL_SHARE * highest {
            still = Some(still.map_or(command, |before: f64| before.max(command)));
        } else {
            let common_std = common_std(resolution, variance(&clean[rows]).sqrt());
            points.push(SteadyPoint { command, direction, response, std: std.hypot(common_std), common_std });
        }
    };
    let mut start = 0;
    for row in 1..=clean.len() {
        let ends = row == clean.len()
            || bin_of(command[row]) != bin_of(command[row - 1])
            || direction_of(row + 1) != direction_of(row);
        if ends {
            close(start..row, direction_of(row));
            start = row;
        }
    }
    // As many levels as a static map needs.
    (points.len() >= 4).then_some(SteadyPoints { running: points, still, source: SteadySource::Ramp })
}
