//! Speeding up and slowing down take different times.

use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site, two_digits};
use crate::rotor::{Motion, RotorEffect};

/// What it is called in files.
pub const ID: &str = "asymmetric_lag";

/// Two time constants, one for each direction.
pub static KIND: Kind = Kind {
    id: ID,
    title: "unequal lags up and down",
    site: Site::Rotor,
    equation: "tau = tau_nominal / sqrt(r) while the drive is above the speed, tau_nominal sqrt(r) while it is below, \
               ln r = ln ratio (1 + growth (g - 0.05) / (g + 0.05)), with g the way from speed to drive as a command",
    parameters: &[
        Parameter::fitted("ratio", "", "time constant downward over that upward")
            .null(1.0)
            .possible(0.02, 50.0)
            .log(0.4, 3.0, &[0.7, 1.3, 1.8])
            .smooth(),
        // Beyond these some ways would be unequal the other way round.
        Parameter::fitted(
            "growth",
            "",
            "growth of the ratio's logarithm with the way to go; at 1 the least ways have equal lags, at -1 the largest",
        )
        .possible(-1.0, 1.0)
        .linear(-1.0, 1.0, &[-0.5, 0.5])
        .smooth()
        .shape(0.0, |growth| {
                let [least, largest] = [1.0 - growth, 1.0 + growth].map(two_digits);
                format!("its ratio is to the power of {least} in the smallest steps, and of {largest} in the largest")
            }),
    ],
    signature: "Rising and falling steps have different time constants, the same ones at every amplitude. Even lines in \
                proportion to the amplitude, and a shift of the mean.",
    confusions: &[
        Confusion {
            with: super::operating_point_lag::ID,
            recipe: &Recipe::DIRECTIONS,
            experiment: "Halve the amplitude: unequal lags stay unequal, a pole that moves with the speed becomes one.",
        },
        Confusion {
            with: super::quadratic_thrust::ID,
            recipe: &Recipe::DIRECTIONS,
            experiment: "A slow staircase shows the static map alone; unequal lags go when it is slow.",
        },
    ],
    remedy: "switch the ESC's active braking on (also called damped or complementary mode), and record again; where it stays, design an \
             inverse (`--kind inverse`), which overshoots in neither direction",
    sources: &[
        "ESCs drive a rotor actively upward and let air slow it down: 1.3 to 2 without active braking",
        "Pintelon & Schoukens, System Identification, 2nd ed., ch. 4: even nonlinearities at even lines",
    ],
    linearity: Linearity::Absent,
    shows: Shows::Anywhere,
    search: Search::Values,
    check: Kind::any,
    part: |values, _| match values[0] {
        1.0 => Part::Nothing,
        ratio => Part::rotor(Asymmetry { faster: ratio.sqrt(), growth: values[1] }),
    },
    response: Kind::unity,
};

/// Ways to go of this size have the ratio that is given: that of the steps and multisines of an experiment.
const TYPICAL_WAY: f64 = 0.05;

struct Asymmetry {
    faster: f64,
    growth: f64,
}

impl RotorEffect for Asymmetry {
    fn pace(&self, motion: &mut Motion) {
        let faster = if self.growth == 0.0 {
            self.faster
        } else {
            let way = (motion.drive - motion.speed).abs();
            self.faster.powf(1.0 + self.growth * (way - TYPICAL_WAY) / (way + TYPICAL_WAY))
        };
        motion.rate_per_s *= if motion.drive >= motion.speed { faster } else { 1.0 / faster };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{active, step};

    #[test]
    fn steps_up_and_down_have_their_own_time_constants() {
        for d in [0.2, -0.01] {
            let tau = if d > 0.0 { 0.1 / 1.69_f64.sqrt() } else { 0.1 * 1.69_f64.sqrt() };
            for (row, y) in step(d, 0.5, &[active(&KIND, &[1.69])]).iter().enumerate() {
                let exact = 10.0 * d * (1.0 - (-(row as f64) * 1e-3 / tau).exp());
                assert!((y - exact).abs() < 1e-8, "row {row}: {y} for {exact}");
            }
        }
    }

    #[test]
    fn a_ratio_that_grows_with_the_way_to_go_has_the_steps_of_its_equation() {
        for (d, growth) in [(0.2, 0.8), (-0.2, 0.8), (0.05, -1.0), (-0.01, 1.0)] {
            // Heun's method, a hundred steps a millisecond.
            let pace = |way: f64| {
                let part = 0.5 * (1.0 + growth * (way.abs() - 0.05) / (way.abs() + 0.05));
                way / 0.1 * 1.69_f64.powf(if d > 0.0 { part } else { -part })
            };
            let (mut way, dt) = (d, 1e-5);
            for (row, &y) in step(d, 0.5, &[active(&KIND, &[1.69, growth])]).iter().enumerate() {
                assert!((y - 10.0 * (d - way)).abs() < 1e-7, "{d}, {growth}, row {row}: {y} for {}", 10.0 * (d - way));
                for _ in 0..100 {
                    way -= 0.5 * dt * (pace(way) + pace(way - dt * pace(way)));
                }
            }
        }
        // Of the typical way the ratio is that without growth, far away its power, and next to the goal another.
        let rate = |drive: f64, growth: f64| {
            let mut motion = Motion { drive, speed: 0.5, anchor: 0.5, rate_per_s: 1.0 };
            Asymmetry { faster: 2.0, growth }.pace(&mut motion);
            motion.rate_per_s
        };
        assert!((rate(0.55, 0.7) - 2.0).abs() < 1e-12 && (rate(0.45, 0.7) - 0.5).abs() < 1e-12);
        assert!((rate(1e9, 1.0) - 4.0).abs() < 1e-6 && (rate(0.5, 1.0) - 1.0).abs() < 1e-12);
    }
}
