//! Which column of a plain table is what, by the names in its header and from what is stated.
//!
//! A name says a quantity and a unit: `time_ms`, `Thrust [g]`, `Throttle (%)`, `rpm`. One that says a quantity alone is not
//! taken, and what numbers look like is never looked at.

use super::ImportError;
use super::plain_layout::PlainTable;
use super::quantity::{ColumnChoice, Quantity, Unit};
use super::summary::ColumnList;
use super::table::Column;

/// A column that is taken.
#[derive(Clone, Copy)]
pub(super) struct Pick<'a> {
    pub(super) column: Column<'a>,
    pub(super) unit: Unit,
    pub(super) is_reversed: bool,
}

/// The columns that are taken. One of thrust and speed is there.
pub(super) struct Picks<'a> {
    pub(super) time: Pick<'a>,
    pub(super) command: Pick<'a>,
    pub(super) thrust: Option<Pick<'a>>,
    pub(super) speed: Option<Pick<'a>>,
    pub(super) voltage: Option<Pick<'a>>,
    pub(super) current: Option<Pick<'a>>,
}

impl<'a> Picks<'a> {
    /// What is stated in `choices`, and the rest from the names; `list` learns why columns are left.
    pub(super) fn of(
        plain: &'a PlainTable,
        choices: &[ColumnChoice],
        list: &mut ColumnList,
    ) -> Result<Self, ImportError> {
        let of = |quantity| find(plain, quantity, choices);
        let mut questions = Vec::new();
        let mut need = |found, asks: &str, quantity| match found {
            Found::Pick(pick) => Some(pick),
            Found::Unclear(question) => {
                questions.push(question);
                None
            }
            Found::Nothing => {
                questions.push(Question::new(quantity, "HEADER", format!("no column is known to be the {asks}")));
                None
            }
        };
        let time = need(of(Quantity::Time)?, "time", Quantity::Time);
        let command = need(of(Quantity::Command)?, "command", Quantity::Command);
        let (thrust, speed) = match (of(Quantity::Thrust)?, of(Quantity::Speed)?) {
            (Found::Nothing, Found::Nothing) => {
                (need(Found::Nothing, "thrust, and none the rpm", Quantity::Thrust), None)
            }
            (Found::Nothing, speed) => (None, need(speed, "", Quantity::Speed)),
            (thrust, speed) => (need(thrust, "", Quantity::Thrust), speed.pick()),
        };
        let (voltage, current) = (of(Quantity::Voltage)?.pick(), of(Quantity::Current)?.pick());
        let (Some(time), Some(command), true) = (time, command, questions.is_empty()) else {
            return Err(ask(plain, &questions));
        };
        let picks = Self { time, command, thrust, speed, voltage, current };
        picks.say_why_others_are_left(plain, list);
        Ok(picks)
    }

    /// Every column that is taken.
    pub(super) fn all(&self) -> impl Iterator<Item = Pick<'a>> {
        [Some(self.time), Some(self.command), self.thrust, self.speed, self.voltage, self.current].into_iter().flatten()
    }

    fn say_why_others_are_left(&self, plain: &PlainTable, list: &mut ColumnList) {
        for index in 0..plain.table.header.len() {
            let column = Column::at(&plain.table, index);
            if self.all().any(|pick| pick.column.index() == index) {
                continue;
            }
            let Some(said) = Said::of(plain, index) else { continue };
            let name = said.quantity.name();
            let is_taken = self.all().any(|pick| pick.unit.quantity == said.quantity);
            match said.unit {
                _ if is_taken => list.left(column, format!("another column was taken as {}", said.quantity.column())),
                Some(_) => list.left(column, format!("one of several that are called {name}")),
                None => list.left(column, format!("{name} in no unit that is known: {}", said.quantity.units())),
            }
        }
    }
}

/// What the search for one quantity comes to.
enum Found<'a> {
    Pick(Pick<'a>),
    Unclear(Question),
    Nothing,
}

impl<'a> Found<'a> {
    fn pick(self) -> Option<Pick<'a>> {
        match self {
            Self::Pick(pick) => Some(pick),
            _ => None,
        }
    }
}

/// What the names do not say, and the option that states it.
struct Question {
    quantity: Quantity,
    asks: String,
    option: String,
}

impl Question {
    fn new(quantity: Quantity, header: &str, asks: String) -> Self {
        Self { quantity, asks, option: option(quantity, header, "UNIT") }
    }
}

/// `--column` as it is typed in a shell.
pub(super) fn option(quantity: Quantity, header: &str, unit: &str) -> String {
    let value = format!("{}={header}:{unit}", quantity.name());
    let is_plain = |c: char| c.is_alphanumeric() || "=:_-+./,".contains(c);
    if value.chars().all(is_plain) {
        return format!("--column {value}");
    }
    // What cannot be quoted, a null byte, cannot be typed either.
    let quoted = shlex::try_quote(&value).map(std::borrow::Cow::into_owned);
    format!("--column {}", quoted.unwrap_or(value))
}

fn find<'a>(plain: &'a PlainTable, quantity: Quantity, choices: &[ColumnChoice]) -> Result<Found<'a>, ImportError> {
    let header = &plain.table.header;
    let (index, stated) = if let Some(choice) = choices.iter().find(|choice| choice.quantity == quantity) {
        let mut named = (0..header.len()).filter(|index| header[*index] == choice.header);
        let index = named.next().ok_or_else(|| ImportError::NoSuchColumn {
            file: plain.table.file.clone(),
            column: choice.header.clone(),
            columns: listed(plain),
        })?;
        if named.next().is_some() {
            return Err(ImportError::SameName { file: plain.table.file.clone(), column: choice.header.clone() });
        }
        (index, Some(choice))
    } else {
        let is_chosen = |index: &usize| choices.iter().any(|choice| choice.header == header[*index]);
        let says = |index: &usize| Said::of(plain, *index).is_some_and(|said| said.quantity == quantity);
        let named: Vec<usize> = (0..header.len()).filter(|index| says(index) && !is_chosen(index)).collect();
        match named[..] {
            [] => return Ok(Found::Nothing),
            [index] => (index, None),
            [one, other, ..] => {
                let asks = format!("`{}` and `{}` are both called {}", header[one], header[other], quantity.name());
                return Ok(Found::Unclear(Question::new(quantity, &header[one], asks)));
            }
        }
    };
    let column = Column::at(&plain.table, index);
    let is_reversed = stated.is_some_and(|choice| choice.is_reversed);
    let written = written(plain, index);
    let named = written.as_deref().and_then(|text| Unit::named(quantity, text));
    let own = || own_command(plain, index, quantity).or_else(|| shown_by_clock(column, quantity));
    let unit = stated.and_then(|choice| choice.unit).or(named).or_else(own);
    Ok(match unit {
        Some(unit) => Found::Pick(Pick { column, unit, is_reversed }),
        None => {
            let in_what = match written {
                Some(written) if Said::of(plain, index).is_some() => format!("in `{written}`, which is not known here"),
                _ => String::from("without a unit"),
            };
            let asks = format!("`{}` is the {} {in_what}", column.name(), quantity.name());
            Found::Unclear(Question::new(quantity, column.name(), asks))
        }
    })
}

/// The column `command` beside those of a record, which is such a record's: a duty.
fn own_command(plain: &PlainTable, index: usize, quantity: Quantity) -> Option<Unit> {
    let has = |name: &str| plain.table.header.iter().any(|column| column == name);
    let is_own = has("time_s") && (has("thrust_n") || has("rpm")) && plain.table.header[index] == "command";
    (is_own && quantity == Quantity::Command).then(|| Unit::named(quantity, "duty")).flatten()
}

/// A time that is read off a clock says so in every row; numbers say nothing.
fn shown_by_clock(column: Column<'_>, quantity: Quantity) -> Option<Unit> {
    (quantity == Quantity::Time && column.shows_a_clock()).then(|| Unit::named(quantity, "clock")).flatten()
}

/// The error that asks all questions at once.
fn ask(plain: &PlainTable, questions: &[Question]) -> ImportError {
    let joined = |of: &dyn Fn(&Question) -> String, with: &str| questions.iter().map(of).collect::<Vec<_>>().join(with);
    let place = plain.header_line.map(|line| format!(", line {line}")).unwrap_or_default();
    let unit = |question: &Question| format!("{} in {}", question.quantity.name(), question.quantity.units());
    ImportError::UnclearColumns {
        file: plain.table.file.clone(),
        problem: format!("{place}: {}", joined(&|question| question.asks.clone(), "; ")),
        remedy: format!(
            "the columns are {}. Nothing is guessed: say which is what, and in which unit, with `{}` ({})",
            listed(plain),
            joined(&|question| question.option.clone(), " "),
            joined(&unit, "; ")
        ),
    }
}

/// The columns' names, for messages.
fn listed(plain: &PlainTable) -> String {
    let names = plain.table.header.iter().filter(|name| !name.is_empty());
    names.map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

/// What a name says.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Said {
    quantity: Quantity,
    unit: Option<Unit>,
}

impl Said {
    fn of(plain: &PlainTable, index: usize) -> Option<Self> {
        let (base, in_name) = split(&plain.table.header[index]);
        let named = Quantity::ALL.into_iter().find(|quantity| quantity.spellings().contains(&base.as_str()));
        // A unit in front of which there is no more than what turns is a name too.
        let quantity = match named {
            Some(quantity) => quantity,
            None if base.is_empty() && in_name.as_deref().is_some_and(is_rpm) => Quantity::Speed,
            None => return None,
        };
        let written = in_name.or_else(|| below(plain, index));
        let unit = written.as_deref().and_then(|written| Unit::named(quantity, written));
        // `motor` alone may be anything of a motor.
        (quantity != Quantity::Speed || unit.is_some() || base.contains("speed") || base == "rpm")
            .then_some(Self { quantity, unit })
    }
}

fn is_rpm(unit: &str) -> bool {
    unit.eq_ignore_ascii_case("rpm")
}

/// The unit that is written in a column's name, or below it.
fn written(plain: &PlainTable, index: usize) -> Option<String> {
    split(&plain.table.header[index]).1.or_else(|| below(plain, index))
}

/// The unit in the line of units.
fn below(plain: &PlainTable, index: usize) -> Option<String> {
    plain.units.get(index).filter(|unit| !unit.is_empty()).cloned()
}

/// A name as words in small letters, and the unit behind them: in brackets, or as the last word where it is one.
fn split(name: &str) -> (String, Option<String>) {
    let name = name.trim();
    if let Some(open) = name.rfind(['(', '[']).filter(|_| name.ends_with([')', ']'])) {
        let unit = name[open + 1..name.len() - 1].trim();
        return (words(&name[..open]), Some(unit.to_owned()).filter(|unit| !unit.is_empty()));
    }
    let start = name.rfind([' ', '_', '-', '.', ',']).map_or(0, |at| at + 1);
    let last = &name[start..];
    // `duty` is more often the name of a command than its unit.
    let is_unit = Unit::is_any(last) && !last.eq_ignore_ascii_case("duty");
    if is_unit && (start > 0 || is_rpm(last)) {
        let base = words(&name[..start]);
        return (base.strip_suffix(" in").map(str::to_owned).unwrap_or(base), Some(last.to_owned()));
    }
    (words(name), None)
}

/// Small letters, and one blank for whatever stands between words.
fn words(text: &str) -> String {
    let lower = text.to_lowercase();
    lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn plain(header: &str) -> PlainTable {
        let text = format!("{header}\n{}\n", vec!["0.5"; header.split(',').count()].join(","));
        PlainTable::parse(Path::new("log.csv"), text.as_bytes()).unwrap()
    }

    /// What each name of a header is taken as.
    fn said(header: &str) -> Vec<Option<(&'static str, Option<&'static str>)>> {
        let plain = plain(header);
        let of = |index| Said::of(&plain, index).map(|said| (said.quantity.name(), said.unit.map(|unit| unit.name)));
        (0..plain.table.header.len()).map(of).collect()
    }

    #[test]
    fn names_say_quantity_and_unit() {
        for (name, expected) in [
            ("time_ms", ("time", "ms")),
            ("Time (s)", ("time", "s")),
            ("Time [µs]", ("time", "us")),
            ("t_s", ("time", "s")),
            ("time in ms", ("time", "ms")),
            ("thrust [g]", ("thrust", "gf")),
            ("thrust_n", ("thrust", "N")),
            ("Thrust (lbf)", ("thrust", "lbf")),
            ("Throttle (%)", ("command", "percent")),
            ("throttle_percent", ("command", "percent")),
            ("pwm_us", ("command", "us")),
            ("ESC signal (µs)", ("command", "us")),
            ("Duty [0..1]", ("command", "duty")),
            ("rpm", ("rpm", "rpm")),
            ("Motor RPM", ("rpm", "rpm")),
            ("Speed (rad/s)", ("rpm", "rad/s")),
            ("Motor Optical Speed (RPM)", ("rpm", "rpm")),
            ("vbat_mV", ("voltage", "mV")),
            ("Current (A)", ("current", "A")),
        ] {
            let (quantity, unit) = expected;
            assert_eq!(said(&format!("{name},x"))[0], Some((quantity, Some(unit))), "{name}");
        }
    }

    #[test]
    fn names_that_say_less_are_told_apart_from_those_that_say_nothing() {
        for name in
            ["time", "throttle", "pwm", "Duty", "command", "thrust", "speed", "Speed (Hz)", "pwm_duty", "voltage"]
        {
            assert!(matches!(said(&format!("{name},x"))[0], Some((_, None))), "{name}");
        }
        for name in ["ms", "load (g)", "torque_nm", "motor", "motor_temperature", "eRPM", "x", "esc_command", "s"] {
            assert_eq!(said(&format!("{name},x"))[0], None, "{name}");
        }
    }

    fn picked(header: &str, choices: &[&str]) -> Result<Vec<String>, ImportError> {
        let plain = plain(header);
        let choices: Vec<ColumnChoice> = choices.iter().map(|choice| choice.parse().unwrap()).collect();
        let mut list = ColumnList::new(&plain.table);
        let picks = Picks::of(&plain, &choices, &mut list)?;
        let show = |pick: Pick<'_>| {
            let sign = if pick.is_reversed { "-" } else { "" };
            format!("{} {}: {sign}{}", pick.unit.quantity.name(), pick.column.name(), pick.unit.name)
        };
        Ok(picks.all().map(show).collect())
    }

    #[test]
    fn what_is_stated_goes_before_what_a_name_says() {
        let found = picked("time_ms,thrust_g,ch1,load", &["thrust=load:-kgf", "command=ch1:percent"]).unwrap();
        assert_eq!(found, ["time time_ms: ms", "command ch1: percent", "thrust load: -kgf"]);
        let found = picked("time_s,command,rpm,thrust (N)", &["command=command:us"]).unwrap();
        assert_eq!(found, ["time time_s: s", "command command: us", "thrust thrust (N): N", "rpm rpm: rpm"]);
    }

    #[test]
    fn a_records_own_columns_need_no_unit() {
        let found = picked("time_s,command,thrust_n", &[]).unwrap();
        assert_eq!(found, ["time time_s: s", "command command: duty", "thrust thrust_n: N"]);
    }

    #[test]
    fn all_that_is_not_told_is_asked_at_once() {
        let error = picked("t,esc_us,load", &[]).unwrap_err();
        let help = miette::Diagnostic::help(&error).unwrap().to_string();
        let message = error.to_string();
        assert!(message.contains("log.csv, line 1: `t` is the time without a unit; no column is known"), "{message}");
        for part in [
            "`t`, `esc_us`, `load`",
            "--column time=t:UNIT --column thrust=HEADER:UNIT",
            "time in s, ms, us or clock (hh:mm:ss)",
        ] {
            assert!(help.contains(part), "{help}");
        }
        for (header, parts) in [
            ("time_s,time_ms,pwm_us,rpm", ["`time_s` and `time_ms` are both called time", "--column time=time_s:UNIT"]),
            ("time_s,command,thrust", ["`command` is the command without a unit", "`thrust` is the thrust without"]),
            ("time_s,pwm_us,speed (Hz)", ["`speed (Hz)` is the rpm in `Hz`", "'rpm=speed (Hz):UNIT'"]),
        ] {
            let error = picked(header, &[]).unwrap_err();
            let said = format!("{error} | {}", miette::Diagnostic::help(&error).unwrap());
            assert!(parts.iter().all(|part| said.contains(part)), "{header}: {said}");
        }
    }

    #[test]
    fn a_stated_column_that_is_not_there_or_twice_is_refused() {
        let error = picked("time_s,pwm_us,rpm", &["thrust=load:N"]).unwrap_err();
        assert!(error.to_string().contains("no column `load`"), "{error}");
        let error = picked("time_s,pwm_us,load,load", &["thrust=load:N"]).unwrap_err();
        assert!(error.to_string().contains("two columns are called `load`"), "{error}");
    }
}
