//! Tables of programs that are known by their columns, electrical speeds, and tables without times.

use std::fmt::Write as _;

use rotorlead_records::Excitation;
use rotorlead_records::import::{Import, ImportError, ImportOptions};

use crate::importing::{imported, message};

const ROWS: usize = 400;

/// A staircase of a command, 0..1, by rows.
fn level(row: usize) -> f64 {
    [0.2, 0.5, 0.8, 0.4][row / 100]
}

/// A table of `header`, and a row for each `cells`.
fn table(header: &str, separator: &str, cells: impl Fn(usize) -> Vec<f64>) -> String {
    let mut text = format!("{header}\n");
    for row in 0..ROWS {
        let cells: Vec<String> = cells(row).iter().map(f64::to_string).collect();
        writeln!(text, "{}", cells.join(separator)).unwrap();
    }
    text
}

fn taken(text: &str, options: &ImportOptions) -> Import {
    imported(text.as_bytes(), options).unwrap_or_else(|error| panic!("{error}"))
}

fn refused(text: &str, options: &ImportOptions) -> (ImportError, String) {
    let error = imported(text.as_bytes(), options).unwrap_err();
    let said = message(imported(text.as_bytes(), options));
    (error, said)
}

fn poles(motor_poles: u32) -> ImportOptions {
    ImportOptions { motor_poles: Some(motor_poles), ..ImportOptions::default() }
}

fn staircase() -> ImportOptions {
    ImportOptions { excitation: Some(Excitation::Staircase), ..ImportOptions::default() }
}

/// Whether the record has the levels, the speed at a row, and the times of a hundred rows a second.
fn check(import: &Import, format: &str, rpm_at_half: f64) {
    assert_eq!(import.summary.format.name, format);
    let record = &import.experiment.records[0];
    assert_eq!((record.excitation, record.time_s.len()), (Excitation::Staircase, ROWS));
    let speed = record.rpm.as_ref().unwrap();
    for row in [0, 150, 250, 399] {
        assert!((record.command[row] - level(row)).abs() < 1e-3, "{format}: {} in row {row}", record.command[row]);
        assert!((record.time_s[row] - 0.01 * row as f64).abs() < 1e-9, "{format}: {}", record.time_s[row]);
        let expected = rpm_at_half * level(row) / 0.5;
        assert!((speed[row] - expected).abs() < 1e-3 * rpm_at_half, "{format}: {} for {expected}", speed[row]);
    }
}

#[test]
fn an_electrical_speed_needs_the_number_of_poles() {
    for header in ["erpm", "eRPM", "ESC eRPM", "speed [erpm]", "motor_erpm"] {
        let text = table(&format!("time_s,duty (0..1),{header}"), ",", |row| {
            vec![0.01 * row as f64, level(row), 70_000.0 * level(row)]
        });
        let (error, said) = refused(&text, &staircase());
        assert!(said.contains(&format!("`{header}` is electrical")), "{said}");
        assert!(said.contains("--motor-poles N"), "{said}");
        assert_eq!(error.missing_options()[0].to_string(), "--motor-poles N");
        let found = taken(&text, &ImportOptions { motor_poles: Some(14), ..staircase() });
        check(&found, "plain", 5000.0);
        assert!(found.summary.is_electrical);
    }
}

#[test]
fn the_rotors_own_speed_goes_before_an_electrical_one() {
    let text = table("time_s,throttle_percent,erpm,rpm", ",", |row| {
        vec![0.01 * row as f64, 100.0 * level(row), 70_000.0 * level(row), 10_000.0 * level(row)]
    });
    check(&taken(&text, &staircase()), "plain", 5000.0);
}

#[test]
fn a_table_without_times_takes_a_rate() {
    let text = table("duty (0..1),rpm", ",", |row| vec![level(row), 10_000.0 * level(row)]);
    let (_, said) = refused(&text, &staircase());
    assert!(said.contains("--rate HZ"), "{said}");
    let with_rate = |rate_hz| ImportOptions { rate_hz: Some(rate_hz), ..staircase() };
    let found = taken(&text, &with_rate(100.0));
    check(&found, "plain", 5000.0);
    assert_eq!(found.experiment.sample_rate_hz, Some(100.0));
    // Times in no known unit are no times.
    let counted = table("time,duty (0..1),rpm", ",", |row| vec![row as f64, level(row), 10_000.0 * level(row)]);
    check(&taken(&counted, &with_rate(100.0)), "plain", 5000.0);
    // A row that is left out leaves a gap.
    let blank = text.replacen("\n0.2,2000\n0.2,2000\n", "\n0.2,2000\n0.2,\n", 1);
    let found = taken(&blank, &with_rate(100.0));
    let times = &found.experiment.records[0].time_s;
    assert_eq!((times[0], times[1], times.len(), found.experiment.sample_rate_hz), (0.0, 0.02, ROWS - 1, None));
    // Beside times it is one too many.
    let timed = table("time_s,duty (0..1),rpm", ",", |row| vec![0.01 * row as f64, level(row), 10_000.0 * level(row)]);
    let (_, said) = refused(&timed, &with_rate(100.0));
    assert!(said.contains("column `time_s`: has the times") && said.contains("leave --rate out"), "{said}");
}

/// The columns of VESC Tool up to the ones that are taken; the rest are as many.
const VESC: &str = "ms_today;input_voltage;temp_mos_max;temp_mos_1;temp_mos_2;temp_mos_3;temp_motor;current_motor;current_in;\
                    d_axis_current;q_axis_current;erpm;duty_cycle;amp_hours_used;fault_code;ms_today_setup;current_in_setup;";

#[test]
fn a_log_of_vesc_tool_is_taken() {
    let text = table(VESC, ";", |row| {
        let (u, zeros) = (level(row), vec![0.0; 4]);
        let front = vec![40_000_000.0 + 10.0 * row as f64, 24.0, 30.0, 30.0, 30.0, 30.0, 40.0, 12.0, 5.0 * u, 0.0, 0.0];
        [front, vec![140_000.0 * u, u], zeros].concat()
    });
    let (_, said) = refused(&text, &ImportOptions::default());
    assert!(said.contains("`erpm` is electrical") && said.contains("--motor-poles N"), "{said}");
    let found = taken(&text, &poles(28));
    check(&found, "vesc", 5000.0);
    let record = &found.experiment.records[0];
    assert_eq!((record.voltage_v.as_ref().unwrap()[0], record.current_a.as_ref().unwrap()[150]), (24.0, 2.5));
    assert!(found.summary.notes.iter().any(|note| note.contains("duty control alone")), "{:?}", found.summary.notes);
}

/// What `blackbox_decode` writes, with a blank behind each comma; motor 2 has its turn first.
fn decoded(command: impl Fn(f64) -> f64, second: impl Fn(usize) -> f64) -> String {
    let header =
        "loopIteration, time (us), axisP[0], vbatLatest (V), amperageLatest (A), motor[0], motor[1], eRPM[0], eRPM[1]";
    table(header, ", ", |row| {
        let u = level(row);
        vec![row as f64, 5e6 + 1e4 * row as f64, 0.0, 16.0, 3.0, command(u), second(row), 700.0 * u, 0.0]
    })
}

#[test]
fn a_decoded_blackbox_is_taken() {
    let dshot = |u: f64| (48.0 + 1999.0 * u).round();
    let text = decoded(dshot, |_| 48.0);
    let (_, said) = refused(&text, &ImportOptions::default());
    assert!(said.contains("`eRPM[0]` is electrical") && said.contains("--motor-poles N"), "{said}");
    check(&taken(&text, &poles(14)), "blackbox_csv", 5000.0);
    // No command of it is over 1024, but some are below what a pulse may be.
    let low = text.replace("1647", "1047");
    assert!(taken(&low, &poles(14)).summary.notes.iter().any(|note| note.contains("guessed to be dshot")));
    check(&taken(&decoded(|u| 1000.0 + 1000.0 * u, |_| 1000.0), &poles(14)), "blackbox_csv", 5000.0);
    // The headers that the log viewer writes above, and its names.
    let viewer = text.replacen("time (us)", "time", 1).replacen(" (V)", "", 1);
    let above = "\"Product\",\"Blackbox flight data recorder by Nicholas Sherlock\"\n\"motor_poles\",14\n\"rollPID\",\"45,80,30\"\n";
    check(&taken(&format!("{above}{viewer}"), &poles(14)), "blackbox_csv", 5000.0);
}

#[test]
fn a_decoded_flight_is_refused_and_another_motor_is_taken() {
    let dshot = |u: f64| (48.0 + 1999.0 * u).round();
    let flight = decoded(dshot, |row| 700.0 + 200.0 * ((row * row) as f64 * 0.37).sin().round());
    let (error, _) = refused(&flight, &poles(14));
    assert!(matches!(error, ImportError::Flight { motor: 1, .. }), "{error}");
    let text = decoded(dshot, |_| 48.0)
        .replace("motor[0], motor[1], eRPM[0], eRPM[1]", "motor[1], motor[0], eRPM[1], eRPM[0]");
    let second = ImportOptions { motor: Some(2), ..poles(14) };
    check(&taken(&text, &second), "blackbox_csv", 5000.0);
    // Motor 1 stands still, motor 2 is the only one that moves.
    let found = taken(&text, &poles(14));
    assert!(found.summary.notes.iter().any(|note| note.contains("taken is motor 2")), "{:?}", found.summary.notes);
    let (_, said) = refused(&text, &ImportOptions { motor: Some(5), ..poles(14) });
    assert!(said.contains("motor 5") && said.contains("1, 2"), "{said}");
}

#[test]
fn a_log_of_a_flight_stand_is_taken() {
    for (thrust, factor) in [("N", 1.0), ("kgf", 9.80665)] {
        for powertrain in [1, 2] {
            let header = format!(
                "Time (s),Powertrain {powertrain} - ESC throttle (μs),Powertrain {powertrain} - force Fz (thrust) ({thrust}),\
                 Powertrain {powertrain} - torque MZ (torque) (N⋅m),Powertrain {powertrain} - voltage (V),\
                 Powertrain {powertrain} - current (A),Powertrain {powertrain} - rotation speed (rpm),\
                 Powertrain {powertrain} - electrical power (W)"
            );
            let text = table(&header, ",", |row| {
                let u = level(row);
                vec![
                    0.01 * row as f64,
                    1000.0 + 1000.0 * u,
                    8.0 * u / factor,
                    0.1,
                    24.0,
                    10.0 * u,
                    10_000.0 * u,
                    240.0 * u,
                ]
            });
            let found = taken(&text, &ImportOptions::default());
            check(&found, "flight_stand", 5000.0);
            assert!((found.experiment.records[0].thrust_n.as_ref().unwrap()[150] - 4.0).abs() < 1e-9);
        }
    }
}

#[test]
fn a_stand_with_two_motors_gives_the_one_that_is_asked_for() {
    let header = "Time (s),ESC A (µs),ESC B (µs),Thrust A (N),Thrust B (N),Motor Optical Speed A (RPM),Motor Optical Speed B (RPM)";
    let text = table(header, ",", |row| {
        let u = level(row);
        vec![
            0.01 * row as f64,
            1000.0 + 1000.0 * u,
            2000.0 - 1000.0 * u,
            8.0 * u,
            1.0,
            10_000.0 * u,
            10_000.0 * (1.0 - u),
        ]
    });
    check(&taken(&text, &ImportOptions::default()), "rc_benchmark", 5000.0);
    let second = taken(&text, &ImportOptions { motor: Some(2), ..ImportOptions::default() });
    let record = &second.experiment.records[0];
    assert_eq!((record.command[0], record.rpm.as_ref().unwrap()[0]), (0.8, 8000.0));
}

#[test]
fn log_variables_of_a_crazyflie_are_taken() {
    let text = table("timestamp,motor.m1,motor.m2,rpm.m1,rpm.m2,pm.vbatMV", ",", |row| {
        let u = level(row);
        vec![123_456.0 + 10.0 * row as f64, (65_535.0 * u).round(), 0.0, 10_000.0 * u, 0.0, 3900.0]
    });
    let found = taken(&text, &ImportOptions::default());
    check(&found, "crazyflie", 5000.0);
    assert_eq!(found.experiment.records[0].voltage_v.as_ref().unwrap()[0], 3.9);
    // `rpm.m1` in any other table is the speed of its first motor.
    for header in
        ["time_ms,pwm_us,rpm.m1,rpm.m2", "time_ms,pwm_us,rpm_motor1,rpm_motor2", "time_ms,pwm_us,rpm[0],rpm[1]"]
    {
        let text = table(header, ",", |row| {
            let u = level(row);
            vec![10.0 * row as f64, 1000.0 + 1000.0 * u, 10_000.0 * u, 3.0]
        });
        check(&taken(&text, &staircase()), "plain", 5000.0);
    }
}

#[test]
fn speeds_that_no_rotor_has_are_left_out_and_counted() {
    let glitched = |rows: &[usize], value: f64| {
        table("time_s,duty (0..1),rpm,thrust (N)", ",", |row| {
            let rpm = if rows.contains(&row) { value } else { 10_000.0 * level(row) };
            vec![0.01 * row as f64, level(row), rpm, level(row)]
        })
    };
    // At a step, beside one another, and of either sign.
    for (rows, value) in [(&[100][..], 6_553_500.0), (&[50, 51, 52], 429_000.0), (&[7, 399], -1e9)] {
        for output in [None, Some(rotorlead_records::Output::Rpm)] {
            let found = taken(&glitched(rows, value), &ImportOptions { output, ..staircase() });
            let record = &found.experiment.records[0];
            assert_eq!((record.time_s.len(), found.summary.rows_taken), (ROWS - rows.len(), ROWS - rows.len()));
            assert!(record.rpm.as_ref().unwrap().iter().all(|rpm| (2000.0..=8000.0).contains(rpm)));
            let dropped = &found.summary.dropped[0];
            assert_eq!(dropped.rows, rows.len());
            assert!(dropped.reason.contains("over 200000 rpm"), "{}", dropped.reason);
        }
    }
    // The step at the row that is gone keeps its moment.
    let found = taken(&glitched(&[100], 1e7), &staircase());
    let log = found.experiment.records[0].command_log.as_ref().unwrap();
    assert!((log.time_s[log.last_change(1.01)] - 1.0).abs() < 1e-9);
    // So many are of another unit.
    let many: Vec<usize> = (200..300).collect();
    let (_, said) = refused(&glitched(&many, 300_000.0), &staircase());
    assert!(said.contains("line 202") && said.contains("more than 200000 rpm"), "{said}");
}

#[test]
fn refusals_list_what_the_log_has() {
    let text = table("time_s,duty (0..1),rpm,heat", ",", |row| vec![0.01 * row as f64, level(row), 5000.0, 20.0]);
    let columns = "`time_s`, `duty (0..1)`, `rpm`, `heat`";
    let thrust = ImportOptions { output: Some(rotorlead_records::Output::ThrustN), ..staircase() };
    let stated = |column: &str| ImportOptions { columns: vec![column.parse().unwrap()], ..staircase() };
    for (options, problem) in [
        (thrust, "no column was taken as thrust_n"),
        (stated("thrust=load:gf"), "there is no column `load`"),
        (stated("time=rpm:s"), "no column is known to be the"),
    ] {
        let (_, said) = refused(&text, &options);
        assert!(said.contains(columns) && said.contains(problem), "{said}");
    }
    let esc32 = "Timestamp,Duty,Speed\n2019-11-07 18:45:58:868,0,0\n";
    let (_, said) = refused(esc32, &ImportOptions::default());
    assert!(said.contains("`RPM` is missing") && said.contains("`Timestamp`, `Duty`, `Speed`"), "{said}");
}
