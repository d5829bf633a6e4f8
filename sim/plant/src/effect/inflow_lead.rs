//! Thrust overshoots until the air moves.

use num_complex::Complex64;

use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site};
use crate::filter::{Interval, MEMORY_TIME_CONSTANTS, Mode, ResponseStage};
use crate::stage::Memory;

/// What it is called in files.
pub const ID: &str = "inflow_lead";

/// A lead from speed to thrust.
pub static KIND: Kind = Kind {
    id: ID,
    title: "lead of the inflow",
    site: Site::Air,
    equation: "(1 + lead_ratio time_constant_s s) / (1 + time_constant_s s)",
    parameters: &[
        Parameter::fitted(
            "lead_ratio",
            "",
            "thrust just after a change of speed over that after the inflow has followed",
        )
        .null(1.0)
        .possible(0.0, 20.0)
        .log(1.0, 3.5, &[1.3, 2.0]),
        Parameter::fitted("time_constant_s", "s", "how long the inflow takes to follow")
            .null(f64::NAN)
            .possible(1e-5, 10.0)
            .log(0.0015, 0.03, &[0.004, 0.012]),
    ],
    signature: "Above 1 / (2 pi time_constant_s) thrust is larger, and leads, what the speed alone would give; the same at every \
                amplitude. The speed itself does not show it.",
    confusions: &[
        Confusion {
            with: super::supply_sag::ID,
            recipe: &Recipe::LONG_LOADS,
            experiment: "Excite from 0.05 Hz: the step of the gain lies above ten hertz for inflow, below a few for sag. The \
                         voltage does not show it.",
        },
        Confusion {
            with: super::parameter_error::ID,
            recipe: &Recipe::LONG_LOADS,
            experiment: "Log the speed too, or excite up to five times 1 / (2 pi time_constant_s): the lead ends at lead_ratio.",
        },
        Confusion {
            with: super::stand_resonance::ID,
            recipe: &Recipe::HIGH_FREQUENCIES,
            experiment: "A hammer on the stand with the motor off: the air's lead is gone, the stand's mode is not.",
        },
    ],
    remedy: "nothing is to be repaired: the air leads in flight too, so keep it in the model that a compensator is designed for (`--out-model`)",
    sources: &[
        "Carpenter & Fridovich, Effect of a Rapid Blade-Pitch Increase on the Thrust and Induced-Velocity Response of a \
         Full-Scale Helicopter Rotor, NACA TN 3044, 1953",
        "Leishman, Principles of Helicopter Aerodynamics, ch. 10: dynamic inflow",
    ],
    linearity: Linearity::Exact,
    shows: Shows::InForce,
    search: Search::Values,
    check: Kind::any,
    part: |values, _| match values[0] {
        1.0 => Part::Nothing,
        ratio => {
            let rate_per_s = 1.0 / values[1];
            Part::response(InflowLead { ratio, rate_per_s, mode: Mode::new(-rate_per_s) })
        }
    },
    response: |values, _, omega_rad_s| {
        if values[0] == 1.0 {
            return Complex64::ONE;
        }
        let x = omega_rad_s * values[1];
        Complex64::new(1.0, values[0] * x) / Complex64::new(1.0, x)
    },
};

/// `ratio u + (1 - ratio) w`, `w` the lagged `u`.
struct InflowLead {
    ratio: f64,
    rate_per_s: f64,
    mode: Mode<f64>,
}

impl InflowLead {
    fn output(&self, input: f64, slope: f64) -> (f64, f64) {
        let lagged = self.mode.state() * self.rate_per_s;
        let lagged_slope = (input - lagged) * self.rate_per_s;
        let rest = 1.0 - self.ratio;
        (self.ratio * input + rest * lagged, self.ratio * slope + rest * lagged_slope)
    }
}

impl ResponseStage for InflowLead {
    fn settle(&mut self, level: f64) -> f64 {
        self.mode.settle(level);
        level
    }

    fn advance(&mut self, signal: &mut Interval) {
        let (start, start_slope) = self.output(signal.start, signal.start_slope);
        self.mode.advance(signal);
        (signal.end, signal.end_slope) = self.output(signal.end, signal.end_slope);
        (signal.start, signal.start_slope) = (start, start_slope);
    }

    fn memory(&self) -> Memory {
        Memory::Seconds(MEMORY_TIME_CONSTANTS / self.rate_per_s)
    }

    fn time_scale_s(&self) -> f64 {
        1.0 / self.rate_per_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{active, step};

    #[test]
    fn a_lagged_step_gets_its_partial_fractions() {
        // (1 + r t2 s) / ((1 + t1 s)(1 + t2 s)) on a step.
        let (r, t1, t2) = (1.8, 0.1, 0.008);
        for (row, y) in step(0.1, 0.3, &[active(&KIND, &[r, t2])]).iter().enumerate() {
            let t = row as f64 * 1e-3;
            let (slow, fast) = ((t1 - r * t2) / (t1 - t2), (r * t2 - t2) / (t1 - t2));
            let exact = 1.0 - slow * (-t / t1).exp() - fast * (-t / t2).exp() * 1.0;
            let exact = exact + (slow + fast - 1.0) * (-t / t2).exp();
            assert!((y - exact).abs() < 1e-9, "row {row}: {y} for {exact}");
        }
    }
}
