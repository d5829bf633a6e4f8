//! The chain from the command at the rotor to the force in the load cell, with its integrator.
//!
//! Exponential (variation of constants) steps on a fixed grid:
//! - The command enters as its exact mean over the step, so that events between grid points count with their moment;
//!   what this neglects is of the second order in the step.
//! - The rotor's lag is exact for a command that is constant over the step. Where its target or time constant depends
//!   on the state, both are taken at the middle of the step, which a half step predicts: exponential midpoint rule,
//!   second order.
//! - What follows the rotor is linear and exact for a force that is straight over the step: second order.
//!
//! The data are made with steps of 50 us. A test halves the step and finds a quarter of the difference.

use super::lag::{Lag, Mode};
use super::motor::Point;
use super::setup::Setup;

/// What the current does with the thrust: power goes with its power of 1.5, and current is power over voltage.
const CURRENT_EXPONENT: f64 = 1.5;

/// The signals on the grid, from time zero on, one more than there are steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Signals {
    /// The rotor's thrust in newtons, which goes with the square of its speed.
    pub rotor_n: Vec<f64>,
    /// Supply voltage relative to the one at rest at this nominal command.
    pub voltage: Vec<f64>,
    /// The force in the load cell in newtons.
    pub force_n: Vec<f64>,
}

/// A motor at one point with effects.
#[derive(Clone, Copy, Debug)]
pub struct Chain<'a> {
    /// The point.
    pub point: Point,
    /// Thrust at hover, where the supply's drop is stated.
    pub hover_n: f64,
    /// The effects.
    pub setup: &'a Setup,
    /// Seconds of a step.
    pub step_s: f64,
}

impl Chain<'_> {
    /// Runs over the commands, each of them the mean over one step, from rest at the nominal command.
    #[must_use]
    pub fn run(&self, means: &[f64]) -> Signals {
        let (rotor_n, voltage) = if self.setup.is_plain_rotor() { self.plain(means) } else { self.midpoint(means) };
        let force_n = self.downstream(&rotor_n);
        Signals { rotor_n, voltage, force_n }
    }

    /// The thrust that a command has in the end, at relative voltage 1 and without drift.
    fn target_n(&self, command: f64) -> f64 {
        let deviation = command - self.point.nominal;
        self.point.rest_n + self.point.gain_n * (deviation + self.setup.curvature * deviation * deviation)
    }

    fn plain(&self, means: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let decay = (-self.step_s / self.point.time_constant_s).exp();
        let mut thrust = self.point.rest_n;
        let mut out = Vec::with_capacity(means.len() + 1);
        out.push(thrust);
        for mean in means {
            let target = self.target_n(*mean);
            thrust = target + (thrust - target) * decay;
            out.push(thrust);
        }
        (out, Vec::new())
    }

    fn midpoint(&self, means: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (setup, point, step_s) = (self.setup, &self.point, self.step_s);
        let supplied = setup.sag_depth != 0.0 || setup.sag_resistance != 0.0;
        let current = |thrust: f64| if supplied { (thrust.max(0.0) / self.hover_n).powf(CURRENT_EXPONENT) } else { 0.0 };
        let rest_current = current(point.rest_n);
        let raw_voltage = |slow: f64, current: f64| 1.0 - setup.sag_depth * slow - setup.sag_resistance * current;
        let rest_voltage = raw_voltage(rest_current, rest_current);
        let (slower, faster) = (setup.ratio.sqrt(), 1.0 / setup.ratio.sqrt());
        let lag = |thrust: f64, target: f64| {
            let mut tau = point.time_constant_s * if target >= thrust { faster } else { slower };
            if setup.exponent != 0.0 {
                // Speed goes with the root of the thrust. A rotor that nearly stands does not become infinitely slow.
                tau *= (thrust / point.rest_n).max(0.01).powf(-setup.exponent / 2.0);
            }
            tau
        };
        let drift = |time_s: f64| setup.drift_change * (1.0 - (-time_s / setup.drift_time_s).exp());
        let drifts = setup.drift_change != 0.0;
        let varies = setup.exponent != 0.0 || setup.ratio != 1.0;
        let fixed = ((-step_s / 2.0 / point.time_constant_s).exp(), (-step_s / point.time_constant_s).exp());
        let (mut thrust, mut slow) = (point.rest_n, rest_current);
        let mut out = Vec::with_capacity(means.len() + 1);
        let mut voltage = Vec::with_capacity(if supplied { means.len() + 1 } else { 0 });
        out.push(thrust);
        if supplied {
            voltage.push(1.0);
        }
        let slow_half = (-step_s / 2.0 / setup.sag_time_s).exp();
        for (index, mean) in means.iter().enumerate() {
            let gain = if drifts { 1.0 + drift((index as f64 + 0.5) * step_s) } else { 1.0 };
            let target = |thrust: f64, slow: f64| {
                let ratio = if supplied { raw_voltage(slow, current(thrust)) / rest_voltage } else { 1.0 };
                gain * self.target_n(mean * ratio)
            };
            let first = target(thrust, slow);
            let half_decay = if varies { (-step_s / 2.0 / lag(thrust, first)).exp() } else { fixed.0 };
            let middle = first + (thrust - first) * half_decay;
            let middle_slow = if supplied { blend(current(thrust), slow, slow_half) } else { 0.0 };
            let second = target(middle, middle_slow);
            let decay = if varies { (-step_s / lag(middle, second)).exp() } else { fixed.1 };
            thrust = second + (thrust - second) * decay;
            out.push(thrust);
            if supplied {
                slow = blend(current(middle), slow, slow_half * slow_half);
                voltage.push(raw_voltage(slow, current(thrust)) / rest_voltage);
            }
        }
        (out, voltage)
    }

    fn downstream(&self, rotor_n: &[f64]) -> Vec<f64> {
        let setup = self.setup;
        let mut force = rotor_n.to_vec();
        let rest = self.point.rest_n;
        if setup.lag_s > 0.0 && setup.lead_s != setup.lag_s {
            let through = setup.lead_s / setup.lag_s;
            let mut lag = Lag::at_rest(setup.lag_s, self.step_s, rest);
            filter(&mut force, |from, to| {
                let lagged = lag.step(from, to);
                through * to + (1.0 - through) * lagged
            });
        }
        if setup.pole_s > 0.0 {
            let mut lag = Lag::at_rest(setup.pole_s, self.step_s, rest);
            filter(&mut force, |from, to| lag.step(from, to));
        }
        if setup.participation != 0.0 && setup.stand_hz > 0.0 {
            let mut mode = Mode::at_rest(setup.stand_hz, setup.stand_damping, self.step_s, rest);
            filter(&mut force, |from, to| {
                let moved = mode.step(from, to);
                (1.0 - setup.participation) * to + setup.participation * moved
            });
        }
        force
    }
}

/// A lag's state after a step in which `keep` of it stays.
fn blend(input: f64, state: f64, keep: f64) -> f64 {
    input + (state - input) * keep
}

/// Replaces the signal by what `step` makes of each pair of neighbors; the first value is the one at rest.
fn filter(signal: &mut [f64], mut step: impl FnMut(f64, f64) -> f64) {
    let Some(mut from) = signal.first().copied() else { return };
    for value in &mut signal[1..] {
        let to = *value;
        *value = step(from, to);
        from = to;
    }
}

/// What a logger reads at `times_s` from a signal on a grid, by cubic interpolation (Catmull-Rom) between grid points.
#[must_use]
pub fn read_at(signal: &[f64], step_s: f64, times_s: impl Iterator<Item = f64>) -> Vec<f64> {
    let last = signal.len() - 1;
    times_s
        .map(|time_s| {
            let position = (time_s / step_s).clamp(0.0, last as f64);
            let mut index = position as usize;
            let mut part = position - index as f64;
            if part < 1e-9 {
                return signal[index];
            }
            if part > 1.0 - 1e-9 {
                (index, part) = (index + 1, 0.0);
            }
            if part == 0.0 {
                return signal[index.min(last)];
            }
            let [a, b, c, d] =
                [signal[index.saturating_sub(1)], signal[index], signal[(index + 1).min(last)], signal[(index + 2).min(last)]];
            let (left, right) = ((c - a) / 2.0, (d - b) / 2.0);
            let rise = c - b;
            b + part * (left + part * (3.0 * rise - 2.0 * left - right + part * (left + right - 2.0 * rise)))
        })
        .collect()
}
