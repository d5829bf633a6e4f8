//! The noise of a record in time, and over how many independent numbers it is spread.
//!
//! A sum of squares of `n` rows of white noise has `n` degrees of freedom; of colored noise with the spectrum `S` it has
//!
//! ```text
//! 2 (sum_k S_k)^2 / sum_k S_k^2
//! ```
//!
//! over the bins `k` of the transform, two degrees each (Satterthwaite's, as of Welch's spectra). In place of `S` there is an
//! average of `v` complex samples, whose square is `1 + 1 / v` times too large on average; that is taken out.

use rotorlead_numerics::sample::variance;

use super::residual_power::ResidualPower;
use crate::lag::steps::Run;
use crate::rows::resolution::{reading_std, resolution};
use crate::spectra;

/// A level has settled after this many time constants. Chosen: a thousandth of the step, `e^-7`, is left; less counts its rest as noise,
/// more leaves out short levels.
const SETTLED_TIME_CONSTANTS: f64 = 7.0;
/// Fewest settled rows of a level. Chosen: 16 have 7 bins, barely enough for a spectrum; more would leave out short levels.
const FEWEST_ROWS: usize = 16;

/// What is less than this part of the response is the rounding of its numbers. Chosen: below the digits of any log, above the rounding of
/// a simulation.
const ROUNDING: f64 = 1e-9;

/// Whether noise of this variance shows in a response: a sensor of coarse steps, or one that was computed, stands still where it
/// should scatter, and a variance below that of rounding to its steps is not the noise's.
pub(super) fn shows(variance: f64, response: &[f64]) -> bool {
    let largest = response.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    variance > reading_std(resolution(response)).max(ROUNDING * largest).powi(2)
}

/// Degrees of freedom of noise with these powers by bin, each the average of `samples` complex ones.
fn degrees_of_freedom(powers: impl Iterator<Item = f64>, samples: f64) -> f64 {
    let (sum, squares) = powers.fold((0.0, 0.0), |(sum, squares), p| (sum + p, squares + p * p));
    if squares > 0.0 { 2.0 * sum * sum / (squares * samples / (samples + 1.0)) } else { f64::INFINITY }
}

/// The part of a residual that does not repeat from period to period.
///
/// What the model gets wrong repeats and cancels, as does a response that the period has settled to; drift counts as
/// noise.
pub(super) struct PeriodNoise {
    /// Variance per row.
    pub(super) variance: f64,
    residual_power: Option<ResidualPower>,
}

impl PeriodNoise {
    /// From a residual of `length` rows per period; `None` with fewer than two whole periods.
    pub(super) fn estimate(residual: &[f64], length: usize) -> Option<Self> {
        let periods: Vec<&[f64]> = residual.chunks_exact(length).collect();
        if periods.len() < 2 {
            return None;
        }
        let count = periods.len() as f64;
        let of_row = |row: usize| variance(&periods.iter().map(|period| period[row]).collect::<Vec<f64>>());
        let variance = (0..length).map(of_row).sum::<f64>() / length as f64;

        let spectra = spectra::transform(residual, length);
        // Without the mean, which the record leaves free, and the bin of half the row rate.
        let bins = 1..length.div_ceil(2);
        let mut noise = Vec::with_capacity(bins.len());
        let mut repeats = 0.0;
        for bin in bins {
            let mean = spectra.iter().map(|period| period[bin]).sum::<num_complex::Complex64>() / count;
            noise.push(spectra.iter().map(|period| (period[bin] - mean).norm_sqr()).sum::<f64>() / (count - 1.0));
            repeats += count * mean.norm_sqr();
        }
        let dof = degrees_of_freedom(noise.iter().copied(), count - 1.0);
        let residual_power = ResidualPower::compute(repeats, dof, noise.iter().sum(), (count - 1.0) * dof);
        Some(Self { variance, residual_power })
    }

    /// Power of the part of the residual that repeats over that of the noise in the mean over periods.
    pub(super) fn residual_power(&self) -> Option<ResidualPower> {
        self.residual_power
    }
}

/// The scatter of a response about its levels, on plateaus that are long enough to settle.
pub(super) struct LevelNoise {
    /// Variance per row.
    pub(super) variance: f64,
    dof: f64,
    /// The rows that it is the scatter of, in the record.
    settled: Vec<std::ops::Range<usize>>,
}

impl LevelNoise {
    /// Of a run whose levels follow their commands with these time constants; `None` without a plateau that settles.
    pub(super) fn estimate(run: &Run, time_s: &[f64], time_constant_s: impl Fn(f64) -> f64) -> Option<Self> {
        let (mut sum, mut spread, mut settled) = (0.0, 0.0, Vec::new());
        for plateau in &run.plateaus {
            let rows = plateau.settled();
            let waited_s = time_s[rows.start] - time_s[plateau.rows.start];
            if plateau.limited
                || rows.len() < FEWEST_ROWS
                || waited_s < SETTLED_TIME_CONSTANTS * time_constant_s(plateau.command)
            {
                continue;
            }
            let scatter = plateau.std * plateau.std * rows.len() as f64;
            let spectrum = &spectra::transform(&run.clean[rows.clone()], rows.len())[0];
            let powers = spectrum[1..rows.len().div_ceil(2)].iter().map(|bin| bin.norm_sqr());
            sum += scatter;
            spread += scatter * scatter / degrees_of_freedom(powers, 1.0);
            settled.push(rows);
        }
        let rows: usize = settled.iter().map(|rows| rows.len()).sum();
        let dof = if spread > 0.0 { sum * sum / spread } else { f64::INFINITY };
        (rows > 0).then(|| Self { variance: sum / rows as f64, dof, settled })
    }

    /// Power of the residual over that of the noise, on the rows on which the levels were not measured, so that the two are
    /// independent. `None` where there are none. Of a sensor slower than the rows, `repeats` says which repeat a reading: the
    /// residual has none of them.
    pub(super) fn residual_power(
        &self,
        residual: impl Iterator<Item = (usize, f64)>,
        repeats: impl Fn(usize) -> bool,
    ) -> Option<ResidualPower> {
        let is_settled = |row: usize| self.settled.iter().any(|rows| rows.contains(&row));
        let (mut sum, mut rows) = (0.0, 0.0);
        for (_, residual) in residual.filter(|&(row, _)| !is_settled(row)) {
            sum += residual * residual;
            rows += 1.0;
        }
        let settled = self.settled.iter().cloned().flatten().filter(|&row| !repeats(row)).count();
        let dof = self.dof * rows / settled as f64;
        ResidualPower::compute(sum / rows, dof, self.variance, self.dof)
    }
}
