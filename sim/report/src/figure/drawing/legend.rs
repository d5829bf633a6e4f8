//! The legend: rows under the title, where it hides nothing.

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;
use rotorlead_answer::{Figure, Mark, Series};

use super::{Area, BAND, Canvas, Drawing, PX, THICK, pale, rgb, text_width, words};

const ONE: i32 = PX as i32;
const ROW: u32 = 22 * PX;
const SWATCH: i32 = 22 * ONE;
/// Between a name and the next swatch.
const GAP: u32 = 30 * PX;
const MARGIN: u32 = 30 * PX;

/// Each entry with the place of its left end.
pub(super) struct Legend<'a> {
    entries: Vec<(&'a Series, u32, u32)>,
    rows: u32,
}

impl<'a> Legend<'a> {
    /// Rows as wide as the picture; empty where there is only one series, which the title names.
    pub(super) fn from_figure(figure: &'a Figure, width: u32) -> Self {
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
                x += wide + GAP;
            }
        }
        let rows = if entries.is_empty() { 0 } else { row + 1 };
        Self { entries, rows }
    }

    pub(super) fn height(&self) -> u32 {
        if self.rows == 0 { 0 } else { ROW * self.rows + 6 * PX }
    }

    pub(super) fn draw<B: Canvas>(&self, area: &Area<B>, top: i32) -> Drawing<()> {
        for (series, x, row) in &self.entries {
            let (x, y) = (*x as i32, top + (ROW * row + ROW / 2) as i32);
            swatch(area, series, (x, y))?;
            words(area, &series.group, (x + SWATCH + 4 * ONE, y), HPos::Left)?;
        }
        Ok(())
    }
}

/// What a series looks like, in small.
fn swatch<B: Canvas>(area: &Area<B>, series: &Series, (x, y): (i32, i32)) -> Drawing<()> {
    let color = rgb(series.color.rgb());
    let (middle, end) = (x + SWATCH / 2, x + SWATCH);
    if !series.band.is_empty() {
        area.draw(&Rectangle::new([(x, y - 6 * ONE), (end, y + 6 * ONE)], color.mix(BAND).filled()))?;
    }
    match series.mark {
        Mark::Line => area.draw(&PathElement::new(vec![(x, y), (end, y)], color.stroke_width(THICK)))?,
        Mark::Dashes => {
            for from in [x, x + 9 * ONE, x + 18 * ONE] {
                area.draw(&PathElement::new(vec![(from, y), (from + 4 * ONE, y)], color.stroke_width(THICK)))?;
            }
        }
        Mark::Dots => area.draw(&Circle::new((middle, y), 3 * ONE, pale(color).filled()))?,
        Mark::Discs => area.draw(&Circle::new((middle, y), 5 * ONE, color.filled()))?,
        Mark::Crosses => area.draw(&Cross::new((middle, y), 5 * ONE, color.stroke_width(THICK)))?,
        Mark::Rings => area.draw(&Circle::new((middle, y), 7 * ONE, color.stroke_width(THICK)))?,
        Mark::Ticks => area
            .draw(&PathElement::new(vec![(middle, y - 8 * ONE), (middle, y + 8 * ONE)], color.stroke_width(3 * PX)))?,
        Mark::Bars => {
            area.draw(&Rectangle::new([(x + 3 * ONE, y - 6 * ONE), (end - 3 * ONE, y + 6 * ONE)], color.filled()))?
        }
    }
    Ok(())
}
