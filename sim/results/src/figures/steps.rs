//! Steps of a staircase laid over each other, and the time constant over operating points.

use rotorlead_answer::{Axis, Color, Figure, FigureKind, Mark, Panel, Series};
use rotorlead_identify::estimate::Estimate;
use rotorlead_identify::lag::steps::{Direction, StaircaseFit, Step, StepFault};
use rotorlead_records::Record;

/// Most steps that are drawn in a panel, spread evenly over the record. Chosen: more of them cover each other, fewer hide the scatter.
const MOST_DRAWN: usize = 24;
/// Rows that are drawn of a step, in time constants after its delay. Chosen: the 8 of a window of the fit (`identify::lag::steps`), after
/// which 0.03 %, `e^-8`, is still to come.
const DRAWN_TIME_CONSTANTS: f64 = 8.0;
/// What is drawn of the time before the command, as a share of that after it. Chosen: it shows the level that a step starts from; more
/// takes room from the step.
const DRAWN_BEFORE: f64 = 0.15;
/// Points of a fitted response. Chosen: 7 to a time constant, between which a line is off by 0.2 % of the step, `(8 / 60)^2 / 8`.
const FITTED_POINTS: usize = 60;
/// Points of the curve. Chosen: its logarithm is a parabola, on which 40 points show no corners.
const CURVE_POINTS: usize = 40;

/// Every step from 0 to 1 over the time since its command, up and down apart: rows as dots, fits as lines, and those that were
/// left out in gray, with the reason.
#[must_use]
pub fn steps(fit: &StaircaseFit, record: &Record) -> Option<Figure> {
    let response = record.response(fit.output)?;
    let longest = |step: &Step| step.lag.map(|lag| lag.delay_s + DRAWN_TIME_CONSTANTS * lag.time_constant_s.value);
    let until_s = fit.steps.iter().filter_map(longest).fold(0.0, f64::max);
    let panel = |(direction, title): (Direction, &str)| {
        let is_drawn = |step: &&Step| step.direction() == direction && step.fault != Some(StepFault::NotNeeded);
        let all: Vec<&Step> = fit.steps.iter().filter(is_drawn).collect();
        let every = all.len().div_ceil(MOST_DRAWN).max(1);
        let series: Vec<Series> =
            all.into_iter().step_by(every).flat_map(|step| step_series(step, record, response, until_s)).collect();
        (!series.is_empty()).then(|| Panel {
            title: title.to_owned(),
            ..Panel::new(
                Axis::linear("time since the command", "ms"),
                Axis::linear("share of the step", "").within(-0.2, 1.3),
                series,
            )
        })
    };
    let panels: Vec<Panel> =
        [(Direction::Up, "Steps up"), (Direction::Down, "Steps down")].into_iter().filter_map(panel).collect();
    (!panels.is_empty()).then(|| {
        Figure::new(
            FigureKind::Steps,
            "Steps, each from 0 to 1, with the lag that was fitted",
            "Dots are rows and lines are fits. Gray steps were left out; the reason stands at their first row.",
            panels,
        )
    })
}

/// The rows of a step, and its fit where it is used.
fn step_series(step: &Step, record: &Record, response: &[f64], until_s: f64) -> Vec<Series> {
    let share = |value: f64| (value - step.before) / (step.after - step.before);
    let is_drawn = |row: &usize| (-DRAWN_BEFORE * until_s..until_s).contains(&(record.time_s[*row] - step.at_s));
    let rows = step.window.clone().filter(is_drawn);
    let points: Vec<(f64, f64)> =
        rows.map(|row| (1e3 * (record.time_s[row] - step.at_s), share(response[row]))).collect();
    let name = format!("{:.2} s: {:.3} to {:.3}", step.at_s, step.from, step.to);
    let group = |series: Series, group: &str| Series { group: group.to_owned(), ..series };
    if let Some(fault) = step.fault {
        let mut notes = vec![String::new(); points.len()];
        if let Some(first) = notes.first_mut() {
            *first = fault.to_string();
        }
        let left_out = Series::new(format!("{name}, left out"), Color::Gray, Mark::Dots, points).with_notes(notes);
        return vec![group(left_out, "left out")];
    }
    let Some(lag) = step.lag else { return Vec::new() };
    let fitted = (0..=FITTED_POINTS).map(|k| {
        let after_s = until_s * k as f64 / FITTED_POINTS as f64;
        (1e3 * after_s, share(lag.response(after_s)))
    });
    let fitted = Series::new(format!("{name}, fitted"), Color::Vermilion, Mark::Line, fitted.collect());
    vec![group(Series::new(name, Color::Blue, Mark::Dots, points), "measured"), group(fitted, "fitted")]
}

/// The curve of time constants with its band, and the steps that it rests on with their intervals.
#[must_use]
pub fn time_constant_curve(fit: &StaircaseFit) -> Option<Figure> {
    let curve = fit.curve.as_ref()?;
    let (low, high) = curve.range;
    let commands = (0..=CURVE_POINTS).map(|k| low + (high - low) * k as f64 / CURVE_POINTS as f64);
    let milliseconds = |(low, high): (f64, f64)| (1e3 * low, 1e3 * high);
    let (points, band): (Vec<_>, Vec<_>) = commands
        .map(|command| {
            let tau = curve.at(command);
            ((command, 1e3 * tau.value), milliseconds(tau.interval_of_logarithm(0.95)))
        })
        .unzip();
    let mut series = vec![Series::new("small motions", Color::Green, Mark::Line, points).with_band(band)];
    for (direction, name, color, mark) in [
        (Direction::Up, "steps up", Color::Blue, Mark::Discs),
        (Direction::Down, "steps down", Color::Vermilion, Mark::Rings),
    ] {
        let own = || fit.steps.iter().filter(|step| step.direction() == direction);
        let known = own().filter_map(|step| Some((step.to, step.time_constant_s()?)));
        let with_interval = |(to, tau): (f64, Estimate)| {
            let (low, high) = milliseconds(tau.interval_of_logarithm(0.95));
            // Upright at its point; between two of them nothing is drawn.
            ((to, 1e3 * tau.value), [(to, low), (to, high), (to, f64::NAN)])
        };
        let (points, intervals): (Vec<_>, Vec<_>) = known.map(with_interval).unzip();
        series.push(Series::new(name, color, mark, points));
        let intervals = intervals.concat();
        series.push(Series::new(format!("{name}, 95 % interval"), color, Mark::Line, intervals).under(name));
        let contradicts = |step: &&Step| matches!(step.fault, Some(StepFault::Contradicts { .. }));
        let left_out = own().filter(contradicts);
        let points: Vec<(f64, f64)> =
            left_out.filter_map(|step| Some((step.to, 1e3 * step.lag?.time_constant_s.value))).collect();
        let notes = vec!["contradicts the others".to_owned(); points.len()];
        series.push(Series::new(format!("{name}, left out"), Color::Gray, Mark::Crosses, points).with_notes(notes));
    }
    series.retain(|series| !series.points.is_empty());
    Some(Figure::new(
        FigureKind::TimeConstants,
        "Time constants over operating points",
        "The compensator's zero stands on the fastest point of the curve; the band is its 95 % interval and holds what single steps \
         differ by.",
        vec![Panel::new(Axis::nominal(), Axis::linear("time constant", "ms"), series)],
    ))
}
