//! One figure in numbers and words, from which every way of showing it starts: [`csv`](Figure::csv), and each kind of picture.

mod csv;
mod kind;

use std::f64::consts::TAU;

pub use kind::FigureKind;
use serde::{Deserialize, Deserializer, Serialize};

/// Panels above each other under one title.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// File name without its end; unique in a report.
    pub name: String,
    /// What it shows.
    pub title: String,
    /// How to read it, in a sentence or two.
    pub caption: String,
    /// From top to bottom. Groups of series reach over panels.
    pub panels: Vec<Panel>,
    /// The numbers as CSV with columns of their own; `None` where those that are drawn, series by series, are all there is.
    pub numbers: Option<String>,
}

/// One pair of axes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Panel {
    /// What sets it apart from the figure's other panels; may be empty.
    pub title: String,
    /// To the right.
    pub x: Axis,
    /// Upward; names are listed downward.
    pub y: Axis,
    /// Height in pixels, axes included.
    pub height: u32,
    /// What is drawn, first to last, over `map`.
    pub series: Vec<Series>,
    /// Colored rectangles.
    pub map: Option<HeatMap>,
}

/// One axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// The quantity.
    pub label: String,
    /// Its unit; empty for names.
    pub unit: String,
    /// How values are laid out.
    pub scale: Scale,
    /// From where to where, instead of what the numbers span.
    pub range: Option<(f64, f64)>,
    /// A second reading of the same axis. At most one axis of a panel has one.
    pub secondary: Option<SecondaryAxis>,
}

/// How values are laid out along an axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Scale {
    /// Evenly.
    Linear,
    /// Evenly, in degrees: parts of a turn are named.
    Degrees,
    /// By their logarithm; values are above zero.
    Log,
    /// Value 0 is the first name.
    Names(Vec<String>),
}

/// The same axis in another unit, drawn on its other side.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SecondaryAxis {
    /// The quantity.
    pub label: String,
    /// Its unit.
    pub unit: String,
    /// How many of this unit one of the axis' own is.
    pub factor: f64,
}

/// One curve, cloud of points, or set of bars.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Series {
    /// What it is; unique in its panel.
    pub name: String,
    /// What the legend says. Series of one such name are switched on and off together.
    pub group: String,
    /// Its color; a model and what was measured of it share theirs.
    pub color: Color,
    /// How points are drawn.
    pub mark: Mark,
    /// Value along x and along y. Points that are not finite, or not above zero on a logarithmic axis, are left out.
    #[serde(deserialize_with = "pairs")]
    pub points: Vec<(f64, f64)>,
    /// Lower and upper end of the band around each point; empty for none.
    #[serde(deserialize_with = "pairs")]
    pub band: Vec<(f64, f64)>,
    /// A few words at each point; empty for none.
    pub notes: Vec<String>,
}

/// How points are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Mark {
    /// Joined by a line.
    Line,
    /// Joined by a broken line.
    Dashes,
    /// A small dot each.
    Dots,
    /// A large dot each.
    Discs,
    /// An x each.
    Crosses,
    /// A circle each.
    Rings,
    /// A short upright line each.
    Ticks,
    /// A bar from the left end of the axis each.
    Bars,
}

/// Colors that stay apart for most color-blind eyes: Okabe and Ito's palette without its yellow, which fades on white.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "[u8; 3]", try_from = "[u8; 3]")]
pub enum Color {
    /// The first choice.
    Blue,
    /// Its contrast.
    Vermilion,
    /// Bluish green.
    Green,
    /// Reddish purple.
    Purple,
    /// Sky blue.
    Sky,
    /// Orange.
    Orange,
    /// What is no data: levels, limits, noise.
    Gray,
}

/// Colors over rectangles of a panel whose y axis has names.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeatMap {
    /// What the color means.
    pub label: String,
    /// Values of the lightest and the darkest color; between them the color follows the logarithm.
    pub range: (f64, f64),
    /// The rectangles.
    pub cells: Vec<HeatCell>,
}

/// One rectangle of a [`HeatMap`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeatCell {
    /// From where to where along x.
    pub x: (f64, f64),
    /// Which name along y.
    pub row: usize,
    /// What the color shows.
    pub value: f64,
}

/// Pairs of numbers. JSON has null for what is not finite.
fn pairs<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<(f64, f64)>, D::Error> {
    let pairs: Vec<(Option<f64>, Option<f64>)> = Deserialize::deserialize(deserializer)?;
    Ok(pairs.into_iter().map(|(one, other)| (one.unwrap_or(f64::NAN), other.unwrap_or(f64::NAN))).collect())
}

impl Axis {
    /// An axis with even steps.
    #[must_use]
    pub fn linear(label: &str, unit: &str) -> Self {
        Self { label: label.to_owned(), unit: unit.to_owned(), scale: Scale::Linear, range: None, secondary: None }
    }

    /// An axis with even factors.
    #[must_use]
    pub fn log(label: &str, unit: &str) -> Self {
        Self { scale: Scale::Log, ..Self::linear(label, unit) }
    }

    /// A phase.
    #[must_use]
    pub fn phase() -> Self {
        Self { scale: Scale::Degrees, ..Self::linear("phase", "degrees") }
    }

    /// A list.
    #[must_use]
    pub fn names(label: &str, names: Vec<String>) -> Self {
        Self { scale: Scale::Names(names), ..Self::linear(label, "") }
    }

    /// Frequency in rad/s, with hertz beside it.
    #[must_use]
    pub fn frequency() -> Self {
        Self::log("frequency", "rad/s").beside_hertz("frequency")
    }

    /// Bandwidth in rad/s, with hertz beside it.
    #[must_use]
    pub fn bandwidth() -> Self {
        Self::log("bandwidth", "rad/s").beside_hertz("bandwidth")
    }

    /// An axis in rad/s with hertz beside it.
    #[must_use]
    pub fn beside_hertz(self, label: &str) -> Self {
        let secondary = SecondaryAxis { label: label.to_owned(), unit: "Hz".to_owned(), factor: 1.0 / TAU };
        Self { secondary: Some(secondary), ..self }
    }

    /// The nominal command.
    #[must_use]
    pub fn nominal() -> Self {
        Self::linear("nominal command u_nom", "duty")
    }

    /// With fixed ends.
    #[must_use]
    pub fn within(self, from: f64, to: f64) -> Self {
        Self { range: Some((from, to)), ..self }
    }

    /// Quantity and unit.
    #[must_use]
    pub fn title(&self) -> String {
        title(&self.label, &self.unit)
    }
}

impl SecondaryAxis {
    /// Quantity and unit.
    #[must_use]
    pub fn title(&self) -> String {
        title(&self.label, &self.unit)
    }
}

fn title(label: &str, unit: &str) -> String {
    if unit.is_empty() { label.to_owned() } else { format!("{label}, {unit}") }
}

impl Series {
    /// A series without band and notes.
    #[must_use]
    pub fn new(name: impl Into<String>, color: Color, mark: Mark, points: Vec<(f64, f64)>) -> Self {
        let name = name.into();
        // No line goes through a single point.
        let mark = match mark {
            Mark::Line | Mark::Dashes if points.len() == 1 => Mark::Rings,
            mark => mark,
        };
        Self { group: name.clone(), name, color, mark, points, band: Vec::new(), notes: Vec::new() }
    }

    /// Together with others in the legend.
    #[must_use]
    pub fn under(self, group: &str) -> Self {
        Self { group: group.to_owned(), ..self }
    }

    /// With a band around each point.
    #[must_use]
    pub fn with_band(self, band: Vec<(f64, f64)>) -> Self {
        Self { band, ..self }
    }

    /// With words at each point.
    #[must_use]
    pub fn with_notes(self, notes: Vec<String>) -> Self {
        Self { notes, ..self }
    }
}

impl Color {
    const CYCLE: [Self; 6] = [Self::Blue, Self::Vermilion, Self::Green, Self::Purple, Self::Sky, Self::Orange];

    /// The color of the `index`-th of many; after six they come again.
    #[must_use]
    pub fn nth(index: usize) -> Self {
        Self::CYCLE[index % Self::CYCLE.len()]
    }

    /// Red, green and blue; each can be distinguished from white and from black.
    #[must_use]
    pub const fn rgb(self) -> [u8; 3] {
        match self {
            Self::Blue => [0, 114, 178],
            Self::Vermilion => [213, 94, 0],
            Self::Green => [0, 158, 115],
            Self::Purple => [204, 121, 167],
            Self::Sky => [86, 180, 233],
            Self::Orange => [230, 159, 0],
            Self::Gray => [118, 118, 118],
        }
    }
}

impl From<Color> for [u8; 3] {
    fn from(color: Color) -> Self {
        color.rgb()
    }
}

impl TryFrom<[u8; 3]> for Color {
    type Error = String;

    fn try_from(rgb: [u8; 3]) -> Result<Self, String> {
        let mut colors = Self::CYCLE.into_iter().chain([Self::Gray]);
        colors.find(|color| color.rgb() == rgb).ok_or_else(|| format!("{rgb:?} is no color of a series"))
    }
}

impl HeatMap {
    /// Where a value is between the ends, 0 to 1.
    #[must_use]
    pub fn part(&self, value: f64) -> f64 {
        let (low, high) = self.range;
        ((value / low).max(1.0).ln() / (high / low).ln()).clamp(0.0, 1.0)
    }

    /// The color of a value: from nearly white to dark blue.
    #[must_use]
    pub fn color(&self, value: f64) -> [u8; 3] {
        let part = self.part(value);
        let mix = |from: f64, to: f64| (from + part * (to - from)) as u8;
        [mix(LIGHTEST[0], DARKEST[0]), mix(LIGHTEST[1], DARKEST[1]), mix(LIGHTEST[2], DARKEST[2])]
    }

    /// Values to be named at the color scale: the powers of ten. The last one stands for all beyond it.
    #[must_use]
    pub fn named(&self) -> Vec<(f64, String)> {
        let [first, last] = [self.range.0, self.range.1].map(|end| end.log10().round() as i32);
        let label = |power: i32| {
            let value = 10.0_f64.powi(power);
            (value, if power == last { format!("{value}+") } else { format!("{value}") })
        };
        (first..=last).map(label).collect()
    }
}

/// Ends of the color scale.
const LIGHTEST: [f64; 3] = [246.0, 248.0, 252.0];
const DARKEST: [f64; 3] = [8.0, 48.0, 107.0];

impl Panel {
    /// A panel of usual height.
    #[must_use]
    pub fn new(x: Axis, y: Axis, series: Vec<Series>) -> Self {
        Self { title: String::new(), x, y, height: 320, series, map: None }
    }
}

impl Figure {
    /// A figure of these panels.
    #[must_use]
    pub fn new(kind: FigureKind, title: impl Into<String>, caption: &str, panels: Vec<Panel>) -> Self {
        let name = kind.id().to_owned();
        Self { name, title: title.into(), caption: caption.to_owned(), panels, numbers: None }
    }

    /// The one of several of its kind that is of this record: its file's name, of which an end `.csv` is left out.
    #[must_use]
    pub fn with_record(self, file: &str) -> Self {
        let stem = file.strip_suffix(".csv").unwrap_or(file);
        Self { name: format!("{}_{stem}", self.name), ..self }
    }

    /// The first series of each group, in the order in which they are drawn.
    #[must_use]
    pub fn legend(&self) -> Vec<&Series> {
        let mut legend: Vec<&Series> = Vec::new();
        for series in self.panels.iter().flat_map(|panel| &panel.series) {
            if !legend.iter().any(|known| known.group == series.group) {
                legend.push(series);
            }
        }
        legend
    }
}
