//! A figure as SVG.

use plotters::prelude::SVGBackend;
use rotorlead_answer::Figure;
use rotorlead_answer::escape::printable;

use super::FigureError;
use super::drawing::{PX, draw, size};

/// What tells a picture of this program, in its head.
pub(super) const MARK: &str = "<!-- Generator: rotorlead -->";
/// On a dark page, as an image, it is dark too: lightness turned over, and hues as they were.
const DARK: &str = "@media (prefers-color-scheme: dark) { svg { filter: invert(0.9) hue-rotate(180deg); } }";

/// The picture as SVG text, 900 pixels wide.
///
/// # Errors
/// When nothing can be drawn.
pub fn svg(figure: &Figure) -> Result<String, FigureError> {
    Ok(drawing(figure)?.replacen(">\n", &format!(">\n{MARK}\n<style>{DARK}</style>\n"), 1))
}

/// The same for a page with colors of its own.
pub(super) fn drawing(figure: &Figure) -> Result<String, FigureError> {
    let (width, height) = size(figure);
    let mut svg = String::new();
    draw(figure, SVGBackend::with_string(&mut svg, (width, height)))?;
    let size = |width: u32, height: u32| format!("<svg width=\"{width}\" height=\"{height}\"");
    // What XML does not allow; markup is escaped by what draws.
    Ok(printable(&svg).replacen(&size(width, height), &size(width / PX, height / PX), 1))
}

#[cfg(test)]
mod tests {
    use rotorlead_answer::{Axis, Color, FigureKind, Mark, Panel, Series};

    use super::*;
    use crate::figure::png;

    fn lag(name: &str, mark: Mark) -> Series {
        let points =
            (0..100).map(|i| 0.5 * 1.06_f64.powi(i)).map(|omega| (omega, -10.0 * (1.0 + omega * omega).log10()));
        Series::new(name, Color::Blue, mark, points.collect())
    }

    fn figure(series: Vec<Series>) -> Figure {
        let panel = Panel::new(Axis::frequency(), Axis::linear("magnitude", "dB"), series);
        Figure::new(FigureKind::Responses, "A lag", "", vec![panel])
    }

    #[test]
    fn a_picture_holds_its_words_and_a_dot_for_each_point() {
        let svg = svg(&figure(vec![lag("a model", Mark::Line), lag("a measurement", Mark::Dots)])).unwrap();
        for text in
            ["A lag", "a model", "a measurement", "magnitude, dB", "frequency, rad/s", "frequency, Hz", "</svg>"]
        {
            assert!(svg.contains(text), "{text}");
        }
        assert!(svg.contains("\n<style>@media (prefers-color-scheme: dark)"), "{}", &svg[..400]);
        assert!(svg.matches("<circle").count() >= 100, "one dot for each point");
    }

    #[test]
    fn nothing_to_draw_is_an_error_and_not_a_picture() {
        assert!(matches!(svg(&figure(vec![])), Err(FigureError::Empty { panel: 1, .. })));
        let bad = Series { points: vec![(0.0, 1.0), (1.0, f64::NAN)], ..lag("", Mark::Line) };
        assert!(matches!(svg(&figure(vec![bad])), Err(FigureError::Empty { .. })));
    }

    #[test]
    fn a_bitmap_is_twice_as_wide_and_not_empty() {
        let png = png(&figure(vec![lag("a model", Mark::Line)])).unwrap();
        assert_eq!(&png[1..4], b"PNG");
        assert_eq!(u32::from_be_bytes([png[16], png[17], png[18], png[19]]), 2 * 900);
        // Words are drawn: without its font the picture is some kilobytes smaller.
        assert!(png.len() > 20_000, "{}", png.len());
    }
}
