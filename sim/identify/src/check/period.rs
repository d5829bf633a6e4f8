//! The period of a square wave or a triangle, as its rows have it. A multisine's is looked at where it is identified.

use rotorlead_numerics::sample::{extent, median};
use rotorlead_records::{Excitation, Record};

use super::RecordFault;

/// A period is the stated one within this share. Chosen: quartz clocks differ by far less, and 1 % shifts the end of four periods by 4 %.
const SAME_PERIOD: f64 = 0.01;
/// And within so many rows. Derived: an edge is known to a row only, and a period has two.
const SAME_ROWS: f64 = 2.0;
/// A command is up, or down, when it is this share of its range away from the middle. Chosen: half of the way to either end, so that
/// neither noise of a recorded command nor a rounded corner counts as an edge.
const BEYOND_MIDDLE: f64 = 0.25;

/// Whether the command goes up and down at another pace than stated; `None` too where it does so less than once.
pub(super) fn check_period(record: &Record) -> Option<RecordFault> {
    let stated_s = record.period_s?;
    if !matches!(record.excitation, Excitation::Square | Excitation::Triangle) {
        return None;
    }
    let found_s = period_s(record)?;
    let off_s = (found_s - stated_s).abs();
    let row_s = (record.time_s.last()? - record.time_s.first()?) / (record.time_s.len() - 1) as f64;
    let file = record.file.clone();
    (off_s > SAME_PERIOD * stated_s && off_s > SAME_ROWS * row_s).then_some(RecordFault::OtherPeriod {
        file,
        stated_s,
        found_s,
    })
}

/// The median from one rise to the next, or twice the time between a rise and a fall where there is one of each.
fn period_s(record: &Record) -> Option<f64> {
    let command = &record.command;
    let (low, high) = extent(command);
    let (middle, beyond) = (f64::midpoint(low, high), BEYOND_MIDDLE * (high - low));
    let (mut rises, mut falls) = (Vec::new(), Vec::new());
    let mut is_up = None;
    for (&time_s, &value) in record.time_s.iter().zip(command) {
        let now = if value > middle + beyond {
            true
        } else if value < middle - beyond {
            false
        } else {
            continue;
        };
        if is_up == Some(!now) {
            if now { &mut rises } else { &mut falls }.push(time_s);
        }
        is_up = Some(now);
    }
    let periods = [&rises, &falls].into_iter().flat_map(|edges| edges.windows(2).map(|pair| pair[1] - pair[0]));
    match median(periods) {
        Some(period_s) => Some(period_s),
        None => Some(2.0 * (rises.first()? - falls.first()?).abs()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::record;

    const ROW_S: f64 = 1e-3;

    fn found(shape: impl Fn(f64) -> f64, excitation: Excitation, stated_s: f64) -> Option<f64> {
        let command: Vec<f64> = (0..12_000).map(|row| 0.5 + 0.05 * shape(f64::from(row) * ROW_S)).collect();
        let record = Record { excitation, ..record(1.0 / ROW_S, Some(stated_s), command.clone(), command) };
        check_period(&record).map(|fault| match fault {
            RecordFault::OtherPeriod { found_s, .. } => found_s,
            other => panic!("{other}"),
        })
    }

    fn square(period_s: f64) -> impl Fn(f64) -> f64 {
        move |time_s| if (time_s / period_s).fract() < 0.5 { 1.0 } else { -1.0 }
    }

    fn triangle(period_s: f64) -> impl Fn(f64) -> f64 {
        move |time_s| 4.0 * ((time_s / period_s).fract() - 0.5).abs() - 1.0
    }

    #[test]
    fn a_period_as_stated_is_no_fault_and_another_one_is_found() {
        for period_s in [1.0, 1.7, 5.0] {
            for stated_s in [0.5, 0.9, 0.98, 1.0, 1.001, 1.1, 2.0_f64].map(|ratio| ratio * period_s) {
                let is_same = (stated_s / period_s - 1.0).abs() < 0.01;
                for found in [
                    found(square(period_s), Excitation::Square, stated_s),
                    found(triangle(period_s), Excitation::Triangle, stated_s),
                ] {
                    assert_eq!(found.is_none(), is_same, "{period_s} {stated_s}: {found:?}");
                    assert!(found.is_none_or(|found| (found - period_s).abs() < 2.0 * ROW_S), "{period_s}: {found:?}");
                }
            }
        }
    }

    #[test]
    fn one_rise_and_one_fall_tell_it_and_one_edge_does_not() {
        let seen = found(square(14.0), Excitation::Square, 5.0);
        assert_eq!(seen, None, "one edge within 12 s");
        let seen = found(|time_s| square(14.0)(time_s + 10.0), Excitation::Square, 5.0).unwrap();
        assert!((seen - 14.0).abs() < 3.0 * ROW_S, "{seen}");
        assert_eq!(found(|_| 0.0, Excitation::Square, 5.0), None, "constant");
    }
}
