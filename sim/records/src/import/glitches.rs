//! Speeds that no rotor has: readings of telemetry that were garbled on their way.
//!
//! A few rows of them are left out, as rows without a reading are, and counted; where there are more, the unit is another.

use super::{DroppedRows, ImportError, Taken};

/// A rotor of a multicopter does not turn faster, revolutions per minute. Chosen: nearly twice what 27 000 rpm/V, the
/// most of any small motor, makes of one cell.
pub(super) const MOST_RPM: f64 = 200_000.0;
/// Share of rows up to which such speeds are glitches. Chosen: of a speed in another unit a level at the least is too fast, and a staircase
/// has some ten; telemetry that garbles more readings than this is none to identify from.
pub(super) const MOST_GLITCHES: f64 = 0.05;

impl Taken {
    /// Leaves out the rows whose speed no rotor has. The command keeps the moments of its changes.
    pub(super) fn leave_out_glitches(&mut self) -> Result<(), ImportError> {
        let Some(rpm) = &self.rpm else { return Ok(()) };
        let keep: Vec<bool> = rpm.iter().map(|rpm| rpm.abs() <= MOST_RPM).collect();
        let glitches = keep.iter().filter(|keep| !**keep).count();
        if glitches == 0 {
            return Ok(());
        }
        let rows = keep.len();
        let name = self.name_of_speed();
        if glitches as f64 > MOST_GLITCHES * rows as f64 {
            let problem = format!("{glitches} of {rows} speeds are over {MOST_RPM} rpm, which no rotor reaches");
            let remedy = "its unit or the number of poles is another; glitches are left out where they are few";
            return Err(ImportError::value(&self.summary.file, format!("column `{name}`"), problem, remedy));
        }
        if self.own_command.is_empty() {
            self.own_command = self.time_s.iter().copied().zip(self.command.iter().copied()).collect();
        }
        for column in self.columns_of_rows() {
            let mut kept = keep.iter();
            column.retain(|_| kept.next().copied().unwrap_or(true));
        }
        let start_s = self.time_s.first().copied().unwrap_or(0.0);
        self.time_s.iter_mut().for_each(|time| *time -= start_s);
        self.own_command.iter_mut().for_each(|(time, _)| *time -= start_s);
        // The record has gaps now.
        self.sample_rate_hz = None;
        self.summary.rows_taken = self.time_s.len();
        let reason = format!("`{name}` is over {MOST_RPM} rpm, which no rotor reaches: a glitch");
        self.summary.dropped.push(DroppedRows { rows: glitches, reason });
        Ok(())
    }

    fn name_of_speed(&self) -> String {
        let is_speed = |column: &&super::ColumnUse| column.taken_as.as_deref() == Some("rpm");
        self.summary.columns.iter().find(is_speed).map_or_else(|| String::from("rpm"), |column| column.name.clone())
    }
}
