//! A figure for a reader with a pointer: what plotly.js draws, a plot for each panel.
//!
//! Colors of text and grid are left to the page, which knows whether it is light or dark.

use rotorlead_answer::{Axis, Figure, HeatMap, Mark, Panel, Scale, Series};
use serde_json::{Value, json};

use super::extent::{Extent, has, is_drawn};
use super::ticks::ticks;
use super::{FigureError, PALE};
use crate::markup::escape_markup;

/// Significant digits of what is drawn: a screen has no more.
const DIGITS: usize = 6;
const TRANSPARENT: &str = "rgba(0,0,0,0)";
/// How much a band covers.
const BAND: f64 = 0.22;

/// The plots, a panel each.
///
/// # Errors
/// When there is nothing to draw.
pub(crate) fn plots(figure: &Figure) -> Result<Vec<Value>, FigureError> {
    let extents = Extent::from_panels(figure)?;
    Ok(figure.panels.iter().zip(&extents).map(|(panel, extent)| plot(panel, extent)).collect())
}

fn plot(panel: &Panel, extent: &Extent) -> Value {
    let maps = panel.map.iter().flat_map(|map| map_traces(map, panel));
    let mut data: Vec<Value> =
        maps.chain(panel.series.iter().flat_map(|series| series_traces(series, panel, extent))).collect();
    let right = if panel.y.secondary.is_some() { 52 } else { 14 };
    let top = if panel.x.secondary.is_some() { 52 } else { 14 };
    let mut layout = json!({
        "autosize": true, "height": panel.height, "margin": { "l": 62, "r": right, "t": top, "b": 48 },
        "showlegend": false, "hovermode": "closest", "dragmode": "zoom",
        "hoverlabel": { "bgcolor": "#ffffff", "namelength": -1 },
        "font": { "family": "system-ui, sans-serif", "size": 12 },
        "paper_bgcolor": TRANSPARENT, "plot_bgcolor": TRANSPARENT,
        "xaxis": plotted(&panel.x, extent.x, 1.0, panel.x.title()),
        "yaxis": plotted(&panel.y, extent.y, 1.0, panel.y.title()),
    });
    // An axis is drawn where something is on it.
    if let Some(axis) = plotted_beside(&panel.x, extent.x, "x", "top") {
        layout["xaxis2"] = axis;
        data.push(json!({ "x": [extent.x.1], "y": [null], "hoverinfo": "skip", "xaxis": "x2" }));
    }
    if let Some(axis) = plotted_beside(&panel.y, extent.y, "y", "right") {
        layout["yaxis2"] = axis;
        data.push(json!({ "x": [null], "y": [extent.y.1], "hoverinfo": "skip", "yaxis": "y2" }));
    }
    let config = json!({ "responsive": true, "displaylogo": false, "displayModeBar": false });
    json!({ "data": data, "layout": layout, "config": config, "beside": second_reading(panel) })
}

/// The axis that has a second reading, and how much of its unit one of the first is.
fn second_reading(panel: &Panel) -> Value {
    let of = |axis: &Axis, place: &str| {
        axis.secondary.as_ref().map(|secondary| json!({ "place": place, "factor": secondary.factor }))
    };
    json!(of(&panel.x, "x").or_else(|| of(&panel.y, "y")))
}

/// An axis' second reading between these ends of the first.
fn plotted_beside(axis: &Axis, ends: (f64, f64), over: &str, side: &str) -> Option<Value> {
    let secondary = axis.secondary.as_ref()?;
    let mut layout = plotted(axis, ends, secondary.factor, secondary.title());
    layout["showgrid"] = false.into();
    layout["overlaying"] = over.into();
    layout["side"] = side.into();
    Some(layout)
}

fn plotted(axis: &Axis, (low, high): (f64, f64), factor: f64, title: String) -> Value {
    let mut layout = json!({
        "title": { "text": title }, "automargin": true, "zeroline": false, "tickangle": 0, "ticks": "outside",
        "range": [low * factor, high * factor],
    });
    match &axis.scale {
        Scale::Linear | Scale::Degrees => {
            layout["type"] = "linear".into();
            layout["nticks"] = 9.into();
        }
        Scale::Log => {
            layout["type"] = "log".into();
            layout["range"] = json!([low * factor, high * factor].map(f64::log10));
        }
        Scale::Names(_) => {
            let (rows, names): (Vec<f64>, Vec<String>) = ticks(&axis.scale, (low, high), 0).into_iter().unzip();
            // The first name is at the top.
            layout["range"] = json!([high, low]);
            layout["tickvals"] = json!(rows);
            layout["ticktext"] = json!(names);
            layout["showgrid"] = false.into();
        }
    }
    layout
}

/// How a value on the axis is read when it is pointed at: `place` is `x` or `y`.
fn axis_reading(axis: &Axis, place: &str) -> String {
    let secondary = axis
        .secondary
        .as_ref()
        .map_or_else(String::new, |secondary| format!(" (%{{customdata:.4~g}} {})", secondary.unit));
    match axis.scale {
        Scale::Names(_) => String::new(),
        _ => format!("{}: %{{{place}:.4~g}} {}{secondary}<br>", axis.label, axis.unit),
    }
}

fn series_traces(series: &Series, panel: &Panel, extent: &Extent) -> Vec<Value> {
    let mut traces = Vec::new();
    if !series.band.is_empty() {
        let drawn = || series.points.iter().zip(&series.band).filter(|(point, _)| is_drawn(panel, point));
        // What noise hides wholly has an end all the same.
        let end = |value: f64, instead: f64| if has(&panel.y, value) { value } else { instead };
        let low = drawn().map(|(point, band)| (point.0, end(band.0, extent.y.0)));
        let high = drawn().rev().map(|(point, band)| (point.0, end(band.1, extent.y.1)));
        let (x, y): (Vec<Value>, Vec<Value>) = low.chain(high).map(|(x, y)| (short(x), short(y))).unzip();
        traces.push(json!({
            "x": x, "y": y, "name": series.name, "legendgroup": series.group, "hoverinfo": "skip",
            "mode": "lines", "line": { "width": 0 }, "fill": "toself", "fillcolor": rgba(series, BAND),
        }));
    }
    let place =
        |point: &(f64, f64)| (short(point.0), if is_drawn(panel, point) { short(point.1) } else { Value::Null });
    let (x, y): (Vec<Value>, Vec<Value>) = series.points.iter().map(place).unzip();
    let color = rgba(series, 1.0);
    let mut trace = json!({
        "x": x, "y": y, "name": series.name, "legendgroup": series.group,
        "hovertemplate": series_reading(series, panel), "hoverlabel": { "bordercolor": color },
    });
    if !series.notes.is_empty() {
        trace["text"] = json!(series.notes);
    }
    // All points of a curve: left to itself the library leaves out what it takes for straight, and corners are seen.
    let line = |dash: &str| json!({ "color": color, "width": 2, "dash": dash, "simplify": false });
    let marker = |symbol: &str, size: u32| json!({ "symbol": symbol, "size": size, "color": color, "line": { "color": color, "width": 2 } });
    let (mode, style) = match series.mark {
        Mark::Line => ("lines", line("solid")),
        Mark::Dashes => ("lines", line("dash")),
        Mark::Dots => ("markers", json!({ "size": 5, "color": color })),
        Mark::Discs => ("markers", marker("circle", 9)),
        Mark::Crosses => ("markers", marker("x-thin-open", 9)),
        // Around a disc at the same place both are seen.
        Mark::Rings => ("markers", marker("circle-open", 14)),
        Mark::Ticks => ("markers", marker("line-ns-open", 14)),
        Mark::Bars => ("bars", json!({ "color": color })),
    };
    if mode == "bars" {
        trace["type"] = "bar".into();
        trace["orientation"] = "h".into();
        trace["textposition"] = "none".into();
    } else {
        trace["mode"] = mode.into();
    }
    // The opacity of all together: where dots lie on each other they stay paler than a line.
    if series.mark == Mark::Dots {
        trace["opacity"] = PALE.into();
    }
    trace[if mode == "lines" { "line" } else { "marker" }] = style;
    traces.push(trace);
    traces
}

/// What is read where a point is pointed at.
fn series_reading(series: &Series, panel: &Panel) -> String {
    let note = if series.notes.is_empty() { "" } else { "%{text}<br>" };
    let (x, y) = (axis_reading(&panel.x, "x"), axis_reading(&panel.y, "y"));
    format!("{note}<b>{}</b><br>{x}{y}<extra></extra>", escape_markup(&series.name))
}

fn rgba(series: &Series, opacity: f64) -> String {
    let [red, green, blue] = series.color.rgb();
    format!("rgba({red},{green},{blue},{opacity})")
}

/// A trace for each row: rows may be cut differently.
fn map_traces(map: &HeatMap, panel: &Panel) -> Vec<Value> {
    let rows = map.cells.iter().map(|cell| cell.row + 1).max().unwrap_or(0);
    let mut traces: Vec<Value> = Vec::new();
    for row in 0..rows {
        let mut edges: Vec<f64> = Vec::new();
        let mut values: Vec<Value> = Vec::new();
        let mut texts: Vec<String> = Vec::new();
        for cell in map.cells.iter().filter(|cell| cell.row == row) {
            match edges.last() {
                // A gap between two cells is a cell without a value.
                Some(last) if (cell.x.0 / last - 1.0).abs() > 1e-6 => {
                    edges.push(cell.x.0);
                    values.push(Value::Null);
                    texts.push(String::new());
                }
                None => edges.push(cell.x.0),
                Some(_) => {}
            }
            edges.push(cell.x.1);
            values.push(short(map.part(cell.value)));
            texts.push(map_reading(map, panel, cell.x, row, cell.value));
        }
        if values.is_empty() {
            continue;
        }
        let at = row as f64;
        traces.push(json!({
            "type": "heatmap", "x": edges, "y": [at - 0.48, at + 0.48], "z": [values], "zmin": 0, "zmax": 1,
            "colorscale": map_scale(map), "showscale": traces.is_empty(), "colorbar": map_bar(map),
            "hovertext": [texts], "hoverinfo": "text",
        }));
    }
    traces
}

fn map_reading(map: &HeatMap, panel: &Panel, (from, to): (f64, f64), row: usize, value: f64) -> String {
    let name = match &panel.y.scale {
        Scale::Names(names) => names.get(row).map_or("", String::as_str),
        _ => "",
    };
    let (from, to, value) = (rounded(from, 3), rounded(to, 3), rounded(value, 3));
    format!("{} {}<br>{from} to {to} {}<br>{}: {value}", panel.y.label, escape_markup(name), panel.x.unit, map.label)
}

fn map_scale(map: &HeatMap) -> Vec<(f64, String)> {
    let (low, high) = map.range;
    let step = |k: u32| {
        let part = f64::from(k) / 8.0;
        let [red, green, blue] = map.color(low * (high / low).powf(part));
        (part, format!("rgb({red},{green},{blue})"))
    };
    (0..=8).map(step).collect()
}

fn map_bar(map: &HeatMap) -> Value {
    let (parts, names): (Vec<f64>, Vec<String>) =
        map.named().into_iter().map(|(value, name)| (map.part(value), name)).unzip();
    json!({ "thickness": 12, "thicknessmode": "pixels", "outlinewidth": 0, "tickvals": parts, "ticktext": names })
}

/// A number with as many digits as a screen shows.
fn short(value: f64) -> Value {
    let value = rounded(value, DIGITS);
    // Whole numbers without a point.
    if value.fract() == 0.0 && value.abs() < 1e6 { json!(value as i64) } else { json!(value) }
}

fn rounded(value: f64, digits: usize) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    // Through text: a power of ten below one is not exact.
    format!("{value:.*e}", digits - 1).parse().unwrap_or(value)
}

/// The source of plotly.js: the bundle for plane figures.
pub(crate) const LIBRARY: &str = include_str!("../../vendor/plotly/plotly-cartesian.min.js");
/// Its license.
pub(crate) const LICENSE: &str = include_str!("../../vendor/plotly/LICENSE");

#[cfg(test)]
mod tests {
    use rotorlead_answer::{Color, FigureKind};

    use super::*;

    #[test]
    fn the_library_says_its_license_and_can_stand_in_a_page() {
        assert!(LIBRARY[..200].contains("plotly.js (cartesian") && LIBRARY[..200].contains("under the MIT license"));
        assert!(LICENSE.starts_with("MIT License"));
        assert!(!LIBRARY.contains("</script") && !LIBRARY.contains("<!--"), "what would end its element");
    }

    #[test]
    fn a_plot_has_its_numbers_and_its_labels() {
        let series = Series::new("a < b", Color::Blue, Mark::Line, vec![(1.0, -3.0), (2.0, f64::NAN)]);
        let panel = Panel::new(Axis::frequency(), Axis::linear("magnitude", "dB"), vec![series]);
        let plots = plots(&Figure::new(FigureKind::Gap, "One", "", vec![panel])).unwrap();
        let plot = &plots[0];
        assert_eq!(plot["data"][0]["y"], json!([-3, null]));
        assert_eq!(plot["layout"]["xaxis"]["title"]["text"], "frequency, rad/s");
        assert_eq!(plot["layout"]["xaxis2"]["title"]["text"], "frequency, Hz");
        assert_eq!(plot["beside"]["place"], "x");
        assert!(plot["data"][0]["hovertemplate"].as_str().unwrap().starts_with("<b>a &lt; b</b>"));
    }

    #[test]
    fn numbers_are_cut_to_what_a_screen_shows() {
        assert_eq!(short(0.123_456_789).to_string(), "0.123457");
        assert_eq!(short(-98_765_432.1).to_string(), "-98765400.0");
        assert_eq!(rounded(1234.5, 3), 1230.0);
        assert_eq!([short(0.0), short(-0.0), short(17.000_000_1)].map(|value| value.to_string()), ["0", "0", "17"]);
        assert_eq!(short(f64::NAN), Value::Null);
    }
}
