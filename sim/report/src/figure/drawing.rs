//! The drawing of a figure, on white: the same for SVG and for a bitmap.

mod along;
mod legend;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters_backend::DrawingBackend;
use rotorlead_answer::{Axis, Figure, HeatMap, Mark, Panel, Scale, Series};

use along::Along;
use legend::Legend;

use super::extent::{Extent, has, is_drawn};
use super::ticks::ticks;
use super::{FigureError, PALE};

/// Units of the drawing per pixel: the drawing library rounds to whole ones, and curves would get steps of a pixel.
pub(super) const PX: u32 = 8;
/// Width.
const WIDTH: u32 = 900 * PX;
/// Height of the title.
const TITLE: u32 = 36 * PX;
/// Font sizes, and the mean width of a letter as a part of its size.
const TITLE_FONT: u32 = 19 * PX;
const FONT: u32 = 13 * PX;
const SMALL_FONT: u32 = 12 * PX;
const LETTER: f64 = 0.56;
/// Width of thin lines, and of those that are data.
const THIN: u32 = PX;
const THICK: u32 = 2 * PX;
/// Room for the numbers left and right of a panel, and for the labels below and above.
const LEFT: u32 = 74 * PX;
const RIGHT: u32 = 84 * PX;
const BELOW: u32 = 46 * PX;
const ABOVE: u32 = 42 * PX;
/// Length of the marks at an axis.
const TICK: u32 = 5 * PX;
/// Room for the title of a panel.
const CAPTION: u32 = 22 * PX;
/// Room for a color scale.
const SCALE: u32 = 150 * PX;
/// Most room for names.
const MOST_NAMES: u32 = 280 * PX;
/// How much a band covers.
const BAND: f64 = 0.22;

type Drawing<T> = Result<T, Box<dyn std::error::Error>>;
type Area<B> = DrawingArea<B, Shift>;
type Chart<'a, B> = ChartContext<'a, B, Cartesian2d<Along, Along>>;

/// What a figure is drawn on.
pub(super) trait Canvas: DrawingBackend<ErrorType = std::io::Error> {}
impl<B: DrawingBackend<ErrorType = std::io::Error>> Canvas for B {}

/// Width and height of the drawing in units of a [`PX`]th of a pixel.
pub(super) fn size(figure: &Figure) -> (u32, u32) {
    let panels = PX * figure.panels.iter().map(|panel| panel.height).sum::<u32>();
    (WIDTH, TITLE + Legend::from_figure(figure, WIDTH).height() + panels)
}

/// Draws the figure on a canvas of its size.
pub(super) fn draw(figure: &Figure, canvas: impl Canvas) -> Result<(), FigureError> {
    let extents = Extent::from_panels(figure)?;
    draw_on(figure, &canvas.into_drawing_area(), &extents).map_err(|error| FigureError::drawing(figure, error))
}

fn draw_on<B: Canvas>(figure: &Figure, root: &Area<B>, extents: &[Extent]) -> Drawing<()> {
    let legend = Legend::from_figure(figure, WIDTH);
    root.fill(&WHITE)?;
    let style = ("sans-serif", TITLE_FONT).into_text_style(root).pos(Pos::new(HPos::Center, VPos::Center));
    root.draw(&Text::new(figure.title.clone(), (WIDTH as i32 / 2, TITLE as i32 / 2), style))?;
    legend.draw(root, TITLE as i32)?;
    let (_, mut rest) = root.split_vertically(TITLE + legend.height());
    for (panel, extent) in figure.panels.iter().zip(extents) {
        let (area, below) = rest.split_vertically(PX * panel.height);
        draw_panel(panel, &area, extent)?;
        rest = below;
    }
    Ok(root.present()?)
}

fn draw_panel<B: Canvas>(panel: &Panel, area: &Area<B>, extent: &Extent) -> Drawing<()> {
    let left = match &panel.y.scale {
        Scale::Names(names) => {
            let longest = names.iter().map(|name| text_width(name)).max().unwrap_or(0);
            (longest + 24 * PX + label_room(&panel.y)).clamp(LEFT, MOST_NAMES)
        }
        _ => LEFT,
    };
    let right = match (&panel.map, &panel.y.secondary) {
        (Some(_), _) => SCALE,
        (None, Some(_)) => RIGHT,
        (None, None) => 26 * PX,
    };
    let above = if panel.x.secondary.is_some() { ABOVE } else { 0 };
    let x = Along::new(&panel.x, extent.x, 10, false);
    let y = Along::new(&panel.y, extent.y, (panel.height / 50) as usize, matches!(panel.y.scale, Scale::Names(_)));
    let mut builder = ChartBuilder::on(area);
    builder
        .margin_left(8 * PX)
        .margin_right(right)
        .margin_bottom(4 * PX)
        .x_label_area_size(BELOW)
        .y_label_area_size(left);
    let caption = if panel.title.is_empty() { 0 } else { CAPTION };
    builder.margin_top(6 * PX + above + caption);
    let mut chart = builder.build_cartesian_2d(x.clone(), y.clone())?;
    let mut mesh = chart.configure_mesh();
    mesh.max_light_lines(0)
        .set_all_tick_mark_size(TICK)
        .axis_style(BLACK.stroke_width(THIN))
        .bold_line_style(BLACK.mix(0.13).stroke_width(THIN))
        .axis_desc_style(("sans-serif", FONT))
        .label_style(("sans-serif", SMALL_FONT))
        .x_desc(panel.x.title())
        .y_desc(panel.y.title());
    let (x_name, y_name) = (|value: &f64| x.name(*value), |value: &f64| y.name(*value));
    mesh.x_label_formatter(&x_name).y_label_formatter(&y_name);
    if panel.map.is_some() {
        mesh.disable_mesh();
    } else if matches!(panel.y.scale, Scale::Names(_)) {
        mesh.disable_y_mesh();
    }
    mesh.draw()?;
    if let Some(map) = &panel.map {
        let cells = map.cells.iter().map(|cell| {
            let corners = [(cell.x.0, cell.row as f64 - 0.47), (cell.x.1, cell.row as f64 + 0.47)];
            Rectangle::new(corners, rgb(map.color(cell.value)).filled())
        });
        chart.draw_series(cells)?;
        draw_scale(map, area)?;
    }
    for series in &panel.series {
        draw_series(series, panel, extent, &mut chart, area)?;
    }
    if caption > 0 {
        let style = ("sans-serif", FONT + 2 * PX).into_text_style(area).pos(Pos::new(HPos::Center, VPos::Center));
        let middle = (left as i32 + area.dim_in_pixel().0 as i32 - right as i32) / 2;
        area.draw(&Text::new(panel.title.clone(), (middle, CAPTION as i32 / 2), style))?;
    }
    draw_above(panel, extent, &chart, area)?;
    draw_right(panel, extent, &chart, area)
}

/// The second reading of the x axis, above the panel.
fn draw_above<B: Canvas>(panel: &Panel, extent: &Extent, chart: &Chart<B>, area: &Area<B>) -> Drawing<()> {
    let Some(secondary) = &panel.x.secondary else { return Ok(()) };
    let ends = (extent.x.0 * secondary.factor, extent.x.1 * secondary.factor);
    let (left, top) = area.get_base_pixel();
    // Of a list the first name is at the top, so that the top is not where the values end.
    let above = chart.plotting_area().get_pixel_range().1.start - top;
    let place = |x: f64| (chart.backend_coord(&(x, chart.y_range().end)).0 - left, above);
    for (value, name) in ticks(&panel.x.scale, ends, 10) {
        let (x, y) = place(value / secondary.factor);
        area.draw(&PathElement::new(vec![(x, y), (x, y - TICK as i32)], BLACK.stroke_width(THIN)))?;
        words(area, &name, (x, y - 13 * PX as i32), HPos::Center)?;
    }
    let ((from, y), (to, _)) = (place(extent.x.0), place(extent.x.1));
    words(area, &secondary.title(), ((from + to) / 2, y - 31 * PX as i32), HPos::Center)
}

/// The second reading of the y axis, right of the panel.
fn draw_right<B: Canvas>(panel: &Panel, extent: &Extent, chart: &Chart<B>, area: &Area<B>) -> Drawing<()> {
    let Some(secondary) = &panel.y.secondary else { return Ok(()) };
    let ends = (extent.y.0 * secondary.factor, extent.y.1 * secondary.factor);
    let (left, top) = area.get_base_pixel();
    let right = chart.plotting_area().get_pixel_range().0.end - left;
    let place = |y: f64| (right, chart.backend_coord(&(chart.x_range().end, y)).1 - top);
    for (value, name) in ticks(&panel.y.scale, ends, (panel.height / 50) as usize) {
        let (x, y) = place(value / secondary.factor);
        area.draw(&PathElement::new(vec![(x, y), (x + TICK as i32, y)], BLACK.stroke_width(THIN)))?;
        words(area, &name, (x + 8 * PX as i32, y), HPos::Left)?;
    }
    let ((x, from), (_, to)) = (place(extent.y.0), place(extent.y.1));
    let style = ("sans-serif", SMALL_FONT).into_text_style(area).pos(Pos::new(HPos::Center, VPos::Center));
    let upright = style.transform(FontTransform::Rotate90);
    Ok(area.draw(&Text::new(secondary.title(), (x + 66 * PX as i32, (from + to) / 2), upright))?)
}

fn draw_series<B: Canvas>(
    series: &Series,
    panel: &Panel,
    extent: &Extent,
    chart: &mut Chart<B>,
    area: &Area<B>,
) -> Drawing<()> {
    let color = rgb(series.color.rgb());
    let inside = |(x, y): (f64, f64)| (x.clamp(extent.x.0, extent.x.1), y.clamp(extent.y.0, extent.y.1));
    if !series.band.is_empty() {
        let drawn = || series.points.iter().zip(&series.band).filter(|(point, _)| is_drawn(panel, point));
        let end = |value: f64, instead: f64| if has(&panel.y, value) { value } else { instead };
        let low = drawn().map(|(point, band)| inside((point.0, end(band.0, extent.y.0))));
        let high = drawn().rev().map(|(point, band)| inside((point.0, end(band.1, extent.y.1))));
        chart.draw_series([Polygon::new(low.chain(high).collect::<Vec<_>>(), color.mix(BAND))])?;
    }
    // A line breaks where a point is missing.
    let runs: Vec<Vec<(f64, f64)>> = series
        .points
        .split(|point| !is_drawn(panel, point))
        .map(|run| run.iter().map(|point| inside(*point)).collect())
        .collect();
    let points = || runs.iter().flatten().copied();
    let near = |point: (f64, f64), (dx, dy): (i32, i32)| {
        let (x, y) = chart.backend_coord(&point);
        (x + dx, y + dy)
    };
    match series.mark {
        Mark::Line => {
            for run in runs {
                chart.draw_series([PathElement::new(run, color.stroke_width(THICK))])?;
            }
        }
        Mark::Dashes => {
            for run in runs {
                chart.draw_series(DashedLineSeries::new(run, 7 * PX, 5 * PX, color.stroke_width(THICK)))?;
            }
        }
        Mark::Dots => {
            chart.draw_series(points().map(|point| Circle::new(point, 2 * PX, pale(color).filled())))?;
        }
        Mark::Discs => {
            chart.draw_series(points().map(|point| Circle::new(point, 5 * PX, color.filled())))?;
        }
        Mark::Crosses => {
            chart.draw_series(points().map(|point| Cross::new(point, 5 * PX, color.stroke_width(THICK))))?;
        }
        Mark::Rings => {
            // Around a disc at the same place both are seen.
            chart.draw_series(points().map(|point| Circle::new(point, 7 * PX, color.stroke_width(THICK))))?;
        }
        Mark::Ticks => {
            let ends = points()
                .map(|point| [near(point, (0, -9 * PX as i32)), near(point, (0, 9 * PX as i32))])
                .collect::<Vec<_>>();
            for ends in ends {
                // The backend counts from the corner of the whole picture, an area from its own.
                let (left, top) = area.get_base_pixel();
                let own = ends.map(|(x, y)| (x - left, y - top)).to_vec();
                area.draw(&PathElement::new(own, color.stroke_width(3 * PX)))?;
            }
        }
        Mark::Bars => {
            let bar = |(x, y): (f64, f64)| [(extent.x.0, y - 0.32), (x, y + 0.32)];
            chart.draw_series(points().map(|point| Rectangle::new(bar(point), color.filled())))?;
        }
    }
    if series.mark == Mark::Bars {
        for (point, note) in series.points.iter().zip(&series.notes).filter(|(point, _)| is_drawn(panel, point)) {
            let (x, y) = chart.backend_coord(&inside(*point));
            let (left, top) = area.get_base_pixel();
            words(area, note, (x - left + 6 * PX as i32, y - top), HPos::Left)?;
        }
    }
    Ok(())
}

/// The scale of a map, at the right.
fn draw_scale<B: Canvas>(map: &HeatMap, area: &Area<B>) -> Drawing<()> {
    const ONE: i32 = PX as i32;
    let (width, height) = area.dim_in_pixel();
    let below = BELOW as i32 + 34 * ONE;
    let tall = (height as i32 - 110 * ONE).clamp(60 * ONE, 200 * ONE);
    let (left, top) = (width as i32 - SCALE as i32 + 28 * ONE, 34 * ONE + (height as i32 - below - tall).max(0) / 2);
    let (low, high) = map.range;
    for step in (0..tall).step_by(PX as usize) {
        let value = low * (high / low).powf(1.0 - f64::from(step) / f64::from(tall));
        let corners = [(left, top + step), (left + 18 * ONE, top + step + ONE)];
        area.draw(&Rectangle::new(corners, rgb(map.color(value)).filled()))?;
    }
    for (value, name) in map.named() {
        let y = top + ((1.0 - map.part(value)) * f64::from(tall)) as i32;
        words(area, &name, (left + 26 * ONE, y), HPos::Left)?;
    }
    for (line, label) in map.label.split(", ").enumerate() {
        words(area, label, (left - 12 * ONE, top + (15 * line as i32 - 34) * ONE), HPos::Left)?;
    }
    Ok(())
}

fn words<B: Canvas>(area: &Area<B>, text: &str, at: (i32, i32), anchor: HPos) -> Drawing<()> {
    let style = ("sans-serif", SMALL_FONT).into_text_style(area).pos(Pos::new(anchor, VPos::Center));
    Ok(area.draw(&Text::new(text.to_owned(), at, style))?)
}

fn rgb([red, green, blue]: [u8; 3]) -> RGBColor {
    RGBColor(red, green, blue)
}

/// A color on white as [`PALE`] makes it, opaque: where dots lie on each other they stay paler than a line.
fn pale(RGBColor(red, green, blue): RGBColor) -> RGBColor {
    let mixed = |part: u8| (255.0 - PALE * (255.0 - f64::from(part))).round() as u8;
    RGBColor(mixed(red), mixed(green), mixed(blue))
}

/// About how wide a text is.
fn text_width(text: &str) -> u32 {
    (text.chars().count() as f64 * LETTER * f64::from(FONT)) as u32
}

/// Room for the label beside the numbers or names of an axis.
fn label_room(axis: &Axis) -> u32 {
    if axis.title().is_empty() { 0 } else { 22 * PX }
}
