//! Response over command at rest: the paper's Fig. 2.

use rotorlead_answer::{Axis, Color, Figure, FigureKind, Mark, Panel, Series};
use rotorlead_identify::lag::steps::Direction;
use rotorlead_identify::static_map::{MapLimit, StaticMapFit, SteadyPoint, SteadyPoints};
use rotorlead_records::Output;

use crate::unit::quantity;

/// Points of the curve. Chosen: one every 7 of a figure's 900 pixels, which shows no corners of a polynomial of low degree.
const COUNT: u32 = 120;

/// The steady points, and the polynomial with its band.
#[must_use]
pub fn static_map(points: &SteadyPoints, fit: &StaticMapFit, output: Output) -> Figure {
    let (from, to) = fit.range;
    let commands = (0..=COUNT).map(|i| from + (to - from) * f64::from(i) / f64::from(COUNT));
    let curve: Vec<_> = commands.map(|command| (command, fit.response(command))).collect();
    let line = curve.iter().map(|(command, response)| (*command, response.value)).collect();
    let band = curve.iter().map(|(_, response)| response.interval(0.95)).collect();
    let reached = |direction: Direction| -> Vec<(f64, f64)> {
        let is = |point: &&SteadyPoint| (point.direction == Direction::Down) == (direction == Direction::Down);
        points.running.iter().filter(is).map(|point| (point.command, point.response)).collect()
    };
    let name = format!("polynomial of degree {}, 95 % band", fit.degree());
    let mut series = vec![
        Series::new(name, Color::Gray, Mark::Line, line).with_band(band),
        Series::new("reached from below", Color::Blue, Mark::Discs, reached(Direction::Up)),
        Series::new("reached from above", Color::Vermilion, Mark::Rings, reached(Direction::Down)),
    ];
    series.retain(|series| !series.points.is_empty());
    let responses = || points.running.iter().map(|point| point.response);
    let (low, high) = (responses().fold(0.0, f64::min), responses().fold(0.0, f64::max));
    let mut upright = |name: &str, color: Color, command: f64| {
        series.push(Series::new(name, color, Mark::Dashes, vec![(command, low), (command, high)]));
    };
    if let Some(zone) = fit.dead_zone {
        upright("end of the dead zone", Color::Green, zone.end.map_or(zone.runs, |end| end.value));
    }
    match fit.limit {
        Some(MapLimit::Saturates { command, .. }) => upright("limit", Color::Purple, command.value),
        Some(MapLimit::Falls { command, .. }) => upright("falls beyond", Color::Purple, command),
        None => {}
    }
    let (what, unit) = quantity(output);
    let axis = Axis::linear(&format!("steady {what}"), unit);
    let panel = Panel { height: 380, ..Panel::new(Axis::linear("command", "duty"), axis, series) };
    Figure::new(
        FigureKind::StaticMap,
        "Static map",
        "The slope is the static gain: where the curve bends, the gain depends on the nominal command.",
        vec![panel],
    )
}
