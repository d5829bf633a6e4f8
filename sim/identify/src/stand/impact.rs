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
//! over the `2 n + 1` nearest lines: the spread between blows where there are several, and what a local rational model
//!
//! ```text
//! G(x) = (b_0 + b_1 x + b_2 x^2) / (1 + a x)
//! ```
//!
//! leaves of a single one (McKelvey & Guérin, *16th IFAC Symposium on System Identification*, 2012): a polynomial alone is off
//! beside a resonance, and what it is off would count as noise. The line itself is left out there: a line that were part of its
//! own noise would be believed the less the farther it is off, and the residual could never be too large. Lines are not smoothed,
//! so their errors are independent.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use rotorlead_numerics::sample::mean;
use rotorlead_records::{Experiment, Record};

use super::StandError;
use crate::error::IdentifyError;
use crate::frequency_response::{FrequencyResponse, ResponseLine};
use crate::rows::columns;
use crate::spectra;

/// Lines to either side that the noise is pooled over. Chosen: a single blow keeps 13 - 1 - 4 = 8 degrees of freedom, where a fit needs 3;
/// a wider window holds more of a resonance than the local model can follow.
const HALF_WIDTH: usize = 6;

/// Complex parameters of the local rational model. Derived: `b_0`, `b_1`, `b_2` and `a`.
const LOCAL_PARAMETERS: usize = 4;

/// The tail that must be quiet: a tenth of the record. Chosen: a shorter one has few rows to compare, a longer one meets the blow itself.
const TAIL: usize = 10;

/// A record is a blow when its force is concentrated: `(sum u^2)^2 / (n sum u^4)` is below this share. It is 2/3 for a
/// chirp, 1/3 for noise, and about the blow's share of the record for a blow. Chosen: six times below noise, and a blow of a twentieth
/// of its record is a long one.
const CONCENTRATED: f64 = 0.05;

/// Whether the record's force is a blow.
pub(super) fn is_blow(record: &Record) -> bool {
    let mean = mean(&record.command);
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
        let response = columns::response_column(record, experiment.output)?;
        let rate_hz = columns::row_rate_hz(record, experiment.sample_rate_hz)?;
        let (rows, first_rate_hz) = *shape.get_or_insert((response.len(), rate_hz));
        let unlike = |what| StandError::Unlike { file: record.file.clone(), what };
        if response.len() != rows {
            return Err(unlike("another number of rows").into());
        }
        // Chosen: times are rounded by less over a record; lines of rates further apart are not the same.
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
    // Chosen: 1e-8 of the strongest amplitude is rounding of the record's digits.
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
            let start = window_start(k, count);
            let from = first + start;
            residual_power(&u[from..from + window], &y[from..from + window], k - start)
        });
        (noise.collect(), (window - 1 - LOCAL_PARAMETERS) as f64)
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

/// Noise power that the best local rational `G` leaves of `y = G u`, the line at `own` left out.
///
/// The linear problem `y (1 + a x) = (b_0 + b_1 x + b_2 x^2) u` has the errors `(1 + a x) v` where `v` is the noise. They are
/// divided by the `1 + a x` of a first solution (Sanathanan & Koerner), so that all lines count alike.
fn residual_power(u: &[Complex64], y: &[Complex64], own: usize) -> f64 {
    let half = 0.5 * u.len() as f64;
    let others: Vec<usize> = (0..u.len()).filter(|&k| k != own).collect();
    let x = |row: usize| (others[row] as f64 - half) / half;
    let mut weight = vec![1.0; others.len()];
    let (mut residual_ratio, mut expected) = (0.0, 1.0);
    for _ in 0..2 {
        let matrix = DMatrix::from_fn(others.len(), LOCAL_PARAMETERS, |row, column| match column {
            3 => -y[others[row]] * x(row) * weight[row],
            power => u[others[row]] * x(row).powi(power as i32) * weight[row],
        });
        let target = DVector::from_fn(others.len(), |row, _| y[others[row]] * weight[row]);
        let qr = matrix.qr();
        let orthonormal = qr.q();
        let projected = orthonormal.adjoint() * &target;
        residual_ratio = (&target - &orthonormal * &projected).norm_squared();
        // The last parameter is the last unknown of the triangular system.
        let corner = qr.r()[(LOCAL_PARAMETERS - 1, LOCAL_PARAMETERS - 1)];
        let a = if corner.norm() > 0.0 { projected[LOCAL_PARAMETERS - 1] / corner } else { Complex64::ZERO };
        let denominator = |row: usize| (1.0 + a * x(row)).norm();
        expected = (0..others.len())
            .map(|row| (weight[row] * denominator(row)).powi(2) * (1.0 - orthonormal.row(row).norm_squared()))
            .sum();
        let largest = (0..others.len()).map(denominator).fold(0.0, f64::max);
        // A pole on a line would rule alone. Chosen: no line counts more than 50 times as much as another.
        weight = (0..others.len()).map(|row| denominator(row).max(0.02 * largest).recip()).collect();
    }
    residual_ratio / expected
}

/// Whether the tenth before the last is clearly louder than the last: a response that has died away is noise in both.
///
/// Chosen: white noise passes the ratio of 1.5 in 2 % of records with 100 rows in a tenth and in 3e-5 with 400 (F); a response that falls
/// by less than 18 % in a tenth of the record is missed. Tenths of fewer than 16 rows have no power to compare.
fn still_rings(response: &[f64]) -> bool {
    let length = response.len() / TAIL;
    if length < 16 {
        return true;
    }
    let power = |part: &[f64]| {
        let mean = mean(part);
        part.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / part.len() as f64
    };
    let end = response.len();
    let (before, last) = (power(&response[end - 2 * length..end - length]), power(&response[end - length..]));
    before > 1.5 * last
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn a_resonance_leaves_nothing_and_noise_is_left() {
        let u: Vec<Complex64> = (0..13).map(|k| Complex64::cis(0.3 * f64::from(k)) * 2.0).collect();
        let seen = |g: &dyn Fn(f64) -> Complex64| -> Vec<Complex64> {
            u.iter().zip(0..).map(|(u, k)| u * g(f64::from(k))).collect()
        };
        let parabola = seen(&|k| Complex64::new(1.0 + 0.1 * k, 0.02 * k * k));
        // Its half width is one line and a half.
        let resonance = seen(&|k| (2.0 + 0.3 * k) / Complex64::new(1.5, k - 4.2));
        for y in [parabola, resonance] {
            assert!(residual_power(&u, &y, 3) < 1e-20);
            let mut off = y.clone();
            off[3] += 1.0;
            // The line itself does not count, its neighbors do.
            assert!(residual_power(&u, &off, 3) < 1e-20 && residual_power(&u, &off, 4) > 1e-3);
        }
    }

    #[test]
    fn the_noise_is_that_which_is_there() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let runs = 4000;
        let mut mean = 0.0;
        for _ in 0..runs {
            let y: Vec<Complex64> = (0..13)
                .map(|k| 200.0 / Complex64::new(1.5, f64::from(k) - 4.2) + crate::testing::noise(&mut rng))
                .collect();
            mean += residual_power(&[Complex64::ONE; 13], &y, 6) / f64::from(runs);
        }
        // `noise` has a power of one; eight degrees of freedom scatter by 0.35, so the mean by 0.0056 of it.
        assert!((mean - 1.0).abs() < 0.03, "{mean}");
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
