//! Random and pseudo-random commands are seen by themselves and give the lag that a chirp gives; ramps are refused with the reason.

use std::fmt::Write as _;
use std::path::Path;

use rand::{RngExt as _, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use rotorlead_identify::error::IdentifyError;
use rotorlead_identify::identification::{Identification, IdentifyOptions, identify};
use rotorlead_identify::lag::steps::StepsWarning;
use rotorlead_records::import::{Import, ImportOptions, import, import_bytes};
use rotorlead_records::shared_data::data;
use rotorlead_records::{Excitation, Experiment};

const ROW_S: f64 = 0.005;
const ROWS: usize = 6000;

/// A motor behind a dead time of whole rows.
struct Motor {
    time_constant_s: f64,
    delay_rows: usize,
    gain_rpm: f64,
    noise_rpm: f64,
}

/// A table of a motor that answers a command of each row.
fn table(motor: &Motor, seed: u64, command: &[f64]) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let noise = Normal::new(0.0, motor.noise_rpm).unwrap();
    let decay = (-ROW_S / motor.time_constant_s).exp();
    let (mut speed, mut text) = (command[0], String::from("time_s,duty (0..1),rpm\n"));
    for (row, u) in command.iter().enumerate() {
        let rpm = 2000.0 + motor.gain_rpm * speed + noise.sample(&mut rng);
        writeln!(text, "{},{u},{rpm}", ROW_S * row as f64).unwrap();
        let now = command[row.saturating_sub(motor.delay_rows)];
        speed = now + (speed - now) * decay;
    }
    text
}

fn imported(text: &str, excitation: Option<Excitation>) -> Experiment {
    let options = ImportOptions { excitation, ..ImportOptions::default() };
    import_bytes(Path::new("log.csv"), text.as_bytes(), &options).unwrap().experiment
}

fn identified(experiment: &Experiment) -> Result<Identification, IdentifyError> {
    identify(experiment, &IdentifyOptions::default())
}

#[track_caller]
fn assert_lag(experiment: &Experiment, tau_s: f64, dead_s: f64) {
    assert_eq!(experiment.records[0].excitation, Excitation::Random);
    let found = identified(experiment).unwrap();
    let point = &found.model.points[0];
    let (tau_std, dead_std) = (point.time_constant_s_std.unwrap(), 0.002 * tau_s + 0.0002);
    assert!(tau_std < 0.02 * tau_s, "{tau_std}");
    assert!((point.time_constant_s - tau_s).abs() < 4.0 * tau_std, "{} +- {tau_std}", point.time_constant_s);
    assert!((point.delay_s - dead_s).abs() < 4.0 * dead_std, "{:?}", point.delay_s);
}

#[test]
fn the_random_binary_command_of_the_case_gives_its_lag() {
    let Some(log) = data("cases/prbs-not-named/log.csv") else { return };
    let columns = vec!["command=command:duty".parse().unwrap()];
    let options = ImportOptions { columns, ..ImportOptions::default() };
    let Import { experiment, .. } = import(&log, &options).unwrap();
    let found = identified(&experiment).unwrap();
    let point = &found.model.points[0];
    let (tau_s, tau_std_s, dead_s) = (point.time_constant_s, point.time_constant_s_std.unwrap(), point.delay_s);
    assert!((tau_s - 0.060_14).abs() < 0.000_05 && (tau_std_s - 0.000_16).abs() < 0.000_02, "{tau_s} {tau_std_s}");
    assert!((dead_s - 0.009_952).abs() < 0.000_05, "{dead_s}");
}

#[test]
fn a_pseudo_random_binary_command() {
    // A shift register of ten, `x^10 + x^7 + 1`, at a tick of 40 ms.
    let mut register = 1_u32;
    let mut bit = || {
        let next = (register >> 9 ^ register >> 6) & 1;
        register = (register << 1 | next) & 0x3ff;
        next == 1
    };
    let command: Vec<f64> = (0..ROWS / 8).flat_map(|_| [if bit() { 0.65 } else { 0.55 }; 8]).collect();
    let motor = Motor { time_constant_s: 0.1, delay_rows: 4, gain_rpm: 12_000.0, noise_rpm: 30.0 };
    assert_lag(&imported(&table(&motor, 1, &command), None), 0.1, 0.02);
}

#[test]
fn a_command_of_random_levels_for_random_times() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut command = Vec::new();
    while command.len() < ROWS {
        let level = (1000.0 * (0.4 + 0.2 * rng.random::<f64>())).round() / 1000.0;
        command.extend(vec![level; rng.random_range(6..40)]);
    }
    let motor = Motor { time_constant_s: 0.035, delay_rows: 0, gain_rpm: 9000.0, noise_rpm: 15.0 };
    assert_lag(&imported(&table(&motor, 2, &command), None), 0.035, 0.0);
}

#[test]
fn a_random_binary_command_of_a_stand_that_logs_staircases_else() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut command = Vec::new();
    while command.len() < ROWS {
        command.extend(vec![if command.len() % 2 == 0 { 0.45 } else { 0.5 }; 2 * rng.random_range(4..20) + 1]);
    }
    let motor = Motor { time_constant_s: 0.06, delay_rows: 2, gain_rpm: 15_000.0, noise_rpm: 20.0 };
    let stand = "Time (s),ESC signal (µs),Motor Optical Speed (RPM)\n";
    let rows = table(&motor, 3, &command);
    let pulses = rows.lines().skip(1).map(|row| {
        let cells: Vec<f64> = row.split(',').map(|cell| cell.parse().unwrap()).collect();
        format!("{},{},{}\n", cells[0], (1000.0 + 1000.0 * cells[1]).round(), cells[2])
    });
    assert_lag(&imported(&format!("{stand}{}", pulses.collect::<String>()), None), 0.06, 0.01);
}

#[test]
fn a_random_command_that_is_called_something_else_is_named() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let command: Vec<f64> = (0..ROWS / 10).flat_map(|_| [if rng.random::<bool>() { 0.42 } else { 0.58 }; 10]).collect();
    let motor = Motor { time_constant_s: 0.06, delay_rows: 2, gain_rpm: 15_000.0, noise_rpm: 50.0 };
    let text = table(&motor, 4, &command);
    for stated in [Excitation::Free, Excitation::Staircase] {
        let error = identified(&imported(&text, Some(stated))).unwrap_err();
        assert!(matches!(error, IdentifyError::RandomCommand { .. }), "{stated:?}: {error}");
        let help = miette::Diagnostic::help(&error).unwrap().to_string();
        assert!(help.contains("--excitation random"), "{help}");
    }
}

#[test]
fn a_ramp_is_refused_with_the_reason() {
    let motor = Motor { time_constant_s: 0.06, delay_rows: 2, gain_rpm: 15_000.0, noise_rpm: 50.0 };
    let up = |row: usize| 0.2 + 0.6 * row as f64 / ROWS as f64;
    let up_and_down = |row: usize| 0.8 - 0.6 * (2.0 * row as f64 / ROWS as f64 - 1.0).abs();
    let held = |row: usize| (0.2 + 0.9 * row as f64 / ROWS as f64).min(0.8);
    let in_pulses = |row: usize| (1000.0 * up(row)).round() / 1000.0;
    for (name, ramp) in
        [("up", &up as &dyn Fn(usize) -> f64), ("both", &up_and_down), ("held", &held), ("us", &in_pulses)]
    {
        let command: Vec<f64> = (0..ROWS).map(ramp).collect();
        let text = table(&motor, 5, &command);
        let experiment = imported(&text, None);
        assert_eq!(experiment.records[0].excitation, Excitation::Free, "{name}");
        for stated in [None, Some(Excitation::Staircase)] {
            let error = identified(&imported(&text, stated)).unwrap_err();
            assert!(matches!(error, IdentifyError::RampCommand { .. }), "{name}, {stated:?}: {error}");
            assert!(error.to_string().contains("a lag and a dead time look alike"), "{error}");
        }
    }
}

#[test]
fn a_steady_ripple_is_no_row_of_spikes() {
    let levels = [0.2, 0.35, 0.5, 0.65, 0.5, 0.35];
    let command: Vec<f64> = (0..ROWS).map(|row| levels[row / 1000]).collect();
    let motor = Motor { time_constant_s: 0.06, delay_rows: 0, gain_rpm: 15_000.0, noise_rpm: 10.0 };
    let clean = table(&motor, 6, &command);
    // Rows of 5 ms: 26 of them are 7.7 Hz.
    for (beat, hz) in [(26, 7.692), (10, 20.0), (41, 4.878), (0, 0.0)] {
        let mut lines = clean.lines();
        let header = lines.next().unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let rows = lines.enumerate().map(|(row, line)| {
            let (front, rpm) = line.rsplit_once(',').unwrap();
            let is_off = if beat > 0 { row % beat == 5 } else { rng.random::<f64>() < 1.0 / 26.0 };
            let factor = if is_off { 1.15 } else { 1.0 };
            format!("{front},{}\n", factor * rpm.parse::<f64>().unwrap())
        });
        let text = format!("{header}\n{}", rows.collect::<String>());
        let found = identified(&imported(&text, Some(Excitation::Staircase))).unwrap();
        let fit = found.lags.in_time().unwrap();
        let ripple = fit.warnings.iter().find_map(|warning| match warning {
            StepsWarning::Ripple { frequency_hz, .. } => Some(*frequency_hz),
            _ => None,
        });
        match ripple {
            Some(found_hz) => assert!((found_hz - hz).abs() < 0.01, "{beat}: {found_hz}"),
            None => assert_eq!(beat, 0, "{:?}", fit.warnings),
        }
        let has_spikes = fit.warnings.iter().any(|warning| matches!(warning, StepsWarning::Spikes { .. }));
        assert_eq!(has_spikes, beat == 0, "{beat}");
    }
}
