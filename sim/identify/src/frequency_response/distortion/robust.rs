//! The frequency response from several phase realizations of one multisine.
//!
//! At an excited line a nonlinearity looks like noise that repeats: periods agree on it, other phases do
//! not. With `M` records of equal amplitudes and random phases (the robust method, Pintelon & Schoukens, 2012,
//! section 4.3.1)
//!
//! ```text
//! G     = mean of G_m                              the best linear approximation
//! s^2   = sum |G_m - G|^2 / (M (M - 1))            all of its variance
//! s_n^2 = sum s_m^2 / M^2                          the noise's share, s_m^2 over the periods of record m
//! M (s^2 - s_n^2)                                  what a change of phases does to one record
//! ```

use num_complex::Complex64;

use super::decibels;
use crate::frequency_response::{FrequencyResponse, ResponseLine};
use crate::spectra::{SpectralLine, Spectrum, noise};

/// Lines to either side that the variance over realizations is averaged over. Chosen: as many as periods' variances by default
/// ([`crate::spectra::SpectrumOptions::pool_half_width`]), so that both follow a density alike.
const POOL_HALF_WIDTH: usize = 5;

/// Commands whose lines differ by less than this, relative, are the same realization. Chosen: random phases make them differ by
/// `sqrt(2)`, and periods of one record agree within 0.01.
const SAME_PHASES: f64 = 0.1;

/// A frequency response over realizations.
#[derive(Clone, Debug, PartialEq)]
pub struct RobustResponse {
    /// The best linear approximation; its variance covers noise and nonlinear distortion.
    pub response: FrequencyResponse,
    /// The noise's share of the variance at each line.
    pub noise_variance: Vec<f64>,
    /// Variance of one record's response from realization to realization, noise taken out; below zero by chance where
    /// there is no distortion.
    pub stochastic_variance: Vec<f64>,
    /// Records averaged.
    pub realizations: usize,
    /// The latter relative to the linear response, over the lines, dB; minus infinity when it is not above zero.
    pub stochastic_db: f64,
}

impl RobustResponse {
    /// From records at one nominal command that excite the same lines with the same amplitudes; the lines that all of
    /// them show. `None` when there are fewer than two, or when two have the same phases.
    #[must_use]
    pub fn from_spectra(spectra: &[&Spectrum]) -> Option<Self> {
        let (first, others) = spectra.split_first().filter(|(_, others)| !others.is_empty())?;
        let of_harmonic = |spectrum: &Spectrum, harmonic: u32| {
            spectrum.lines.binary_search_by_key(&harmonic, |line| line.harmonic).ok().map(|at| spectrum.lines[at])
        };
        // By line, all records' lines.
        let common: Vec<Vec<SpectralLine>> = first
            .lines
            .iter()
            .filter_map(|line| spectra.iter().map(|spectrum| of_harmonic(spectrum, line.harmonic)).collect())
            .collect();
        // Chosen: records that share less than half of their lines are of different multisines.
        let comparable = 2 * common.len() > others.iter().map(|s| s.lines.len()).max()?;
        if common.is_empty() || !comparable || !all_differ(&common, spectra.len()) {
            return None;
        }

        let count = spectra.len() as f64;
        let mean: Vec<Complex64> =
            common.iter().map(|lines| lines.iter().map(SpectralLine::ratio).sum::<Complex64>() / count).collect();
        let sample: Vec<f64> = common
            .iter()
            .zip(&mean)
            .map(|(lines, mean)| {
                lines.iter().map(|line| (line.ratio() - mean).norm_sqr()).sum::<f64>() / (count * (count - 1.0))
            })
            .collect();
        let bins: Vec<usize> = common.iter().map(|lines| lines[0].harmonic as usize).collect();
        let pooled = noise::pool(&sample, &bins, count - 1.0, POOL_HALF_WIDTH, 0.0);
        let noise_variance: Vec<f64> = common
            .iter()
            .map(|lines| lines.iter().map(SpectralLine::ratio_variance).sum::<f64>() / (count * count))
            .collect();
        let stochastic_variance: Vec<f64> =
            sample.iter().zip(&noise_variance).map(|(all, noise)| count * (all - noise)).collect();
        let command_power =
            common.iter().map(|lines| lines.iter().map(|line| line.command.norm_sqr()).sum::<f64>() / count);
        let (mut stochastic, mut linear) = (0.0, 0.0);
        for ((power, variance), mean) in command_power.zip(&stochastic_variance).zip(&mean) {
            stochastic += power * variance;
            linear += power * mean.norm_sqr();
        }
        let lines = common
            .iter()
            .zip(mean)
            .zip(pooled.variance)
            .map(|((lines, response), variance)| ResponseLine { omega_rad_s: lines[0].omega_rad_s, response, variance })
            .collect();
        Some(Self {
            response: FrequencyResponse {
                lines,
                degrees_of_freedom: pooled.neighbors as f64 * (count - 1.0),
                periods: spectra.iter().map(|s| s.periods_used).sum(),
            },
            noise_variance,
            stochastic_variance,
            realizations: spectra.len(),
            stochastic_db: decibels(stochastic / linear),
        })
    }
}

/// Whether any two records have other phases.
fn all_differ(common: &[Vec<SpectralLine>], records: usize) -> bool {
    let power: f64 = common.iter().map(|lines| lines[0].command.norm_sqr()).sum();
    let differ = |a: usize, b: usize| {
        let difference: f64 = common.iter().map(|lines| (lines[a].command - lines[b].command).norm_sqr()).sum();
        difference > SAME_PHASES * SAME_PHASES * power
    };
    (0..records).all(|a| (0..a).all(|b| differ(a, b)))
}
