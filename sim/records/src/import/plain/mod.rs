//! Tables: any logger's rows of numbers, with or without lines above them, separated by commas, semicolons or tabs.
//!
//! `layout` finds the table, `columns` says which column is what by `names` and `units`, `questions` asks for what neither says, `rows`
//! makes the numbers of a record, and `response` says which of thrust and speed is the response.

mod columns;
mod layout;
mod names;
mod questions;
mod response;
mod rows;
mod speeds;
mod units;

use std::mem::take;

use self::columns::{Pick, Picks};
pub(super) use self::layout::{Beside, PlainTable};
use self::names::{Said, is_electrical};
use self::questions::{listed, option};
use self::response::{Columns, Decision};
use self::rows::Rows;
pub(super) use self::units::SINCE_1970_S;
use super::format::{Dialect, LogFormat, Reader, UNCOMPRESSED};
use super::glitches::{MOST_GLITCHES, MOST_RPM};
use super::quantity::{ELECTRICAL, Quantity, Scale, Unit};
use super::stamps::typical_and_longest;
use super::summary::ColumnList;
use super::table::Table;
use super::{ImportError, ImportOptions, ImportSummary, MIN_ROWS, MIN_STEADY_POINTS, Taken, Timing};
use crate::experiment::{Excitation, Output, Setpoints};

/// Share of thrust readings below zero from which on the sign is mentioned.
const MOSTLY: f64 = 0.5;
/// No such rotor pulls more, newtons.
const MOST_N: f64 = 10_000.0;

impl PlainTable<'_> {
    /// What a column measures by its name.
    pub(super) fn quantity(&self, column: usize) -> Option<Quantity> {
        Said::from_column(self, column).map(|said| said.quantity)
    }
}

/// Takes the columns that are known or stated, and the rows that have what a record needs.
pub(super) fn take_table(
    mut plain: PlainTable<'_>,
    options: &ImportOptions,
    format: &'static LogFormat,
) -> Result<Taken, ImportError> {
    let is_stand = plain.dialect.is_stand;
    let mut notes = take(&mut plain.notes);
    let mut list = ColumnList::new(&plain.table, &plain.beside);
    let picks = Picks::choose(&plain, options, &mut list)?;
    let places: Vec<usize> = picks.all().map(|pick| pick.column).collect();
    plain.table.check_lengths(&picks.compared())?;
    notes.extend(plain.table.infer_comma(&places)?.map(String::from));
    let table = &plain.table;

    let read: Vec<_> = picks.all().map(|pick| (pick.column, pick.reading())).collect();
    let mut numbers = table.numbers(&read)?.into_iter();
    let mut values = |pick: Option<Pick>| pick.and_then(|_| numbers.next());
    let mut rows = Rows {
        table,
        places: Vec::new(),
        time: values(picks.time).unwrap_or_default(),
        command: values(picks.command).unwrap_or_default(),
        own_command: Vec::new(),
        thrust: values(picks.thrust),
        speed: values(picks.speed),
        voltage: values(picks.voltage),
        current: values(picks.current),
        dropped: Vec::new(),
        reordered: 0,
    };
    let rows_read = rows.time.len().max(rows.command.len());
    rows.places = (0..rows_read).collect();
    notes.extend(rows.hold_interleaved(options.output));
    if table.has_samples() {
        rows.leave_out_no_numbers();
    }
    let mut command_note = String::new();
    if let Some(command) = picks.command {
        rows.cut_to_the_command(command)?;
        command_note = rows.normalize_command(command, options, &mut notes)?;
    }
    for (pick, values) in [
        (picks.thrust, &mut rows.thrust),
        (picks.speed, &mut rows.speed),
        (picks.voltage, &mut rows.voltage),
        (picks.current, &mut rows.current),
    ] {
        convert(table, &rows.places, pick, values)?;
    }

    let is_steady = rows.find_times(picks.time, is_stand, options, &mut notes)?;
    if let (true, Some(motor), Some(command)) = (plain.dialect.may_be_flight, picks.motor, picks.command) {
        rows.refuse_flight(&plain, motor, command, options)?;
    }
    let listed = listed(&plain);
    let columns = Columns {
        table,
        listed: &listed,
        places: &rows.places,
        thrust: picks.thrust.zip(rows.thrust.as_deref()),
        speed: picks.speed.zip(rows.speed.as_deref()),
        others: [(picks.voltage, &rows.voltage), (picks.current, &rows.current)]
            .into_iter()
            .filter_map(|(pick, values)| pick.zip(values.as_deref()))
            .collect(),
    };
    let Decision { output, note, needed } = columns.decide(options.output, is_stand)?;
    notes.extend(note);
    rows.leave_out_blanks(&needed);
    rows.leave_out_repeated();
    let count = rows.time.len();
    let least = if is_steady { MIN_STEADY_POINTS } else { MIN_ROWS };
    if count < least {
        return Err(ImportError::TooFewRows { file: table.file.clone(), rows: count, needed: least });
    }

    if let Some(time) = picks.time {
        list.taken(time.column, Quantity::Time.column(), format!("{}, from the first row taken", time.unit.name));
    }
    if let Some(command) = picks.command {
        list.taken(command.column, Quantity::Command.column(), command_note);
    }
    let span = rows.time.last().copied().unwrap_or(0.0);
    let mut complete = |pick: Option<Pick>, values: &mut Option<Vec<f64>>| {
        let (Some(pick), Some(found)) = (pick, values.as_ref()) else { return None };
        let filled = found.iter().filter(|value| !value.is_nan()).count();
        let is_idle = pick.unit.quantity == Quantity::Speed
            && output == Output::ThrustN
            && !pick.is_stated
            && found.iter().all(|value| *value == 0.0);
        if filled == count && !is_idle {
            list.taken(pick.column, pick.unit.quantity.column(), conversion(pick));
            return values.take();
        }
        let mut why = format!("filled in {filled} of {count} rows ({:.1} Hz)", filled as f64 / span);
        if is_idle {
            why = String::from("zero in every row");
        } else if matches!(pick.unit.quantity, Quantity::Thrust | Quantity::Speed) {
            why += match 2 * filled > count {
                true => format!(": `--response {}` takes it and leaves out the other rows", pick.unit.quantity.name()),
                false => String::from(": too slow to show the lag"),
            }
            .as_str();
        }
        list.left(pick.column, why);
        None
    };
    let sample_rate_hz = options.rate_hz.filter(|_| picks.time.is_none() && rows::is_whole(&rows.places));
    let thrust_n = complete(picks.thrust, &mut rows.thrust);
    let rpm = complete(picks.speed, &mut rows.speed);
    let voltage_v = complete(picks.voltage, &mut rows.voltage);
    let current_a = complete(picks.current, &mut rows.current);
    if let (Some(pick), Some(thrust_n)) = (picks.thrust, &thrust_n) {
        notes.extend(reversed(table, pick, thrust_n));
    }
    if let (Some(pick), true) = (picks.speed, rpm.is_some()) {
        let name = &table.header[pick.column];
        let is_electrical = is_electrical(name);
        if is_electrical {
            notes.push(format!(
                "speed is `{name}` as it stands, which is right for the rotor only if the number of poles was set in the stand's \
                 software"
            ));
        }
        let beside = picks.command.map(|command| speeds::Beside { command, thrust: picks.thrust });
        notes.extend(
            (is_electrical || picks.is_another_speed_lost).then(|| speeds::differing(&plain, pick, beside)).flatten(),
        );
    }
    Ok(Taken {
        summary: ImportSummary {
            file: table.file.clone(),
            format,
            rows_read,
            rows_taken: count,
            columns: list.into_vec(),
            dropped: rows.dropped,
            timing: timing(&rows.time, rows.reordered),
            pulse_widths: picks.command.is_some_and(|command| command.unit.scale == Scale::Pulse),
            has_motors: picks.motor.is_some(),
            is_electrical: picks.speed.is_some_and(|speed| speed.unit.name.starts_with(ELECTRICAL)),
            notes,
        },
        usual: if is_steady { Some(Excitation::Steady) } else { plain.dialect.usual },
        output,
        time_s: rows.time,
        command: rows.command,
        own_command: rows.own_command.iter().map(|own| (own.time, own.command)).collect(),
        thrust_n,
        rpm,
        voltage_v,
        current_a,
        setpoints: Setpoints::default(),
        loop_rate_hz: None,
        sample_rate_hz,
    })
}

fn timing(time_s: &[f64], reordered: usize) -> Timing {
    let (typical, longest) = typical_and_longest(time_s);
    let span = time_s.last().copied().unwrap_or(0.0);
    let sorted = if reordered > 0 { ", sorted" } else { "" };
    Timing {
        method: format!(
            "stamps of the log{sorted}; intervals of {:.3} ms (median) to {:.3} ms (longest)",
            typical * 1e3,
            longest * 1e3
        ),
        rate_hz: (time_s.len() - 1) as f64 / span,
        rows_reordered: reordered,
        rows_missing: 0,
        residual_rms_s: None,
        residual_max_s: None,
    }
}

/// Puts the numbers of a column in the unit of a record, where they are within what can be. `places` are their rows of the table.
fn convert(
    table: &Table<'_>,
    places: &[usize],
    pick: Option<Pick>,
    values: &mut Option<Vec<f64>>,
) -> Result<(), ImportError> {
    let (Some(pick), Some(values)) = (pick, values) else { return Ok(()) };
    let (most, unit) = match pick.unit.quantity {
        Quantity::Thrust => (MOST_N, "N"),
        Quantity::Speed => (MOST_RPM, "rpm"),
        _ => (f64::MAX, ""),
    };
    let is_too_much = |value: &f64| pick.converted(*value).abs() > most;
    let too_much = values.iter().filter(|value| is_too_much(value)).count();
    // A few are left out with the rest of what no rotor does.
    let are_glitches = pick.unit.quantity == Quantity::Speed && too_much as f64 <= MOST_GLITCHES * values.len() as f64;
    for (row, value) in values.iter_mut().enumerate() {
        let found = pick.converted(*value);
        if found.abs() > most && !are_glitches {
            let name = &table.header[pick.column];
            let line = table.line(places[row]);
            let text = table.at(places[row], |row| row.text(pick.column).to_owned()).unwrap_or_default();
            return Err(ImportError::cell(
                &table.file,
                line,
                name,
                format!("`{text}` in {} is more than {most} {unit}, which cannot be", pick.unit.name),
                format!(
                    "where its unit is another, state it with `{}`; where the value is a glitch, delete the row",
                    option(pick.unit.quantity, name, "UNIT")
                ),
            ));
        }
        *value = found;
    }
    Ok(())
}

/// What [`Pick::converted`] does, in words.
fn conversion(pick: Pick) -> String {
    let Unit { name, scale, .. } = pick.unit;
    let factor = match scale {
        Scale::Ratio(1.0, 1.0) | Scale::Pulse | Scale::Dshot | Scale::Clock | Scale::Electrical(_) => String::new(),
        Scale::Ratio(times, 1.0) => format!(", times {times}"),
        Scale::Ratio(times, over) => format!(", times {}", times / over),
    };
    format!("in {name}{factor}{}", if pick.is_reversed { ", sign turned" } else { "" })
}

/// What is to be said of a thrust that pulls where it should push.
fn reversed(table: &Table<'_>, pick: Pick, thrust_n: &[f64]) -> Option<String> {
    let below = thrust_n.iter().filter(|thrust| **thrust < 0.0).count();
    let other_sign = if pick.is_reversed { "" } else { "-" };
    (below as f64 > MOSTLY * thrust_n.len() as f64).then(|| {
        format!(
            "thrust is below zero in {below} of {} rows; where the sensor reads the other way round, turn its sign by \
             `{}`",
            thrust_n.len(),
            option(Quantity::Thrust, &table.header[pick.column], &format!("{other_sign}{}", pick.unit.name))
        )
    })
}

/// The format.
pub(super) const FORMAT: LogFormat = LogFormat {
    name: "plain",
    title: "tables of numbers as text, with commas, semicolons, tabs or blanks between the columns",
    has_motors: true,
    has_several_logs: false,
    has_stated_columns: true,
    memory_per_byte: UNCOMPRESSED,
    reader: Reader::Table { is_header: |_| true, dialect: &Dialect::PLAIN },
};
