//! Steady responses: what a record says of the static map.

use rotorlead_numerics::sample::extent;
use rotorlead_plant::{Lagged, StaticMap};
use rotorlead_records::{CommandShape, Excitation, Output, Record};

use super::ramp::{self, bin_width};
use crate::lag::steps::{Direction, Plateau, PlateauState, Run, SAME_LEVEL, StepsError, find_plateaus};

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
    /// Bins of a ramp, whose lag is taken off.
    Ramp,
    /// Bins of a ramp whose lag is not known: commands are those at which both ways agree, where it goes both ways, and else contain the
    /// lag.
    RampOfUnknownLag,
}

/// Below this share of the highest response the motor stands still. Chosen: above the offset of a load cell; a tenth of the highest speed
/// has as much of the thrust, so that a motor that idles slower may be taken for still.
pub(super) const STILL_SHARE: f64 = 0.01;

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

    /// Commands closer than this are one level. A bin of a ramp is met again at another command within it.
    pub(super) fn same_level(&self) -> f64 {
        match self.source {
            SteadySource::Plateaus | SteadySource::Averages => SAME_LEVEL,
            SteadySource::Ramp | SteadySource::RampOfUnknownLag => {
                let commands: Vec<f64> = self.running.iter().map(|point| point.command).collect();
                0.5 * bin_width(extent(&commands))
            }
        }
    }

    /// The mean response of each level.
    #[must_use]
    pub fn levels(&self) -> StaticMap {
        let same = self.same_level();
        let mut sums: Vec<(f64, f64, f64)> = Vec::new();
        let mut sorted = self.running.clone();
        sorted.sort_by(|a, b| a.command.total_cmp(&b.command));
        for point in sorted {
            match sums.last_mut().filter(|last| point.command - last.0 / last.2 < same) {
                Some((command, sum, count)) => {
                    *command += point.command;
                    *sum += point.response;
                    *count += 1.0;
                }
                None => sums.push((point.command, point.response, 1.0)),
            }
        }
        StaticMap {
            command: sums.iter().map(|level| level.0 / level.2).collect(),
            response: sums.iter().map(|level| level.1 / level.2).collect(),
            lagged: Lagged::Response,
            polynomial: None,
        }
    }

    /// The plateaus of a record, its rows where they are averages, or the bins of a ramp. `lag_s` is the delay and the time constant together,
    /// where known: a ramp's commands are taken from so much earlier.
    ///
    /// # Errors
    /// [`StepsError`] when the record has neither two plateaus in a row on which the motor runs nor a ramp.
    pub fn from_record(record: &Record, output: Output, lag_s: Option<f64>) -> Result<Self, StepsError> {
        // The response trails a ramp, and no row of it is a steady point.
        if record.excitation == Excitation::Steady && record.command_shape() != Some(CommandShape::Ramp) {
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
            Err(error) => ramp::points(record, output, lag_s).ok_or(error),
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
