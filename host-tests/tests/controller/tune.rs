//! `rotorlead device tune`, against the library's own tick and request handler with rotors whose ESCs say their speed.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use clap::Parser as _;
use host_tests::rotor::{POLES, Rotor};
use host_tests::stand_in::{Pace, Stand, StandIn, Trouble};
use rotorlead::capture::Signal;
use rotorlead::dshot::Reply;
use rotorlead::link::{NO_TURN, Sensed};
use rotorlead_cli::Arguments;
use serde_json::Value;

const FAST: Pace = Pace { speed: 40.0, eager: true, bytes_per_s: None, needs_full_window: false };
const LOOP_HZ: f64 = 5000.0;
/// At 495 frames per second: the next whole number of ticks.
const FRAME_TICKS: u64 = 11;
/// The commands, and what a motor with its propeller reaches at the highest of them, and a tenth more.
const LEVELS: &str = "--nominal 0.5,0.3,0.4 --most-rpm 12500";

/// The amplifier of a thrust sensor.
const ZERO_COUNT: f64 = 10_000.0;
const NEWTONS_PER_COUNT: f64 = 2e-4;

/// A rotor whose highest command goes to `most`, in millionths.
fn turning(rotor: Rotor, most: Arc<AtomicU32>) -> impl FnMut(f64, f64) -> Sensed {
    let (mut turning, mut framed) = (rotor.at_rest(), 0.0);
    move |command, time_s| {
        most.fetch_max((1e6 * command) as u32, Ordering::Relaxed);
        // The ESC gets a frame in so many ticks, and holds what it says.
        if ((LOOP_HZ * time_s).round() as u64).is_multiple_of(FRAME_TICKS) {
            framed = command;
        }
        let said = turning.run(framed, time_s);
        let adc = (ZERO_COUNT + turning.newtons() / NEWTONS_PER_COUNT) as u16;
        Sensed { adc, turn_us: said.and_then(Reply::turn_us).map_or(NO_TURN, i32::from) }
    }
}

struct Vehicle {
    controller: StandIn,
    folder: tempfile::TempDir,
    /// The highest command of each motor since the start, in millionths.
    most: Vec<Arc<AtomicU32>>,
}

impl Vehicle {
    fn new(trouble: Trouble, rotors: &[Rotor]) -> Self {
        let most: Vec<Arc<AtomicU32>> = rotors.iter().map(|_| Arc::default()).collect();
        let all: Vec<(Rotor, Arc<AtomicU32>)> = rotors.iter().copied().zip(most.iter().cloned()).collect();
        let stand = move || Stand {
            input: Box::new(|_| Signal::Nothing),
            motors: all
                .into_iter()
                .map(|(rotor, most)| Box::new(turning(rotor, most)) as Box<dyn FnMut(f64, f64) -> Sensed>)
                .collect(),
        };
        let vehicle =
            Self { controller: StandIn::start(trouble, FAST, stand), folder: tempfile::tempdir().unwrap(), most };
        vehicle.device("set output.protocol dshot600_bidirectional").unwrap();
        vehicle.device("save").unwrap();
        vehicle
    }

    fn device(&self, arguments: &str) -> Result<Value, String> {
        let json = self.folder.path().join("out.json");
        let _ = std::fs::remove_file(&json);
        let line = format!(
            "rotorlead device --port {} --timeout 2 --json {} {arguments}",
            self.controller.address(),
            json.display()
        );
        let words = line.split(' ').map(|word| match word.strip_prefix('@') {
            Some(name) => self.folder.path().join(name).display().to_string(),
            None => word.to_owned(),
        });
        let flat = |report: miette::Report| {
            format!("{report:?}").replace('\u{2502}', " ").split_whitespace().collect::<Vec<_>>().join(" ")
        };
        Arguments::try_parse_from(words).map_err(|error| error.to_string())?.run().map_err(flat)?;
        Ok(serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap())
    }

    /// What tuning says where it fails; nothing was set then.
    fn refused(&self, arguments: &str) -> String {
        let before = self.settings();
        let error = self.device(&format!("tune --yes --out @tuned {arguments}")).unwrap_err();
        assert_eq!(self.settings(), before, "{error}");
        error
    }

    fn settings(&self) -> Value {
        let mut all = self.device("get").unwrap();
        all.as_object_mut().unwrap().remove("generator");
        all
    }
}

#[test]
fn two_motors_get_the_compensators_that_their_replies_ask_for() {
    let rotors = [Rotor::new(0.060), Rotor::new(0.042)];
    let vehicle = Vehicle::new(Trouble::None, &rotors);
    let found = vehicle
        .device(&format!("tune --yes --out @tuned --motors 0,1 {LEVELS} --motor-poles 14 --kind inverse"))
        .unwrap();
    assert_eq!(found["saved"], true);
    let all = vehicle.settings();
    assert_eq!(vehicle.device("info").unwrap()["settings"], "Stored");
    for (motor, rotor) in rotors.iter().enumerate() {
        let points = found["motors"][motor]["points"].as_array().unwrap();
        for point in points {
            let truth_s = rotor.time_constant_s(rotor.rpm(point["nominal"].as_f64().unwrap()));
            let off = point["time_constant_s"].as_f64().unwrap() / truth_s - 1.0;
            println!("motor {motor}: {:.1} % off at {}", 100.0 * off, point["nominal"]);
            assert!(off.abs() < 0.02, "{point}");
        }
        assert_eq!(points.len(), 3);
        assert_eq!(all[format!("motor.{motor}.compensate")], "true");
        let curve = all[format!("motor.{motor}.time_constant_s")].as_str().unwrap();
        let written: Vec<f64> = curve.split(',').map(|pair| pair.split_once(':').unwrap().1.parse().unwrap()).collect();
        assert!(
            written.iter().any(|tau_s| (tau_s / rotor.time_constant_s(rotor.rpm(0.4)) - 1.0).abs() < 0.05),
            "{curve}"
        );
    }
    assert_eq!((&all["compensator"], &all["motor.2.compensate"]), (&"inverse".into(), &"false".into()));
}

#[test]
fn a_thrust_sensor_takes_the_place_of_the_replies() {
    let rotor = Rotor { answers_until_s: 0.0, ..Rotor::new(0.060) };
    let vehicle = Vehicle::new(Trouble::None, &[rotor]);
    let sensor = format!("--newtons-per-count {NEWTONS_PER_COUNT} --zero-count {ZERO_COUNT}");
    let found =
        vehicle.device(&format!("tune --yes --out @tuned --motors 0 --nominal 0.3,0.5 --kind lead {sensor}")).unwrap();
    for point in found["motors"][0]["points"].as_array().unwrap() {
        let truth_s = rotor.time_constant_s(rotor.rpm(point["nominal"].as_f64().unwrap()));
        let off = point["time_constant_s"].as_f64().unwrap() / truth_s - 1.0;
        println!("{:.1} % off at {}", 100.0 * off, point["nominal"]);
        assert!(off.abs() < 0.02, "{point}");
    }
    let all = vehicle.settings();
    assert_eq!((&all["compensator"], &all["motor.0.compensate"]), (&"lead".into(), &"true".into()));
}

#[test]
fn speeds_that_correct_an_inverse_are_set_with_it_and_without_them_it_stays_blind() {
    let vehicle = Vehicle::new(Trouble::None, &[Rotor::new(0.050)]);
    let error = vehicle.refused("--motors 0 --nominal 0.4 --most-rpm 12500 --motor-poles 14 --rpm");
    assert!(error.contains("two commands or more"), "{error}");
    vehicle
        .device(&format!("tune --yes --out @tuned --motors 0 {LEVELS} --motor-poles 14 --kind inverse --rpm"))
        .unwrap();
    let all = vehicle.settings();
    assert_eq!(all["compensator"], "rpm");
    for motor in 0..4 {
        let speeds = all[format!("motor.{motor}.erpm")].as_str().unwrap();
        println!("{speeds}");
        for (point, command) in speeds.split(',').zip([0.3, 0.4, 0.5]) {
            let (at, erpm) = point.split_once(':').unwrap();
            let truth = POLES / 2.0 * Rotor::new(0.05).rpm(command);
            assert!((at.parse::<f64>().unwrap() - command).abs() < 1e-8);
            assert!((erpm.parse::<f64>().unwrap() / truth - 1.0).abs() < 0.005, "{point} of {truth}");
        }
    }
    // Written by hand it is what was shown.
    vehicle.device(&format!("set motor.1.erpm {}", all["motor.0.erpm"].as_str().unwrap())).unwrap();
    assert_eq!(vehicle.settings(), all);
    for (change, word) in [
        ("set output.protocol dshot600", "dshot600_bidirectional"),
        ("set motor.0.erpm none", "motor.0.erpm is none"),
        ("set motor.0.erpm 0.3:50000,0.5:40000", "must rise"),
        ("set motor.0.erpm 0.3:50000", "two points or more"),
    ] {
        let error = vehicle.device(change).unwrap_err();
        assert!(error.contains(word), "{change}: {error}");
    }
}

#[test]
fn a_motor_that_runs_away_is_stopped_and_nothing_is_set() {
    // Without its propeller.
    let vehicle = Vehicle::new(Trouble::None, &[Rotor { faster: 1.7, ..Rotor::new(0.01) }]);
    let error = vehicle.refused(&format!("--motors 0 {LEVELS} --motor-poles 14"));
    assert!(error.contains("--most-rpm allows 12500") && error.contains("propeller"), "{error}");
    // It was not taken to the highest command.
    assert!(vehicle.most[0].load(Ordering::Relaxed) < 470_000, "{:?}", vehicle.most);
}

#[test]
fn a_wrong_number_of_magnets_is_seen_by_the_speed() {
    let vehicle = Vehicle::new(Trouble::None, &[Rotor::new(0.05)]);
    let few = vehicle.refused(&format!("--motors 0 {LEVELS} --motor-poles 8"));
    assert!(few.contains("--motor-poles the number of its magnets"), "{few}");
    std::fs::remove_dir_all(vehicle.folder.path().join("tuned")).unwrap();
    let many = vehicle.refused(&format!("--motors 0 {LEVELS} --motor-poles 28"));
    assert!(many.contains("far from the 12500") && many.contains("--motor-poles"), "{many}");
}

#[test]
fn a_motor_that_does_not_answer_is_not_turned_for_long() {
    let silent = Rotor { answers_until_s: 0.0, ..Rotor::new(0.05) };
    let vehicle = Vehicle::new(Trouble::None, &[Rotor::new(0.05), silent]);
    let error = vehicle.refused(&format!("--motors 0,1 {LEVELS} --motor-poles 14 --kind inverse"));
    assert!(error.contains("motor 1 was not measured") && error.contains("gave no speed"), "{error}");
    assert!(vehicle.most[1].load(Ordering::Relaxed) < 360_000, "{:?}", vehicle.most);
}

#[test]
fn where_the_line_breaks_it_is_said_that_no_setting_was_changed() {
    let vehicle = Vehicle::new(Trouble::Vanishes(300), &[Rotor::new(0.05)]);
    let error = vehicle.device(&format!("tune --yes --out @tuned --motors 0 {LEVELS} --motor-poles 14")).unwrap_err();
    assert!(error.contains("motor 0 was not measured, and no setting was changed"), "{error}");
}

#[test]
fn what_cannot_be_tuned_is_refused_before_a_motor_turns() {
    let vehicle = Vehicle::new(Trouble::None, &[Rotor::new(0.05)]);
    for (arguments, said) in [
        ("--motors 4 --nominal 0.4 --most-rpm 9000 --motor-poles 14", "there is no motor 4"),
        ("--motors 0 --nominal 0.4 --motor-poles 14", "--most-rpm"),
        ("--motors 0,0 --nominal 0.4 --most-rpm 9000 --motor-poles 14", "names a motor twice"),
        ("--motors 0 --nominal 0.4 --most-rpm 9000 --newtons-per-count 2e-4 --zero-count 10000", "--motor-poles"),
        ("--motors 0 --nominal 0.4 --most-rpm 9000", "required"),
    ] {
        let error = vehicle.refused(arguments);
        assert!(error.contains(said), "{arguments}: {error}");
    }
    vehicle.device("set motor.1.compensate true").unwrap();
    for (motor, said) in [("0", "not among --motors"), ("1", "through which it would be measured")] {
        let error = vehicle.refused(&format!("--motors {motor} --nominal 0.4 --most-rpm 9000 --motor-poles 14"));
        assert!(error.contains(said) && error.contains("set motor.1.compensate false"), "{error}");
    }
    assert_eq!(vehicle.most[0].load(Ordering::Relaxed), 0);
    assert!(!vehicle.folder.path().join("tuned").exists());
}
