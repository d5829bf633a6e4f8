//! What a column of a table, or a named vector, may measure, and in which units a table may have it.

use std::f64::consts::PI;
use std::str::FromStr;

use crate::files::did_you_mean;

/// Newtons per gram-force.
pub(super) const N_PER_GF: f64 = 9.80665e-3;
/// Newtons per ounce-force, a sixteenth of a pound-force.
const N_PER_OZF: f64 = N_PER_LBF / 16.0;
/// Newtons per pound-force.
const N_PER_LBF: f64 = 4.448_221_615_260_5;

/// DShot numbers of no and of full throttle.
pub(super) const DSHOT: (f64, f64) = (48.0, 2047.0);

/// How units of electrical revolutions begin.
pub(super) const ELECTRICAL: &str = "erpm";

/// What a column measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// The times of the rows.
    Time,
    /// The command to the ESC.
    Command,
    /// Thrust.
    Thrust,
    /// Rotor speed.
    Speed,
    /// Supply voltage.
    Voltage,
    /// Supply current.
    Current,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::Time, Self::Command, Self::Thrust, Self::Speed, Self::Voltage, Self::Current];

    /// What `--column` calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Command => "command",
            Self::Thrust => "thrust",
            Self::Speed => "rpm",
            Self::Voltage => "voltage",
            Self::Current => "current",
        }
    }

    /// The column of a record that it becomes.
    pub(super) fn column(self) -> &'static str {
        match self {
            Self::Time => "time_s",
            Self::Command => "command",
            Self::Thrust => "thrust_n",
            Self::Speed => "rpm",
            Self::Voltage => "voltage_v",
            Self::Current => "current_a",
        }
    }

    /// Its units, as messages list them.
    pub(super) fn units(self) -> &'static str {
        match self {
            Self::Time => "s, ms, us, ns or clock (hh:mm:ss)",
            Self::Command => {
                "us (pulse width), percent, dshot, duty (0..1), 0..255, 0..1023, 0..4095, 0..8191 or 0..65535"
            }
            Self::Thrust => "N, gf (also g), kgf (also kg), lbf (also lb) or ozf (also oz)",
            Self::Speed => "rpm, rev/s, rad/s, erpm (also electrical rpm) or erpm/100",
            Self::Voltage => "V or mV",
            Self::Current => "A or mA",
        }
    }

    /// Its units, by the name that `--column` takes for each.
    pub fn unit_names(self) -> impl Iterator<Item = &'static str> {
        UNITS.iter().filter(move |unit| unit.quantity == self).map(|unit| unit.name)
    }

    /// Names that say what a column measures, in small letters, words apart.
    pub(super) fn spellings(self) -> &'static [&'static str] {
        match self {
            Self::Time => &["time", "t", "timestamp", "time stamp", "elapsed", "elapsed time"],
            Self::Command => &[
                "command",
                "cmd",
                "u",
                "throttle",
                "throttle command",
                "throttle duty",
                "motor command",
                "duty",
                "duty cycle",
                "pwm",
                "pwm duty",
                "pulse",
                "pulse width",
                "esc",
                "esc pwm",
                "esc pulse",
                "esc signal",
                "esc throttle",
            ],
            Self::Thrust => &["thrust", "thrust force", "motor thrust", "propeller thrust", "prop thrust"],
            Self::Speed => &[
                "rpm",
                "speed",
                "motor",
                "motor speed",
                "esc speed",
                "rotor",
                "rotor speed",
                "rotation speed",
                "rotational speed",
                "propeller speed",
                "prop speed",
                "optical",
                "optical speed",
                "motor optical speed",
                "motor electrical speed",
            ],
            Self::Voltage => &["voltage", "battery voltage", "supply voltage", "bus voltage", "vbat"],
            Self::Current => &["current", "battery current", "supply current", "esc current"],
        }
    }
}

/// How numbers of a unit become those of a record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Scale {
    /// Times the first, over the second: divided where that is the exact way.
    Ratio(f64, f64),
    /// The stated range of pulse widths becomes 0..1.
    Pulse,
    /// A number of the DShot protocol: 0 stops the motor, 1 to 47 are orders to the ESC, the rest is its range.
    Dshot,
    /// Times this, over the pairs of poles: electrical revolutions, of which each turn has one for each pair.
    Electrical(f64),
    /// A reading of the clock, as in `13:07:59.250`, becomes seconds since midnight.
    Clock,
}

/// A unit that a column's numbers may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    pub(super) quantity: Quantity,
    /// What messages call it.
    pub(super) name: &'static str,
    pub(super) scale: Scale,
    /// How it may be written; capitals matter only where [`Unit::named`] says so.
    spellings: &'static [&'static str],
}

const fn unit(quantity: Quantity, scale: Scale, spellings: &'static [&'static str]) -> Unit {
    Unit { quantity, name: spellings[0], scale, spellings }
}

const MICRO: &[&str] = &["us", "µs", "μs", "usec", "microsecond", "microseconds", "micros"];

/// Every unit.
const UNITS: &[Unit] = &[
    unit(Quantity::Time, Scale::Ratio(1.0, 1.0), &["s", "sec", "secs", "second", "seconds"]),
    unit(Quantity::Time, Scale::Ratio(1.0, 1e3), &["ms", "msec", "millisecond", "milliseconds", "millis"]),
    unit(Quantity::Time, Scale::Ratio(1.0, 1e6), MICRO),
    unit(Quantity::Time, Scale::Ratio(1.0, 1e9), &["ns", "nsec", "nanosecond", "nanoseconds", "nanos"]),
    unit(Quantity::Time, Scale::Clock, &["clock", "hh:mm:ss", "h:m:s", "hh:mm:ss.sss", "hh:mm:ss.ms"]),
    unit(Quantity::Command, Scale::Pulse, MICRO),
    unit(Quantity::Command, Scale::Ratio(1.0, 100.0), &["percent", "%", "pct"]),
    unit(Quantity::Command, Scale::Dshot, &["dshot"]),
    unit(Quantity::Command, Scale::Ratio(1.0, 1.0), &["duty", "0..1", "0-1"]),
    // Whole numbers of eight to sixteen bits; DroneCAN's commands have fourteen, of which one is a sign.
    unit(Quantity::Command, Scale::Ratio(1.0, 255.0), &["0..255", "0-255"]),
    unit(Quantity::Command, Scale::Ratio(1.0, 1023.0), &["0..1023", "0-1023"]),
    unit(Quantity::Command, Scale::Ratio(1.0, 4095.0), &["0..4095", "0-4095"]),
    unit(Quantity::Command, Scale::Ratio(1.0, 8191.0), &["0..8191", "0-8191"]),
    unit(Quantity::Command, Scale::Ratio(1.0, 65_535.0), &["0..65535", "0-65535"]),
    unit(Quantity::Thrust, Scale::Ratio(1.0, 1.0), &["N", "newton", "newtons"]),
    unit(Quantity::Thrust, Scale::Ratio(N_PER_GF, 1.0), &["gf", "g", "gram", "grams"]),
    unit(Quantity::Thrust, Scale::Ratio(1e3 * N_PER_GF, 1.0), &["kgf", "kg"]),
    unit(Quantity::Thrust, Scale::Ratio(N_PER_LBF, 1.0), &["lbf", "lb", "lbs"]),
    unit(Quantity::Thrust, Scale::Ratio(N_PER_OZF, 1.0), &["ozf", "oz"]),
    unit(Quantity::Speed, Scale::Ratio(1.0, 1.0), &["rpm", "rev/min", "r/min", "1/min"]),
    unit(Quantity::Speed, Scale::Ratio(60.0, 1.0), &["rev/s", "rps", "r/s"]),
    unit(Quantity::Speed, Scale::Ratio(30.0, PI), &["rad/s"]),
    unit(Quantity::Speed, Scale::Electrical(1.0), &[ELECTRICAL, "e-rpm", "electrical rpm"]),
    // As bidirectional DShot has it, in Betaflight's logs.
    unit(Quantity::Speed, Scale::Electrical(100.0), &["erpm/100", "100 erpm"]),
    unit(Quantity::Voltage, Scale::Ratio(1.0, 1.0), &["V", "volt", "volts"]),
    unit(Quantity::Voltage, Scale::Ratio(1.0, 1e3), &["mV"]),
    unit(Quantity::Current, Scale::Ratio(1.0, 1.0), &["A", "amp", "amps", "ampere", "amperes"]),
    unit(Quantity::Current, Scale::Ratio(1.0, 1e3), &["mA"]),
];

impl Unit {
    /// The unit of `quantity` that is written so, in whatever capitals.
    pub(super) fn named(quantity: Quantity, text: &str) -> Option<Self> {
        let is_so = |unit: &&Self| unit.quantity == quantity && unit.is_written(text);
        UNITS.iter().find(is_so).copied()
    }

    /// The quantity whose unit `text` is, where that is one of what is measured. One letter may be the number of a motor.
    pub(super) fn measured_quantity(text: &str) -> Option<Quantity> {
        let unit = UNITS.iter().find(|unit| text.len() > 1 && unit.is_written(text))?;
        Some(unit.quantity).filter(|quantity| !matches!(quantity, Quantity::Time | Quantity::Command))
    }

    /// The same of a motor with so many poles: electrical revolutions become the rotor's.
    pub(super) fn with_poles(self, poles: Option<u32>) -> Self {
        let scale = match (self.scale, poles) {
            (Scale::Electrical(times), Some(poles)) => Scale::Ratio(2.0 * times, f64::from(poles)),
            (scale, _) => scale,
        };
        Self { scale, ..self }
    }

    /// Whether the number of poles is needed to make a rotor's speed of it.
    pub(super) fn is_electrical(self) -> bool {
        matches!(self.scale, Scale::Electrical(_))
    }

    /// Whether `text` is any unit of any quantity.
    pub(super) fn is_any(text: &str) -> bool {
        UNITS.iter().any(|unit| unit.is_written(text))
    }

    fn is_written(&self, text: &str) -> bool {
        let text = text.trim().to_lowercase();
        self.spellings.iter().any(|spelling| spelling.to_lowercase() == text)
    }
}

/// Which column of a plain table measures what, as a person states it: `thrust=load cell:-gf`.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnChoice {
    /// What it measures.
    pub quantity: Quantity,
    /// Its name in the log.
    pub header: String,
    /// Its unit; `None` where the name has it.
    pub unit: Option<Unit>,
    /// Whether its sign is turned: a load cell that is pulled where it should be pushed.
    pub is_reversed: bool,
}

impl FromStr for ColumnChoice {
    type Err = String;

    /// `QUANTITY=HEADER:UNIT`, or `QUANTITY=HEADER` where the header says the unit. Behind the last colon a minus before the
    /// unit turns the sign.
    fn from_str(text: &str) -> Result<Self, String> {
        let remedy = "write it as QUANTITY=HEADER:UNIT, as in thrust=load:gf";
        let (name, rest) = text.split_once('=').ok_or_else(|| String::from(remedy))?;
        let quantity = Quantity::ALL.into_iter().find(|quantity| quantity.name() == name.trim()).ok_or_else(|| {
            let names = Quantity::ALL.map(Quantity::name).join(", ");
            let meant = did_you_mean(name.trim(), Quantity::ALL.map(Quantity::name).into_iter());
            let meant = meant.map(|question| format!("; {question}")).unwrap_or_default();
            format!("`{}` is no quantity of a record: {names}{meant}", name.trim())
        })?;
        let with_unit = rest.rsplit_once(':').map(|(header, unit)| (header, unit.trim()));
        let (header, unit, is_reversed) = match with_unit {
            Some((header, written)) => {
                let (unit, is_reversed) = written.strip_prefix('-').map_or((written, false), |unit| (unit, true));
                match Unit::named(quantity, unit) {
                    Some(unit) => (header, Some(unit), is_reversed),
                    // A colon may belong to the name, whose unit is then in it.
                    None if written.contains(['(', '[']) => (rest, None, false),
                    None => return Err(format!("`{written}` is no unit of {name}: {}", quantity.units())),
                }
            }
            None => (rest, None, false),
        };
        if is_reversed && !matches!(quantity, Quantity::Thrust | Quantity::Speed) {
            return Err(format!("the sign of {name} is not turned: thrust and rpm alone may be"));
        }
        match header.trim() {
            "" => Err(String::from(remedy)),
            header => Ok(Self { quantity, header: header.to_owned(), unit, is_reversed }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(text: &str) -> (&'static str, String, Option<&'static str>, bool) {
        let choice: ColumnChoice = text.parse().unwrap();
        (choice.quantity.name(), choice.header, choice.unit.map(|unit| unit.name), choice.is_reversed)
    }

    #[test]
    fn a_choice_names_quantity_column_unit_and_sign() {
        assert_eq!(chosen("time=t:ms"), ("time", "t".into(), Some("ms"), false));
        assert_eq!(chosen("thrust=load cell:-G"), ("thrust", "load cell".into(), Some("gf"), true));
        assert_eq!(chosen("command=Throttle (%)"), ("command", "Throttle (%)".into(), None, false));
        assert_eq!(chosen("command=ch:1:µs"), ("command", "ch:1".into(), Some("us"), false));
        assert_eq!(chosen("rpm=#4:rev/s"), ("rpm", "#4".into(), Some("rev/s"), false));
        assert_eq!(chosen("rpm=motor: speed [rpm]"), ("rpm", "motor: speed [rpm]".into(), None, false));
    }

    #[test]
    fn a_choice_that_is_none_says_why() {
        for (text, part) in [
            ("thrust", "QUANTITY=HEADER:UNIT"),
            ("thrust=:gf", "QUANTITY=HEADER:UNIT"),
            ("force=load:gf", "`force` is no quantity of a record: time, command, thrust, rpm, voltage, current"),
            ("thrst=load:gf", "current; did you mean `thrust`?"),
            ("thrust=load:ms", "`ms` is no unit of thrust: N, gf"),
            ("rpm=speed:Hz", "rpm, rev/s, rad/s, erpm"),
            ("time=t:-s", "the sign of time is not turned"),
        ] {
            let message = text.parse::<ColumnChoice>().unwrap_err();
            assert!(message.contains(part), "{text}: {message}");
        }
    }

    #[test]
    fn every_unit_that_is_listed_is_one() {
        for quantity in Quantity::ALL {
            let listed = quantity.units().replace("also ", "").replace(" or ", ", ").replace(['(', ')'], ", ");
            let words = listed.split(", ").map(str::trim).filter(|word| !word.is_empty() && *word != "pulse width");
            for word in words {
                assert!(Unit::named(quantity, word).is_some(), "`{word}` of {quantity:?}");
            }
        }
    }
}
