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

/// What the current does with the speed: a propeller's power goes with its cube, and current is power over voltage.
const CURRENT_EXPONENT: i32 = 3;
/// The command, and with it the speed, at which a supply's drops are stated.
const HOVER: f64 = 0.5;
/// The paper's amplitude, at which laws that are bent are bent by as much as they say.
const AMPLITUDE: f64 = 0.05;

/// The current at a speed, relative to that at hover.
#[must_use]
pub fn relative_current(speed: f64) -> f64 {
    (speed.max(0.0) / HOVER).powi(CURRENT_EXPONENT)
}

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
        let force_n = self.downstream(rotor_n.clone());
        Signals { rotor_n, voltage, force_n }
    }

    /// The force alone.
    #[must_use]
    pub fn force(&self, means: &[f64]) -> Vec<f64> {
        let (rotor_n, _) = if self.setup.is_plain_rotor() { self.plain(means) } else { self.midpoint(means) };
        self.downstream(rotor_n)
    }

    /// The thrust that a command has in the end, at relative voltage 1 and without drift.
    fn target_n(&self, command: f64) -> f64 {
        let deviation = command - self.point.nominal;
        let Setup { curvature, shape, .. } = self.setup;
        let cubic = shape.cubic * deviation / AMPLITUDE;
        self.point.rest_n + self.point.gain_n * (deviation + curvature * deviation * deviation * (1.0 + cubic))
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
        let current = |thrust: f64| if supplied { relative_current(point.speed(thrust)) } else { 0.0 };
        let by_command = |command: f64| (command / HOVER).powi(2);
        let rest_current = if setup.shape.sags_by_command { by_command(point.nominal) } else { current(point.rest_n) };
        let raw_voltage = |slow: f64, current: f64| 1.0 - setup.sag_depth * slow - setup.sag_resistance * current;
        let rest_voltage = raw_voltage(rest_current, rest_current);
        let (slower, faster) = (setup.ratio.sqrt(), 1.0 / setup.ratio.sqrt());
        let swing_n = 2.0 * AMPLITUDE * point.gain_n;
        let lag = |thrust: f64, target: f64| {
            let tau = point.time_constant_s * if target >= thrust { faster } else { slower };
            let way = setup.shape.unevenness_of_way * ((target - thrust) / swing_n).abs();
            let tau = tau * if target >= thrust { faster } else { slower }.powf(way);
            // A rotor that nearly stands does not become infinitely slow.
            let speed = (point.speed(thrust) / point.nominal).max(0.1);
            let of_speed = || (1.0 - setup.exponent * (speed - 1.0)).max(0.1);
            tau * if setup.shape.linear_lag { of_speed() } else { speed.powf(-setup.exponent) }
        };
        // The change is that of the first time constant.
        let reach = setup.drift_change / (1.0 - (-1.0_f64).exp());
        let drift = |time_s: f64| {
            if setup.shape.ramp {
                return setup.drift_change * time_s / setup.drift_time_s;
            }
            reach * (1.0 - (-time_s / setup.drift_time_s).exp())
        };
        let drifts = setup.drift_change != 0.0;
        // What stays of a deviation after half a step and a whole one, for a time constant.
        let decays = |tau: f64| ((-step_s / 2.0 / tau).exp(), (-step_s / tau).exp());
        let (rising, falling) = (decays(point.time_constant_s * faster), decays(point.time_constant_s * slower));
        let decay = |thrust: f64, target: f64| {
            if setup.exponent != 0.0 || setup.shape.unevenness_of_way != 0.0 {
                return decays(lag(thrust, target));
            }
            if target >= thrust { rising } else { falling }
        };
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
            let loaded = |thrust: f64| if setup.shape.sags_by_command { by_command(*mean) } else { current(thrust) };
            let target = |thrust: f64, slow: f64| {
                let ratio = if supplied { raw_voltage(slow, loaded(thrust)) / rest_voltage } else { 1.0 };
                gain * self.target_n(mean * ratio)
            };
            let first = target(thrust, slow);
            let middle = first + (thrust - first) * decay(thrust, first).0;
            let middle_slow = if supplied { blend(loaded(thrust), slow, slow_half) } else { 0.0 };
            let second = target(middle, middle_slow);
            thrust = second + (thrust - second) * decay(middle, second).1;
            out.push(thrust);
            if supplied {
                slow = blend(loaded(middle), slow, slow_half * slow_half);
                voltage.push(raw_voltage(slow, loaded(thrust)) / rest_voltage);
            }
        }
        (out, voltage)
    }

    fn downstream(&self, rotor_n: Vec<f64>) -> Vec<f64> {
        let setup = self.setup;
        let mut force = rotor_n;
        let rest = self.point.rest_n;
        if setup.lag_s > 0.0 && setup.lead_s != setup.lag_s {
            let through = setup.lead_s / setup.lag_s;
            let mut lag = Lag::at_rest(setup.lag_s, self.step_s, rest);
            filter(&mut force, |from, to| {
                if setup.shape.inflow_of_speed {
                    lag.retime(setup.lag_s * setup.shape.inflow_factor(self.point.speed(from), HOVER), self.step_s);
                }
                let lagged = lag.step(from, to);
                through * to + (1.0 - through) * lagged
            });
        }
        let third_s = setup.shape.third_lag * setup.pole_s;
        for lag_s in [setup.pole_s - third_s, third_s] {
            if lag_s > 0.0 {
                let mut lag = Lag::at_rest(lag_s, self.step_s, rest);
                filter(&mut force, |from, to| lag.step(from, to));
            }
        }
        if setup.participation != 0.0 && setup.stand_hz > 0.0 {
            let second = setup.shape.second_mode;
            let parts = [(1.0, 1.0 - second), (setup.shape.second_mode_ratio, second)];
            let mode = |ratio: f64| Mode::at_rest(ratio * setup.stand_hz, setup.stand_damping, self.step_s, rest);
            let shown = parts.iter().filter(|(_, part)| *part > 0.0);
            let mut modes: Vec<(f64, Mode)> =
                shown.map(|(ratio, part)| (setup.participation * part, mode(*ratio))).collect();
            filter(&mut force, |from, to| {
                let still = (1.0 - setup.participation) * to;
                modes.iter_mut().fold(still, |sum, (part, mode)| sum + *part * mode.step(from, to))
            });
        }
        let shape = &setup.shape;
        for (window_s, recency) in [(setup.window_s, shape.recency), (shape.second_average * setup.window_s, 0.0)] {
            if window_s > 0.0 {
                force = average(&force, window_s, recency, self.step_s);
            }
        }
        force
    }
}

/// The mean over the last `window_s`, with weights that fall along a straight line, by `recency` more than 1 at the latest moment and by
/// as much less at the earliest. By parts, the second integral has what the weights do to the first.
fn average(signal: &[f64], window_s: f64, recency: f64, step_s: f64) -> Vec<f64> {
    let Some(&rest) = signal.first() else { return Vec::new() };
    let off: Vec<f64> = signal.iter().map(|value| value - rest).collect();
    let once = integral(&off, step_s);
    let twice = integral(&once, step_s);
    let earlier =
        |signal: &[f64]| read_at(signal, step_s, (0..signal.len()).map(|index| index as f64 * step_s - window_s));
    let (once_earlier, twice_earlier) = (earlier(&once), earlier(&twice));
    let mean = |index: usize| {
        let plain = once[index] - once_earlier[index];
        let late = twice[index] - twice_earlier[index] - window_s * once_earlier[index];
        rest + ((1.0 + recency) * plain - 2.0 * recency / window_s * late) / window_s
    };
    (0..signal.len()).map(mean).collect()
}

/// The integral from the first grid point on of a signal that is straight between them.
fn integral(signal: &[f64], step_s: f64) -> Vec<f64> {
    let mut sum = 0.0;
    let pairs = signal.windows(2).map(|pair| {
        sum += 0.5 * step_s * (pair[0] + pair[1]);
        sum
    });
    std::iter::once(0.0).chain(pairs).collect()
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
            let [a, b, c, d] = [
                signal[index.saturating_sub(1)],
                signal[index],
                signal[(index + 1).min(last)],
                signal[(index + 2).min(last)],
            ];
            let (left, right) = ((c - a) / 2.0, (d - b) / 2.0);
            let rise = c - b;
            b + part * (left + part * (3.0 * rise - 2.0 * left - right + part * (left + right - 2.0 * rise)))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use num_complex::Complex;

    use super::super::path::{Timing, means, pieces};
    use super::super::shape::Shape;
    use super::*;

    const POINT: Point = Point { nominal: 0.5, gain_n: 10.0, time_constant_s: 0.1, rest_n: 2.5 };

    fn run(commands: &[f64], setup: &Setup, step_s: f64) -> Signals {
        let steps = (commands.len() as f64 * 1e-3 / step_s).round() as usize;
        let pieces = pieces(commands, 0.5, setup, &Timing { frame_phase: 0.3, ..Timing::exact(commands.len(), 1e-3) });
        Chain { point: POINT, setup, step_s }.run(&means(&pieces, step_s, steps))
    }

    fn force(commands: &[f64], setup: &Setup) -> Vec<f64> {
        let force = run(commands, setup, 5e-5).force_n;
        read_at(&force, 5e-5, (0..commands.len()).map(|row| row as f64 * 1e-3))
    }

    fn step(rows: usize, to: f64) -> Vec<f64> {
        vec![to; rows]
    }

    /// Gain and phase of the force at a frequency, from whole periods after a settled second.
    fn response(setup: &Setup, hz: f64, size: f64) -> (f64, f64) {
        response_at(0.5, setup, hz, size)
    }

    fn response_at(level: f64, setup: &Setup, hz: f64, size: f64) -> (f64, f64) {
        let commands: Vec<f64> = (0..6000).map(|row| level + size * (TAU * hz * f64::from(row) * 1e-3).sin()).collect();
        let out = force(&commands, setup);
        let (mut re, mut im, mut re_in, mut im_in) = (0.0, 0.0, 0.0, 0.0);
        for row in 2000..6000 {
            let (sin, cos) = (TAU * hz * row as f64 * 1e-3).sin_cos();
            (re, im) = (re + out[row] * sin, im + out[row] * cos);
            (re_in, im_in) = (re_in + commands[row] * sin, im_in + commands[row] * cos);
        }
        (f64::hypot(re, im) / f64::hypot(re_in, im_in), im.atan2(re) - im_in.atan2(re_in))
    }

    #[test]
    fn with_nothing_set_it_is_the_first_order_lag() {
        let out = force(&step(500, 0.55), &Setup::default());
        for (row, value) in out.iter().enumerate() {
            let expected = 2.5 + 0.5 * (1.0 - (-(row as f64) * 1e-3 / 0.1).exp());
            assert!((value - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn null_parameters_give_the_plain_chain() {
        let commands: Vec<f64> = (0..2000).map(|row| 0.5 + 0.05 * (f64::from(row) * 0.03).sin()).collect();
        let plain = force(&commands, &Setup::default());
        let null = Setup {
            upper: 1.0,
            slope_per_s: 1e9,
            sag_depth: 1e-12,
            drift_change: 1e-12,
            ratio: 1.0 + 1e-12,
            exponent: 1e-12,
            curvature: 0.0,
            lead_s: 0.01,
            lag_s: 0.01,
            pole_s: 1e-9,
            stand_hz: 30.0,
            stand_damping: 0.05,
            participation: 1e-12,
            ..Setup::default()
        };
        let out = force(&commands, &null);
        let off = out.iter().zip(&plain).fold(0.0_f64, |off, (a, b)| off.max((a - b).abs()));
        assert!(off < 1e-6, "{off}");
    }

    #[test]
    fn halving_the_step_quarters_the_difference() {
        let commands: Vec<f64> = (0..3000)
            .map(|row| 0.5 + 0.03 * (f64::from(row) * 0.05).sin() + if row % 500 < 250 { 0.02 } else { -0.02 })
            .collect();
        for setup in [
            Setup { exponent: 1.2, ..Setup::default() },
            Setup { ratio: 1.7, delay_s: 1.23e-3, ..Setup::default() },
            Setup { sag_depth: 0.15, sag_time_s: 0.3, sag_resistance: 0.05, ..Setup::default() },
            Setup { drift_change: -0.1, drift_time_s: 10.0, ..Setup::default() },
            Setup { pole_s: 5e-3, lead_s: 0.02, lag_s: 0.01, ..Setup::default() },
            Setup { stand_hz: 40.0, stand_damping: 0.05, participation: 0.5, ..Setup::default() },
            Setup { window_s: 0.0123, shape: Shape { recency: 0.2, ..Shape::default() }, ..Setup::default() },
            Setup { window_s: 0.0123, shape: Shape { second_average: 0.2, ..Shape::default() }, ..Setup::default() },
            Setup { frame_hz: 173.0, slope_per_s: 3.0, delay_s: 2.3e-3, ..Setup::default() },
        ] {
            let at = |step_s: f64| {
                let force = run(&commands, &setup, step_s).force_n;
                read_at(&force, step_s, (0..commands.len()).map(|row| row as f64 * 1e-3))
            };
            let off = |a: &[f64], b: &[f64]| {
                (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
            };
            let (coarse, middle, fine) = (at(2e-4), at(1e-4), at(5e-5));
            let (first, second) = (off(&coarse, &middle), off(&middle, &fine));
            // Where events fall between grid points the error depends on where, so the ratio is not exactly 4, and
            // below 1e-5 of the swing, which no case's noise shows, it does not matter.
            assert!(second < (first / 2.5).max(1e-5), "{setup:?}: {first:e} then {second:e}");
            // One part in ten thousand of the swing, 1 N: a twentieth of the smallest noise.
            assert!(second < 1e-4, "{setup:?}: {second:e}");
        }
    }

    #[test]
    fn a_second_pole_and_an_inflow_have_their_transfer_functions() {
        let w = TAU * 5.0;
        let plain = response(&Setup::default(), 5.0, 0.02);
        let pole = response(&Setup { pole_s: 0.01, ..Setup::default() }, 5.0, 0.02);
        assert!((pole.0 / plain.0 - 1.0 / f64::hypot(1.0, 0.01 * w)).abs() < 1e-4);
        assert!((pole.1 - plain.1 + (0.01 * w).atan()).abs() < 1e-4);
        let inflow = response(&Setup { lead_s: 0.02, lag_s: 0.01, ..Setup::default() }, 5.0, 0.02);
        assert!((inflow.0 / plain.0 - f64::hypot(1.0, 0.02 * w) / f64::hypot(1.0, 0.01 * w)).abs() < 1e-4);
        assert!((inflow.1 - plain.1 - (0.02 * w).atan() + (0.01 * w).atan()).abs() < 1e-4);
    }

    #[test]
    fn an_average_has_the_transfer_function_of_its_weights() {
        let (hz, window_s) = (5.0, 0.05);
        let plain = response(&Setup::default(), hz, 0.02);
        let sinc = |a: f64| a.sin() / a;
        let half = 0.5 * TAU * hz * window_s;
        let at = |shape: Shape| response(&Setup { window_s, shape, ..Setup::default() }, hz, 0.02);
        let mean = at(Shape::default());
        assert!((mean.0 / plain.0 - sinc(half)).abs() < 1e-3 && (mean.1 - plain.1 + half).abs() < 1e-3);
        let twice = at(Shape { second_average: 0.4, ..Shape::default() });
        assert!((twice.0 / plain.0 - sinc(half) * sinc(0.4 * half)).abs() < 1e-3);
        assert!((twice.1 - plain.1 + 1.4 * half).abs() < 1e-3);
        // Around the middle of the window the weights 1 + r x, x from -1 to 1, have the imaginary part r (sin a - a cos a) / a^2.
        let recent = at(Shape { recency: 0.3, ..Shape::default() });
        let expected = Complex::new(sinc(half), 0.3 * (half.sin() - half * half.cos()) / (half * half));
        assert!((recent.0 / plain.0 - expected.norm()).abs() < 1e-3, "{} {}", recent.0 / plain.0, expected.norm());
        assert!((recent.1 - plain.1 + half - expected.arg()).abs() < 1e-3);
        // A window that a sine fits into whole leaves nothing of it.
        assert!(response(&Setup { window_s: 1.0 / hz, ..Setup::default() }, hz, 0.02).0 < 1e-3 * plain.0);
    }

    #[test]
    fn a_delay_turns_the_phase_alone() {
        let (plain, late) = (
            response(&Setup::default(), 5.0, 0.02),
            response(&Setup { delay_s: 7.3e-3, ..Setup::default() }, 5.0, 0.02),
        );
        let (gain, turn) = (late.0 / plain.0, late.1 - plain.1 + TAU * 5.0 * 7.3e-3);
        // The images of the rows' hold fold back onto 5 Hz: each 1/200 by the hold and 1/200 by the lag, two of each.
        assert!((gain - 1.0).abs() < 2e-4 && turn.abs() < 2e-4, "{gain} {turn}");
    }

    #[test]
    fn a_mode_has_its_participation_at_its_frequency() {
        let (hz, zeta, g) = (20.0, 0.05, 0.4);
        let plain = response(&Setup::default(), hz, 0.02);
        let setup = Setup { stand_hz: hz, stand_damping: zeta, participation: g, ..Setup::default() };
        let mode = response(&setup, hz, 0.02);
        // At resonance the mode is g / (2 zeta j): (1 - g) - j g / (2 zeta).
        let gain = mode.0 / plain.0;
        // The mode takes the folded images of the rows' hold away: 2 / 49^2 of the plain gain.
        assert!((gain / f64::hypot(1.0 - g, g / 2.0 / zeta) - 1.0).abs() < 1.5e-3, "{gain}");
    }

    #[test]
    fn two_modes_share_the_participation() {
        let (hz, zeta, g) = (20.0, 0.05, 0.4);
        let shape = Shape { second_mode: 0.3, second_mode_ratio: 1.5, ..Shape::default() };
        let setup = Setup { stand_hz: hz, stand_damping: zeta, participation: g, shape, ..Setup::default() };
        for (at_hz, tolerance) in [(2.0, 1e-4), (20.0, 2e-3), (30.0, 5e-3)] {
            let (plain, modes) = (response(&Setup::default(), at_hz, 0.02), response(&setup, at_hz, 0.02));
            let mode = |own_hz: f64| {
                let ratio = at_hz / own_hz;
                Complex::new(1.0 - ratio * ratio, 2.0 * zeta * ratio).inv()
            };
            let expected = mode(hz) * (0.7 * g) + mode(1.5 * hz) * (0.3 * g) + (1.0 - g);
            let gain = modes.0 / plain.0;
            assert!((gain / expected.norm() - 1.0).abs() < tolerance, "{at_hz} Hz: {gain} {}", expected.norm());
        }
    }

    #[test]
    fn an_inflow_of_the_speed_has_its_time_constants_at_hover_and_shorter_ones_above() {
        let shape = Shape { inflow_of_speed: true, ..Shape::default() };
        let inflow = Setup { lead_s: 0.02, lag_s: 0.01, ..Setup::default() };
        let of_speed = Setup { shape, ..inflow.clone() };
        let w = TAU * 5.0;
        for (level, factor) in [(0.5, 1.0), (0.625, 0.8)] {
            let plain = response_at(level, &Setup::default(), 5.0, 0.01).0;
            let gain = response_at(level, &of_speed, 5.0, 0.01).0 / plain;
            let expected = f64::hypot(1.0, 0.02 * factor * w) / f64::hypot(1.0, 0.01 * factor * w);
            assert!((gain / expected - 1.0).abs() < 1e-3, "{level}: {gain} {expected}");
            let fixed = response_at(level, &inflow, 5.0, 0.01).0 / plain;
            assert_eq!((fixed / expected - 1.0).abs() < 1e-3, factor == 1.0, "{level}: {fixed} {expected}");
        }
    }

    #[test]
    fn an_asymmetric_lag_rises_and_falls_with_its_two_time_constants() {
        let setup = Setup { ratio: 1.69, ..Setup::default() };
        let rest = |to: f64, tau: f64| {
            let out = force(&step(300, to), &setup);
            let end = 2.5 + 10.0 * (to - 0.5);
            assert!(((out[200] - end) / (2.5 - end) - (-0.2_f64 / tau).exp()).abs() < 1e-9);
        };
        rest(0.55, 0.1 / 1.3);
        rest(0.45, 0.1 * 1.3);
    }

    #[test]
    fn an_operating_point_lag_is_faster_where_the_speed_is_higher() {
        let setup = Setup { exponent: 1.0, ..Setup::default() };
        // Around the end of a step the lag is the one of the speed there: tau (2.5 / 3)^(1/2).
        let out = force(&step(1000, 0.55), &setup);
        let rate = ((3.0 - out[400]) / (3.0 - out[500])).ln() / 0.1;
        assert!((rate * 0.1 * (2.5_f64 / 3.0).sqrt() - 1.0).abs() < 0.01, "{rate}");
    }

    #[test]
    fn a_curved_map_ends_on_its_curve() {
        let out = force(&step(3000, 0.55), &Setup { curvature: 4.0, ..Setup::default() });
        assert!((out[2999] - (2.5 + 10.0 * (0.05 + 4.0 * 0.0025))).abs() < 1e-9);
    }

    #[test]
    fn a_drift_has_its_change_after_its_time_and_goes_on_by_half_as_much_again() {
        let setup = Setup { drift_change: -0.1, drift_time_s: 1.0, ..Setup::default() };
        let out = force(&step(12_000, 0.5), &setup);
        let whole = 0.1 / (1.0 - (-1.0_f64).exp());
        assert!((out[11_999] / 2.5 - (1.0 - whole)).abs() < 2e-5);
        // The rotor's lag delays by a tenth of a second.
        assert!((out[1_100] / 2.5 - 0.9).abs() < 2e-3);
    }

    #[test]
    fn a_sag_is_at_rest_at_the_nominal_command_and_takes_its_depth_at_hover() {
        let setup = Setup { sag_depth: 0.1, sag_time_s: 0.5, ..Setup::default() };
        let out = force(&step(2000, 0.5), &setup);
        assert!(out.iter().all(|value| (value - 2.5).abs() < 1e-9));
        // Once settled at 0.55 the voltage solves v = (1 - depth i) / (1 - depth), i = (speed / 0.5)^3 with the speed 0.55 v.
        let out = force(&step(20_000, 0.55), &setup);
        let mut thrust: f64 = 3.0;
        for _ in 0..200 {
            let speed = 0.5 + (thrust - 2.5) / 10.0;
            let voltage = (1.0 - 0.1 * (speed / 0.5).powi(3)) / 0.9;
            thrust = 2.5 + 10.0 * (0.55 * voltage - 0.5);
        }
        assert!((out[19_999] - thrust).abs() < 1e-6, "{} {thrust}", out[19_999]);
        assert!(thrust < 2.9);
    }

    #[test]
    fn a_logger_reads_between_grid_points() {
        let wave: Vec<f64> = (0..1001).map(|index| (f64::from(index) * 0.02).sin()).collect();
        let times: Vec<f64> = (0..900).map(|row| 5.5 + f64::from(row) * 1.0007).collect();
        for (value, time) in read_at(&wave, 1.0, times.iter().copied()).iter().zip(&times) {
            assert!((value - (time * 0.02).sin()).abs() < 1e-6, "{value} at {time}");
        }
    }
}
