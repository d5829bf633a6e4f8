//! Units that a table does not state, as its numbers show them.

use rotorlead_numerics::sample::median;

use super::layout::PlainTable;
use super::names::Said;
use crate::import::quantity::{DSHOT, Quantity, Scale, Unit};
use crate::import::table::{CellFormat, seconds_since_midnight};

/// Above this a whole number from below [`LEAST_PULSE_US`] is one of DShot: percents end at 100, pulses of OneShot125 at 250, and
/// ten bits at 1023.
const MOST_OF_OTHERS: f64 = 1024.0;
/// A command in percent that stays below is one of a motor that hardly turns; numbers so small are of something else.
const LEAST_PERCENT: f64 = 10.0;
/// Pulses that an ESC of PWM takes are not shorter, microseconds.
const LEAST_PULSE_US: f64 = 800.0;
/// Pulse widths of PWM, microseconds. Standard.
const PULSES_US: (f64, f64) = (1000.0, 2000.0);
/// Nor longer, microseconds.
const MOST_PULSE_US: f64 = 2500.0;
/// Seconds from 1970 to a date of a log. Chosen: 2001 to 2096.
pub(in crate::import) const SINCE_1970_S: std::ops::RangeInclusive<f64> = 1e9..=4e9;
/// Rows are no further apart, seconds. Derived: the next smaller unit, of a log that counts from its start, would have 1000 rows a second.
const SLOWEST_S: f64 = 1.0;
/// Rounding of whole numbers that were averaged.
const WHOLE: f64 = 1e-6;

/// The unit of a command or of a time that its numbers show, and what in them does; `None` where several fit.
pub(super) fn guessed(
    plain: &PlainTable<'_>,
    column: usize,
    quantity: Quantity,
    pulse_us: (f64, f64),
) -> Option<(Unit, &'static str)> {
    match quantity {
        Quantity::Command => guessed_command(plain, column, pulse_us),
        Quantity::Time => since_1970(plain, column),
        _ => None,
    }
}

/// The unit in which times are of this century, counted from 1970, with rows no slower than a log's.
fn since_1970(plain: &PlainTable<'_>, column: usize) -> Option<(Unit, &'static str)> {
    let [values] = &plain.table.numbers(&[(column, CellFormat::Decimal)]).ok()?[..] else { return None };
    let first = values.iter().copied().find(|value| !value.is_nan())?;
    let interval = median(values.windows(2).map(|pair| pair[1] - pair[0]).filter(|interval| *interval > 0.0))?;
    let is_it = |unit: &Unit| {
        let Scale::Ratio(times, over) = unit.scale else { return false };
        let in_s = |value: f64| value * times / over;
        SINCE_1970_S.contains(&in_s(first)) && in_s(interval) <= SLOWEST_S
    };
    let mut units = ["s", "ms", "us", "ns"].into_iter().filter_map(|name| Unit::named(Quantity::Time, name));
    units.find(is_it).map(|unit| (unit, "are times since 1970 in that"))
}

/// The only unit of a command that its numbers fit, and what shows that; none where several do. Pulse widths lie within
/// `pulse_us`. DShot numbers are whole ones that are no microseconds, since some are too small, and no percents or the like, since
/// some are too large.
fn guessed_command(plain: &PlainTable<'_>, column: usize, pulse_us: (f64, f64)) -> Option<(Unit, &'static str)> {
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
    Unit::named(Quantity::Command, name).map(|unit| (unit, because))
}

/// The count of so many bits that whole numbers of a command seem to be, which has to be confirmed: nothing but the largest of them shows
/// how large they may be. Not where they may be percents, pulse widths or numbers of DShot.
pub(super) fn likely(plain: &PlainTable<'_>, column: usize, quantity: Quantity) -> Option<Unit> {
    let [values] = &plain.table.numbers(&[(column, CellFormat::Decimal)]).ok()?[..] else { return None };
    let numbers = || values.iter().copied().filter(|value| !value.is_nan());
    let most = numbers().fold(0.0, f64::max);
    let is_count = quantity == Quantity::Command && numbers().all(|value| value >= 0.0 && value.fract() == 0.0);
    let name = match most {
        _ if !is_count => return None,
        // OneShot125 has pulses of 125 to 250 microseconds.
        most if most > 100.0 && most <= 255.0 && numbers().any(|value| value > 0.0 && value < 125.0) => "0..255",
        most if most > MOST_PULSE_US && most <= 4095.0 => "0..4095",
        most if most > 4095.0 && most <= 8191.0 => "0..8191",
        most if most > 8191.0 && most <= 65_535.0 => "0..65535",
        _ => return None,
    };
    Unit::named(quantity, name)
}

/// A column without a known name whose numbers increase from row to row, where there is one.
pub(super) fn increasing(plain: &PlainTable<'_>) -> Option<usize> {
    let increases = |column: &usize| {
        let numbers = plain.table.numbers(&[(*column, CellFormat::Decimal)]);
        numbers.is_ok_and(|numbers| numbers[0].len() > 1 && numbers[0].is_sorted_by(|a, b| a < b))
    };
    let unknown = |column: &usize| Said::from_column(plain, *column).is_none();
    let mut columns = (0..plain.table.header.len()).filter(unknown).filter(increases);
    let column = columns.next()?;
    columns.next().is_none().then_some(column)
}

/// The unit of a command in percent whose numbers are a fraction, and what shows that: a header is believed unless no motor could be as it
/// says. Derived: ESCs begin to turn a motor at 3 to 6 % of their range, so that a run below 1 % would be one of a motor that stands.
pub(super) fn fraction(plain: &PlainTable<'_>, column: usize, unit: Unit) -> Option<(Unit, &'static str)> {
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
pub(super) fn own_command(plain: &PlainTable<'_>, index: usize, quantity: Quantity) -> Option<Unit> {
    let has = |name: &str| plain.table.header.iter().any(|column| column == name);
    let is_own = has("time_s") && (has("thrust_n") || has("rpm")) && plain.table.header[index] == "command";
    (is_own && quantity == Quantity::Command).then(|| Unit::named(quantity, "duty")).flatten()
}

/// A time that is read off a clock says so in every row; numbers say nothing.
pub(super) fn shown_by_clock(plain: &PlainTable<'_>, column: usize, quantity: Quantity) -> Option<Unit> {
    let first_filled = || {
        plain.table.first(|row| {
            let text = row.text(column);
            (!text.is_empty()).then(|| seconds_since_midnight(text).is_some())
        })
    };
    let is_clock = quantity == Quantity::Time && first_filled() == Some(true);
    is_clock.then(|| Unit::named(quantity, "clock")).flatten()
}
