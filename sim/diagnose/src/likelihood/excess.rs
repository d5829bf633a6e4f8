//! Excess of a hypothesis's residual over the noise.
//!
//! A record that repeats is compared on the lines of its period, which hold the signal, the model error and noise. `sum |z|^2` of the
//! white residual over `n` lines is a chi-square of `2 n` degrees of freedom where only noise is left. A record that does not repeat is
//! compared row by row: the square of the residual over the variance of the noise there is 1 on average where only noise is left, and
//! rows of correlated noise count as fewer.

use serde::Serialize;

/// The noise density rests on about half as many lines, at two numbers each, so its own error adds to that of a sum over many. Chosen:
/// half or twice as many change a significance by 6 % at most.
const DENSITY_LINES: f64 = 48.0;
/// A residual is significant only if its chi-square exceeds the expected value by this many standard deviations. Standard: five sigma,
/// 3e-7 of a normal distribution. Lower, an error of the density is a gap; higher, small gaps pass for noise.
const SIGNIFICANT: f64 = 5.0;
/// The same for an explanation that is easily confused with many others. Derived: noise alone exceeds it once in 4300 experiments, by a
/// normal distribution.
const SUSPICIOUS: f64 = 3.5;
/// A residual of at most this many times the power of the noise, whose density is an estimate, counts as noise. Chosen: 2.5 % in amplitude,
/// which no use of a model notices. Lower, long records find an error of the density.
const NOISE: f64 = 1.05;

/// How much is left, and how much noise would leave.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Excess {
    /// Sum of squares of the white residual.
    pub sum: f64,
    /// What noise leaves on average: two per line.
    pub expected: f64,
}

impl Excess {
    pub(crate) fn add(&mut self, other: Self) {
        self.sum += other.sum;
        self.expected += other.expected;
    }

    /// What is more than noise.
    #[must_use]
    pub fn over(&self) -> f64 {
        self.sum - self.expected
    }

    /// Whether it is no more than noise leaves, whose density is an estimate.
    #[must_use]
    pub fn is_noise(&self) -> bool {
        self.significance() < SIGNIFICANT || self.sum < NOISE * self.expected
    }

    /// Whether it is little enough for an explanation that is easily confused with many others to be accepted.
    #[must_use]
    pub fn is_surely_noise(&self) -> bool {
        self.significance() < SUSPICIOUS || self.sum < NOISE * self.expected
    }

    /// The same in standard deviations.
    #[must_use]
    pub fn significance(&self) -> f64 {
        if self.expected == 0.0 {
            return 0.0;
        }
        // 2 n for the chi-square of n degrees of freedom, as much again for the density's own error where it rests on few.
        let variance = 2.0 * self.expected * (1.0 + self.expected / (self.expected + DENSITY_LINES));
        self.over() / variance.sqrt()
    }
}

/// Something that is left, with where it lies along what it lies on.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Term {
    /// How much.
    pub excess: Excess,
    /// The sum of squares over all rows, response units, that an excess of one is.
    pub scale: f64,
    /// The line of a spectrum that it is on.
    pub line: Option<Line>,
    /// From and to in commands.
    pub nominal: Option<(f64, f64)>,
    /// Size of the last step, a command.
    pub step: Option<f64>,
    /// 1 upward and -1 downward.
    pub direction: Option<f64>,
    /// From and to in seconds from the begin of the record.
    pub time_s: Option<(f64, f64)>,
}

/// A line that a period has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Line {
    /// Its frequency.
    pub hz: f64,
    /// Whether the command has it.
    pub is_excited: bool,
    /// Whether it is an even multiple of the frequency of the period.
    pub is_even: bool,
}
