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
//! with `v` the command, moved and scaled to -1..1. The last term is the initial condition. A command stands
//! still from row to row, so all of this is exact at any time, and so are the derivatives.
//!
//! Where both logs have the response, there is no lag between the two: `x_1 = v`, the command log's response with a first-order hold
//! between rows, and its initial condition falls away.

use std::ops::Range;

use nalgebra::DMatrix;
use rotorlead_numerics::autoregression::whiten;
use rotorlead_numerics::least_squares::Residuals;

use super::logs::DriveKind;

pub(super) const DELAY: usize = 0;
const OFFSET: usize = 1;
/// Index of the first gain. The last gain is followed by the skew, the logarithm of the time constant and the initial condition, each only
/// where it is fitted.
pub(super) const GAIN: usize = 2;
/// Highest power of the command. Chosen: thrust goes with the square, and a cubic takes its bend; a delay needs no better map.
pub(super) const MOST_POWERS: usize = 3;

/// Weight of a Gaussian prior that holds the initial state at zero: without it a state that has gone before the first whitened row leaves
/// the problem without a solution. Chosen: it counts as a millionth of the first row and moves no state that rows show.
const START_TIE: f64 = 1e-3;

/// The data and what is held fixed.
#[derive(Clone, Debug)]
pub(super) struct AlignmentProblem<'a> {
    /// Times of the command's rows on its own clock.
    pub(super) command_time_s: &'a [f64],
    /// Scaled commands, or the command log's response.
    pub(super) drive: &'a [f64],
    pub(super) kind: DriveKind,
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
    /// Whether the skew is fitted; else it is zero.
    pub(super) skew: bool,
    /// Autoregression of the noise.
    pub(super) color: Vec<f64>,
}

/// The lag's state at one time, and its derivatives by the logarithm of the time constant.
#[derive(Clone, Copy, Default)]
struct LagState {
    x: [f64; MOST_POWERS],
    by_lag: [f64; MOST_POWERS],
    /// Its rate, per second.
    rate: [f64; MOST_POWERS],
}

impl AlignmentProblem<'_> {
    pub(super) fn parameters(&self) -> usize {
        let of_lag = if self.kind == DriveKind::Command { 2 } else { 0 };
        GAIN + self.powers + usize::from(self.skew) + of_lag
    }

    /// Index of the skew, where it is fitted.
    pub(super) fn skew_index(&self) -> usize {
        GAIN + self.powers
    }

    /// Index of the logarithm of the time constant, where there is a lag; that of the initial condition is the next.
    pub(super) fn lag_index(&self) -> Option<usize> {
        (self.kind == DriveKind::Command).then_some(GAIN + self.powers + usize::from(self.skew))
    }

    /// Time constant in seconds; zero without a lag.
    pub(super) fn time_constant_s(&self, p: &[f64]) -> f64 {
        self.lag_index().map_or(0.0, |lag| p[lag].exp())
    }

    pub(super) fn skew(&self, p: &[f64]) -> f64 {
        if self.skew { p[self.skew_index()] } else { 0.0 }
    }

    /// Visits each row with its number, its time on the command's clock and the state there; false where the parameters are none.
    fn march(&self, p: &[f64], visit: impl FnMut(usize, f64, &LagState)) -> bool {
        let skew = self.skew(p);
        let times = self.time_s.iter().map(|t| self.reference_s - p[DELAY] + (t - self.reference_s) / (1.0 + skew));
        match self.lag_index() {
            // Chosen: far beyond any clock, and time still runs forward.
            _ if skew.abs() >= 0.5 => false,
            Some(lag) => self.march_lagged(p[lag].exp(), times, visit),
            None => {
                self.march_first_order_hold(times, visit);
                true
            }
        }
    }

    fn march_lagged(
        &self,
        tau: f64,
        times: impl Iterator<Item = f64>,
        mut visit: impl FnMut(usize, f64, &LagState),
    ) -> bool {
        // Chosen: far beyond any rotor to either side, so that the exponentials stay numbers.
        if !(tau > 1e-6 && tau < 1e3) {
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
        let mut to = toward(self.drive[0]);
        let mut state = LagState { x: to, ..LagState::default() };
        let (mut now, mut next) = (self.command_time_s[0], 1);
        let advance = |state: &mut LagState, to: &[f64; MOST_POWERS], by_s: f64| {
            let h = by_s / tau;
            let decay = (-h).exp();
            for ((x, by_lag), to) in state.x.iter_mut().zip(&mut state.by_lag).zip(to).take(self.powers) {
                let excess = *x - to;
                *by_lag = (*by_lag + excess * h) * decay;
                *x = to + excess * decay;
            }
        };
        for (row, s) in times.enumerate() {
            while next < self.drive.len() && self.command_time_s[next] <= s {
                advance(&mut state, &to, self.command_time_s[next] - now);
                now = self.command_time_s[next];
                to = toward(self.drive[next]);
                next += 1;
            }
            // Before the log begins nothing has changed yet.
            if s > now {
                advance(&mut state, &to, s - now);
                now = s;
            }
            for ((rate, x), to) in state.rate.iter_mut().zip(&state.x).zip(&to).take(self.powers) {
                *rate = (to - x) / tau;
            }
            visit(row, s, &state);
        }
        true
    }

    fn march_first_order_hold(&self, times: impl Iterator<Item = f64>, mut visit: impl FnMut(usize, f64, &LagState)) {
        let last = self.drive.len() - 1;
        let mut next = 1;
        for (row, s) in times.enumerate() {
            while next < last && self.command_time_s[next] <= s {
                next += 1;
            }
            let (from_s, to_s) = (self.command_time_s[next - 1], self.command_time_s[next]);
            let (from, to) = (self.drive[next - 1], self.drive[next]);
            let rate = (to - from) / (to_s - from_s);
            let mut state = LagState::default();
            // Beyond its ends the log goes on as it is there.
            state.x[0] = from + rate * (s.clamp(from_s, to_s) - from_s);
            state.rate[0] = if (from_s..to_s).contains(&s) { rate } else { 0.0 };
            visit(row, s, &state);
        }
    }

    /// How much of the state in which the log began is left, and its derivative by the logarithm of the time constant.
    fn start(&self, s: f64, tau: f64) -> (f64, f64) {
        let elapsed = ((s - self.start_s) / tau).max(0.0);
        let remaining = (-elapsed).exp();
        (remaining, remaining * elapsed)
    }

    /// The columns that the linear parameters multiply, at `p`'s delay, lag and skew; row by row. Offset and gains, and last the
    /// initial condition where there is one.
    pub(super) fn regressors(&self, p: &[f64]) -> Option<DMatrix<f64>> {
        let start = self.lag_index().map(|_| 1 + self.powers);
        let mut columns = DMatrix::zeros(self.time_s.len(), 1 + self.powers + usize::from(start.is_some()));
        let tau = self.time_constant_s(p);
        self.march(p, |row, s, state| {
            columns[(row, 0)] = 1.0;
            for j in 0..self.powers {
                columns[(row, 1 + j)] = state.x[j];
            }
            if let Some(start) = start {
                columns[(row, start)] = self.start(s, tau).0;
            }
        })
        .then_some(columns)
    }
}

impl Residuals for AlignmentProblem<'_> {
    /// The rows, and the prior of the initial condition.
    fn count(&self) -> usize {
        self.time_s.len() + usize::from(self.lag_index().is_some())
    }

    fn evaluate(&self, p: &[f64], out: &mut [f64]) -> bool {
        let tau = self.time_constant_s(p);
        let initial = self.lag_index().map(|lag| p[lag + 1]);
        let ok = self.march(p, |row, s, state| {
            let moved: f64 = state.x[..self.powers].iter().zip(&p[GAIN..]).map(|(x, g)| g * x).sum();
            let from_start = initial.map_or(0.0, |initial| initial * self.start(s, tau).0);
            out[row] = p[OFFSET] + from_start + moved - self.response[row];
        });
        whiten(out, self.runs, &self.color);
        if let Some(initial) = initial {
            out[self.time_s.len()] = START_TIE * initial;
        }
        ok
    }

    fn jacobian(&self, p: &[f64], out: &mut DMatrix<f64>) -> bool {
        out.fill(0.0);
        let (tau, rate) = (self.time_constant_s(p), 1.0 + self.skew(p));
        let ok = self.march(p, |row, s, state| {
            let (mut slope, mut by_lag) = (0.0, 0.0);
            for j in 0..self.powers {
                let gain = p[GAIN + j];
                slope += gain * state.rate[j];
                by_lag += gain * state.by_lag[j];
                out[(row, GAIN + j)] = state.x[j];
            }
            if let Some(lag) = self.lag_index() {
                let initial = p[lag + 1];
                let (remaining, remaining_by_lag) = self.start(s, tau);
                slope += if s > self.start_s { -initial * remaining / tau } else { 0.0 };
                out[(row, lag)] = by_lag + initial * remaining_by_lag;
                out[(row, lag + 1)] = remaining;
            }
            out[(row, DELAY)] = -slope;
            out[(row, OFFSET)] = 1.0;
            if self.skew {
                out[(row, self.skew_index())] = -slope * (self.time_s[row] - self.reference_s) / (rate * rate);
            }
        });
        for mut column in out.column_iter_mut() {
            whiten(column.as_mut_slice(), self.runs, &self.color);
        }
        if let Some(lag) = self.lag_index() {
            out[(self.time_s.len(), lag + 1)] = START_TIE;
        }
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
        let lagged = AlignmentProblem {
            command_time_s: &command_time_s,
            drive: &command,
            kind: DriveKind::Command,
            time_s: &time_s,
            response: &response,
            runs: &[0..40, 40..90],
            start_s: -0.01,
            reference_s: 0.45,
            powers: 3,
            skew: true,
            color: vec![0.6, -0.2],
        };
        check(&lagged, &[0.0123, 0.4, 1.1, -0.3, 0.15, 0.002, (0.07f64).ln(), 0.2]);
        let held = AlignmentProblem { kind: DriveKind::Response, powers: 1, ..lagged };
        check(&held, &[0.0123, 0.4, 1.1, 0.002]);
    }

    fn check(problem: &AlignmentProblem<'_>, p: &[f64]) {
        assert_eq!(p.len(), problem.parameters());
        let rows = problem.count();
        let mut exact = DMatrix::zeros(rows, p.len());
        assert!(problem.jacobian(p, &mut exact));
        let (mut ahead, mut behind) = (vec![0.0; rows], vec![0.0; rows]);
        for j in 0..p.len() {
            let h = 1e-7;
            let (mut high, mut low) = (p.to_vec(), p.to_vec());
            high[j] += h;
            low[j] -= h;
            assert!(problem.evaluate(&high, &mut ahead) && problem.evaluate(&low, &mut behind));
            for row in 0..rows {
                let difference = (ahead[row] - behind[row]) / (2.0 * h);
                assert!((difference - exact[(row, j)]).abs() < 1e-6, "{row} {j}: {difference} {}", exact[(row, j)]);
            }
        }
    }
}
