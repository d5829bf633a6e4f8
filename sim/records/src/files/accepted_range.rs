//! What numbers may be: every key, column and option that holds one, the least and the greatest value, and why.
//!
//! A number outside its range is no measurement and no design, and the work that some ask for has no end. The table in
//! `docs/ranges.md` is [`AcceptedRange::table`].

use super::{Fault, KeyPath};

/// What a number of a file or of an option says, under any of its names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AcceptedRange {
    /// The keys and columns that hold it, and the options that stand for no key.
    pub keys: &'static [&'static str],
    /// The least value, which is accepted.
    pub least: f64,
    /// The greatest one, likewise.
    pub greatest: f64,
    /// Why the range ends there; appended to the help of the error message.
    pub reason: &'static str,
}

const fn quantity(keys: &'static [&'static str], least: f64, greatest: f64, reason: &'static str) -> AcceptedRange {
    AcceptedRange { keys, least, greatest, reason }
}

impl AcceptedRange {
    /// A number of this range as it is typed.
    ///
    /// # Errors
    /// Where it is none, in a sentence with what to do.
    pub fn parse(&self, text: &str) -> Result<f64, String> {
        let value = text.parse().map_err(|_| format!("`{text}` is not a number"))?;
        self.accept_given(value).map(|()| value).map_err(|(message, help)| format!("{message}; {help}"))
    }

    /// `LOW..HIGH`, both numbers of this range, the first lower.
    ///
    /// # Errors
    /// As [`Self::parse`].
    pub fn parse_pair(&self, text: &str) -> Result<(f64, f64), String> {
        let remedy = || String::from("write it as LOW..HIGH with LOW below HIGH, as in 0.1..30");
        let (low, high) = text.split_once("..").ok_or_else(remedy)?;
        let (low, high) = (self.parse(low)?, self.parse(high)?);
        if low < high { Ok((low, high)) } else { Err(remedy()) }
    }

    /// The times of a record's rows.
    pub const TIME_S: Self =
        quantity(&["time_s"], -1e12, 1e12, "seconds; stamps of an epoch in nanoseconds lose their digits");
    /// The duty of a command.
    pub const DUTY: Self = quantity(
        &[
            "nominal",
            "command",
            "esc_command",
            "setpoint_throttle",
            "levels",
            "min",
            "max",
            "compensate_from",
            "compensate_to",
            "range",
            "esc_frame_phase",
        ],
        0.0,
        1.0,
        "a part of the whole: 0 is none, 1 is all",
    );
    /// The force of a propeller.
    pub const THRUST_N: Self = quantity(&["thrust_n"], -1e7, 1e7, "newtons; the largest rockets pull so much");
    /// The speed of a rotor.
    pub const RPM: Self =
        quantity(&["rpm"], -1e8, 1e8, "revolutions per minute, electrical ones and ticks of counters included");
    /// The voltage of a battery.
    pub const VOLTAGE_V: Self = quantity(&["voltage_v"], -1e6, 1e6, "volts, or millivolts of a battery of 1000 V");
    /// The current from it.
    pub const CURRENT_A: Self = quantity(&["current_a"], -1e6, 1e6, "amperes, or milliamperes of a motor of 1000 A");
    /// How fast a vehicle is to turn.
    pub const RATE_RAD_S: Self = quantity(
        &["setpoint_roll_rad_s", "setpoint_pitch_rad_s", "setpoint_yaw_rad_s"],
        -1e4,
        1e4,
        "radians a second, or degrees a second of the fastest racer",
    );
    /// How late a response is.
    pub const DELAY_S: Self =
        quantity(&["delay_s"], 0.0, 100.0, "seconds; a log that is later belongs to another command");
    /// How often rows come.
    pub const SAMPLE_RATE_HZ: Self =
        quantity(&["sample_rate_hz"], 1e-3, 1e6, "rows a second, from a table by hand to the fastest logger");
    /// How often an ESC takes a command.
    pub const ESC_FRAME_HZ: Self =
        quantity(&["esc_frame_hz"], 1.0, 4e4, "hertz; ESCs take 50 to 32000 commands a second");
    /// How often a loop runs.
    pub const LOOP_RATE_HZ: Self =
        quantity(&["loop_rate_hz", "rate_hz"], 50.0, 1e5, "hertz; flight controllers run their loops at 250 to 32000");
    /// How long something lasts.
    pub const DURATION_S: Self = quantity(
        &["period_s", "half_period_s", "hold_s"],
        1e-4,
        1e5,
        "seconds; from a loop's tick to a day of recording",
    );
    /// How far a command goes.
    pub const AMPLITUDE: Self =
        quantity(&["amplitude"], 1e-6, 1.0, "a part of the command's range, which an ESC resolves to 1/2000");
    /// A frequency of a motor or its compensator.
    pub const FREQUENCY_RAD_S: Self = quantity(
        &[
            "zero_rad_s",
            "pole_rad_s",
            "prewarp_rad_s",
            "natural_rad_s",
            "inverse_rad_s",
            "speed_loop_rad_s",
            "omega_g_rad_s",
        ],
        1e-2,
        3.2e5,
        "radians per second, from the slowest motor to half of 100 kHz",
    );
    /// The damping of a compensator's poles.
    pub const DAMPING: Self = quantity(&["damping"], 0.01, 100.0, "a ratio of about 0.7");
    /// How fast a command may change.
    pub const SLEW_PER_S: Self =
        quantity(&["slew_per_s"], 1e-3, 1e6, "commands a second: 1 is the whole range in a second");
    /// A frequency of a structure.
    pub const FREQUENCY_HZ: Self = quantity(
        &["frequency_hz", "top_hz", "usable_hz"],
        0.1,
        1e6,
        "hertz; what swings more slowly is no structure that carries a motor, nor does it answer higher up",
    );
    /// The widths of pulses.
    pub const PULSE_US: Self = quantity(&["--pulse-us"], 0.0, 1e5, "microseconds; an analog servo's frame has 20000");
    /// The lines of an excitation.
    pub const BAND_HZ: Self =
        quantity(&["--band"], 1e-5, 5e5, "hertz; from a line in a day to half of the fastest logger's rate");
    /// How well a bandwidth is known.
    pub const ACCURACY: Self = quantity(&["--accuracy"], 1e-6, 1.0, "a part of the bandwidth");

    /// Every number of every file and option. A key that is in none of these is a coefficient: see [`Self::NUMBER`].
    pub const ALL: &'static [Self] = &[
        Self::TIME_S,
        Self::DUTY,
        Self::THRUST_N,
        Self::RPM,
        Self::VOLTAGE_V,
        Self::CURRENT_A,
        Self::RATE_RAD_S,
        quantity(&["gain", "response"], -1e8, 1e8, "newtons or revolutions per minute at full command"),
        quantity(
            &["time_constant_s", "time_constant_up_s", "time_constant_down_s", "low_s", "high_s"],
            1e-5,
            100.0,
            "seconds; a loop of 100 kHz does not see a faster lag, and no motor takes minutes",
        ),
        Self::DELAY_S,
        quantity(
            &["fit_frequency_percent", "fit_square_percent", "fit_step_percent"],
            -1e6,
            100.0,
            "100 is a perfect fit; a model that is ten thousand times worse than none says nothing of the record",
        ),
        quantity(&["dead_zone", "hysteresis", "limit"], -2.0, 2.0, "a part of the range of commands, or little more"),
        quantity(&["down_over_up"], 1e-3, 1e3, "one time constant over another of the same motor"),
        Self::SAMPLE_RATE_HZ,
        Self::ESC_FRAME_HZ,
        quantity(&["command_rate_hz"], 1.0, 1e5, "hertz, as often as the loop writes a command"),
        Self::LOOP_RATE_HZ,
        Self::DURATION_S,
        quantity(&["periods", "warm_up_periods"], 0.0, 1e6, "periods of one record"),
        Self::AMPLITUDE,
        Self::FREQUENCY_RAD_S,
        Self::DAMPING,
        quantity(
            &["pole.damping"],
            1e-9,
            1.0,
            "a stand that stands still; two real poles are two entries of damping 1",
        ),
        quantity(
            &["zero.damping"],
            -1.0,
            1.0,
            "two real zeros are two entries of damping 1, or of -1 in the right half",
        ),
        Self::SLEW_PER_S,
        quantity(&["sigma_n", "hum_n"], 0.0, 1e6, "newtons that a sensor adds"),
        quantity(&["hum_hz"], 1e-2, 1e5, "hertz; the mains hum at 50 or 60"),
        quantity(
            &["pole"],
            -0.999_999,
            0.999_999,
            "the correlation of one row's noise with that of the row before; at 1 it has no variance",
        ),
        Self::FREQUENCY_HZ,
        quantity(&["inertia_kg_m2"], 1e-7, 1e3, "kilograms times square meters"),
        quantity(&["arm_m"], 1e-3, 10.0, "meters from the axis to a motor"),
        quantity(&["drag_m"], 0.0, 10.0, "meters: newton meters of drag for a newton of thrust"),
        quantity(&["disturbance_n_m"], 1e-9, 1e4, "newton meters; give it in SI units"),
        quantity(&["step_deg"], 0.01, 30.0, "degrees; give a step of some"),
        quantity(&["integral_time_s"], 0.01, 100.0, "seconds; the default vehicle has 0.3"),
        quantity(&["gyro_low_pass_hz", "d_low_pass_hz"], 1.0, 5e4, "hertz, below half of the controller's rate"),
        quantity(&["latency_s"], 0.0, 0.1, "give seconds, not milliseconds: 0.002"),
        quantity(&["gyro_noise_deg_s_sqrt_hz"], 0.0, 100.0, "degrees per second per root hertz; a good gyro has 0.005"),
        quantity(&["tilt_deg"], 1.0, 80.0, "degrees; without a tilt there is no lateral force"),
        quantity(&["step_n", "sine_n"], 1e-6, 1e4, "newtons; give it in SI units"),
        quantity(&["sine_hz"], 0.1, 50.0, "hertz; give a frequency that a vehicle may follow"),
        Self::PULSE_US,
        Self::BAND_HZ,
        Self::ACCURACY,
    ];

    /// A coefficient, or a standard error.
    pub const NUMBER: Self = quantity(&[], -1e15, 1e15, "a number that leaves digits for those that it is added to");

    /// That of a key, outside of effects, whose parameters are in `docs/confusion.md`.
    #[must_use]
    pub fn for_key(key: &str) -> &'static Self {
        Self::named(key).unwrap_or(&Self::NUMBER)
    }

    fn named(name: &str) -> Option<&'static Self> {
        Self::ALL.iter().find(|quantity| quantity.keys.contains(&name))
    }

    /// Accepts a number of a result, of either sign, as an estimate may be: one that is a time constant is no larger than what a file may
    /// hold. Under other keys a result may hold another thing than a file, as the time between two clocks.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn accept_result(key: &str, value: f64) -> Result<(), String> {
        let Self { least, greatest, .. } =
            if key.starts_with("time_constant") { *Self::for_key(key) } else { Self::NUMBER };
        let most = greatest.max(-least);
        let fault = || format!("{} is not from -{} to {}", shown(value), shown(most), shown(most));
        (value.abs() <= most).then_some(()).ok_or_else(fault)
    }

    /// Accepts a number of the range that somebody gives: a command next to nothing is a slip.
    ///
    /// # Errors
    /// What it is not, and what to give.
    pub fn accept_given(&self, value: f64) -> Result<(), (String, String)> {
        if *self == Self::DUTY && value > 0.0 && value < FINEST_DUTY {
            let help = format!("give 0, or a value from {FINEST_DUTY} to 1: an ESC resolves 1/2000");
            return Err((format!("{} is next to nothing", shown(value)), help));
        }
        self.accept(value)
    }

    /// Accepts a number of the range.
    ///
    /// # Errors
    /// What it is not, and what to give.
    pub fn accept(&self, value: f64) -> Result<(), (String, String)> {
        let Self { least, greatest, reason, .. } = *self;
        if (least..=greatest).contains(&value) {
            return Ok(());
        }
        let rule = if (least, greatest) == (0.0, 1.0) {
            "in the range 0 to 1"
        } else if !value.is_finite() && least < 0.0 {
            "a finite number"
        } else if least > 0.0 && !(value > 0.0 && value.is_finite()) {
            "a finite number above 0"
        } else if least == 0.0 && !(value >= 0.0 && value.is_finite()) {
            "a finite number of 0 or more"
        } else {
            let range = format!("from {} to {}", shown(least), shown(greatest));
            return Err((format!("{} is not {range}", shown(value)), format!("give a value {range}: {reason}")));
        };
        Err((
            format!("{} is not {rule}", shown(value)),
            format!("give a value from {} to {}: {reason}", shown(least), shown(greatest)),
        ))
    }

    /// The table of `docs/ranges.md`.
    #[must_use]
    pub fn table() -> String {
        let row = |quantity: &Self| {
            let keys: Vec<String> = quantity.keys.iter().map(|key| format!("`{key}`")).collect();
            let keys = if keys.is_empty() { String::from("any other number") } else { keys.join(", ") };
            let Self { least, greatest, reason, .. } = *quantity;
            format!("| {keys} | {} | {} | {reason} |\n", shown(least), shown(greatest))
        };
        let rows: String = Self::ALL.iter().chain([&Self::NUMBER]).map(row).collect();
        format!("| key, column or option | least | greatest | why |\n|---|---|---|---|\n{rows}")
    }
}

/// Characters of a number that is shown without an exponent.
const MOST_DIGITS: usize = 20;
/// A part of the whole that someone writes and means.
const FINEST_DUTY: f64 = 1e-6;

impl KeyPath {
    /// Accepts what its key may hold.
    ///
    /// # Errors
    /// A fault at this place for a number that is out of its range, or is none.
    pub fn accept(self, value: f64) -> Result<(), Fault> {
        let quantity = {
            let mut keys = self.keys_from_last();
            let (key, table) = (keys.next().unwrap_or_default(), keys.next().unwrap_or_default());
            // A key may mean another thing in another table.
            AcceptedRange::named(&format!("{table}.{key}")).unwrap_or_else(|| AcceptedRange::for_key(key))
        };
        quantity.accept_given(value).map_err(|(message, help)| self.fault(message, help))
    }

    /// Accepts any number that has digits.
    ///
    /// # Errors
    /// A fault at this place for one that is too large, or is none.
    pub fn accept_any(self, value: f64) -> Result<(), Fault> {
        AcceptedRange::NUMBER.accept(value).map_err(|(message, help)| self.fault(message, help))
    }
}

/// A number with few digits, however large or small it is.
#[must_use]
pub fn shown(value: f64) -> String {
    let size = value.abs();
    let plain = value.to_string();
    if size == 0.0 || !size.is_finite() || (1e-6..1e9).contains(&size) && plain.len() <= MOST_DIGITS {
        plain
    } else {
        format!("{value:e}")
    }
}

/// A number with so many decimals, or few digits where it is very large.
#[must_use]
pub fn shown_to(value: f64, decimals: usize) -> String {
    if value.abs() < 1e9 { format!("{value:.decimals$}") } else { shown(value) }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn a_key_has_one_range() {
        let mut keys = BTreeSet::new();
        for quantity in AcceptedRange::ALL {
            assert!(quantity.least < quantity.greatest && !quantity.reason.is_empty(), "{quantity:?}");
            quantity.keys.iter().for_each(|key| assert!(keys.insert(*key), "{key} is there twice"));
        }
    }

    #[test]
    fn a_command_that_is_next_to_nothing_is_a_slip() {
        let accepted = |value: f64| KeyPath::root().key("nominal").accept(value).is_ok();
        assert!(accepted(0.0) && accepted(1e-6) && !accepted(5e-324) && !accepted(9e-7));
    }

    #[test]
    fn a_result_may_be_on_the_wrong_side_of_zero_and_no_larger_than_a_file_has_it() {
        assert_eq!(AcceptedRange::accept_result("time_constant_s", -0.001), Ok(()));
        assert_eq!(AcceptedRange::accept_result("delay_s", -7000.0), Ok(()));
        assert_eq!(AcceptedRange::accept_result("range", 2.15), Ok(()));
        for (key, value) in [("time_constant_s", 5_626_758.0), ("delay_s", -2e16), ("range", 1e300), ("a", f64::NAN)] {
            assert!(AcceptedRange::accept_result(key, value).is_err(), "{key} {value}");
        }
    }

    #[test]
    fn a_number_is_accepted_up_to_the_ends_of_its_range() {
        for quantity in AcceptedRange::ALL {
            let AcceptedRange { least, greatest, .. } = *quantity;
            assert_eq!(quantity.accept(least), Ok(()));
            assert_eq!(quantity.accept(greatest), Ok(()));
            for value in [least - 1e-3 * least.abs() - 1e-9, 1.001 * greatest, f64::NAN, f64::INFINITY, 1e300] {
                let (message, help) = quantity.accept(value).unwrap_err();
                assert!(message.contains("is not") && help.contains(quantity.reason), "{message}: {help}");
                assert!(message.len() < 80, "{message}");
            }
        }
    }

    #[test]
    fn a_place_is_judged_by_its_key() {
        let lags = KeyPath::root().key("point").item(1).key("time_constant_s");
        assert_eq!(lags.clone().accept(0.1), Ok(()));
        assert_eq!(lags.clone().item(2).accept(0.1), Ok(()));
        let fault = lags.item(2).accept(9e18).unwrap_err();
        assert_eq!(fault.to_string(), "`point` 2, `time_constant_s` 3: 9e18 is not from 0.00001 to 100");
        // The same key in another table is another quantity.
        let damping = |table: &str, value| KeyPath::root().key(table).item(0).key("damping").accept(value).is_ok();
        assert!(damping("zero", -1.0) && !damping("pole", -1.0) && !damping("point", -1.0));
        assert!(!damping("zero", 2.0) && !damping("pole", 2.0) && damping("point", 2.0));
    }
}
