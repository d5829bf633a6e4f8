//! The ramps of a fleet's ESCs, side by side.

use std::collections::{BTreeMap, BTreeSet};

use rotorlead_answer::{ColumnSpec, Table, build_table};
use rotorlead_assess::fleet::{FEWEST_RAMPS, compare_ramps};
use serde::Serialize;
use serde_json::{Value, json};

use super::FleetRow;
use crate::{EscRampValues, RampValues};

/// The ramps of each motor's ESC; of none where no log was diagnosed.
pub(super) struct Ramps {
    motors: Vec<MotorRamp>,
    differ: bool,
}

#[derive(Serialize)]
struct MotorRamp {
    motor: String,
    #[serde(flatten)]
    ramp: EscRampValues,
    is_odd: bool,
    #[serde(skip)]
    is_diagnosed: bool,
}

impl Ramps {
    /// Of the logs that were diagnosed; of several logs of a motor what they say together.
    pub fn new(rows: &[FleetRow]) -> Self {
        let mut ramps: BTreeMap<&str, EscRampValues> = BTreeMap::new();
        for (motor, ramp) in rows.iter().filter_map(|row| Some((row.motor.as_str(), row.esc_ramp?))) {
            let known = ramps.entry(motor).or_insert(ramp);
            *known = EscRampValues { up: both(known.up, ramp.up), down: both(known.down, ramp.down) };
        }
        let ranges: Vec<_> = ramps.values().map(|ramp| [ramp.up.range(), ramp.down.range()]).collect();
        let compared = compare_ramps(&ranges);
        let of_motor = |motor: &str| {
            let place = ramps.keys().position(|diagnosed| *diagnosed == motor);
            MotorRamp {
                motor: motor.to_owned(),
                ramp: ramps.get(motor).copied().unwrap_or(EscRampValues::UNKNOWN),
                is_odd: place.is_some_and(|place| compared.is_odd[place]),
                is_diagnosed: place.is_some(),
            }
        };
        let all: BTreeSet<&str> = rows.iter().map(|row| row.motor.as_str()).collect();
        let motors = if ramps.is_empty() { Vec::new() } else { all.into_iter().map(of_motor).collect() };
        Self { motors, differ: compared.differ }
    }

    /// Which is the odd one; `None` where too few were diagnosed.
    pub fn sentence(&self) -> Option<String> {
        if self.motors.iter().filter(|motor| motor.is_diagnosed).count() < FEWEST_RAMPS {
            return None;
        }
        let odd: Vec<&MotorRamp> = self.motors.iter().filter(|motor| motor.is_odd).collect();
        let words =
            |one: &MotorRamp| format!("{}: {} up, {} down", one.motor, one.ramp.up.words(), one.ramp.down.words());
        Some(match &odd[..] {
            [] if self.differ => "ESC ramps: they differ, and none is the odd one.".to_owned(),
            [] => "ESC ramps: no two differ clearly.".to_owned(),
            [one] => format!("ESC ramps: the odd one is {}.", words(one)),
            several => {
                let several: Vec<String> = several.iter().map(|one| words(one)).collect();
                format!("ESC ramps: the odd ones are {}.", several.join("; "))
            }
        })
    }

    pub fn table(&self) -> Option<Table> {
        let columns = [
            ColumnSpec::words("motor", "motor", |one: &MotorRamp| one.motor.clone()),
            ColumnSpec::words("up", "up", |one: &MotorRamp| one.ramp.up.words()),
            ColumnSpec::words("down", "down", |one: &MotorRamp| one.ramp.down.words()),
            ColumnSpec::words("note", "", |one: &MotorRamp| {
                let note = match one {
                    MotorRamp { is_diagnosed: false, .. } => "not diagnosed",
                    MotorRamp { is_odd: true, .. } => "the odd one",
                    _ => "",
                };
                note.to_owned()
            }),
        ];
        let table = || build_table("fleet_esc_ramps", "Ramps of the ESCs, 95 % intervals", &columns, &self.motors);
        (!self.motors.is_empty()).then(table)
    }

    pub fn values(&self) -> Value {
        json!(self.motors)
    }
}

/// What two logs tell of one ramp: the narrower ends, and the rate of the one that knows one. Where they exclude each other, the wider ends
/// and no rate: it was changed.
fn both(one: RampValues, other: RampValues) -> RampValues {
    let end = |one: Option<f64>, other: Option<f64>, choose: fn(f64, f64) -> f64| match (one, other) {
        (Some(one), Some(other)) => Some(choose(one, other)),
        (known, None) | (None, known) => known,
    };
    let (low, high) = (one.range().0.max(other.range().0), one.range().1.min(other.range().1));
    if low > high {
        let wider = |one: Option<f64>, other: Option<f64>, choose: fn(f64, f64) -> f64| Some(choose(one?, other?));
        return RampValues {
            rate_percent_per_ms: None,
            low_percent_per_ms: wider(one.low_percent_per_ms, other.low_percent_per_ms, f64::min),
            high_percent_per_ms: wider(one.high_percent_per_ms, other.high_percent_per_ms, f64::max),
        };
    }
    RampValues {
        rate_percent_per_ms: one.rate_percent_per_ms.or(other.rate_percent_per_ms),
        low_percent_per_ms: end(one.low_percent_per_ms, other.low_percent_per_ms, f64::max),
        high_percent_per_ms: end(one.high_percent_per_ms, other.high_percent_per_ms, f64::min),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logs_that_exclude_each_other_leave_the_wider_ends() {
        let ramp = |rate, low, high| RampValues {
            rate_percent_per_ms: rate,
            low_percent_per_ms: low,
            high_percent_per_ms: high,
        };
        let (slow, none) = (ramp(Some(0.1), Some(0.098), Some(0.103)), ramp(None, Some(8.3), None));
        assert_eq!(both(slow, none), ramp(None, Some(0.098), None));
        let other = ramp(Some(0.101), Some(0.1), Some(0.104));
        assert_eq!(both(slow, other), ramp(Some(0.1), Some(0.1), Some(0.103)));
    }
}
