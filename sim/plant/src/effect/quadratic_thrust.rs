//! Curvature of steady thrust against command.

use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site, two_digits};
use crate::rotor::RotorEffect;

/// What it is called in files.
pub const ID: &str = "quadratic_thrust";

/// A parabola in place of the straight line.
pub static KIND: Kind = Kind {
    id: ID,
    title: "curvature of the static map",
    site: Site::Map,
    equation: "T = T0 + K (d + curvature_per_duty d^2 + cubic_per_duty2 d^3), d the deviation of the command from the nominal one \
               (from the model's range, for a model that spans one); a part behind_lag of the curvature, and of the cubic term, acts \
               on the speed instead of the command. Beyond the first extremum on either side the thrust stays",
    parameters: &[
        Parameter::fitted("curvature_per_duty", "1/duty", "curvature over slope of the static map")
            .possible(-50.0, 50.0)
            .linear(-3.0, 8.0, &[1.0, 3.0]),
        Parameter::fitted("behind_lag", "", "part of the curvature that lies behind the rotor's lag")
            .possible(0.0, 1.0)
            .linear(0.0, 1.0, &[0.0, 1.0])
            .optional(0.0),
        // A thrust that is a power 1 to 3 of the command has up to 2 at a nominal command of 0.4; a map that goes over into a
        // straight line or a limit near the nominal command has ten times that, 7 % of the slope at a deviation of 0.05.
        Parameter::fitted("cubic_per_duty2", "1/duty^2", "cubic term over slope of the static map")
            .possible(-1000.0, 1000.0)
            .linear(-30.0, 30.0, &[-10.0, 10.0])
            .smooth()
            .shape(0.0, |cubic| {
                let how = if cubic < 0.0 { "flatter" } else { "steeper" };
                let off_percent = two_digits(100.0 * 3.0 * cubic.abs() * 0.05_f64.powi(2));
                format!("0.05 duty to either side it is {how} than a parabola, by {off_percent} % of its slope")
            }),
    ],
    signature: "Even lines that grow with the square of the amplitude and follow the static map; the mean thrust rises with the \
                amplitude. The pole is the same at every level and in both directions.",
    confusions: &[
        Confusion {
            with: super::operating_point_lag::ID,
            recipe: &Recipe::DIRECTIONS,
            experiment: "A slow staircase around the nominal command: curvature stays however slow it is, a moving pole goes.",
        },
        Confusion {
            with: super::asymmetric_lag::ID,
            recipe: &Recipe::DIRECTIONS,
            experiment: "Halve the amplitude: even lines of curvature fall to a quarter, those of unequal lags to a half.",
        },
        Confusion {
            with: super::saturation::ID,
            recipe: &Recipe::LOWERED,
            experiment: "Lower the nominal command by the amplitude: curvature stays, clipping goes.",
        },
    ],
    remedy: "let the flight controller straighten the map: `rotorlead export` writes `thrust_linear` of Betaflight, `THR_MDL_FAC` of PX4 and \
             `MOT_THST_EXPO` of ArduPilot",
    sources: &[
        "thrust is the square of the speed (Leishman, Principles of Helicopter Aerodynamics, ch. 2)",
        "Pintelon & Schoukens, System Identification, 2nd ed., ch. 4: even nonlinearities at even lines",
    ],
    linearity: Linearity::SmallSignal,
    shows: Shows::Anywhere,
    search: Search::Values,
    check: Kind::any,
    part: |values, _| match (values[0], values[2]) {
        (0.0, 0.0) => Part::Nothing,
        (curvature, cubic) => {
            let bend = |part: f64| Bend::new(curvature * part, cubic * part);
            Part::rotor(Curvature { ahead: bend(1.0 - values[1]), behind: bend(values[1]) })
        }
    },
    response: Kind::unity,
};

struct Curvature {
    ahead: Bend,
    behind: Bend,
}

/// `curvature d^2 + cubic d^3` between the extrema of `d + curvature d^2 + cubic d^3` next to 0, beyond which that sum stays.
struct Bend {
    curvature: f64,
    cubic: f64,
    /// Where the sum is least on the way down, and greatest on the way up, and what it is there.
    lowest: (f64, f64),
    highest: (f64, f64),
}

impl Bend {
    fn new(curvature: f64, cubic: f64) -> Self {
        let mut bend =
            Self { curvature, cubic, lowest: (f64::NEG_INFINITY, f64::NAN), highest: (f64::INFINITY, f64::NAN) };
        // Zeros of the slope, 1 + 2 curvature d + 3 cubic d^2, as one over what goes to 0 where there is but one of them.
        let root = (curvature * curvature - 3.0 * cubic).sqrt();
        for divisor in [-curvature - root, -curvature + root] {
            let at = 1.0 / divisor;
            // There cubic d^2 is -(1 + 2 curvature d) / 3.
            let stays = if cubic == 0.0 { 0.5 * at } else { at * (2.0 + curvature * at) / 3.0 };
            if at < 0.0 && at > bend.lowest.0 {
                bend.lowest = (at, stays);
            } else if at > 0.0 && at < bend.highest.0 {
                bend.highest = (at, stays);
            }
        }
        bend
    }

    fn at(&self, d: f64) -> f64 {
        if d < self.lowest.0 {
            self.lowest.1 - d
        } else if d > self.highest.0 {
            self.highest.1 - d
        } else {
            (self.curvature + self.cubic * d) * d * d
        }
    }
}

impl RotorEffect for Curvature {
    fn input_nonlinearity(&self, deviation: f64) -> f64 {
        self.ahead.at(deviation)
    }

    fn output_nonlinearity(&self, deviation: f64) -> f64 {
        self.behind.at(deviation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{active, step};

    #[test]
    fn ahead_of_the_lag_steps_have_another_height_and_the_same_time_constant() {
        for (d, c) in [(0.1, 3.0), (-0.1, 3.0), (0.05, -2.0)] {
            for (row, y) in step(d, 0.5, &[active(&KIND, &[c, 0.0])]).iter().enumerate() {
                let exact = 10.0 * (d + c * d * d) * (1.0 - (-(row as f64) * 0.01).exp());
                assert!((y - exact).abs() < 1e-9, "row {row}: {y} for {exact}");
            }
        }
    }

    #[test]
    fn behind_the_lag_it_is_the_square_of_the_lagged_step() {
        for (row, y) in step(0.1, 0.5, &[active(&KIND, &[3.0, 1.0])]).iter().enumerate() {
            let x = 0.1 * (1.0 - (-(row as f64) * 0.01).exp());
            assert!((y - 10.0 * (x + 3.0 * x * x)).abs() < 1e-9);
        }
    }

    #[test]
    fn beyond_the_vertex_thrust_stays() {
        for c in [6.0, -6.0_f64] {
            let last = |d: f64| step(-d.copysign(c), 2.0, &[active(&KIND, &[c, 0.0])])[1999];
            assert!((last(0.3) - last(0.2)).abs() < 1e-7 && (last(0.3).abs() - 10.0 / 24.0).abs() < 1e-7);
        }
    }

    #[test]
    fn a_cubic_term_bends_steps_ahead_of_the_lag_and_behind_it() {
        for (d, c, q) in [(0.1, 0.0, 20.0), (-0.1, 3.0, -9.0), (0.05, -2.0, 30.0)] {
            let bent = |d: f64| 10.0 * (d + c * d * d + q * d * d * d);
            let ahead = step(d, 0.5, &[active(&KIND, &[c, 0.0, q])]);
            let behind = step(d, 0.5, &[active(&KIND, &[c, 1.0, q])]);
            for (row, (ahead, behind)) in ahead.iter().zip(&behind).enumerate() {
                let settled = 1.0 - (-(row as f64) * 0.01).exp();
                assert!((ahead - bent(d) * settled).abs() < 1e-9, "row {row}: {ahead}");
                assert!((behind - bent(d * settled)).abs() < 1e-9, "row {row}: {behind}");
            }
        }
    }

    #[test]
    fn beyond_the_extrema_next_to_the_nominal_command_the_sum_stays() {
        // On a fine grid from 0 on, with the greatest size that the free sum has before it turns.
        for (c, q) in [(0.0, -20.0), (3.0, -9.0), (-4.0, 3.0), (4.0, 5.0), (0.0, 25.0), (2.0, 1e-13), (-6.0, 11.0)] {
            let bend = Bend::new(c, q);
            let sum = |d: f64| d + bend.at(d);
            for way in [1e-4, -1e-4] {
                let (mut most, mut has_turned) = (0.0_f64, false);
                for k in 1..=5000 {
                    let d = way * f64::from(k);
                    let free = d + c * d * d + q * d * d * d;
                    has_turned |= free.abs() < most - 1e-15;
                    if !has_turned {
                        most = free.abs();
                    }
                    let expected = if has_turned { most.copysign(way) } else { free };
                    assert!((sum(d) - expected).abs() < 1e-6, "{c}, {q} at {d}: {} for {expected}", sum(d));
                }
            }
        }
    }
}
