//! From where to where the axes of a panel go.

use rotorlead_answer::{Axis, Figure, Panel, Scale};

use super::FigureError;

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

impl Extent {
    /// Those of all panels.
    pub(super) fn from_panels(figure: &Figure) -> Result<Vec<Self>, FigureError> {
        let empty = |index| FigureError::Empty { name: figure.name.clone(), panel: index + 1 };
        let panels = figure.panels.iter().enumerate();
        panels.map(|(index, panel)| Self::from_panel(panel).ok_or_else(|| empty(index))).collect()
    }

    /// What the numbers span, with some room; `None` where there is no number.
    fn from_panel(panel: &Panel) -> Option<Self> {
        let drawn = || panel.series.iter().flat_map(|series| &series.points).filter(|point| is_drawn(panel, point));
        let cells = || panel.map.iter().flat_map(|map| &map.cells);
        let across = drawn().map(|point| point.0).chain(cells().flat_map(|cell| [cell.x.0, cell.x.1]));
        let x = ends(&panel.x, across, &[])?;
        let band: Vec<f64> =
            panel.series.iter().flat_map(|series| &series.band).flat_map(|(low, high)| [*low, *high]).collect();
        let y = ends(&panel.y, drawn().map(|point| point.1).chain(cells().map(|cell| cell.row as f64)), &band)?;
        Some(Self { x, y })
    }
}

/// Whether a point has its place on both axes.
pub(super) fn is_drawn(panel: &Panel, point: &(f64, f64)) -> bool {
    has(&panel.x, point.0) && has(&panel.y, point.1)
}

/// Whether the value has a place on the axis.
pub(super) fn has(axis: &Axis, value: f64) -> bool {
    value.is_finite() && (axis.scale != Scale::Log || value > 0.0)
}

fn ends(axis: &Axis, values: impl Iterator<Item = f64>, band: &[f64]) -> Option<(f64, f64)> {
    if let Scale::Names(names) = &axis.scale {
        return (!names.is_empty()).then_some((-0.5, names.len() as f64 - 0.5));
    }
    if axis.range.is_some() {
        return axis.range;
    }
    let along = |value: f64| if axis.scale == Scale::Log { value.ln() } else { value };
    let wider = |(low, high): (f64, f64), value: f64| (low.min(value), high.max(value));
    let empty = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = values.filter(|value| has(axis, *value)).map(along).fold(empty, wider);
    if low > high {
        return None;
    }
    // A single value still needs an axis around it.
    let span = if high > low { high - low } else { (0.1 * high.abs()).max(1e-3) };
    let banded = band.iter().filter(|value| has(axis, **value)).map(|value| along(*value)).fold((low, high), wider);
    let low = banded.0.max(low - BAND * span) - ROOM * span;
    let high = banded.1.min(high + BAND * span) + ROOM * span;
    Some(if axis.scale == Scale::Log { (low.exp(), high.exp()) } else { (low, high) })
}
