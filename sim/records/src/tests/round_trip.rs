use std::path::PathBuf;

use proptest::prelude::*;

use super::record;
use crate::CommandLog;
use crate::experiment::{Excitation, Experiment, Output, Record, Role};
use crate::files::OutputFolder;
use crate::files::testing::{Scratch, assert_report};

/// Numbers of every magnitude that a column takes, zeros and subnormals of both signs among them.
fn number() -> impl Strategy<Value = f64> {
    use proptest::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
    (POSITIVE | NEGATIVE | NORMAL | SUBNORMAL | ZERO)
        .prop_map(|value: f64| if value.abs() > 1e6 { value.recip() } else { value })
}

fn column(rows: usize) -> impl Strategy<Value = Option<Vec<f64>>> {
    prop::option::of(prop::collection::vec(number(), rows))
}

fn duties(rows: usize) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(0.0..=1.0, rows)
}

fn times() -> impl Strategy<Value = Vec<f64>> {
    (-1e6..1e6, prop::collection::vec(1e-4..0.5, 1..19)).prop_map(|(start, intervals)| {
        let mut time_s = vec![start];
        intervals.iter().for_each(|interval: &f64| time_s.push(time_s[time_s.len() - 1] + interval));
        time_s
    })
}

fn any_record() -> impl Strategy<Value = Record> {
    let excitation = prop::sample::select(vec![
        Excitation::Multisine,
        Excitation::Square,
        Excitation::Triangle,
        Excitation::Step,
        Excitation::Staircase,
        Excitation::Chirp,
        Excitation::Free,
    ]);
    let role = prop::option::of(prop::sample::select(vec![Role::Fit, Role::Validate]));
    let keys = (0.0..=1.0, excitation, 1e-4..1e5, prop::option::of(1e-6..=1.0), role);
    let columns = times().prop_flat_map(|time_s| {
        let rows = time_s.len();
        (
            Just(time_s),
            duties(rows),
            prop::collection::vec(number(), rows),
            column(rows),
            prop::option::of(duties(rows)),
            column(rows),
            column(rows),
            prop::option::of((2usize..5).prop_flat_map(duties)),
        )
    });
    (keys, columns).prop_map(|(keys, columns)| {
        let (nominal, excitation, period_s, amplitude, role) = keys;
        let (time_s, command, thrust_n, rpm, esc_command, voltage_v, current_a, own_command) = columns;
        let first_s = time_s[0];
        let command_log = own_command.map(|command| CommandLog {
            file: String::new(),
            time_s: (0..command.len()).map(|place| first_s + 0.1 * place as f64).collect(),
            command,
        });
        let command = command_log.as_ref().map_or(command, |log| log.at_rows(&time_s, excitation));
        Record {
            file: String::new(),
            nominal,
            excitation,
            period_s: Some(period_s),
            amplitude,
            compensated: false,
            compensator: None,
            role,
            time_s,
            command,
            command_log,
            thrust_n: Some(thrust_n),
            rpm,
            esc_command,
            voltage_v,
            current_a,
            setpoints: crate::Setpoints::default(),
        }
    })
}

fn any_experiment() -> impl Strategy<Value = Experiment> {
    let rate = || prop::option::of(1.0..4e4);
    let records = prop::collection::vec(any_record(), 1..4);
    (any::<String>(), rate(), rate(), records).prop_map(|(name, esc, command, mut records)| {
        for (index, record) in records.iter_mut().enumerate() {
            record.file = format!("runs/{index}.csv");
            if let Some(log) = &mut record.command_log {
                log.file = format!("runs/{index}_command.csv");
            }
        }
        Experiment {
            name,
            output: Output::ThrustN,
            sample_rate_hz: None,
            esc_frame_hz: esc,
            command_rate_hz: command,
            records,
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn an_experiment_comes_back_bit_for_bit(experiment in any_experiment()) {
        let scratch = Scratch::new();
        let folder = scratch.path().join("run");
        experiment.write(&folder).unwrap();
        let back = Experiment::read(&folder).unwrap();
        // `{:?}` tells zeros of both signs apart, which `==` does not.
        prop_assert_eq!(format!("{back:?}"), format!("{experiment:?}"));
        let files = experiment.files().unwrap();
        prop_assert_eq!(Experiment::checksum_in((&files).into()), Experiment::checksum(&folder));
        prop_assert_eq!(format!("{:?}", Experiment::from_files(&files).unwrap()), format!("{experiment:?}"));
        prop_assert_eq!(back, experiment);
    }

    #[test]
    fn no_text_makes_the_reader_panic(manifest in ".*", csv in "[-0-9e.,\"\n\r;a-z_ ]*") {
        let _ = super::read(&manifest, super::CSV);
        let _ = super::read(super::MANIFEST, &csv);
        let _ = super::read(super::MANIFEST, &format!("time_s,command,thrust_n\n{csv}"));
    }
}

fn experiment(record: Record) -> Experiment {
    Experiment {
        name: "run".to_owned(),
        output: Output::ThrustN,
        sample_rate_hz: None,
        esc_frame_hz: None,
        command_rate_hz: None,
        records: vec![record],
    }
}

#[test]
fn a_compensator_is_written_into_the_same_folder() {
    let scratch = Scratch::new();
    let path = scratch.path().join("run");
    let mut record = record(vec![0.0, 0.1]);
    record.compensated = true;
    record.compensator = Some(PathBuf::from("compensator.toml"));
    let experiment = experiment(record);
    let folder = OutputFolder::create(&path).unwrap();
    experiment.write_into(&folder).unwrap();
    folder.write("compensator.toml", b"format = 1").unwrap();
    folder.commit().unwrap();
    assert_eq!(Experiment::read(&path).unwrap(), experiment);
}

#[test]
fn what_reading_would_refuse_is_not_written() {
    type Spoil = fn(&mut Experiment);
    let spoils: [(Spoil, &[&str]); 9] = [
        (|e| e.records.clear(), &["experiment.toml", "no record"]),
        (|e| e.sample_rate_hz = Some(7.0), &["u050.csv", "`time_s`", "7 Hz", "correct the rate"]),
        (|e| e.esc_frame_hz = Some(0.0), &["experiment.toml", "`esc_frame_hz`", "above 0"]),
        (|e| e.output = Output::Rpm, &["u050.csv", "`rpm`", "missing", "set the experiment's"]),
        (|e| e.records[0].file = "../a".to_owned(), &["experiment.toml", "`../a`", "without `..`"]),
        (|e| e.records[0].command[1] = 2.0, &["u050.csv", "`command` 2", "outside 0 to 1"]),
        (|e| e.records[0].thrust_n = Some(vec![f64::NAN; 3]), &["u050.csv", "`thrust_n` 1", "finite"]),
        (|e| e.records[0].time_s[2] = 0.1, &["u050.csv", "`time_s` 3", "stands still"]),
        (|e| e.records[0].command.truncate(2), &["u050.csv", "`command`: 2 rows, but 3 times"]),
    ];
    for (spoil, parts) in spoils {
        let scratch = Scratch::new();
        let mut experiment = experiment(record(vec![0.0, 0.1, 0.2]));
        spoil(&mut experiment);
        let error = experiment.write(&scratch.path().join("run")).unwrap_err();
        assert_report(error, parts);
        assert!(scratch.names().is_empty());
    }
}

/// Prints its speed: `cargo test -p rotorlead-records --release --lib a_million_rows -- --nocapture`.
#[test]
fn a_million_rows_come_back_unchanged() {
    const ROWS: usize = 1_000_000;
    let scratch = Scratch::new();
    let folder = scratch.path().join("run");
    let mut record = record((0..ROWS).map(|k| k as f64 / 5000.0).collect());
    record.command = record.time_s.iter().map(|t| 0.5 + 0.05 * t.sin()).collect();
    record.thrust_n = Some(record.time_s.iter().map(|t| 6.0 * t.cos()).collect());
    let mut experiment = experiment(record);
    experiment.sample_rate_hz = Some(5000.0);
    let start = std::time::Instant::now();
    experiment.write(&folder).unwrap();
    let written = start.elapsed();
    let start = std::time::Instant::now();
    let back = Experiment::read(&folder).unwrap();
    let read = start.elapsed();
    assert!(back == experiment, "a number changed");
    let rate = |time: std::time::Duration| ROWS as f64 / time.as_secs_f64() / 1e6;
    println!("million rows per second: {:.2} written, {:.2} read", rate(written), rate(read));
}
