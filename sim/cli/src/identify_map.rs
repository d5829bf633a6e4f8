//! `rotorlead identify`: the static map, where the records have plateaus or a ramp.

use rotorlead_identify::Estimate;
use rotorlead_identify::static_map::{Limit, StaticMapFit, SteadyPoints, fit_static_map};
use rotorlead_plant::{MapPolynomial, StaticMap};
use rotorlead_records::{Experiment, Output, Role};
use rotorlead_report::unit;
use serde_json::{Value, json};

use super::identify::Identified;

/// Fits the static map to all records that may be fitted and are not compensated, and puts it in the model. Null, and
/// nothing said, where they show fewer than four levels. What it was fitted to is kept for figures.
pub fn add(experiment: &Experiment, identified: &mut Identified) -> Value {
    let lag_s = median(identified.model.points.iter().map(|point| point.time_constant_s + point.delay_s).collect());
    let mut all = SteadyPoints { running: Vec::new(), still: None, ramp: false };
    for record in experiment.records.iter().filter(|r| r.role != Some(Role::Validate) && !r.compensated) {
        // Most records are no staircase, and that is no fault of theirs.
        if let Ok(found) = SteadyPoints::of(record, experiment.output, lag_s) {
            all.join(found);
        }
    }
    let Ok(fit) = fit_static_map(&all) else {
        return Value::Null;
    };
    let polynomial = polynomial(&fit);
    let map = identified.model.static_map.get_or_insert_with(|| levels(&all));
    map.polynomial = Some(polynomial);
    identified.text.push_str(&describe(&fit, experiment.output));
    identified.warnings.extend(fit.warnings.iter().map(ToString::to_string));
    let json = to_json(&fit);
    identified.static_map = Some((all, fit));
    json
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// The mean response of each level.
fn levels(points: &SteadyPoints) -> StaticMap {
    let mut sums: Vec<(f64, f64, f64)> = Vec::new();
    let mut sorted = points.running.clone();
    sorted.sort_by(|a, b| a.command.total_cmp(&b.command));
    for point in sorted {
        match sums.last_mut().filter(|last| point.command - last.0 < 1e-6) {
            Some((_, sum, count)) => {
                *sum += point.response;
                *count += 1.0;
            }
            None => sums.push((point.command, point.response, 1.0)),
        }
    }
    StaticMap {
        command: sums.iter().map(|level| level.0).collect(),
        response: sums.iter().map(|level| level.1 / level.2).collect(),
        polynomial: None,
    }
}

fn polynomial(fit: &StaticMapFit) -> MapPolynomial {
    let (limit, limit_std) = match fit.limit {
        Some(Limit::Saturates { command, .. }) => (Some(command.value), Some(command.std)),
        Some(Limit::Falls { command, .. }) => (Some(command), None),
        None => (None, None),
    };
    MapPolynomial {
        range: fit.range.into(),
        coefficients: fit.coefficients.iter().map(|c| c.value).collect(),
        coefficients_std: fit.coefficients.iter().map(|c| c.std).collect(),
        dead_zone: fit.dead_zone.map(|zone| zone.end.map_or(zone.runs, |end| end.value)),
        dead_zone_std: fit.dead_zone.and_then(|zone| zone.end).map(|end| end.std),
        hysteresis: fit.hysteresis.map(|width| width.value),
        hysteresis_std: fit.hysteresis.map(|width| width.std),
        limit,
        limit_std,
    }
}

fn interval(estimate: Estimate, digits: usize) -> String {
    let (low, high) = estimate.interval(0.95);
    format!("{:.digits$} ({low:.digits$} to {high:.digits$})", estimate.value)
}

fn describe(fit: &StaticMapFit, output: Output) -> String {
    let mut text = format!(
        "\nstatic map over commands {:.3} to {:.3}: degree {} by F-test at 0.5 %,\n\
         {} steady points, 95 % intervals\n",
        fit.range.0,
        fit.range.1,
        fit.degree(),
        fit.points
    );
    let mut say = |line: String| {
        text.push_str(&line);
        text.push('\n');
    };
    let digits = if output == Output::Rpm { 1 } else { 4 };
    for (power, coefficient) in fit.coefficients.iter().enumerate() {
        say(format!("  u^{power} {:>42} {}", interval(*coefficient, digits), unit(output)));
    }
    match fit.dead_zone {
        Some(zone) => {
            let bracket = format!("still at {:.3}, turning at {:.3}", zone.still, zone.runs);
            match zone.end {
                Some(end) => say(format!("  dead zone up to {}; {bracket}", interval(end, 4))),
                None => say(format!("  dead zone: {bracket}; it starts with a jump")),
            }
        }
        None => say(String::from("  dead zone not seen: the motor turns at all commands recorded")),
    }
    match fit.hysteresis {
        Some(width) => {
            say(format!("  hysteresis {} of command\n    between levels from below and from above", interval(width, 4)))
        }
        None => say(String::from("  hysteresis not seen: levels were reached from one side only")),
    }
    match fit.limit {
        Some(Limit::Saturates { command, response }) => say(format!(
            "  limited beyond command {}, at {} {}",
            interval(command, 4),
            interval(response, digits),
            unit(output)
        )),
        Some(Limit::Falls { command, by }) => say(format!(
            "  falls beyond command {command:.3}, by {} {} at the next level:\n    the polynomial ends there",
            interval(by, digits),
            unit(output)
        )),
        None => say(format!("  no limit up to command {:.3}", fit.range.1)),
    }
    if let Some(table) = fit.linearization(11) {
        let commands: Vec<String> = table.iter().map(|(_, command)| format!("{command:.4}")).collect();
        say(format!("  commands for 0, 10 .. 100 % of the response:\n  {}", commands.join(" ")));
    }
    text
}

fn to_json(fit: &StaticMapFit) -> Value {
    let estimate =
        |e: Estimate| json!({ "value": e.value, "std": e.std, "interval": <[f64; 2]>::from(e.interval(0.95)) });
    json!({
        "range": <[f64; 2]>::from(fit.range),
        "degree": fit.degree(),
        "coefficients": fit.coefficients.iter().map(|c| estimate(*c)).collect::<Vec<_>>(),
        "dead_zone": fit.dead_zone.map(|zone| json!({
            "still": zone.still, "runs": zone.runs, "end": zone.end.map(estimate),
        })),
        "hysteresis": fit.hysteresis.map(estimate),
        "limit": fit.limit.map(|limit| match limit {
            Limit::Saturates { command, response } => {
                json!({ "kind": "saturates", "command": estimate(command), "response": estimate(response) })
            }
            Limit::Falls { command, by } => json!({ "kind": "falls", "command": command, "by": estimate(by) }),
        }),
        "points": fit.points,
        "excess": fit.excess,
        "linearization": fit.linearization(11),
    })
}
