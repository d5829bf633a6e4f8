//! Steady points of a ramp: bins of its rows, each at the command that the response belongs to.
//!
//! A response that lags trails a ramp: it is that of an earlier command, by the lag. Up and down it is then off to opposite sides, as by a
//! hysteresis of twice the ramp's rate times the lag. Where the lag is not known, commands are taken from so much earlier that both ways
//! agree. Behind the start and each turn of the ramp the response only begins to trail it; these rows are left out.

use std::ops::Range;

use rotorlead_numerics::sample::{extent, mean, median, variance};
use rotorlead_records::{CommandShape, Output, Record};

use super::points::{STILL_SHARE, SteadyPoint, SteadyPoints, SteadySource};
use crate::lag::steps::Direction;
use crate::rows::resolution::{common_std, resolution};
use crate::rows::spikes::without_spikes;

/// Bins of the command's range that a ramp is cut into. Chosen: many points for at most 8 parameters; wider bins blur a bend, narrower ones
/// have few rows.
const BINS: usize = 40;
/// Fewest rows of a bin that is used. Chosen: its variance, of 7 differences, is known to about a half, and with fewer rows not even that.
const ROWS_PER_BIN: usize = 8;
/// Lags after which a response trails a ramp. Chosen: all but 0.7 %, `e^-5`, of what it still misses.
const SETTLED_LAGS: f64 = 5.0;
/// A lag at which the ways are compared beside none, seconds. Chosen: a motor's; how far they are apart is a straight line in the lag.
const USUAL_LAG_S: f64 = 0.05;
/// As many levels as a static map needs.
const FEWEST_POINTS: usize = 4;

/// Width of the bins of a ramp between two commands.
pub(super) fn bin_width((low, high): (f64, f64)) -> f64 {
    (high - low) / BINS as f64
}

/// The points of a ramp; `None` for a record that is none. `lag_s` is the delay and the time constant together, where known.
pub(super) fn points(record: &Record, output: Output, lag_s: Option<f64>) -> Option<SteadyPoints> {
    let raw = record.response(output).filter(|y| y.len() == record.time_s.len())?;
    let is_read = record.command.len() == raw.len() && raw.iter().all(|y| y.is_finite());
    if !is_read || record.command_shape() != Some(CommandShape::Ramp) {
        return None;
    }
    let ramp = Ramp::new(record, without_spikes(raw).0);
    let (lag_s, source) = match lag_s {
        Some(lag_s) => (lag_s, SteadySource::Ramp),
        None => (ramp.lag_by_both_ways().unwrap_or(0.0), SteadySource::RampOfUnknownLag),
    };
    let (running, still) = ramp.bins(lag_s);
    (running.len() >= FEWEST_POINTS).then_some(SteadyPoints { running, still, source })
}

struct Ramp<'a> {
    record: &'a Record,
    response: Vec<f64>,
    /// The step of its readings, response units.
    resolution: f64,
    /// Which way the command goes, or went last, at each row.
    direction: Vec<Direction>,
}

impl<'a> Ramp<'a> {
    fn new(record: &'a Record, response: Vec<f64>) -> Self {
        let command = &record.command;
        let moves = command.windows(2).map(|pair| pair[1] - pair[0]);
        let mut way = Direction::Up;
        let mut direction: Vec<Direction> = Vec::with_capacity(command.len());
        for moved in moves {
            if moved != 0.0 {
                way = if moved < 0.0 { Direction::Down } else { Direction::Up };
            }
            direction.push(way);
        }
        direction.push(way);
        Self { record, resolution: resolution(&response), response, direction }
    }

    /// The points at which the motor runs, and the highest command at which it stands still, where the response is that of the command
    /// `lag_s` earlier.
    fn bins(&self, lag_s: f64) -> (Vec<SteadyPoint>, Option<f64>) {
        let Record { time_s, command, .. } = self.record;
        let (low, high) = extent(command);
        let width = bin_width((low, high));
        let bin = |row: usize| (((command[row] - low) / width) as usize).min(BINS - 1);
        let (_, highest) = extent(&self.response);
        let (mut points, mut still) = (Vec::new(), None::<f64>);
        let mut close = |rows: Range<usize>, direction: Direction| {
            if rows.len() < ROWS_PER_BIN {
                return;
            }
            let acts = |row: usize| command[time_s.partition_point(|&s| s <= time_s[row] - lag_s).saturating_sub(1)];
            let command = mean(&rows.clone().map(acts).collect::<Vec<f64>>());
            let seen = &self.response[rows.clone()];
            let response = mean(seen);
            // About the straight line in the bin, whose slope is that of the map.
            let differences: Vec<f64> = seen.windows(2).map(|pair| pair[1] - pair[0]).collect();
            let std = (variance(&differences) / 2.0 / rows.len() as f64).sqrt();
            if response < STILL_SHARE * highest {
                still = Some(still.map_or(command, |before: f64| before.max(command)));
            } else {
                let common_std = common_std(self.resolution, variance(seen).sqrt());
                points.push(SteadyPoint { command, direction, response, std: std.hypot(common_std), common_std });
            }
        };
        let (mut start, mut turned_s) = (0, time_s[0]);
        for row in 0..time_s.len() {
            let ends = row + 1 == time_s.len();
            let turns = !ends && self.direction[row + 1] != self.direction[row];
            if time_s[row] - turned_s < SETTLED_LAGS * lag_s {
                start = row + 1;
            } else if ends || turns || bin(row + 1) != bin(row) {
                close(start..row + 1, self.direction[row]);
                start = row + 1;
            }
            if turns {
                turned_s = time_s[row];
            }
        }
        (points, still)
    }

    /// The lag at which levels from below and from above are the same, seconds; `None` where the ramp goes one way.
    fn lag_by_both_ways(&self) -> Option<f64> {
        let [at_none, at_usual] = [0.0, USUAL_LAG_S].map(|lag_s| apart(&self.bins(lag_s).0));
        let (at_none, at_usual) = (at_none?, at_usual?);
        let lag_s = USUAL_LAG_S * at_none / (at_none - at_usual);
        // A response ahead of its ramp has no lag.
        Some(lag_s).filter(|lag_s| lag_s.is_finite()).map(|lag_s| lag_s.max(0.0))
    }
}

/// By how much of command levels from below are above those from above that have the same response: the median.
fn apart(points: &[SteadyPoint]) -> Option<f64> {
    let of = |way| points.iter().filter(move |point| point.direction == way);
    let mut up: Vec<&SteadyPoint> = of(Direction::Up).collect();
    up.sort_by(|a, b| a.response.total_cmp(&b.response));
    median(of(Direction::Down).filter_map(|down| {
        let above = up.partition_point(|up| up.response <= down.response);
        let (low, high) = (up.get(above.checked_sub(1)?)?, up.get(above)?);
        let share = (down.response - low.response) / (high.response - low.response);
        Some(low.command + share * (high.command - low.command) - down.command)
    }))
}
