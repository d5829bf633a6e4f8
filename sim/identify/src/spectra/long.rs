//! The spectrum of a record that is too long for memory.

use miette::Diagnostic;
use rotorlead_records::files::FileError;
use rotorlead_records::{Experiment, LongRecord, LongRows, RowCount};
use thiserror::Error;

use super::band::Band;
use super::frame::Frame;
use super::{Spectrum, SpectrumOptions};
use crate::error::IdentifyError;
use crate::rows::columns::{check_even_rows, mean_row_rate_hz};

/// Why there is no spectrum of a long record.
#[derive(Debug, Error, Diagnostic)]
pub enum LongRecordError {
    /// Its file cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    File(#[from] FileError),
    /// Nothing can be identified from it.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Identify(#[from] IdentifyError),
}

impl Spectrum {
    /// Transforms a periodic record whose rows stay on disk: the same numbers as [`Self::from_record`], bit for bit.
    ///
    /// The file is read once; memory holds one period of each column and, of each period's spectrum, the bins up to the
    /// highest excited line. Where the first period's command does not go up as far as the others' do, or the file has rows
    /// that are not lines, it is read a second time.
    ///
    /// # Errors
    /// Those of [`Experiment::read`] and of [`Self::from_record`].
    pub fn from_long_record(
        experiment: &Experiment,
        record: &LongRecord,
        options: &SpectrumOptions,
    ) -> Result<Self, LongRecordError> {
        let header = &record.header;
        let mut count = record.row_count_by_lines()?;
        let mut keep = None;
        loop {
            let rate_hz = mean_row_rate_hz(experiment.sample_rate_hz, count.rows, count.first_s, count.last_s);
            // Without a frame the rows are read all the same: the lines may be miscounted, and what is wrong with the
            // rows comes before what is wrong with the period.
            let frame = Frame::new(header, rate_hz, count.rows);
            let mut band = frame.as_ref().ok().map(|frame| Band::new(*frame, options, keep));
            let found = read_even(record, &count, rate_hz, |rows| {
                if let Some(band) = &mut band {
                    band.add(rows);
                }
            })?;
            if found != count {
                count = found;
                continue;
            }
            let frame = frame?;
            match band.map(Band::finish) {
                Some(Ok(periods)) => return Ok(frame.spectrum(&periods, options, &header.file)?),
                Some(Err(bins)) => keep = Some(bins),
                None => {}
            }
        }
    }
}

/// Gives all rows to `each`, and refuses uneven ones where there are as many as `count` says.
fn read_even(
    record: &LongRecord,
    count: &RowCount,
    rate_hz: f64,
    mut each: impl FnMut(LongRows<'_>),
) -> Result<RowCount, LongRecordError> {
    let mut farthest = (0, 0.0);
    let found = record.for_each_block(|rows| {
        for (row, time_s) in (rows.rows_before..).zip(rows.time_s) {
            let off_by = ((time_s - count.first_s) * rate_hz - row as f64).abs();
            if off_by > farthest.1 {
                farthest = (row, off_by);
            }
        }
        each(rows);
    })?;
    if found == *count {
        check_even_rows(farthest, &record.header.file)?;
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rotorlead_records::Record;
    use rotorlead_records::files::testing::{Scratch, report};

    use super::*;
    use crate::lag::multisine::{PeriodicOptions, identify_periodic};
    use crate::testing::{experiment, noise, record};

    const RATE_HZ: f64 = 1000.0;
    const PERIOD_S: f64 = 2.0;
    const PERIOD: usize = 2000;

    /// A lag of 0.1 s that starts from rest behind a multisine, for so many rows.
    fn multisine(rows: usize) -> Record {
        multisine_with(rows, |_, _| 1.0)
    }

    /// The same with lines of another amplitude, by row and number of the harmonic.
    fn multisine_with(rows: usize, amplitude: impl Fn(usize, u8) -> f64) -> Record {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut state = 0.0;
        let (mut command, mut thrust_n) = (Vec::new(), Vec::new());
        for row in 0..rows {
            let t = row as f64 / RATE_HZ;
            let line = |n: u8| {
                let harmonic = f64::from(n);
                amplitude(row, n) * (TAU * harmonic * t / PERIOD_S + harmonic * harmonic).sin()
            };
            let sum: f64 = (1..40).step_by(2).map(line).sum();
            thrust_n.push(10.0 * state + 0.01 * noise(&mut rng).re);
            command.push(0.5 + 0.01 * sum);
            state += (command[row] - state) * (1.0 - (-1.0 / (RATE_HZ * 0.1)).exp());
        }
        record(RATE_HZ, Some(PERIOD_S), command, thrust_n)
    }

    /// The experiment as it is read, with its record in memory; without it, and the record on disk.
    fn both(
        scratch: &Scratch,
        record: Record,
        state_rate: bool,
        edit: impl Fn(String) -> String,
    ) -> (Experiment, Experiment, LongRecord) {
        let folder = scratch.path().join("run");
        let mut written = experiment(RATE_HZ, vec![record]);
        written.sample_rate_hz = written.sample_rate_hz.filter(|_| state_rate);
        written.write(&folder).unwrap();
        let csv = folder.join("test.csv");
        std::fs::write(&csv, edit(std::fs::read_to_string(&csv).unwrap())).unwrap();
        let (short, none) = Experiment::read_except_long(&folder, u64::MAX).unwrap();
        let (rest, mut long) = Experiment::read_except_long(&folder, 0).unwrap();
        assert!(none.is_empty() && rest.records.is_empty());
        (short, rest, long.remove(0))
    }

    /// Asserts that both ways to the spectrum, or to an error, agree in every bit.
    #[track_caller]
    fn agree(record: Record, state_rate: bool, edit: impl Fn(String) -> String) -> Result<Spectrum, String> {
        let scratch = Scratch::new();
        let (short, rest, long) = both(&scratch, record, state_rate, edit);
        let options = SpectrumOptions::default();
        let expected = Spectrum::from_record(&short, &short.records[0], &options);
        let found = Spectrum::from_long_record(&rest, &long, &options);
        match (expected, found) {
            (Ok(expected), Ok(found)) => {
                assert!(found == expected);
                Ok(found)
            }
            (Err(expected), Err(found)) => {
                assert_eq!(report(&found), report(&expected));
                Err(expected.to_string())
            }
            (expected, found) => panic!("{expected:?}, from disk {found:?}"),
        }
    }

    #[test]
    fn the_spectrum_is_that_of_the_record_in_memory() {
        for (rows, state_rate) in [(PERIOD, true), (30 * PERIOD, true), (30 * PERIOD + 777, false)] {
            let spectrum = agree(multisine(rows), state_rate, |csv| csv).unwrap();
            assert_eq!(spectrum.periods, rows / PERIOD);
            assert_eq!(spectrum.rows_left_out, rows % PERIOD);
            assert_eq!(spectrum.transient.is_present(), rows == 30 * PERIOD, "the first period starts from rest");
            assert!(spectrum.lines.len() > 15);
        }
    }

    #[test]
    fn the_column_after_a_compensator_is_taken_too() {
        let mut record = multisine(5 * PERIOD);
        record.esc_command = Some(record.command.iter().map(|u| 0.5 + 0.9 * (u - 0.5)).collect());
        let spectrum = agree(record, true, |csv| csv).unwrap();
        assert!(spectrum.lines.iter().all(|line| line.esc_command.is_some()));
    }

    #[test]
    fn rows_that_are_not_lines_are_counted_in_the_end() {
        agree(multisine(5 * PERIOD + 10), false, |csv| csv.replacen("\n0.5", "\n\n\n0.5", 1)).unwrap();
    }

    #[test]
    fn a_first_period_that_goes_less_far_up_than_the_others_hides_nothing() {
        // Of so many periods it is so small a part that they still count as periodic.
        let top = |row, n| if n < 39 { 1.0 } else { 0.3 * f64::from(u8::from(row >= PERIOD)) };
        let record = multisine_with(60 * PERIOD, top);
        let found = agree(record, true, |csv| csv);
        assert!(found.as_ref().is_ok_and(|s| s.lines.iter().any(|l| l.harmonic == 39)), "{found:?}");
    }

    #[test]
    fn what_is_refused_in_memory_is_refused_from_disk() {
        let constant = |mut record: Record| {
            record.command.fill(0.5);
            record
        };
        let wrong_period = |mut record: Record| {
            record.period_s = Some(1.7);
            record
        };
        let part_of_a_row = |mut record: Record| {
            record.period_s = Some(1.9995001);
            record
        };
        for (record, part) in [
            (multisine(PERIOD - 1), "less than one period"),
            (constant(multisine(3 * PERIOD)), "command"),
            (wrong_period(multisine(9 * PERIOD)), "period"),
            (part_of_a_row(multisine(3 * PERIOD)), "not a whole number"),
        ] {
            let error = agree(record, true, |csv| csv).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
        // A row is missing, and no rate is stated.
        let gap = |csv: String| {
            let mut lines: Vec<_> = csv.lines().collect();
            lines.remove(5000);
            lines.join("\n")
        };
        let error = agree(multisine(5 * PERIOD), false, gap).unwrap_err();
        assert!(error.contains("even spacing"), "{error}");
    }

    #[test]
    fn the_model_is_that_of_the_records_in_memory() {
        let scratch = Scratch::new();
        let (short, rest, long) = both(&scratch, multisine(30 * PERIOD + 5), true, |csv| csv);
        let spectrum = Spectrum::from_long_record(&rest, &long, &SpectrumOptions::default()).unwrap();
        let transformed = [(long.header.clone(), spectrum)];
        let options = PeriodicOptions { long: &transformed, ..PeriodicOptions::default() };
        let expected = identify_periodic(&short, &PeriodicOptions::default()).unwrap();
        assert_eq!(identify_periodic(&rest, &options).unwrap(), expected);
        let tau = expected.nominals[0].fit.time_constant_s;
        assert!((tau.value - 0.1).abs() < 5.0 * tau.std + 1e-3, "{tau:?}");
    }
}
