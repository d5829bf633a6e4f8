//! Two models beside each other, for people and for programs.

use rotorlead_answer::words::sentence;
use rotorlead_answer::{
    Answer, Axis, CellValue, Color, ColumnSpec, Figure, FigureKind, Mark, Panel, Series, Table, Tone, Unit, Verdict,
    build_table,
};
use rotorlead_assess::{Compared, Difference, LagParameter};
use rotorlead_plant::{Model, TimeConstantBand};
use rotorlead_records::Output;
use serde_json::{Map, json};

use super::unit::unit;

/// A model, and what it is called.
pub struct Subject<'a> {
    /// The file that it is of.
    pub name: &'a str,
    /// What was found of it.
    pub model: &'a Model,
}

/// What differs between `a` and `b`.
#[must_use]
pub fn comparison_answer(a: &Subject, b: &Subject, compared: &[Compared]) -> Answer {
    let output = [a, b].iter().find_map(|of| Some(of.model.provenance.as_ref()?.output));
    let mut sentences = compared.iter().map(in_words);
    let headline = sentences.next().unwrap_or_default();
    let judged = [("A", a), ("B", b)].into_iter().map(|(letter, of)| {
        let judgement = of.model.judgement().map_or_else(|| "not judged".to_owned(), ToString::to_string);
        sentence(&format!("{letter} is {}: {judgement}", of.name))
    });
    let values = [("a", a), ("b", b)]
        .map(|(key, of)| (key.to_owned(), json!({ "file": of.name, "judgement": of.model.judgement() })));
    Answer {
        name: "comparison",
        title: "Comparison",
        text: judged.collect(),
        verdict: Verdict::new(Tone::Plain, headline).with(sentences.collect()),
        findings: Vec::new(),
        tables: compared.iter().map(|compared| table(compared, output)).collect(),
        figures: vec![figure(a, b)],
        values: Map::from_iter(values),
    }
}

/// What a quantity is called, in a sentence and as the key of its rows.
fn names(quantity: LagParameter) -> (&'static str, &'static str) {
    match quantity {
        LagParameter::TimeConstant => ("time constant", "time_constants"),
        LagParameter::Gain => ("gain", "gains"),
        LagParameter::DeadTime => ("dead time", "dead_times"),
    }
}

/// A change with its unit, and its scale.
fn change_unit(quantity: LagParameter) -> (&'static str, f64) {
    if quantity == LagParameter::DeadTime { ("ms", 1e3) } else { ("%", 1e2) }
}

fn in_words(compared: &Compared) -> String {
    let Compared { quantity, points } = compared;
    let ((name, _), (unit, scale)) = (names(*quantity), change_unit(*quantity));
    let known = points.iter().filter(|point| point.interval.is_some()).count();
    if known == 0 {
        return format!("Whether the {name} differs is not known: a model has no standard error of it.");
    }
    let commands = if points.len() == 1 { "command" } else { "commands" };
    let of = format!("of {} {commands}", points.len());
    let differing: Vec<&Difference> = points.iter().filter(|point| point.differs() == Some(true)).collect();
    if differing.is_empty() {
        let reach = |point: &Difference| point.interval.map(|(low, high)| low.abs().max(high.abs()));
        let most = points.iter().filter_map(reach).fold(0.0, f64::max);
        let beside =
            if known < points.len() { format!(" at the {known} where it is known well enough") } else { String::new() };
        return format!(
            "No difference in the {name} is shown at any {of}{beside}: it is less than {:.1} {unit} by the intervals.",
            scale * most
        );
    }
    let ends = differing.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |ends, point| {
        (ends.0.min(scale * point.change), ends.1.max(scale * point.change))
    });
    let by = if format!("{:+.1}", ends.0) == format!("{:+.1}", ends.1) {
        format!("{:+.1} {unit}", ends.0)
    } else {
        format!("{:+.1} to {:+.1} {unit}", ends.0, ends.1)
    };
    format!("The {name} of B differs from that of A at {} {of}, by {by}.", differing.len())
}

fn table(compared: &Compared, output: Option<Output>) -> Table {
    let quantity = compared.quantity;
    let (name, key) = names(quantity);
    let (of_value, decimals) = match quantity {
        LagParameter::Gain => (Unit::plain(output.map_or("", unit)), 3),
        LagParameter::TimeConstant | LagParameter::DeadTime => (Unit::MILLISECONDS, 1),
    };
    let of_change = if quantity == LagParameter::DeadTime { Unit::MILLISECONDS } else { Unit::PERCENT_OF_SHARE };
    let estimate = |(value, std): (f64, Option<f64>)| CellValue::Estimate(value, std);
    let columns = [
        ColumnSpec::new("nominal", "u_nom", Unit::DUTY, 3, |point: &Difference| point.nominal),
        ColumnSpec::new("a", "A", of_value, decimals, move |point: &Difference| estimate(point.a)),
        ColumnSpec::new("b", "B", of_value, decimals, move |point: &Difference| estimate(point.b)),
        ColumnSpec::new("change", "change", of_change, 1, |point: &Difference| point.change),
        ColumnSpec::new("change_low", "from", of_change, 1, |point: &Difference| point.interval.map(|ends| ends.0)),
        ColumnSpec::new("change_high", "to", of_change, 1, |point: &Difference| point.interval.map(|ends| ends.1)),
        ColumnSpec::words("differs", "differs", |point: &Difference| {
            let word = match point.differs() {
                Some(true) => "yes",
                Some(false) => "not shown",
                None => "not known",
            };
            word.to_owned()
        }),
    ];
    let caption =
        format!("The {name} of both, and its change from A to B with intervals that hold together with 95 %",);
    Table { key: Some(key), ..build_table(key, caption, &columns, &compared.points) }
}

/// Time constants of both over the command, with what is known of their errors.
fn figure(a: &Subject, b: &Subject) -> Figure {
    let milliseconds = |(low, high): (f64, f64)| (1e3 * low, 1e3 * high);
    let series = [("A", a, Color::Blue, Mark::Discs), ("B", b, Color::Vermilion, Mark::Rings)].into_iter().flat_map(
        |(letter, of, color, mark)| {
            let name = format!("{letter}: {}", of.name);
            let points: Vec<_> =
                of.model.points.iter().map(|point| (point.nominal, 1e3 * point.time_constant_s)).collect();
            let band = of.model.time_constant_curve.as_ref().map(|band: &TimeConstantBand| {
                let ends = band.low_s.iter().copied().zip(band.high_s.iter().copied()).map(milliseconds);
                let curve = band.nominal.iter().copied().zip(band.time_constant_s.iter().map(|tau| 1e3 * tau));
                Series::new(format!("{name}, 95 % band"), color, Mark::Line, curve.collect())
                    .with_band(ends.collect())
                    .under(&name)
            });
            std::iter::once(Series::new(name.clone(), color, mark, points)).chain(band).collect::<Vec<_>>()
        },
    );
    Figure::new(
        FigureKind::ComparedLags,
        "Time constants of both",
        "Each model's own points, and where it is of steps its curve with the 95 % band. Whether they differ says the table.",
        vec![Panel::new(Axis::nominal(), Axis::linear("time constant", "ms"), series.collect())],
    )
}
