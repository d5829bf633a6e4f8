//! Many logs side by side.

use rotorlead_answer::{Cell, Column, Section, Table};
use rotorlead_identify::fleet::{Comparison, MotorDeviation, share};
use rotorlead_records::Output;

use crate::unit::unit;

/// A log of the tables: what it is called, whose it is, when it was measured, and what else is to be said of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FleetRow {
    /// Its folder.
    pub log: String,
    /// Its motor.
    pub motor: String,
    /// Its day; empty where nobody knows.
    pub date: String,
    /// Why it is not among those that are compared, or what a diagnosis found.
    pub note: String,
}

/// Motors and logs, by how far their lags are from the usual.
#[must_use]
pub fn fleet_section(
    rows: &[FleetRow],
    time_constants: &Comparison,
    gains: &Comparison,
    output: Option<Output>,
) -> Section {
    let text = vec![
        "A deviation is the mean, over the commands that logs share, of how far a log is from the median of all. A score is a distance from \
         the others in their standard deviations, taken from their medians; from 3.5 on it stands out. A drift has its 95 % interval."
            .to_owned(),
    ];
    Section {
        text,
        tables: vec![
            usual_table(time_constants, gains, output),
            motors_table(time_constants, gains),
            logs_table(rows, time_constants, gains),
        ],
        ..Section::new("fleet", "The fleet")
    }
}

/// What is usual at each command, of models of this response.
#[must_use]
pub fn usual_table(time_constants: &Comparison, gains: &Comparison, output: Option<Output>) -> Table {
    let row = |(&(nominal, tau_s), &(_, gain)): (&(f64, f64), &(f64, f64))| {
        vec![Cell::number(nominal, 3), Cell::number(1e3 * tau_s, 1), Cell::number(gain, 2)]
    };
    Table {
        name: "fleet_usual".to_owned(),
        caption: "What is usual: medians of all logs".to_owned(),
        columns: vec![
            Column::new("u_nom", "u_nom", "duty"),
            Column::new("time_constant_ms", "tau", "ms"),
            Column::new("gain", "gain", output.map_or("", unit)),
        ],
        rows: time_constants.levels.iter().zip(&gains.levels).map(row).collect(),
        ..Table::default()
    }
}

/// Each motor against the others, and over time.
#[must_use]
pub fn motors_table(time_constants: &Comparison, gains: &Comparison) -> Table {
    let row = |(name, motor): (&String, &MotorDeviation)| {
        let gain = gains.motors.get(name);
        let [drift, low, high] = drift_percent(motor);
        let [gain_drift, gain_low, gain_high] =
            gain.map_or_else(|| [(); 3].map(|()| Cell::optional(None, 1)), drift_percent);
        let mut notes = Vec::new();
        for (stands_out, drifts, what) in [
            (motor.stands_out(), motor.drifts, "tau"),
            (gain.is_some_and(|gain| gain.stands_out()), gain.is_some_and(|gain| gain.drifts), "gain"),
        ] {
            notes.extend(stands_out.then(|| format!("{what} stands out")));
            notes.extend(drifts.then(|| format!("{what} drifts")));
        }
        vec![
            Cell::text(name),
            Cell::number(motor.logs as f64, 0),
            percent(Some(motor.deviation)),
            Cell::optional(motor.score, 1),
            drift,
            low,
            high,
            percent(gain.map(|gain| gain.deviation)),
            Cell::optional(gain.and_then(|gain| gain.score), 1),
            gain_drift,
            gain_low,
            gain_high,
            Cell::text(notes.join(", ")),
        ]
    };
    Table {
        name: "fleet_motors".to_owned(),
        caption: "Motors: how far from the usual, and how they change".to_owned(),
        columns: vec![
            Column::new("motor", "motor", ""),
            Column::new("logs", "logs", ""),
            Column::new("time_constant_percent", "tau", "%"),
            Column::new("time_constant_score", "score", ""),
            Column::new("drift_percent_per_month", "tau drift", "%/month"),
            Column::new("drift_low", "from", ""),
            Column::new("drift_high", "to", ""),
            Column::new("gain_percent", "gain", "%"),
            Column::new("gain_score", "score", ""),
            Column::new("gain_drift_percent_per_month", "gain drift", "%/month"),
            Column::new("gain_drift_low", "from", ""),
            Column::new("gain_drift_high", "to", ""),
            Column::new("note", "", ""),
        ],
        rows: time_constants.motors.iter().map(row).collect(),
        ..Table::default()
    }
}

/// Each log against the others of its motor.
#[must_use]
pub fn logs_table(rows: &[FleetRow], time_constants: &Comparison, gains: &Comparison) -> Table {
    let row = |(index, row): (usize, &FleetRow)| {
        let [tau, gain] = [time_constants, gains].map(|found| found.logs.get(index).copied().flatten());
        let mut notes: Vec<String> = [("tau", tau), ("gain", gain)]
            .into_iter()
            .filter(|(_, log)| log.is_some_and(|log| log.stands_out()))
            .map(|(what, _)| format!("{what} stands out"))
            .collect();
        notes.extend((!row.note.is_empty()).then(|| row.note.clone()));
        vec![
            Cell::text(&row.log),
            Cell::text(&row.motor),
            Cell::text(&row.date),
            percent(tau.map(|log| log.deviation)),
            Cell::optional(tau.and_then(|log| log.score), 1),
            percent(gain.map(|log| log.deviation)),
            Cell::optional(gain.and_then(|log| log.score), 1),
            Cell::text(notes.join(", ")),
        ]
    };
    Table {
        name: "fleet_logs".to_owned(),
        caption: "Logs: how far from the usual, with the score against the motor's other logs".to_owned(),
        columns: vec![
            Column::new("log", "log", ""),
            Column::new("motor", "motor", ""),
            Column::new("date", "date", ""),
            Column::new("time_constant_percent", "tau", "%"),
            Column::new("time_constant_score", "score", ""),
            Column::new("gain_percent", "gain", "%"),
            Column::new("gain_score", "score", ""),
            Column::new("note", "", ""),
        ],
        rows: rows.iter().enumerate().map(row).collect(),
        ..Table::default()
    }
}

/// A motor's drift with its interval, percent per month.
fn drift_percent(motor: &MotorDeviation) -> [Cell; 3] {
    let drift = motor.drift.as_ref();
    let shares = drift.map(|drift| [drift.per_month, drift.interval[0], drift.interval[1]]);
    [0, 1, 2].map(|place| Cell::optional(shares.map(|shares| 100.0 * shares[place]), 1))
}

fn percent(logarithm: Option<f64>) -> Cell {
    Cell::optional(logarithm.map(|logarithm| 100.0 * share(logarithm)), 1)
}
