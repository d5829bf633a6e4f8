//! Logs that are faster than a motor.
//!
//! Command and speed are averaged over the same rows, by one filter: what follows the command before follows it behind, and nothing of a lag
//! is lost but time.

use std::ops::Range;

use rotorlead_numerics::sample::mean;
use rotorlead_records::{Experiment, Record, Setpoints};

use super::series::GAP_INTERVALS;
use super::{is_flight_to_fit, telemetry};
use crate::rows::gaps::{rows_after_intervals, usual_interval_s};

/// Rows per second that are left. Chosen: twice the samples of the fit, below which simulated flights were not looked at.
const ROW_RATE_HZ: f64 = 500.0;

/// The flights of an experiment at [`ROW_RATE_HZ`] or above; `None` where they are no faster than that, or repeat reports, whose rows have to
/// stay apart.
pub(super) fn thinned(experiment: &Experiment) -> Option<Experiment> {
    let flights = || experiment.records.iter().filter(|record| is_flight_to_fit(record));
    let factor = |record: &Record| {
        let step_s = usual_interval_s(&record.time_s)?;
        let repeats = record.response(experiment.output).is_some_and(|response| telemetry::report_rows(response) > 1);
        let factor = (1.0 / (step_s * ROW_RATE_HZ) + 0.01) as usize;
        (!repeats && factor > 1).then_some(factor)
    };
    // One for all, whose rows are to be the same.
    let count = flights().map(factor).collect::<Option<Vec<_>>>()?.into_iter().min()?;
    let records = flights().map(|record| averaged(record, count)).collect();
    Some(Experiment { records, ..experiment.clone() })
}

/// Means over so many rows each, none of them over a gap.
fn averaged(record: &Record, count: usize) -> Record {
    let gaps = rows_after_intervals(&record.time_s, GAP_INTERVALS);
    let ends = gaps.iter().copied().chain([record.time_s.len()]);
    let whole = |(start, end): (usize, usize)| {
        (start..(end + 1).saturating_sub(count)).step_by(count).map(move |row| row..row + count)
    };
    let groups: Vec<Range<usize>> = std::iter::once(0).chain(gaps.iter().copied()).zip(ends).flat_map(whole).collect();
    let means = |column: &[f64]| groups.iter().map(|rows| mean(&column[rows.clone()])).collect::<Vec<f64>>();
    let some = |column: &Option<Vec<f64>>| column.as_deref().map(means);
    let asked = &record.setpoints;
    Record {
        file: record.file.clone(),
        compensator: record.compensator.clone(),
        time_s: means(&record.time_s),
        command: means(&record.command),
        command_log: None,
        thrust_n: some(&record.thrust_n),
        rpm: some(&record.rpm),
        esc_command: None,
        voltage_v: some(&record.voltage_v),
        current_a: None,
        setpoints: Setpoints {
            roll_rad_s: some(&asked.roll_rad_s),
            pitch_rad_s: some(&asked.pitch_rad_s),
            yaw_rad_s: some(&asked.yaw_rad_s),
            throttle: some(&asked.throttle),
        },
        ..*record
    }
}

#[cfg(test)]
mod tests {
    use rotorlead_records::Excitation;

    use super::*;
    use crate::testing::record;

    #[test]
    fn groups_end_at_a_gap_and_keep_command_and_speed_together() {
        let mut flight = record(1000.0, None, vec![0.5; 21], vec![1.0; 21]);
        flight.excitation = Excitation::Flight;
        flight.time_s.iter_mut().skip(11).for_each(|time| *time += 1.0);
        flight.command = (0..21).map(f64::from).map(|row| 0.01 * row).collect();
        let thinned = averaged(&flight, 2);
        // Five pairs, a row that is left over, and five pairs.
        assert_eq!(thinned.time_s.len(), 10);
        assert!((thinned.time_s[4] - 0.0085).abs() < 1e-12 && (thinned.time_s[5] - 1.0115).abs() < 1e-12);
        assert!((thinned.command[5] - 0.115).abs() < 1e-12);
    }
}
