//! Linear stages with exact steps for an input that is straight over the step.

use std::f64::consts::TAU;

/// `1 / (tau s + 1)`.
#[derive(Clone, Copy, Debug)]
pub struct Lag {
    decay: f64,
    /// Time constant in steps.
    behind: f64,
    state: f64,
}

impl Lag {
    /// At rest at `level`.
    #[must_use]
    pub fn at_rest(time_constant_s: f64, step_s: f64, level: f64) -> Self {
        Self { decay: (-step_s / time_constant_s).exp(), behind: time_constant_s / step_s, state: level }
    }

    /// From now on with another time constant; the state stays.
    pub fn retime(&mut self, time_constant_s: f64, step_s: f64) {
        *self = Self::at_rest(time_constant_s, step_s, self.state);
    }

    /// The state after a step over which the input goes from `from` to `to`.
    ///
    /// Behind a ramp the lag runs parallel, one time constant late; what is off from that decays.
    pub fn step(&mut self, from: f64, to: f64) -> f64 {
        let late = self.behind * (to - from);
        self.state = to - late + (self.state - from + late) * self.decay;
        self.state
    }
}

/// `w^2 / (s^2 + 2 zeta w s + w^2)` with `zeta < 1`.
#[derive(Clone, Copy, Debug)]
pub struct Mode {
    /// What of position and speed goes into position and speed over a step without input.
    transition: [[f64; 2]; 2],
    /// `2 zeta / w`: how late the mode follows a ramp.
    late_s: f64,
    step_s: f64,
    state: [f64; 2],
}

impl Mode {
    /// At rest at `level`. The damping ratio is below 1.
    #[must_use]
    pub fn at_rest(frequency_hz: f64, damping: f64, step_s: f64, level: f64) -> Self {
        let w = TAU * frequency_hz;
        let damped = w * (1.0 - damping * damping).max(1e-12).sqrt();
        let (sin, cos) = (damped * step_s).sin_cos();
        let decay = (-damping * w * step_s).exp();
        let side = damping * w / damped;
        Self {
            transition: [
                [decay * (cos + side * sin), decay * sin / damped],
                [-decay * w * w / damped * sin, decay * (cos - side * sin)],
            ],
            late_s: 2.0 * damping / w,
            step_s,
            state: [level, 0.0],
        }
    }

    /// The position after a step over which the input goes from `from` to `to`.
    pub fn step(&mut self, from: f64, to: f64) -> f64 {
        let slope = (to - from) / self.step_s;
        let late = self.late_s * slope;
        let off = [self.state[0] - from + late, self.state[1] - slope];
        let [first, second] = self.transition;
        self.state =
            [to - late + first[0] * off[0] + first[1] * off[1], slope + second[0] * off[0] + second[1] * off[1]];
        self.state[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lag_answers_a_step_and_a_ramp_as_the_formulas_say() {
        let mut lag = Lag::at_rest(0.02, 1e-3, 0.0);
        let mut value = 0.0;
        for _ in 0..20 {
            value = lag.step(1.0, 1.0);
        }
        assert!((value - (1.0 - (-1.0_f64).exp())).abs() < 1e-12);
        let mut lag = Lag::at_rest(0.02, 1e-3, 0.0);
        for step in 0..50 {
            value = lag.step(f64::from(step), f64::from(step + 1));
        }
        assert!((value - (50.0 - 20.0 * (1.0 - (-2.5_f64).exp()))).abs() < 1e-10);
    }

    #[test]
    fn a_mode_swings_at_its_damped_frequency_and_decays_at_its_rate() {
        let (hz, damping, step_s) = (12.0, 0.05, 1e-4);
        let mut mode = Mode::at_rest(hz, damping, step_s, 0.0);
        let w = TAU * hz;
        let damped = w * f64::sqrt(1.0 - damping * damping);
        for step in 1..4000 {
            let t = f64::from(step) * step_s;
            let expected =
                1.0 - (-damping * w * t).exp() * ((damped * t).cos() + damping * w / damped * (damped * t).sin());
            assert!((mode.step(1.0, 1.0) - expected).abs() < 1e-9);
        }
    }

    #[test]
    fn a_mode_follows_a_ramp_late_by_its_lateness() {
        let mut mode = Mode::at_rest(20.0, 0.1, 1e-3, 0.0);
        let mut value = 0.0;
        for step in 0..2000 {
            value = mode.step(f64::from(step) * 1e-3, f64::from(step + 1) * 1e-3);
        }
        assert!((value - (2.0 - 0.2 / (TAU * 20.0))).abs() < 1e-9);
    }
}
