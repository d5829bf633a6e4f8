//! One more lag.

use num_complex::Complex64;

use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site, two_digits};
use crate::filter::{Interval, MEMORY_TIME_CONSTANTS, Mode, ResponseStage};
use crate::stage::Memory;

/// What it is called in files.
pub const ID: &str = "second_pole";

/// The motor's electrical lag, or a filter of the sensor.
pub static KIND: Kind = Kind {
    id: ID,
    title: "second pole",
    site: Site::Logger,
    equation: "1 / ((time_constant_s s + 1) (third_ratio time_constant_s s + 1))",
    parameters: &[
        Parameter::fitted("time_constant_s", "s", "time constant of the second lag")
            .possible(0.0, 10.0)
            .log(1e-4, 0.04, &[3e-4, 1e-3, 3e-3, 0.01, 0.03])
            .smooth()
            .lag(),
        // The slower of the two is the second.
        Parameter::fitted("third_ratio", "", "time constant of a third lag over that of the second")
            .possible(0.0, 1.0)
            .linear(0.0, 1.0, &[0.3, 0.8])
            .smooth()
            .shape(0.0, |ratio| format!("a third pole has {} of the time constant of the second", two_digits(ratio))),
    ],
    signature: "Above 1 / (2 pi time_constant_s) the response rolls off by 20 dB per decade more and lags by up to 90 degrees \
                more, the same at every nominal command and amplitude. Steps begin with a curve instead of a corner.",
    confusions: &[
        Confusion {
            with: super::transport_delay::ID,
            recipe: &Recipe::HIGH_FREQUENCIES,
            experiment: "Excite up to 1 / (2 pi time_constant_s): the magnitude is 3 dB down there, which a delay does not do.",
        },
        Confusion {
            with: super::slew_limit::ID,
            recipe: &Recipe::AMPLITUDES,
            experiment: "Halve the amplitude: a pole stays where it is.",
        },
        Confusion {
            with: super::parameter_error::ID,
            recipe: &Recipe::HIGH_FREQUENCIES,
            experiment: "Excite up to ten times the pole: one lag ends at 90 degrees, two go on to 180.",
        },
    ],
    remedy: "find out whose it is: log the speed too. A filter of the sensor or the logger does not fly: record again with a faster one. Where \
             it is the motor's, keep it in the model (`--out-model`)",
    sources: &[
        "L/R of the windings 0.1 to 1 ms; thrust sensors and anti-alias filters 1 to 30 ms",
        "Franklin, Powell & Emami-Naeini, Feedback Control of Dynamic Systems, ch. 3",
    ],
    linearity: Linearity::Exact,
    shows: Shows::Anywhere,
    search: Search::Values,
    check: Kind::any,
    part: |values, _| match (values[0], values[1]) {
        (0.0, _) => Part::Nothing,
        (second_s, 0.0) => Part::response(Lowpass::new(second_s)),
        (second_s, ratio) => Part::response(TwoLags::new(second_s, ratio)),
    },
    response: |values, _, omega_rad_s| {
        let x = omega_rad_s * values[0];
        Complex64::new(1.0, x).inv() * Complex64::new(1.0, values[1] * x).inv()
    },
};

/// Lags that are nearer to each other than this part are taken as so far apart. Derived: their sum is then rounded by 1e-10, a double's
/// `1e-16 / 1e-6`.
const LEAST_APART: f64 = 1e-6;

struct Lowpass {
    rate_per_s: f64,
    mode: Mode<f64>,
}

impl Lowpass {
    fn new(time_constant_s: f64) -> Self {
        let rate_per_s = 1.0 / time_constant_s;
        Self { rate_per_s, mode: Mode::new(-rate_per_s) }
    }

    fn output(&self) -> f64 {
        self.mode.state() * self.rate_per_s
    }
}

impl ResponseStage for Lowpass {
    fn settle(&mut self, level: f64) -> f64 {
        self.mode.settle(level);
        level
    }

    fn advance(&mut self, signal: &mut Interval) {
        let start = self.output();
        self.mode.advance(signal);
        let end = self.output();
        signal.start_slope = (signal.start - start) * self.rate_per_s;
        signal.end_slope = (signal.end - end) * self.rate_per_s;
        (signal.start, signal.end) = (start, end);
    }

    fn memory(&self) -> Memory {
        Memory::Seconds(MEMORY_TIME_CONSTANTS / self.rate_per_s)
    }

    fn time_scale_s(&self) -> f64 {
        1.0 / self.rate_per_s
    }
}

/// Two lags in series, as the sum of two side by side, each of which is exact:
/// `1 / ((T s + 1) (r T s + 1)) = (1 / (T s + 1) - r / (r T s + 1)) / (1 - r)`.
struct TwoLags {
    slow: Lowpass,
    fast: Lowpass,
    ratio: f64,
}

impl TwoLags {
    fn new(slow_s: f64, ratio: f64) -> Self {
        let ratio = ratio.min(1.0 - LEAST_APART);
        Self { slow: Lowpass::new(slow_s), fast: Lowpass::new(ratio * slow_s), ratio }
    }

    /// The output and its slope.
    fn output(&self) -> (f64, f64) {
        let (slow, fast, apart) = (self.slow.output(), self.fast.output(), 1.0 - self.ratio);
        ((slow - self.ratio * fast) / apart, self.slow.rate_per_s * (fast - slow) / apart)
    }
}

impl ResponseStage for TwoLags {
    fn settle(&mut self, level: f64) -> f64 {
        self.slow.settle(level);
        self.fast.settle(level)
    }

    fn advance(&mut self, signal: &mut Interval) {
        let (start, start_slope) = self.output();
        self.slow.mode.advance(signal);
        self.fast.mode.advance(signal);
        let (end, end_slope) = self.output();
        *signal = Interval { start, start_slope, end, end_slope, ..*signal };
    }

    fn memory(&self) -> Memory {
        self.slow.memory().and(self.fast.memory())
    }

    fn time_scale_s(&self) -> f64 {
        self.fast.time_scale_s()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{active, step};

    #[test]
    fn a_step_is_that_of_two_lags_in_series() {
        for t2 in [1e-4, 0.003, 0.099, 0.4] {
            for (row, y) in step(0.1, 0.4, &[active(&KIND, &[t2])]).iter().enumerate() {
                let (t, t1) = (row as f64 * 1e-3, 0.1);
                let exact = 1.0 - (t1 * (-t / t1).exp() - t2 * (-t / t2).exp()) / (t1 - t2);
                assert!((y - exact).abs() < 1e-9, "{t2}, row {row}: {y} for {exact}");
            }
        }
    }

    #[test]
    fn a_step_is_that_of_three_lags_in_series() {
        for (t2, ratio) in [(0.03, 0.5), (0.004, 0.01), (0.02, 0.999), (0.05, 1.0)] {
            let step = step(0.1, 0.4, &[active(&KIND, &[t2, ratio])]);
            // Partial fractions; two that are equal are taken a ten-thousandth apart, on either side.
            let part = if ratio > 0.99 { 1e-4 } else { 0.0 };
            let (t1, t2, t3) = (0.1, t2 * (1.0 + part), t2 * ratio * (1.0 - part));
            for (row, y) in step.iter().enumerate() {
                let t = row as f64 * 1e-3;
                let of = |a: f64, b: f64, c: f64| a * a * (-t / a).exp() / ((a - b) * (a - c));
                let exact = 1.0 - of(t1, t2, t3) - of(t2, t1, t3) - of(t3, t1, t2);
                let tolerance = if ratio > 0.99 { 3e-5 } else { 1e-9 };
                assert!((y - exact).abs() < tolerance, "{t2}, {t3}, row {row}: {y} for {exact}");
            }
        }
    }

    #[test]
    fn what_comes_behind_a_third_lag_takes_it_as_it_is() {
        // A third lag, and the same in a link of its own, ahead of one more.
        let last = active(&KIND, &[0.02]);
        let third = step(0.1, 0.4, &[active(&KIND, &[0.03, 0.5]), last.clone()]);
        let links = step(0.1, 0.4, &[active(&KIND, &[0.03]), active(&KIND, &[0.015]), last]);
        let worst = third.iter().zip(&links).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-6, "{worst:e}");
    }
}
