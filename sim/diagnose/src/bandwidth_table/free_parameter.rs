//! A parameter that bandwidths depend on.

use rotorlead_plant::effect::{Kind, Parameter, Scale, Site};

use super::case::Case;
use super::table::Column;

/// A change of a bandwidth by less than this part is none.
const NOTHING: f64 = 1e-9;

/// A parameter with its place among a kind's, stepped through on its own scale.
#[derive(Clone, Copy, Debug)]
pub(super) struct FreeParameter {
    pub index: usize,
    pub parameter: &'static Parameter,
    /// Coordinates from and to which it is searched: its plausible range, and all that is possible for the numbers of the lag,
    /// which may be stale by any factor.
    pub range: (f64, f64),
}

impl FreeParameter {
    fn new(kind: &Kind, index: usize, parameter: &'static Parameter) -> Self {
        let (low, high) = if kind.site == Site::Base { parameter.possible } else { parameter.plausible };
        let mut free_parameter = Self { index, parameter, range: (low, high) };
        free_parameter.range = (free_parameter.coordinate(low), free_parameter.coordinate(high));
        free_parameter
    }

    /// Where a value is on the scale.
    pub(super) fn coordinate(&self, value: f64) -> f64 {
        match self.parameter.scale {
            Scale::Linear => value,
            Scale::Log => value.ln(),
        }
    }

    /// The value at a coordinate.
    pub(super) fn value(&self, coordinate: f64) -> f64 {
        match self.parameter.scale {
            Scale::Linear => coordinate,
            Scale::Log => coordinate.exp(),
        }
    }

    /// Value per coordinate.
    pub(super) fn slope(&self, value: f64) -> f64 {
        match self.parameter.scale {
            Scale::Linear => 1.0,
            Scale::Log => value,
        }
    }
}

/// Where searches begin: the first start of each parameter that is fitted, the defaults of the others.
pub(super) fn first_values(kind: &Kind) -> Vec<f64> {
    let mut values = kind.null();
    for (index, parameter) in kind.fitted() {
        values[index] = parameter.starts.first().copied().unwrap_or(parameter.plausible.0);
    }
    values
}

/// The parameters that move a bandwidth, in their order.
pub(super) fn free_parameters(case: &Case, kind: &'static Kind) -> Vec<FreeParameter> {
    let first = first_values(kind);
    let moves = |index: usize, to: f64| {
        let mut values = first.clone();
        values[index] = to;
        case.rows.iter().any(|row| {
            Column::ALL.iter().any(|column| {
                let bandwidth = |values: &[f64]| case.predicted(row, *column, kind, values);
                // Where there is no bandwidth left (a clipped command) there is nothing to compare with a measured one.
                let (from, to) = (bandwidth(&first), bandwidth(&values));
                from.zip(to).is_some_and(|(from, to)| (to / from).ln().abs() > NOTHING)
            })
        })
    };
    let found = kind.fitted().filter(|(index, parameter)| {
        let (low, high) = parameter.plausible;
        moves(*index, low) || moves(*index, high)
    });
    found.map(|(index, parameter)| FreeParameter::new(kind, index, parameter)).collect()
}
