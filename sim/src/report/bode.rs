//! Bode plots as SVG.

use miette::Diagnostic;
use num_complex::Complex64;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::prelude::*;
use thiserror::Error;

/// Size of the picture in pixels.
const SIZE: (u32, u32) = (900, 720);
/// Colors that stay apart for most color-blind eyes (Okabe and Ito's palette, without its yellow).
pub(super) const COLORS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(0, 0, 0),
];

/// How a curve is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// A model: a line.
    Line,
    /// A measurement: a dot at each frequency.
    Dots,
}

/// One response.
#[derive(Clone, Debug)]
pub struct Curve {
    /// What the legend says.
    pub label: String,
    /// Line or dots.
    pub mark: Mark,
    /// Index of the color; a model and what was measured of it share theirs.
    pub color: usize,
    /// Frequency in rad/s and response, by increasing frequency.
    pub points: Vec<(f64, Complex64)>,
}

/// Why there is no picture.
#[derive(Debug, Error, Diagnostic)]
pub enum BodeError {
    /// No curve has a point above 0 rad/s with a finite response.
    #[error("there is nothing to draw: no curve has a point at a positive frequency")]
    #[diagnostic(help("give records or models with at least one frequency above zero"))]
    Empty,
    /// The drawing library failed.
    #[error("the figure cannot be drawn: {0}")]
    Drawing(String),
}

/// A logarithmic axis with a key point at each decade's 1, 2 and 5.
#[derive(Clone)]
pub(super) struct Frequency(pub(super) std::ops::Range<f64>);

impl Ranged for Frequency {
    type ValueType = f64;
    type FormatOption = DefaultFormatting;

    fn map(&self, value: &f64, (low, high): (i32, i32)) -> i32 {
        let part = (value / self.0.start).ln() / (self.0.end / self.0.start).ln();
        low + (part * f64::from(high - low)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        let first = self.0.start.log10().floor() as i32;
        let last = self.0.end.log10().ceil() as i32;
        (first..=last)
            .flat_map(|decade| [1.0, 2.0, 5.0].map(|step| step * 10.0_f64.powi(decade)))
            .filter(|value| (self.0.start..=self.0.end).contains(value))
            .collect()
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.0.clone()
    }
}

/// Draws magnitude and phase of `curves` over frequency, and a line at `level_db` where one is given, as SVG text.
///
/// Phases are unwrapped along each curve. Points that are not finite, or not at a positive frequency, are left out.
///
/// # Errors
/// When nothing can be drawn.
pub fn bode(title: &str, curves: &[Curve], level_db: Option<f64>) -> Result<String, BodeError> {
    let traces: Vec<Trace> = curves.iter().map(Trace::new).collect();
    let all = || traces.iter().flat_map(|trace| trace.points.iter());
    let frequencies = bounds(all().map(|point| point.0)).ok_or(BodeError::Empty)?;
    let magnitudes = bounds(all().map(|point| point.1).chain(level_db)).ok_or(BodeError::Empty)?;
    let phases = bounds(all().map(|point| point.2)).ok_or(BodeError::Empty)?;

    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        draw(&root, title, &traces, level_db, (frequencies, padded(magnitudes), padded(phases)))
            .map_err(|error| BodeError::Drawing(error.to_string()))?;
    }
    Ok(svg)
}

/// A curve as it is drawn: frequency in rad/s, magnitude in dB, phase in degrees.
struct Trace<'a> {
    curve: &'a Curve,
    points: Vec<(f64, f64, f64)>,
}

impl<'a> Trace<'a> {
    fn new(curve: &'a Curve) -> Self {
        let mut last = 0.0;
        let points = curve
            .points
            .iter()
            .filter(|(omega, value)| *omega > 0.0 && omega.is_finite() && value.norm().is_normal())
            .map(|(omega, value)| {
                let phase = value.arg().to_degrees();
                last = phase - 360.0 * ((phase - last) / 360.0).round();
                (*omega, 20.0 * value.norm().log10(), last)
            })
            .collect();
        Self { curve, points }
    }

    fn color(&self) -> RGBColor {
        COLORS[self.curve.color % COLORS.len()]
    }
}

type Bounds = (f64, f64);

/// Smallest and largest of the values; `None` of none.
fn bounds(values: impl Iterator<Item = f64>) -> Option<Bounds> {
    values.fold(None, |bounds, value| {
        let (low, high) = bounds.unwrap_or((value, value));
        Some((value.min(low), value.max(high)))
    })
}

/// Room around the values, at least a tenth of what they span and one unit.
fn padded((low, high): Bounds) -> std::ops::Range<f64> {
    let room = 0.08 * (high - low) + 1.0;
    low - room..high + room
}

type Drawing<T> = Result<T, Box<dyn std::error::Error>>;

fn draw(
    root: &DrawingArea<SVGBackend<'_>, Shift>,
    title: &str,
    traces: &[Trace],
    level_db: Option<f64>,
    (frequencies, magnitudes, phases): (Bounds, std::ops::Range<f64>, std::ops::Range<f64>),
) -> Drawing<()> {
    root.fill(&WHITE)?;
    let body = root.titled(title, ("sans-serif", 20))?;
    let (upper, lower) = body.split_vertically(body.dim_in_pixel().1 * 57 / 100);
    let frequencies = Frequency(frequencies.0 / 1.05..frequencies.1 * 1.05);

    let mut chart = ChartBuilder::on(&upper)
        .margin(8)
        .x_label_area_size(8)
        .y_label_area_size(60)
        .build_cartesian_2d(frequencies.clone(), magnitudes)?;
    chart
        .configure_mesh()
        .y_desc("magnitude, dB")
        .x_label_formatter(&|_| String::new())
        .light_line_style(WHITE)
        .draw()?;
    if let Some(level) = level_db {
        let ends = [(frequencies.0.start, level), (frequencies.0.end, level)];
        chart.draw_series(LineSeries::new(ends, BLACK.mix(0.5)))?;
    }
    for trace in traces {
        let color = trace.color();
        let points = trace.points.iter().map(|&(omega, db, _)| (omega, db));
        let series = match trace.curve.mark {
            Mark::Line => chart.draw_series(LineSeries::new(points, color.stroke_width(2)))?,
            Mark::Dots => chart.draw_series(points.map(|point| Circle::new(point, 2, color.mix(0.6).filled())))?,
        };
        let mark = trace.curve.mark;
        series.label(&trace.curve.label).legend(move |(x, y)| match mark {
            Mark::Line => PathElement::new(vec![(x, y), (x + 18, y)], color.stroke_width(2)).into_dyn(),
            Mark::Dots => Circle::new((x + 9, y), 3, color.mix(0.6).filled()).into_dyn(),
        });
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerLeft)
        .background_style(WHITE.mix(0.8))
        .label_font(("sans-serif", 13))
        .draw()?;

    let mut chart = ChartBuilder::on(&lower)
        .margin(8)
        .x_label_area_size(40)
        .y_label_area_size(60)
        .build_cartesian_2d(frequencies, phases)?;
    chart.configure_mesh().y_desc("phase, degrees").x_desc("frequency, rad/s").light_line_style(WHITE).draw()?;
    for trace in traces {
        let color = trace.color();
        let points = trace.points.iter().map(|&(omega, _, phase)| (omega, phase));
        match trace.curve.mark {
            Mark::Line => chart.draw_series(LineSeries::new(points, color.stroke_width(2)))?,
            Mark::Dots => chart.draw_series(points.map(|point| Circle::new(point, 2, color.mix(0.6).filled())))?,
        };
    }
    root.present()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lag(label: &str, mark: Mark) -> Curve {
        let points =
            (0..100).map(|i| 0.5 * 1.06_f64.powi(i)).map(|omega| (omega, 1.0 / Complex64::new(1.0, omega / 10.0)));
        Curve { label: label.to_owned(), mark, color: 0, points: points.collect() }
    }

    #[test]
    fn a_figure_holds_both_panels_and_the_legend() {
        let svg = bode("lag", &[lag("a model", Mark::Line), lag("a measurement", Mark::Dots)], Some(-3.0)).unwrap();
        for text in ["a model", "a measurement", "magnitude, dB", "phase, degrees", "frequency, rad/s", "</svg>"] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(svg.matches("<circle").count() >= 200, "one dot for each point and panel");
    }

    #[test]
    fn nothing_to_draw_is_an_error_and_not_a_picture() {
        assert!(matches!(bode("none", &[], None), Err(BodeError::Empty)));
        let bad =
            Curve { points: vec![(0.0, Complex64::ONE), (1.0, Complex64::new(f64::NAN, 0.0))], ..lag("", Mark::Line) };
        assert!(matches!(bode("none", &[bad], None), Err(BodeError::Empty)));
    }
}
