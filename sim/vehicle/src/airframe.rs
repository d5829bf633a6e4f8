//! The vehicle's parameters, as a TOML file gives them.

use std::path::Path;

use rotorlead_records::files::{Fault, FileError, KeyPath, TomlFile};
use serde::{Deserialize, Serialize};

use crate::TICK_HZ;

/// One vehicle: its body, its controller, where it hovers, and the actuators that are compared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Airframe {
    /// Version of the file's layout; 1.
    pub format: u32,
    /// The roll axis.
    pub roll: Roll,
    /// The flight controller.
    pub controller: Controller,
    /// The commands at which the vehicle hovers.
    pub hover: Hover,
    /// The actuators that are compared.
    #[serde(default)]
    pub actuators: Actuators,
    /// A fully actuated hexarotor with the same motors; absent: lateral force is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lateral: Option<Lateral>,
}

/// The rigid body about the roll axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Roll {
    /// Moment of inertia, kg m2.
    pub inertia_kg_m2: f64,
    /// Distance of each motor from the axis, meters.
    pub arm_m: f64,
    /// Motors that act on the axis, half of them on each side.
    pub motors: u32,
    /// Step of the disturbance torque, newton meters.
    pub disturbance_n_m: f64,
    /// Step of the attitude setpoint by which settling is measured, degrees.
    pub step_deg: f64,
}

/// The flight controller's rate loop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Controller {
    /// Rate of the rate and attitude loops, hertz; a divisor of 5000.
    pub rate_hz: f64,
    /// Cut-off of the gyro's low-pass of second order, hertz.
    pub gyro_low_pass_hz: f64,
    /// Cut-off of the D term's low-pass of first order, hertz.
    pub d_low_pass_hz: f64,
    /// Integral time of the rate controller, seconds.
    pub integral_time_s: f64,
    /// Latencies from the gyro's sample to the ESC's new command, seconds; each gives a table. The gains of the first are also tried
    /// at the others.
    pub latency_s: Vec<f64>,
    /// Density of the gyro's noise in flight, degrees per second per square root of hertz.
    pub gyro_noise_deg_s_sqrt_hz: f64,
}

/// The operating points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hover {
    /// Command at hover, 0..1.
    pub command: f64,
    /// The lowest and the highest command for which one gain set has to serve.
    pub range: [f64; 2],
}

/// The actuators that are compared with the bare one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Actuators {
    /// Natural frequencies of the conditioned inverse's reference model, rad/s.
    pub inverse_rad_s: Vec<f64>,
    /// Pole of the speed loop at hover, rad/s.
    pub speed_loop_rad_s: f64,
    /// Lowest command that the ESC gets, 0..1.
    pub min: f64,
    /// Highest command that the ESC gets, 0..1.
    pub max: f64,
}

/// A hexarotor whose rotors are tilted about their arms, one to the left and the next to the right: it makes lateral force
/// without leaning.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lateral {
    /// Tilt of each rotor, degrees.
    pub tilt_deg: f64,
    /// Distance of each rotor from the center, meters.
    pub arm_m: f64,
    /// Drag torque of a rotor over its thrust, meters.
    pub drag_m: f64,
    /// Step of the lateral force, newtons.
    pub step_n: f64,
    /// Amplitude of the lateral force's sine, newtons.
    pub sine_n: f64,
    /// Frequency of that sine, hertz.
    pub sine_hz: f64,
}

impl Default for Actuators {
    fn default() -> Self {
        // Standard: 94 rad/s, 15 Hz, is the paper's. Chosen: 150 and 200 are 1.6 and 2.1 times as fast, up to where steps of 5 % meet the
        // limits of the command; below 0.05 sensorless motors hardly keep turning.
        Self { inverse_rad_s: vec![94.0, 150.0, 200.0], speed_loop_rad_s: 94.0, min: 0.05, max: 1.0 }
    }
}

impl Default for Airframe {
    /// A 450 mm quadrotor with the motors of the paper, and a hexarotor of 550 mm.
    fn default() -> Self {
        Self {
            format: 1,
            // Derived: an arm of 225 mm at 45 degrees is `0.225 sqrt(0.5)` from the axis. Chosen: four motors of 0.1 kg there have 0.010 kg
            // m2, the body has the rest; 0.3 N m takes 0.9 N between the two sides; a larger step than 1 degree meets limits sooner.
            roll: Roll { inertia_kg_m2: 0.0125, arm_m: 0.159, motors: 4, disturbance_n_m: 0.3, step_deg: 1.0 },
            controller: Controller {
                rate_hz: 1000.0,
                // Chosen: both low-passes lag 2.5 ms, about the shorter latency; lower ones cost phase, higher ones pass noise. The corner
                // of 0.3 s, 3.3 rad/s, is far below any bandwidth here. The noise is ten times that of a gyro at rest (`docs/vehicle.md`).
                gyro_low_pass_hz: 90.0,
                d_low_pass_hz: 60.0,
                integral_time_s: 0.3,
                latency_s: vec![0.002, 0.012],
                gyro_noise_deg_s_sqrt_hz: 0.05,
            },
            // Derived: from the first to the last operating point of the paper's Table 1, and one near the middle.
            hover: Hover { command: 0.50, range: [0.40, 0.65] },
            actuators: Actuators::default(),
            lateral: Some(Lateral {
                // Derived: half of 550 mm. Standard: the drag is that of the Firefly of RotorS. Chosen: a third of the thrust is lateral,
                // `sin 20`, for 6 % of the lift, `1 - cos 20`; 1.5 N takes as much of two rotors each, a third of their thrust at hover.
                tilt_deg: 20.0,
                arm_m: 0.275,
                drag_m: 0.016,
                step_n: 0.5,
                sine_n: 1.5,
                sine_hz: 2.0,
            }),
        }
    }
}

impl Airframe {
    /// Reads and checks an airframe.
    ///
    /// # Errors
    /// When the file is missing or is no airframe: an unknown key, a missing one, or a number that [`Airframe::check`] refuses. The
    /// error shows the place in the file.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let (airframe, file): (Self, _) = TomlFile::read(path)?;
        airframe.check().map_err(|fault| file.show(&fault))?;
        Ok(airframe)
    }

    /// Refuses what is no vehicle, or one that is not simulated here.
    ///
    /// # Errors
    /// A fault that names the first number that breaks a rule.
    pub fn check(&self) -> Result<(), Fault> {
        self.check_roll(&KeyPath::root().key("roll"))?;
        self.check_controller(&KeyPath::root().key("controller"))?;
        self.check_hover(&KeyPath::root().key("hover"))?;
        self.check_actuators(&KeyPath::root().key("actuators"))?;
        self.lateral.map_or(Ok(()), |lateral| lateral.check(&KeyPath::root().key("lateral")))
    }

    fn check_roll(&self, place: &KeyPath) -> Result<(), Fault> {
        let roll = &self.roll;
        for (key, value) in [
            ("inertia_kg_m2", roll.inertia_kg_m2),
            ("arm_m", roll.arm_m),
            ("disturbance_n_m", roll.disturbance_n_m),
            ("step_deg", roll.step_deg),
        ] {
            place.key(key).accept(value)?;
        }
        if roll.motors < 2 || !roll.motors.is_multiple_of(2) {
            return Err(place.key("motors").fault(
                format!("{} is not an even number of 2 or more", roll.motors),
                "count the motors on both sides of the axis; those on it do not act on it",
            ));
        }
        Ok(())
    }

    fn check_controller(&self, place: &KeyPath) -> Result<(), Fault> {
        let controller = &self.controller;
        let rate = place.key("rate_hz");
        rate.clone().accept(controller.rate_hz)?;
        // Chosen: 50 ticks are 100 Hz, slower than rate loops that fly; 1e-9 is for the rounding of a rate in decimals.
        let ticks = TICK_HZ / controller.rate_hz;
        if !(1.0..=50.0).contains(&ticks) || (ticks - ticks.round()).abs() > 1e-9 {
            return Err(rate.fault(
                format!("the compensators run at {TICK_HZ} Hz, of which {} is no divisor", controller.rate_hz),
                "give a rate that divides it, from 100 to 5000: 250, 500, 1000, 2500",
            ));
        }
        let half_rate_hz = 0.5 * controller.rate_hz;
        for (key, value) in
            [("gyro_low_pass_hz", controller.gyro_low_pass_hz), ("d_low_pass_hz", controller.d_low_pass_hz)]
        {
            // Chosen: below 1 Hz it lags 0.2 s and more, and no rate loop flies behind it.
            within(place.key(key), value, 1.0, half_rate_hz, "choose a cut-off below half of `rate_hz`")?;
        }
        place.key("integral_time_s").accept(controller.integral_time_s)?;
        let latency = place.key("latency_s");
        if controller.latency_s.is_empty() {
            return Err(latency.fault("no latency is given", "give one or more, in seconds: [0.002, 0.012]"));
        }
        for (index, &value) in controller.latency_s.iter().enumerate() {
            latency.item(index).accept(value)?;
        }
        place.key("gyro_noise_deg_s_sqrt_hz").accept(controller.gyro_noise_deg_s_sqrt_hz)
    }

    fn check_hover(&self, place: &KeyPath) -> Result<(), Fault> {
        let [from, to] = self.hover.range;
        let range = place.key("range");
        range.item(0).accept(from)?;
        range.item(1).accept(to)?;
        if from >= to {
            return Err(range.fault(format!("it goes from {from} to {to}"), "give the lower command first"));
        }
        within(place.key("command"), self.hover.command, from, to, "the command at hover lies within `range`")
    }

    fn check_actuators(&self, place: &KeyPath) -> Result<(), Fault> {
        let actuators = &self.actuators;
        for (index, &omega_rad_s) in actuators.inverse_rad_s.iter().enumerate() {
            place.key("inverse_rad_s").item(index).accept(omega_rad_s)?;
        }
        place.key("speed_loop_rad_s").accept(actuators.speed_loop_rad_s)?;
        place.key("min").accept(actuators.min)?;
        place.key("max").accept(actuators.max)?;
        let [from, to] = self.hover.range;
        if actuators.min >= from || actuators.max <= to {
            let (end, limit) = if actuators.min >= from { ("min", actuators.min) } else { ("max", actuators.max) };
            return Err(place.key(end).fault(
                format!("{limit} leaves no room beyond `hover`, `range`, {from} to {to}"),
                "the ESC's range has to be wider than that of the hover commands",
            ));
        }
        Ok(())
    }
}

impl Lateral {
    fn check(&self, place: &KeyPath) -> Result<(), Fault> {
        for (key, value) in [
            ("tilt_deg", self.tilt_deg),
            ("arm_m", self.arm_m),
            ("drag_m", self.drag_m),
            ("step_n", self.step_n),
            ("sine_n", self.sine_n),
            ("sine_hz", self.sine_hz),
        ] {
            place.key(key).accept(value)?;
        }
        Ok(())
    }
}

/// Accepts a number from `low` to `high`.
fn within(place: KeyPath, value: f64, low: f64, high: f64, remedy: &str) -> Result<(), Fault> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(place.fault(format!("{value} is not in the range {low} to {high}"), remedy))
}

#[cfg(test)]
mod tests {
    use rotorlead_records::files::testing::{Scratch, assert_report};

    use super::*;

    fn text() -> String {
        toml::to_string(&Airframe::default()).unwrap()
    }

    #[test]
    fn the_default_is_an_airframe_that_reads_back() {
        let scratch = Scratch::new();
        let airframe = Airframe::read(&scratch.file("airframe.toml", text())).unwrap();
        assert_eq!(airframe, Airframe::default());
    }

    #[test]
    fn what_is_no_vehicle_is_refused_at_its_place() {
        for (from, to, parts) in [
            ("inertia_kg_m2 = 0.0125", "inertia_kg_m2 = -0.0125", &["`roll`, `inertia_kg_m2`", "above 0"][..]),
            ("inertia_kg_m2 = 0.0125", "inertia_kg_m2 = nan", &["`inertia_kg_m2`", "NaN"]),
            ("inertia_kg_m2 = 0.0125", "inertia_kg_m2 = \"0.0125\"", &["`inertia_kg_m2`", "a text in quotes"]),
            ("inertia_kg_m2 = 0.0125", "inertia = 0.0125", &["unknown field `inertia`", "inertia_kg_m2"]),
            ("inertia_kg_m2 = 0.0125\n", "", &["missing field `inertia_kg_m2`", "add `inertia_kg_m2`"]),
            (
                "inertia_kg_m2 = 0.0125",
                "inertia_kg_m2 = 12500.0",
                &["`inertia_kg_m2`", "kilograms times square meters"],
            ),
            ("motors = 4", "motors = 3", &["`motors`", "even number"]),
            ("arm_m = 0.159", "arm_m = 0", &["`roll`, `arm_m`", "above 0"]),
            ("step_deg = 1.0", "step_deg = 90.0", &["`step_deg`", "0.01 to 30"]),
            ("rate_hz = 1000.0", "rate_hz = 400.0", &["`rate_hz`", "no divisor"]),
            ("gyro_low_pass_hz = 90.0", "gyro_low_pass_hz = 900.0", &["`gyro_low_pass_hz`", "half of `rate_hz`"]),
            ("latency_s = [0.002, 0.012]", "latency_s = [2.0]", &["`latency_s` 1", "not milliseconds"]),
            ("latency_s = [0.002, 0.012]", "latency_s = []", &["`latency_s`", "no latency"]),
            ("command = 0.5", "command = 0.7", &["`hover`, `command`", "0.4 to 0.65"]),
            ("range = [0.4, 0.65]", "range = [0.65, 0.4]", &["`hover`, `range`", "lower command first"]),
            ("max = 1.0", "max = 0.6", &["`actuators`, `max`", "no room"]),
            ("tilt_deg = 20.0", "tilt_deg = 0.0", &["`lateral`, `tilt_deg`", "no lateral force"]),
            ("format = 1", "format = 2", &["layout 2"]),
        ] {
            let good = text();
            assert!(good.contains(from), "no `{from}` in\n{good}");
            let scratch = Scratch::new();
            let path = scratch.file("airframe.toml", good.replacen(from, to, 1));
            let all = [&["airframe.toml:", "help: "], parts].concat();
            assert_report(Airframe::read(&path).unwrap_err(), &all);
        }
    }
}
