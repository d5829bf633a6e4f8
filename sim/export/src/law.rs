//! The laws by which stacks describe thrust over motor output, both counted from 0 to 1.

/// A law with one parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ThrustLaw {
    /// `y = p r^2 + (1 - p) r`: PX4, ArduPilot, Indiflight.
    Quadratic,
    /// `r = y (1 + p (1 - y)^2)`: Betaflight, which has the law of the output over the thrust.
    Boost,
}

/// Newton's steps for the inverse of the boost: it converges to the last digit in less than ten. Chosen: halving the bracket, which it does
/// where Newton's step leaves it, then has 1e-15; more change nothing.
const MOST_STEPS: usize = 50;

impl ThrustLaw {
    /// Share of the full thrust at a motor output `r` of 0..1; `None` where the law is no function of `r`.
    pub(super) fn thrust(self, r: f64, parameter: f64) -> Option<f64> {
        match self {
            Self::Quadratic => Some(r * (1.0 - parameter + parameter * r)),
            // Derived: its slope 1 + p (1 - y) (1 - 3 y) is above zero between thrusts of 0 and 1.
            Self::Boost => (parameter > -1.0 && parameter < 3.0).then(|| unboosted(r, parameter)),
        }
    }
}

/// The thrust whose boosted output is `r`: Newton's method, kept between the ends that bracket it.
fn unboosted(r: f64, parameter: f64) -> f64 {
    let (mut low, mut high, mut y) = (0.0, 1.0, r.clamp(0.0, 1.0));
    for _ in 0..MOST_STEPS {
        let excess = y * (1.0 + parameter * (1.0 - y) * (1.0 - y)) - r;
        if excess > 0.0 {
            high = y;
        } else {
            low = y;
        }
        let newton = y - excess / (1.0 + parameter * (1.0 - y) * (1.0 - 3.0 * y));
        let next = if (low..=high).contains(&newton) { newton } else { 0.5 * (low + high) };
        if (next - y).abs() <= f64::EPSILON {
            return next;
        }
        y = next;
    }
    y
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quadratic_law_is_that_of_px4_and_of_ardupilot() {
        // FunctionMotors.hpp of PX4: -b / 2a + sqrt(b^2 / 4a^2 + thrust / a), with a the factor and b = 1 - a.
        // AP_Motors_Thrust_Linearization.cpp: ((e - 1) + sqrt((1 - e)^2 + 4 e thrust)) / 2e.
        for thrust in [0.0, 0.1, 0.25, 0.5, 0.81, 1.0] {
            for p in [0.05_f64, 0.3, 0.65, 1.0] {
                let b = 1.0 - p;
                let px4 = -b / (2.0 * p) + (b * b / (4.0 * p * p) + thrust / p).sqrt();
                assert!((ThrustLaw::Quadratic.thrust(px4, p).unwrap() - thrust).abs() < 1e-12, "{thrust} {p}");
            }
            for e in [-1.0_f64, -0.3, 0.65, 1.0] {
                let ardupilot = ((e - 1.0) + ((1.0 - e) * (1.0 - e) + 4.0 * e * thrust).sqrt()) / (2.0 * e);
                assert!((ThrustLaw::Quadratic.thrust(ardupilot, e).unwrap() - thrust).abs() < 1e-12, "{thrust} {e}");
            }
        }
    }

    #[test]
    fn the_boost_is_that_of_betaflight() {
        // Pull request 9740: "thrust linear of 50 results in a 50% increase of motor drive at zero throttle".
        let small = 1e-6;
        assert!((ThrustLaw::Boost.thrust(1.5 * small, 0.5).unwrap() / small - 1.0).abs() < 1e-5);
        for p in [-0.9, 0.0, 0.25, 1.0, 1.5, 2.9] {
            for y in [0.0, 0.01, 0.2, 0.5, 2.0 / 3.0, 0.9, 1.0] {
                let output = y * (1.0 + p * (1.0 - y) * (1.0 - y));
                assert!((ThrustLaw::Boost.thrust(output, p).unwrap() - y).abs() < 1e-9, "{p} {y}");
            }
        }
        assert_eq!(ThrustLaw::Boost.thrust(0.5, 3.0), None);
        assert_eq!(ThrustLaw::Boost.thrust(0.5, -1.0), None);
    }
}
