//! The rows of a table that are taken: their numbers become those of a record.
//!
//! Stamps are kept as they are, from the first row taken; a row with the stamp of the row before it is left out.

use rotorlead_numerics::sample::median;

use super::columns::{Pick, other_motors};
use super::layout::PlainTable;
use crate::experiment::{Excitation, Output};
use crate::import::quantity::{DSHOT, Quantity, Scale};
use crate::import::rcbenchmark::MAX_OVERTAKING_S;
use crate::import::stamps::spread_bursts;
use crate::import::table::Table;
use crate::import::{DroppedRows, ImportError, ImportOptions, MIN_STEADY_POINTS, flight};

/// Seconds of a day.
const DAY_S: f64 = 86_400.0;
/// Rows further apart than this are slower than the lag of any motor of a multicopter, seconds.
const SLOWER_THAN_A_LAG_S: f64 = 0.5;
/// A logger's rows are more than a table of steady points has.
const MOST_STEADY_POINTS: usize = 1000;
/// Share of rows whose command is another than in the row before, from which on each row is a point of its own.
const NEARLY_ALL: f64 = 0.9;

/// The numbers of the rows that are still to be taken, NaN where there are none.
pub(super) struct Rows<'a> {
    pub(super) table: &'a Table<'a>,
    /// Which row of the table each of them is.
    pub(super) places: Vec<usize>,
    pub(super) time: Vec<f64>,
    pub(super) command: Vec<f64>,
    /// The rows with a command, where the response is in others.
    pub(super) own_command: Vec<OwnCommand>,
    pub(super) thrust: Option<Vec<f64>>,
    pub(super) speed: Option<Vec<f64>>,
    pub(super) voltage: Option<Vec<f64>>,
    pub(super) current: Option<Vec<f64>>,
    pub(super) dropped: Vec<DroppedRows>,
    pub(super) reordered: usize,
}

/// A command on a row of its own.
pub(super) struct OwnCommand {
    /// Which row of the table.
    pub(super) place: usize,
    pub(super) time: f64,
    pub(super) command: f64,
}

impl Rows<'_> {
    fn columns(&mut self) -> impl Iterator<Item = &mut Vec<f64>> {
        let optional = [&mut self.thrust, &mut self.speed, &mut self.voltage, &mut self.current];
        [&mut self.time, &mut self.command]
            .into_iter()
            .filter(|column| !column.is_empty())
            .chain(optional.into_iter().flatten())
    }

    fn commands(&mut self) -> impl Iterator<Item = &mut f64> {
        self.command.iter_mut().chain(self.own_command.iter_mut().map(|own| &mut own.command))
    }

    fn left_out(&mut self, rows: usize, reason: impl Into<String>) {
        if rows > 0 {
            self.dropped.push(DroppedRows { rows, reason: reason.into() });
        }
    }

    /// Where each row is a message of one series, so that most readings of the response have no command beside them, the other series
    /// hold until their next row, and the rows of the response stay. Says so.
    pub(super) fn hold_interleaved(&mut self, stated: Option<Output>) -> Option<String> {
        let filled = |values: &Option<Vec<f64>>| values.iter().flatten().filter(|value| !value.is_nan()).count();
        let response = match stated {
            Some(Output::ThrustN) => &self.thrust,
            Some(Output::Rpm) => &self.speed,
            None if filled(&self.thrust) < filled(&self.speed) => &self.speed,
            None => &self.thrust,
        };
        let is_reading: Vec<bool> = response.as_ref()?.iter().map(|value| !value.is_nan()).collect();
        let readings = is_reading.iter().filter(|is| **is).count();
        let alone = is_reading.iter().zip(&self.command).filter(|(is, command)| **is && command.is_nan()).count();
        if 2 * alone <= readings {
            return None;
        }
        self.keep_own_command();
        let others = [&mut self.voltage, &mut self.current].into_iter().flatten();
        for series in std::iter::once(&mut self.command).chain(others) {
            let mut last = f64::NAN;
            for value in series {
                last = if value.is_nan() { last } else { *value };
                *value = last;
            }
        }
        self.retain(&is_reading, "a row of another series");
        Some(String::from("each row has one series: those beside the response hold until their next row"))
    }

    /// Remembers each command with its stamp, before rows without a response are left out.
    fn keep_own_command(&mut self) {
        let rows = self.places.iter().zip(&self.time).zip(&self.command);
        let own = rows.map(|((&place, &time), &command)| OwnCommand { place, time, command });
        self.own_command = own.filter(|own| !own.command.is_nan()).collect();
    }

    /// Leaves out the rows whose time or command is none, which a program that writes numbers put there on purpose.
    pub(super) fn leave_out_no_numbers(&mut self) {
        let is_number = |values: &[f64], row: usize| values.get(row).is_none_or(|value| !value.is_nan());
        let keep = (0..self.places.len()).map(|row| is_number(&self.time, row) && is_number(&self.command, row));
        let keep: Vec<bool> = keep.collect();
        self.retain(&keep, "NaN in the time or the command");
    }

    /// Keeps the rows from the first to the last that has a command; one without between them is an error.
    pub(super) fn cut_to_the_command(&mut self, command: Pick) -> Result<(), ImportError> {
        let has = |value: &f64| !value.is_nan();
        let Some(first) = self.command.iter().position(has) else {
            return Err(ImportError::missing(
                &self.table.file,
                format!(
                    ", column `{}`: empty in all {} rows, so the log does not have the command",
                    self.table.header[command.column],
                    self.command.len()
                ),
                "record with the output switched on; where the command was logged apart, `rotorlead import --no-command` takes the log \
                 without it, and `rotorlead identify --align LOG` merges the two",
            ));
        };
        let end = self.command.iter().rposition(has).map_or(first, |last| last + 1);
        if let Some(blank) = self.command[first..end].iter().position(|value| value.is_nan()) {
            return Err(self.table.blank(self.places[first + blank], command.column));
        }
        let after = self.command.len() - end;
        self.left_out(first, "no command yet");
        self.left_out(after, "no command any more");
        for column in self.columns() {
            column.truncate(end);
            column.drain(..first);
        }
        self.places.truncate(end);
        self.places.drain(..first);
        Ok(())
    }

    /// Puts the command on 0..1 and says how.
    pub(super) fn normalize_command(
        &mut self,
        pick: Pick,
        options: &ImportOptions,
        notes: &mut Vec<String>,
    ) -> Result<String, ImportError> {
        let (mut low, high) = command_range(pick, options).unwrap_or((0.0, 1.0));
        if pick.unit.scale == Scale::Dshot {
            low = 0.0;
        }
        let rows = self.places.iter().copied().zip(self.command.iter().copied());
        let own = self.own_command.iter().map(|own| (own.place, own.command));
        if let Some((place, value)) = rows.chain(own).find(|(_, value)| !(low..=high).contains(value)) {
            let (line, column) = (self.table.line(place), &self.table.header[pick.column]);
            return Err(ImportError::out_of_range(&self.table.file, line, column, value, (low, high)));
        }
        let name = &self.table.header[pick.column];
        notes.extend(pick.guess(name));
        let guessed = if pick.guessed_because.is_some() { "; guessed" } else { "" };
        if pick.unit.scale != Scale::Dshot {
            self.commands().for_each(|value| *value = (*value - low) / (high - low));
            let stated = if pick.unit.scale == Scale::Pulse {
                " µs become 0..1, stated and not measured"
            } else {
                " become 0..1"
            };
            return Ok(format!("{low}..{high}{stated}{guessed}"));
        }
        let (low, high) = DSHOT;
        let orders = self.command.iter().filter(|value| **value > 0.0 && **value < low).count();
        if orders > 0 {
            notes.push(format!(
                "{orders} rows have a DShot number from 1 to 47: an order to the ESC, which is given while the motor stands; taken \
                 as stop"
            ));
        }
        self.commands().for_each(|value| *value = ((*value - low) / (high - low)).max(0.0));
        Ok(format!("DShot: {low}..{high} become 0..1, 0 is stop{guessed}"))
    }

    /// Refuses a log in which other motors have commands of their own.
    pub(super) fn refuse_flight(
        &self,
        plain: &PlainTable<'_>,
        motor: usize,
        command: Pick,
        options: &ImportOptions,
    ) -> Result<(), ImportError> {
        let Some((low, high)) = command_range(command, options) else { return Ok(()) };
        for (other, column) in other_motors(plain, Quantity::Command, motor) {
            let numbers = self.table.numbers(&[(column, command.reading())])?;
            let scaled = |&place: &usize| ((numbers[0][place] - low) / (high - low)).max(0.0);
            let others = [(other, self.places.iter().map(scaled).collect())];
            flight::refuse(&self.table.file, options, motor, &self.time, &self.command, "motor", &others)?;
        }
        Ok(())
    }

    /// Makes seconds from the first row of the stamps, in their order, and finds out whether each row is a steady point, whose
    /// stamps may be anything.
    pub(super) fn find_times(
        &mut self,
        pick: Option<Pick>,
        is_stand: bool,
        options: &ImportOptions,
        notes: &mut Vec<String>,
    ) -> Result<bool, ImportError> {
        let is_stated = options.excitation == Some(Excitation::Steady);
        let Some(pick) = pick else {
            self.own_command.clear();
            if let Some(rate_hz) = options.rate_hz {
                self.time = self.places.iter().map(|&place| place as f64 / rate_hz).collect();
                notes.push(format!("the table has no time: its rows are {rate_hz} a second, as stated"));
                return Ok(is_stated);
            }
            self.time = numbered(self.command.len());
            notes.push(String::from("the table has no time: its points are numbered, one a second"));
            return Ok(true);
        };
        if let Some(at) = self.time.iter().position(|stamp| stamp.is_nan()) {
            return Err(self.table.blank(self.places[at], pick.column));
        }
        notes.extend(pick.guess(&self.table.header[pick.column]));
        if pick.unit.scale == Scale::Clock {
            go_on_behind_midnight(self.time.iter_mut());
            go_on_behind_midnight(self.own_command.iter_mut().map(|own| &mut own.time));
        }
        let start = self.time.first().copied().unwrap_or(0.0);
        let stamps = self.time.iter_mut().chain(self.own_command.iter_mut().map(|own| &mut own.time));
        stamps.for_each(|stamp| *stamp = pick.converted(*stamp - start));
        let is_shown = options.excitation.is_none() && self.are_points();
        if !is_stated && !is_shown {
            if let Some(even) = spread_bursts(&self.time) {
                self.time = even;
                // Stamps of commands tell nothing then.
                self.own_command.clear();
                notes.push(String::from(
                    "time stamps come in bursts, as of a host that reads several rows at a time: the rows were spread evenly",
                ));
                return Ok(false);
            }
            self.sort(pick, if is_stand { MAX_OVERTAKING_S } else { 0.0 })?;
            return Ok(false);
        }
        self.own_command.clear();
        let found = if is_shown { "the rows are slower than any lag, and each has another command: " } else { "" };
        let increases = self.time.is_sorted_by(|a, b| a < b);
        let numbering =
            if increases { "" } else { ". Their times do not increase, so they are numbered, one a second" };
        let other = if is_shown { ". `--excitation` says where they are anything else" } else { "" };
        notes.push(format!(
            "{found}{} steady points, which give a static map and no lag{numbering}{other}",
            self.command.len()
        ));
        if !increases {
            self.time = numbered(self.command.len());
        }
        Ok(true)
    }

    /// Whether rows are further apart than a lag lasts, and each of another command than the one before.
    fn are_points(&self) -> bool {
        let rows = self.command.len();
        if !(MIN_STEADY_POINTS..=MOST_STEADY_POINTS).contains(&rows) {
            return false;
        }
        let changes = self.command.windows(2).filter(|pair| pair[0] != pair[1]).count();
        let interval = median(self.time.windows(2).map(|pair| (pair[1] - pair[0]).abs())).unwrap_or(0.0);
        changes as f64 > NEARLY_ALL * (rows - 1) as f64 && interval > SLOWER_THAN_A_LAG_S
    }

    /// Sorts rows that overtake each other by no more than `most_s`; more is an error.
    fn sort(&mut self, pick: Pick, most_s: f64) -> Result<(), ImportError> {
        let mut latest = f64::NEG_INFINITY;
        for (at, &time) in self.time.iter().enumerate() {
            if latest - time > most_s {
                let (line, column) = (self.table.line(self.places[at]), &self.table.header[pick.column]);
                // To the nanosecond: digits beyond are those of the subtraction.
                let by_s = ((latest - time) * 1e9).round() / 1e9;
                return Err(ImportError::time_runs_back(&self.table.file, line, column, by_s));
            }
            self.reordered += usize::from(time < latest);
            latest = latest.max(time);
        }
        if self.reordered > 0 {
            let mut order: Vec<usize> = (0..self.time.len()).collect();
            // Stable: equal stamps keep the log's order.
            order.sort_by(|a, b| self.time[*a].total_cmp(&self.time[*b]));
            for column in self.columns() {
                *column = order.iter().map(|row| column[*row]).collect();
            }
            self.places = order.iter().map(|row| self.places[*row]).collect();
            let start = self.time[0];
            self.time.iter_mut().for_each(|time| *time -= start);
            self.own_command.iter_mut().for_each(|own| own.time -= start);
        }
        self.own_command.sort_by(|a, b| a.time.total_cmp(&b.time));
        Ok(())
    }

    /// Leaves out the rows that are blank in one of the columns that are needed.
    pub(super) fn leave_out_blanks(&mut self, needed: &[Pick]) {
        for pick in needed {
            let values = match pick.unit.quantity {
                Quantity::Thrust => &self.thrust,
                Quantity::Speed => &self.speed,
                Quantity::Voltage => &self.voltage,
                _ => &self.current,
            };
            let keep: Vec<bool> = values.iter().flatten().map(|value| !value.is_nan()).collect();
            let name = &self.table.header[pick.column];
            if self.own_command.is_empty() && keep.contains(&false) {
                self.keep_own_command();
            }
            self.retain(&keep, format!("`{name}` is blank"));
        }
    }

    pub(super) fn leave_out_repeated(&mut self) {
        let differs = |row: usize| row == 0 || self.time[row] > self.time[row - 1];
        let keep: Vec<bool> = (0..self.time.len()).map(differs).collect();
        self.retain(&keep, "same time stamp as the row before");
        // The first row may be one of those that were left out.
        let start = self.time.first().copied().unwrap_or(0.0);
        self.time.iter_mut().for_each(|time| *time -= start);
        self.own_command.iter_mut().for_each(|own| own.time -= start);
    }

    fn retain(&mut self, keep: &[bool], reason: impl Into<String>) {
        let rows = keep.iter().filter(|keep| !**keep).count();
        if rows == 0 {
            return;
        }
        self.left_out(rows, reason);
        for column in self.columns() {
            let mut kept = keep.iter();
            column.retain(|_| kept.next().copied().unwrap_or(true));
        }
        let mut kept = keep.iter();
        self.places.retain(|_| kept.next().copied().unwrap_or(true));
    }
}

/// What numbers of a command become 0 and 1; `None` where it is none.
fn command_range(pick: Pick, options: &ImportOptions) -> Option<(f64, f64)> {
    match pick.unit.scale {
        Scale::Pulse => Some(options.pulse_range()),
        Scale::Dshot => Some(DSHOT),
        Scale::Ratio(times, over) => Some((0.0, over / times)),
        Scale::Clock | Scale::Electrical(_) => None,
    }
}

/// Whether rows follow each other in the table.
pub(super) fn is_whole(places: &[usize]) -> bool {
    places.windows(2).all(|pair| pair[1] == pair[0] + 1)
}

/// Times of points that have none.
fn numbered(points: usize) -> Vec<f64> {
    (0..points).map(|point| point as f64).collect()
}

/// Adds a day where a clock runs back by more than half of one.
fn go_on_behind_midnight<'a>(stamps: impl Iterator<Item = &'a mut f64>) {
    let (mut days_s, mut before) = (0.0, f64::NEG_INFINITY);
    for stamp in stamps {
        if before - (*stamp + days_s) > DAY_S / 2.0 {
            days_s += DAY_S;
        }
        *stamp += days_s;
        before = *stamp;
    }
}
