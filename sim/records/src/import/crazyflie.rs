//! Tables of Crazyflie's log variables, as scripts on cflib write them: a column for each variable, called by its group and name.
//!
//! The variables are those of bitcraze/crazyflie-firmware: `motor.m1` is what the motor gets, 0 to 65535, and `rpm.m1` what a deck or the ESC
//! measures; cflib stamps in milliseconds.

use super::format::{Dialect, LogFormat, Names, Reader, UNCOMPRESSED};
use super::quantity::Quantity;
use crate::experiment::Excitation;

const NAMES: Names = &[
    (Quantity::Time, "ms", &["timestamp", "timestamp ms"]),
    (Quantity::Command, "0..65535", &["motor.m#"]),
    (Quantity::Speed, "rpm", &["rpm.m#"]),
    (Quantity::Voltage, "V", &["pm.vbat"]),
    (Quantity::Voltage, "mV", &["pm.vbatmv"]),
];

const DIALECT: Dialect =
    Dialect { names: NAMES, usual: Some(Excitation::Staircase), may_be_flight: true, ..Dialect::PLAIN };

fn is_header(header: &[String]) -> bool {
    let of_motor = |quantity| {
        let is_it =
            |name: &String| DIALECT.meaning(name).is_some_and(|said| said.quantity == quantity && said.motor.is_some());
        header.iter().any(is_it)
    };
    of_motor(Quantity::Command) && of_motor(Quantity::Speed)
}

/// The format.
pub(super) const FORMAT: LogFormat = LogFormat {
    name: "crazyflie",
    title: "Crazyflie log variables (cflib) as a table",
    has_motors: true,
    has_several_logs: false,
    has_stated_columns: true,
    memory_per_byte: UNCOMPRESSED,
    reader: Reader::Table { is_header, dialect: &DIALECT },
};
