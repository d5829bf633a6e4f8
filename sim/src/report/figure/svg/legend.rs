//! The legend: rows under the title, where it hides nothing.

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::{Area, BAND, Drawing, Figure, Mark, Series, rgb, text_width, words};

const ROW: u32 = 22;
const SWATCH: i32 = 22;
const GAP: u32 = 46;
const MARGIN: u32 = 30;

/// Each entry with the place of its left end.
pub(super) struct Legend<'a> {
    entries: Vec<(&'a Series, u32, u32)>,
    rows: u32,
}

impl<'a> Legend<'a> {
    /// Rows as wide as the picture; empty where there is only one series, which the title names.
    pub(super) fn of(figure: &'a Figure, width: u32) -> Self {
        let series = figure.legend();
        let mut entries = Vec::new();
        let (mut x, mut row) = (MARGIN, 0);
        if series.len() > 1 {
            for series in series {
                let wide = SWATCH as u32 + text_width(&series.group);
                if x > MARGIN && x + wide > width - MARGIN {
                    (x, row) = (MARGIN, row + 1);
                }
                entries.push((series, x, row));
                x += wide + GAP - 16;
            }
        }
        let rows = if entries.is_empty() { 0 } else { row + 1 };
        Self { entries, rows }
    }

    pub(super) fn height(&self) -> u32 {
        if self.rows == 0 { 0 } else { ROW * self.rows + 6 }
    }

    pub(super) fn draw(&self, area: &Area, top: i32) -> Drawing<()> {
        for (series, x, row) in &self.entries {
            let (x, y) = (*x as i32, top + (ROW * row + ROW / 2) as i32);
            swatch(area, series, (x, y))?;
            words(area, &series.group, (x + SWATCH + 4, y), HPos::Left)?;
        }
        Ok(())
    }
}

/// What a series looks like, in small.
fn swatch(area: &Area, series: &Series, (x, y): (i32, i32)) -> Drawing<()> {
    let color = rgb(series.color.rgb());
    let (middle, end) = (x + SWATCH / 2, x + SWATCH);
    if !series.band.is_empty() {
        area.draw(&Rectangle::new([(x, y - 6), (end, y + 6)], color.mix(BAND).filled()))?;
    }
    match series.mark {
        Mark::Line => area.draw(&PathElement::new(vec![(x, y), (end, y)], color.stroke_width(2)))?,
        Mark::Dashes => {
            for from in [x, x + 9, x + 18] {
                area.draw(&PathElement::new(vec![(from, y), (from + 5, y)], color.stroke_width(2)))?;
            }
        }
        Mark::Dots => area.draw(&Circle::new((middle, y), 3, color.mix(0.6).filled()))?,
        Mark::Discs => area.draw(&Circle::new((middle, y), 5, color.filled()))?,
        Mark::Crosses => area.draw(&Cross::new((middle, y), 5, color.stroke_width(2)))?,
        Mark::Rings => area.draw(&Circle::new((middle, y), 5, color.stroke_width(2)))?,
        Mark::Ticks => area.draw(&PathElement::new(vec![(middle, y - 8), (middle, y + 8)], color.stroke_width(3)))?,
        Mark::Bars => area.draw(&Rectangle::new([(x + 3, y - 6), (end - 3, y + 6)], color.filled()))?,
    }
    Ok(())
}
