//! Which column of a plain table is what, by the names in its header and from what is stated.
//!
//! A name says a quantity and a unit: `time_ms`, `Thrust [g]`, `Throttle (%)`, `rpm`. One that says a quantity alone is not
//! taken. What numbers look like is looked at in two places: a command without a unit is taken in the only one that its numbers
//! fit, where there is one, and of several columns of one quantity one that never moves is not taken.

use super::format::Meaning;
use super::missing::{EXCITATIONS, MissingOption};
use super::plain_layout::PlainTable;
use super::quantity::{DSHOT, Quantity, Scale, Unit};
use super::summary::ColumnList;
use super::table::{CellFormat, seconds_since_midnight};
use super::{ImportError, ImportOptions, MOST_MOTORS, plain_speeds};
use crate::experiment::{Excitation, Output};
use crate::files::csv_rows::quoted;

/// Above this a whole number from below [`LEAST_PULSE_US`] is one of DShot: percents end at 100, pulses of OneShot125 at 250, and
/// ten bits at 1023.
const MOST_OF_OTHERS: f64 = 1024.0;
/// A command in percent that stays below is one of a motor that hardly turns; numbers so small are of something else.
const LEAST_PERCENT: f64 = 10.0;
/// Pulses that an ESC of PWM takes are not shorter, microseconds.
const LEAST_PULSE_US: f64 = 800.0;
/// Pulse widths of PWM, microseconds. Standard.
const PULSES_US: (f64, f64) = (1000.0, 2000.0);
/// Rounding of whole numbers that were averaged.
const WHOLE: f64 = 1e-6;

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
        let mut need = |found, asks: &str, quantity| match found {
            Found::Pick(pick) => Some(pick),
            Found::Unclear(question) => {
                questions.push(question);
                None
            }
            Found::Nothing => {
                unfit.push(quantity);
                questions.push(Question::new(quantity, "HEADER", format!("no column is known to be the {asks}")));
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
            found => need(found, "time", Quantity::Time),
        };
        let command = match options.without_command {
            true => None,
            false => need(of(Quantity::Command)?, "command", Quantity::Command),
        };
        let (thrust, speed) = match (of(Quantity::Thrust)?, of(Quantity::Speed)?) {
            (Found::Nothing, Found::Nothing) => {
                (need(Found::Nothing, "thrust, and none the rpm", Quantity::Thrust), None)
            }
            (Found::Nothing, speed) => (None, need(speed, "", Quantity::Speed)),
            (thrust, speed @ Found::Unclear(_)) if options.output == Some(Output::Rpm) => {
                (thrust.pick(), need(speed, "", Quantity::Speed))
            }
            (thrust, speed) => (need(thrust, "", Quantity::Thrust), speed.pick()),
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
        let beside = plain_speeds::Beside { command, thrust: self.thrust };
        let other =
            other_speed(plain, speed).filter(|other| plain_speeds::is_lost(plain, speed.column, other.column, beside));
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

/// What the names do not say, and the column that would be stated.
struct Question {
    quantity: Quantity,
    asks: String,
    /// `HEADER` where no column is known.
    header: String,
    /// The option that answers it.
    missing: MissingOption,
}

impl Question {
    fn new(quantity: Quantity, header: &str, asks: String) -> Self {
        let missing = MissingOption::column(quantity, header, "UNIT");
        Self { quantity, asks, header: header.to_owned(), missing }
    }

    /// How many poles the motor has whose electrical speed is in a column.
    fn poles(header: &str) -> Self {
        let asks = format!("`{}` is electrical, and turns once for each pair of poles", quoted(header));
        Self { missing: MissingOption::motor_poles(), ..Self::new(Quantity::Speed, header, asks) }
    }

    /// What the answer may be.
    fn answers(&self) -> String {
        match self.missing.name {
            "--column" => format!("{} in {}", self.quantity.name(), self.quantity.units()),
            name => format!("{name}: the magnets of the motor, as 14"),
        }
    }

    /// What else may be meant where a log has no such column.
    fn otherwise(&self) -> Option<&'static str> {
        let is_missing = self.header == "HEADER";
        match self.quantity {
            Quantity::Time if is_missing => Some(
                ". Where the rows are evenly spaced, `--rate HZ` says how many a second; where each is a steady point, \
                     `--excitation steady` needs no time",
            ),
            Quantity::Command if is_missing => Some(
                ". Where the command was logged apart, `rotorlead import --no-command` takes the log without it, and `rotorlead \
                 identify --align LOG` merges the two",
            ),
            _ => None,
        }
    }
}

/// `--column` as it is typed in a shell.
pub(super) fn option(quantity: Quantity, header: &str, unit: &str) -> String {
    MissingOption::column(quantity, header, unit).to_string()
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
pub(super) fn of_other_motors(plain: &PlainTable<'_>, quantity: Quantity, motor: usize) -> Vec<(usize, usize)> {
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
    let own = || own_command(plain, index, quantity).or_else(|| shown_by_clock(plain, index, quantity));
    let unit = stated.and_then(|choice| choice.unit).or(named).or_else(own);
    // A unit that is written and not known is another.
    let guess = || guessed(plain, index, quantity, options.pulse_range()).filter(|_| written.is_none());
    let contradicted = |unit: Unit| stated.is_none().then(|| fraction(plain, index, unit)).flatten();
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
                _ => String::from("without a unit"),
            };
            let asks = format!("`{}` is the {} {in_what}", header[index], quantity.name());
            Found::Unclear(Question::new(quantity, &header[index], asks))
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

/// Whether a name is that of a speed which a stand derives from the motor's voltage.
pub(super) fn is_electrical(name: &str) -> bool {
    split(name).0.starts_with("motor electrical speed")
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

/// The only unit of a command that its numbers fit, and what shows that; none where several do. Pulse widths lie within
/// `pulse_us`. DShot numbers are whole ones that are no microseconds, since some are too small, and no percents or the like, since
/// some are too large.
fn guessed(
    plain: &PlainTable<'_>,
    column: usize,
    quantity: Quantity,
    pulse_us: (f64, f64),
) -> Option<(Unit, &'static str)> {
    if quantity != Quantity::Command {
        return None;
    }
    let [values] = &plain.table.numbers(&[(column, CellFormat::Decimal)]).ok()?[..] else { return None };
    let numbers = || values.iter().copied().filter(|value| !value.is_nan());
    let (least, most) = (numbers().fold(f64::INFINITY, f64::min), numbers().fold(f64::NEG_INFINITY, f64::max));
    let least_above_zero = numbers().filter(|value| *value > 0.0).fold(f64::INFINITY, f64::min);
    let lie_within = |(low, high): (f64, f64)| low <= least && most <= high;
    let is_whole = |value: f64| (value - value.round()).abs() < WHOLE;
    let is_of_dshot = lie_within((0.0, DSHOT.1)) && numbers().all(is_whole);
    let goes_beyond_pulses = numbers().any(|value| value > 0.0 && !(PULSES_US.0..=PULSES_US.1).contains(&value));
    let (name, because) = if plain.dialect.is_dshot_or_pulse && is_of_dshot && goes_beyond_pulses {
        ("dshot", "are whole, up to 2047, and not all pulse widths")
    } else if lie_within((0.0, 1.0)) {
        ("duty", "lie within 0..1")
    } else if lie_within((0.0, 100.0)) && most > LEAST_PERCENT {
        ("percent", "lie within 0..100 and go above 10")
    } else if lie_within(pulse_us) {
        ("us", "are pulse widths from none to full command")
    } else if lie_within((0.0, DSHOT.1))
        && least_above_zero < LEAST_PULSE_US
        && most > MOST_OF_OTHERS
        && numbers().all(is_whole)
    {
        ("dshot", "are whole, begin below those of pulse widths and end above those of percents")
    } else {
        return None;
    };
    Unit::named(quantity, name).map(|unit| (unit, because))
}

/// The unit of a command in percent whose numbers are a fraction, and what shows that: a header is believed unless no motor could be as it
/// says. Derived: ESCs begin to turn a motor at 3 to 6 % of their range, so that a run below 1 % would be one of a motor that stands.
fn fraction(plain: &PlainTable<'_>, column: usize, unit: Unit) -> Option<(Unit, &'static str)> {
    if unit.quantity != Quantity::Command || unit.scale != Scale::Ratio(1.0, 100.0) {
        return None;
    }
    let [values] = &plain.table.numbers(&[(column, CellFormat::Decimal)]).ok()?[..] else { return None };
    let lies_within = |value: &f64| value.is_nan() || (0.0..=1.0).contains(value);
    let is_fraction = values.iter().all(lies_within) && values.iter().any(|value| *value > 0.0);
    let duty = Unit::named(unit.quantity, "duty").filter(|_| is_fraction)?;
    Some((duty, "lie within 0..1, and no motor turns at 1 percent or less"))
}

/// The column `command` beside those of a record, which is such a record's: a duty.
fn own_command(plain: &PlainTable<'_>, index: usize, quantity: Quantity) -> Option<Unit> {
    let has = |name: &str| plain.table.header.iter().any(|column| column == name);
    let is_own = has("time_s") && (has("thrust_n") || has("rpm")) && plain.table.header[index] == "command";
    (is_own && quantity == Quantity::Command).then(|| Unit::named(quantity, "duty")).flatten()
}

/// A time that is read off a clock says so in every row; numbers say nothing.
fn shown_by_clock(plain: &PlainTable<'_>, column: usize, quantity: Quantity) -> Option<Unit> {
    let first_filled = || {
        plain.table.first(|row| {
            let text = row.text(column);
            (!text.is_empty()).then(|| seconds_since_midnight(text).is_some())
        })
    };
    let is_clock = quantity == Quantity::Time && first_filled() == Some(true);
    is_clock.then(|| Unit::named(quantity, "clock")).flatten()
}

/// The error that asks all questions at once, and what drove the command with them where nothing says it.
fn ask(plain: &PlainTable<'_>, questions: &[Question], options: &ImportOptions) -> ImportError {
    let place = plain.header_line.map(|line| format!(", line {line}")).unwrap_or_default();
    let mut asks: Vec<&str> = questions.iter().map(|question| question.asks.as_str()).collect();
    let mut values: Vec<String> = questions.iter().map(Question::answers).collect();
    let mut missing: Vec<MissingOption> = questions.iter().map(|question| question.missing.clone()).collect();
    let is_driven = !options.without_command && plain.dialect.usual.is_none();
    if is_driven && options.excitation.is_none() {
        asks.push("nothing says what drove the command");
        values.push(format!("--excitation: {EXCITATIONS}"));
        missing.push(MissingOption::excitation());
    }
    ImportError::Unstated {
        file: plain.table.file.clone(),
        problem: format!("{place}: {}", asks.join("; ")),
        remedy: format!(
            "the columns are {}. Say {} with `{}` ({}){}",
            listed(plain),
            if missing.iter().any(|option| option.name == "--column") {
                "which is what, and in which unit,"
            } else {
                "it"
            },
            missing.iter().map(ToString::to_string).collect::<Vec<_>>().join(" "),
            values.join("; "),
            questions.iter().filter_map(Question::otherwise).collect::<String>()
        ),
        missing,
    }
}

/// The columns' names, for messages.
pub(super) fn listed(plain: &PlainTable<'_>) -> String {
    let names = plain.table.header.iter().enumerate().filter(|(_, name)| !name.is_empty());
    let shown = |(column, name): (usize, &String)| match plain.label(column) {
        Some(label) if !name.ends_with(label) => format!("`{}` (`{}`)", quoted(name), quoted(label)),
        _ => format!("`{}`", quoted(name)),
    };
    let mut columns = names.map(shown).take(MOST_LISTED).collect::<Vec<_>>().join(", ");
    if columns.is_empty() {
        columns.push_str("none");
    }
    let beside = plain.beside.iter().map(|beside| format!("`{}` ({})", quoted(&beside.name), beside.shown));
    let beside = beside.take(MOST_LISTED).collect::<Vec<_>>().join(", ");
    let more = if beside.is_empty() { "" } else { "; no columns are " };
    format!("{columns}{more}{beside}")
}

/// So many columns are listed: a log with more has them in no message.
pub(super) const MOST_LISTED: usize = 60;

/// What a name says.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Said {
    quantity: Quantity,
    unit: Option<Unit>,
    /// Which motor it is of, from 1, where it says that.
    motor: Option<usize>,
}

impl Said {
    fn from_column(plain: &PlainTable<'_>, index: usize) -> Option<Self> {
        let label = plain.label(index)?;
        let stated = || below(plain, index).or_else(|| behind_numbers(plain, index));
        let with_poles = |unit: Unit| unit.with_poles(plain.motor_poles);
        if let Some(Meaning { quantity, unit, motor }) = plain.dialect.meaning(label) {
            let stated = stated().and_then(|unit| Unit::named(quantity, &unit));
            return Some(Self {
                quantity,
                unit: stated.or_else(|| Unit::named(quantity, unit)).map(with_poles),
                motor,
            });
        }
        let (label, motor) = split_motor(label);
        let (base, in_name) = split(label);
        // `t` is the time, and `T` may be a torque or a temperature.
        if in_name.is_none() && label.trim() == "T" {
            return None;
        }
        // A unit of another quantity overrules the name: `esc_rpm` is no command.
        let of_unit = in_name.as_deref().and_then(Unit::measured_quantity);
        let named = Quantity::ALL.into_iter().find(|quantity| quantity.spellings().contains(&base.as_str()));
        let named = named.map(|named| of_unit.unwrap_or(named));
        // A unit may be a name of its own.
        let quantity = match named {
            Some(quantity) => quantity,
            None => in_name.as_deref().filter(|_| base.is_empty()).and_then(named_by_unit)?,
        };
        let written = in_name.or_else(stated);
        let unit = written.as_deref().and_then(|written| Unit::named(quantity, written));
        // `motor` alone may be anything of a motor.
        (quantity != Quantity::Speed || unit.is_some() || base.contains("speed") || base == "rpm").then_some(Self {
            quantity,
            unit: unit.map(with_poles),
            motor,
        })
    }
}

/// The quantity of a unit that is a name of its own.
fn named_by_unit(unit: &str) -> Option<Quantity> {
    match unit.to_lowercase().as_str() {
        "rpm" | "erpm" => Some(Quantity::Speed),
        "dshot" => Some(Quantity::Command),
        _ => None,
    }
}

/// The unit that is written in a column's name, below it, or behind its numbers.
fn written(plain: &PlainTable<'_>, index: usize) -> Option<String> {
    plain
        .label(index)
        .filter(|label| plain.dialect.meaning(label).is_none())
        .and_then(|label| split(split_motor(label).0).1)
        .or_else(|| below(plain, index))
        .or_else(|| behind_numbers(plain, index))
}

/// The unit behind its numbers.
fn behind_numbers(plain: &PlainTable<'_>, index: usize) -> Option<String> {
    Some(plain.table.unit_behind_numbers(index)).filter(|unit| !unit.is_empty())
}

/// The unit in the line of units.
fn below(plain: &PlainTable<'_>, index: usize) -> Option<String> {
    plain.units.get(index).filter(|unit| !unit.is_empty()).cloned()
}

/// A name without the number of a motor behind it, as in `rpm.m1`, `pwm_motor2` or `eRPM[0]`, which counts from 0; and that, from 1.
fn split_motor(name: &str) -> (&str, Option<usize>) {
    let name = name.trim();
    let number = |digits: &str, least: usize| {
        let is_short = !digits.is_empty() && digits.len() <= 2 && digits.bytes().all(|byte| byte.is_ascii_digit());
        digits.parse().ok().filter(|number| is_short && (least..=MOST_MOTORS).contains(number))
    };
    if let Some((rest, index)) = name.strip_suffix(']').and_then(|name| name.rsplit_once('['))
        && let Some(index) = number(index, 0).filter(|&index: &usize| index < MOST_MOTORS && !rest.is_empty())
    {
        return (rest, Some(index + 1));
    }
    if let Some((rest, last)) = name.rsplit_once([' ', '_', '.', '/'])
        && let Some(digits) = last.strip_prefix("motor").or_else(|| last.strip_prefix(['m', 'M']))
        && let Some(motor) = number(digits, 1).filter(|_| !rest.is_empty())
    {
        return (rest, Some(motor));
    }
    (name, None)
}

/// A name as words in small letters, and the unit behind them: in brackets, or as the last word where it is one.
fn split(name: &str) -> (String, Option<String>) {
    let name = name.trim();
    if let Some(open) = name.rfind(['(', '[']).filter(|_| name.ends_with([')', ']'])) {
        let unit = name[open + 1..name.len() - 1].trim();
        return (words(&name[..open]), Some(unit.to_owned()).filter(|unit| !unit.is_empty()));
    }
    // A unit may have a stroke of its own; else it separates, as in the name of a topic.
    for separators in [&[' ', '_', '-', '.', ','][..], &['/']] {
        let start = name.rfind(separators).map_or(0, |at| at + 1);
        let last = &name[start..];
        // `duty` is more often the name of a command than its unit.
        let is_unit = Unit::is_any(last) && !last.eq_ignore_ascii_case("duty");
        if is_unit && (start > 0 || named_by_unit(last).is_some()) {
            let base = words(&name[..start]);
            return (base.strip_suffix(" in").map(str::to_owned).unwrap_or(base), Some(last.to_owned()));
        }
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
    use crate::import::ColumnChoice;

    fn text(header: &str) -> String {
        format!("{header}\n{}\n", vec!["0.5"; header.split(',').count()].join(","))
    }

    fn plain(text: &str) -> PlainTable<'_> {
        PlainTable::parse(Path::new("log.csv"), text).unwrap()
    }

    /// What each name of a header is taken as.
    fn said(header: &str) -> Vec<Option<(&'static str, Option<&'static str>)>> {
        let text = text(header);
        let plain = plain(&text);
        let of = |index| {
            Said::from_column(&plain, index).map(|said| (said.quantity.name(), said.unit.map(|unit| unit.name)))
        };
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
            ("esc_rpm", ("rpm", "rpm")),
            ("ESC RPM", ("rpm", "rpm")),
            ("ESC speed [rad/s]", ("rpm", "rad/s")),
            ("pwm_mV", ("voltage", "mV")),
            ("/motor/rpm", ("rpm", "rpm")),
            ("speed_rad/s", ("rpm", "rad/s")),
            ("eRPM", ("rpm", "erpm")),
            ("motor_erpm", ("rpm", "erpm")),
            ("speed (eRPM)", ("rpm", "erpm")),
            ("eRPM[0]", ("rpm", "erpm")),
            ("rpm.m1", ("rpm", "rpm")),
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
        for name in ["ms", "load (g)", "torque_nm", "motor", "motor_temperature", "motor[0]", "x", "esc_command", "s"] {
            assert_eq!(said(&format!("{name},x"))[0], None, "{name}");
        }
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
    fn all_that_is_not_told_is_asked_at_once() {
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
