//! A sensor that is slower than the rows, so that each of its readings stands in several of them.

use rotorlead_records::{Excitation, Record};

use super::RecordFault;
use crate::rows::readings::Readings;

/// Whether readings are repeated.
pub(super) fn check_repeats(record: &Record, response: &[f64], column: &'static str) -> Option<RecordFault> {
    let readings = Readings::find(&record.time_s, response)?;
    let cost = match record.excitation {
        // Their fit takes the rows in which a reading is new.
        Excitation::Step | Excitation::Staircase => String::from("no lag is seen that is shorter than a few readings"),
        _ => format!(
            "repeated, a reading is {:.1} ms old on average, and twice that where each is the mean since the one before: it is identified \
             as dead time of the motor. No lag is seen that is shorter than a few readings",
            500.0 * readings.interval_s
        ),
    };
    Some(RecordFault::Repeats {
        file: record.file.clone(),
        column,
        rows_per_reading: readings.rows_per_reading,
        readings_hz: readings.interval_s.recip(),
        cost,
    })
}
