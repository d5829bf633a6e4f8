//! From where to where the axes of a panel go.

use super::{Axis, Panel, Scale};

/// Room beyond the outermost values, as a part of what they span.
const ROOM: f64 = 0.06;
/// A band may widen an axis by so much of what the points span: it can be endless where noise hides the response.
const BAND: f64 = 0.25;

/// Both axes of a panel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extent {
    pub x: (f64, f64),
    pub y: (f64, f64),
}

impl Panel {
    /// What the numbers span, with some room; `None` where there is no number.
    pub(super) fn extent(&self) -> Option<Extent> {
        let drawn = || self.series.iter().flat_map(|series| &series.points).filter(|point| self.is_drawn(point));
        let cells = || self.map.iter().flat_map(|map| &map.cells);
        let x =
            self.x.extent(drawn().map(|point| point.0).chain(cells().flat_map(|cell| [cell.x.0, cell.x.1])), &[])?;
        let band: Vec<f64> =
            self.series.iter().flat_map(|series| &series.band).flat_map(|(low, high)| [*low, *high]).collect();
        let y = self.y.extent(drawn().map(|point| point.1).chain(cells().map(|cell| cell.row as f64)), &band)?;
        Some(Extent { x, y })
    }

    /// Whether a point has its place on both axes.
    pub(super) fn is_drawn(&self, point: &(f64, f64)) -> bool {
        self.x.has(point.0) && self.y.has(point.1)
    }
}

impl Axis {
    /// Whether the value has a place on the axis.
    pub(super) fn has(&self, value: f64) -> bool {
        value.is_finite() && (self.scale != Scale::Log || value > 0.0)
    }

    fn extent(&self, values: impl Iterator<Item = f64>, band: &[f64]) -> Option<(f64, f64)> {
        if let Scale::Names(names) = &self.scale {
            return (!names.is_empty()).then_some((-0.5, names.len() as f64 - 0.5));
        }
        if self.range.is_some() {
            return self.range;
        }
        let along = |value: f64| if self.scale == Scale::Log { value.ln() } else { value };
        let wider = |(low, high): (f64, f64), value: f64| (low.min(value), high.max(value));
        let empty = (f64::INFINITY, f64::NEG_INFINITY);
        let (low, high) = values.filter(|value| self.has(*value)).map(along).fold(empty, wider);
        if low > high {
            return None;
        }
        // A single value still needs an axis around it.
        let span = if high > low { high - low } else { (0.1 * high.abs()).max(1e-3) };
        let banded = band.iter().filter(|value| self.has(**value)).map(|value| along(*value)).fold((low, high), wider);
        let low = banded.0.max(low - BAND * span) - ROOM * span;
        let high = banded.1.min(high + BAND * span) + ROOM * span;
        Some(if self.scale == Scale::Log { (low.exp(), high.exp()) } else { (low, high) })
    }
}
