//! Betaflight's blackbox logs as tables: what `blackbox_decode` writes, and what the log viewer exports.
//!
//! `blackbox_decode` (betaflight/blackbox-tools, `src/blackbox_decode.c`, `outputFieldNamesHeader`) has the fields of the frames with their
//! units in one line: `loopIteration, time (us), ..., motor[0], ..., eRPM[0]`. The viewer writes the headers of the log above, and `time`.
//! Neither says how many poles a motor has, which `eRPM[]`, in hundreds of electrical revolutions per minute, needs. Commands are
//! DShot numbers or pulse widths.

use super::format::{Dialect, LogFormat, Names, Reader, UNCOMPRESSED, spelled};
use super::quantity::Quantity;
use crate::experiment::Excitation;

const NAMES: Names = &[
    (Quantity::Time, "us", &["time (us)", "time"]),
    (Quantity::Command, "", &["motor[@]"]),
    (Quantity::Speed, "erpm/100", &["erpm[@]"]),
    (Quantity::Voltage, "V", &["vbatlatest (v)"]),
];

fn is_header(header: &[String]) -> bool {
    let has = |name: &str| header.iter().any(|column| spelled(column) == name);
    has("loopiteration") && has("motor[0]")
}

/// The format.
pub(super) const FORMAT: LogFormat = LogFormat {
    name: "blackbox_csv",
    title: "Betaflight blackbox as a table (blackbox_decode)",
    has_motors: true,
    has_several_logs: false,
    has_stated_columns: true,
    memory_per_byte: UNCOMPRESSED,
    reader: Reader::Table {
        is_header,
        dialect: &Dialect {
            names: NAMES,
            usual: Some(Excitation::Staircase),
            is_dshot_or_pulse: true,
            may_be_flight: true,
            speed_elsewhere: Some(
                "Logs of Betaflight 4.1 to 4.4 have it in `debug[]` where debug_mode was DSHOT_RPM_TELEMETRY, that of motor 1 as \
                 `--column 'rpm=debug[0]:erpm/100'`",
            ),
            ..Dialect::PLAIN
        },
    },
};
