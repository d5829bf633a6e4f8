//! The same lag by instruments: what moves the command and has no part in the noise.
//!
//! The prediction error is uncorrelated with the past of the command, so that the fit is consistent in a closed loop, only if nothing moves
//! command and speed alike. A gust does: it turns the vehicle and brakes the rotor. Setpoints, and a chirp among them, do not know of it.
//! At the fit, one step of `sum z_k e_k = 0` with `z` the derivatives of the speed for the part of the command that the instruments
//! explain (Söderström and Stoica, *System Identification*, 1989, chapter 8; the test of the difference is Hausman's, *Econometrica* 46,
//! 1978).

use nalgebra::{DMatrix, DVector};
use rotorlead_numerics::normal_equations::scaled_inverse;
use rotorlead_numerics::sample::moving_mean;
use rotorlead_records::Record;
use serde::Serialize;

use super::fit::MotorFit;
use super::noise;
use super::response::LAG_PARAMETERS;
use super::series::Series;

/// How far back an instrument moves the command, in samples, and every how many of them is taken. Chosen: 0.4 s is the length of a rate
/// loop's response.
const REACH: usize = 100;
const EVERY: usize = 4;
/// Delay of a command that serves as an instrument of itself, in samples. Chosen: behind it a prediction error of this moment has no part.
const OWN_DELAY: usize = 15;
/// Half the width of the mean that is taken off command and instruments, in samples: slower than that, pilots answer the wind.
const SLOW: usize = 125;

/// An estimate by instruments beside that of the fit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct InstrumentalEstimate {
    /// What served.
    pub instruments: &'static str,
    /// Difference of the logarithm of the time constant at the center from that of the fit.
    pub difference: f64,
    /// Standard error of the difference.
    pub difference_std: f64,
    /// Standard error of the estimate itself.
    pub std: f64,
}

/// The estimate by the record's setpoints, or where there are none by its own past command; `None` where they move nothing.
pub(super) fn estimate(series: &Series, record: &Record, fit: &MotorFit) -> Option<InstrumentalEstimate> {
    let setpoints: Vec<&[f64]> =
        record.setpoints.columns().filter(|values| values.windows(2).any(|pair| pair[0] != pair[1])).collect();
    let (instruments, columns, delay) = match setpoints.is_empty() {
        false => ("setpoints", setpoints, 0),
        true => ("delayed commands", vec![&series.input[..]], OWN_DELAY),
    };
    let sampled: Vec<Vec<f64>> = columns.iter().map(|column| high_passed(series, column)).collect();
    let command = high_passed(series, &series.input);
    let explained = explained(series, &command, &sampled, delay)?;
    let slow = {
        let samples = at_samples(series, &series.input);
        moving_mean(&samples, SLOW)
    };
    let moved: Vec<f64> = slow.iter().zip(&explained).map(|(slow, explained)| slow + explained).collect();
    let input = at_rows(series, &moved);
    let (full, part) = (fit.sensitivities(series, &series.input), fit.sensitivities(series, &input));
    let mut errors = Vec::new();
    noise::whitened(&fit.residual(series, &series.rpm()), &fit.runs, &fit.noise, &mut errors);
    // The bends of the lag stay those of the fit: instruments are too weak to know them.
    let count = full.len();
    let free: Vec<usize> = [0, 3].into_iter().chain(LAG_PARAMETERS..count).collect();
    let size = free.len();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let cross = DMatrix::from_fn(size, size, |i, j| dot(&part[free[i]], &full[free[j]]));
    let square = DMatrix::from_fn(size, size, |i, j| dot(&part[free[i]], &part[free[j]]));
    let whole = DMatrix::from_fn(size, size, |i, j| dot(&full[free[i]], &full[free[j]]));
    let right = DVector::from_fn(size, |i, _| dot(&part[free[i]], &errors));
    let inverse = cross.try_inverse()?;
    let step = &inverse * right;
    let variance = fit.error_rpm.powi(2);
    let covariance = &inverse * square * inverse.transpose() * variance;
    let fitted = scaled_inverse(&whole, 1e-12)? * variance;
    let difference_variance = covariance[(0, 0)] - fitted[(0, 0)];
    // Rounding where the instruments explain nearly all of the command.
    let least = 0.01 * covariance[(0, 0)];
    Some(InstrumentalEstimate {
        instruments,
        difference: step[0],
        difference_std: difference_variance.max(least).sqrt(),
        std: covariance[(0, 0)].max(0.0).sqrt(),
    })
    .filter(|found| found.difference.is_finite() && found.std.is_finite())
}

fn at_samples(series: &Series, values: &[f64]) -> Vec<f64> {
    let mean = |rows: &std::ops::Range<usize>| values[rows.clone()].iter().sum::<f64>() / rows.len() as f64;
    series.samples.iter().map(|sample| mean(&sample.rows)).collect()
}

fn high_passed(series: &Series, values: &[f64]) -> Vec<f64> {
    let samples = at_samples(series, values);
    let slow = moving_mean(&samples, SLOW);
    samples.iter().zip(&slow).map(|(value, slow)| value - slow).collect()
}

/// The part of the command that the instruments explain, by least squares over the runs.
fn explained(series: &Series, command: &[f64], instruments: &[Vec<f64>], delay: usize) -> Option<Vec<f64>> {
    let lags: Vec<usize> = (0..REACH / EVERY).map(|lag| delay + lag * EVERY).collect();
    let count = instruments.len() * lags.len();
    // Mean over the samples of a lag, so that nothing between two lags is passed over.
    let smooth: Vec<Vec<f64>> = instruments.iter().map(|values| moving_mean(values, EVERY / 2)).collect();
    let reach = delay + REACH;
    let regressor = |place: usize, out: &mut Vec<f64>| {
        out.clear();
        for values in &smooth {
            out.extend(lags.iter().map(|lag| if place >= *lag { values[place - lag] } else { 0.0 }));
        }
    };
    let (mut square, mut right) = (DMatrix::zeros(count, count), DVector::zeros(count));
    let mut row = Vec::with_capacity(count);
    for place in series.runs.iter().cloned().flatten().filter(|place| *place >= reach) {
        regressor(place, &mut row);
        let x = DVector::from_column_slice(&row);
        square.ger(1.0, &x, &x, 1.0);
        right.axpy(command[place], &x, 1.0);
    }
    let coefficients = scaled_inverse(&square, 1e-6)? * right;
    Some(
        (0..command.len())
            .map(|place| {
                regressor(place, &mut row);
                row.iter().zip(coefficients.iter()).map(|(x, c)| x * c).sum()
            })
            .collect(),
    )
}

/// Values of samples, on straight lines between their middles, at the rows.
fn at_rows(series: &Series, values: &[f64]) -> Vec<f64> {
    let middle = |place: usize| {
        let rows = &series.samples[place].rows;
        0.5 * (rows.start + rows.end - 1) as f64
    };
    let mut place = 0;
    (0..series.time_s.len())
        .map(|row| {
            while place + 2 < values.len() && middle(place + 1) <= row as f64 {
                place += 1;
            }
            let (from, to) = (middle(place), middle(place + 1));
            let part = ((row as f64 - from) / (to - from)).clamp(0.0, 1.0);
            values[place] + part * (values[place + 1] - values[place])
        })
        .collect()
}
