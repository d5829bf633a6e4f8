//! Spectra of periodic records at their excited lines.
//!
//! A record of whole periods has no leakage: the DFT of one period holds the response to each line
//! of the excitation in one bin, `X_k = (2 / N) sum x_n e^(-2 pi j k n / N)`. The mean over periods
//! estimates it, the spread over periods gives the noise (`noise` pools it over neighbors),
//! first periods that carry a transient are left out ([`transient`]), sinusoids that are none of the excitation's
//! are subtracted (of two periods before that test), and lines on which a disturbance is left are left out. The bins between the excited ones are kept
//! too: what repeats there is no linear response ([`Distortion`](crate::frequency_response::distortion::Distortion)).

mod band;
pub(crate) mod estimate;
mod frame;
mod long;
pub(crate) mod noise;
mod off_curve;
pub(crate) mod period_statistics;
mod transform;
pub mod transient;

use num_complex::Complex64;
use rotorlead_records::{Experiment, LongRows, Record};

use band::Band;
use frame::Frame;

use crate::error::IdentifyError;
use crate::rows::columns::{response_column, row_rate_hz};
use crate::spectra::transient::TransientTest;
pub use long::LongRecordError;
pub use noise::density;
pub(super) use transform::transform;

/// How spectra are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpectrumOptions {
    /// A line is excited when the command's amplitude is above this share of the largest, 0..1. The default of 0.1 is chosen: the lines of
    /// a flat multisine differ by less than 20 dB, and what a quantized command adds between them is further below.
    pub line_threshold: f64,
    /// Noise variances are averaged over this many lines to either side. The default of 5 is chosen: eleven lines of four periods give
    /// 66 degrees of freedom, `2 * 11 * 3`, and more lines follow the slope of the noise less well.
    pub pool_half_width: usize,
    /// Probability of dropping a period of a record that carries no transient, 0..1; zero never
    /// drops any. The default of 0.05 is chosen: a period lost costs precision, a transient that is kept costs bias.
    pub transient_level: f64,
}

impl Default for SpectrumOptions {
    fn default() -> Self {
        Self { line_threshold: 0.1, pool_half_width: 5, transient_level: 0.05 }
    }
}

/// One excited line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpectralLine {
    /// Number of the harmonic of one over the period.
    pub harmonic: u32,
    /// Frequency in rad/s.
    pub omega_rad_s: f64,
    /// Complex amplitude of the command.
    pub command: Complex64,
    /// Complex amplitude of the command after the compensator, where it was recorded.
    pub esc_command: Option<Complex64>,
    /// Complex amplitude of the response, mean over the periods used, response units.
    pub response: Complex64,
    /// Variance of `response` given the command, `E |Y - G U|^2` with the line's mean `U`, response units
    /// squared. Where the command's record repeats exactly this is the response's noise; where it does not,
    /// it is `s_Y^2 + |G|^2 s_U^2 - 2 Re(conj(G) s_YU)`, both noises and their covariance (Pintelon &
    /// Schoukens, section 2.4).
    pub variance: f64,
    /// Degrees of freedom of `variance` (real: two per complex sample).
    pub dof: f64,
    /// How many lines, or bins between them, `variance` is pooled over: so many neighbors share what they know of it.
    pub pooled: usize,
}

impl SpectralLine {
    /// Response over command.
    #[must_use]
    pub fn ratio(&self) -> Complex64 {
        self.response / self.command
    }

    /// Variance of [`Self::ratio`].
    #[must_use]
    pub fn ratio_variance(&self) -> f64 {
        self.variance / self.command.norm_sqr()
    }
}

/// A line between the excited ones, where a linear actuator without noise would show nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnexcitedLine {
    /// Number of the harmonic of one over the period.
    pub harmonic: u32,
    /// Frequency in rad/s.
    pub omega_rad_s: f64,
    /// Complex amplitude of the response, mean over the periods used, response units.
    pub response: Complex64,
    /// Noise variance of `response`, from the spread over periods, pooled over neighbors.
    pub variance: f64,
    /// Degrees of freedom of `variance`.
    pub dof: f64,
}

/// A line that was left out because something else than the excitation shows on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisturbedLine {
    /// Number of the harmonic of one over the period.
    pub harmonic: u32,
    /// Frequency in rad/s.
    pub omega_rad_s: f64,
    /// How it shows.
    pub sign: DisturbanceSign,
}

/// A sinusoid that was subtracted from the response: it goes on from period to period on a frequency that is no
/// multiple of the record's, as mains hum does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RemovedSinusoid {
    /// Frequency in rad/s.
    pub omega_rad_s: f64,
    /// Amplitude, response units.
    pub amplitude: f64,
}

/// How a disturbance of one frequency, such as mains hum, shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DisturbanceSign {
    /// The line scatters over the periods far more than its neighbors.
    ScattersOverPeriods,
    /// The line repeats, but is far off the smooth curve through its neighbors.
    OffTheCurve,
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
    /// Whether the first period, or more, carried a transient and was dropped.
    pub transient: TransientTest,
    /// Where the noise variances come from.
    pub noise: NoiseSource,
    /// The excited lines, by frequency, without disturbed ones.
    pub lines: Vec<SpectralLine>,
    /// The lines between them, by frequency, without disturbed ones; none where the noise is taken from them.
    pub unexcited: Vec<UnexcitedLine>,
    /// Excited lines that were left out.
    pub disturbed: Vec<DisturbedLine>,
    /// Sinusoids that were subtracted before.
    pub removed: Vec<RemovedSinusoid>,
}

impl Spectrum {
    /// Transforms one periodic record of `experiment`.
    ///
    /// Rows beyond whole periods are left out at the start, where the transient is.
    ///
    /// # Errors
    /// [`IdentifyError`] when the record has no period, no response or a constant one, uneven rows, less than a
    /// period, a constant or non-periodic command, or no way to know its noise.
    pub fn from_record(
        experiment: &Experiment,
        record: &Record,
        options: &SpectrumOptions,
    ) -> Result<Self, IdentifyError> {
        let response = response_column(record, experiment.output)?;
        if response.windows(2).all(|pair| pair[0] == pair[1]) {
            return Err(IdentifyError::ConstantResponse { file: record.file.clone() });
        }
        let row_rate_hz = row_rate_hz(record, experiment.sample_rate_hz)?;
        let frame = Frame::new(record, row_rate_hz, response.len())?;
        let rows = LongRows {
            rows_before: 0,
            time_s: &record.time_s,
            command: &record.command,
            response,
            esc_command: record.esc_command.as_deref().filter(|column| column.len() == record.time_s.len()),
        };
        let mut keep = None;
        loop {
            let mut band = Band::new(frame, options, keep);
            band.add(rows);
            match band.finish() {
                Ok(periods) => return frame.spectrum(&periods, options, &record.file),
                Err(bins) => keep = Some(bins),
            }
        }
    }
}
