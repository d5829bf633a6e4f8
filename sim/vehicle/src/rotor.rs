//! The rotor over its whole range: pole and thrust as functions of its state.

use rotorlead_plant::{Model, OperatingCurve};

use crate::VehicleError;

/// Below this part of full command the pole of a rotor is no longer taken to fall. Chosen: the lowest command that an ESC gets by default;
/// without a floor a rotor at rest would never start.
const SLOWEST_COMMAND: f64 = 0.05;
/// Halvings of the range of commands until the command of a thrust is known. Derived: to 1e-12 of the range, `1 / 2^40`.
const HALVINGS: usize = 40;

/// A motor with its propeller: `dv/dt = p(v) (u - v)`, thrust `T(v)`. The state `v` is the command whose steady thrust it has.
///
/// - **Pole** `p = 1 / tau`: that of the model at its points, linear between them, and in proportion to the command beyond them, as
///   the pole of a rotor goes with its speed.
/// - **Thrust**: the integral of the model's gain, linear between the points. It is 0 at the first point: only differences count.
#[derive(Clone, Debug)]
pub struct Rotor {
    /// Command and pole in rad/s, in order of the command.
    poles: Vec<(f64, f64)>,
    thrust: OperatingCurve,
}

impl Rotor {
    /// The rotor of `model`, without its effects.
    ///
    /// # Errors
    /// When the model is impossible or its gain is not above zero.
    pub fn new(model: &Model) -> Result<Self, VehicleError> {
        // Of a static map the slope may jump from piece to piece; margins are computed from gains.
        let bare = Model { static_map: None, ..model.clone() };
        let thrust = OperatingCurve::without_effects(&bare)?;
        if let Some(point) = model.points.iter().find(|point| point.gain <= 0.0) {
            return Err(VehicleError::FallingThrust { nominal: point.nominal, gain: point.gain });
        }
        let poles = match &model.time_constant_curve {
            Some(band) => {
                band.nominal.iter().zip(&band.time_constant_s).map(|(&at, &tau_s)| (at, 1.0 / tau_s)).collect()
            }
            None => model.points.iter().map(|point| (point.nominal, 1.0 / point.time_constant_s)).collect(),
        };
        Ok(Self { poles, thrust })
    }

    /// The pole at the state `v`, rad/s.
    #[must_use]
    pub fn pole_rad_s(&self, v: f64) -> f64 {
        let v = v.max(SLOWEST_COMMAND);
        let above = self.poles.partition_point(|&(command, _)| command < v);
        let beyond = |(command, pole): (f64, f64)| pole * v / command.max(SLOWEST_COMMAND);
        match (above.checked_sub(1).map(|below| self.poles[below]), self.poles.get(above)) {
            (Some(low), Some(&high)) => low.1 + (v - low.0) / (high.0 - low.0) * (high.1 - low.1),
            (None, Some(&end)) | (Some(end), None) => beyond(end),
            (None, None) => f64::NAN,
        }
    }

    /// Dead time of the model at `command`, seconds.
    #[must_use]
    pub fn delay_s(&self, command: f64) -> f64 {
        self.thrust.clamped_at(command).lag.delay_s
    }

    /// Slope of the thrust at `command`, newtons per unit of command.
    #[must_use]
    pub fn gain_n(&self, command: f64) -> f64 {
        self.thrust.clamped_at(command).lag.gain
    }

    /// Thrust at the state `v` over that at the model's first point, newtons.
    #[must_use]
    pub fn thrust_n(&self, v: f64) -> f64 {
        self.thrust.steady_response(v)
    }

    /// The command from `min` to `max` with the steady thrust `thrust_n`, or the nearer end.
    #[must_use]
    pub fn command_for(&self, thrust_n: f64, (min, max): (f64, f64)) -> f64 {
        let (mut low, mut high) = (min, max);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if self.thrust_n(middle) < thrust_n {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }

    /// The state after `u` was held for `duration_s`: the midpoint rule, with the exact decay at the middle's pole.
    #[must_use]
    pub fn advanced(&self, v: f64, u: f64, duration_s: f64) -> f64 {
        let moved = |pole: f64, duration_s: f64| v - (u - v) * (-pole * duration_s).exp_m1();
        let middle = moved(self.pole_rad_s(v), 0.5 * duration_s);
        moved(self.pole_rad_s(middle), duration_s)
    }
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::testing::{model, table_1};

    use super::*;

    #[test]
    fn it_has_the_poles_and_gains_of_the_model() {
        let rotor = Rotor::new(&table_1()).unwrap();
        for point in table_1().points {
            assert!((rotor.pole_rad_s(point.nominal) * point.time_constant_s - 1.0).abs() < 1e-12);
            assert!((rotor.gain_n(point.nominal) - point.gain).abs() < 1e-12);
        }
        assert!((rotor.pole_rad_s(0.475) - 0.5 * (7.3524 + 9.2889)).abs() < 1e-9);
        assert!((rotor.pole_rad_s(0.2) - 0.5 * 6.2758).abs() < 1e-9, "half the speed, half the pole");
        assert!(rotor.pole_rad_s(1.0) > rotor.pole_rad_s(0.65) && rotor.pole_rad_s(0.0) > 0.0);
    }

    #[test]
    fn the_command_of_a_thrust_is_the_inverse_of_the_thrust() {
        let rotor = Rotor::new(&table_1()).unwrap();
        for command in [0.06, 0.3, 0.45, 0.5, 0.61, 0.99] {
            assert!((rotor.command_for(rotor.thrust_n(command), (0.05, 1.0)) - command).abs() < 1e-9);
        }
        assert!((rotor.command_for(1e3, (0.05, 1.0)) - 1.0).abs() < 1e-9, "more than there is");
    }

    #[test]
    fn a_step_of_a_rotor_with_one_pole_is_an_exponential() {
        // One pole at both ends of the step: the same between them.
        let rotor = Rotor::new(&model(&[(0.4, 8.0, 0.1, 0.0), (0.6, 8.0, 0.1, 0.0)])).unwrap();
        let mut v = 0.45;
        for _ in 0..500 {
            v = rotor.advanced(v, 0.55, 2e-4);
        }
        assert!((v - (0.55 - 0.1 * (-1.0_f64).exp())).abs() < 1e-12, "{v}");
    }

    #[test]
    fn a_thrust_that_falls_with_the_command_is_refused() {
        let error = Rotor::new(&model(&[(0.4, 8.0, 0.1, 0.0), (0.6, -8.0, 0.1, 0.0)])).unwrap_err();
        assert!(matches!(error, VehicleError::FallingThrust { nominal: 0.6, .. }), "{error}");
    }
}
