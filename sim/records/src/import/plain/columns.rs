//! Which column of a plain table is what, by the names in its header and from what is stated.
//!
//! A name says a quantity and a unit: `time_ms`, `Thrust [g]`, `Throttle (%)`, `rpm`. One that says a quantity alone is not
//! taken. What numbers look like is looked at in two places: a command without a unit is taken in the only one that its numbers
//! fit, where there is one, and of several columns of one quantity one that never moves is not taken.

use super::layout::PlainTable;
use super::names::{Said, is_electrical, written};
use super::questions::{Question, ask, listed, option};
use super::{speeds, units};
use crate::experiment::{Excitation, Output};
use crate::import::missing::MissingOption;
use crate::import::quantity::{Quantity, Scale, Unit};
use crate::import::summary::ColumnList;
use crate::import::table::CellFormat;
use crate::import::{ImportError, ImportOptions};

/// Of a name that says none.
const WITHOUT_UNIT: &str = "without a unit";

/// A column that may be taken.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pick {
    /// Its place in the header.
    pub(super) column: usize,
    pub(super) unit: Unit,
    pub(super) is_reversed: bool,
    /// Whether it was named by [`ColumnChoice`], so that it has to be taken.
    pub(super) is_stated: bool,
    /// What the numbers show of their unit, where it is guessed from them.
    pub(super) guessed_because: Option<&'static str>,
}

impl Pick {
    /// A number as a record has it; that of a command is not one of these.
    pub(super) fn converted(self, value: f64) -> f64 {
        let sign = if self.is_reversed { -1.0 } else { 1.0 };
        match self.unit.scale {
            Scale::Ratio(times, over) => sign * value * times / over,
            // Electrical revolutions are taken with the number of poles alone.
            Scale::Pulse | Scale::Dshot | Scale::Clock | Scale::Electrical(_) => sign * value,
        }
    }

    /// That its unit is guessed, if it is, of a column of that name.
    pub(super) fn guess(self, name: &str) -> Option<String> {
        let because = self.guessed_because?;
        let quantity = self.unit.quantity;
        Some(format!(
            "the unit of `{name}` is guessed to be {}: its numbers {because}. `{}` states another unit: {}",
            self.unit.name,
            option(quantity, name, "UNIT"),
            quantity.units()
        ))
    }

    pub(super) fn reading(self) -> CellFormat {
        if self.unit.scale == Scale::Clock { CellFormat::Clock } else { CellFormat::Decimal }
    }
}

/// The columns that may be taken. One of thrust and speed is there.
pub(super) struct Picks {
    /// `None` where it is not needed.
    pub(super) time: Option<Pick>,
    /// `None` where it was logged apart.
    pub(super) command: Option<Pick>,
    pub(super) thrust: Option<Pick>,
    pub(super) speed: Option<Pick>,
    /// Whether the speed is taken because another one is lost at some levels of the command.
    pub(super) is_another_speed_lost: bool,
    pub(super) voltage: Option<Pick>,
    pub(super) current: Option<Pick>,
    /// Which motor they are of, where columns say that.
    pub(super) motor: Option<usize>,
}

impl Picks {
    /// What is stated, and the rest from the names; `list` learns why columns are left. Steady points need no time, and a log whose
    /// command is elsewhere none of that.
    pub(super) fn choose(
        plain: &PlainTable<'_>,
        options: &ImportOptions,
        list: &mut ColumnList,
    ) -> Result<Self, ImportError> {
        let needs_time = options.excitation != Some(Excitation::Steady) && options.rate_hz.is_none();
        let motor = wanted_motor(plain, options)?;
        let of = |quantity| find(plain, quantity, motor, options);
        let mut questions = Vec::new();
        let mut unfit = Vec::new();
        let mut need = |found, quantity| match found {
            Found::Pick(pick) => Some(pick),
            Found::Unclear(question) => {
                questions.push(question);
                None
            }
            Found::Nothing => {
                unfit.push(quantity);
                questions.push(Question::nothing(plain, quantity));
                None
            }
        };
        let time = match of(Quantity::Time)? {
            Found::Nothing if !needs_time => None,
            // Times in no known unit are no better than none.
            Found::Unclear(_) if options.rate_hz.is_some() => None,
            Found::Pick(time) if options.rate_hz.is_some() => {
                let column = &plain.table.header[time.column];
                return Err(ImportError::value(
                    &plain.table.file,
                    format!("column `{column}`"),
                    "has the times of the rows, beside which no --rate is needed",
                    "leave --rate out; where these are no times, say which column has them with --column",
                ));
            }
            found => need(found, Quantity::Time),
        };
        let command = match options.without_command {
            true => None,
            false => need(of(Quantity::Command)?, Quantity::Command),
        };
        let (thrust, speed) = match (of(Quantity::Thrust)?, of(Quantity::Speed)?) {
            (Found::Nothing, Found::Nothing) => (need(Found::Nothing, Quantity::Thrust), None),
            (Found::Nothing, speed) => (None, need(speed, Quantity::Speed)),
            (thrust, speed @ Found::Unclear(_)) if options.output == Some(Output::Rpm) => {
                (thrust.pick(), need(speed, Quantity::Speed))
            }
            (thrust, speed) => (need(thrust, Quantity::Thrust), speed.pick()),
        };
        let (voltage, current) = (of(Quantity::Voltage)?.pick(), of(Quantity::Current)?.pick());
        if let Some(beside) = plain.beside.iter().find(|b| b.quantity.is_some_and(|quantity| unfit.contains(&quantity)))
        {
            return Err(ImportError::value(
                &plain.table.file,
                format!("variable `{}`", beside.name),
                format!("{}, where a vector of real numbers is needed", beside.shown),
                format!("in MATLAB, {}", beside.remedy),
            ));
        }
        if !questions.is_empty() {
            return Err(ask(plain, &questions, options));
        }
        let mut picks = Self { time, command, thrust, speed, is_another_speed_lost: false, voltage, current, motor };
        picks.leave_lost_speed(plain);
        picks.say_why_others_are_left(plain, list);
        Ok(picks)
    }

    /// Takes another speed in place of one that is lost at some levels of the command, unless it was stated.
    fn leave_lost_speed(&mut self, plain: &PlainTable<'_>) {
        let (Some(speed), Some(command)) = (self.speed.filter(|speed| !speed.is_stated), self.command) else { return };
        let beside = speeds::Beside { command, thrust: self.thrust };
        let other =
            other_speed(plain, speed).filter(|other| speeds::is_lost(plain, speed.column, other.column, beside));
        if let Some(other) = other {
            (self.speed, self.is_another_speed_lost) = (Some(other), true);
        }
    }

    /// The columns that need as many numbers as each other.
    pub(super) fn compared(&self) -> Vec<usize> {
        let needed = [self.time, self.command, self.thrust, self.speed];
        needed.into_iter().flatten().map(|pick| pick.column).collect()
    }

    /// Every column that may be taken.
    pub(super) fn all(&self) -> impl Iterator<Item = Pick> {
        [self.time, self.command, self.thrust, self.speed, self.voltage, self.current].into_iter().flatten()
    }

    fn say_why_others_are_left(&self, plain: &PlainTable<'_>, list: &mut ColumnList) {
        for column in 0..plain.table.header.len() {
            if self.all().any(|pick| pick.column == column) {
                continue;
            }
            let Some(said) = Said::from_column(plain, column) else { continue };
            let name = said.quantity.name();
            let is_taken = self.all().any(|pick| pick.unit.quantity == said.quantity);
            match said.unit {
                _ if said.motor.is_some() && said.motor != self.motor => list.left(column, "another motor"),
                _ if is_taken && !moves(plain, column) => list.left(column, "zero or blank in every row"),
                _ if is_taken => list.left(column, format!("another column was taken as {}", said.quantity.column())),
                Some(unit) if unit.is_electrical() => {
                    list.left(column, format!("electrical: `{}` takes it", MissingOption::motor_poles()));
                }
                Some(_) => list.left(column, format!("one of several that are called {name}")),
                None => list.left(column, format!("{name} in no unit that is known: {}", said.quantity.units())),
            }
        }
    }
}

/// What the search for one quantity comes to.
enum Found {
    Pick(Pick),
    Unclear(Question),
    Nothing,
}

impl Found {
    fn pick(self) -> Option<Pick> {
        match self {
            Self::Pick(pick) => Some(pick),
            _ => None,
        }
    }
}

/// The motors that columns are of, from 1.
fn motors(plain: &PlainTable<'_>) -> Vec<usize> {
    let is_drive = |said: &Said| !matches!(said.quantity, Quantity::Time | Quantity::Voltage | Quantity::Current);
    let said = (0..plain.table.header.len()).filter_map(|column| Said::from_column(plain, column).filter(is_drive));
    let mut motors: Vec<usize> = said.filter_map(|said| said.motor).collect();
    motors.sort_unstable();
    motors.dedup();
    motors
}

/// The motor that is asked for, or the first that there is; `None` where no column says which it is of.
fn wanted_motor(plain: &PlainTable<'_>, options: &ImportOptions) -> Result<Option<usize>, ImportError> {
    let motors = motors(plain);
    match options.motor {
        Some(motor) if !motors.is_empty() && !motors.contains(&motor) => {
            let there = motors.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
            let remedy = format!("state one that is there: {there}. The columns are {}", listed(plain));
            Err(ImportError::missing(&plain.table.file, format!(": no column is of motor {motor}"), remedy))
        }
        stated => Ok(stated.or(motors.first().copied()).filter(|_| !motors.is_empty())),
    }
}

/// The columns of a quantity of other motors than the one, which are in the unit of its own.
pub(super) fn other_motors(plain: &PlainTable<'_>, quantity: Quantity, motor: usize) -> Vec<(usize, usize)> {
    let other = |column: usize| {
        let said = Said::from_column(plain, column).filter(|said| said.quantity == quantity)?;
        said.motor.filter(|other| *other != motor).map(|other| (other, column))
    };
    let mut others: Vec<(usize, usize)> = (0..plain.table.header.len()).filter_map(other).collect();
    others.sort_unstable();
    // A motor has one: work stays within a multiple of the log.
    others.dedup_by_key(|(motor, _)| *motor);
    others
}

fn find(
    plain: &PlainTable<'_>,
    quantity: Quantity,
    motor: Option<usize>,
    options: &ImportOptions,
) -> Result<Found, ImportError> {
    let (header, choices) = (&plain.table.header, &options.columns);
    let (index, stated) = if let Some(choice) = choices.iter().find(|choice| choice.quantity == quantity) {
        let mut named = plain.called(&choice.header).into_iter();
        let (file, column) = (&plain.table.file, &choice.header);
        let index = named.next().ok_or_else(|| {
            let remedy = format!(
                "the columns are {}: give one of these to --column, capitals and blanks as they are",
                listed(plain)
            );
            ImportError::missing(file, format!(": there is no column `{column}`"), remedy)
        })?;
        if named.next().is_some() {
            let remedy = format!("rename one of them in the header; the columns are {}", listed(plain));
            return Err(ImportError::missing(file, format!(": two columns are called `{column}`"), remedy));
        }
        (index, Some(choice))
    } else {
        let chosen: Vec<usize> = choices.iter().flat_map(|choice| plain.called(&choice.header)).collect();
        let is_chosen = |index: &usize| chosen.contains(index);
        let is_it = |said: Said| said.quantity == quantity && said.motor.is_none_or(|of| Some(of) == motor);
        let says = |index: &usize| Said::from_column(plain, *index).is_some_and(is_it);
        let named: Vec<usize> = (0..header.len()).filter(|index| says(index) && !is_chosen(index)).collect();
        match named[..] {
            [] => return Ok(Found::Nothing),
            [index] => (index, None),
            [one, other, ..] => match choose_one(plain, &named) {
                Some(index) => (index, None),
                None => {
                    let asks = format!("`{}` and `{}` are both called {}", header[one], header[other], quantity.name());
                    return Ok(Found::Unclear(Question::new(quantity, &header[one], asks)));
                }
            },
        }
    };
    let is_reversed = stated.is_some_and(|choice| choice.is_reversed);
    let written = written(plain, index);
    let said = Said::from_column(plain, index);
    let named = written.as_deref().and_then(|text| Unit::named(quantity, text));
    let named = named.or(said.filter(|said| said.quantity == quantity).and_then(|said| said.unit));
    let own = || units::own_command(plain, index, quantity).or_else(|| units::shown_by_clock(plain, index, quantity));
    let unit = stated.and_then(|choice| choice.unit).or(named).or_else(own);
    // A unit that is written and not known is another.
    let guess = || units::guessed(plain, index, quantity, options.pulse_range()).filter(|_| written.is_none());
    let contradicted = |unit: Unit| stated.is_none().then(|| units::fraction(plain, index, unit)).flatten();
    let unit = unit.map(|unit| contradicted(unit).map_or((unit, None), |(unit, because)| (unit, Some(because))));
    let found = unit.or_else(|| guess().map(|(unit, because)| (unit, Some(because))));
    let found = found.map(|(unit, because)| (unit.with_poles(plain.motor_poles), because));
    Ok(match found {
        Some((unit, _)) if unit.is_electrical() => Found::Unclear(Question::poles(&header[index])),
        Some((unit, guessed_because)) => {
            Found::Pick(Pick { column: index, unit, is_reversed, is_stated: stated.is_some(), guessed_because })
        }
        None => {
            let in_what = match written {
                Some(written) if said.is_some() => {
                    format!("in `{written}`, which is not known here")
                }
                _ => String::from(WITHOUT_UNIT),
            };
            let asks = format!("`{}` is the {} {in_what}", header[index], quantity.name());
            let question = Question::new(quantity, &header[index], asks);
            let likely = units::likely(plain, index, quantity).filter(|_| in_what == WITHOUT_UNIT);
            Found::Unclear(likely.into_iter().fold(question, Question::with_unit))
        }
    })
}

/// Which of several columns of one quantity is taken: the only one that moves, or of an electrical and an optical speed the
/// electrical one. Where none moves, one that has numbers; `None` where it is not clear.
fn choose_one(plain: &PlainTable<'_>, named: &[usize]) -> Option<usize> {
    let moving: Vec<usize> = named.iter().copied().filter(|column| moves(plain, *column)).collect();
    match moving[..] {
        [one] => Some(one),
        [] => named.iter().copied().find(|column| has_numbers(plain, *column)).or(named.first().copied()),
        _ => {
            let derived = moving.iter().copied().find(|column| is_electrical(&plain.table.header[*column]));
            // Of a motor's own speed no poles need to be known.
            let is_own = |column: &usize| {
                Said::from_column(plain, *column).and_then(|said| said.unit).is_some_and(|unit| !unit.is_electrical())
            };
            let own: Vec<usize> = moving.into_iter().filter(is_own).collect();
            derived.or_else(|| <[usize; 1]>::try_from(own).ok().map(|[own]| own))
        }
    }
}

/// Another column of a speed, in a unit that is known, that moves.
pub(super) fn other_speed(plain: &PlainTable<'_>, pick: Pick) -> Option<Pick> {
    let motor = Said::from_column(plain, pick.column).and_then(|said| said.motor);
    let of = |column| {
        let said = Said::from_column(plain, column)
            .filter(|said| said.quantity == Quantity::Speed && said.motor == motor && column != pick.column)?;
        let unit = said.unit.filter(|unit| !unit.is_electrical() && moves(plain, column))?;
        Some(Pick { column, unit, is_reversed: false, is_stated: false, guessed_because: None })
    };
    (0..plain.table.header.len()).find_map(of)
}

fn has_numbers(plain: &PlainTable<'_>, column: usize) -> bool {
    plain.table.first(|row| (!row.text(column).is_empty()).then_some(())).is_some()
}

/// Whether a column is anything but zero or blank.
pub(super) fn moves(plain: &PlainTable<'_>, column: usize) -> bool {
    let is_zero = |text: &str| text.is_empty() || text.parse().is_ok_and(|value: f64| value == 0.0);
    plain.table.first(|row| (!is_zero(row.text(column))).then_some(())).is_some()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::import::ColumnChoice;

    fn text(header: &str) -> String {
        format!("{header}\n{}\n", vec!["0.5"; header.split(',').count()].join(","))
    }

    fn plain(text: &str) -> PlainTable<'_> {
        PlainTable::parse(Path::new("log.csv"), text).unwrap()
    }

    fn picked(header: &str, choices: &[&str]) -> Result<Vec<String>, ImportError> {
        let text = text(header);
        let plain = plain(&text);
        let choices: Vec<ColumnChoice> = choices.iter().map(|choice| choice.parse().unwrap()).collect();
        let mut list = ColumnList::new(&plain.table, &[]);
        let options = ImportOptions { columns: choices, ..ImportOptions::default() };
        let picks = Picks::choose(&plain, &options, &mut list)?;
        let show = |pick: Pick| {
            let sign = if pick.is_reversed { "-" } else { "" };
            format!("{} {}: {sign}{}", pick.unit.quantity.name(), plain.table.header[pick.column], pick.unit.name)
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
    fn all_that_is_not_said_is_asked_at_once() {
        let error = picked("t,esc_us,load", &[]).unwrap_err();
        let help = miette::Diagnostic::help(&error).unwrap().to_string();
        let message = error.to_string();
        assert!(message.contains("log.csv, line 1: `t` is the time without a unit; no column is known"), "{message}");
        for part in [
            "`t`, `esc_us`, `load`",
            "--column time=t:UNIT --column thrust=HEADER:UNIT",
            "time in s, ms, us, ns or clock (hh:mm:ss)",
        ] {
            assert!(help.contains(part), "{help}");
        }
        for (header, parts) in [
            ("time_s,time_ms,pwm_us,rpm", ["`time_s` and `time_ms` are both called time", "--column time=time_s:UNIT"]),
            ("time_s,command,thrust", ["`thrust` is the thrust without a unit", "--excitation KIND"]),
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
