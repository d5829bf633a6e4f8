//! What a simulation of a record needs of it.

use rotorlead_plant::{CommandSignal, Interpolation, Memory, Start};

use super::dataset::{Before, PreparedRecord};

/// Shortest time constant that rows show which do not repeat, in parts of the time between them. Derived: a row after a step `e^(-1/0.3)`,
/// 4 %, of it is left, about what a level is off by. Lower costs time.
const LEAST_PART_OF_ROW: f64 = 0.3;
/// Records that do not repeat are simulated in steps that are so many times as long as usual: models of them are off by a part in a
/// thousand at best. Derived: a step of a quarter of the time constant errs by `0.25^5 / 120`, 8e-6.
const LONGER_STEPS: f64 = 2.5;

impl PreparedRecord {
    /// The applied commands up to so many rows; from row to row where that is wanted, and will do.
    pub fn input_signal(&self, rows: usize, in_rows: bool) -> (CommandSignal<'_>, Interpolation) {
        if self.log.is_some() {
            return (CommandSignal { time_s: &self.command_s, command: &self.command }, Interpolation::ZeroOrderHold);
        }
        fn up_to<'a>(time_s: &'a [f64], command: &'a [f64], last: usize) -> CommandSignal<'a> {
            let count = (last + 1).min(time_s.len());
            CommandSignal { time_s: &time_s[..count], command: &command[..count] }
        }
        let last = rows.saturating_sub(1);
        if in_rows && !self.first_order_hold.is_empty() {
            return (up_to(&self.time_s, &self.first_order_hold, last), Interpolation::FirstOrderHold);
        }
        (up_to(&self.command_s, &self.command, last * self.commands_per_row), Interpolation::ZeroOrderHold)
    }

    /// What was before the record, for an actuator with this memory.
    pub fn initial_condition(&self, memory: Memory) -> Start {
        match self.before {
            _ if self.log.is_some() => Start::Rest(self.command[0]),
            Before::Rest => Start::Rest(self.nominal),
            Before::Periods => {
                let period_s = self.period_rows as f64 / self.rate_hz;
                let lead_s = match memory {
                    Memory::Seconds(memory_s) => memory_s.min(period_s),
                    Memory::TurningPoints(_) | Memory::Lasting => period_s,
                };
                Start::PartOfPeriod { period_s, lead_s }
            }
        }
    }

    /// How many times as long as usual the steps of an integration may be.
    pub fn step_factor(&self) -> f64 {
        if self.log.is_some() { LONGER_STEPS } else { 1.0 }
    }

    /// The shortest time constant that its rows show, seconds.
    pub fn least_time_constant_s(&self) -> f64 {
        if self.log.is_some() { LEAST_PART_OF_ROW / self.rate_hz } else { 0.0 }
    }

    /// Whether the static map is free, a number for each level.
    pub fn has_free_map(&self) -> bool {
        self.log.as_ref().is_some_and(|log| log.has_free_map)
    }

    /// Whether it goes from one settled level to the next.
    pub fn starts_settled(&self) -> bool {
        self.log.as_ref().is_some_and(|log| log.begins_settled)
    }
}
