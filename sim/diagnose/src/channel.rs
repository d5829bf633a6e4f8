//! What a record that does not repeat shows beside the response: the speed, and the voltage of the supply.
//!
//! They separate what the response alone cannot. A second pole of the sensor, a lead of the inflow and a mode of the stand are in
//! the thrust and not in the speed; a sag of the supply is in the voltage, a drift of the gain is not. So each column that is
//! there adds its own white residual to that of the response:
//!
//! | column | model | free |
//! |---|---|---|
//! | `rpm` beside `thrust_n` | the simulated speed | a parabola of it: thrust is the square of the revolutions, more or less |
//! | `voltage_v` | the supply's voltage over that without load: 1 without an effect on the supply | the voltage without load |
//!
//! What is free is projected out, so a column says nothing of the gain of the response, and a model without a supply is not to
//! blame for the level of its voltage. The current is not used: no effect says it without the voltage.
//!
//! In records that repeat they are [heard](super::auxiliary channel) where the response alone cannot tell.

use nalgebra::{DMatrix, DVector};
use rotorlead_plant::Trace;
use rotorlead_records::{Output, Record as SourceRecord};
use serde::Serialize;

use super::dataset::{Record, Split};
use super::log::{Blocks, Errors, Filter};

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
    pub(super) fn predicted(self, trace: &Trace, rows: usize) -> Vec<Vec<f64>> {
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

/// A column with what makes its residual white.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    /// Which column.
    pub column: Column,
    measured: Vec<f64>,
    errors: Errors,
    fitted: Filter,
    held_out: Filter,
}

/// The columns that a record has beside the response, over these rows. One that never changes says nothing.
pub(super) fn columns(source: &SourceRecord, output: Output, rows: std::ops::Range<usize>) -> Vec<(Column, Vec<f64>)> {
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
pub(super) fn channels(
    source: &SourceRecord,
    output: Output,
    (rows, blocks): (std::ops::Range<usize>, &Blocks),
) -> Vec<Channel> {
    let channel = |(column, measured): (Column, Vec<f64>)| Channel {
        column,
        measured: blocks.means(&measured),
        errors: Errors::default(),
        fitted: Filter::default(),
        held_out: Filter::default(),
    };
    columns(source, output, rows).into_iter().map(channel).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Channel {
    /// The sum of the columns that comes nearest, by the rows that are fitted where there are such.
    fn nearest(&self, record: &Record, trace: &Trace) -> Vec<f64> {
        let split = if record.end_of(Some(Split::Train)) > 0 { Split::Train } else { Split::Holdout };
        let columns = self.column.predicted(trace, self.measured.len());
        let white: Vec<Vec<f64>> = columns.iter().map(|column| self.of(split).apply(column)).collect();
        let measured = self.of(split).apply(&self.measured);
        // Each column over its length, since they differ by orders of magnitude; one that never moves says nothing.
        let lengths: Vec<f64> = white.iter().map(|column| dot(column, column).sqrt()).collect();
        let scale = |index: usize| if lengths[index] > 0.0 { lengths[index].recip() } else { 0.0 };
        let count = columns.len();
        let matrix = DMatrix::from_fn(count, count, |i, j| dot(&white[i], &white[j]) * scale(i) * scale(j));
        let right = DVector::from_fn(count, |i, _| dot(&white[i], &measured) * scale(i));
        let solution = matrix.svd(true, true).solve(&right, 1e-9).unwrap_or_else(|_| DVector::zeros(count));
        let factors: Vec<f64> = solution.iter().enumerate().map(|(index, factor)| factor * scale(index)).collect();
        let sum = |row: usize| columns.iter().zip(&factors).map(|(column, factor)| factor * column[row]).sum();
        (0..self.measured.len()).map(sum).collect()
    }

    /// The white residual of a split.
    pub fn white(&self, record: &Record, split: Split, trace: &Trace) -> Vec<f64> {
        self.of(split).apply(&self.left(record, trace))
    }

    fn of(&self, split: Split) -> &Filter {
        if split == Split::Train { &self.fitted } else { &self.held_out }
    }

    /// Minus twice the log likelihood over the rows of a split, with the errors that are left there.
    pub fn deviance(&self, record: &Record, split: Split, trace: &Trace) -> f64 {
        self.of(split).deviance(&self.left(record, trace))
    }

    fn left(&self, record: &Record, trace: &Trace) -> Vec<f64> {
        let nearest = self.nearest(record, trace);
        self.measured.iter().zip(nearest).map(|(measured, model)| measured - model).collect()
    }

    /// Makes its filters anew for what the dataset's groups are for.
    pub fn assign(&mut self, record: &Record) {
        let Some(log) = &record.log else { return };
        let filter = |split| log.filter(self.errors, split, false);
        (self.fitted, self.held_out) = (filter(Split::Train), filter(Split::Holdout));
    }

    /// Takes the errors from what a model leaves.
    pub fn weigh(&mut self, record: &Record, trace: &Trace) {
        let Some(log) = &record.log else { return };
        self.assign(record);
        self.errors = self.of(log.known_by()).errors_of(&self.left(record, trace));
        self.assign(record);
    }
}
