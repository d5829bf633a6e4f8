//! Times without the date and the hour: each is counted from the whole second, or the whole number, at which the first one is. Stamps since
//! 1970 stay such stamps, for the importer knows their unit by their size.
//!
//! Digits are moved and not computed: what stands behind the decimal mark stays as it is.

use jiff::civil::{DateTime, date};

use crate::import::esc32;
use crate::import::plain::SINCE_1970_S;
use crate::import::table::{Comma, seconds_since_midnight, without_unit};

/// Digits of a number that are computed with.
const MOST_DIGITS: usize = 36;
const DAY_S: i64 = 86_400;
/// The day on which clocks with a date begin in a copy.
const FIRST_DAY: DateTime = date(2000, 1, 1).at(0, 0, 0, 0);

/// The clock of a column.
pub(super) struct Clock {
    comma: Comma,
    origin: Option<Origin>,
}

/// Units of stamps since 1970, in each second.
const STAMPS_PER_S: [i128; 4] = [1, 1_000, 1_000_000, 1_000_000_000];

/// What is subtracted.
#[derive(Clone, Copy)]
enum Origin {
    Number {
        less: i128,
        /// The whole number that is left of the first.
        first: i128,
    },
    /// Seconds since midnight.
    Hour(i64),
    Date(DateTime),
}

impl Clock {
    pub(super) fn new(comma: Comma) -> Self {
        Self { comma, origin: None }
    }

    /// What was done to the times, behind the name of their column; `None` where nothing was.
    pub(super) fn change(&self) -> Option<String> {
        match self.origin? {
            Origin::Number { less: 0, .. } => None,
            Origin::Number { first, .. } => Some(format!("begins at {first}")),
            Origin::Hour(_) => Some(String::from("begins at 00:00:00, without a date")),
            Origin::Date(_) => Some(format!("begins at {}", FIRST_DAY.strftime("%Y-%m-%d %H:%M:%S"))),
        }
    }

    /// A time of this clock; `None` of text that is none.
    pub(super) fn shift(&mut self, text: &str) -> Option<String> {
        if let Some((moment, _)) = esc32::parse(text) {
            let origin = *self.origin.get_or_insert(Origin::Date(moment));
            let Origin::Date(first) = origin else { return None };
            let (_, fraction) = text.rsplit_once(':')?;
            let moment = FIRST_DAY.checked_add(moment.duration_since(first)).ok()?;
            return Some(format!("{}:{fraction}", moment.strftime("%Y-%m-%d %H:%M:%S")));
        }
        if let Some(seconds) = seconds_since_midnight(text) {
            let whole = seconds.floor() as i64;
            let origin = *self.origin.get_or_insert(Origin::Hour(whole));
            let Origin::Hour(first) = origin else { return None };
            let of_day = (whole - first).rem_euclid(DAY_S);
            let (hours, minutes, seconds) = (of_day / 3600, of_day / 60 % 60, of_day % 60);
            return Some(format!("{hours:02}:{minutes:02}:{seconds:02}{}", fraction_of_clock(text)));
        }
        let (number, unit) = without_unit(text);
        let rest = &text[number.len()..];
        debug_assert!(rest.trim() == unit);
        let grouped = || number.replace(',', "");
        let number = if self.comma == Comma::Thousands { grouped() } else { number.to_owned() };
        let decimal = Decimal::parse(&number)?;
        let origin = *self.origin.get_or_insert_with(|| Origin::number(decimal.whole()));
        let Origin::Number { less, .. } = origin else { return None };
        if less == 0 {
            return Some(text.to_owned());
        }
        Some(decimal.minus(less)? + rest)
    }
}

impl Origin {
    /// Of numbers the first of which is this: it becomes zero, or the earliest second that counts as one since 1970.
    fn number(first: i128) -> Self {
        let is_within = |per_s: &i128| SINCE_1970_S.contains(&(first as f64 / *per_s as f64));
        let kept = STAMPS_PER_S.into_iter().find(is_within).map_or(0, |per_s| *SINCE_1970_S.start() as i128 * per_s);
        Self::Number { less: first - kept, first: kept }
    }
}

/// What is behind the seconds of a clock: `.250`, or nothing.
fn fraction_of_clock(text: &str) -> &str {
    let time = text.rfind(':').map_or("", |last| &text[last + 1..]);
    let Some(mark) = time.find(['.', ',']) else { return "" };
    let end = time[mark + 1..].find(|c: char| !c.is_ascii_digit()).map_or(time.len(), |digits| mark + 1 + digits);
    &time[mark..end]
}

/// A number by its digits.
struct Decimal {
    /// All digits as one number.
    digits: i128,
    /// How many of them are behind the mark.
    decimals: u32,
    mark: Option<char>,
    /// What has an exponent is computed as a double.
    rounded: Option<f64>,
}

impl Decimal {
    fn parse(text: &str) -> Option<Self> {
        let rounded: Option<f64> = text.replacen(',', ".", 1).parse().ok().filter(|value: &f64| value.is_finite());
        let rounded = rounded?;
        let digits = text.trim_start_matches(['+', '-']);
        let (whole, fraction) = digits.split_once(['.', ',']).unwrap_or((digits, ""));
        let mark = digits.chars().find(|c| !c.is_ascii_digit());
        let all = format!("{whole}{fraction}");
        let is_plain = all.len() <= MOST_DIGITS && all.bytes().all(|byte| byte.is_ascii_digit());
        let sign = if text.starts_with('-') { -1 } else { 1 };
        Some(match all.parse::<i128>() {
            Ok(digits) if is_plain => {
                Self { digits: sign * digits, decimals: fraction.len() as u32, mark, rounded: None }
            }
            _ => Self { digits: 0, decimals: 0, mark: None, rounded: Some(rounded) },
        })
    }

    /// The digits in front of the mark.
    fn whole(&self) -> i128 {
        match self.rounded {
            Some(rounded) => rounded.trunc() as i128,
            None => self.digits / 10_i128.pow(self.decimals),
        }
    }

    /// The number less a whole one.
    fn minus(&self, whole: i128) -> Option<String> {
        if let Some(rounded) = self.rounded {
            return Some((rounded - whole as f64).to_string());
        }
        let one = 10_i128.pow(self.decimals);
        let left = self.digits.checked_sub(whole.checked_mul(one)?)?;
        let sign = if left < 0 { "-" } else { "" };
        let (front, behind) = (left.unsigned_abs() / one.unsigned_abs(), left.unsigned_abs() % one.unsigned_abs());
        Some(match self.mark {
            Some(mark) if self.decimals > 0 => {
                format!("{sign}{front}{mark}{behind:0width$}", width = self.decimals as usize)
            }
            _ => format!("{sign}{front}"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shifted(comma: Comma, times: &[&str]) -> Vec<String> {
        let mut clock = Clock::new(comma);
        times.iter().map(|time| clock.shift(time).unwrap_or_else(|| panic!("{time}"))).collect()
    }

    #[test]
    fn a_clock_begins_at_zero_and_keeps_its_digits() {
        for (times, expected) in [
            (["1573152358.250", "1573152360.0"], ["1000000000.250", "1000000002.0"]),
            (["1573152358250", "1573152358251"], ["1000000000000", "1000000000001"]),
            (["86400.250", "86402.0"], ["0.250", "2.0"]),
            (["0.0065", "1.5"], ["0.0065", "1.5"]),
            (["12.5", "11.25"], ["0.5", "-0.75"]),
            (["-3.5", "1"], ["-0.5", "4"]),
            (["100 ms", "101 ms"], ["0 ms", "1 ms"]),
            (["1.5e3", "1.501e3"], ["0", "1"]),
            (["23:59:59.9", "2026-11-23 00:00:01,25Z"], ["00:00:00.9", "00:00:02,25"]),
            (["2026-11-22 23:59:59", "2026-11-23T00:00:00+02:00"], ["00:00:00", "00:00:01"]),
            (
                ["2019-11-07 23:59:59:868", "2019-11-08 00:00:00:084"],
                ["2000-01-01 00:00:00:868", "2000-01-01 00:00:01:084"],
            ),
        ] {
            assert_eq!(shifted(Comma::Wrong, &times), expected);
        }
        assert_eq!(shifted(Comma::Decimal, &["86400,250", "86401,5"]), ["0,250", "1,5"]);
        assert_eq!(shifted(Comma::Thousands, &["1,573,152.5", "1,573,153.25"]), ["0.5", "1.25"]);
    }

    #[test]
    fn what_is_no_time_of_the_clock_is_refused() {
        let mut clock = Clock::new(Comma::Wrong);
        assert_eq!(clock.shift("at home"), None);
        assert_eq!(clock.shift("12:00:00"), Some("00:00:00".to_owned()));
        assert_eq!(clock.shift("12.5"), None);
        assert_eq!(clock.shift(""), None);
    }
}
