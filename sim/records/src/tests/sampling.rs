use super::record;
use crate::error::RecordError;
use crate::files::testing::assert_report;
use crate::sampling::Periods;

/// `count` stamps at `rate_hz` from `start_s`, rounded to `decimals`.
fn stamps(count: usize, rate_hz: f64, start_s: f64, decimals: usize) -> Vec<f64> {
    (0..count)
        .map(|k| format!("{:.decimals$}", start_s + k as f64 / rate_hz))
        .map(|text| text.parse().unwrap())
        .collect()
}

#[test]
fn the_rate_is_found_through_rounded_stamps() {
    for (rate_hz, start_s, decimals) in
        [(1000.0, 0.0, 3), (1000.0, 1.7e9, 3), (5000.0, 12.0, 5), (600.0, 0.0, 4), (143.0, 3.0, 4)]
    {
        let found = record(stamps(2000, rate_hz, start_s, decimals)).sample_rate_hz().unwrap();
        assert!((found / rate_hz - 1.0).abs() < 1e-6, "{found} for {rate_hz}");
    }
}

#[test]
fn two_rows_have_a_rate_and_one_has_none() {
    assert_eq!(record(vec![1.0, 1.5]).sample_rate_hz(), Ok(2.0));
    assert!(matches!(record(vec![1.0]).sample_rate_hz(), Err(RecordError::TooFewRows { rows: 1, .. })));
    assert!(record(vec![]).sample_rate_hz().is_err());
}

#[test]
fn a_missing_row_is_named() {
    let mut time_s = stamps(5000, 1000.0, 0.0, 4);
    time_s.remove(3000);
    let error = record(time_s).sample_rate_hz().unwrap_err();
    // Rows count from one: the one after the gap is now in the place of the one removed.
    assert_eq!(error.row(), Some(3001));
    let parts = ["u050.csv", "row 3001", "0.002 s after", "0.001 s apart", "cut the record"];
    assert_report(error, &parts);
}

#[test]
fn stamps_rounded_to_whole_intervals_are_uneven() {
    let error = record(stamps(2000, 600.0, 0.0, 3)).sample_rate_hz().unwrap_err();
    assert!(matches!(error, RecordError::Gap { .. }), "{error}");
}

#[test]
fn a_rate_that_drifts_is_named() {
    let time_s = (0..10_000).map(|k| f64::from(k) * 1e-3).map(|t| t + 1e-3 * t * t);
    let error = record(time_s.collect()).sample_rate_hz().unwrap_err();
    assert!(matches!(error, RecordError::Drift { row: 1 | 10_000, .. }), "{error}");
    assert_report(error, &["u050.csv", "evenly spaced", "resample"]);
}

#[test]
fn periods_are_counted_and_a_rest_is_left_over() {
    let mut record = record(stamps(4321, 1000.0, 0.0, 3));
    record.period_s = Some(1.0);
    let expected = Periods { samples: 1000, count: 4 };
    assert_eq!(record.periods(), Ok(expected));
}

#[test]
fn exactly_one_period_is_enough_and_one_row_less_is_not() {
    let mut whole = record(stamps(1000, 1000.0, 0.0, 3));
    whole.period_s = Some(1.0);
    assert_eq!(whole.periods().unwrap().count, 1);
    let mut short = record(stamps(999, 1000.0, 0.0, 3));
    short.period_s = Some(1.0);
    let error = short.periods().unwrap_err();
    assert_report(error, &["u050.csv", "999 rows", "1000 samples", "one whole period"]);
}

#[test]
fn a_period_that_is_no_whole_number_of_samples_is_refused() {
    for (period_s, samples) in [(1.0 / 3.0, "333.3333"), (1e-5, "0.0100"), (1.0005, "1000.5000")] {
        let mut record = record(stamps(4000, 1000.0, 0.0, 3));
        record.period_s = Some(period_s);
        let error = record.periods().unwrap_err();
        assert_report(error, &["u050.csv", samples, "not a whole number", "correct `period_s`"]);
    }
}

#[test]
fn a_small_error_of_the_period_counts_once_per_period() {
    let mut record = record(stamps(40_000, 1000.0, 0.0, 3));
    record.period_s = Some(1.000_002);
    assert_eq!(record.periods().unwrap().count, 40); // 40 x 0.002 samples
    record.period_s = Some(1.000_004);
    assert!(matches!(record.periods(), Err(RecordError::PartialSample { .. })));
}

#[test]
fn absurd_periods_are_refused_without_overflow() {
    for period_s in [1e300, f64::MAX, f64::MIN_POSITIVE] {
        let mut record = record(stamps(10, 1000.0, 0.0, 3));
        record.period_s = Some(period_s);
        assert!(record.periods().is_err(), "{period_s}");
    }
}

#[test]
fn a_record_without_period_is_told_so() {
    let error = record(stamps(10, 1000.0, 0.0, 3)).periods().unwrap_err();
    assert_report(error, &["u050.csv", "no period", "give `period_s`"]);
}
