//! What a diagnosis found, as figures: where the gap lies, what explains it, and how far it shrinks.

use std::fmt::Write as _;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::bode::{BodeError, COLORS, Frequency};
use crate::diagnose::{Diagnosis, Excess};
use crate::record::Output;

/// Width of every figure, pixels.
const WIDTH: u32 = 900;
/// Height of a line of a table of bars or dots, and of what is around them.
const LINE: u32 = 26;
const AROUND: u32 = 130;
/// Kinds that are shown.
const MOST_KINDS: usize = 12;
/// The map's darkest color: so many times the power of the noise.
const DARKEST: f64 = 1000.0;
/// Room for names left of an axis.
const NAMES: u32 = 190;

/// One figure: its name, the picture as SVG text, and its numbers as CSV.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Figure {
    /// File name without its end.
    pub name: &'static str,
    /// The picture.
    pub svg: String,
    /// The numbers.
    pub csv: String,
}

/// The figures of a diagnosis. Those that have nothing to show are left out.
///
/// # Errors
/// When the drawing library fails.
pub fn diagnosis_figures(found: &Diagnosis) -> Result<Vec<Figure>, BodeError> {
    let figures = [where_(found), candidates(found), gaps(found), residual(found)];
    figures.into_iter().flatten().map(|figure| figure.map_err(|error| BodeError::Drawing(error.to_string()))).collect()
}

type Drawing<T> = Result<T, Box<dyn std::error::Error>>;
type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

fn drawn(height: u32, draw: impl FnOnce(&Area) -> Drawing<()>) -> Drawing<String> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (WIDTH, height)).into_drawing_area();
        root.fill(&WHITE)?;
        draw(&root)?;
        root.present()?;
    }
    Ok(svg)
}

fn text(root: &Area, words: &str, at: (i32, i32), anchor: HPos) -> Drawing<()> {
    let style = ("sans-serif", 13).into_text_style(root).pos(Pos::new(anchor, VPos::Center));
    Ok(root.draw(&Text::new(words.to_owned(), at, style))?)
}

/// A color between white and dark blue.
fn shade(ratio: f64) -> RGBColor {
    let part = (ratio.max(1.0).ln() / DARKEST.ln()).clamp(0.0, 1.0);
    let mix = |from: f64, to: f64| (from + part * (to - from)) as u8;
    RGBColor(mix(246.0, 8.0), mix(248.0, 48.0), mix(252.0, 107.0))
}

fn ratio(excess: Excess) -> f64 {
    excess.sum / excess.expected
}

/// Power of the misfit over that of the noise, over frequency and nominal command.
fn where_(found: &Diagnosis) -> Option<Drawing<Figure>> {
    let cells = &found.map;
    let (first, last) = (cells.first()?, cells.last()?);
    let low = cells.iter().map(|cell| cell.band_hz.0).fold(first.band_hz.0, f64::min);
    let high = cells.iter().map(|cell| cell.band_hz.1).fold(last.band_hz.1, f64::max);
    let mut nominals: Vec<f64> = cells.iter().map(|cell| cell.nominal).collect();
    nominals.dedup();
    let mut csv = String::from("nominal,from_hz,to_hz,before_over_noise,after_over_noise\n");
    for cell in cells {
        let (from, to) = cell.band_hz;
        let _ = writeln!(csv, "{},{from},{to},{},{}", cell.nominal, ratio(cell.before), ratio(cell.after));
    }
    let rows = nominals.len();
    let draw = |root: &Area| -> Drawing<()> {
        let body = root.titled("Misfit over noise, in power", ("sans-serif", 20))?;
        let (body, legend) = body.split_horizontally(WIDTH - 110);
        for (panel, (title, is_after)) in
            body.split_evenly((1, 2)).iter().zip([("first model", false), ("improved model", true)])
        {
            let mut chart = ChartBuilder::on(panel)
                .margin(10)
                .caption(title, ("sans-serif", 15))
                .x_label_area_size(42)
                .y_label_area_size(56)
                .build_cartesian_2d(Frequency(low..high), -0.5..rows as f64 - 0.5)?;
            chart
                .configure_mesh()
                .disable_mesh()
                .x_desc("frequency, Hz")
                .y_desc("u_nom")
                .y_labels(rows + 1)
                .x_label_formatter(&|hz| format!("{hz}"))
                .y_label_formatter(&|_| String::new())
                .draw()?;
            let cells = cells.iter().filter_map(|cell| {
                let row = nominals.iter().position(|nominal| *nominal == cell.nominal)? as f64;
                let color = shade(ratio(if is_after { cell.after } else { cell.before }));
                Some(Rectangle::new([(cell.band_hz.0, row - 0.48), (cell.band_hz.1, row + 0.48)], color.filled()))
            });
            chart.draw_series(cells)?;
            for (row, nominal) in nominals.iter().enumerate() {
                let (x, y) = chart.backend_coord(&(low, row as f64));
                text(root, &format!("{nominal}"), (x - 8, y), HPos::Right)?;
            }
        }
        let (height, left) = (200, WIDTH as i32 - 90);
        let top = 20 + (legend.dim_in_pixel().1 as i32 - height) / 2;
        for step in 0..height {
            let value = DARKEST.powf(1.0 - f64::from(step) / f64::from(height));
            let corners = [(left, top + step), (left + 18, top + step + 1)];
            root.draw(&Rectangle::new(corners, shade(value).filled()))?;
        }
        for (label, value) in [("1", 1.0), ("10", 10.0), ("100", 100.0), ("1000", DARKEST)] {
            let part: f64 = f64::ln(value) / DARKEST.ln();
            let label = if value == DARKEST { format!("{label}+") } else { label.to_owned() };
            text(root, &label, (left + 26, top + ((1.0 - part) * f64::from(height)) as i32), HPos::Left)?;
        }
        Ok(())
    };
    let height = (rows as u32 * 34 + 130).max(300);
    Some(drawn(height, draw).map(|svg| Figure { name: "where", svg, csv }))
}

/// What each kind is worth, tried alone.
fn candidates(found: &Diagnosis) -> Option<Drawing<Figure>> {
    let tried: Vec<_> = found.tried.iter().filter(|tried| tried.worth.is_finite()).collect();
    let best = tried.iter().map(|tried| tried.worth).fold(f64::NEG_INFINITY, f64::max);
    let mut csv = String::from("kind,named,worth,fitted_gain,held_out_gain\n");
    let is_named = |id: &str| found.effects.iter().any(|effect| effect.kind.id == id);
    for tried in &tried {
        let id = tried.kind.id;
        let _ = writeln!(csv, "{id},{},{},{},{}", is_named(id), tried.worth, tried.fitted_gain, tried.held_out_gain);
    }
    if best < 1.0 {
        return None;
    }
    let shown: Vec<_> = tried.into_iter().filter(|tried| tried.worth > 1.0).take(MOST_KINDS).collect();
    let end = best.max(10.0) * 3.0;
    let axis = Frequency(1.0..end);
    // Over many decades there is room for their names alone.
    let label = |value: &f64| {
        let is_named = end < 1e3 || (value.log10() - value.log10().round()).abs() < 1e-9;
        if is_named { format!("{value}") } else { String::new() }
    };
    let draw = |root: &Area| -> Drawing<()> {
        let body = root.titled("Effects tried alone", ("sans-serif", 20))?;
        let mut chart = ChartBuilder::on(&body)
            .margin(10)
            .margin_right(24)
            .x_label_area_size(42)
            .y_label_area_size(NAMES)
            .build_cartesian_2d(axis, shown.len() as f64 - 0.5..-0.5)?;
        chart
            .configure_mesh()
            .disable_y_mesh()
            .light_line_style(WHITE)
            .x_desc("gain of log likelihood, fitted and held out, less one per parameter")
            .x_label_formatter(&label)
            .y_labels(0)
            .draw()?;
        let bars = shown.iter().enumerate().map(|(row, tried)| {
            let color = if is_named(tried.kind.id) { COLORS[1] } else { COLORS[0] };
            Rectangle::new([(1.0, row as f64 - 0.32), (tried.worth, row as f64 + 0.32)], color.filled())
        });
        chart.draw_series(bars)?;
        for (row, tried) in shown.iter().enumerate() {
            let (x, y) = chart.backend_coord(&(1.0, row as f64));
            let name = tried.kind.id.to_owned() + if is_named(tried.kind.id) { " (named)" } else { "" };
            text(root, &name, (x - 8, y), HPos::Right)?;
            let (end, _) = chart.backend_coord(&(tried.worth, row as f64));
            text(root, &format!("{:.0}", tried.worth), (end + 6, y), HPos::Left)?;
        }
        Ok(())
    };
    let height = shown.len() as u32 * LINE + AROUND;
    Some(drawn(height, draw).map(|svg| Figure { name: "candidates", svg, csv }))
}

/// The gap of each record, beside what noise alone leaves.
fn gaps(found: &Diagnosis) -> Option<Drawing<Figure>> {
    let records = &found.records;
    let mut csv = String::from("file,nominal,before,after,noise_floor\n");
    for record in records {
        let gap = record.gap;
        let _ = writeln!(csv, "{},{},{},{},{}", record.file, record.nominal, gap.before, gap.after, gap.noise_floor);
    }
    let all = || records.iter().flat_map(|record| [record.gap.before, record.gap.after, record.gap.noise_floor]);
    let percent = |value: f64| 100.0 * value;
    let low = all().filter(|value| *value > 0.0).map(percent).fold(f64::INFINITY, f64::min);
    let high = all().map(percent).fold(0.0, f64::max);
    if !(low.is_finite() && high > 0.0) {
        return None;
    }
    let axis = Frequency(0.7 * low..1.4 * high);
    let draw = |root: &Area| -> Drawing<()> {
        let on = if found.held_out { "held out" } else { "fitted: nothing was held out" };
        let body = root.titled(&format!("Gap of each record ({on})"), ("sans-serif", 20))?;
        let mut chart = ChartBuilder::on(&body)
            .margin(10)
            .margin_right(170)
            .x_label_area_size(42)
            .y_label_area_size(NAMES)
            .build_cartesian_2d(axis, records.len() as f64 - 0.5..-0.5)?;
        chart
            .configure_mesh()
            .disable_y_mesh()
            .light_line_style(WHITE)
            .x_desc("RMS of the residual over that of the response, percent")
            .x_label_formatter(&|percent| format!("{percent}"))
            .y_labels(0)
            .draw()?;
        for (row, record) in records.iter().enumerate() {
            let y = row as f64;
            let [before, after, noise] = [record.gap.before, record.gap.after, record.gap.noise_floor]
                .map(|value| percent(value).max(0.7 * low));
            chart.draw_series(LineSeries::new([(before, y), (after, y)], BLACK.mix(0.4)))?;
            chart.draw_series([Rectangle::new(
                [(noise / 1.004, y - 0.38), (noise * 1.004, y + 0.38)],
                BLACK.filled(),
            )])?;
            chart.draw_series([Circle::new((before, y), 5, COLORS[1].filled())])?;
            chart.draw_series([Circle::new((after, y), 5, COLORS[0].filled())])?;
            let (x, line) = chart.backend_coord(&(0.7 * low, y));
            text(root, &record.file, (x - 8, line), HPos::Right)?;
        }
        let left = WIDTH as i32 - 150;
        for (row, (label, color)) in [("first model", COLORS[1]), ("improved model", COLORS[0])].into_iter().enumerate()
        {
            let y = 60 + 22 * row as i32;
            root.draw(&Circle::new((left, y), 5, color.filled()))?;
            text(root, label, (left + 14, y), HPos::Left)?;
        }
        root.draw(&Rectangle::new([(left - 1, 96), (left + 1, 112)], BLACK.filled()))?;
        text(root, "noise alone", (left + 14, 104), HPos::Left)
    };
    let height = (records.len() as u32 * LINE + AROUND).max(190);
    Some(drawn(height, draw).map(|svg| Figure { name: "gap", svg, csv }))
}

/// What is left of one record over a period.
fn residual(found: &Diagnosis) -> Option<Drawing<Figure>> {
    let left = found.residual.as_ref()?;
    let mut csv = String::from("time_s,before,after,noise_std\n");
    for ((time_s, before), after) in left.time_s.iter().zip(&left.before).zip(&left.after) {
        let _ = writeln!(csv, "{time_s},{before},{after},{}", left.noise_std);
    }
    let unit = match found.conditions.output {
        Output::ThrustN => "N",
        Output::Rpm => "rpm",
    };
    let (from, to) = (*left.time_s.first()?, *left.time_s.last()?);
    let most = left.before.iter().chain(&left.after).fold(3.0 * left.noise_std, |most, value| most.max(value.abs()));
    let draw = |root: &Area| -> Drawing<()> {
        let body = root.titled(&format!("What is left of {}", left.file), ("sans-serif", 20))?;
        let mut chart = ChartBuilder::on(&body)
            .margin(10)
            .margin_right(20)
            .x_label_area_size(42)
            .y_label_area_size(70)
            .build_cartesian_2d(from..to, -1.1 * most..1.7 * most)?;
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .x_desc("time in the record, s")
            .y_desc(format!("measured less simulated, {unit}"))
            // Without the sign of a zero.
            .x_label_formatter(&|time_s| format!("{}", (1e6 * time_s).round() / 1e6 + 0.0))
            .y_label_formatter(&|left| format!("{}", (1e6 * left).round() / 1e6 + 0.0))
            .draw()?;
        let band = [(from, -2.0 * left.noise_std), (to, 2.0 * left.noise_std)];
        chart
            .draw_series([Rectangle::new(band, BLACK.mix(0.15).filled())])?
            .label("noise, two standard deviations")
            .legend(|(x, y)| Rectangle::new([(x, y - 5), (x + 18, y + 5)], BLACK.mix(0.15).filled()));
        for (label, values, color, width) in
            [("first model", &left.before, COLORS[1], 3), ("improved model", &left.after, COLORS[0], 1)]
        {
            let points = left.time_s.iter().copied().zip(values.iter().copied());
            chart
                .draw_series(LineSeries::new(points, color.stroke_width(width)))?
                .label(label)
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], color.stroke_width(2)));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE.mix(0.8))
            .label_font(("sans-serif", 13))
            .draw()?;
        Ok(())
    };
    Some(drawn(420, draw).map(|svg| Figure { name: "residual", svg, csv }))
}
