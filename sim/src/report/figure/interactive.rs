//! A figure for a reader with a pointer: what plotly.js draws, a plot for each panel.
//!
//! Colors of text and grid are left to the page, which knows whether it is light or dark.

use plotly::common::{
    AxisSide, ColorBar, ColorScale, ColorScaleElement, DashType, Fill, Font, HoverInfo, Label, Line, Marker,
    MarkerSymbol, Mode, Orientation, ThicknessMode,
};
use plotly::configuration::DisplayModeBar;
use plotly::layout::{Axis as PlotAxis, AxisRange, AxisType, DragMode, HoverMode, Margin, TicksDirection};
use plotly::traces::heat_map::HeatMap as Rectangles;
use plotly::{Bar, Configuration, Layout, Plot, Scatter, Trace};

use super::extent::Extent;
use super::ticks::ticks;
use super::{Axis, Beside, Figure, FigureError, HeatMap, Mark, PALE, Panel, Scale, Series};

/// Significant digits of what is drawn: a screen has no more.
const DIGITS: usize = 6;
const TRANSPARENT: &str = "rgba(0,0,0,0)";
/// How much a band covers.
const BAND: f64 = 0.22;

impl Figure {
    /// The plots as JSON texts that may stand within an HTML element: no `<` is in them.
    ///
    /// # Errors
    /// When there is nothing to draw.
    pub(in crate::report) fn plots(&self) -> Result<Vec<String>, FigureError> {
        let plot = |(index, panel): (usize, &Panel)| {
            let extent =
                panel.extent().ok_or_else(|| FigureError::Empty { name: self.name.clone(), panel: index + 1 })?;
            Ok(panel.plot(&extent).to_json().replace('<', "\\u003c"))
        };
        self.panels.iter().enumerate().map(plot).collect()
    }
}

impl Panel {
    fn plot(&self, extent: &Extent) -> Plot {
        let mut plot = Plot::new();
        for trace in self.map.iter().flat_map(|map| map.traces(self)) {
            plot.add_trace(trace);
        }
        for series in &self.series {
            for trace in series.traces(self, extent) {
                plot.add_trace(trace);
            }
        }
        let mut layout = Layout::new()
            .auto_size(true)
            .height(self.height as usize)
            .margin(self.margin())
            .show_legend(false)
            .hover_mode(HoverMode::Closest)
            .drag_mode(DragMode::Zoom)
            .hover_label(Label::new().background_color("#ffffff").name_length(-1))
            .font(Font::new().family("system-ui, sans-serif").size(12))
            .paper_background_color(TRANSPARENT)
            .plot_background_color(TRANSPARENT)
            .x_axis(self.x.plotted(extent.x, 1.0).title(self.x.title()))
            .y_axis(self.y.plotted(extent.y, 1.0).title(self.y.title()));
        // An axis is drawn where something is on it.
        let nothing = |x: f64, y: f64| Scatter::new(vec![x], vec![y]).hover_info(HoverInfo::Skip);
        if let Some(axis) = self.x.plotted_beside(extent.x) {
            layout = layout.x_axis2(axis.overlaying("x").side(AxisSide::Top));
            plot.add_trace(nothing(extent.x.1, f64::NAN).x_axis("x2"));
        }
        if let Some(axis) = self.y.plotted_beside(extent.y) {
            layout = layout.y_axis2(axis.overlaying("y").side(AxisSide::Right));
            plot.add_trace(nothing(f64::NAN, extent.y.1).y_axis("y2"));
        }
        plot.set_layout(layout);
        plot.set_configuration(
            Configuration::new().responsive(true).display_logo(false).display_mode_bar(DisplayModeBar::False),
        );
        plot
    }

    fn margin(&self) -> Margin {
        let top = if self.x.beside.is_some() { 52 } else { 14 };
        let right = if self.y.beside.is_some() { 52 } else { 14 };
        Margin::new().left(62).right(right).top(top).bottom(48)
    }

    /// The second reading of each point, where an axis has one.
    fn read_beside(&self, points: &[(f64, f64)]) -> Option<Vec<f64>> {
        let read = |beside: &Beside, of: fn(&(f64, f64)) -> f64| {
            points.iter().map(|point| short(of(point) * beside.factor)).collect()
        };
        match (&self.x.beside, &self.y.beside) {
            (Some(beside), _) => Some(read(beside, |point| point.0)),
            (None, Some(beside)) => Some(read(beside, |point| point.1)),
            (None, None) => None,
        }
    }
}

impl Axis {
    /// Its second reading between these ends of the first.
    fn plotted_beside(&self, (low, high): (f64, f64)) -> Option<PlotAxis> {
        let beside = self.beside.as_ref()?;
        Some(self.plotted((low, high), beside.factor).title(beside.title()).show_grid(false))
    }

    fn plotted(&self, (low, high): (f64, f64), factor: f64) -> PlotAxis {
        let axis = PlotAxis::new().auto_margin(true).zero_line(false).tick_angle(0.0).ticks(TicksDirection::Outside);
        match &self.scale {
            Scale::Linear | Scale::Degrees => {
                axis.range(AxisRange::new(low * factor, high * factor)).type_(AxisType::Linear).n_ticks(9)
            }
            Scale::Log => {
                let [low, high] = [low * factor, high * factor].map(f64::log10);
                axis.range(AxisRange::new(low, high)).type_(AxisType::Log)
            }
            Scale::Names(_) => {
                let (rows, names) = ticks(&self.scale, (low, high), 0).into_iter().unzip();
                // The first name is at the top.
                axis.range(AxisRange::new(high, low)).tick_values(rows).tick_text(names).show_grid(false)
            }
        }
    }

    /// How a value on the axis is read when it is pointed at: `place` is `x` or `y`.
    fn reading(&self, place: &str) -> String {
        let beside =
            self.beside.as_ref().map_or_else(String::new, |beside| format!(" (%{{customdata:.4~g}} {})", beside.unit));
        match self.scale {
            Scale::Names(_) => String::new(),
            _ => format!("{}: %{{{place}:.4~g}} {}{beside}<br>", self.label, self.unit),
        }
    }
}

impl Series {
    fn traces(&self, panel: &Panel, extent: &Extent) -> Vec<Box<dyn Trace>> {
        let mut traces: Vec<Box<dyn Trace>> = Vec::new();
        if !self.band.is_empty() {
            let drawn = || self.points.iter().zip(&self.band).filter(|(point, _)| panel.is_drawn(point));
            // What noise hides wholly has an end all the same.
            let end = |value: f64, instead: f64| if panel.y.has(value) { value } else { instead };
            let low = drawn().map(|(point, band)| (point.0, end(band.0, extent.y.0)));
            let high = drawn().rev().map(|(point, band)| (point.0, end(band.1, extent.y.1)));
            let (x, y) = low.chain(high).map(|(x, y)| (short(x), short(y))).unzip();
            let band = Scatter::new(x, y).mode(Mode::Lines).line(Line::new().width(0.0)).fill(Fill::ToSelf);
            traces.push(
                band.fill_color(self.rgba(BAND)).name(&self.name).legend_group(&self.group).hover_info(HoverInfo::Skip),
            );
        }
        let (x, y): (Vec<f64>, Vec<f64>) = self
            .points
            .iter()
            .map(
                |point| {
                    if panel.is_drawn(point) { (short(point.0), short(point.1)) } else { (short(point.0), f64::NAN) }
                },
            )
            .unzip();
        let mut reading = self.reading(panel);
        if !self.notes.is_empty() {
            reading.insert_str(0, "%{text}<br>");
        }
        reading.push_str("<extra></extra>");
        let label = Label::new().border_color(self.rgba(1.0));
        if self.mark == Mark::Bars {
            let bars = Bar::new(x, y)
                .orientation(Orientation::Horizontal)
                .name(&self.name)
                .legend_group(&self.group)
                .hover_label(label);
            let bars = bars.marker(Marker::new().color(self.rgba(1.0))).hover_template(reading);
            let bars = if self.notes.is_empty() { bars } else { bars.text_array(self.notes.clone()) };
            traces.push(bars.text_position(plotly::common::TextPosition::None));
            return traces;
        }
        let mut points =
            Scatter::new(x, y).name(&self.name).legend_group(&self.group).hover_template(reading).hover_label(label);
        if let Some(beside) = panel.read_beside(&self.points) {
            points = points.custom_data(beside);
        }
        if !self.notes.is_empty() {
            points = points.text_array(self.notes.clone());
        }
        // All points of a curve: left to itself the library leaves out what it takes for straight, and corners are seen.
        let line = |dash: DashType| Line::new().color(self.rgba(1.0)).width(2.0).dash(dash).simplify(false);
        let marker = |symbol: MarkerSymbol, size: usize, opacity: f64| {
            Marker::new()
                .symbol(symbol)
                .size(size)
                .color(self.rgba(opacity))
                .line(Line::new().color(self.rgba(opacity)).width(2.0))
        };
        traces.push(match self.mark {
            Mark::Line => points.mode(Mode::Lines).line(line(DashType::Solid)),
            Mark::Dashes => points.mode(Mode::Lines).line(line(DashType::Dash)),
            // The opacity of all together: where dots lie on each other they stay paler than a line.
            Mark::Dots => points.mode(Mode::Markers).marker(Marker::new().size(5).color(self.rgba(1.0))).opacity(PALE),
            Mark::Discs => points.mode(Mode::Markers).marker(marker(MarkerSymbol::Circle, 9, 1.0)),
            Mark::Crosses => points.mode(Mode::Markers).marker(marker(MarkerSymbol::XThinOpen, 9, 1.0)),
            // Around a disc at the same place both are seen.
            Mark::Rings => points.mode(Mode::Markers).marker(marker(MarkerSymbol::CircleOpen, 14, 1.0)),
            Mark::Ticks => points.mode(Mode::Markers).marker(marker(MarkerSymbol::LineNSOpen, 14, 1.0)),
            Mark::Bars => unreachable!("bars are another trace, above"),
        });
        traces
    }

    /// What is read where a point is pointed at.
    fn reading(&self, panel: &Panel) -> String {
        format!("<b>{}</b><br>{}{}", escaped(&self.name), panel.x.reading("x"), panel.y.reading("y"))
    }

    fn rgba(&self, opacity: f64) -> String {
        let [red, green, blue] = self.color.rgb();
        format!("rgba({red},{green},{blue},{opacity})")
    }
}

impl HeatMap {
    /// A trace for each row: rows may be cut differently.
    fn traces(&self, panel: &Panel) -> Vec<Box<dyn Trace>> {
        let rows = self.cells.iter().map(|cell| cell.row + 1).max().unwrap_or(0);
        let mut scale_shown = false;
        let mut traces: Vec<Box<dyn Trace>> = Vec::new();
        for row in 0..rows {
            let mut edges: Vec<f64> = Vec::new();
            let mut values: Vec<f64> = Vec::new();
            let mut texts: Vec<String> = Vec::new();
            for cell in self.cells.iter().filter(|cell| cell.row == row) {
                match edges.last() {
                    // A gap between two cells is a cell without a value.
                    Some(last) if (cell.x.0 / last - 1.0).abs() > 1e-6 => {
                        edges.push(cell.x.0);
                        values.push(f64::NAN);
                        texts.push(String::new());
                    }
                    None => edges.push(cell.x.0),
                    Some(_) => {}
                }
                edges.push(cell.x.1);
                values.push(short(self.part(cell.value)));
                texts.push(self.read(panel, cell.x, row, cell.value));
            }
            if values.is_empty() {
                continue;
            }
            let at = row as f64;
            let trace = Rectangles::new(edges, vec![at - 0.48, at + 0.48], vec![values])
                .zmin(0.0)
                .zmax(1.0)
                .color_scale(ColorScale::Vector(self.scale()))
                .show_scale(!scale_shown)
                .color_bar(self.bar())
                .hover_text_matrix(vec![texts])
                .hover_info(HoverInfo::Text);
            scale_shown = true;
            traces.push(trace);
        }
        traces
    }

    fn read(&self, panel: &Panel, (from, to): (f64, f64), row: usize, value: f64) -> String {
        let name = match &panel.y.scale {
            Scale::Names(names) => names.get(row).map_or("", String::as_str),
            _ => "",
        };
        let (from, to, value) = (rounded(from, 3), rounded(to, 3), rounded(value, 3));
        format!("{} {}<br>{from} to {to} {}<br>{}: {value}", panel.y.label, escaped(name), panel.x.unit, self.label)
    }

    fn scale(&self) -> Vec<ColorScaleElement> {
        let (low, high) = self.range;
        let step = |k: u32| {
            let part = f64::from(k) / 8.0;
            let [red, green, blue] = self.color(low * (high / low).powf(part));
            ColorScaleElement(part, format!("rgb({red},{green},{blue})"))
        };
        (0..=8).map(step).collect()
    }

    fn bar(&self) -> ColorBar {
        let (parts, names) = self.named().into_iter().map(|(value, name)| (self.part(value), name)).unzip();
        ColorBar::new()
            .thickness(12)
            .thickness_mode(ThicknessMode::Pixels)
            .outline_width(0)
            .tick_vals(parts)
            .tick_text(names)
    }
}

/// A number with as many digits as a screen shows.
fn short(value: f64) -> f64 {
    rounded(value, DIGITS)
}

fn rounded(value: f64, digits: usize) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    // Through text: a power of ten below one is not exact.
    format!("{value:.*e}", digits - 1).parse().unwrap_or(value)
}

/// A text as plotly.js takes it, which knows some elements of HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// The source of plotly.js as an HTML element; its license is at its beginning.
pub(in crate::report) fn library() -> String {
    let all = Plot::offline_js_sources();
    // The first element is plotly.js; what follows it typesets formulas, of which there are none.
    let end = all.find(END).map_or(all.len(), |start| start + END.len());
    all[..end].to_owned()
}

const END: &str = "</script>";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::figure::{Color, FigureKind};

    #[test]
    fn the_library_comes_whole_with_its_license_and_nothing_else() {
        let library = library();
        assert!(library.starts_with("<script") && library.ends_with(END));
        assert!(library.len() > 3_000_000 && !library.contains("MathJax.loader"), "{}", library.len());
        assert!(library[..400].contains("plotly.js v") && library[..400].contains("Licensed under the MIT license"));
    }

    #[test]
    fn a_plot_has_its_numbers_its_labels_and_no_markup() {
        let series = Series::new("</script>", Color::Blue, Mark::Line, vec![(1.0, -3.0), (2.0, f64::NAN)]);
        let panel = Panel::new(Axis::frequency(), Axis::linear("magnitude", "dB"), vec![series]);
        let plots = Figure::new(FigureKind::Gap, "One", "", vec![panel]).plots().unwrap();
        assert!(!plots[0].contains('<'));
        let plot: serde_json::Value = serde_json::from_str(&plots[0]).unwrap();
        assert_eq!(plot["data"][0]["y"], serde_json::json!([-3.0, null]));
        assert_eq!(plot["layout"]["xaxis"]["title"]["text"], "frequency, rad/s");
        assert_eq!(plot["layout"]["xaxis2"]["title"]["text"], "frequency, Hz");
    }

    #[test]
    fn numbers_are_cut_to_what_a_screen_shows() {
        assert_eq!(short(0.123_456_789), 0.123_457);
        assert_eq!(short(-98_765_432.1), -98_765_400.0);
        assert_eq!(rounded(1234.5, 3), 1230.0);
        assert_eq!(short(0.0), 0.0);
    }
}
