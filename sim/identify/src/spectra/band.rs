//! The spectra of a record's periods as far up as the excitation goes, from rows that come in pieces.
//!
//! An estimator needs the periods one by one: it tests the first ones for a transient, takes the noise from the spread and
//! looks for sinusoids of their own frequency. What it does not need are the bins above the highest excited line and the
//! few that tell the noise there. A record of 5 kHz rows whose lines end at 30 Hz leaves one bin of 80 that way: 16 bytes
//! for each, each period and each column.

use num_complex::Complex64;
use rotorlead_records::LongRows;

use super::SpectrumOptions;
use super::estimate::{Periods, excited_bins, noise_bins};
use super::frame::Frame;
use super::transform::PeriodTransform;

/// How much weaker than an excited line of the mean a line of the first period may be that is kept. Chosen: it only decides how many bins
/// are kept; too few are noticed, and the rows are then read a second time.
const FIRST_PERIOD: f64 = 0.5;

/// One column.
struct Column {
    transform: PeriodTransform,
    periods: Vec<Vec<Complex64>>,
}

impl Column {
    fn new(transform: PeriodTransform) -> Self {
        Self { transform, periods: Vec::new() }
    }
}

/// Takes rows, and keeps the band of their periods' spectra.
pub(super) struct Band<'a> {
    frame: Frame,
    options: &'a SpectrumOptions,
    /// Rows that are still to be left out.
    skip: usize,
    /// Bins that are kept of each period; not known before the first one.
    keep: Option<usize>,
    /// Sum of the command's spectra, all bins.
    command_sum: Vec<Complex64>,
    command: Column,
    response: Column,
    esc_command: Option<Column>,
}

impl<'a> Band<'a> {
    /// For rows from the record's first on. Of each period `keep` bins are kept, or as many as the first period says.
    pub(super) fn new(frame: Frame, options: &'a SpectrumOptions, keep: Option<usize>) -> Self {
        let transform = PeriodTransform::new(frame.length);
        Self {
            frame,
            options,
            skip: frame.rows_left_out,
            keep,
            command_sum: vec![Complex64::ZERO; transform.bins()],
            response: Column::new(transform.another()),
            command: Column::new(transform),
            esc_command: None,
        }
    }

    /// Adds rows.
    pub(super) fn add(&mut self, rows: LongRows<'_>) {
        let from = self.skip.min(rows.command.len());
        self.skip -= from;
        let (options, sum, kept) = (self.options, &mut self.command_sum, &mut self.keep);
        let Column { transform, periods } = &mut self.command;
        transform.add(&rows.command[from..], |spectrum| {
            for (sum, bin) in sum.iter_mut().zip(spectrum) {
                *sum += bin;
            }
            let keep = *kept.get_or_insert_with(|| bins_needed(spectrum, FIRST_PERIOD, options));
            periods.push(spectrum[..keep.min(spectrum.len())].to_vec());
        });
        let keep = self.keep.unwrap_or(usize::MAX);
        let push = |column: &mut Column, samples: &[f64]| {
            let Column { transform, periods } = column;
            transform.add(&samples[from..], |spectrum| periods.push(spectrum[..keep.min(spectrum.len())].to_vec()));
        };
        push(&mut self.response, rows.response);
        if let Some(samples) = rows.esc_command {
            // All rows have it or none.
            push(self.esc_command.get_or_insert_with(|| Column::new(self.response.transform.another())), samples);
        }
    }

    /// The spectra of all periods; or how many bins have to be kept, where the command of the first period was not that of
    /// the others.
    pub(super) fn finish(self) -> Result<Periods, usize> {
        let count = self.command.periods.len() as f64;
        let mean: Vec<_> = self.command_sum.iter().map(|sum| sum / count).collect();
        let needed = bins_needed(&mean, 1.0, self.options).min(mean.len());
        if self.keep.is_none_or(|keep| keep < needed) {
            return Err(needed);
        }
        Ok(Periods {
            bin_rad_s: self.frame.bin_rad_s(),
            command: self.command.periods,
            response: self.response.periods,
            esc_command: self.esc_command.map(|column| column.periods),
        })
    }
}

/// How many bins an estimate uses of spectra with this command, when it looks for lines above a part of the threshold.
fn bins_needed(command: &[Complex64], part: f64, options: &SpectrumOptions) -> usize {
    let excited = excited_bins(command, part * options.line_threshold);
    // The last bin that is kept is not used: it could be half the sampling rate.
    excited.last().map_or(2, |highest| highest + noise_bins(options) + 1)
}
