//! Whether the residual of an explanation is stationary noise.
//!
//! What comes and goes without repeating with the period (a motor that loses step, a logger that drops rows) lies between
//! the harmonics, where the density takes it for noise: no gap shows it. But noise is equally strong at all times. Its white
//! lines are independent complex normal numbers, and so is their unitary transform back into time: the mean square of `n`
//! moments over the mean of all has the variance `1 / n`. What is more than that is the spread of a power that changes.

use num_complex::Complex64;
use rotorlead_fourier as fourier;
use rotorlead_numerics::sample::mean;
use serde::Serialize;

use crate::data::dataset::PreparedRecord;
use crate::likelihood::Likelihood;
use crate::likelihood::periodic::BEYOND_EXCITED;
use crate::model::hypothesis::Hypothesis;
use crate::noise::whitening::{NoiseDensity, Whitening};

/// Moments of a mean, a factor apart, each twice the inverse of the compared bandwidth. Chosen: factors of four from single moments to
/// bursts of 256, of which records have few.
const LENGTHS: [usize; 5] = [1, 4, 16, 64, 256];
/// Fewest means of a record. Derived: their own mean is known to `8^-0.5`, 35 %, of what each scatters. Fewer say nothing of a spread.
const FEWEST_MEANS: usize = 8;
/// Power that changes by more standard deviations than this, and by more than [`SPREAD`], is not that of noise. Chosen: squares of single
/// moments have long tails, so that five are not enough. Higher misses short bursts.
const SIGNIFICANT: f64 = 8.0;
/// The part of itself. Chosen: 10 % in amplitude; less matters to no use of a model, as significant as long records make it.
const SPREAD: f64 = 0.2;

/// How much the power of what is left changes with time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Steadiness {
    /// Relative standard deviation of the power beyond chance, over means of the length that shows it most.
    pub spread: f64,
    /// By how many standard deviations of stationary noise that is beyond chance.
    pub significance: f64,
}

impl Steadiness {
    /// Whether it can be noise.
    #[must_use]
    pub fn is_noise(&self) -> bool {
        self.significance < SIGNIFICANT || self.spread < SPREAD
    }
}

/// Judges what `hypothesis` leaves between the harmonics of all records with more than one period.
pub(crate) fn steadiness(likelihood: &Likelihood, hypothesis: &Hypothesis) -> Steadiness {
    let powers: Vec<Vec<f64>> =
        likelihood.data.records.iter().filter_map(|record| power_in_time(likelihood, record, hypothesis)).collect();
    let of_length = |length: usize| {
        let (mut means, mut square, mut chance) = (0.0, 0.0, 0.0);
        for power in powers.iter().filter(|power| power.len() / length >= FEWEST_MEANS) {
            let count = (power.len() / length) as f64;
            square += power.chunks_exact(length).map(|moments| (mean(moments) - 1.0).powi(2)).sum::<f64>();
            // The mean of all is their own.
            chance += (count - 1.0) / length as f64;
            means += count;
        }
        if means == 0.0 {
            return Steadiness::default();
        }
        // The fourth central moment of a gamma variable of shape n and mean 1 is 3 / n^2 + 6 / n^3.
        let variance = (2.0 + 6.0 / length as f64) / (length as f64).powi(2);
        let beyond = (square - chance) / means;
        Steadiness { spread: beyond.max(0.0).sqrt(), significance: beyond / (variance / means).sqrt() }
    };
    let all = LENGTHS.map(of_length);
    all.into_iter().max_by(|a, b| a.significance.total_cmp(&b.significance)).unwrap_or_default()
}

/// Power of what is left between the harmonics over time, its mean 1, as often as the compared band asks for.
fn power_in_time(likelihood: &Likelihood, record: &PreparedRecord, hypothesis: &Hypothesis) -> Option<Vec<f64>> {
    let periods = record.periods();
    if periods < 2 {
        return None;
    }
    let (_, mut residual) = hypothesis.aligned(&likelihood.data, record)?;
    residual.truncate(periods * record.period_rows);
    let density = NoiseDensity::between_harmonics(&residual, periods, record.rate_hz)?;
    let mut whitening = Whitening::unit(residual.len());
    whitening.set_noise(&density, record.rate_hz);
    let mut lines = whitening.apply(&residual);
    let highest = BEYOND_EXCITED * record.highest_hz * residual.len() as f64 / record.rate_hz;
    lines.truncate(highest as usize);
    // What repeats is evaluated elsewhere.
    lines.iter_mut().skip(periods - 1).step_by(periods).for_each(|line| *line = Complex64::ZERO);
    fourier::inverse(lines.len()).process(&mut lines);
    let power: Vec<f64> = lines.iter().map(Complex64::norm_sqr).collect();
    let mean = mean(&power);
    (mean > 0.0).then(|| power.iter().map(|power| power / mean).collect())
}
