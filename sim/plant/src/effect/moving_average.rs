//! The sensor averages.

use std::collections::VecDeque;

use num_complex::Complex64;

use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site, two_digits};
use crate::filter::{Interval, ResponseStage};
use crate::stage::Memory;

/// What it is called in files.
pub const ID: &str = "moving_average";

/// What is logged is the mean over the last moments.
pub static KIND: Kind = Kind {
    id: ID,
    title: "moving average of the sensor",
    site: Site::Sensor,
    equation: "(1 - e^(-s T)) / (s T), T = window_s: the mean over the last T seconds; a second mean over taper T behind it",
    parameters: &[
        // The fastest converters of load cells give a reading every 3 ms (NAU7802): what is shorter looks as a delay does.
        Parameter::fitted("window_s", "s", "how long is averaged")
            .possible(0.0, 10.0)
            .log(3e-3, 0.25, &[4e-3, 0.01, 0.03, 0.08, 0.2])
            .smooth(),
        // Both means together weight the past by a trapezoid that is as wide at half its height, and at 1 by a triangle.
        Parameter::fitted("taper", "", "for how long the weights rise, and fall, over the window")
            .possible(0.0, 1.0)
            .linear(0.0, 1.0, &[0.3, 0.8])
            .smooth()
            .shape(0.0, |taper| format!("its weights rise, and fall, over {} of the window", two_digits(taper))),
    ],
    signature: "The phase lags in proportion to the frequency, as that of a delay of half the window, and the magnitude falls to nothing at \
                1 / window_s and its multiples; the same at every nominal command and amplitude. Steps begin and end with a corner.",
    confusions: &[
        Confusion {
            with: super::transport_delay::ID,
            recipe: &Recipe::HIGH_FREQUENCIES,
            experiment: "Excite up to 1 / window_s: there a mean shows nothing at all, at half of it two thirds; a delay of half the window \
                         leaves the magnitude alone.",
        },
        Confusion {
            with: super::second_pole::ID,
            recipe: &Recipe::HIGH_FREQUENCIES,
            experiment: "Excite beyond 1 / window_s: a mean has a notch there, and more at its multiples; a pole goes on falling without one.",
        },
        Confusion {
            with: super::esc_frame_hold::ID,
            recipe: &Recipe::HIGH_FREQUENCIES,
            experiment: "Log the speed too: it has the frames, and not the mean of the thrust. A hold has images around the multiples of its \
                         rate, a mean has none.",
        },
    ],
    remedy: "it is the sensor's, not the motor's, and does not fly: log with fewer readings in a mean, or at a higher rate, and record again; \
             what a compensator would gain on it is lost in flight",
    sources: &[
        "Smith, The Scientist and Engineer's Guide to Digital Signal Processing, ch. 15: moving average filters",
        "Nuvoton, NAU7802 data sheet: a load cell is read 10 to 320 times a second",
        "Avia Semiconductor, HX711 data sheet: a load cell is read 10 or 80 times a second; firmware of cheap stands takes the mean of \
         4 to 16 readings",
    ],
    linearity: Linearity::Exact,
    shows: Shows::Anywhere,
    search: Search::Values,
    check: Kind::any,
    part: |values, _| match (values[0], values[1]) {
        (0.0, _) => Part::Nothing,
        (window_s, 0.0) => Part::response(Mean::over(window_s)),
        (window_s, taper) => {
            Part::response(TwoMeans { first: Mean::over(window_s), second: Mean::over(taper * window_s) })
        }
    },
    response: |values, _, omega_rad_s| {
        let half = 0.5 * omega_rad_s * values[0];
        mean_of_turns(half) * mean_of_turns(values[1] * half)
    },
};

/// The mean of `e^(-j a)` for `a` from 0 to `2 half`.
fn mean_of_turns(half: f64) -> Complex64 {
    if half == 0.0 { Complex64::ONE } else { Complex64::cis(-half) * (half.sin() / half) }
}

/// The mean over the last seconds. What comes in adds its area to that under the window, and what leaves the window takes its own away;
/// both are exact.
struct Mean {
    window_s: f64,
    /// What was in the last `window_s`, each interval with its begin at 0, and its area.
    past: VecDeque<(Interval, f64)>,
    /// How much of the first of them has left the window.
    gone_s: f64,
    /// The input a window ago.
    oldest: f64,
    area: f64,
}

impl Mean {
    fn over(window_s: f64) -> Self {
        Self { window_s, past: VecDeque::new(), gone_s: 0.0, oldest: f64::NAN, area: 0.0 }
    }

    /// The mean and its slope, where the input is now `input`.
    fn output(&self, input: f64) -> (f64, f64) {
        (self.area / self.window_s, (input - self.oldest) / self.window_s)
    }

    /// In what time the next interval begins to leave the window.
    fn until_next_s(&self) -> f64 {
        self.past.front().map_or(0.0, |(first, _)| first.duration_s - self.gone_s)
    }

    /// Puts the last `parts` together to the interval that they are of, where it is under the window as a whole: its own cuts would cut what
    /// comes a window later, and these again.
    fn join(&mut self, parts: usize, whole: &Interval) {
        if let Some(before) = self.past.len().checked_sub(parts).filter(|before| *before > 0) {
            self.past.truncate(before);
            self.past.push_back((Interval { from_s: 0.0, ..*whole }, area(whole)));
        }
    }

    /// The area of what leaves the window in `duration_s`.
    fn leave(&mut self, duration_s: f64) -> f64 {
        // What of the first interval is gone already is counted again with all of it.
        let mut area = -self.past.front().map_or(0.0, |(first, _)| area_until(first, self.gone_s));
        self.gone_s += duration_s;
        while let Some((first, whole)) = self.past.front().filter(|_| self.past.len() > 1)
            && self.gone_s >= first.duration_s
        {
            area += whole;
            self.gone_s -= first.duration_s;
            self.past.pop_front();
        }
        if let Some((first, _)) = self.past.front() {
            area += area_until(first, self.gone_s);
            self.oldest = first.at(self.gone_s);
        }
        area
    }
}

/// The area under an interval: of a cubic its ends and its slopes there tell it.
fn area(interval: &Interval) -> f64 {
    let Interval { duration_s, start, end, start_slope, end_slope, .. } = *interval;
    0.5 * duration_s * (start + end + duration_s * (start_slope - end_slope) / 6.0)
}

/// The area under an interval from its begin until `moment_s` later.
fn area_until(interval: &Interval, moment_s: f64) -> f64 {
    let Interval { duration_s, start, end, start_slope, end_slope, .. } = *interval;
    let part = moment_s / duration_s;
    let at_end = part.powi(3) * (1.0 - 0.5 * part);
    let from_start = part * part * (0.5 + part * (0.25 * part - 2.0 / 3.0));
    let from_end = part.powi(3) * (0.25 * part - 1.0 / 3.0);
    duration_s
        * (start * (part - at_end) + end * at_end + duration_s * (start_slope * from_start + end_slope * from_end))
}

impl ResponseStage for Mean {
    fn settle(&mut self, level: f64) -> f64 {
        let still = Interval {
            from_s: 0.0,
            duration_s: self.window_s,
            start: level,
            start_slope: 0.0,
            end: level,
            end_slope: 0.0,
        };
        self.past.clear();
        self.past.push_back((still, level * self.window_s));
        (self.gone_s, self.oldest, self.area) = (0.0, level, level * self.window_s);
        level
    }

    fn advance(&mut self, signal: &mut Interval) {
        let input = Interval { from_s: 0.0, ..*signal };
        (signal.start, signal.start_slope) = self.output(input.start);
        let area = area(&input);
        self.past.push_back((input, area));
        self.area += area - self.leave(input.duration_s);
        (signal.end, signal.end_slope) = self.output(input.end);
    }

    fn memory(&self) -> Memory {
        Memory::Seconds(self.window_s)
    }

    fn time_scale_s(&self) -> f64 {
        self.window_s
    }
}

/// Parts of an interval are no shorter, seconds: corners that are nearer to each other do not matter. Chosen: a quarter of a tick of 5 kHz,
/// as the pieces of a response; shorter ones only take time.
const LEAST_PART_S: f64 = 5e-5;

/// A mean of means.
struct TwoMeans {
    first: Mean,
    second: Mean,
}

impl TwoMeans {
    fn output(&self, input: f64) -> (f64, f64) {
        self.second.output(self.first.output(input).0)
    }
}

impl ResponseStage for TwoMeans {
    fn settle(&mut self, level: f64) -> f64 {
        self.first.settle(level);
        self.second.settle(level)
    }

    fn advance(&mut self, signal: &mut Interval) {
        // Where the slope of the input had a corner a window ago, that of the first mean has one: the second takes it in parts between.
        let (start, start_slope) = self.output(signal.start);
        let mut rest = *signal;
        let mut parts = 0;
        loop {
            parts += 1;
            let part_s = self.first.until_next_s().max(LEAST_PART_S);
            let is_last = rest.duration_s < part_s + LEAST_PART_S;
            let mut part = if is_last { rest } else { rest.part(rest.from_s, part_s) };
            self.first.advance(&mut part);
            self.second.advance(&mut part);
            if is_last {
                break;
            }
            rest = rest.part(rest.from_s + part_s, rest.duration_s - part_s);
        }
        let (end, end_slope) = self.output(signal.end);
        self.first.join(parts, signal);
        *signal = Interval { start, start_slope, end, end_slope, ..*signal };
    }

    fn memory(&self) -> Memory {
        self.first.memory().and(self.second.memory())
    }

    fn time_scale_s(&self) -> f64 {
        self.second.time_scale_s()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{active, step};

    /// The integral of a lagged step of 1 with a time constant of 0.1 s, and the integral of that, from 0 to `t`.
    fn integrals(t: f64) -> (f64, f64) {
        let t = t.max(0.0);
        let once = t - 0.1 * (1.0 - (-10.0 * t).exp());
        (once, 0.5 * t * t - 0.1 * once)
    }

    #[test]
    fn a_step_is_the_mean_of_a_lagged_one() {
        // Shorter than a row, no whole number of rows, and longer than the lag.
        for window_s in [3e-5, 0.001, 0.012_34, 0.2] {
            for (row, y) in step(0.1, 0.5, &[active(&KIND, &[window_s])]).iter().enumerate() {
                let t = row as f64 * 1e-3;
                let exact = (integrals(t).0 - integrals(t - window_s).0) / window_s;
                assert!((y - exact).abs() < 1e-9, "{window_s} s, row {row}: {y} for {exact}");
            }
        }
    }

    #[test]
    fn a_step_with_tapered_weights_is_the_mean_of_means() {
        for (window_s, taper) in [(0.012_34, 0.4), (0.05, 1.0), (0.2, 0.01), (0.002, 0.5)] {
            let second_s = taper * window_s;
            for (row, y) in step(0.1, 0.5, &[active(&KIND, &[window_s, taper])]).iter().enumerate() {
                let t = row as f64 * 1e-3;
                let of = |late_s: f64| integrals(t - late_s).1;
                let exact = (of(0.0) - of(window_s) - of(second_s) + of(window_s + second_s)) / (window_s * second_s);
                // Where the second begins, the first has a corner within a row.
                assert!((y - exact).abs() < 1e-7, "{window_s} s, {taper}, row {row}: {y} for {exact}");
            }
        }
    }

    #[test]
    fn nothing_is_left_at_the_notches() {
        let at = |hz: f64| (KIND.response)(&[0.05, 0.0], &crate::testing::point(), std::f64::consts::TAU * hz).norm();
        assert!(at(20.0) < 1e-12 && at(40.0) < 1e-12);
        assert!((at(10.0) - 2.0 / std::f64::consts::PI).abs() < 1e-12);
    }
}
