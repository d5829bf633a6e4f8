//! The supply's voltage falls with the current.

use num_complex::Complex64;

use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site, two_digits};
use crate::filter::MEMORY_TIME_CONSTANTS;
use crate::rotor::{Motion, RotorBase, RotorEffect, Supply};

/// The speed, as a command, at which losses of the drive are counted.
pub(super) const HOVER: f64 = 0.5;
/// An ESC stops before its supply is down to this part of its voltage. Chosen: it keeps a search's drive above zero, and no model of a
/// flight comes near it.
const LEAST_PART: f64 = 0.1;

/// What it is called in files.
pub const ID: &str = "supply_sag";

/// A resistance, and a slow polarization, in series with an ideal source.
pub static KIND: Kind = Kind {
    id: ID,
    title: "sag of the supply",
    site: Site::Supply,
    equation: "V/V0 = 1 - resistive_drop i - p, polarization_s dp/dt = polarization_drop i - p, i = (1 - square_part) s^3 + square_part s^2, s = \
               speed / 0.5; the motor gets u V / V_nominal, with V_nominal the steady voltage at the nominal command (V0 for a model that \
               spans a range)",
    parameters: &[
        Parameter::fitted("polarization_drop", "", "the part of the voltage that is slowly lost at a speed of 0.5")
            .possible(0.0, 0.5)
            .linear(0.0, 0.2, &[0.05, 0.1]),
        Parameter::fitted("polarization_s", "s", "the time constant of the slow loss")
            .null(f64::NAN)
            .possible(0.01, 1000.0)
            .log(0.15, 60.0, &[0.3, 1.0, 3.0]),
        Parameter::fitted("resistive_drop", "", "the part of the voltage that is lost at once at a speed of 0.5")
            .possible(0.0, 0.5)
            .linear(0.0, 0.2, &[0.0, 0.04])
            .optional(0.0),
        Parameter::fitted(
            "square_part",
            "",
            "the part of the current that grows with the speed's square; the rest is a propeller's cube",
        )
        .possible(-3.0, 3.0)
        .linear(-2.0, 1.5, &[0.7])
        .shape(0.0, |square_part| {
            let power = two_digits(3.0 - square_part);
            format!("at a speed of 0.5 its current grows with the power {power} of the speed, not 3")
        }),
        Parameter::fitted("open_circuit_v", "V", "voltage without load; 0 where it is not known")
            .possible(0.0, 1000.0)
            .linear(3.0, 60.0, &[16.0])
            .optional(0.0),
        Parameter::fitted("hover_current_a", "A", "current at a speed of 0.5; 0 where it is not known")
            .possible(0.0, 1000.0)
            .linear(0.5, 60.0, &[10.0])
            .optional(0.0),
    ],
    signature: "Below 1 / (2 pi polarization_s) the gain is lower than above, with a small phase lead between; more so at higher \
                nominal commands. Steps overshoot and creep back. It shows in the voltage. The resistance alone looks like a \
                lower gain and a shorter time constant.",
    confusions: &[
        Confusion {
            with: super::gain_drift::ID,
            recipe: &Recipe::LONG_LOADS,
            experiment: "Log the voltage, or repeat the same record: drift goes on from period to period, sag repeats.",
        },
        Confusion {
            with: super::inflow_lead::ID,
            recipe: &Recipe::LONG_LOADS,
            experiment: "Excite from 0.05 Hz: the step of the gain lies below a few hertz for sag, above ten for inflow. A bench \
                         supply in place of the battery removes sag.",
        },
        Confusion {
            with: super::winding_heating::ID,
            recipe: &Recipe::LONG_LOADS,
            experiment: "Log the voltage: it falls with a sag, and not where the windings heat.",
        },
        Confusion {
            with: super::parameter_error::ID,
            recipe: &Recipe::LONG_LOADS,
            experiment: "Log the voltage: a wrong gain leaves it alone.",
        },
    ],
    remedy: "record with the battery that flies: one of less resistance sags less. Let the flight controller scale its commands by the \
             voltage (Betaflight `vbat_sag_compensation`, PX4 `MC_BAT_SCALE_EN`, ArduPilot `MOT_BAT_VOLT_MAX`)",
    sources: &[
        "Plett, Battery Management Systems, vol. 1, 2015, ch. 2: series resistance and one RC pair (Thevenin model)",
        "the mean voltage at the motor is duty times supply voltage, so a supply gives the power of the propeller, the cube of \
         its speed, by its voltage; 5 to 15 % of sag at hover, 0.3 to 3 s",
        "a battery polarizes in seconds and in minutes: Chen & Rincon-Mora, Accurate electrical battery model capable of predicting \
         runtime and I-V performance, IEEE Trans. Energy Conversion 21(2), 2006",
    ],
    linearity: Linearity::SmallSignal,
    shows: Shows::Anywhere,
    search: Search::Values,
    check: Kind::any,
    part: |values, base| match (values[0], values[2]) {
        // A supply that is stiff still has a voltage to show.
        (0.0, 0.0) if values[4] == 0.0 => Part::Nothing,
        _ => Part::rotor(SupplySag::new(values, base)),
    },
    response: |values, point, omega_rad_s| {
        let sag = SupplySag::new(values, &RotorBase::Linear(*point));
        // At the nominal command speed and drive are one.
        let slope = sag.current_growth(point.nominal) / sag.nominal_part;
        let slow = Complex64::from(sag.slow) / Complex64::new(1.0, omega_rad_s * sag.slow_s);
        let lag = Complex64::new(1.0, omega_rad_s * point.lag.time_constant_s);
        lag / (lag + (slow + sag.resistive) * slope)
    },
};

struct SupplySag {
    slow: f64,
    slow_s: f64,
    resistive: f64,
    square_part: f64,
    open_circuit_v: f64,
    hover_current_a: f64,
    /// Part of the open-circuit voltage for which the base model holds.
    nominal_part: f64,
}

impl SupplySag {
    fn new(values: &[f64], base: &RotorBase) -> Self {
        let mut sag = Self {
            slow: values[0],
            slow_s: values[1],
            resistive: values[2],
            square_part: values[3],
            open_circuit_v: values[4],
            hover_current_a: values[5],
            nominal_part: 1.0,
        };
        sag.nominal_part = sag.part(
            sag.current(base.reference_supply_command()),
            sag.slow * sag.current(base.reference_supply_command()),
        );
        sag
    }

    /// Current over that at hover.
    fn current(&self, speed: f64) -> f64 {
        let relative = speed.max(0.0) / HOVER;
        relative * relative * (relative + self.square_part * (1.0 - relative))
    }

    /// By how much that grows, in parts of the speed.
    fn current_growth(&self, speed: f64) -> f64 {
        let relative = speed.max(0.0) / HOVER;
        relative * relative * (3.0 * relative + self.square_part * (2.0 - 3.0 * relative))
    }

    /// Voltage over that of the open circuit.
    fn part(&self, current: f64, slow: f64) -> f64 {
        (1.0 - self.resistive * current - slow).max(LEAST_PART)
    }
}

/// The steady speed where a part of the drive is lost, more of it at a higher speed: `part` returns the share that is left at a speed,
/// and `nominal_part` is left where the model holds.
pub(super) fn speed_at_rest(drive: f64, nominal_part: f64, part: impl Fn(f64) -> f64) -> f64 {
    // The drive falls with the speed, so there is one speed at which both are equal.
    let (mut low, mut high) = (0.0, drive.max(0.0) / nominal_part);
    // Derived: 60 halvings go beyond a double's 53 digits.
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if drive * part(middle) / nominal_part > middle { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

impl RotorEffect for SupplySag {
    fn at_rest(&self, motion: &mut Motion) -> f64 {
        motion.drive = speed_at_rest(motion.drive, self.nominal_part, |speed| {
            let current = self.current(speed);
            self.part(current, self.slow * current)
        });
        self.slow * self.current(motion.drive)
    }

    fn state_derivative(&self, own: f64, motion: &mut Motion) -> f64 {
        let current = self.current(motion.speed);
        motion.drive *= self.part(current, own) / self.nominal_part;
        (self.slow * current - own) / self.slow_s
    }

    fn memory_s(&self) -> f64 {
        MEMORY_TIME_CONSTANTS * self.slow_s
    }

    fn measured(&self, own: f64, motion: &Motion) -> Option<Supply> {
        let current = self.current(motion.speed);
        let voltage_v = (self.open_circuit_v > 0.0).then(|| self.open_circuit_v * self.part(current, own))?;
        Some(Supply { voltage_v, current_a: self.hover_current_a * current })
    }
}
