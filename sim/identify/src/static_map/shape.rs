//! One candidate for the static map, fitted to the steady points.
//!
//! `y = sum_j b_j z^j`, `z = (min(u -+ w/2, L) - c) / h`: a polynomial of degree `n` in the command, which the hysteresis
//! moves by half its width `w` (to the right for levels reached from below, as play does) and the limit `L` cuts off.
//! `c` and `h`, the middle and half the range of the commands, keep the powers apart.

use nalgebra::DMatrix;
use rotorlead_numerics::least_squares::{Residuals, Solution, StoppingCriteria, minimize};

use super::points::SteadyPoint;
use crate::lag::steps::{Direction, SAME_LEVEL};

/// Which terms a candidate has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MapTerms {
    pub(super) degree: usize,
    pub(super) hysteresis: bool,
    pub(super) limit: bool,
    pub(super) center: f64,
    pub(super) half_range: f64,
}

impl MapTerms {
    pub(super) fn parameter_count(&self) -> usize {
        self.degree + 1 + usize::from(self.hysteresis) + usize::from(self.limit)
    }

    /// Index of the hysteresis' width.
    pub(super) fn hysteresis_index(&self) -> Option<usize> {
        self.hysteresis.then_some(self.degree + 1)
    }

    /// Index of the limit.
    pub(super) fn limit_index(&self) -> Option<usize> {
        self.limit.then_some(self.degree + 1 + usize::from(self.hysteresis))
    }

    /// The map at `command` for a level reached in `direction`; `None` for the middle of both.
    pub(super) fn response(&self, p: &[f64], command: f64, direction: Option<Direction>) -> f64 {
        let half_width = self.hysteresis_index().map_or(0.0, |k| 0.5 * p[k]);
        let moved = match direction {
            Some(Direction::Up) => command - half_width,
            Some(Direction::Down) => command + half_width,
            None => command,
        };
        let limited = self.limit_index().map_or(moved, |k| moved.min(p[k]));
        let z = (limited - self.center) / self.half_range;
        p[..=self.degree].iter().rev().fold(0.0, |sum, b| sum * z + b)
    }

    /// Derivatives of [`Self::response`] in the middle of both directions by the parameters, by central differences.
    pub(super) fn gradient(&self, p: &[f64], command: f64) -> Vec<f64> {
        // Derived: near the cube root of the rounding unit, 6e-6, rounding and the cubic term balance; 1e-3 is for parameters near zero.
        (0..p.len())
            .map(|j| {
                let step = 1e-6 * p[j].abs().max(1e-3);
                let (mut high, mut low) = (p.to_vec(), p.to_vec());
                high[j] += step;
                low[j] -= step;
                (self.response(&high, command, None) - self.response(&low, command, None)) / (2.0 * step)
            })
            .collect()
    }

    /// Coefficients in powers of the command itself are this matrix times those in powers of `z`.
    pub(super) fn expansion(&self) -> DMatrix<f64> {
        let n = self.degree;
        let mut matrix = DMatrix::zeros(n + 1, n + 1);
        for j in 0..=n {
            // (u - c)^j / h^j, term by term.
            let mut binomial = 1.0;
            for i in (0..=j).rev() {
                matrix[(i, j)] = binomial * (-self.center).powi((j - i) as i32) / self.half_range.powi(j as i32);
                binomial *= i as f64 / (j - i + 1) as f64;
            }
        }
        matrix
    }
}

/// The residuals of a shape.
struct MapProblem<'a> {
    shape: MapTerms,
    points: &'a [SteadyPoint],
    /// Standard error of each point.
    std: &'a [f64],
    /// What the response is about.
    scale: f64,
}

impl Residuals for MapProblem<'_> {
    fn count(&self) -> usize {
        self.points.len()
    }

    fn evaluate(&self, p: &[f64], out: &mut [f64]) -> bool {
        for ((out, point), std) in out.iter_mut().zip(self.points).zip(self.std) {
            *out = (self.shape.response(p, point.command, Some(point.direction)) - point.response) / std;
        }
        // Chosen: twice the range of commands, and a hysteresis of half of it; beyond, the search has run away.
        self.shape.limit_index().is_none_or(|k| (0.0..=2.0).contains(&p[k]))
            && self.shape.hysteresis_index().is_none_or(|k| p[k].abs() < 0.5)
    }

    /// Chosen: widths and limits in command are of the order of a percent.
    fn typical(&self, index: usize) -> f64 {
        if index <= self.shape.degree { self.scale } else { 0.01 }
    }
}

/// Where the limit is looked for, as shares of the range of commands: a third of it at the top. Chosen: closer together toward the top,
/// where a limit cuts off few levels; the kink keeps a search between the levels where it starts.
const LIMIT_STARTS: [f64; 6] = [0.66, 0.74, 0.81, 0.87, 0.92, 0.97];

/// The least-squares fit of a shape, which leaves `least_dof` degrees of freedom or more; `None` where the points do not determine it.
pub(super) fn fit(shape: MapTerms, points: &[SteadyPoint], std: &[f64], least_dof: usize) -> Option<Solution> {
    if points.len() < shape.parameter_count() + least_dof {
        return None;
    }
    let scale = points.iter().map(|p| p.response.abs()).fold(f64::MIN_POSITIVE, f64::max);
    let problem = MapProblem { shape, points, std, scale };
    let low = shape.center - shape.half_range;
    let limits: Vec<f64> = if shape.limit {
        LIMIT_STARTS.iter().map(|share| low + 2.0 * shape.half_range * share).collect()
    } else {
        vec![f64::INFINITY]
    };
    let mut best: Option<Solution> = None;
    for limit in limits {
        let columns = DMatrix::from_fn(points.len(), shape.degree + 1, |row, j| {
            ((points[row].command.min(limit) - shape.center) / shape.half_range).powi(j as i32) / std[row]
        });
        let right = nalgebra::DVector::from_fn(points.len(), |row, _| points[row].response / std[row]);
        // Chosen: beneath 1e-12 a singular value is rounding.
        let linear = rotorlead_numerics::linear::linear_least_squares(columns, &right, 1e-12)?;
        let mut start = vec![0.0; shape.parameter_count()];
        start[..=shape.degree].copy_from_slice(linear.as_slice());
        if let Some(k) = shape.limit_index() {
            start[k] = limit;
        }
        if let Some(found) = minimize(&problem, &start, StoppingCriteria::default())
            && found.unit_covariance.is_some()
            && best.as_ref().is_none_or(|b| found.sum_of_squares < b.sum_of_squares)
        {
            best = Some(found);
        }
    }
    // A limit is where the response is the same at two levels or more: one alone is the end of a curve.
    let top = points.iter().map(|p| p.command).fold(f64::NEG_INFINITY, f64::max);
    let second = points.iter().map(|p| p.command).filter(|u| *u < top - SAME_LEVEL).fold(f64::NEG_INFINITY, f64::max);
    best.filter(|s| shape.limit_index().is_none_or(|k| s.parameters[k] < second))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coefficients_in_powers_of_the_command_give_the_same_polynomial() {
        let shape = MapTerms { degree: 4, hysteresis: false, limit: false, center: 0.45, half_range: 0.3 };
        let b = [3.0, -2.0, 0.7, 1.1, -0.4];
        let c = shape.expansion() * nalgebra::DVector::from_column_slice(&b);
        for u in [0.0, 0.2, 0.45, 0.9] {
            let direct: f64 = c.iter().rev().fold(0.0, |sum, c| sum * u + c);
            assert!((direct - shape.response(&b, u, None)).abs() < 1e-10, "{u}");
        }
    }
}
