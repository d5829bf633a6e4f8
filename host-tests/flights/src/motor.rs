//! One motor with its propeller.

/// A direct-current equivalent of a brushless motor on a propeller.
#[derive(Clone, Copy, Debug)]
pub struct Motor {
    /// Torque per current, and voltage per speed, N m/A.
    pub torque_constant: f64,
    /// Resistance of windings, wires and ESC, ohms.
    pub resistance: f64,
    /// Inertia of bell and propeller, kg m^2.
    pub inertia: f64,
    /// Drag torque per squared speed, N m s^2.
    pub drag: f64,
    /// Drag torque that a wind along the axis takes off, per speed and wind, N s^2.
    pub drag_inflow: f64,
    /// Thrust per squared speed, N s^2.
    pub thrust: f64,
    /// Thrust that a wind along the axis takes off, per speed and wind, N s^2/m.
    pub thrust_inflow: f64,
}

impl Motor {
    /// Current through the windings, amperes, of a duty 0..1 at a supply voltage and a speed in rad/s.
    #[must_use]
    pub fn current_a(&self, duty: f64, voltage_v: f64, speed: f64) -> f64 {
        (duty * voltage_v - self.torque_constant * speed) / self.resistance
    }

    /// Drag torque, N m, in a wind against the thrust in m/s.
    #[must_use]
    pub fn drag_nm(&self, speed: f64, wind: f64) -> f64 {
        speed * (self.drag * speed - self.drag_inflow * wind)
    }

    /// Thrust, newtons.
    #[must_use]
    pub fn thrust_n(&self, speed: f64, wind: f64) -> f64 {
        speed * (self.thrust * speed - self.thrust_inflow * wind)
    }

    /// Angular acceleration, rad/s^2.
    #[must_use]
    pub fn acceleration(&self, duty: f64, voltage_v: f64, speed: f64, wind: f64) -> f64 {
        (self.torque_constant * self.current_a(duty, voltage_v, speed) - self.drag_nm(speed, wind)) / self.inertia
    }

    /// Speed at rest in still air, rad/s: the root of `Q(w) = K I(w)`.
    #[must_use]
    pub fn steady_speed(&self, duty: f64, voltage_v: f64) -> f64 {
        let back = self.torque_constant.powi(2) / self.resistance;
        let drive = self.torque_constant / self.resistance * duty * voltage_v;
        ((back.powi(2) + 4.0 * self.drag * drive).sqrt() - back) / (2.0 * self.drag)
    }
}
