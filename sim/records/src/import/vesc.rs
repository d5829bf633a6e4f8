//! Real-time logs of VESC Tool: tables with semicolons.
//!
//! `ms_today;input_voltage;...;current_in;...;erpm;duty_cycle;...`, as vedderb/vesc_tool writes them (`vescinterface.cpp`,
//! `VescInterface::openRtLogFile`). The speed is electrical: the log does not say how many poles the motor has.

use super::format::{Dialect, LogFormat, Names, Reader, UNCOMPRESSED};
use super::quantity::Quantity;
use crate::experiment::Excitation;

const NAMES: Names = &[
    (Quantity::Time, "ms", &["mstoday"]),
    (Quantity::Command, "duty", &["dutycycle"]),
    (Quantity::Speed, "erpm", &["erpm"]),
    (Quantity::Voltage, "V", &["inputvoltage"]),
    (Quantity::Current, "A", &["currentin"]),
];

fn is_header(header: &[String]) -> bool {
    let has = |name: &str| header.iter().any(|column| column == name);
    has("ms_today") && has("duty_cycle") && has("erpm")
}

/// The format.
pub(super) const FORMAT: LogFormat = LogFormat {
    name: "vesc",
    title: "VESC Tool",
    has_motors: false,
    has_several_logs: false,
    has_stated_columns: true,
    memory_per_byte: UNCOMPRESSED,
    reader: Reader::Table {
        is_header,
        dialect: &Dialect {
            names: NAMES,
            usual: Some(Excitation::Staircase),
            note: Some(
                "`duty_cycle` is what the VESC put out: it is the command in duty control alone, and the answer of a controller where \
                 current or speed was commanded",
            ),
            ..Dialect::PLAIN
        },
    },
};
