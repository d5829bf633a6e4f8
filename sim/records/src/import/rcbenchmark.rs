//! Continuous logs of an RCbenchmark (Tyto) thrust stand (1520/1580 series): tables, whose columns are found as those of any other.
//!
//! - The command is `ESC signal (µs)`, or without a unit where it was sent by DShot. It is empty until the output is switched on.
//! - `Motor Electrical Speed` is the speed that the stand derives from the motor's phase voltage and the number of poles set in
//!   its software. It is taken as it stands: if that number was wrong, all speeds are off by one constant factor, which changes
//!   gains but no time constant and no compensator. `Motor Optical Speed` stands in for it where it never moves.
//! - Each row carries the host's stamp for its own reading. Stamps are kept; a few rows overtake each other on their way and are
//!   sorted.
//! - The 1780 series has two motors, A and B, in whose columns the letter stands: `ESC B (µs)`, `Thrust B (N)`, `Motor Optical Speed B (RPM)`.
//! - Thrust and torque come from slower converters behind filters: they lag behind the speed, so that the response is the speed.

use super::format::{Dialect, LogFormat, Names, Reader, UNCOMPRESSED, spelled};
use super::quantity::Quantity;
use crate::experiment::Excitation;

const TIME: &str = "Time (s)";
const COMMAND: &str = "ESC signal";
const SPEEDS: [&str; 2] = ["Motor Electrical Speed", "Motor Optical Speed"];

/// Rows that overtake each other do so by a row or two. More is another log.
pub(super) const MAX_OVERTAKING_S: f64 = 0.1;

/// Columns of one of two motors.
const NAMES: Names = &[
    (Quantity::Command, "us", &["esc # (µs)", "esc signal # (µs)"]),
    (Quantity::Thrust, "N", &["thrust # (n)"]),
    (Quantity::Thrust, "kgf", &["thrust # (kgf)"]),
    (Quantity::Thrust, "gf", &["thrust # (gf)"]),
    (Quantity::Speed, "rpm", &["motor electrical speed # (rpm)", "motor optical speed # (rpm)"]),
    (Quantity::Voltage, "V", &["voltage # (v)"]),
    (Quantity::Current, "A", &["current # (a)"]),
];

const DIALECT: Dialect = Dialect { names: NAMES, is_stand: true, usual: Some(Excitation::Staircase), ..Dialect::PLAIN };

/// Whether a log with these columns is the stand's.
pub(super) fn is_header(header: &[String]) -> bool {
    let has_pulse = |name: &String| spelled(name) == "esc a (µs)" || spelled(name) == "esc b (µs)";
    if header.iter().any(|name| name == TIME) && header.iter().any(has_pulse) {
        return true;
    }
    let begins = |start: &str| header.iter().any(|name| name.starts_with(start));
    header.iter().any(|name| name == TIME) && begins(COMMAND) && SPEEDS.into_iter().any(begins)
}

/// The format.
pub(super) const FORMAT: LogFormat = LogFormat {
    name: "rc_benchmark",
    title: "RCbenchmark (Tyto) thrust stands",
    has_motors: true,
    has_several_logs: false,
    has_stated_columns: true,
    memory_per_byte: UNCOMPRESSED,
    reader: Reader::Table { is_header, dialect: &DIALECT },
};
