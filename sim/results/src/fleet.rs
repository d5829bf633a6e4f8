//! Many logs side by side.

mod ramps;

use rotorlead_answer::{Answer, ColumnSpec, Table, Tone, Unit, Verdict, build_table};
use rotorlead_assess::fleet::{Comparison, LogFileDeviation, MotorDeviation, relative_change};
use rotorlead_records::Output;
use serde_json::{Value, json};

use crate::EscRampValues;
use crate::json_object::json_object;
use crate::unit::unit;
use ramps::Ramps;

/// A log of the tables: what it is called, whose it is, when it was measured, and what else is to be said of it.
#[derive(Clone, Debug, PartialEq)]
pub struct FleetRow {
    /// Its folder.
    pub log: String,
    /// Its motor.
    pub motor: String,
    /// Its day; empty where nobody knows.
    pub date: String,
    /// Why it is not among those that are compared, or what a diagnosis found.
    pub note: String,
    /// The ramps of its ESC, where it was diagnosed.
    pub esc_ramp: Option<EscRampValues>,
}

/// A motor in its time constant and in its gain, as far as they are compared.
struct Motor<'a> {
    name: &'a str,
    found: [Option<&'a MotorDeviation>; 2],
}

/// A log likewise.
#[derive(Clone, Copy)]
struct RankedLog<'a> {
    row: &'a FleetRow,
    found: [Option<LogFileDeviation>; 2],
}

/// What is usual at a command.
struct UsualLevel {
    nominal: f64,
    time_constant_s: f64,
    gain: f64,
}

/// Motors and logs, by how far their time constants and gains are from the usual. `output` is the response of their models.
#[must_use]
pub fn fleet_answer(
    rows: &[FleetRow],
    time_constants: &Comparison,
    gains: &Comparison,
    output: Option<Output>,
) -> Answer {
    let both = [time_constants, gains];
    let levels = time_constants.levels.iter().zip(&gains.levels);
    let levels: Vec<UsualLevel> =
        levels.map(|(&(nominal, time_constant_s), &(_, gain))| UsualLevel { nominal, time_constant_s, gain }).collect();
    let motor = |name| Motor { name, found: both.map(|all| all.motors.get(name)) };
    let motors: Vec<Motor> = time_constants.motors.keys().map(|name| motor(name)).collect();
    let log = |(index, row)| RankedLog { row, found: both.map(|all| all.logs.get(index).copied().flatten()) };
    let logs: Vec<RankedLog> = rows.iter().enumerate().map(log).collect();
    let noted: Vec<RankedLog> = logs.iter().filter(|log| !log.note().is_empty()).copied().collect();
    let all_logs = Table {
        notes: vec![
            "A deviation is the mean, over the commands that logs share, of how far a log is from the median of all. A score is a \
             distance from the others in their standard deviations, taken from their medians; from 3.5 on it stands out. A drift \
             has its 95 % interval."
                .to_owned(),
        ],
        ..logs_table("fleet_logs", "Logs", &logs)
    };
    let noted =
        (!noted.is_empty()).then(|| logs_table("fleet_noted_logs", "Logs of which something is to be said", &noted));
    let ramps = Ramps::new(rows);
    let mut verdict = verdict(&motors, &logs);
    verdict.sentences.extend(ramps.sentence());
    Answer {
        name: "fleet",
        title: "The fleet",
        verdict,
        tables: [usual_table(&levels, output), motors_table(&motors)]
            .into_iter()
            .chain(ramps.table())
            .chain(noted)
            .chain([all_logs.in_detail()])
            .collect(),
        values: json_object(&json!({
            "levels": levels
                .iter()
                .map(|level| json!({"nominal": level.nominal, "time_constant_s": level.time_constant_s, "gain": level.gain}))
                .collect::<Value>(),
            "motors": motors.iter().map(Motor::json).collect::<Value>(),
            "esc_ramps": ramps.values(),
            "logs": logs.iter().map(RankedLog::json).collect::<Value>(),
        })),
        ..Answer::default()
    }
}

impl Motor<'_> {
    fn is_any(&self, wanted: fn(&MotorDeviation) -> bool) -> bool {
        self.found.into_iter().flatten().any(wanted)
    }

    fn note(&self) -> String {
        let of_quantity = |(found, what): (Option<&MotorDeviation>, &str)| {
            let found = found?;
            let said = [(found.stands_out(), "stands out"), (found.drifts, "drifts")];
            Some(said.map(|(is_so, word)| is_so.then(|| format!("{what} {word}"))))
        };
        let said = self.found.into_iter().zip(["tau", "gain"]).filter_map(of_quantity).flatten().flatten();
        said.collect::<Vec<_>>().join(", ")
    }

    /// Shares are of the usual value: 0.05 is 5 % more.
    fn json(&self) -> Value {
        let deviation = |found: &MotorDeviation| {
            json!({
                "share": relative_change(found.deviation),
                "score": found.score,
                "stands_out": found.stands_out(),
                "drift_share_per_month": found.drift.map(|drift| drift.per_month),
                "drift_interval": found.drift.map(|drift| drift.interval),
                "drift_p_value": found.drift.map(|drift| drift.p_value),
                "drifts": found.drifts,
            })
        };
        let [time_constant, gain] = self.found;
        json!({
            "motor": self.name,
            "logs": time_constant.map(|found| found.logs),
            "time_constant": time_constant.map(deviation),
            "gain": gain.map(deviation),
        })
    }
}

impl RankedLog<'_> {
    fn stands_out(&self) -> bool {
        self.found.iter().flatten().any(LogFileDeviation::stands_out)
    }

    fn note(&self) -> String {
        let quantities = self.found.iter().zip(["tau", "gain"]);
        let outlying = quantities.filter(|(found, _)| found.is_some_and(|found| found.stands_out()));
        let known = (!self.row.note.is_empty()).then(|| self.row.note.clone());
        outlying.map(|(_, what)| format!("{what} stands out")).chain(known).collect::<Vec<_>>().join(", ")
    }

    fn json(&self) -> Value {
        let known = |text: &str| (!text.is_empty()).then(|| text.to_owned());
        let [time_constant, gain] = self.found;
        json!({
            "log": self.row.log,
            "motor": self.row.motor,
            "date": known(&self.row.date),
            "time_constant_share": time_constant.map(|found| relative_change(found.deviation)),
            "time_constant_score": time_constant.and_then(|found| found.score),
            "gain_share": gain.map(|found| relative_change(found.deviation)),
            "gain_score": gain.and_then(|found| found.score),
            "stands_out": self.stands_out(),
            "note": known(&self.row.note),
        })
    }
}

fn verdict(motors: &[Motor], logs: &[RankedLog]) -> Verdict {
    let count = |count: usize, one: &str, many: &str| format!("{count} {}", if count == 1 { one } else { many });
    let outlying = motors.iter().filter(|motor| motor.is_any(MotorDeviation::stands_out)).count();
    let drifting = motors.iter().filter(|motor| motor.is_any(|found| found.drifts)).count();
    let outlying_logs = logs.iter().filter(|log| log.stands_out()).count();
    let missing = logs.iter().filter(|log| log.found[0].is_none()).count();
    let mut said = vec![
        format!(
            "{} of {}: {}, {}",
            count(logs.len(), "log", "logs"),
            count(motors.len(), "motor", "motors"),
            count(outlying, "motor stands out", "motors stand out"),
            count(drifting, "drifts", "drift")
        ),
        count(outlying_logs, "log stands out", "logs stand out"),
    ];
    said.extend((missing > 0).then(|| count(missing, "log was not compared", "logs were not compared")));
    let tone = if outlying + drifting + outlying_logs + missing > 0 { Tone::Attention } else { Tone::Good };
    Verdict::new(tone, format!("{}.", said.join("; ")))
}

/// What is usual at each command, of models of this response.
fn usual_table(levels: &[UsualLevel], output: Option<Output>) -> Table {
    let columns = [
        ColumnSpec::new("u_nom", "u_nom", Unit::DUTY, 3, |level: &UsualLevel| level.nominal),
        ColumnSpec::new("time_constant_ms", "tau", Unit::plain("ms"), 1, |level: &UsualLevel| {
            1e3 * level.time_constant_s
        }),
        ColumnSpec::new("gain", "gain", Unit::plain(output.map_or("", unit)), 2, |level: &UsualLevel| level.gain),
    ];
    build_table("fleet_usual", "What is usual: medians of all logs", &columns, levels)
}

/// Each motor against the others, and over time.
fn motors_table(motors: &[Motor]) -> Table {
    let of_quantity = |place: usize, heading: &str, [share, score, drift, low, high]: [&'static str; 5]| {
        let per_month = move |key, heading: String, unit, end: fn([f64; 3]) -> f64| {
            ColumnSpec::new(key, heading, unit, 1, move |motor: &Motor| {
                let drift = motor.found[place].and_then(|found| found.drift.as_ref());
                drift.map(|drift| 100.0 * end([drift.interval[0], drift.per_month, drift.interval[1]]))
            })
        };
        [
            ColumnSpec::new(share, heading, Unit::PERCENT, 1, move |motor: &Motor| {
                motor.found[place].map(|found| percent(found.deviation))
            }),
            ColumnSpec::new(score, "score", Unit::NONE, 1, move |motor: &Motor| {
                motor.found[place].and_then(|found| found.score)
            }),
            per_month(drift, format!("{heading} drift"), Unit::plain("%/month"), |[_, drift, _]| drift),
            per_month(low, "from".to_owned(), Unit::NONE, |[low, ..]| low),
            per_month(high, "to".to_owned(), Unit::NONE, |[.., high]| high),
        ]
    };
    let time_constant =
        ["time_constant_percent", "time_constant_score", "drift_percent_per_month", "drift_low", "drift_high"];
    let gain = ["gain_percent", "gain_score", "gain_drift_percent_per_month", "gain_drift_low", "gain_drift_high"];
    let mut columns = vec![
        ColumnSpec::words("motor", "motor", |motor: &Motor| motor.name.to_owned()),
        ColumnSpec::new("logs", "logs", Unit::NONE, 0, |motor: &Motor| motor.found[0].map(|found| found.logs as f64)),
    ];
    columns.extend(of_quantity(0, "tau", time_constant));
    columns.extend(of_quantity(1, "gain", gain));
    columns.push(ColumnSpec::words("note", "", Motor::note));
    build_table("fleet_motors", "Motors: how far from the usual, and how they change", &columns, motors)
}

/// Each log against the others of its motor.
fn logs_table(name: &str, which: &str, logs: &[RankedLog]) -> Table {
    let share = |key, heading: &str, place: usize| {
        ColumnSpec::new(key, heading, Unit::PERCENT, 1, move |log: &RankedLog| {
            log.found[place].map(|found| percent(found.deviation))
        })
    };
    let score = |key, place: usize| {
        ColumnSpec::new(key, "score", Unit::NONE, 1, move |log: &RankedLog| {
            log.found[place].and_then(|found| found.score)
        })
    };
    let columns = [
        ColumnSpec::words("log", "log", |log: &RankedLog| log.row.log.clone()),
        ColumnSpec::words("motor", "motor", |log: &RankedLog| log.row.motor.clone()),
        ColumnSpec::words("date", "date", |log: &RankedLog| log.row.date.clone()),
        share("time_constant_percent", "tau", 0),
        score("time_constant_score", 0),
        share("gain_percent", "gain", 1),
        score("gain_score", 1),
        ColumnSpec::words("note", "", RankedLog::note),
    ];
    let caption = format!("{which}: how far from the usual, with the score against the motor's other logs");
    build_table(name, caption, &columns, logs)
}

fn percent(logarithm: f64) -> f64 {
    100.0 * relative_change(logarithm)
}
