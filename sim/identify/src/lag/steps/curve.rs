//! The time constant as a smooth curve over operating points, from the steps that carry information.
//!
//! # Model
//! The logarithm of the time constant of step `i` to the command `u_i` is
//!
//! ```text
//! log tau_i = c_0 + c_1 v_i + c_2 v_i^2 + d [down] + b_i + e_i,   v = u - 1/2
//! ```
//!
//! with `e_i` the error of its own fit, whose covariance is known, and `b_i` what steps differ by beyond that: a random effect of
//! variance `b^2`, by the generalized moment estimator (Paule and Mandel 1982; DerSimonian and Kacker 2007). So the band of the
//! curve holds what the steps do not agree on, whatever the reason.
//!
//! Few steps say little of slope, bend and the difference of directions, and a curve that left them out would be sure where
//! it has no reason to. They have Gaussian priors instead, from what a motor does ([`PRIOR`]): they widen the band away from the
//! steps, and fade where there are many.
//!
//! # Steps that contradict
//! A step whose time constant is far from what all others say of it, by Student's t of a fit without it at 1 % over all
//! steps (Bonferroni), is left out, the farthest first and at most a quarter of all.

use nalgebra::{Cholesky, DMatrix, DVector, SMatrix, SVector};
use rotorlead_numerics::statistics::t_quantile;
use rotorlead_plant::TimeConstantBand;

use super::plateaus::Direction;
use crate::estimate::Estimate;

/// A time constant as a step says it.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepTimeConstant {
    pub(super) command: f64,
    pub(super) direction: Direction,
    pub(super) log_tau: f64,
}

/// Constant, slope, bend, and what steps down add.
const TERMS: usize = 4;
type Coefficients = SVector<f64, TERMS>;
type Covariance = SMatrix<f64, TERMS, TERMS>;

/// Mean and standard deviation of the Gaussian priors of slope, bend and direction. Chosen to hold what motors do within a standard
/// deviation or two: drag alone makes the logarithm fall by 0 to about 1.5 from low to full command; it falls steadily; and steps down
/// differ from steps up by a third or so either way, as the ESC lets coast or brakes.
const PRIOR: [(f64, f64); TERMS - 1] = [(-0.5, 0.75), (0.0, 0.75), (0.0, 0.3)];

/// The time constant of small motions over the operating points that steps lead to.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeConstantCurve {
    /// The lowest and the highest command of a step that it rests on.
    pub range: (f64, f64),
    /// How many steps it rests on.
    pub steps: usize,
    /// Standard deviation of the logarithm by which steps differ beyond their own errors.
    pub between_std: f64,
    coefficients: Coefficients,
    covariance: Covariance,
    /// Degrees of freedom behind the band.
    dof: f64,
    /// What the coefficients are multiplied with on average, over the steps up and over those down.
    average_rows: [Option<Coefficients>; 2],
}

/// Time constants up and down that differ by more than this factor, and by more than their errors, are reported. Chosen: at 1.2 the mean
/// of the time constants and that of the rates differ by 0.8 % only, so one lag serves both directions.
const ASYMMETRY_FACTOR: f64 = 1.2;
/// Most of the steps that may be left out as contradicting the others. Chosen: more than a quarter are no exceptions but scatter, which
/// the intervals are to hold.
const MOST_LEFT_OUT: f64 = 0.25;
/// Level of the test that leaves them out, over all of them. Chosen: one sound record in a hundred loses a step.
const CONTRADICTION_LEVEL: f64 = 0.01;
/// Steps from which on their own scatter is estimated. Chosen: 4 degrees of freedom know a standard deviation to 35 %, `1 / sqrt(8)`; fewer
/// would often find none by chance.
const FEWEST_FOR_SCATTER: usize = 5;
/// By how much time constants of single steps differ beyond their own errors, as a standard deviation of the logarithm; fewer steps differ
/// by at least this. Tuned on five logs of thrust stands: the most that was seen.
const USUAL_SCATTER: f64 = 0.15;
/// The largest deviation of steps that is searched, of the logarithm. Chosen: a factor of 20, `e^3`, which no staircase has.
const MOST_BETWEEN_STD: f64 = 3.0;
/// Halvings of the interval in which the variance between steps is searched. Derived: to `3^2 / 2^24`, 5e-7, or 0.0007 of the logarithm.
const BISECTIONS: usize = 24;

impl TimeConstantCurve {
    /// The curve through some readings; which of them contradict the others comes with it. `None` without any.
    ///
    /// `common` is an error, of one standard deviation, that all readings have together: the curve's band holds it, and its weights do not
    /// rest on it.
    pub(super) fn fit(
        readings: &[StepTimeConstant],
        covariance: &DMatrix<f64>,
        common: &DVector<f64>,
    ) -> Option<(Self, Vec<(usize, f64)>)> {
        let mut used: Vec<usize> = (0..readings.len()).collect();
        let mut left_out = Vec::new();
        let most = (MOST_LEFT_OUT * readings.len() as f64) as usize;
        while left_out.len() < most
            && let Some((place, ratio)) = farthest(readings, (covariance, common), &used)
        {
            left_out.push((used.remove(place), ratio));
        }
        Some((fit(readings, (covariance, common), &used)?, left_out))
    }

    /// Whether a step of its range leads there.
    #[must_use]
    pub fn holds(&self, command: f64) -> bool {
        (self.range.0..=self.range.1).contains(&command)
    }

    /// The time constant of small motions about an operating point, seconds: `2 / (1 / tau_up + 1 / tau_down)`, since small
    /// motions go both ways. A frequency response sees a lag that is between its two: near the mean of
    /// the time constants at low frequency, near that of the rates at high. The two means differ by 4 % when one
    /// direction is half as slow again. Of them the shorter is taken, as a compensator built on a time constant
    /// that is too long leads too much and overshoots. Use [`Estimate::interval_of_logarithm`].
    #[must_use]
    pub fn at(&self, command: f64) -> Estimate {
        // log tau = f + log 2 - log(1 + e^-d), whose derivative by d is 1 / (1 + e^d).
        let apart = self.coefficients[TERMS - 1];
        let log_up = row(command, 0.0).dot(&self.coefficients);
        self.estimate(log_up + 2.0_f64.ln() - (-apart).exp().ln_1p(), &row(command, 1.0 / (1.0 + apart.exp())))
    }

    /// The time constant of steps in one direction to a command, seconds.
    #[must_use]
    pub fn toward(&self, command: f64, direction: Direction) -> Estimate {
        let row = row_toward(command, direction);
        self.estimate(row.dot(&self.coefficients), &row)
    }

    /// The time constant of steps down over that of steps up.
    #[must_use]
    pub fn down_over_up(&self) -> Estimate {
        self.estimate(self.coefficients[TERMS - 1], &Coefficients::ith(TERMS - 1, 1.0))
    }

    /// The time constant of steps down over that of steps up, where they are known to differ and by more than is worth a word.
    #[must_use]
    pub fn asymmetry(&self) -> Option<f64> {
        let ratio = self.down_over_up();
        let differs = ratio.excludes(1.0) && !(1.0 / ASYMMETRY_FACTOR..=ASYMMETRY_FACTOR).contains(&ratio.value);
        differs.then_some(ratio.value)
    }

    /// The time constant of the steps in one direction, averaged over them as they were recorded, seconds; `None` without any.
    #[must_use]
    pub fn average(&self, direction: Direction) -> Option<Estimate> {
        let row = self.average_rows[usize::from(direction == Direction::Down)]?;
        Some(self.estimate(row.dot(&self.coefficients), &row))
    }

    /// The curve at some commands, of which those beyond the steps that it rests on are left out.
    #[must_use]
    pub fn band(&self, commands: impl Iterator<Item = f64>) -> TimeConstantBand {
        let mut band = TimeConstantBand {
            nominal: vec![],
            time_constant_s: vec![],
            low_s: vec![],
            high_s: vec![],
            down_over_up: self.asymmetry(),
        };
        for command in commands.filter(|command| self.holds(*command)) {
            let tau = self.at(command);
            let (low_s, high_s) = tau.interval_of_logarithm(0.95);
            band.nominal.push(command);
            band.time_constant_s.push(tau.value);
            band.low_s.push(low_s);
            band.high_s.push(high_s);
        }
        band
    }

    /// Degrees of freedom behind its band.
    pub(super) fn dof(&self) -> f64 {
        self.dof
    }

    /// `e^value` of a linear combination of the coefficients.
    fn estimate(&self, value: f64, row: &Coefficients) -> Estimate {
        let std = row.dot(&(self.covariance * row)).max(0.0).sqrt();
        Estimate { value: value.exp(), std: value.exp() * std, dof: self.dof }
    }
}

/// What the coefficients are multiplied with; `down` is the share of steps down that is asked for.
fn row(command: f64, down: f64) -> Coefficients {
    let v = command - 0.5;
    Coefficients::new(1.0, v, v * v, down)
}

fn row_toward(command: f64, direction: Direction) -> Coefficients {
    row(command, if direction == Direction::Down { 1.0 } else { 0.0 })
}

/// The reading that is farthest from what the others say, where that is too far: its place in `used`, and its ratio to them.
fn farthest(readings: &[StepTimeConstant], errors: Errors<'_>, used: &[usize]) -> Option<(usize, f64)> {
    let mut worst: Option<(usize, f64, f64)> = None;
    for place in 0..used.len() {
        let mut others = used.to_vec();
        let own = others.remove(place);
        let reading = &readings[own];
        let curve = fit(readings, errors, &others)?;
        let row = row_toward(reading.command, reading.direction);
        let apart = reading.log_tau - row.dot(&curve.coefficients);
        let variance = row.dot(&(curve.covariance * row)) + curve.between_std.powi(2) + errors.0[(own, own)];
        let far = apart.abs() / variance.sqrt();
        let reach = t_quantile(1.0 - 0.5 * CONTRADICTION_LEVEL / used.len() as f64, curve.dof);
        if far > reach && worst.is_none_or(|(_, most, _)| far / reach > most) {
            worst = Some((place, far / reach, apart.exp()));
        }
    }
    worst.map(|(place, _, ratio)| (place, ratio))
}

/// The covariance of readings, and an error that all have together.
type Errors<'a> = (&'a DMatrix<f64>, &'a DVector<f64>);

/// Generalized least squares with the variance between steps. What is known beforehand are further observations.
fn fit(readings: &[StepTimeConstant], (covariance, common): Errors<'_>, used: &[usize]) -> Option<TimeConstantCurve> {
    let count = used.len();
    if count == 0 {
        return None;
    }
    let rows: Vec<Coefficients> =
        used.iter().map(|&k| row_toward(readings[k].command, readings[k].direction)).collect();
    let x = DMatrix::from_fn(count, TERMS, |i, j| rows[i][j]);
    let y = DVector::from_iterator(count, used.iter().map(|&k| readings[k].log_tau));
    let own = DMatrix::from_fn(count, count, |i, j| covariance[(used[i], used[j])]);
    let common = DVector::from_iterator(count, used.iter().map(|&k| common[k]));
    let at = |between: f64| -> Option<(Coefficients, Covariance, f64)> {
        let v = Cholesky::new(&own + DMatrix::from_diagonal_element(count, count, between))?;
        let vx = v.solve(&x);
        let (product, right) = (x.tr_mul(&vx), vx.tr_mul(&y));
        let mut normal = Covariance::from_fn(|i, j| product[(i, j)]);
        let mut right = Coefficients::from_fn(|i, _| right[i]);
        for (term, (mean, std)) in (1..).zip(PRIOR) {
            normal[(term, term)] += 1.0 / (std * std);
            right[term] += mean / (std * std);
        }
        let covariance = normal.cholesky()?.inverse();
        let coefficients = covariance * right;
        let off = vx.tr_mul(&common);
        let off = covariance * Coefficients::from_fn(|i, _| off[i]);
        let left = &y - DVector::from_fn(count, |i, _| rows[i].dot(&coefficients));
        let of_prior = (1..).zip(PRIOR).map(|(term, (mean, std))| ((coefficients[term] - mean) / std).powi(2));
        Some((coefficients, covariance + off * off.transpose(), left.dot(&v.solve(&left)) + of_prior.sum::<f64>()))
    };
    // All observations less all coefficients: the constant alone has no prior.
    let dof = (count - 1) as f64;
    let says_scatter = count >= FEWEST_FOR_SCATTER;
    let least = if says_scatter { 0.0 } else { USUAL_SCATTER * USUAL_SCATTER };
    let (mut low, mut high) = (least, least);
    // One step alone differs from nothing.
    if count > 1 && at(least)?.2 > dof {
        high = MOST_BETWEEN_STD * MOST_BETWEEN_STD;
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if at(middle)?.2 > dof { low = middle } else { high = middle }
        }
    }
    let (coefficients, covariance, _) = at(high)?;
    let commands = || used.iter().map(|&k| readings[k].command);
    let average_rows = [Direction::Up, Direction::Down].map(|direction| {
        let own = || used.iter().zip(&rows).filter(|(k, _)| readings[**k].direction == direction).map(|(_, row)| row);
        (own().count() > 0).then(|| own().sum::<Coefficients>() / own().count() as f64)
    });
    Some(TimeConstantCurve {
        range: (commands().fold(f64::INFINITY, f64::min), commands().fold(f64::NEG_INFINITY, f64::max)),
        steps: count,
        between_std: high.sqrt(),
        coefficients,
        covariance,
        dof: if says_scatter { dof } else { f64::INFINITY },
        average_rows,
    })
}
