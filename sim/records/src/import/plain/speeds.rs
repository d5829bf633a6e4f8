//! Which of two columns of a speed is the rotor's, and what is to be said of two that differ.
//!
//! Thrust goes with the square of the speed, whatever the unit of either and whatever the number of poles that a stand is set to. Of
//! two speeds one that keeps to that over the levels of the command is taken in place of one that does not: an electrical speed is lost
//! where the motor's voltage shows none, an optical one where its mark does not. Without a thrust, a speed that falls while the
//! command and the other speed rise is not taken.

use rotorlead_numerics::sample::median;

use super::columns::{Pick, other_speed};
use super::layout::PlainTable;
use super::names::is_electrical;
use super::questions::option;
use crate::import::quantity::Quantity;
use crate::import::table::CellFormat;

/// Share of the greatest speed by which two sensors of it may differ. Chosen: what levels of one command scatter by.
const OTHER_SPEED: f64 = 0.05;
/// Levels of the command that are kept apart. Chosen: a staircase has some ten.
const LEVELS: usize = 20;
/// Readings of which a level's median is known. Chosen: what the step to it takes is less than half of more.
const LEAST_READINGS: usize = 5;
/// Levels that a comparison needs. Derived: of two, no one says which of them is the odd one.
const LEAST_LEVELS: usize = 3;
/// A speed is lost where it reads less than half of what the other does, both against their usual ratio. Derived: thrust over the square
/// of the speed is then off by a factor of four more.
const LOST: f64 = 4.0;
/// A ratio of speeds is one of pole pairs within this. Derived: half the least distance of two ratios of up to [`MOST_PAIRS`] pairs, `1
/// / (14 * 13)`, is 0.0027.
const SAME_RATIO: f64 = 0.0025;
/// Pole pairs that a motor of a multicopter has at the most. Standard: 28 magnets.
const MOST_PAIRS: u32 = 14;

/// What was measured at one level of the command: medians.
struct Level {
    thrust: Option<f64>,
    one: f64,
    other: f64,
}

/// A column as it is in the table, in whatever unit: ratios are looked at alone.
#[derive(Clone, Copy)]
pub(super) struct Beside {
    pub(super) command: Pick,
    pub(super) thrust: Option<Pick>,
}

/// Whether `other` is the rotor's speed, and `one` is not.
pub(super) fn is_lost(plain: &PlainTable<'_>, one: usize, other: usize, beside: Beside) -> bool {
    let levels = levels(plain, one, other, beside);
    // How far thrust over the square of the speed strays from its median, as a factor.
    let strays = |speed: fn(&Level) -> f64| {
        let turns = |level: &&Level| level.one > 0.0 || level.other > 0.0;
        let pulls = levels.iter().filter(turns).filter_map(|level| {
            let thrust = level.thrust.filter(|thrust| *thrust > 0.0)?;
            Some((thrust / speed(level).max(f64::MIN_POSITIVE).powi(2)).min(f64::MAX).ln())
        });
        let pulls: Vec<f64> = pulls.collect();
        let middle = median(pulls.iter().copied()).filter(|_| pulls.len() >= LEAST_LEVELS)?;
        Some(pulls.iter().fold(0.0, |most: f64, pull| most.max((pull - middle).abs())))
    };
    let (of_one, of_other) = (strays(|level| level.one), strays(|level| level.other));
    if let (Some(one), Some(other)) = (of_one, of_other)
        && (one - other).abs() > LOST.ln()
    {
        return one > other;
    }
    let falls = |speed: fn(&Level) -> f64| {
        let most = levels.iter().map(speed).fold(0.0, f64::max);
        levels.windows(2).filter(|pair| speed(&pair[0]) - speed(&pair[1]) > OTHER_SPEED * most).count()
    };
    falls(|level| level.one) > falls(|level| level.other)
}

/// The levels of the command, from the lowest up.
fn levels(plain: &PlainTable<'_>, one: usize, other: usize, beside: Beside) -> Vec<Level> {
    let wanted =
        [(beside.command.column, beside.command.reading()), (one, CellFormat::Decimal), (other, CellFormat::Decimal)];
    let thrust = beside.thrust.map(|pick| (pick.column, pick.reading()));
    let wanted: Vec<_> = wanted.into_iter().chain(thrust).collect();
    let Ok(numbers) = plain.table.numbers(&wanted) else { return Vec::new() };
    let command = &numbers[0];
    let least = command.iter().copied().fold(f64::INFINITY, f64::min);
    let most = command.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let level_of =
        |row: usize| (LEVELS as f64 * (command[row] - least) / (most - least)).min(LEVELS as f64 - 1.0) as usize;
    let mut rows = vec![Vec::new(); LEVELS];
    let is_whole = |row: &usize| numbers[..3].iter().all(|values| !values[*row].is_nan());
    (0..command.len()).filter(is_whole).for_each(|row| rows[level_of(row)].push(row));
    let sign = if beside.thrust.is_some_and(|pick| pick.is_reversed) { -1.0 } else { 1.0 };
    let level = |rows: &Vec<usize>| {
        let median = |column: usize| {
            let values = rows.iter().map(|row| numbers[column][*row]).filter(|value| !value.is_nan());
            median(values).filter(|_| rows.len() >= LEAST_READINGS)
        };
        let thrust = (numbers.len() > 3).then(|| median(3)).flatten().map(|thrust| sign * thrust);
        Some(Level { thrust, one: median(1)?.abs(), other: median(2)?.abs() })
    };
    rows.iter().filter_map(level).collect()
}

/// What is to be said of a speed that is not the other one beside it.
pub(super) fn differing(plain: &PlainTable<'_>, taken: Pick, beside: Option<Beside>) -> Option<String> {
    let other = other_speed(plain, taken)?;
    let numbers = plain.table.numbers(&[taken, other].map(|pick| (pick.column, pick.reading()))).ok()?;
    let in_rpm = |pick: Pick, values: &[f64]| values.iter().map(|value| pick.converted(*value)).collect::<Vec<f64>>();
    let (one, two) = (in_rpm(taken, &numbers[0]), in_rpm(other, &numbers[1]));
    let most = two.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let differ = one.iter().zip(&two).filter(|(a, b)| (*a - *b).abs() > OTHER_SPEED * most).count();
    let [name, other_name] = [taken, other].map(|pick| &plain.table.header[pick.column]);
    let fast = one.iter().zip(&two).filter(|(_, b)| b.abs() > most / 2.0).map(|(a, b)| (a / b).abs());
    let ratio = median(fast.filter(|ratio| ratio.is_finite()));
    let is_pairs = [name, other_name].into_iter().any(|name| is_electrical(name));
    let pairs = ratio.and_then(|ratio| ratio_of_counts(ratio.min(ratio.recip()), is_pairs)).unwrap_or_default();
    let is_lost = beside.is_some_and(|beside| is_lost(plain, other.column, taken.column, beside));
    let why = if is_lost {
        format!("; taken is `{name}`, which the thrust and the command agree with over all levels")
    } else {
        String::new()
    };
    (differ > 0).then(|| {
        format!(
            "`{name}` and `{other_name}` differ by more than {} % of full speed in {differ} of {} rows{why}: `{}` takes the other one{pairs}",
            100.0 * OTHER_SPEED,
            one.len(),
            option(Quantity::Speed, other_name, other.unit.name)
        )
    })
}

/// What is to be said of a ratio of two speeds, below one, that is one of small whole numbers: pairs of poles, or what an optical sensor
/// counts in a turn.
fn ratio_of_counts(ratio: f64, is_electrical: bool) -> Option<String> {
    let pairs = (1..=MOST_PAIRS).flat_map(|counted| (1..=MOST_PAIRS).map(move |set| (counted, set)));
    let is_it = |(counted, set): &(u32, u32)| {
        counted != set && (f64::from(*counted) / f64::from(*set) - ratio).abs() < SAME_RATIO
    };
    // The simplest.
    let (counted, set) = pairs.filter(is_it).min_by_key(|(counted, set)| counted + set)?;
    let check =
        if is_electrical { "the pole count" } else { "the number of poles, marks or blades that each was set to" };
    Some(format!(". The lower one is {ratio:.3} = {counted}/{set} of the other: check {check}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_of_pole_pairs_are_the_simplest_ones() {
        for (ratio, expected) in [(0.857, Some("6/7")), (0.5, Some("1/2")), (0.9165, Some("11/12"))] {
            let found = ratio_of_counts(ratio, true);
            assert_eq!(found.is_some(), expected.is_some());
            assert!(found.unwrap().contains(expected.unwrap()), "{ratio}");
        }
        assert_eq!(ratio_of_counts(1.0, true), None);
        assert_eq!(ratio_of_counts(0.97, true), None);
    }
}
