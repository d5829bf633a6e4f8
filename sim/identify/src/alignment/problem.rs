//! Delay, skew and lag as one least-squares problem.
//!
//! The response at the logger's time `t` is that of the command's time
//!
//! `s = t_ref - D + (t - t_ref) / (1 + sigma)`
//!
//! through a first-order lag behind a static polynomial (a Hammerstein model, Ljung section 5.2):
//!
//! `y(t) = offset + sum_j g_j x_j(s) + g_0 e^(-(s - s_start) / tau)`, `tau dx_j/ds = v^j - x_j`
//!
//! with `v` the command, moved and scaled to -1..1. The last term is the state in which the log begins. A command stands
//! still from row to row, so all of this is exact at any time, and so are the derivatives.

use std::ops::Range;

use nalgebra::DMatrix;
use rotorlead_numerics::least_squares::Residuals;

use super::color::whiten;

pub(super) const DELAY: usize = 0;
/// The logarithm of the time constant.
pub(super) const LAG: usize = 1;
const OFFSET: usize = 2;
const START: usize = 3;
pub(super) const GAIN: usize = 4;
/// Powers of the command at most.
pub(super) const MOST_POWERS: usize = 3;

/// Ties the initial state to zero by a thousand times the response's own scale: it has gone before the first whitened row
/// where the noise has a long memory, and would else leave the problem without a solution.
const START_TIE: f64 = 1e-3;

/// The data and what is held fixed.
#[derive(Clone, Debug)]
pub(super) struct Problem<'a> {
    /// Times of the command's rows on its own clock.
    pub(super) command_time_s: &'a [f64],
    /// Scaled commands.
    pub(super) command: &'a [f64],
    /// Rows of the response.
    pub(super) time_s: &'a [f64],
    /// Scaled response.
    pub(super) response: &'a [f64],
    /// Segments of rows without a gap.
    pub(super) runs: &'a [Range<usize>],
    /// When the response log begins, on the command's clock and nearly.
    pub(super) start_s: f64,
    /// Where the delay is counted, on the logger's clock.
    pub(super) reference_s: f64,
    /// Powers of the command, 1 to [`MOST_POWERS`].
    pub(super) powers: usize,
    /// Whether the skew is the last parameter; else it is zero.
    pub(super) skew: bool,
    /// Autoregression of the noise.
    pub(super) color: Vec<f64>,
}

/// The lag's state at one time, and its derivatives by the logarithm of the time constant.
#[derive(Clone, Copy, Default)]
struct State {
    x: [f64; MOST_POWERS],
    by_lag: [f64; MOST_POWERS],
    /// What it moves toward.
    to: [f64; MOST_POWERS],
}

impl Problem<'_> {
    pub(super) fn parameters(&self) -> usize {
        GAIN + self.powers + usize::from(self.skew)
    }

    /// Index of the skew, where it is fitted.
    pub(super) fn skew_index(&self) -> usize {
        GAIN + self.powers
    }

    pub(super) fn skew_of(&self, p: &[f64]) -> f64 {
        if self.skew { p[self.skew_index()] } else { 0.0 }
    }

    /// Visits each row with its number, its time on the command's clock and the state there.
    fn march(&self, p: &[f64], mut visit: impl FnMut(usize, f64, &State)) -> bool {
        let (skew, tau) = (self.skew_of(p), p[LAG].exp());
        if !(skew.abs() < 0.5 && tau > 1e-6 && tau < 1e3) {
            return false;
        }
        let toward = |v: f64| {
            let mut to = [0.0; MOST_POWERS];
            let mut power = 1.0;
            for to in &mut to[..self.powers] {
                power *= v;
                *to = power;
            }
            to
        };
        let mut state = State { to: toward(self.command[0]), ..State::default() };
        state.x = state.to;
        let (mut now, mut next) = (self.command_time_s[0], 1);
        let advance = |state: &mut State, by_s: f64| {
            let h = by_s / tau;
            let decay = (-h).exp();
            for j in 0..self.powers {
                let excess = state.x[j] - state.to[j];
                state.by_lag[j] = (state.by_lag[j] + excess * h) * decay;
                state.x[j] = state.to[j] + excess * decay;
            }
        };
        for (row, t) in self.time_s.iter().enumerate() {
            let s = self.reference_s - p[DELAY] + (t - self.reference_s) / (1.0 + skew);
            while next < self.command.len() && self.command_time_s[next] <= s {
                advance(&mut state, self.command_time_s[next] - now);
                now = self.command_time_s[next];
                state.to = toward(self.command[next]);
                next += 1;
            }
            // Before the log begins nothing has changed yet.
            if s > now {
                advance(&mut state, s - now);
                now = s;
            }
            visit(row, s, &state);
        }
        true
    }

    /// How much of the state in which the log began is left, and its derivative by the logarithm of the time constant.
    fn start(&self, s: f64, tau: f64) -> (f64, f64) {
        let elapsed = ((s - self.start_s) / tau).max(0.0);
        let left = (-elapsed).exp();
        (left, left * elapsed)
    }

    /// The columns that the linear parameters multiply, at `p`'s delay, lag and skew; row by row.
    pub(super) fn regressors(&self, p: &[f64]) -> Option<DMatrix<f64>> {
        let mut columns = DMatrix::zeros(self.time_s.len(), 2 + self.powers);
        let tau = p[LAG].exp();
        self.march(p, |row, s, state| {
            columns[(row, 0)] = 1.0;
            columns[(row, 1)] = self.start(s, tau).0;
            for j in 0..self.powers {
                columns[(row, 2 + j)] = state.x[j];
            }
        })
        .then_some(columns)
    }
}

impl Residuals for Problem<'_> {
    /// The rows, and the tie of the state in which the log begins.
    fn count(&self) -> usize {
        self.time_s.len() + 1
    }

    fn evaluate(&self, p: &[f64], out: &mut [f64]) -> bool {
        let tau = p[LAG].exp();
        let ok = self.march(p, |row, s, state| {
            let moved: f64 = state.x[..self.powers].iter().zip(&p[GAIN..]).map(|(x, g)| g * x).sum();
            out[row] = p[OFFSET] + p[START] * self.start(s, tau).0 + moved - self.response[row];
        });
        whiten(out, self.runs, &self.color);
        out[self.time_s.len()] = START_TIE * p[START];
        ok
    }

    fn jacobian(&self, p: &[f64], out: &mut DMatrix<f64>) -> bool {
        out.fill(0.0);
        let (tau, rate) = (p[LAG].exp(), 1.0 + self.skew_of(p));
        let ok = self.march(p, |row, s, state| {
            let (left, left_by_lag) = self.start(s, tau);
            let fading = if s > self.start_s { -p[START] * left / tau } else { 0.0 };
            let (mut slope, mut by_lag) = (fading, p[START] * left_by_lag);
            for j in 0..self.powers {
                let gain = p[GAIN + j];
                slope += gain * (state.to[j] - state.x[j]) / tau;
                by_lag += gain * state.by_lag[j];
                out[(row, GAIN + j)] = state.x[j];
            }
            out[(row, DELAY)] = -slope;
            out[(row, LAG)] = by_lag;
            out[(row, OFFSET)] = 1.0;
            out[(row, START)] = left;
            if self.skew {
                out[(row, self.skew_index())] = -slope * (self.time_s[row] - self.reference_s) / (rate * rate);
            }
        });
        for mut column in out.column_iter_mut() {
            whiten(column.as_mut_slice(), self.runs, &self.color);
        }
        out[(self.time_s.len(), START)] = START_TIE;
        ok
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_those_of_the_residuals() {
        let command_time_s = [0.0, 0.1, 0.25, 0.31, 0.6];
        let command = [-1.0, 0.3, 1.0, -0.4, 0.7];
        let time_s: Vec<f64> = (0..90).map(|k| 0.0107 * f64::from(k)).collect();
        let response = vec![0.0; 90];
        let problem = Problem {
            command_time_s: &command_time_s,
            command: &command,
            time_s: &time_s,
            response: &response,
            runs: &[0..40, 40..90],
            start_s: -0.01,
            reference_s: 0.45,
            powers: 3,
            skew: true,
            color: vec![0.6, -0.2],
        };
        let p = [0.0123, (0.07f64).ln(), 0.4, 0.2, 1.1, -0.3, 0.15, 0.002];
        let mut exact = DMatrix::zeros(91, p.len());
        assert!(problem.jacobian(&p, &mut exact));
        let (mut ahead, mut behind) = (vec![0.0; 91], vec![0.0; 91]);
        for j in 0..p.len() {
            let h = 1e-7;
            let (mut high, mut low) = (p, p);
            high[j] += h;
            low[j] -= h;
            assert!(problem.evaluate(&high, &mut ahead) && problem.evaluate(&low, &mut behind));
            for row in 0..91 {
                let difference = (ahead[row] - behind[row]) / (2.0 * h);
                assert!((difference - exact[(row, j)]).abs() < 1e-6, "{row} {j}: {difference} {}", exact[(row, j)]);
            }
        }
    }
}
