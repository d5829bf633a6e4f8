//! What a diagnosis found, as figures: where the gap lies, what explains it, and how far it shrinks.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use rotorlead_answer::escape::field;
use rotorlead_answer::{Axis, Color, Figure, FigureKind, HeatCell, HeatMap, Mark, Panel, Series};
use rotorlead_diagnose::{Diagnosis, Excess, MapCell};

use crate::unit::unit;

/// Kinds that are shown. Chosen: most of the catalog, the best first, on one screen of 26 pixels a bar; the figure's numbers have all.
const MOST_KINDS: usize = 12;
/// The map's darkest color: so many times the power of the noise. Chosen: residuals of 32 times the noise, `sqrt(1000)`; less leaves large
/// ones alike, more makes small ones pale.
const DARKEST: f64 = 1000.0;
/// Height of a line of a table of bars or dots, and of what is around them, pixels. Chosen: a line of text, and title and axis; more is
/// empty.
const LINE: u32 = 26;
const AROUND: u32 = 100;

/// The figures of a diagnosis. Those that have nothing to show are left out.
#[must_use]
pub fn diagnosis_figures(found: &Diagnosis) -> Vec<Figure> {
    [where_(found), candidates(found), gaps(found), residual(found)].into_iter().flatten().collect()
}

fn ratio(excess: Excess) -> f64 {
    excess.sum / excess.expected
}

/// Power of the residual over that of the noise, over frequency and nominal command.
fn where_(found: &Diagnosis) -> Option<Figure> {
    let cells = &found.map;
    let mut nominals: Vec<f64> = cells.iter().map(|cell| cell.nominal).collect();
    nominals.dedup();
    let (low, high) = cells.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), cell| {
        (low.min(TAU * cell.band_hz.0), high.max(TAU * cell.band_hz.1))
    });
    if nominals.is_empty() {
        return None;
    }
    let names: Vec<String> = nominals.iter().map(ToString::to_string).collect();
    let panel = |title: &str, of: fn(&MapCell) -> Excess| {
        let cells = cells.iter().filter_map(|cell| {
            let row = nominals.iter().position(|nominal| *nominal == cell.nominal)?;
            let (from, to) = cell.band_hz;
            Some(HeatCell { x: (TAU * from, TAU * to), row, value: ratio(of(cell)) })
        });
        let map =
            HeatMap { label: "residual over noise, in power".into(), range: (1.0, DARKEST), cells: cells.collect() };
        Panel {
            title: title.to_owned(),
            height: (nominals.len() as u32 * 32 + 130).max(230),
            map: Some(map),
            ..Panel::new(Axis::frequency().within(low, high), Axis::names("u_nom (duty)", names.clone()), Vec::new())
        }
    };
    let panels = if is_improved(found) {
        vec![panel("first model", |cell| cell.before), panel("improved model", |cell| cell.after)]
    } else {
        vec![panel("model", |cell| cell.before)]
    };
    let mut csv = String::from("nominal,from_hz,to_hz,before_over_noise,after_over_noise\n");
    for cell in cells {
        let (from, to) = cell.band_hz;
        let _ = writeln!(csv, "{},{from},{to},{},{}", cell.nominal, ratio(cell.before), ratio(cell.after));
    }
    let caption = "A light map is a model that leaves no more than noise. Dark columns are frequencies, dark rows are nominal commands \
                   at which the model is wrong.";
    Some(Figure {
        numbers: Some(csv),
        ..Figure::new(FigureKind::Where, "Residual over noise, in power", caption, panels)
    })
}

/// Whether there is another model than the first. Drawn twice, one would hide itself.
fn is_improved(found: &Diagnosis) -> bool {
    !found.effects.is_empty()
}

/// The series of the first model and of the improved one, where there is one.
fn model_series(found: &Diagnosis, mark: Mark, before: Vec<(f64, f64)>, after: Vec<(f64, f64)>) -> Vec<Series> {
    if !is_improved(found) {
        return vec![Series::new("model", Color::Vermilion, mark, before)];
    }
    let improved = Series::new("improved model", Color::Blue, mark, after);
    vec![Series::new("first model", Color::Vermilion, mark, before), improved]
}

/// The score of each kind, tried alone.
fn candidates(found: &Diagnosis) -> Option<Figure> {
    let tried: Vec<_> = found.tried.iter().filter(|tried| tried.score.is_finite()).collect();
    let is_named = |id: &str| found.effects.iter().any(|effect| effect.kind.id == id);
    let mut csv = String::from("kind,named,score,fitted_gain,held_out_gain\n");
    for tried in &tried {
        let id = tried.kind.id;
        let held_out = tried.held_out_gain.map_or(String::new(), |gain| gain.to_string());
        let _ = writeln!(csv, "{id},{},{},{},{held_out}", is_named(id), tried.score, tried.fitted_gain);
    }
    let shown: Vec<_> = tried.into_iter().filter(|tried| tried.score > 1.0).take(MOST_KINDS).collect();
    let best = shown.iter().map(|tried| tried.score).fold(0.0, f64::max);
    if shown.is_empty() {
        return None;
    }
    let name = |id: &str| if is_named(id) { format!("{id} (named)") } else { id.to_owned() };
    let names = shown.iter().map(|tried| name(tried.kind.id)).collect();
    let bars = |name: &str, color: Color, is: bool| {
        let rows = || shown.iter().enumerate().filter(|(_, tried)| is_named(tried.kind.id) == is);
        let notes = rows().map(|(_, tried)| format!("{:.0}", tried.score)).collect();
        let points = rows().map(|(row, tried)| (tried.score, row as f64)).collect();
        Series::new(name, color, Mark::Bars, points).with_notes(notes)
    };
    let mut series = vec![bars("named", Color::Vermilion, true), bars("tried", Color::Blue, false)];
    series.retain(|series| !series.points.is_empty());
    // Log likelihoods add up: twice the length is twice the evidence. To the right there is room for the longest bar's number.
    let axis = Axis::linear("evidence", "log likelihood gained beyond chance").within(0.0, 1.2 * best);
    let panel =
        Panel { height: shown.len() as u32 * LINE + AROUND, ..Panel::new(axis, Axis::names("", names), series) };
    let caption = "Each kind of effect is fitted alone; what it gains counts on fitted and held-out records. Several long bars are effects \
                   that look alike in these records: the search then asks what the best of them leaves to the others.";
    Some(Figure {
        numbers: Some(csv),
        ..Figure::new(FigureKind::Candidates, "Effects tried alone", caption, vec![panel])
    })
}

/// The gap of each record, beside what noise alone leaves.
fn gaps(found: &Diagnosis) -> Option<Figure> {
    let records = &found.records;
    let mut csv = String::from("file,nominal,before,after,noise_floor\n");
    for record in records {
        let gap = record.gap;
        let _ = writeln!(
            csv,
            "{},{},{},{},{}",
            field(&record.file),
            record.nominal,
            gap.before,
            gap.after,
            gap.noise_floor
        );
    }
    let all = || records.iter().flat_map(|record| [record.gap.before, record.gap.after, record.gap.noise_floor]);
    let low = 100.0 * all().filter(|value| *value > 0.0).fold(f64::INFINITY, f64::min);
    let high = 100.0 * all().fold(0.0, f64::max);
    if !(low.is_finite() && high > 0.0) {
        return None;
    }
    let points = |gap: fn(&rotorlead_diagnose::Gap) -> f64| -> Vec<(f64, f64)> {
        let at = |(row, record): (usize, &rotorlead_diagnose::RecordGap)| {
            ((100.0 * gap(&record.gap)).max(0.7 * low), row as f64)
        };
        records.iter().enumerate().map(at).collect()
    };
    let mut series = vec![Series::new("noise alone", Color::Gray, Mark::Ticks, points(|gap| gap.noise_floor))];
    series.extend(model_series(found, Mark::Discs, points(|gap| gap.before), points(|gap| gap.after)));
    let axis = Axis::log("gap, RMS of the residual over the response", "percent").within(0.7 * low, 1.4 * high);
    let names = Axis::names("", records.iter().map(|record| record.file.clone()).collect());
    let panel = Panel { height: (records.len() as u32 * LINE + AROUND).max(160), ..Panel::new(axis, names, series) };
    let on = if found.held_out { "periods or records that were held out" } else { "fitted: nothing was held out" };
    let caption = "A model that explains all brings its dot to the noise.";
    let title = format!("Gap of each record ({on})");
    Some(Figure { numbers: Some(csv), ..Figure::new(FigureKind::Gap, title, caption, vec![panel]) })
}

/// What is left of one record over a period.
fn residual(found: &Diagnosis) -> Option<Figure> {
    let left = found.residual.as_ref()?;
    let mut csv = String::from("time_s,before,after,noise_std\n");
    for ((time_s, before), after) in left.time_s.iter().zip(&left.before).zip(&left.after) {
        let _ = writeln!(csv, "{time_s},{before},{after},{}", left.noise_std);
    }
    let ends = [*left.time_s.first()?, *left.time_s.last()?];
    let points = |values: &[f64]| left.time_s.iter().copied().zip(values.iter().copied()).collect();
    let noise =
        Series::new("noise, two standard deviations", Color::Gray, Mark::Dashes, ends.map(|time| (time, 0.0)).to_vec())
            .with_band(vec![(-2.0 * left.noise_std, 2.0 * left.noise_std); 2]);
    let mut series = vec![noise];
    series.extend(model_series(found, Mark::Line, points(&left.before), points(&left.after)));
    let axis = Axis::linear("measured less simulated", unit(found.conditions.output));
    let panel = Panel { height: 360, ..Panel::new(Axis::linear("time in the record", "s"), axis, series) };
    let caption = format!(
        "The record that the first model explains worst, over one period, in means of {} rows. What stays outside of the shade is \
         not explained.",
        left.rows
    );
    let title = format!("What is left of {}", left.file);
    Some(Figure { numbers: Some(csv), ..Figure::new(FigureKind::Residual, title, &caption, vec![panel]) })
}
