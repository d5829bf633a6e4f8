//! Curvature of steady thrust against command.

use super::{Confusion, Kind, Linearity, Parameter, Part, Search, Shows, Site};
use crate::RotorTerm;

/// A parabola in place of the straight line.
pub static KIND: Kind = Kind {
    id: "quadratic_thrust",
    title: "curvature of the static map",
    site: Site::Map,
    equation: "T = T0 + K (d + curvature_per_duty d^2), d the deviation of the command from the nominal one (from the model's \
               range, for a model that spans one); a part behind_lag of the curvature acts on the speed instead of the command. \
               Beyond the parabola's vertex the thrust stays",
    parameters: &[
        Parameter::fitted("curvature_per_duty", "1/duty", "curvature over slope of the static map")
            .possible(-50.0, 50.0)
            .linear(-3.0, 8.0, &[1.0, 3.0]),
        Parameter::fitted("behind_lag", "", "part of the curvature that lies behind the rotor's lag")
            .possible(0.0, 1.0)
            .linear(0.0, 1.0, &[0.0, 1.0])
            .optional(0.0),
    ],
    signature: "Even lines that grow with the square of the amplitude and follow the static map; the mean thrust rises with the \
                amplitude. The pole is the same at every level and in both directions.",
    confusions: &[
        Confusion {
            with: "operating_point_lag",
            experiment: "A slow staircase around the nominal command: curvature stays however slow it is, a moving pole goes.",
        },
        Confusion {
            with: "asymmetric_lag",
            experiment: "Halve the amplitude: even lines of curvature fall to a quarter, those of unequal lags to a half.",
        },
        Confusion {
            with: "saturation",
            experiment: "Lower the nominal command by the amplitude: curvature stays, clipping goes.",
        },
    ],
    sources: &[
        "thrust is the square of the speed (Leishman, Principles of Helicopter Aerodynamics, ch. 2)",
        "Pintelon & Schoukens, System Identification, 2nd ed., ch. 4: even nonlinearities at even lines",
    ],
    linearity: Linearity::SmallSignal,
    shows: Shows::Anywhere,
    search: Search::Values,
    check: Kind::any,
    part: |values, _| match values[0] {
        0.0 => Part::Nothing,
        curvature => Part::rotor(Curvature { ahead: curvature * (1.0 - values[1]), behind: curvature * values[1] }),
    },
    response: Kind::unity,
};

struct Curvature {
    ahead: f64,
    behind: f64,
}

/// What the parabola adds to `d`; from its vertex on the sum stays.
fn bend(curvature: f64, d: f64) -> f64 {
    let vertex = -0.5 / curvature;
    let beyond = if curvature > 0.0 { d < vertex } else { d > vertex };
    if beyond { 0.5 * vertex - d } else { curvature * d * d }
}

impl RotorTerm for Curvature {
    fn bend(&self, deviation: f64) -> f64 {
        if self.ahead == 0.0 { 0.0 } else { bend(self.ahead, deviation) }
    }

    fn bend_behind(&self, deviation: f64) -> f64 {
        if self.behind == 0.0 { 0.0 } else { bend(self.behind, deviation) }
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
}
