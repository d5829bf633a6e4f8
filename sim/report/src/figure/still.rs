//! The picture that a report shows without scripts and on paper: the SVG in a fraction of its length.

use std::fmt::Write as _;

use rotorlead_answer::Figure;

use super::FigureError;
use super::svg::drawing;

/// How far a curve may be from its points, units of the drawing: a quarter of a pixel.
const TOLERANCE: f64 = 2.0;

/// The SVG with neighbors of one look in one path, and curves without points that nobody sees.
///
/// # Errors
/// When nothing can be drawn.
pub(crate) fn still(figure: &Figure) -> Result<String, FigureError> {
    Ok(shortened(&drawing(figure)?))
}

fn shortened(svg: &str) -> String {
    let mut short = String::new();
    // The look of the path that is open.
    let mut open: Option<String> = None;
    for line in svg.lines() {
        let drawn = drawn(line);
        let look = drawn.as_ref().map(|(look, _)| look);
        if open.is_some() && open.as_ref() != look {
            short.push_str("\"/>\n");
        }
        match &drawn {
            None => {
                // What is so anyway; the page names the font.
                let words = line.replace(" opacity=\"1\"", "").replace(" font-family=\"sans-serif\"", "");
                let _ = writeln!(short, "{words}");
            }
            Some((look, path)) if open.as_ref() == Some(look) => short.push_str(path),
            Some((look, path)) => {
                let _ = write!(short, "<path {look} d=\"{path}");
            }
        }
        open = drawn.map(|(look, _)| look);
    }
    short
}

/// An element's look and path; `None` where it is neither a line nor a dot nor an area.
fn drawn(element: &str) -> Option<(String, String)> {
    let stroke = |color: &str, width: &str, opacity: &str| {
        format!("fill=\"none\" stroke=\"{color}\" stroke-width=\"{width}\" opacity=\"{opacity}\"")
    };
    match element.split('"').collect::<Vec<_>>()[..] {
        ["<line opacity=", opacity, " stroke=", color, " stroke-width=", width, _, x1, _, y1, _, x2, _, y2, _] => {
            Some((stroke(color, width, opacity), path(&format!("{x1},{y1} {x2},{y2}"))))
        }
        ["<polyline fill=", _, " opacity=", opacity, " stroke=", color, " stroke-width=", width, _, points, _] => {
            Some((stroke(color, width, opacity), path(points)))
        }
        ["<polygon opacity=", opacity, " fill=", color, _, points, _] => {
            Some((format!("fill=\"{color}\" opacity=\"{opacity}\""), path(points) + "z"))
        }
        // A line without length is as wide as its round ends.
        ["<circle cx=", x, _, y, _, radius, " opacity=", "1", " fill=", color, " stroke=", "none", ..] => {
            let width = 2 * radius.parse::<u32>().ok()?;
            Some((stroke(color, &width.to_string(), "1") + " stroke-linecap=\"round\"", format!("M{x} {y}h0")))
        }
        _ => None,
    }
}

/// A path along points, from each to the next.
fn path(points: &str) -> String {
    let points: Vec<(i32, i32)> = points
        .split_whitespace()
        .filter_map(|point| point.split_once(','))
        .filter_map(|(x, y)| Some((x.parse().ok()?, y.parse().ok()?)))
        .collect();
    let mut kept = points.get(..1).unwrap_or_default().to_vec();
    simplify(&points, &mut kept);
    let mut path = kept.first().map_or_else(String::new, |(x, y)| format!("M{x} {y}l"));
    for pair in kept.windows(2) {
        let _ = write!(path, "{:+}{:+}", pair[1].0 - pair[0].0, pair[1].1 - pair[0].1);
    }
    path
}

/// Adds to `kept`, which has the first point, those of the others that are seen (Ramer, Douglas and Peucker).
fn simplify(points: &[(i32, i32)], kept: &mut Vec<(i32, i32)>) {
    let [first, between @ .., last] = points else { return };
    let (across, up) = (f64::from(last.0 - first.0), f64::from(last.1 - first.1));
    let off = |point: &(i32, i32)| {
        let (x, y) = (f64::from(point.0 - first.0), f64::from(point.1 - first.1));
        let along = ((x * across + y * up) / (across * across + up * up).max(1.0)).clamp(0.0, 1.0);
        (x - along * across).hypot(y - along * up)
    };
    let offs = between.iter().map(off).enumerate();
    match offs.max_by(|a, b| a.1.total_cmp(&b.1)) {
        Some((index, farthest)) if farthest > TOLERANCE => {
            simplify(&points[..=index + 1], kept);
            simplify(&points[index + 1..], kept);
        }
        _ => kept.push(*last),
    }
}

#[cfg(test)]
mod tests {
    use rotorlead_answer::{Axis, Color, FigureKind, Mark, Panel, Series};

    use super::*;

    #[test]
    fn a_picture_keeps_what_is_seen_in_a_fraction_of_its_length() {
        let curve: Vec<(f64, f64)> = (0..2000).map(|k| 0.01 * f64::from(k)).map(|x| (x, x.sin())).collect();
        let band = curve.iter().map(|(_, y)| (y - 0.1, y + 0.1)).collect();
        let dots = Series::new("dots", Color::Green, Mark::Dots, curve.clone()).with_band(band);
        let series = [Mark::Line, Mark::Dashes].map(|mark| Series::new("", Color::Blue, mark, curve.clone()));
        let series = [series.to_vec(), vec![dots]].concat();
        let panel = Panel::new(Axis::linear("x", "s"), Axis::linear("y", "m"), series);
        let figure = Figure::new(FigureKind::Record, "Words", "", vec![panel]);
        let (svg, still) = (drawing(&figure).unwrap(), still(&figure).unwrap());
        assert!(still.len() * 5 < svg.len(), "{} of {}", still.len(), svg.len());
        // Had the drawing library another form of its own, it would still be there.
        for element in ["<circle", "<line", "<polyline", "<polygon"] {
            assert!(svg.contains(element) && !still.contains(element), "{element}");
        }
        let words = |svg: &str| svg.lines().filter(|line| !line.starts_with('<')).collect::<String>();
        assert_eq!(words(&still), words(&svg));
        assert_eq!(still.matches("h0").count(), svg.matches("<circle").count());
    }

    #[test]
    fn points_on_a_line_go_and_corners_stay() {
        assert_eq!(path("0,0 10,1 20,0 30,-1 40,0 40,50 20,50 0,50 "), "M0 0l+40+0+0+50-40+0");
        assert_eq!(path("0,0 100,0 0,0 "), "M0 0l+100+0-100+0", "there and back");
        assert_eq!(path("7,8 "), "M7 8l");
        assert_eq!(path(""), "");
    }

    #[test]
    fn neighbors_of_one_look_are_one_path_and_others_are_not() {
        let line = |color: &str, y: u32| {
            format!(
                "<line opacity=\"1\" stroke=\"{color}\" stroke-width=\"8\" x1=\"0\" y1=\"{y}\" x2=\"9\" y2=\"{y}\"/>\n"
            )
        };
        let look = |color: &str| format!("<path fill=\"none\" stroke=\"{color}\" stroke-width=\"8\" opacity=\"1\" d=");
        let svg = [line("red", 1), line("red", 2), line("blue", 3), "</svg>\n".to_owned()].concat();
        let expected = format!("{}\"M0 1l+9+0M0 2l+9+0\"/>\n{}\"M0 3l+9+0\"/>\n</svg>\n", look("red"), look("blue"));
        assert_eq!(shortened(&svg), expected);
    }
}
