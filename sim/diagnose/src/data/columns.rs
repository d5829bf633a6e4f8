//! What was measured beside the response: the speed, and the voltage of the supply.

use std::ops::Range;

use rotorlead_plant::Trace;
use rotorlead_records::{Output, Record as SourceRecord};
use serde::Serialize;

use super::plateaus::rows::Blocks;

/// Which column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Column {
    /// Revolutions per minute, beside the thrust.
    #[serde(rename = "rpm")]
    Speed,
    /// Volts.
    #[serde(rename = "voltage_v")]
    Voltage,
}

impl Column {
    /// Its name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Speed => "rpm",
            Self::Voltage => "voltage_v",
        }
    }

    /// What the model says over so many rows, up to what is free: columns of which any sum may be what was measured.
    pub(crate) fn predicted(self, trace: &Trace, rows: usize) -> Vec<Vec<f64>> {
        match self {
            Self::Speed => {
                let mean = trace.speed.iter().sum::<f64>() / rows.max(1) as f64;
                let deviation: Vec<f64> = trace.speed.iter().map(|speed| speed - mean).collect();
                let squares = deviation.iter().map(|deviation| deviation * deviation).collect();
                vec![vec![1.0; rows], deviation, squares]
            }
            Self::Voltage if trace.voltage_v.is_empty() => vec![vec![1.0; rows]],
            Self::Voltage => vec![trace.voltage_v.clone()],
        }
    }
}

/// A column of a record that does not repeat.
#[derive(Clone, Debug)]
pub(crate) struct Channel {
    /// Which column.
    pub column: Column,
    /// What was measured at each row that is compared.
    pub measured: Vec<f64>,
}

/// The columns that a record has beside the response, over these rows. One that never changes says nothing.
pub(crate) fn columns(source: &SourceRecord, output: Output, rows: Range<usize>) -> Vec<(Column, Vec<f64>)> {
    let speed = source.rpm.as_deref().filter(|_| output == Output::ThrustN).map(|values| (Column::Speed, values));
    let voltage = source.voltage_v.as_deref().map(|values| (Column::Voltage, values));
    let there = [speed, voltage].into_iter().flatten().filter_map(|(column, values)| {
        let measured = values.get(rows.clone())?.to_vec();
        let moves =
            measured.iter().any(|value| *value != measured[0]) && measured.iter().all(|value| value.is_finite());
        moves.then_some((column, measured))
    });
    there.collect()
}

/// The columns of a record that does not repeat.
pub(crate) fn channels(source: &SourceRecord, output: Output, rows: Range<usize>, blocks: &Blocks) -> Vec<Channel> {
    let channel = |(column, measured): (Column, Vec<f64>)| Channel { column, measured: blocks.means(&measured) };
    columns(source, output, rows).into_iter().map(channel).collect()
}
