//! What the name of a column says: a quantity, a unit, the number of a motor.

use super::layout::PlainTable;
use crate::import::MOST_MOTORS;
use crate::import::format::Meaning;
use crate::import::quantity::{Quantity, Unit};

/// What a name says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Said {
    pub(super) quantity: Quantity,
    pub(super) unit: Option<Unit>,
    /// Which motor it is of, from 1, where it says that.
    pub(super) motor: Option<usize>,
}

impl Said {
    pub(super) fn from_column(plain: &PlainTable<'_>, index: usize) -> Option<Self> {
        let label = plain.label(index)?;
        let stated = || below(plain, index).or_else(|| behind_numbers(plain, index));
        let with_poles = |unit: Unit| unit.with_poles(plain.motor_poles);
        if let Some(Meaning { quantity, unit, motor }) = plain.dialect.meaning(label) {
            let stated = stated().and_then(|unit| Unit::named(quantity, &unit));
            return Some(Self {
                quantity,
                unit: stated.or_else(|| Unit::named(quantity, unit)).map(with_poles),
                motor,
            });
        }
        let (label, motor) = split_motor(label);
        let (base, in_name) = split(label);
        // `t` is the time, and `T` may be a torque or a temperature.
        if in_name.is_none() && label.trim() == "T" {
            return None;
        }
        // A unit of another quantity overrules the name: `esc_rpm` is no command.
        let of_unit = in_name.as_deref().and_then(Unit::measured_quantity);
        let named = Quantity::ALL.into_iter().find(|quantity| quantity.spellings().contains(&base.as_str()));
        let named = named.map(|named| of_unit.unwrap_or(named));
        // A unit may be a name of its own.
        let quantity = match named {
            Some(quantity) => quantity,
            None => in_name.as_deref().filter(|_| base.is_empty()).and_then(named_by_unit)?,
        };
        let written = in_name.or_else(stated);
        let unit = written.as_deref().and_then(|written| Unit::named(quantity, written));
        // `motor` alone may be anything of a motor.
        (quantity != Quantity::Speed || unit.is_some() || base.contains("speed") || base == "rpm").then_some(Self {
            quantity,
            unit: unit.map(with_poles),
            motor,
        })
    }
}

/// The quantity of a unit that is a name of its own.
fn named_by_unit(unit: &str) -> Option<Quantity> {
    match unit.to_lowercase().as_str() {
        "rpm" | "erpm" => Some(Quantity::Speed),
        "dshot" => Some(Quantity::Command),
        _ => None,
    }
}

/// The unit that is written in a column's name, below it, or behind its numbers.
pub(super) fn written(plain: &PlainTable<'_>, index: usize) -> Option<String> {
    plain
        .label(index)
        .filter(|label| plain.dialect.meaning(label).is_none())
        .and_then(|label| split(split_motor(label).0).1)
        .or_else(|| below(plain, index))
        .or_else(|| behind_numbers(plain, index))
}

/// The unit behind its numbers.
fn behind_numbers(plain: &PlainTable<'_>, index: usize) -> Option<String> {
    Some(plain.table.unit_behind_numbers(index)).filter(|unit| !unit.is_empty())
}

/// The unit in the line of units.
fn below(plain: &PlainTable<'_>, index: usize) -> Option<String> {
    plain.units.get(index).filter(|unit| !unit.is_empty()).cloned()
}

/// A name without the number of a motor behind it, as in `rpm.m1`, `pwm_motor2` or `eRPM[0]`, which counts from 0; and that, from 1.
fn split_motor(name: &str) -> (&str, Option<usize>) {
    let name = name.trim();
    let number = |digits: &str, least: usize| {
        let is_short = !digits.is_empty() && digits.len() <= 2 && digits.bytes().all(|byte| byte.is_ascii_digit());
        digits.parse().ok().filter(|number| is_short && (least..=MOST_MOTORS).contains(number))
    };
    if let Some((rest, index)) = name.strip_suffix(']').and_then(|name| name.rsplit_once('['))
        && let Some(index) = number(index, 0).filter(|&index: &usize| index < MOST_MOTORS && !rest.is_empty())
    {
        return (rest, Some(index + 1));
    }
    if let Some((rest, last)) = name.rsplit_once([' ', '_', '.', '/'])
        && let Some(digits) = last.strip_prefix("motor").or_else(|| last.strip_prefix(['m', 'M']))
        && let Some(motor) = number(digits, 1).filter(|_| !rest.is_empty())
    {
        return (rest, Some(motor));
    }
    (name, None)
}

/// A name as words in small letters, and the unit behind them: in brackets, or as the last word where it is one.
fn split(name: &str) -> (String, Option<String>) {
    let name = name.trim();
    if let Some(open) = name.rfind(['(', '[']).filter(|_| name.ends_with([')', ']'])) {
        let unit = name[open + 1..name.len() - 1].trim();
        return (words(&name[..open]), Some(unit.to_owned()).filter(|unit| !unit.is_empty()));
    }
    // A unit may have a stroke of its own; else it separates, as in the name of a topic.
    for separators in [&[' ', '_', '-', '.', ','][..], &['/']] {
        let start = name.rfind(separators).map_or(0, |at| at + 1);
        let last = &name[start..];
        // `duty` is more often the name of a command than its unit.
        let is_unit = Unit::is_any(last) && !last.eq_ignore_ascii_case("duty");
        if is_unit && (start > 0 || named_by_unit(last).is_some()) {
            let base = words(&name[..start]);
            return (base.strip_suffix(" in").map(str::to_owned).unwrap_or(base), Some(last.to_owned()));
        }
    }
    (words(name), None)
}

/// Small letters, and one blank for whatever stands between words.
fn words(text: &str) -> String {
    let lower = text.to_lowercase();
    lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ")
}

/// Whether a name is that of a speed which a stand derives from the motor's voltage.
pub(super) fn is_electrical(name: &str) -> bool {
    split(name).0.starts_with("motor electrical speed")
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn text(header: &str) -> String {
        format!("{header}\n{}\n", vec!["0.5"; header.split(',').count()].join(","))
    }

    fn plain(text: &str) -> PlainTable<'_> {
        PlainTable::parse(Path::new("log.csv"), text).unwrap()
    }

    /// What each name of a header is taken as.
    fn said(header: &str) -> Vec<Option<(&'static str, Option<&'static str>)>> {
        let text = text(header);
        let plain = plain(&text);
        let of = |index| {
            Said::from_column(&plain, index).map(|said| (said.quantity.name(), said.unit.map(|unit| unit.name)))
        };
        (0..plain.table.header.len()).map(of).collect()
    }

    #[test]
    fn names_say_quantity_and_unit() {
        for (name, expected) in [
            ("time_ms", ("time", "ms")),
            ("Time (s)", ("time", "s")),
            ("Time [µs]", ("time", "us")),
            ("t_s", ("time", "s")),
            ("time in ms", ("time", "ms")),
            ("thrust [g]", ("thrust", "gf")),
            ("thrust_n", ("thrust", "N")),
            ("Thrust (lbf)", ("thrust", "lbf")),
            ("Throttle (%)", ("command", "percent")),
            ("throttle_percent", ("command", "percent")),
            ("pwm_us", ("command", "us")),
            ("ESC signal (µs)", ("command", "us")),
            ("Duty [0..1]", ("command", "duty")),
            ("rpm", ("rpm", "rpm")),
            ("Motor RPM", ("rpm", "rpm")),
            ("Speed (rad/s)", ("rpm", "rad/s")),
            ("Motor Optical Speed (RPM)", ("rpm", "rpm")),
            ("vbat_mV", ("voltage", "mV")),
            ("Current (A)", ("current", "A")),
            ("esc_rpm", ("rpm", "rpm")),
            ("ESC RPM", ("rpm", "rpm")),
            ("ESC speed [rad/s]", ("rpm", "rad/s")),
            ("pwm_mV", ("voltage", "mV")),
            ("/motor/rpm", ("rpm", "rpm")),
            ("speed_rad/s", ("rpm", "rad/s")),
            ("eRPM", ("rpm", "erpm")),
            ("motor_erpm", ("rpm", "erpm")),
            ("speed (eRPM)", ("rpm", "erpm")),
            ("eRPM[0]", ("rpm", "erpm")),
            ("rpm.m1", ("rpm", "rpm")),
        ] {
            let (quantity, unit) = expected;
            assert_eq!(said(&format!("{name},x"))[0], Some((quantity, Some(unit))), "{name}");
        }
    }

    #[test]
    fn names_that_say_less_are_apart_from_those_that_say_nothing() {
        for name in
            ["time", "throttle", "pwm", "Duty", "command", "thrust", "speed", "Speed (Hz)", "pwm_duty", "voltage"]
        {
            assert!(matches!(said(&format!("{name},x"))[0], Some((_, None))), "{name}");
        }
        for name in ["ms", "load (g)", "torque_nm", "motor", "motor_temperature", "motor[0]", "x", "esc_command", "s"] {
            assert_eq!(said(&format!("{name},x"))[0], None, "{name}");
        }
    }
}
