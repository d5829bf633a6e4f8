//! `rotorlead identify`: the static map, where the records have plateaus or a ramp.

use rotorlead_identify::Estimate;
use rotorlead_identify::static_map::{Limit, StaticMapFit};
use rotorlead_records::Output;
use rotorlead_results::unit;

fn interval(estimate: Estimate, digits: usize) -> String {
    let (low, high) = estimate.interval(0.95);
    format!("{:.digits$} ({low:.digits$} to {high:.digits$})", estimate.value)
}

/// What the map shows beside its polynomial.
pub fn describe(fit: &StaticMapFit, output: Output) -> String {
    let mut text = String::new();
    let mut say = |line: String| {
        text.push_str(&line);
        text.push('\n');
    };
    let digits = if output == Output::Rpm { 1 } else { 4 };
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
            "  limited beyond command {},\n    at {} {}",
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
