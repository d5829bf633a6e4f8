//! How fast the rotor of the stand turns.

/// Thrust of a revolution per minute squared, in newtons: 3 N at 6 000 rpm.
const THRUST_PER_RPM2: f64 = 3.0 / 36.0e6;

/// Revolutions per minute of a rotor of this thrust.
#[must_use]
pub fn rpm(thrust_n: f64) -> f64 {
    (thrust_n.max(0.0) / THRUST_PER_RPM2).sqrt()
}
