//! `rotorlead device tune` on the image that is flashed, at its USB plug, with ESCs that answer at its pins.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clap::Parser as _;
use host_tests::live_pico::LivePico;
use host_tests::rotor::Rotor;
use rotorlead::settings::{DEAD_MAN_MS, Pulse, PulseProtocol, Settings};
use rotorlead_cli::Arguments;
use serde_json::Value;

/// From a full command to the stop, milliseconds.
const RAMP_MS: u16 = 100;
/// The command around which is played first.
const NOMINAL: f64 = 0.4;
/// With two levels, which a judgement asks for.
const TUNE: &str = "tune --yes --out @tuned --motors 0,1 --nominal 0.4,0.5 --most-rpm 12500 --motor-poles 14 --kind inverse --periods 2 \
                    --divisor 1";

/// A frame in each tick, and short ramps: emulated time is dear.
fn settings() -> Settings {
    let output = Pulse { protocol: PulseProtocol::Dshot600Bidirectional, frame_hz: 1000 };
    let mut settings = Settings { loop_rate_hz: 1000, output, stop_pulses_ms: 20, ..Settings::default() };
    (settings.excitation.arm_ms, settings.excitation.ramp_ms) = (10, RAMP_MS);
    settings
}

/// A vehicle with a Pico, and a folder for what is found.
struct Vehicle {
    pico: LivePico,
    folder: tempfile::TempDir,
}

impl Vehicle {
    fn new(rotors: &[Rotor]) -> Self {
        Self { pico: LivePico::start(0, Some(&settings()), rotors), folder: tempfile::tempdir().unwrap() }
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }

    /// `rotorlead device` with these, where `@` stands for the folder.
    fn device(&self, arguments: &str) -> Result<Value, String> {
        let json = self.path("out.json");
        // The emulated time is slower than that of the host.
        let line = format!("rotorlead device --port {} --timeout 20 --json {json} {arguments}", self.pico.address());
        let words = line.split(' ').map(|word| word.strip_prefix('@').map_or(word.to_owned(), |name| self.path(name)));
        let run = Arguments::try_parse_from(words).map_err(|error| error.to_string())?.run();
        run.map_err(|error| format!("{error:?}"))?;
        Ok(serde_json::from_str(&std::fs::read_to_string(Path::new(&json)).unwrap()).unwrap())
    }

    fn settings(&self) -> Value {
        let mut all = self.device("get").unwrap();
        all.as_object_mut().unwrap().remove("generator");
        all
    }
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn two_motors_get_their_compensators_on_the_image_that_is_flashed() {
    let rotors = [Rotor::new(0.060), Rotor::new(0.042)];
    let vehicle = Vehicle::new(&rotors);
    let found = vehicle.device(TUNE).unwrap();
    assert_eq!(found["saved"], true);
    let all = vehicle.settings();
    for (motor, rotor) in rotors.iter().enumerate() {
        let truth_s = |nominal: f64| rotor.time_constant_s(rotor.rpm(nominal));
        let points = found["motors"][motor]["points"].as_array().unwrap();
        assert_eq!(points.len(), 2);
        for point in points {
            let off = point["time_constant_s"].as_f64().unwrap() / truth_s(point["nominal"].as_f64().unwrap()) - 1.0;
            println!("motor {motor}: {:.1} % off at {}", 100.0 * off, point["nominal"]);
            assert!(off.abs() < 0.02, "{point}");
        }
        assert_eq!(all[format!("motor.{motor}.compensate")], "true");
        let curve = all[format!("motor.{motor}.time_constant_s")].as_str().unwrap();
        let stored_s: Vec<f64> =
            curve.split(',').map(|pair| pair.split_once(':').unwrap().1.parse().unwrap()).collect();
        assert!(stored_s.iter().any(|stored_s| (stored_s / truth_s(NOMINAL) - 1.0).abs() < 0.02), "{curve}");
    }
    assert_eq!((&all["compensator"], &all["motor.2.compensate"]), (&"inverse".into(), &"false".into()));
    println!("{:.1} s of the emulated time from the plug to the settings", vehicle.pico.seconds());
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn a_plug_that_is_pulled_stops_the_motor_and_nothing_is_set() {
    let vehicle = Vehicle::new(&[Rotor::new(0.060), Rotor::new(0.042)]);
    let is_over = AtomicBool::new(false);
    let error = std::thread::scope(|scope| {
        scope.spawn(|| {
            while vehicle.pico.motor(0).last() < 0.9 * NOMINAL && !is_over.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(20));
            }
            vehicle.pico.unplug();
        });
        let result = vehicle.device(TUNE);
        is_over.store(true, Ordering::Relaxed);
        result.unwrap_err()
    });
    assert!(error.contains("motor 0 was not measured, and no setting was changed"), "{error}");
    let turned_ms = (0..100).find_map(|_| {
        std::thread::sleep(Duration::from_millis(200));
        vehicle.pico.turned_ms()
    });
    let turned_ms = turned_ms.expect("the motors stop");
    println!("the motors stood {turned_ms} ms after the plug was pulled");
    assert!(turned_ms <= f64::from(DEAD_MAN_MS + u32::from(RAMP_MS)), "{turned_ms}");
    assert_eq!(vehicle.pico.motor(1).most(), 0.0);
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn a_motor_without_its_propeller_one_that_does_not_answer_and_wrong_poles_set_nothing() {
    let silent = Rotor { answers_until_s: 0.0, ..Rotor::new(0.05) };
    let vehicle = Vehicle::new(&[Rotor { faster: 1.7, ..Rotor::new(0.01) }, silent, Rotor::new(0.05)]);
    let before = vehicle.settings();
    for (motor, poles, said) in [("0", "14", "propeller"), ("1", "14", "gave no speed"), ("2", "8", "magnets")] {
        let tune = TUNE.replace("0,1", motor).replace("@tuned", &format!("@tuned{motor}"));
        let error = vehicle.device(&tune.replace("-poles 14", &format!("-poles {poles}"))).unwrap_err();
        assert!(error.contains(said), "{error}");
        assert_eq!(vehicle.settings(), before);
        assert_eq!(vehicle.pico.motor(motor.parse().unwrap()).last(), 0.0);
    }
}
