//! The prediction-error fit: lag, static map and noise of one motor together.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rotorlead_numerics::least_squares::{Residuals, StoppingCriteria, minimize};
use rotorlead_numerics::linear::linear_least_squares;

use super::noise;
use super::response::{DIFFERENCES, LAG_PARAMETERS, LagShape, basis, gain};
use super::series::Series;

/// What is known of `slope` before any flight: mean and standard deviation. Derived: `tau = J / (b + 2 c w)` of a motor with a drag torque
/// `c w^2` changes with its speed by a power of 0, where the windings brake it, to -1, where the air does, and the speed by a power of 0.5
/// to 1 with the command: 0 to -0.5 or so, the middle of which is known to as much as its half.
const SLOPE: (f64, f64) = (-0.3, 0.25);
/// The same of `curve`. Derived: of the same motor the power itself falls by up to 0.1 for each e-fold of the command.
const CURVE: (f64, f64) = (-0.05, 0.1);
/// The same of the dead time, ms: a standard deviation that hardly holds it. Chosen: protocols and telemetry take 0 to 20 ms.
const DELAY_MS: (f64, f64) = (3.0, 20.0);
/// Time constants that the search begins at, s. Chosen: from the smallest motors to the largest, by factors that a search bridges.
const START_TIME_CONSTANTS_S: [f64; 9] = [0.008, 0.012, 0.018, 0.027, 0.04, 0.06, 0.09, 0.14, 0.25];
/// Dead times of the same, ms.
const START_DELAYS_MS: [f64; 4] = [0.0, 2.0, 6.0, 15.0];
/// Order of the noise by which a first fit finds the residual that its order is chosen on. Chosen: in the middle of those that are tried.
const FIRST_ORDER: usize = 6;
/// A fit of one motor, or of a part of its samples.
#[derive(Clone, Debug)]
pub(super) struct MotorFit {
    pub(super) shape: LagShape,
    /// Of [`basis`], rpm.
    pub(super) coefficients: Vec<f64>,
    /// Of the noise.
    pub(super) noise: Vec<f64>,
    /// RMS of the prediction error, rpm.
    pub(super) error_rpm: f64,
    /// Of the lag's parameters.
    pub(super) covariance: DMatrix<f64>,
    /// Of the coefficients.
    pub(super) coefficients_covariance: DMatrix<f64>,
    pub(super) runs: Vec<Range<usize>>,
}

/// Which parameter the prior is of, its mean and standard deviation.
const PRIORS: [(usize, (f64, f64)); 3] = [(1, SLOPE), (2, CURVE), (3, DELAY_MS)];

struct Joint<'a> {
    series: &'a Series,
    rpm: &'a [f64],
    runs: &'a [Range<usize>],
    order: usize,
    /// RMS of the noise, by which the priors weigh.
    error_rpm: f64,
}

impl Joint<'_> {
    fn terms(&self) -> usize {
        self.series.degree() + 2 + self.series.vehicle.len()
    }

    fn predicted(&self, lag: &[f64], coefficients: &[f64]) -> Vec<f64> {
        let shape = LagShape::from_slice(lag);
        combined(&basis(self.series, &self.series.input, &shape), coefficients)
    }

    fn split<'p>(&self, parameters: &'p [f64]) -> (&'p [f64], &'p [f64], &'p [f64]) {
        let (lag, rest) = parameters.split_at(LAG_PARAMETERS);
        let (coefficients, noise) = rest.split_at(self.terms());
        (lag, coefficients, noise)
    }
}

impl Residuals for Joint<'_> {
    fn count(&self) -> usize {
        self.runs.iter().map(|run| run.len() - self.order).sum::<usize>() + PRIORS.len()
    }

    fn evaluate(&self, parameters: &[f64], out: &mut [f64]) -> bool {
        let (lag, coefficients, noise) = self.split(parameters);
        if !is_possible(lag) {
            return false;
        }
        let predicted = self.predicted(lag, coefficients);
        let residual: Vec<f64> = self.rpm.iter().zip(&predicted).map(|(rpm, predicted)| rpm - predicted).collect();
        let mut white = Vec::with_capacity(out.len());
        noise::whitened(&residual, self.runs, noise, &mut white);
        white.extend(PRIORS.map(|(place, (mean, std))| self.error_rpm * (lag[place] - mean) / std));
        out.copy_from_slice(&white);
        true
    }

    fn jacobian(&self, parameters: &[f64], out: &mut DMatrix<f64>) -> bool {
        let (lag, coefficients, noise) = self.split(parameters);
        let rows = self.count() - PRIORS.len();
        let mut white = Vec::with_capacity(rows);
        let mut put = |column: usize, values: &[f64], out: &mut DMatrix<f64>| {
            noise::whitened(values, self.runs, noise, &mut white);
            for (cell, value) in out.column_mut(column).iter_mut().zip(&white) {
                *cell = -value;
            }
        };
        out.fill(0.0);
        for (place, step) in DIFFERENCES.into_iter().enumerate() {
            let moved = |by: f64| {
                let mut lag = lag.to_vec();
                lag[place] += by;
                self.predicted(&lag, coefficients)
            };
            let (ahead, behind) = (moved(step), moved(-step));
            let slope: Vec<f64> = ahead.iter().zip(&behind).map(|(a, b)| (a - b) / (2.0 * step)).collect();
            put(place, &slope, out);
        }
        let basis = basis(self.series, &self.series.input, &LagShape::from_slice(lag));
        for (term, values) in basis.iter().enumerate() {
            put(LAG_PARAMETERS + term, values, out);
        }
        let predicted = combined(&basis, coefficients);
        let residual: Vec<f64> = self.rpm.iter().zip(&predicted).map(|(rpm, predicted)| rpm - predicted).collect();
        for lagged in 0..self.order {
            let places = self.runs.iter().flat_map(|run| run.start + self.order..run.end);
            let mut column = out.column_mut(LAG_PARAMETERS + self.terms() + lagged);
            for (cell, place) in column.iter_mut().zip(places) {
                *cell = -residual[place - 1 - lagged];
            }
        }
        for (row, (place, (_, std))) in PRIORS.into_iter().enumerate() {
            out[(rows + row, place)] = self.error_rpm / std;
        }
        true
    }
}

/// Bounds beyond which the search is lost: time constants of 2 ms to 2 s, dead times of -20 to 100 ms, and slopes that no motor has.
fn is_possible(lag: &[f64]) -> bool {
    let within = |value: f64, low: f64, high: f64| (low..=high).contains(&value);
    within(lag[0], 0.002_f64.ln(), 2.0_f64.ln())
        && within(lag[1], -2.5, 2.0)
        && within(lag[2], -1.5, 1.5)
        && within(lag[3], -20.0, 100.0)
}

fn combined(basis: &[Vec<f64>], coefficients: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; basis[0].len()];
    for (values, coefficient) in basis.iter().zip(coefficients) {
        for (sum, value) in sum.iter_mut().zip(values) {
            *sum += coefficient * value;
        }
    }
    sum
}

/// Where the search begins: the best of a grid, by what the lag leaves of the changes from sample to sample.
fn start(series: &Series, rpm: &[f64]) -> Option<(LagShape, Vec<f64>)> {
    let mut best: Option<(f64, LagShape, Vec<f64>)> = None;
    for time_constant_s in START_TIME_CONSTANTS_S {
        for delay_ms in START_DELAYS_MS {
            let shape = LagShape { level: time_constant_s.ln(), slope: SLOPE.0, curve: CURVE.0, delay_ms };
            let basis = basis(series, &series.input, &shape);
            let Some(coefficients) = differenced_fit(&basis, rpm, &series.runs) else { continue };
            let predicted = combined(&basis, &coefficients);
            let residual: Vec<f64> = rpm.iter().zip(&predicted).map(|(rpm, predicted)| rpm - predicted).collect();
            let mut changes = Vec::new();
            noise::whitened(&residual, &series.runs, &[1.0], &mut changes);
            let sum = changes.iter().map(|change| change * change).sum();
            if best.as_ref().is_none_or(|(least, ..)| sum < *least) {
                best = Some((sum, shape, coefficients));
            }
        }
    }
    best.map(|(_, shape, coefficients)| (shape, coefficients))
}

/// Coefficients that explain the changes best; the constant explains none, and is taken from the mean.
fn differenced_fit(basis: &[Vec<f64>], rpm: &[f64], runs: &[Range<usize>]) -> Option<Vec<f64>> {
    let differenced = |values: &[f64]| {
        let mut out = Vec::new();
        noise::whitened(values, runs, &[1.0], &mut out);
        out
    };
    let columns: Vec<Vec<f64>> = basis.iter().skip(1).map(|values| differenced(values)).collect();
    let right = DVector::from_vec(differenced(rpm));
    let matrix = DMatrix::from_fn(right.len(), columns.len(), |row, column| columns[column][row]);
    let normal = matrix.tr_mul(&matrix);
    let slopes = linear_least_squares(normal, &matrix.tr_mul(&right), 1e-12)?;
    let mut coefficients = vec![0.0];
    coefficients.extend(slopes.iter());
    let rest = combined(basis, &coefficients);
    let places = || runs.iter().cloned().flatten();
    coefficients[0] = places().map(|place| rpm[place] - rest[place]).sum::<f64>() / places().count() as f64;
    Some(coefficients)
}

impl MotorFit {
    /// The fit of all samples.
    pub(super) fn fit(series: &Series) -> Option<Self> {
        let rpm = series.rpm();
        let (shape, coefficients) = start(series, &rpm)?;
        let first = search(series, &rpm, &series.runs, FIRST_ORDER, &shape, &coefficients, None)?;
        let order = noise::held_out_order(&first.residual(series, &rpm), &series.runs);
        let again = |from: &Self, order: usize| {
            search(series, &rpm, &series.runs, order, &from.shape, &from.coefficients, Some(from.error_rpm))
        };
        // A search of many orders may end nowhere; what the last one found stands then.
        let Some(second) = again(&first, order) else { return Some(first) };
        let chosen = noise::held_out_order(&second.residual(series, &rpm), &series.runs);
        if chosen == order { Some(second) } else { again(&second, chosen).or(Some(second)) }
    }

    /// Logarithms of the time constant at the center, of the even and of the odd parts of the flight.
    pub(super) fn halves(&self, series: &Series) -> Option<[f64; 2]> {
        let rpm = series.rpm();
        let half = |half: usize| {
            let runs = noise::parts(&self.runs, half);
            let fit =
                search(series, &rpm, &runs, self.noise.len(), &self.shape, &self.coefficients, Some(self.error_rpm))?;
            Some(fit.shape.level)
        };
        Some([half(0)?, half(1)?])
    }

    /// Speed less what the lag makes of it, rpm.
    pub(super) fn residual(&self, series: &Series, rpm: &[f64]) -> Vec<f64> {
        let predicted = combined(&basis(series, &series.input, &self.shape), &self.coefficients);
        rpm.iter().zip(&predicted).map(|(rpm, predicted)| rpm - predicted).collect()
    }

    /// The derivatives of the speed by the parameters of the lag and by the coefficients, for an input, whitened as the noise is.
    pub(super) fn sensitivities(&self, series: &Series, input: &[f64]) -> Vec<Vec<f64>> {
        let predicted = |shape: &LagShape| combined(&basis(series, input, shape), &self.coefficients);
        let mut all = Vec::new();
        for (place, step) in DIFFERENCES.into_iter().enumerate() {
            let moved = |by: f64| {
                let mut lag = self.shape.to_array();
                lag[place] += by;
                predicted(&LagShape::from_slice(&lag))
            };
            let (ahead, behind) = (moved(step), moved(-step));
            all.push(ahead.iter().zip(&behind).map(|(a, b)| (a - b) / (2.0 * step)).collect());
        }
        all.extend(basis(series, input, &self.shape));
        let mut white = Vec::new();
        all.iter()
            .map(|values: &Vec<f64>| {
                noise::whitened(values, &self.runs, &self.noise, &mut white);
                white.clone()
            })
            .collect()
    }

    /// Logarithm of the time constant at a level, and its standard error.
    pub(super) fn log_time_constant(&self, series: &Series, level: f64) -> (f64, f64) {
        let x = (level / series.center).ln();
        let by = [1.0, x, x * x, 0.0];
        let variance: f64 = (0..LAG_PARAMETERS)
            .flat_map(|i| (0..LAG_PARAMETERS).map(move |j| (i, j)))
            .map(|(i, j)| by[i] * by[j] * self.covariance[(i, j)])
            .sum();
        (self.shape.time_constant_s(level, series.center).ln(), variance.max(0.0).sqrt())
    }

    /// Static gain at a level, rpm per unit of command, and its standard error.
    pub(super) fn gain(&self, series: &Series, level: f64) -> (f64, f64) {
        let count = self.coefficients.len();
        let by: Vec<f64> = (0..count)
            .map(|place| {
                let mut unit = vec![0.0; count];
                unit[place] = 1.0;
                gain(series, &unit, level)
            })
            .collect();
        let variance: f64 = (0..count)
            .flat_map(|i| (0..count).map(move |j| (i, j)))
            .map(|(i, j)| by[i] * by[j] * self.coefficients_covariance[(i, j)])
            .sum();
        (gain(series, &self.coefficients, level), variance.max(0.0).sqrt())
    }
}

#[allow(clippy::too_many_arguments)]
fn search(
    series: &Series,
    rpm: &[f64],
    runs: &[Range<usize>],
    order: usize,
    shape: &LagShape,
    coefficients: &[f64],
    error_rpm: Option<f64>,
) -> Option<MotorFit> {
    let runs: Vec<Range<usize>> = runs.iter().filter(|run| run.len() > 2 * order).cloned().collect();
    let predicted = combined(&basis(series, &series.input, shape), coefficients);
    let residual: Vec<f64> = rpm.iter().zip(&predicted).map(|(rpm, predicted)| rpm - predicted).collect();
    let noise = noise::autoregression(&residual, &runs, order)?;
    let mut white = Vec::new();
    noise::whitened(&residual, &runs, &noise, &mut white);
    if white.len() < 10 * (order + coefficients.len() + LAG_PARAMETERS) {
        return None;
    }
    let rms = |values: &[f64]| (values.iter().map(|e| e * e).sum::<f64>() / values.len() as f64).sqrt();
    let error_rpm = error_rpm.unwrap_or_else(|| rms(&white));
    let joint = Joint { series, rpm, runs: &runs, order, error_rpm };
    let start = [&shape.to_array()[..], coefficients, &noise].concat();
    let limits = StoppingCriteria { iterations: 40, decrease: 3e-7 };
    let found = minimize(&joint, &start, limits)?;
    let error_rpm = rms(&found.residuals[..found.residuals.len() - PRIORS.len()]);
    let covariance = found.unit_covariance? * error_rpm.powi(2);
    let (lag, found_coefficients, noise) = joint.split(&found.parameters);
    Some(MotorFit {
        shape: LagShape::from_slice(lag),
        coefficients: found_coefficients.to_vec(),
        noise: noise.to_vec(),
        error_rpm,
        coefficients_covariance: covariance
            .view((LAG_PARAMETERS, LAG_PARAMETERS), (coefficients.len(), coefficients.len()))
            .into_owned(),
        covariance: covariance.view((0, 0), (LAG_PARAMETERS, LAG_PARAMETERS)).into_owned(),
        runs,
    })
}
