//! The ramps of a fleet's ESCs, side by side.

use std::collections::BTreeMap;

use rotorlead_answer::{ColumnSpec, Table, build_table};
use rotorlead_assess::fleet::{FEWEST_RAMPS, odd_ramps};
use serde::Serialize;
use serde_json::{Value, json};

use super::FleetRow;
use crate::{EscRampValues, RampValues};

/// The ramps of each motor's ESC.
pub(super) struct Ramps {
    motors: Vec<MotorRamp>,
}

#[derive(Serialize)]
struct MotorRamp {
    motor: String,
    #[serde(flatten)]
    ramp: EscRampValues,
    is_odd: bool,
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
        let motors = ramps.into_iter().zip(odd_ramps(&ranges));
        let motors = motors.map(|((motor, ramp), is_odd)| MotorRamp { motor: motor.to_owned(), ramp, is_odd });
        Self { motors: motors.collect() }
    }

    /// Which is the odd one; `None` where too few were diagnosed.
    pub fn sentence(&self) -> Option<String> {
        if self.motors.len() < FEWEST_RAMPS {
            return None;
        }
        let odd: Vec<&MotorRamp> = self.motors.iter().filter(|motor| motor.is_odd).collect();
        let words =
            |one: &MotorRamp| format!("{}: {} up, {} down", one.motor, one.ramp.up.words(), one.ramp.down.words());
        Some(match &odd[..] {
            [] => "ESC ramps: no motor's is unlike the others'.".to_owned(),
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
            ColumnSpec::words(
                "note",
                "",
                |one: &MotorRamp| if one.is_odd { "the odd one".to_owned() } else { String::new() },
            ),
        ];
        let table = || build_table("fleet_esc_ramps", "Ramps of the ESCs, 95 % intervals", &columns, &self.motors);
        (!self.motors.is_empty()).then(table)
    }

    pub fn values(&self) -> Value {
        json!(self.motors)
    }
}

/// What two logs say of one ramp: the narrower ends, and the rate of the one that knows one.
fn both(one: RampValues, other: RampValues) -> RampValues {
    let end = |one: Option<f64>, other: Option<f64>, choose: fn(f64, f64) -> f64| match (one, other) {
        (Some(one), Some(other)) => Some(choose(one, other)),
        (known, None) | (None, known) => known,
    };
    RampValues {
        rate_percent_per_ms: one.rate_percent_per_ms.or(other.rate_percent_per_ms),
        low_percent_per_ms: end(one.low_percent_per_ms, other.low_percent_per_ms, f64::max),
        high_percent_per_ms: end(one.high_percent_per_ms, other.high_percent_per_ms, f64::min),
    }
}
