//! The laws by which stacks describe thrust over motor output, both counted from 0 to 1.

/// A law with one parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ThrustLaw {
    /// `y = p r^2 + (1 - p) r`: PX4, ArduPilot, Indiflight.
    Quadratic,
    /// `r = y (1 + p (1 - y)^2)`: Betaflight up to 2025.12, which has the law of the output over the thrust.
    Boost,
    /// `r = y (1 + p (1 - y) (1 + p (1 - 2 y)))`: Betaflight from 2026.6 on, the inverse of [`Self::Quadratic`] to the second order of `p`.
    InverseSeries,
}

/// Newton's steps for the output's inverse: it converges to the last digit in less than ten. Chosen: halving the bracket, which it does
/// where Newton's step leaves it, then has 1e-15; more change nothing.
const MOST_STEPS: usize = 50;

impl ThrustLaw {
    /// Share of the full thrust at a motor output `r` of 0..1; `None` where the law is no function of `r`.
    pub(super) fn thrust(self, r: f64, p: f64) -> Option<f64> {
        match self {
            Self::Quadratic => Some(r * (1.0 - p + p * r)),
            // Derived: the slope is above zero between thrusts of 0 and 1.
            Self::Boost => (p > -1.0 && p < 3.0)
                .then(|| thrust_at(r, |y| (y * (1.0 + p * (1.0 - y).powi(2)), 1.0 + p * (1.0 - y) * (1.0 - 3.0 * y)))),
            // Derived: the slope is least at y = 1/2 + 1/(6 p), where it is 5/6 - p^2/2.
            Self::InverseSeries => (p * p < 5.0 / 3.0).then(|| {
                let output = |y: f64| y * (1.0 + p * (1.0 - y) * (1.0 + p * (1.0 - 2.0 * y)));
                let slope = |y: f64| 1.0 + p * (1.0 - 2.0 * y) + p * p * (1.0 - 6.0 * y * (1.0 - y));
                thrust_at(r, |y| (output(y), slope(y)))
            }),
        }
    }
}

/// The thrust from 0 to 1 whose output, here with its slope, is `r`: Newton's method, kept between the ends that bracket it.
fn thrust_at(r: f64, output_and_slope: impl Fn(f64) -> (f64, f64)) -> f64 {
    let (mut low, mut high, mut y) = (0.0, 1.0, r.clamp(0.0, 1.0));
    for _ in 0..MOST_STEPS {
        let (output, slope) = output_and_slope(y);
        let excess = output - r;
        if excess > 0.0 {
            high = y;
        } else {
            low = y;
        }
        let newton = y - excess / slope;
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

    #[test]
    fn the_series_is_that_of_betaflight_and_near_the_quadratic_law() {
        for p in [-1.2_f64, -0.4, 0.0, 0.55, 1.0, 1.29] {
            for y in [0.0, 0.01, 0.2, 0.5, 0.7, 0.9, 1.0_f64] {
                // pidApplyThrustLinearization of pull request 15226, with its names.
                let inv = 1.0 - y;
                let output = y * (1.0 + p * inv * (1.0 + p * (inv - y)));
                assert!((ThrustLaw::InverseSeries.thrust(output, p).unwrap() - y).abs() < 1e-9, "{p} {y}");
                // What the series leaves is of the third order.
                if p.abs() < 0.5 {
                    let miss = ThrustLaw::Quadratic.thrust(output, p).unwrap() - y;
                    assert!(miss.abs() < 0.1 * p.abs().powi(3) + 1e-12, "{p} {y} {miss}");
                }
            }
        }
        assert_eq!(ThrustLaw::InverseSeries.thrust(0.5, 1.3), None);
    }
}
