//! The frequency response from blows: `H1` over whole records.
//!
//! A blow and all of its response are in one record, so the ratio of their whole-record spectra has no leakage, and no window is
//! applied: an exponential one would add to every pole's damping. Over `R` blows
//!
//! ```text
//! G = sum Y U* / sum |U|^2,    var G = s^2 / sum |U|^2
//! ```
//!
//! (Bendat & Piersol, *Random Data*, 4th ed., section 6.1), with the force taken as known. The noise `s^2` of `Y` is pooled
//! over the `2 n + 1` nearest lines: the spread between blows where there are several, and what a parabola through `G`
//! leaves of a single one. Lines are not smoothed, so their errors are independent.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use super::StandError;
use crate::identify::{FrequencyResponse, IdentifyError, ResponseLine, spectra};
use crate::record::{Experiment, Record};

/// Lines to either side that the noise is pooled over.
const HALF_WIDTH: usize = 6;

/// The tail that must be quiet: a tenth of the record.
const TAIL: usize = 10;

/// A record is a blow when its force is concentrated: `(sum u^2)^2 / (n sum u^4)` is below this share. It is 2/3 for a
/// chirp, 1/3 for noise, and about the blow's share of the record for a blow.
const CONCENTRATED: f64 = 0.05;

/// Whether the record's force is a blow.
pub(super) fn is_blow(record: &Record) -> bool {
    let mean = record.command.iter().sum::<f64>() / record.command.len().max(1) as f64;
    let (second, fourth) = record.command.iter().fold((0.0, 0.0), |(second, fourth), u| {
        let square = (u - mean).powi(2);
        (second + square, fourth + square * square)
    });
    second * second < CONCENTRATED * record.command.len() as f64 * fourth
}

/// The response of `records`, all of them blows, and whether a response had not died away at the end of its record.
pub(super) fn response(
    experiment: &Experiment,
    records: &[&Record],
    band_hz: (f64, f64),
) -> Result<(FrequencyResponse, Vec<String>), IdentifyError> {
    let mut blows = Vec::new();
    let mut shape: Option<(usize, f64)> = None;
    let mut ringing = Vec::new();
    for record in records {
        let response = spectra::response_of(record, experiment.output)?;
        let rate_hz = spectra::row_rate_hz(record, experiment.sample_rate_hz)?;
        let (rows, first_rate_hz) = *shape.get_or_insert((response.len(), rate_hz));
        let unlike = |what| StandError::Unlike { file: record.file.clone(), what };
        if response.len() != rows {
            return Err(unlike("another number of rows").into());
        }
        if (rate_hz / first_rate_hz - 1.0).abs() > 1e-6 {
            return Err(unlike("another row rate").into());
        }
        if still_rings(response) {
            ringing.push(record.file.clone());
        }
        let spectrum = |samples: &[f64]| spectra::transform(samples, rows).swap_remove(0);
        blows.push((spectrum(&record.command), spectrum(response)));
    }
    let (rows, rate_hz) = shape.ok_or_else(|| StandError::NoRecord { name: experiment.name.clone() })?;
    let bin_hz = rate_hz / rows as f64;
    let (low_hz, high_hz) = band_hz;
    if !(low_hz >= 0.0 && low_hz < high_hz && high_hz < 0.5 * rate_hz) {
        return Err(StandError::Band { low_hz, high_hz, half_rate_hz: 0.5 * rate_hz }.into());
    }
    let bins = ((low_hz / bin_hz).ceil() as usize).max(1)..=(high_hz / bin_hz).floor() as usize;
    let window = 2 * HALF_WIDTH + 1;
    let count = bins.clone().count();
    if count < window {
        let file = records[0].file.clone();
        return Err(StandError::TooShort { file, lines: count, window }.into());
    }
    let first = *bins.start();
    let force: Vec<f64> = bins.clone().map(|bin| blows.iter().map(|(u, _)| u[bin].norm_sqr()).sum()).collect();
    let strongest = force.iter().fold(0.0, |a: f64, b| a.max(*b));
    if let Some(index) = force.iter().position(|power| *power <= 1e-16 * strongest) {
        return Err(StandError::NoForce { frequency_hz: (first + index) as f64 * bin_hz }.into());
    }
    let ratio: Vec<Complex64> = bins
        .clone()
        .zip(&force)
        .map(|(bin, power)| blows.iter().map(|(u, y)| y[bin] * u[bin].conj()).sum::<Complex64>() / power)
        .collect();
    let (noise, degrees_of_freedom) = if blows.len() > 1 {
        let spread: Vec<f64> = bins
            .clone()
            .zip(&ratio)
            .map(|(bin, g)| {
                let squares = blows.iter().map(|(u, y)| (y[bin] - g * u[bin]).norm_sqr()).sum::<f64>();
                squares / (blows.len() - 1) as f64
            })
            .collect();
        let pooled = (0..count).map(|k| {
            let from = window_start(k, count);
            spread[from..from + window].iter().sum::<f64>() / window as f64
        });
        (pooled.collect::<Vec<_>>(), (window * (blows.len() - 1)) as f64)
    } else {
        let (u, y) = &blows[0];
        let noise = (0..count).map(|k| {
            let from = first + window_start(k, count);
            left_over(&u[from..from + window], &y[from..from + window])
        });
        (noise.collect(), (window - 3) as f64)
    };
    let lines = (0..count)
        .map(|k| ResponseLine {
            omega_rad_s: TAU * bin_hz * (first + k) as f64,
            response: ratio[k],
            variance: noise[k] / force[k],
        })
        .collect();
    Ok((FrequencyResponse { lines, degrees_of_freedom, periods: blows.len() }, ringing))
}

fn window_start(k: usize, count: usize) -> usize {
    k.saturating_sub(HALF_WIDTH).min(count - (2 * HALF_WIDTH + 1))
}

/// Noise power that the best parabola `G` leaves of `y = G u`.
fn left_over(u: &[Complex64], y: &[Complex64]) -> f64 {
    let half = 0.5 * u.len() as f64;
    let matrix = DMatrix::from_fn(u.len(), 3, |row, column| u[row] * ((row as f64 - half) / half).powi(column as i32));
    let target = DVector::from_column_slice(y);
    let orthonormal = matrix.qr().q();
    let residual = &target - &orthonormal * (orthonormal.adjoint() * &target);
    residual.norm_squared() / (u.len() - 3) as f64
}

/// Whether the tenth before the last is clearly louder than the last: a response that has died away is noise in both.
fn still_rings(response: &[f64]) -> bool {
    let length = response.len() / TAIL;
    if length < 16 {
        return true;
    }
    let power = |part: &[f64]| {
        let mean = part.iter().sum::<f64>() / part.len() as f64;
        part.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / part.len() as f64
    };
    let end = response.len();
    let (before, last) = (power(&response[end - 2 * length..end - length]), power(&response[end - length..]));
    before > 1.5 * last
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_in_frequency_leaves_nothing_and_noise_is_left() {
        let u: Vec<Complex64> = (0..13).map(|k| Complex64::cis(0.3 * f64::from(k)) * 2.0).collect();
        let g = |k: usize| Complex64::new(1.0 + 0.1 * k as f64, 0.02 * (k * k) as f64);
        let y: Vec<Complex64> = u.iter().enumerate().map(|(k, u)| u * g(k)).collect();
        assert!(left_over(&u, &y) < 1e-24);
        let cubic: Vec<Complex64> = u.iter().enumerate().map(|(k, u)| u * (k as f64 / 6.0 - 1.0).powi(3)).collect();
        assert!(left_over(&u, &cubic) > 1e-3);
    }

    #[test]
    fn an_exponential_that_has_not_died_away_is_noticed() {
        let ring = |decay: f64| -> Vec<f64> {
            (0..1000)
                .map(|k| (-decay * f64::from(k)).exp() * (0.5 * f64::from(k)).sin() + 1e-3 * f64::from(k % 2))
                .collect()
        };
        assert!(still_rings(&ring(0.003)));
        assert!(!still_rings(&ring(0.03)));
    }
}
