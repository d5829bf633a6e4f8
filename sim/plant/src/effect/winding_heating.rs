//! The windings heat up with the load, and a hot motor is a weaker one.

use num_complex::Complex64;

use super::supply_sag::{HOVER, speed_at_rest};
use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site};
use crate::filter::MEMORY_TIME_CONSTANTS;
use crate::rotor::{Motion, RotorBase, RotorEffect};

/// A motor that has lost so much of its drive has burnt. Chosen: it keeps a search's drive above zero, and no model of a flight comes near
/// it.
const LEAST_REMAINING_DRIVE: f64 = 0.1;

/// What it is called in files.
pub const ID: &str = "winding_heating";

/// Copper's resistance grows with its temperature, and magnets weaken.
pub static KIND: Kind = Kind {
    id: ID,
    title: "heating of the windings",
    site: Site::Supply,
    equation: "heat_s dh/dt = heat_drop (speed / 0.5)^4 - h; the motor gets u (1 - h) / (1 - h_nominal), with h_nominal the \
               steady heat at the nominal command (0 for a model that spans a range)",
    parameters: &[
        Parameter::fitted("heat_drop", "", "the part of the drive that is lost to steady heat at a speed of 0.5")
            .possible(0.0, 0.2)
            .linear(0.0, 0.05, &[0.005, 0.02]),
        Parameter::fitted("heat_s", "s", "the time constant of the heat").null(f64::NAN).possible(0.1, 1000.0).log(
            1.0,
            30.0,
            &[2.0, 6.0],
        ),
    ],
    signature: "After a step up the response goes too far and creeps back for seconds, after a large step down it undershoots and \
                creeps up; the same command settles lower after a high load than before. The current creeps along, the voltage \
                does not.",
    confusions: &[
        Confusion {
            with: super::supply_sag::ID,
            recipe: &Recipe::LONG_LOADS,
            experiment: "Log the voltage: it creeps with the polarization of a battery, and not with the windings.",
        },
        Confusion {
            with: super::gain_drift::ID,
            recipe: &Recipe::LONG_LOADS,
            experiment: "Hold a low level for long before and after a high one: drift keeps to the clock, heat comes with the load \
                         and goes with it.",
        },
        Confusion {
            with: super::quadratic_thrust::ID,
            recipe: &Recipe::LONG_LOADS,
            experiment: "A staircase up and down again: curvature is the same both ways, heat is not.",
        },
    ],
    remedy: "leave a margin of throttle for the hot motor, or cool it better; let it cool down before each record",
    sources: &[
        "Hughes & Drury, Electric Motors and Drives, 5th ed., 2019, ch. 11: the loss in the copper is the square of the current, \
         and its resistance grows by 0.4 % per kelvin",
        "the current is that of the torque, which of a propeller is the square of the speed; windings of hobby motors weigh some \
         ten grams and heat within seconds",
    ],
    linearity: Linearity::SmallSignal,
    shows: Shows::OverLevels,
    search: Search::Values,
    check: Kind::any,
    part: |values, base| match values[0] {
        0.0 => Part::Nothing,
        _ => Part::rotor(Heating::new(values, base)),
    },
    response: |values, point, omega_rad_s| {
        let heating = Heating::new(values, &RotorBase::Linear(*point));
        // h' = 4 h / speed, and at the nominal command speed and drive are one.
        let slope = 4.0 * heating.steady(point.nominal) / heating.nominal_remaining_drive;
        let slow = Complex64::from(slope) / Complex64::new(1.0, omega_rad_s * heating.heat_s);
        let lag = Complex64::new(1.0, omega_rad_s * point.lag.time_constant_s);
        lag / (lag + slow)
    },
};

struct Heating {
    heat_drop: f64,
    heat_s: f64,
    /// Part of the drive that is left where the base model holds.
    nominal_remaining_drive: f64,
}

impl Heating {
    fn new(values: &[f64], base: &RotorBase) -> Self {
        let mut heating = Self { heat_drop: values[0], heat_s: values[1], nominal_remaining_drive: 1.0 };
        heating.nominal_remaining_drive = remaining_drive(heating.steady(base.reference_supply_command()));
        heating
    }

    /// The heat in the end at a speed.
    fn steady(&self, speed: f64) -> f64 {
        self.heat_drop * (speed.max(0.0) / HOVER).powi(4)
    }
}

/// What is left of the drive.
fn remaining_drive(heat: f64) -> f64 {
    (1.0 - heat).max(LEAST_REMAINING_DRIVE)
}

impl RotorEffect for Heating {
    fn at_rest(&self, motion: &mut Motion) -> f64 {
        motion.drive =
            speed_at_rest(motion.drive, self.nominal_remaining_drive, |speed| remaining_drive(self.steady(speed)));
        self.steady(motion.drive)
    }

    fn state_derivative(&self, own: f64, motion: &mut Motion) -> f64 {
        motion.drive *= remaining_drive(own) / self.nominal_remaining_drive;
        (self.steady(motion.speed) - own) / self.heat_s
    }

    fn memory_s(&self) -> f64 {
        MEMORY_TIME_CONSTANTS * self.heat_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{active, step};

    #[test]
    fn a_step_overshoots_and_creeps_back_as_the_windings_heat() {
        let effect = active(&KIND, &[0.02, 2.0]);
        let response = step(0.2, 20.0, &[effect]);
        // At the end x = 0.7 (1 - 0.02 (x / 0.5)^4) / 0.98.
        let speed = 0.5 + response[response.len() - 1] / 10.0;
        assert!((speed - 0.7 * (1.0 - 0.02 * (speed / 0.5).powi(4)) / 0.98).abs() < 1e-6, "{speed}");
        // Cold, the motor follows the command in full.
        let peak = response.iter().copied().fold(0.0, f64::max);
        assert!(peak > 10.0 * (speed - 0.5) * 1.1 && peak < 10.0 * (0.7 - 0.5), "{peak}");
    }
}
