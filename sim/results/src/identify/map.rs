//! The static map, where the records have plateaus or a ramp.

use rotorlead_answer::{Audience, ColumnSpec, Table, Unit, build_table};
use rotorlead_identify::estimate::Estimate;
use rotorlead_identify::static_map::{MapLimit, StaticMapFit, StaticMapWarning};
use rotorlead_records::Output;

use crate::unit::unit;

/// Shares of the response in the table that makes it linear. Chosen: a tenth apart; straight between them a square root is off by 0.6 % of
/// the range from the second share on, and more rows are tedious to copy.
const LINEARIZED: usize = 11;

/// The polynomial, with what shows beside it as notes; and the commands that make the response linear.
pub(super) fn tables(fit: &StaticMapFit, output: Output) -> Vec<Table> {
    [polynomial(fit, output)].into_iter().chain(linearization(fit)).collect()
}

fn polynomial(fit: &StaticMapFit, output: Output) -> Table {
    let decimals = if output == Output::Rpm { 1 } else { 4 };
    let unit_of = Unit::plain(unit(output));
    type Row<'a> = (usize, &'a Estimate);
    let columns = [
        ColumnSpec::words("term", "term", |(power, _): &Row| format!("u^{power}")),
        ColumnSpec::new("coefficient", "coefficient", unit_of, decimals, |(_, found): &Row| found.value),
        ColumnSpec::new("lower", "from", unit_of, decimals, |(_, found): &Row| found.interval(0.95).0),
        ColumnSpec::new("upper", "to", unit_of, decimals, |(_, found): &Row| found.interval(0.95).1),
    ];
    let rows: Vec<Row> = fit.coefficients.iter().enumerate().collect();
    let caption = format!(
        "Static map over commands {:.3} to {:.3}: degree {} by {}, {} steady points, 95 % intervals",
        fit.range.0,
        fit.range.1,
        fit.degree(),
        fit.degree_by,
        fit.points
    );
    Table {
        notes: notes(fit, output),
        weight: Audience::Detail,
        ..build_table("static_map_terms", caption, &columns, &rows)
    }
}

fn interval(estimate: Estimate, digits: usize) -> String {
    let (low, high) = estimate.interval(0.95);
    format!("{:.digits$} ({low:.digits$} to {high:.digits$})", estimate.value)
}

/// Dead zone, hysteresis and limit.
fn notes(fit: &StaticMapFit, output: Output) -> Vec<String> {
    let digits = if output == Output::Rpm { 1 } else { 4 };
    let dead_zone = match fit.dead_zone {
        Some(zone) => {
            let bracket = format!("still at {:.3}, turning at {:.3}", zone.still, zone.runs);
            match zone.end {
                Some(end) => format!("dead zone up to {}; {bracket}", interval(end, 4)),
                None => format!("dead zone: {bracket}; it starts with a jump"),
            }
        }
        None => "dead zone not seen: the motor turns at all commands recorded".to_owned(),
    };
    let hysteresis = match fit.hysteresis {
        Some(width) => {
            format!("hysteresis {} of command between levels from below and from above", interval(width, 4))
        }
        None if fit.warnings.contains(&StaticMapWarning::RampLag { both_ways: true }) => {
            "hysteresis not known: on a ramp the motor's lag looks alike".to_owned()
        }
        None => "hysteresis not seen: levels were reached from one side only".to_owned(),
    };
    let limit = match fit.limit {
        Some(MapLimit::Saturates { command, response }) => format!(
            "limited beyond command {}, at {} {}",
            interval(command, 4),
            interval(response, digits),
            unit(output)
        ),
        Some(MapLimit::Falls { command, by }) => format!(
            "falls beyond command {command:.3}, by {} {} at the next level: the polynomial ends there",
            interval(by, digits),
            unit(output)
        ),
        None => format!("no limit up to command {:.3}", fit.range.1),
    };
    vec![dead_zone, hysteresis, limit]
}

fn linearization(fit: &StaticMapFit) -> Option<Table> {
    type Row = (f64, f64);
    let columns = [
        ColumnSpec::new("part", "response", Unit::plain("of its range"), 1, |(part, _): &Row| *part),
        ColumnSpec::new("command", "command", Unit::DUTY, 4, |(_, command): &Row| *command),
    ];
    let rows = fit.linearization(LINEARIZED)?;
    let table = build_table("linearization", "Commands that make the response linear", &columns, &rows);
    Some(Table { weight: Audience::Detail, ..table })
}
