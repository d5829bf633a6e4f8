//! Logs of Tyto's Flight Stand software: tables, each column of which names its powertrain.
//!
//! `Time (s)`, `Powertrain 1 - ESC throttle (μs)`, `Powertrain 1 - force Fz (thrust) (N)` or `(kgf)`, `Powertrain 1 - rotation speed (rpm)`,
//! `Powertrain 1 - voltage (V)` and `Powertrain 1 - current (A)`: these are the names that published scripts read such files by; no file
//! of the program itself was at hand.

use super::format::{Dialect, LogFormat, Names, Reader, UNCOMPRESSED, spelled};
use super::quantity::Quantity;
use crate::experiment::Excitation;

const NAMES: Names = &[
    (Quantity::Command, "us", &["powertrain # - esc throttle (µs)"]),
    (Quantity::Command, "percent", &["powertrain # - esc throttle (%)"]),
    (Quantity::Thrust, "N", &["powertrain # - force fz (thrust) (n)"]),
    (Quantity::Thrust, "kgf", &["powertrain # - force fz (thrust) (kgf)"]),
    (Quantity::Thrust, "gf", &["powertrain # - force fz (thrust) (gf)"]),
    (Quantity::Thrust, "lbf", &["powertrain # - force fz (thrust) (lbf)"]),
    (Quantity::Speed, "rpm", &["powertrain # - rotation speed (rpm)"]),
    (Quantity::Speed, "rad/s", &["powertrain # - rotation speed (rad/s)"]),
    (Quantity::Voltage, "V", &["powertrain # - voltage (v)"]),
    (Quantity::Current, "A", &["powertrain # - current (a)"]),
];

fn is_header(header: &[String]) -> bool {
    header.iter().any(|name| spelled(name).starts_with("powertrain "))
}

/// The format.
pub(super) const FORMAT: LogFormat = LogFormat {
    name: "flight_stand",
    title: "Tyto Flight Stands",
    has_motors: true,
    has_several_logs: false,
    has_stated_columns: true,
    memory_per_byte: UNCOMPRESSED,
    reader: Reader::Table {
        is_header,
        dialect: &Dialect { names: NAMES, usual: Some(Excitation::Staircase), ..Dialect::PLAIN },
    },
};
