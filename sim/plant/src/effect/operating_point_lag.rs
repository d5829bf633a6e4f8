//! The time constant is that of the speed of the moment.

use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site, two_digits};
use crate::rotor::{Motion, RotorEffect};

/// Speeds below a tenth, or above ten times, of that of the model's numbers count as these. Chosen: beyond the range of commands of a
/// flight; without an end a rotor at rest would be infinitely slow.
const FURTHEST: f64 = 10.0;
/// The linear part leaves this of the time constant at least. Chosen: it keeps the time constant above zero however far a search goes.
const LEAST_PART: f64 = 0.2;

/// What it is called in files.
pub const ID: &str = "operating_point_lag";

/// A time constant that moves within a record.
pub static KIND: Kind = Kind {
    id: ID,
    title: "lag that depends on the speed",
    site: Site::Rotor,
    equation: "tau = tau_nominal ((nominal / speed)^exponent - linear (speed / nominal - 1)), with the speed as the command that \
               would keep it, and the nominal command (the command in the model's range, for a model that spans one); at least \
               a fifth of what it is without the linear part",
    parameters: &[
        Parameter::fitted("exponent", "", "power of the speed in one over the time constant")
            .possible(-5.0, 5.0)
            .linear(0.0, 2.5, &[0.5, 1.0])
            .smooth(),
        // As wide as the exponent, whose place it may take, and which it may take back.
        Parameter::fitted("linear", "", "part by which the time constant falls with the speed in a straight line")
            .possible(-5.0, 5.0)
            .linear(-2.0, 2.5, &[-0.7, 0.7])
            .smooth()
            .shape(0.0, |linear| {
                let what = if linear < 0.0 { "adds" } else { "takes off" };
                format!(
                    "beside its power, 10 % more speed {what} {} % of the time constant",
                    two_digits(10.0 * linear.abs())
                )
            }),
    ],
    signature: "The pole moves with the nominal command and within a step: steps up begin slowly, steps down fast, and both by \
                more the larger they are. Even lines that grow with the square of the amplitude.",
    confusions: &[
        Confusion {
            with: super::asymmetric_lag::ID,
            recipe: &Recipe::DIRECTIONS,
            experiment: "Halve the amplitude: the difference between rising and falling steps halves, that of unequal lags stays.",
        },
        Confusion {
            with: super::quadratic_thrust::ID,
            recipe: &Recipe::DIRECTIONS,
            experiment: "A slow staircase: the static map is straight where only the pole moves.",
        },
    ],
    remedy: "design an inverse (`--kind inverse`), whose zero follows the rotor over the commands; that of a lead is right at the fastest \
             operating point alone",
    sources: &[
        "drag torque is the square of the speed, so J dw/dt = k u - c w^2 has the pole 2 c w / J: tau ~ 1/w (Mahony, Kumar & \
         Corke, Multirotor Aerial Vehicles, IEEE RAM 2012)",
        "Table 1 of Charla, Yao & Voyles: the pole rises from 6.3 to 14.1 rad/s as u_nom goes from 0.40 to 0.65",
    ],
    linearity: Linearity::SmallSignal,
    shows: Shows::Anywhere,
    search: Search::Values,
    check: Kind::any,
    part: |values, _| match (values[0], values[1]) {
        (0.0, 0.0) => Part::Nothing,
        (exponent, linear) => Part::rotor(SpeedLag { exponent, linear }),
    },
    response: Kind::unity,
};

struct SpeedLag {
    exponent: f64,
    linear: f64,
}

impl RotorEffect for SpeedLag {
    fn pace(&self, motion: &mut Motion) {
        let relative = (motion.speed / motion.anchor.max(f64::MIN_POSITIVE)).clamp(1.0 / FURTHEST, FURTHEST);
        let power = if self.exponent == 1.0 { relative } else { relative.powf(self.exponent) };
        motion.rate_per_s *= power;
        if self.linear != 0.0 {
            // The time constant over that of the power alone.
            motion.rate_per_s /= (1.0 - self.linear * (relative - 1.0) * power).max(LEAST_PART);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{active, step};

    #[test]
    fn with_tau_as_one_over_speed_a_step_is_logistic() {
        // dx/dt = x (u - x) / (tau nominal): x = u / (1 + (u / x0 - 1) e^(-u t / (tau nominal))).
        for d in [0.3, -0.3, 0.01] {
            let u = 0.5 + d;
            for (row, y) in step(d, 0.8, &[active(&KIND, &[1.0])]).iter().enumerate() {
                let x = u / (1.0 + (u / 0.5 - 1.0) * (-u * row as f64 * 1e-3 / (0.1 * 0.5)).exp());
                // With the command above the lag's target the response lags behind the same rate.
                assert!((y - 10.0 * (x - 0.5)).abs() < 1e-7, "{d}, row {row}: {y} for {}", 10.0 * (x - 0.5));
            }
        }
    }

    #[test]
    fn with_a_linear_tau_alone_a_step_takes_the_time_of_its_integral() {
        // dt = tau (1 - b (x / n - 1)) dx / (u - x): t / tau = (1 + b - b u / n) ln ((u - n) / (u - x)) + b (x - n) / n.
        for (d, b) in [(0.1, 1.5), (-0.1, 1.5), (0.2, -0.8)] {
            let (n, u) = (0.5, 0.5 + d);
            for (row, &y) in step(d, 0.3, &[active(&KIND, &[0.0, b])]).iter().enumerate() {
                let x = n + y / 10.0;
                let time_s = 0.1 * ((1.0 + b - b * u / n) * (d / (u - x)).ln() + b * (x - n) / n);
                assert!((time_s - row as f64 * 1e-3).abs() < 3e-6, "{d}, {b}, row {row}: {time_s}");
            }
        }
    }

    #[test]
    fn both_parts_add_up_and_leave_a_fifth_of_the_power() {
        let rate = |speed: f64, exponent: f64, linear: f64| {
            let mut motion = Motion { drive: 0.5, speed, anchor: 0.5, rate_per_s: 10.0 };
            SpeedLag { exponent, linear }.pace(&mut motion);
            motion.rate_per_s
        };
        for speed in [0.4_f64, 0.5, 0.6] {
            let tau = 0.1 * ((0.5 / speed).powf(1.3) - 0.7 * (speed / 0.5 - 1.0));
            assert!((rate(speed, 1.3, 0.7) * tau - 1.0).abs() < 1e-12, "{speed}");
        }
        assert!((rate(2.0, 1.0, 2.0) / rate(2.0, 1.0, 0.0) - 5.0).abs() < 1e-12);
    }
}
