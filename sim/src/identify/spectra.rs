//! Spectra of periodic records at their excited lines.
//!
//! A record of whole periods has no leakage: the DFT of one period holds the response to each line
//! of the excitation in one bin, `X_k = (2 / N) sum x_n e^(-2 pi j k n / N)`. The mean over periods
//! estimates it, the spread over periods gives the noise ([`super::noise`] pools it over neighbours),
//! and a first period that carries a transient is left out ([`super::transient`]).

use std::f64::consts::TAU;

use num_complex::Complex64;
use realfft::RealFftPlanner;

use super::{IdentifyError, TransientTest, noise, transient};
use crate::record::{Experiment, Output, Record};

/// How spectra are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpectrumOptions {
    /// A line is excited when the command's amplitude is above this share of the largest, 0..1.
    pub line_threshold: f64,
    /// Noise variances are averaged over this many lines to either side.
    pub pool_half_width: usize,
    /// Probability of dropping the first period of a record that carries no transient, 0..1; zero
    /// never drops it.
    pub transient_level: f64,
}

impl Default for SpectrumOptions {
    fn default() -> Self {
        Self { line_threshold: 0.1, pool_half_width: 5, transient_level: 0.05 }
    }
}

/// One excited line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Frequency in rad/s.
    pub omega_rad_s: f64,
    /// Complex amplitude of the command.
    pub command: Complex64,
    /// Complex amplitude of the command after the compensator, where it was recorded.
    pub esc_command: Option<Complex64>,
    /// Complex amplitude of the response, mean over the periods used, response units.
    pub response: Complex64,
    /// Noise variance of `response`, `E |N|^2`, response units squared.
    pub variance: f64,
    /// Degrees of freedom of `variance`.
    pub dof: f64,
}

impl Line {
    /// Response over command.
    #[must_use]
    pub fn ratio(&self) -> Complex64 {
        self.response / self.command
    }

    /// Noise variance of [`Self::ratio`]; the command is what was sent and has no noise.
    #[must_use]
    pub fn ratio_variance(&self) -> f64 {
        self.variance / self.command.norm_sqr()
    }
}

/// Where the noise variance comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoiseSource {
    /// The spread over periods.
    BetweenPeriods,
    /// The lines between the excited ones, of one period. Includes even-order distortion.
    UnexcitedLines,
}

/// A periodic record in the frequency domain.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// The record's file.
    pub file: String,
    /// Rows per second.
    pub row_rate_hz: f64,
    /// Period in seconds.
    pub period_s: f64,
    /// Whole periods in the record.
    pub periods: usize,
    /// Periods that the lines are the mean of.
    pub periods_used: usize,
    /// Rows before the first whole period, left out.
    pub rows_left_out: usize,
    /// Whether the first period carried a transient and was dropped.
    pub transient: TransientTest,
    /// Where the noise variances come from.
    pub noise: NoiseSource,
    /// The excited lines, by frequency.
    pub lines: Vec<Line>,
}

/// Name of the response's column.
pub(super) fn column(output: Output) -> &'static str {
    match output {
        Output::ThrustN => "thrust_n",
        Output::Rpm => "rpm",
    }
}

/// A record's response column, checked to be as long as its time and command.
pub(super) fn response_of(record: &Record, output: Output) -> Result<&[f64], IdentifyError> {
    let rows = record.time_s.len();
    record
        .response(output)
        .filter(|response| response.len() == rows && record.command.len() == rows)
        .ok_or_else(|| IdentifyError::NoResponse { file: record.file.clone(), column: column(output), rows })
}

/// Rows per second of a record: as stated, or as its times say.
///
/// # Errors
/// [`IdentifyError::UnevenRows`] when a row is more than a tenth of a row away from even spacing,
/// [`IdentifyError::TooShort`] when there are fewer than two rows.
pub(super) fn row_rate_hz(record: &Record, stated_hz: Option<f64>) -> Result<f64, IdentifyError> {
    let (Some(&first), Some(&last)) = (record.time_s.first(), record.time_s.last()) else {
        return Err(IdentifyError::TooShort { file: record.file.clone(), rows: 0, period_rows: 2 });
    };
    let steps = record.time_s.len() - 1;
    if steps == 0 {
        return Err(IdentifyError::TooShort { file: record.file.clone(), rows: 1, period_rows: 2 });
    }
    let rate = stated_hz.unwrap_or(steps as f64 / (last - first));
    let worst = record
        .time_s
        .iter()
        .enumerate()
        .map(|(row, t)| (row, ((t - first) * rate - row as f64).abs()))
        .fold((0, 0.0), |a, b| if b.1 > a.1 || b.1.is_nan() { b } else { a });
    if worst.1.is_nan() || worst.1 > 0.1 {
        return Err(IdentifyError::UnevenRows { file: record.file.clone(), row: worst.0, off_by: worst.1 });
    }
    Ok(rate)
}

/// Period in seconds and in rows.
///
/// # Errors
/// [`IdentifyError::NoPeriod`], or [`IdentifyError::PeriodRows`] when it is not a whole number of rows.
pub(super) fn period(record: &Record, row_rate_hz: f64) -> Result<(f64, usize), IdentifyError> {
    let file = || record.file.clone();
    let period_s = record.period_s.ok_or_else(|| IdentifyError::NoPeriod { file: file() })?;
    let rows = period_s * row_rate_hz;
    let length = rows.round();
    if !((rows - length).abs() <= 1e-3 && (4.0..=1e9).contains(&length)) {
        return Err(IdentifyError::PeriodRows { file: file(), period_s, rows });
    }
    Ok((period_s, length as usize))
}

impl Spectrum {
    /// Transforms one periodic record of `experiment`.
    ///
    /// Rows beyond whole periods are left out at the start, where the transient is.
    ///
    /// # Errors
    /// [`IdentifyError`] when the record has no period, no response, uneven rows, less than a
    /// period, a constant or non-periodic command, or no way to know its noise.
    pub fn of(experiment: &Experiment, record: &Record, options: &SpectrumOptions) -> Result<Self, IdentifyError> {
        let file = || record.file.clone();
        let response = response_of(record, experiment.output)?;
        let row_rate_hz = row_rate_hz(record, experiment.sample_rate_hz)?;
        let (period_s, length) = period(record, row_rate_hz)?;
        let periods = response.len() / length;
        if periods == 0 {
            return Err(IdentifyError::TooShort { file: file(), rows: response.len(), period_rows: length });
        }
        let rows_left_out = response.len() - periods * length;

        let command = transform(&record.command[rows_left_out..], length);
        let excited = excited_bins(&mean(&command), options.line_threshold);
        if excited.is_empty() {
            return Err(IdentifyError::ConstantCommand { file: file() });
        }
        let at_lines =
            |spectrum: &Vec<Complex64>| -> Vec<Complex64> { excited.iter().map(|&bin| spectrum[bin]).collect() };
        let command: Vec<_> = command.iter().map(at_lines).collect();
        check_periodic(&command, record)?;

        let all = transform(&response[rows_left_out..], length);
        let width = 2 * options.pool_half_width + 1;
        let last = &all[periods - 1];
        let quiet = noise::from_unexcited(last, &excited, width);
        let by_period: Vec<_> = all.iter().map(at_lines).collect();
        let transient = transient::test(&by_period, quiet.as_ref(), options.transient_level);
        let used = &by_period[usize::from(transient.is_present())..];

        let response = mean(used);
        let (noise, variance, dof) = if used.len() > 1 {
            let sample = sample_variance(used, &response);
            let (pooled, neighbours) = noise::pool(&sample, options.pool_half_width);
            let dof = 2.0 * (neighbours * (used.len() - 1)) as f64;
            let of_mean = pooled.iter().map(|v| v / used.len() as f64).collect();
            (NoiseSource::BetweenPeriods, of_mean, dof)
        } else {
            let (power, bins) = quiet.ok_or_else(|| IdentifyError::NoNoise { file: file() })?;
            (NoiseSource::UnexcitedLines, power, 2.0 * bins as f64)
        };
        let command = mean(&command);
        let esc_command: Option<Vec<Complex64>> =
            record.esc_command.as_ref().filter(|column| column.len() == record.time_s.len()).map(|column| {
                let periods = transform(&column[rows_left_out..], length);
                let dropped = usize::from(transient.is_present());
                mean(&periods[dropped..].iter().map(at_lines).collect::<Vec<_>>())
            });
        let lines = excited
            .iter()
            .enumerate()
            .map(|(k, &bin)| Line {
                omega_rad_s: TAU * bin as f64 * row_rate_hz / length as f64,
                command: command[k],
                esc_command: esc_command.as_ref().map(|e| e[k]),
                response: response[k],
                variance: variance[k],
                dof,
            })
            .collect();
        Ok(Self {
            file: file(),
            row_rate_hz,
            period_s,
            periods,
            periods_used: used.len(),
            rows_left_out,
            transient,
            noise,
            lines,
        })
    }
}

/// Spectra of the consecutive periods of `samples`, amplitudes of `e^(j w t)` times two.
fn transform(samples: &[f64], length: usize) -> Vec<Vec<Complex64>> {
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let mut scratch = fft.make_scratch_vec();
    let mut input = fft.make_input_vec();
    samples
        .chunks_exact(length)
        .map(|period| {
            input.copy_from_slice(period);
            let mut spectrum = fft.make_output_vec();
            fft.process_with_scratch(&mut input, &mut spectrum, &mut scratch).expect("all buffers are the plan's own");
            for bin in &mut spectrum {
                *bin *= 2.0 / length as f64;
            }
            spectrum
        })
        .collect()
}

fn mean(periods: &[Vec<Complex64>]) -> Vec<Complex64> {
    let count = periods.len() as f64;
    let bins = periods.first().map_or(0, Vec::len);
    (0..bins).map(|k| periods.iter().map(|p| p[k]).sum::<Complex64>() / count).collect()
}

fn sample_variance(periods: &[Vec<Complex64>], mean: &[Complex64]) -> Vec<f64> {
    mean.iter()
        .enumerate()
        .map(|(k, m)| periods.iter().map(|p| (p[k] - m).norm_sqr()).sum::<f64>() / (periods.len() - 1) as f64)
        .collect()
}

/// Bins of the command above the threshold; none when the command does not move. A command of 0..1
/// that moves by less than 1e-9 is taken as constant: that is rounding, not excitation.
fn excited_bins(command: &[Complex64], threshold: f64) -> Vec<usize> {
    let inner = 1..command.len().saturating_sub(1);
    let peak = inner.clone().map(|k| command[k].norm()).fold(0.0, f64::max);
    if peak.is_nan() || peak <= 1e-9 {
        return Vec::new();
    }
    inner.filter(|&k| command[k].norm() >= threshold * peak).collect()
}

/// The command has no noise, so its periods must agree; a wrong `period_s` shows here.
fn check_periodic(command: &[Vec<Complex64>], record: &Record) -> Result<(), IdentifyError> {
    let average = mean(command);
    let power = average.iter().map(Complex64::norm_sqr).sum::<f64>();
    let spread =
        command.iter().flat_map(|period| period.iter().zip(&average).map(|(c, m)| (c - m).norm_sqr())).sum::<f64>()
            / command.len() as f64;
    let relative = (spread / power).sqrt();
    if relative > 0.01 {
        return Err(IdentifyError::NotPeriodic { file: record.file.clone(), percent: 100.0 * relative });
    }
    Ok(())
}
