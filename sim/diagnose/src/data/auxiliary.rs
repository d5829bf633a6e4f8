//! What records that repeat have beside the response, heard where the response alone cannot tell two kinds.
//!
//! The speed and the voltage come with sensors of their own, whose faults would be named where they are fitted like the response.
//! So they have no say in what the response tells. Of kinds that it leaves within chance of each other, each column is
//! compared with what they make of it, on the lines that a period has, over the noise that is between these lines. The kind
//! that leaves least sets how well a column can be known: with `Q` of `n` numbers left by the best, a kind that leaves
//! `Q'` is worth `(Q - Q') / (2 max(1, Q / n))` less (quasi-likelihood; McCullagh and Nelder, Generalized Linear Models, 1989, ch. 9).

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use rotorlead_numerics::sample::mean;
use rotorlead_plant::Trace;
use rotorlead_records::{Output, Record as SourceRecord};

use super::columns::{Column, columns};
use crate::noise::whitening::{NoiseDensity, Whitening, dot};

/// From so many periods on the first one, in which what is slow comes to rest, is left out. Derived: two are needed to tell noise from
/// what repeats.
const SETTLED: usize = 3;
/// Part of a row by which a column may have been taken at another moment than the response: a standard deviation, anew for each record.
/// Sensors are read one after the other, and filter by themselves. Chosen: higher, a column tells no delay from a pole; lower, a logger's
/// order of reading names one.
const TAKEN_OFF: f64 = 0.1;

/// A column of a record that repeats.
#[derive(Clone, Debug)]
pub(crate) struct AuxiliaryChannel {
    /// Which one.
    pub column: Column,
    from: usize,
    periods: usize,
    mean: f64,
    rate_hz: f64,
    /// The white lines of a period.
    pub measured: Vec<Complex64>,
    whitening: Whitening,
}

/// The columns of a record over its whole periods. One period says nothing of the noise.
pub(crate) fn auxiliary_channels(
    source: &SourceRecord,
    output: Output,
    period_rows: usize,
    rate_hz: f64,
) -> Vec<AuxiliaryChannel> {
    let all = source.time_s.len() / period_rows;
    let from = if all >= SETTLED { period_rows } else { 0 };
    let periods = all - from / period_rows;
    if periods < 2 {
        return Vec::new();
    }
    let rows = from..from + periods * period_rows;
    let auxiliary = |(column, values): (Column, Vec<f64>)| {
        let mean = mean(&values);
        let deviation: Vec<f64> = values.iter().map(|value| value - mean).collect();
        let mut whitening = Whitening::unit(values.len());
        whitening.set_noise(&NoiseDensity::between_harmonics(&deviation, periods, rate_hz)?, rate_hz);
        let mut auxiliary = AuxiliaryChannel { column, from, periods, mean, rate_hz, measured: Vec::new(), whitening };
        auxiliary.measured = auxiliary.lines(&deviation);
        auxiliary.measured.iter().all(|line| line.is_finite()).then_some(auxiliary)
    };
    columns(source, output, rows).into_iter().filter_map(auxiliary).collect()
}

impl AuxiliaryChannel {
    /// The white lines that a period has.
    fn lines(&self, rows: &[f64]) -> Vec<Complex64> {
        let white = self.whitening.apply(rows);
        white.into_iter().skip(self.periods - 1).step_by(self.periods).collect()
    }

    /// The white lines that the model leaves of it: of the speed no parabola of what it says, of the voltage no multiple of it.
    pub fn residual(&self, trace: &Trace) -> Option<Vec<Complex64>> {
        let rows = self.from..self.from + self.whitening.rows();
        let cut = |values: &[f64]| values.get(rows.clone()).map(<[f64]>::to_vec);
        let supplied = !trace.voltage_v.is_empty();
        let cut = Trace {
            speed: cut(&trace.speed)?,
            voltage_v: if supplied { cut(&trace.voltage_v)? } else { Vec::new() },
            ..Trace::default()
        };
        let model = self.column.predicted(&cut, rows.len());
        let lines: Vec<Vec<Complex64>> = model.iter().map(|column| self.lines(column)).collect();
        let factors = match self.column {
            // Its mean says how high it is.
            Column::Voltage => {
                model.iter().map(|column| self.mean * column.len() as f64 / column.iter().sum::<f64>()).collect()
            }
            Column::Speed => nearest(&lines, &self.measured)?,
        };
        let mut left = self.measured.clone();
        let mut said = vec![Complex64::ZERO; left.len()];
        for (line, factor) in lines.iter().zip(&factors) {
            said.iter_mut().zip(line).for_each(|(said, model)| *said += model * factor);
        }
        left.iter_mut().zip(&said).for_each(|(left, said)| *left -= said);
        self.forgive_moment(&mut left, &said);
        Some(left)
    }

    /// Shortens what is left along what another moment of the column would make of it, as far as that may be the reason: with `d`
    /// the derivative by the moment, the covariance of the lines is `1 + d d' off^2`.
    fn forgive_moment(&self, left: &mut [Complex64], said: &[Complex64]) {
        let off_s = TAKEN_OFF / self.rate_hz;
        let rad_per_s = TAU * self.rate_hz * self.periods as f64 / self.whitening.rows() as f64;
        let by_moment = |(line, said): (usize, &Complex64)| said * Complex64::new(0.0, (line + 1) as f64 * rad_per_s);
        let derivative: Vec<Complex64> = said.iter().enumerate().map(by_moment).collect();
        let power = dot(&derivative, &derivative);
        if power > 0.0 {
            let keep = (1.0 + off_s * off_s * power).sqrt().recip();
            let share = (1.0 - keep) * dot(&derivative, left) / power;
            left.iter_mut().zip(&derivative).for_each(|(left, derivative)| *left -= derivative * share);
        }
    }
}

/// The factors of the sum of these columns that comes nearest. One that never moves has no lines but rounding, and none. Chosen: 1e-6 of
/// the noise, and singular values below 1e-9, are rounding; anything that counts is orders above either.
fn nearest(columns: &[Vec<Complex64>], measured: &[Complex64]) -> Option<Vec<f64>> {
    let lengths: Vec<f64> = columns.iter().map(|column| dot(column, column).sqrt()).collect();
    let moves: Vec<usize> = (0..columns.len()).filter(|&index| lengths[index] > 1e-6).collect();
    let mut factors = vec![0.0; columns.len()];
    if moves.is_empty() {
        return Some(factors);
    }
    let over = |i: usize, other: &[Complex64]| dot(&columns[moves[i]], other) / lengths[moves[i]];
    let cosine = |i: usize, j: usize| over(i, &columns[moves[j]]) / lengths[moves[j]];
    let right = DVector::from_fn(moves.len(), |i, _| over(i, measured));
    let cosines = DMatrix::from_fn(moves.len(), moves.len(), cosine);
    let solution = rotorlead_numerics::linear::linear_least_squares(cosines, &right, 1e-9)?;
    moves.iter().zip(solution.iter()).for_each(|(&index, factor)| factors[index] = factor / lengths[index]);
    Some(factors)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_that_never_moves_has_no_part_in_the_sum() {
        let line = |re: f64, im: f64| Complex64::new(re, im);
        let still = vec![line(0.0, 0.0), line(1e-9, 0.0)];
        let moving = vec![line(1.0, 1.0), line(0.0, -2.0)];
        let measured: Vec<Complex64> = moving.iter().map(|line| 3.0 * line).collect();
        let factors = nearest(&[still.clone(), moving], &measured).unwrap();
        assert!(factors[0] == 0.0 && (factors[1] - 3.0).abs() < 1e-12, "{factors:?}");
        assert_eq!(nearest(&[still], &measured), Some(vec![0.0]));
    }
}
