//! Units that are not those of the columns, by the size of the numbers.

use rotorlead_numerics::sample::{extent, mean, median};
use rotorlead_records::files::shown_to;
use rotorlead_records::{Output, Record, SLOWEST_ROWS_S};

use super::RecordFault;
use crate::rows::gaps::usual_interval_s;

/// Rates that loggers have, hertz. Chosen: from slow telemetry to a fast bench. Two units overlap by a factor of 2.5; the first is taken.
const RATES_HZ: std::ops::RangeInclusive<f64> = 20.0..=50_000.0;
/// Units of time that loggers write, and their parts in a second (SI prefixes).
const PARTS: [(&str, f64); 3] = [("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9)];
/// A command repeats when what differs is at most this share of what moves, in RMS... Chosen: after whole rows a command repeats but for
/// rounding, while two unrelated stretches of it differ by `sqrt(2)`.
const REPEATS: f64 = 0.05;
/// ...and does not from this share on. Chosen: times in seconds get the benefit of the doubt, four times as much as another unit.
const DIFFERS: f64 = 0.2;
/// A column around the nominal command, so near, is the command: a thrust of less than a newton might be there by chance only. Chosen:
/// twice what is another operating point, 0.01.
const SAME_DUTY: f64 = 0.02;
/// A rate is the stated one within this share. Chosen: units differ by a factor of a thousand, and quartz clocks by far less.
const SAME_RATE: f64 = 0.05;

/// Gains beyond these are no motor's with a propeller, newtons per unit of command. The low one is a propeller of 50 mm, the
/// high one lifts 25 kg by itself. Chosen: grams-force are found from 2.5 N on, `250 / 102`, kilograms-force up to 15 N, `1.5 * 9.8`.
const GAINS_N: (f64, f64) = (1.5, 250.0);
/// Thrust per electrical power, newtons per watt: 2 to 20 grams-force a watt, 0.02 to 0.2 N, are usual. Chosen: a factor of two and of four
/// beyond; grams-force are always found, kilograms-force below 10 and pounds-force below 4.5 grams-force a watt.
const THRUST_N_PER_W: (f64, f64) = (0.01, 0.8);
/// Electrical power of a motor that lifts, watts. Chosen: 0.02 to 0.2 N, below which a sensor's zero counts for as much as the thrust.
const LEAST_POWER_W: f64 = 1.0;
/// Rows of less than this share of the greatest power show no thrust per power. Chosen: what an ESC takes at rest is less, and there are
/// rows of half the greatest thrust from a third of its power on.
const LEAST_POWER: f64 = 0.1;
/// A command that stays below has been divided by 100 once too often. Derived: ESCs begin to turn a motor at 3 to 6 % of their range.
const MOST_OF_A_FRACTION: f64 = 0.01;
/// Gains beyond these are no motor's, revolutions per minute per unit of command. Chosen: revolutions per second are found up to 60 000
/// rpm, electrical ones of 7 pole pairs from 14 300 rpm on.
const GAINS_RPM: (f64, f64) = (1000.0, 100_000.0);

/// What a command outside 0 to 1 seems to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandUnit {
    /// 0 to 100.
    Percent,
    /// A pulse width around 1000 to 2000.
    Microseconds,
    /// A pulse width around 1 to 2.
    Milliseconds,
    /// DSHOT, 48 to 2047.
    Dshot,
    /// A duty that was divided by 100, as if it had been in percent.
    Divided,
}

impl CommandUnit {
    /// The end of a sentence about the command.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Percent => "so it seems to be in percent",
            Self::Microseconds => "so it seems to be a pulse width in microseconds",
            Self::Milliseconds => "so it seems to be a pulse width in milliseconds",
            Self::Dshot => "so it seems to be a DSHOT value",
            Self::Divided => "which turns no motor: it seems to be a fraction that was taken for percent",
        }
    }

    /// How to make a duty of it.
    pub(super) fn remedy(self) -> &'static str {
        match self {
            Self::Percent => "divide `command` by 100: it is a duty from 0 to 1",
            Self::Microseconds => {
                "write (command - low) / (high - low) with the ESC's pulse range, such as (command - 1000) / 1000"
            }
            Self::Milliseconds => {
                "write (command - low) / (high - low) with the ESC's pulse range, such as command - 1"
            }
            Self::Divided => {
                "multiply `command` by 100, or import the log with its command's unit stated, as in `--column 'command=HEADER:duty'`"
            }
            Self::Dshot => "write (command - 48) / 1999: DSHOT's 48 to 2047 are the duty from 0 to 1",
        }
    }

    /// Every unit, with what it reads from and to, and what it reads at a duty of 0 and of 1. Standard are servo pulses, 1 to 2 ms and
    /// 0.5 to 2.5 ms at most, and DSHOT's throttle values, 48 to 2047 of 11 bits.
    const READINGS: [(Self, [f64; 2], [f64; 2]); 4] = [
        (Self::Percent, [0.0, 100.0], [0.0, 100.0]),
        (Self::Milliseconds, [0.5, 2.5], [1.0, 2.0]),
        (Self::Microseconds, [500.0, 2500.0], [1000.0, 2000.0]),
        (Self::Dshot, [0.0, 2047.0], [48.0, 2047.0]),
    ];

    /// The unit in which a command that runs from `low` to `high` is nearest to its nominal duty; `None` where it fits in none.
    fn nearest(low: f64, high: f64, nominal: f64) -> Option<Self> {
        let fits = Self::READINGS.into_iter().filter(|(_, [least, most], _)| low >= *least && high <= *most);
        let off = |[zero, one]: [f64; 2]| ((low + high) / 2.0 - zero) / (one - zero) - nominal;
        fits.min_by(|a, b| off(a.2).abs().total_cmp(&off(b.2).abs())).map(|(unit, ..)| unit)
    }
}

/// What a response seems to be in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResponseUnit {
    /// Grams-force instead of newtons.
    Grams,
    /// Kilograms-force or pounds-force instead of newtons.
    Kilograms,
    /// Revolutions per second or radians per second instead of revolutions per minute.
    PerSecond,
    /// Electrical revolutions instead of the shaft's.
    Electrical,
}

impl ResponseUnit {
    pub(super) fn column(self) -> &'static str {
        match self {
            Self::Grams | Self::Kilograms => "thrust_n",
            Self::PerSecond | Self::Electrical => "rpm",
        }
    }

    /// In which unit such a column is.
    pub(super) fn unit(self) -> &'static str {
        match self {
            Self::Grams | Self::Kilograms => "newtons",
            Self::PerSecond | Self::Electrical => "revolutions of the rotor per minute",
        }
    }

    pub(super) fn remedy(self) -> &'static str {
        match self {
            Self::Grams => "where it is in grams-force, multiply `thrust_n` by 0.00980665",
            Self::Kilograms => {
                "multiply `thrust_n` by 9.80665 where it is in kilograms-force, by 4.44822 where it is in pounds-force, unless the \
                 motor is as small as that"
            }
            Self::PerSecond => {
                "multiply `rpm` by 60 where it is in revolutions per second, by 9.5493 where it is in rad/s"
            }
            Self::Electrical => {
                "where it is in electrical revolutions, divide `rpm` by the motor's pole pairs: half the number of its magnets"
            }
        }
    }
}

/// Whether `command` is in a unit other than a duty, or is the response.
pub(super) fn check_command_unit(record: &Record, output: Output) -> Option<RecordFault> {
    let (low, high) = extent(&record.command);
    if low >= 0.0 && high > low && high <= MOST_OF_A_FRACTION {
        let row = record.command.iter().position(|command| *command > 0.0)?;
        let unit = CommandUnit::Divided;
        return Some(RecordFault::CommandUnit { file: record.file.clone(), row: row + 1, low, high, unit });
    }
    let row = record.command.iter().position(|command| !(0.0..=1.0).contains(command))?;
    if record.response(output).is_some_and(|response| is_command(response, record.nominal)) {
        let (column, nominal) = (output.column(), record.nominal);
        return Some(RecordFault::Swapped { file: record.file.clone(), row: row + 1, low, high, column, nominal });
    }
    let unit = CommandUnit::nearest(low, high, record.nominal)?;
    Some(RecordFault::CommandUnit { file: record.file.clone(), row: row + 1, low, high, unit })
}

/// Whether a column that should be the response is a duty around the nominal command, and moves.
fn is_command(response: &[f64], nominal: f64) -> bool {
    let (low, high) = extent(response);
    let mean = mean(response);
    low >= 0.0 && high <= 1.0 && low < high && (mean - nominal).abs() <= SAME_DUTY
}

/// Whether `time_s` is in a unit other than seconds: by the rate that `experiment.toml` states, by the period after which the
/// command repeats, or by rows that no motor could be seen in.
pub(super) fn check_time_unit(record: &Record, stated_hz: Option<f64>) -> Option<RecordFault> {
    let interval = usual_interval_s(&record.time_s)?;
    let fault = |(unit, factor): (&'static str, f64), reason: String| {
        // To nine digits behind the point, as many as it is printed with.
        let interval = (interval * 1e9).round() / 1e9;
        RecordFault::TimeUnit { file: record.file.clone(), interval, reason, unit, factor }
    };
    if let Some(stated_hz) = stated_hz {
        let is_stated = |factor: f64| (interval * stated_hz / factor - 1.0).abs() < SAME_RATE;
        if is_stated(1.0) {
            return None;
        }
        if let Some(&unit) = PARTS.iter().find(|(_, factor)| is_stated(*factor)) {
            return Some(fault(unit, format!("and `sample_rate_hz` is {stated_hz}")));
        }
    }
    if let Some(period_s) = record.period_s.filter(|_| record.excitation.is_periodic()) {
        let change = |factor: f64| change_after(&record.command, period_s * factor / interval);
        let in_seconds = change(1.0);
        if in_seconds.is_some_and(|change| change <= DIFFERS) {
            return None;
        }
        let repeats = |factor: f64| change(factor).is_some_and(|change| change < REPEATS);
        if let Some(&unit) = PARTS.iter().find(|(_, factor)| repeats(*factor)) {
            let rows = (period_s * unit.1 / interval).round();
            return Some(fault(unit, format!("and the period of {period_s} s is one of {rows} rows")));
        }
    }
    if interval < SLOWEST_ROWS_S {
        return None;
    }
    let unit = *PARTS.iter().find(|(_, factor)| RATES_HZ.contains(&(factor / interval)))?;
    Some(fault(unit, String::from("which is slower than any motor")))
}

/// By how much a command differs from itself so many rows later, relative to how much it moves; `None` where the record is
/// too short to tell. Chosen: at least four rows to a period, and a third of the record to compare.
fn change_after(command: &[f64], rows: f64) -> Option<f64> {
    let rows = rows.round();
    if !(4.0..command.len() as f64 * 0.67).contains(&rows) {
        return None;
    }
    let mean = mean(command);
    let moves = command.iter().map(|command| (command - mean).powi(2)).sum::<f64>() / command.len() as f64;
    let later = &command[rows as usize..];
    let differs = command.iter().zip(later).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / later.len() as f64;
    (moves > 0.0).then(|| (differs / moves).sqrt())
}

/// Whether the response is in a unit other than its column's; `gain` is its rough static gain, where it is known.
pub(super) fn check_response_unit(
    record: &Record,
    output: Output,
    response: &[f64],
    gain: Option<f64>,
) -> Option<RecordFault> {
    let fault = |unit, evidence| Some(RecordFault::ResponseUnit { file: record.file.clone(), evidence, unit });
    if output == Output::ThrustN
        && let Some(n_per_w) = thrust_per_power(record, response)
    {
        let evidence = format!("{} N for a watt of electrical power", shown_to(n_per_w, 3));
        return match n_per_w {
            n_per_w if n_per_w > THRUST_N_PER_W.1 => fault(ResponseUnit::Grams, evidence),
            n_per_w if n_per_w < THRUST_N_PER_W.0 => fault(ResponseUnit::Kilograms, evidence),
            _ => None,
        };
    }
    let ((low, high), units, name) = match output {
        Output::ThrustN => (GAINS_N, (ResponseUnit::Kilograms, ResponseUnit::Grams), "N"),
        Output::Rpm => (GAINS_RPM, (ResponseUnit::PerSecond, ResponseUnit::Electrical), "rpm"),
    };
    let gain = gain?;
    let evidence = format!("full command would change it by some {} {name}", shown_to(gain, 2));
    match gain {
        gain if gain > high => fault(units.1, evidence),
        gain if gain < low => fault(units.0, evidence),
        _ => None,
    }
}

/// Median thrust over median electrical power of the rows in which the motor takes some, newtons per watt; `None` without voltage and
/// current, for a motor that idles, and for a thrust that has another zero.
fn thrust_per_power(record: &Record, response: &[f64]) -> Option<f64> {
    let (voltage, current) = (record.voltage_v.as_deref()?, record.current_a.as_deref()?);
    let powers = || voltage.iter().zip(current).map(|(volts, amperes)| volts * amperes);
    let least = (LEAST_POWER * powers().fold(0.0, f64::max)).max(LEAST_POWER_W);
    let (powers, thrusts): (Vec<f64>, Vec<f64>) =
        powers().zip(response.iter().copied()).filter(|(power, _)| *power >= least).unzip();
    let (power, thrust) = (median(powers)?, median(thrusts.iter().copied())?);
    thrusts.iter().all(|thrust| *thrust > 0.0).then(|| thrust / power)
}

#[cfg(test)]
mod tests {
    use rotorlead_records::import::{ImportOptions, import};

    use super::*;

    #[test]
    fn a_command_outside_its_range_is_told_by_its_numbers() {
        for (low, high, nominal, unit) in [
            (40.0, 60.0, 0.5, Some(CommandUnit::Percent)),
            (0.0, 100.0, 0.5, Some(CommandUnit::Percent)),
            (0.0, 2.0, 0.01, Some(CommandUnit::Percent)),
            (1.45, 1.55, 0.5, Some(CommandUnit::Milliseconds)),
            (1000.0, 1900.0, 0.45, Some(CommandUnit::Microseconds)),
            (1450.0, 1550.0, 0.5, Some(CommandUnit::Microseconds)),
            (948.0, 1147.0, 0.5, Some(CommandUnit::Dshot)),
            (48.0, 1047.0, 0.25, Some(CommandUnit::Dshot)),
            (0.0, 65535.0, 0.5, None),
            (-0.5, 1.5, 0.5, None),
        ] {
            assert_eq!(CommandUnit::nearest(low, high, nominal), unit, "{low}..{high}");
        }
    }

    #[test]
    fn power_tells_a_gram_from_a_newton_where_the_gain_cannot() {
        let rows = 100;
        let mut record = crate::testing::record(100.0, None, vec![0.5; rows], Vec::new());
        record.voltage_v = Some(vec![16.0; rows]);
        record.current_a = Some(vec![10.0; rows]);
        // 160 W lift about 10 N, which is 1020 gf or 1.02 kgf.
        for (thrust, unit) in [(10.0, None), (1020.0, Some(ResponseUnit::Grams)), (1.02, Some(ResponseUnit::Kilograms))]
        {
            let found = check_response_unit(&record, Output::ThrustN, &vec![thrust; rows], None);
            let found = found.map(|fault| match fault {
                RecordFault::ResponseUnit { unit, .. } => unit,
                other => panic!("{other}"),
            });
            assert_eq!(found, unit, "{thrust}");
        }
    }

    /// Rows of a motor of 50 kilograms-force, whose thrust in newtons is as large as that of a small one in grams-force.
    #[test]
    fn rows_at_rest_leave_the_power_to_judge_by() {
        let large = [(48.4, 97.3, 9.2), (118.3, 96.2, 22.9), (210.4, 94.9, 41.0), (444.8, 91.4, 90.3)];
        let small = [(48.4, 7.4, 0.9), (118.3, 7.3, 2.6), (210.4, 7.2, 5.5), (444.8, 7.0, 14.0)];
        // At rest nothing is taken, or what the electronics take, and the load cell is off its zero by a little.
        for (rest, current) in [(0.0, 0.0), (0.0, 0.05), (-0.4, 0.1), (0.3, 0.0)] {
            for (rows, expected) in [(large, false), (small, true)] {
                let rows: Vec<_> = [(rest, rows[0].1, current)].into_iter().chain(rows).collect();
                let thrust: Vec<f64> = rows.iter().map(|row| row.0).collect();
                let mut record = crate::testing::record(100.0, None, vec![0.5; rows.len()], Vec::new());
                record.voltage_v = Some(rows.iter().map(|row| row.1).collect());
                record.current_a = Some(rows.iter().map(|row| row.2).collect());
                let found = check_response_unit(&record, Output::ThrustN, &thrust, Some(600.0));
                let is_grams = matches!(found, Some(RecordFault::ResponseUnit { unit: ResponseUnit::Grams, .. }));
                assert_eq!(is_grams, expected, "{rest} N and {current} A at rest: {found:?}");
            }
        }
    }

    #[test]
    fn the_table_of_a_large_motor_is_in_newtons_as_it_says() {
        let Some(file) = rotorlead_records::shared_data::data("cases/newtons-called-grams/table.csv") else { return };
        let options =
            ImportOptions { excitation: Some(rotorlead_records::Excitation::Steady), ..ImportOptions::default() };
        let experiment = import(&file, &options).unwrap().experiment;
        let found = crate::check::check_record(&experiment, &experiment.records[0], false);
        assert!(found.iter().all(|finding| finding.topic != rotorlead_records::Topic::ResponseUnit), "{found:?}");
    }

    #[test]
    fn a_command_that_turns_no_motor_is_the_column_that_is_wrong() {
        for (levels, expected) in [
            ([0.0, 0.002, 0.005, 0.008], true),
            ([0.0015, 0.0018, 0.0015, 0.01], true),
            ([0.0, 0.02, 0.05, 0.08], false),
            ([0.5, 0.505, 0.495, 0.5], false),
            ([0.0, 0.0, 0.0, 0.0], false),
        ] {
            let record = crate::testing::record(100.0, None, levels.to_vec(), Vec::new());
            let found = check_command_unit(&record, Output::ThrustN);
            let is_it = matches!(found, Some(RecordFault::CommandUnit { unit: CommandUnit::Divided, .. }));
            assert_eq!(is_it, expected, "{levels:?}: {found:?}");
        }
    }
}
