//! The host's end of the link, against the library's own tick and request handler behind a TCP port.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Parser as _;
use host_tests::stand_in::{Pace, Stand, StandIn, TIMER_HZ, Trouble};
use host_tests::{TABLE_1, cases};
use proptest::prelude::*;
use rotorlead::capture::Signal;
use rotorlead::channel::Input;
use rotorlead::design::{CurvePoint, RotorCurve};
use rotorlead::dshot::Reply;
use rotorlead::excitation::{Multisine, ODD_LINES_30_HZ};
use rotorlead::link::{
    FRAME_BYTES, INJECT_SAMPLES, INJECT_WINDOW, InjectRequest, Injected, Message, NO_TURN, Request, Sensed, Series,
    VERSION, encode,
};
use rotorlead::settings::Settings;
use rotorlead::throttle::{Command, EscCommand};
use rotorlead_cli::Arguments;
use rotorlead_design::{DesignOptions, InverseOptions, design, design_inverse};
use rotorlead_device::{entries, path, set};
use rotorlead_plant::bench::{BenchError, Plan, run_through};
use rotorlead_plant::{Actuator, CompensatorDesign, EscTiming, Law, Model};
use rotorlead_records::{Excitation, Experiment, Output, Role};
use serde_json::Value;

const NEWTONS_PER_COUNT: f64 = 2e-4;
const ZERO_COUNT: f64 = 10_000.0;
const NOMINAL: f64 = 0.5;
/// The paper's motor at 0.5.
const GAIN: f64 = 10.1718;
/// By the ESC's replies: at the nominal command, and as its thrust deviates from there.
const NOMINAL_RPM: f64 = 12_000.0;
const RPM_PER_NEWTON: f64 = 1200.0;
const TIME_CONSTANT_S: f64 = 1.0 / 9.2889;

/// Faster than time, where the controller's clock has to run for long.
const FAST: Pace = Pace { speed: 40.0, eager: true, bytes_per_s: None, needs_full_window: false };

/// Frames per second of the default settings.
const INPUT_HZ: f64 = 490.0;
const OUTPUT_HZ: f64 = 495.0;

/// A controller with a motor and a thrust sensor, and a folder for what comes of it.
struct Bench {
    controller: StandIn,
    folder: tempfile::TempDir,
}

impl Bench {
    fn new(trouble: Trouble, pace: Pace) -> Self {
        Self::with_frames(trouble, pace, OUTPUT_HZ, |_| Signal::Nothing)
    }

    /// With an ESC that says how fast its motor turns, until so many seconds have passed.
    fn with_replies(until_s: f64) -> Self {
        let bench = Self::with(Trouble::None, FAST, OUTPUT_HZ, until_s, |_| Signal::Nothing);
        bench.device("set output.protocol dshot600_bidirectional").unwrap();
        bench
    }

    /// With pulses at the input, which the output frames follow.
    fn driven(trouble: Trouble, pace: Pace, input: impl FnMut(f64) -> Signal + Send + 'static) -> Self {
        Self::with_frames(trouble, pace, INPUT_HZ, input)
    }

    fn with_frames(
        trouble: Trouble,
        pace: Pace,
        frame_hz: f64,
        input: impl FnMut(f64) -> Signal + Send + 'static,
    ) -> Self {
        Self::with(trouble, pace, frame_hz, 0.0, input)
    }

    fn with(
        trouble: Trouble,
        pace: Pace,
        frame_hz: f64,
        replies_until_s: f64,
        input: impl FnMut(f64) -> Signal + Send + 'static,
    ) -> Self {
        let stand = move || {
            let timing = EscTiming { frame_hz: Some(frame_hz), frame_phase: 0.0 };
            let mut motor = Actuator::new(&model(), Law::LinearAround(NOMINAL), timing).unwrap();
            motor.settle(0.0);
            let sensed = move |command: f64, time_s: f64| {
                motor.advance(command, time_s);
                let response = motor.response();
                let adc = (response / NEWTONS_PER_COUNT + ZERO_COUNT).round() as u16;
                Sensed { turn_us: if time_s < replies_until_s { turn_us(response) } else { NO_TURN }, adc }
            };
            Stand { input: Box::new(input), motors: vec![Box::new(sensed)] }
        };
        let controller = StandIn::start(trouble, pace, stand);
        let folder = tempfile::tempdir().unwrap();
        model().write(&folder.path().join("model.toml")).unwrap();
        Self { controller, folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs `rotorlead device` with these arguments; `@NAME` is a path in the folder. Gives its JSON, or its error.
    fn device(&self, arguments: &str) -> Result<Value, String> {
        self.within("2", arguments)
    }

    /// The same, with another limit on answers: on a busy machine two seconds are none too long.
    fn within(&self, timeout_s: &str, arguments: &str) -> Result<Value, String> {
        self.rotorlead(&format!("device --port {} --timeout {timeout_s} {arguments}", self.controller.address()))
    }

    fn rotorlead(&self, arguments: &str) -> Result<Value, String> {
        let json = self.path("out.json");
        let words = arguments.split(' ').map(|word| match word.strip_prefix('@') {
            Some(name) => self.path(name).display().to_string(),
            None => word.to_owned(),
        });
        let (command, rest): (Vec<_>, Vec<_>) = words.enumerate().partition(|(index, _)| *index == 0);
        let words = |words: Vec<(usize, String)>| words.into_iter().map(|(_, word)| word);
        let json_option = ["--json".to_owned(), json.display().to_string()];
        let all = ["rotorlead".to_owned()].into_iter().chain(words(command)).chain(json_option).chain(words(rest));
        // One line: a report breaks where it likes.
        let flat = |report: miette::Report| {
            format!("{report:?}").replace('\u{2502}', " ").split_whitespace().collect::<Vec<_>>().join(" ")
        };
        let arguments = Arguments::try_parse_from(all).map_err(|error| error.to_string())?;
        let _ = std::fs::remove_file(&json);
        arguments.run().map_err(flat)?;
        Ok(self.json())
    }

    /// What the last command wrote, beside the mark of the program.
    fn json(&self) -> Value {
        let mut json: Value = serde_json::from_str(&std::fs::read_to_string(self.path("out.json")).unwrap()).unwrap();
        json.as_object_mut().unwrap().remove("generator").unwrap();
        json
    }

    fn plan(&self, text: &str) {
        std::fs::write(self.path("plan.toml"), format!("format = 1\nname = \"test\"\nseed = 1\n{text}")).unwrap();
    }

    /// Files and folders.
    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).unwrap();
        let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

fn model() -> Model {
    let text =
        format!("format = 1\n[[point]]\nnominal = {NOMINAL}\ngain = {GAIN}\ntime_constant_s = {TIME_CONSTANT_S}\n");
    toml::from_str(&text).unwrap()
}

/// What the ESC of a motor of 14 poles says, whose speed answers as the thrust does.
fn turn_us(response: f64) -> i32 {
    let rpm = NOMINAL_RPM + RPM_PER_NEWTON * response;
    Reply::from_period_us(Some((120e6 / (14.0 * rpm)) as u32)).turn_us().map_or(NO_TURN, i32::from)
}

const SENSOR: &str = "--newtons-per-count 2e-4 --zero-count 10000";

#[test]
fn what_is_set_is_used_stored_and_shown() {
    let bench = Bench::new(Trouble::None, FAST);
    let info = bench.device("info").unwrap();
    assert_eq!((&info["settings"], &info["outputs_enabled"]), (&"Stored".into(), &true.into()));
    bench.device("set motor.*.compensate true").unwrap();
    let set = bench.device("set output.frame_hz 150").unwrap();
    assert!(set["warnings"][0].as_str().unwrap().contains("output.frame_hz"), "{set}");
    let all = bench.device("get").unwrap();
    assert_eq!((&all["motor.3.compensate"], &all["output.frame_hz"]), (&"true".into(), &"150".into()));
    assert_eq!(bench.device("info").unwrap()["settings"], "Host");
    bench.device("save").unwrap();
    assert_eq!(bench.device("info").unwrap()["settings"], "Stored");
}

#[test]
fn every_setting_that_is_shown_can_be_set_to_what_is_shown() {
    let bench = Bench::new(Trouble::None, FAST);
    let before = bench.device("get").unwrap();
    for (key, value) in before.as_object().unwrap() {
        bench.device(&format!("set {key} {}", value.as_str().unwrap())).unwrap();
    }
    assert_eq!(bench.device("get").unwrap(), before);
}

/// The paper's pulses: a duty of 2 % is the stop, and 98 % is full speed.
const RAW_DUTY: &str = "set output.protocol raw_duty output.frame_hz 600 stop 0.02 motor.*.max 0.98";

#[test]
fn protocols_are_changed_in_one_command_there_and_back() {
    let bench = Bench::new(Trouble::None, FAST);
    let defaults = bench.device("get").unwrap();
    let shown = |keys: [&str; 4]| {
        let all = bench.device("get").unwrap();
        keys.map(|key| all[key].as_str().unwrap().to_owned())
    };
    let keys = ["output.protocol", "output.frame_hz", "stop", "motor.3.max"];
    let set = bench.device(RAW_DUTY).unwrap();
    assert_eq!((&set["set"]["stop"], &set["set"]["motor.*.max"]), (&"0.02".into(), &"0.98".into()));
    assert_eq!(shown(keys), ["raw_duty", "600", "0.02", "0.98"]);
    bench.device("set output.protocol standard_pwm output.frame_hz 495 stop 0 motor.*.max 1").unwrap();
    assert_eq!(bench.device("get").unwrap(), defaults);
    bench.device(RAW_DUTY).unwrap();
    bench.device("set output.protocol oneshot125 output.frame_hz 2400 stop 0 motor.*.max 1").unwrap();
    assert_eq!(shown(keys), ["oneshot125", "2400", "0", "1"]);
}

#[test]
fn one_wrong_value_among_several_changes_nothing() {
    let bench = Bench::new(Trouble::None, FAST);
    let before = bench.device("get").unwrap();
    for (arguments, said) in [
        ("set motor.0.max 0.9 damping much", "no value for damping"),
        ("set motor.0.max 0.9 dampin 0.7", "no setting `dampin`"),
        ("set motor.0.max 0.9 output.frame_hz 600", "output.frame_hz"),
        ("set motor.0.max 0.9 stop", "`stop` has no value"),
    ] {
        let error = bench.device(arguments).unwrap_err();
        assert!(error.contains(said), "{arguments}: {error}");
        assert_eq!(bench.device("get").unwrap(), before);
    }
}

#[test]
fn a_key_that_needs_another_one_is_refused_with_a_command_that_works() {
    for (first, alone, said) in [
        (None, "set output.protocol raw_duty", "set output.protocol raw_duty stop 0.0099 motor.*.max 0.9901"),
        (
            Some(RAW_DUTY),
            "set output.protocol standard_pwm",
            "set output.protocol standard_pwm output.frame_hz 495 stop 0",
        ),
        (Some(RAW_DUTY), "set output.protocol oneshot125", "set output.protocol oneshot125 stop 0"),
        (Some(RAW_DUTY), "set output.frame_hz 1200", "set output.frame_hz 1200 stop 0.024 motor.*.max 0.976"),
        (None, "set stop 0.02", "set stop 0.02 output.protocol raw_duty motor.*.max 0.9901"),
        (None, "set motor.2.idle 0.5", "outside its range 0 to 0.199"),
        (None, "set motor.2.disarming 0.15", "set motor.2.disarming 0.15 motor.2.arming 0.15"),
    ] {
        let bench = Bench::new(Trouble::None, FAST);
        if let Some(first) = first {
            bench.device(first).unwrap();
        }
        let before = bench.device("get").unwrap();
        let error = bench.device(alone).unwrap_err();
        assert!(error.contains(said), "{alone}: {error}");
        assert_eq!(bench.device("get").unwrap(), before);
        if let Some((_, command)) = error.split_once('`').filter(|_| said.starts_with("set")) {
            bench.device(command.split_once('`').unwrap().0).unwrap();
        }
    }
    // Where another key does not help, it is not asked for.
    let bench = Bench::new(Trouble::None, FAST);
    let error = bench.device("set stop 0.5").unwrap_err();
    assert!(error.contains("even with output.protocol raw_duty") && error.contains("0.0099 to 0.0300"), "{error}");
    let error = bench.device("set omega_f_rad_s 10").unwrap_err();
    assert!(error.contains("`set omega_f_rad_s 10 omega_z_rad_s VALUE`"), "{error}");
}

/// The paper's motors, as they are given on the command line.
const CURVE: &str = "0.40:0.159,0.45:0.136,0.50:0.108,0.55:0.101,0.60:0.085,0.65:0.071";

#[test]
fn an_inverse_is_set_used_stored_and_shown() {
    let bench = Bench::new(Trouble::None, FAST);
    let all = "compensator inverse inverse.natural_rad_s 100 inverse.damping 0.75 output.slew_per_s 60 \
               inverse.compensate_from 0.3 inverse.compensate_to 0.7";
    bench.device(&format!("set {all} motor.*.time_constant_s {CURVE} motor.2.time_constant_s 0.5:0.1")).unwrap();
    bench.device("save").unwrap();
    let shown = bench.device("get").unwrap();
    for pair in all.split_whitespace().collect::<Vec<_>>().chunks(2) {
        assert_eq!(shown[pair[0]], pair[1], "{shown}");
    }
    assert_eq!(shown["motor.2.time_constant_s"], "0:0.1,1:0.1");
    // As the controller stores it: at every 32nd of the command where it changes.
    let stored = shown["motor.1.time_constant_s"].as_str().unwrap();
    assert!(
        stored.starts_with("0:0.159,0.375:0.159,0.40625:0.1557") && stored.ends_with("0.65625:0.071,1:0.071"),
        "{stored}"
    );
    // And what is shown can be set.
    for (key, value) in shown.as_object().unwrap() {
        bench.device(&format!("set {key} {}", value.as_str().unwrap())).unwrap();
    }
    assert_eq!(bench.device("get").unwrap(), shown);
    bench.device("set compensator lead motor.*.time_constant_s none").unwrap();
    assert_eq!(bench.device("get motor.1.time_constant_s").unwrap()["motor.1.time_constant_s"], "none");
}

/// What a folder says of its records is read again by other commands.
#[test]
fn a_record_of_an_inverse_has_the_inverse_beside_it() {
    let bench = Bench::new(Trouble::None, FAST);
    bench.device(&format!("set compensator inverse motor.*.time_constant_s {CURVE} motor.1.compensate true")).unwrap();
    bench.device(&format!("excite --motor 1 --nominal 0.5 --periods 1 --out @excited {SENSOR}")).unwrap();
    let design = CompensatorDesign::read(&bench.path("excited/compensator.toml")).unwrap();
    let inverse = design.as_inverse().unwrap();
    // The limits are the motor's.
    let range = inverse.range();
    assert!((range.min - 0.05).abs() < 1e-8 && range.max == 1.0, "{range:?}");
    assert_eq!(inverse.design().loop_rate_hz(), 5000.0);
    // Without it in the path a record has none.
    bench.device(&format!("excite --motor 0 --nominal 0.5 --periods 1 --out @plain {SENSOR}")).unwrap();
    assert!(!bench.path("plain").join("compensator.toml").exists());
}

/// The file that a design writes, as the controller takes it, and as it comes back beside a record.
#[test]
fn a_compensator_is_set_from_its_file() {
    let bench = Bench::new(Trouble::None, FAST);
    let model = Model::read(&bench.path("model.toml")).unwrap();
    let options = InverseOptions { slew_per_s: Some(20.0), range: (0.05, 1.0), ..InverseOptions::default() };
    let inverse: CompensatorDesign = design_inverse(&model, &options).unwrap().compensator.into();
    let lead: CompensatorDesign =
        design(&model, &DesignOptions { omega_g_rad_s: 300.0, slew_per_s: Some(20.0), ..DesignOptions::default() })
            .unwrap()
            .into();
    for (number, design) in [inverse, lead].into_iter().enumerate() {
        design.write(&bench.path("compensator.toml")).unwrap();
        bench.device("set --compensator @compensator.toml motor.1.compensate true").unwrap();
        bench.device(&format!("excite --motor 1 --nominal 0.5 --periods 1 --out @stand{number} {SENSOR}")).unwrap();
        let back = CompensatorDesign::read(&bench.path(&format!("stand{number}/compensator.toml"))).unwrap();
        assert!(back.is_bit_identical_to(&design), "{back:?}");
    }
    let mut other = model.clone();
    other.points[0].gain *= 1.01;
    for (model, warned) in [(&model, false), (&other, true)] {
        let design = CompensatorDesign::read(&bench.path("compensator.toml")).unwrap().designed_for(model);
        design.write(&bench.path("compensator.toml")).unwrap();
        let set = bench.device("set --compensator @compensator.toml --model @model.toml").unwrap();
        let warnings = set["warnings"].to_string();
        assert_eq!(warnings.contains("the compensator was designed for the model with CRC-32"), warned, "{warnings}");
    }
    let error = bench.device("set --compensator @model.toml").unwrap_err();
    assert!(error.contains("a model") && error.contains("a compensator is needed"), "{error}");
}

#[test]
fn an_inverse_without_curves_is_refused_with_the_key_that_it_takes() {
    let bench = Bench::new(Trouble::None, FAST);
    let before = bench.device("get").unwrap();
    let known =
        format!("motor.0.time_constant_s {CURVE} motor.1.time_constant_s {CURVE} motor.3.time_constant_s {CURVE}");
    for (arguments, said) in [
        ("set compensator inverse".to_owned(), "`set compensator inverse motor.*.time_constant_s COMMAND:SECONDS,...`"),
        (format!("set compensator inverse {known}"), "motor.2.time_constant_s COMMAND:SECONDS,...`"),
        (
            format!("set compensator inverse motor.*.time_constant_s {CURVE} motor.3.time_constant_s none"),
            "motor.3.time_constant_s is none",
        ),
        ("set compensator inverse motor.*.time_constant_s none".to_owned(), "motor.0.time_constant_s is none"),
    ] {
        let error = bench.device(&arguments).unwrap_err();
        assert!(error.contains(said) && error.contains("identified model"), "{arguments}: {error}");
        assert_eq!(bench.device("get").unwrap(), before);
    }
    // With the curves it is taken, and not given up by removing one.
    bench.device(&format!("set compensator inverse motor.*.time_constant_s {CURVE}")).unwrap();
    let error = bench.device("set motor.1.time_constant_s none").unwrap_err();
    assert!(error.contains("motor.1.time_constant_s is none: with compensator inverse"), "{error}");
}

#[test]
fn wrong_curves_and_inverses_are_refused_with_what_is_wrong() {
    let bench = Bench::new(Trouble::None, FAST);
    bench.device(&format!("set compensator inverse motor.*.time_constant_s {CURVE}")).unwrap();
    let before = bench.device("get").unwrap();
    let form = "give COMMAND:SECONDS,..., as 0.40:0.159,0.65:0.071, or none";
    let many = (0..34).map(|n| format!("{}:0.1", f64::from(n) / 40.0)).collect::<Vec<_>>().join(",");
    for (value, said) in [
        ("0.4", form),
        ("0.4:x", form),
        (":", form),
        ("0.4:0.1,", form),
        ("0.4:0.1;0.5:0.1", form),
        ("None", form),
        ("0.5:0.1,0.4:0.1", "point 1 of the curve: command is 0.4, not above that of the point before, 0.5"),
        ("0.5:0.1,0.5:0.2", "point 1 of the curve: command is 0.5, not above"),
        ("0.4:-1", "point 0 of the curve: tau_s is -1, outside its range"),
        ("0.4:0.1,1.1:0.1", "point 1 of the curve: command is 1.1, outside its range 0 to 1"),
        ("0.4:nan", "point 0 of the curve: tau_s is not a finite number"),
        ("0.4:1e9", "outside its range"),
        (&many, "the curve has 34 points, more than 33"),
        // Curves of which there is no inverse.
        ("0.4:0.001", "the rotor is faster than the inverse can slow down"),
        ("0.5:0.1,0.53:0.2", "tau_s changes from 0.1000 at command 0.5000"),
    ] {
        let error = bench.device(&format!("set motor.3.time_constant_s {value}")).unwrap_err();
        assert!(error.contains(said) && error.contains("motor.3.time_constant_s"), "{value}: {error}");
        assert_eq!(bench.device("get").unwrap(), before);
    }
    for (arguments, said) in [
        ("compensator inverted", "give lead or inverse"),
        ("compensator lead inverse.damping 0.2", "inverse.damping is 0.2"),
        ("inverse.natural_rad_s 2001", "inverse.natural_rad_s is 2001"),
        ("output.slew_per_s 1e7", "output.slew_per_s is 10000000"),
        ("output.slew_per_s 0.01", "slew_per_s is 0.01, less than one step of the output"),
        ("inverse.compensate_from 0.8 inverse.compensate_to 0.7", "inverse.compensate_to is 0.69"),
        ("inverse.compensate_to 1.5", "give a command from 0 to 1"),
        ("inverse.natural 90", "did you mean `inverse.natural_rad_s`?"),
        ("time_constant_s 0.4:0.1", "motor.*.KEY"),
        ("inverse.natural_rad_s 3", "inverse.natural_rad_s"),
    ] {
        let error = bench.device(&format!("set {arguments}")).unwrap_err();
        assert!(error.contains(said), "{arguments}: {error}");
        assert_eq!(bench.device("get").unwrap(), before);
    }
}

proptest! {
    #![proptest_config(cases(500))]

    /// Whatever was stored: from points, and as 33 time constants of any size.
    #[test]
    fn a_curve_that_is_shown_is_read_to_the_last_bit(
        drawn in proptest::array::uniform32(-13.8..6.9_f64),
        runs in proptest::collection::vec(0..33_usize, 0..20),
        points in proptest::collection::vec((0.0..=1.0_f64, -13.8..6.9_f64), 1..8),
        is_drawn in any::<bool>(),
    ) {
        let curve = if is_drawn {
            let mut tau_s: [f32; 33] = std::array::from_fn(|index| (drawn[index % 32].exp() as f32).clamp(1.1e-6, 999.0));
            runs.iter().filter(|&&index| index > 0).for_each(|&index| tau_s[index] = tau_s[index - 1]);
            RotorCurve::from_time_constants_s(tau_s)
        } else {
            let mut points: Vec<_> = points.iter().map(|&(command, tau)| CurvePoint { command, tau_s: tau.exp().clamp(1.1e-6, 999.0) }).collect();
            points.sort_by(|a, b| a.command.total_cmp(&b.command));
            points.dedup_by(|a, b| a.command == b.command);
            RotorCurve::through(&points).unwrap()
        };
        let name = "motor.1.time_constant_s";
        let mut settings = Settings::default();
        settings.motors[1].curve = Some(curve);
        let (_, shown) = entries(&settings).into_iter().find(|(key, _)| key == name).unwrap();
        let mut read = Settings::default();
        set(&mut read, name, &shown).unwrap();
        let bits = |settings: &Settings| settings.motors[1].curve.unwrap().time_constants_s().map(f32::to_bits);
        prop_assert_eq!(bits(&read), bits(&settings), "{}", shown);
        prop_assert!(read.motors[0].curve.is_none());
    }
}

/// The outputs of a [`Trouble::BlankFlash`] are low, and stay so.
fn assert_not_chosen(bench: &Bench) {
    let info = bench.device("info").unwrap();
    assert_eq!((&info["settings"], &info["outputs_enabled"]), (&"DefaultsBlank".into(), &false.into()));
}

#[test]
fn where_nobody_has_chosen_settings_nothing_is_set_without_the_protocol() {
    let bench = Bench::new(Trouble::BlankFlash, FAST);
    for arguments in ["set motor.*.hold_ms 1000", "set input.protocol oneshot125 input.frame_hz 2000"] {
        let error = bench.device(arguments).unwrap_err();
        for said in ["nobody has chosen", "40 %", &format!("`set output.protocol PROTOCOL {}`", &arguments[4..])] {
            assert!(error.contains(said), "{said}: {error}");
        }
        assert_not_chosen(&bench);
    }
    bench.device("set output.protocol standard_pwm motor.*.hold_ms 1000").unwrap();
    let info = bench.device("info").unwrap();
    assert_eq!((&info["settings"], &info["outputs_enabled"]), (&"Host".into(), &true.into()));
    // From now on they are chosen.
    bench.device("set motor.*.hold_ms 100").unwrap();
    bench.device("save").unwrap();
    assert_eq!(bench.device("info").unwrap()["settings"], "Stored");
}

#[test]
fn defaults_that_nobody_has_chosen_are_not_saved() {
    let bench = Bench::new(Trouble::BlankFlash, FAST);
    let error = bench.device("save").unwrap_err();
    assert!(error.contains("nobody has chosen") && error.contains("set output.protocol PROTOCOL"), "{error}");
    assert_not_chosen(&bench);
    bench.device("set output.protocol standard_pwm").unwrap();
    bench.device("save").unwrap();
    assert_eq!(bench.device("info").unwrap()["settings"], "Stored");
}

#[test]
fn wrong_settings_are_refused_with_the_remedy() {
    let bench = Bench::new(Trouble::None, FAST);
    let before = bench.device("get").unwrap();
    for (arguments, said) in [
        ("set output.frame_hz 600", "use 495 Hz or less"),
        ("set motor.1.idle 0.01", "motor.1.idle is 0.00999"),
        ("set motor.1.idle 1.5", "give a command from 0 to 1"),
        ("set motor.4.idle 0.1", "there is no setting"),
        ("set dampin 0.7", "did you mean `damping`?"),
        ("set damping much", "give a number"),
        ("set stop 0.5", "stop must be 0"),
        ("set no_signal idle", "give no_pulses or stop_pulses"),
        ("set motor.2.disarming 0.05", "motor.2.arming is 0.0499"),
        ("set output.protocol dshot", "give raw_duty or standard_pwm or oneshot125"),
        ("set omega_f_rad_s 1900", "coefficient g0"),
        ("get idle", "motor.*.KEY"),
    ] {
        let error = bench.device(arguments).unwrap_err();
        assert!(error.contains(said), "{arguments}: {error}");
    }
    assert_eq!(bench.device("get").unwrap(), before);
}

#[test]
fn a_recorded_excitation_is_identified_as_it_is() {
    for trouble in [Trouble::None, Trouble::Noise] {
        let bench = Bench::new(trouble, FAST);
        bench.device(&format!("excite --nominal 0.5 --periods 2 --out @stand {SENSOR}")).unwrap();
        let experiment = Experiment::read(&bench.path("stand")).unwrap();
        assert_eq!(experiment.records[0].time_s.len(), 20_000);
        assert_eq!(experiment.esc_frame_hz, Some(OUTPUT_HZ));
        let identified = bench.rotorlead("identify @stand --out @found.toml").unwrap();
        assert_found(&identified["points"][0]);
    }
}

#[test]
fn a_motor_is_identified_from_the_replies_of_its_esc() {
    let bench = Bench::with_replies(f64::INFINITY);
    bench.device("excite --nominal 0.5 --periods 2 --out @vehicle --motor-poles 14").unwrap();
    let experiment = Experiment::read(&bench.path("vehicle")).unwrap();
    assert_eq!((experiment.output, experiment.records[0].rpm.as_ref().unwrap().len()), (Output::Rpm, 20_000));
    assert_eq!(experiment.records[0].thrust_n, None);
    let point = bench.rotorlead("identify @vehicle --out @found.toml").unwrap()["points"][0].clone();
    let off = |key: &str, truth: f64| (point[key].as_f64().unwrap() / truth - 1.0).abs();
    // A reply has 9 bits, and a rotor's speed is said to a part in 256 to 512.
    let offs = [off("gain", GAIN * RPM_PER_NEWTON), off("time_constant_s", TIME_CONSTANT_S)];
    println!("gain and time constant off by {offs:?}");
    assert!(offs.iter().all(|off| *off < 0.003), "{point}");
    // 495 Hz are one frame in eleven control ticks.
    assert_eq!(experiment.esc_frame_hz, Some(5000.0 / 11.0));
    // Beside a thrust sensor the speed is a column, and the thrust the response.
    bench.device(&format!("excite --nominal 0.5 --periods 1 --out @both --motor-poles 14 {SENSOR}")).unwrap();
    let both = Experiment::read(&bench.path("both")).unwrap();
    assert!(both.output == Output::ThrustN && both.records[0].rpm.is_some() && both.records[0].thrust_n.is_some());
    // The one does not go where the other is.
    let error = bench.device(&format!("excite --nominal 0.5 --periods 1 --out @vehicle {SENSOR}")).unwrap_err();
    assert!(error.contains("output"), "{error}");
}

#[test]
fn a_speed_that_no_esc_says_is_not_recorded() {
    let one_way = Bench::new(Trouble::None, FAST);
    let error = one_way.device("record --seconds 0.1 --out @free --motor-poles 14").unwrap_err();
    assert!(error.contains("output.protocol has none") && error.contains("dshot300_bidirectional"), "{error}");
    for (arguments, said) in
        [("--motor-poles 13", "no number of poles"), ("", "required"), ("--zero-count 3", "--newtons-per-count")]
    {
        let error = one_way.device(format!("record --seconds 0.1 --out @free {arguments}").trim_end()).unwrap_err();
        assert!(error.contains(said), "{arguments}: {error}");
    }
    assert_eq!(one_way.names(), ["model.toml"]);
    // An ESC that falls silent: the rows until then are kept.
    let silent = Bench::with_replies(1.0);
    let error = silent.device("record --seconds 100 --out @free --motor-poles 14").unwrap_err();
    assert!(error.contains("gave no speed") && error.contains("free.partial"), "{error}");
    let kept = Experiment::read(&silent.path("free.partial")).unwrap();
    let rpm = kept.records[0].rpm.clone().unwrap();
    let stands = NOMINAL_RPM - RPM_PER_NEWTON * GAIN * NOMINAL;
    assert!(!rpm.is_empty() && rpm.iter().all(|rpm| (rpm / stands - 1.0).abs() < 1.0 / 256.0), "{rpm:?}");
    assert!(error.contains(&format!("row {}", rpm.len())), "{error}");
    // From the start: there is nothing to keep, and the motor does not turn for longer than the way up takes.
    let error = silent.device("record --seconds 1 --out @never --motor-poles 14").unwrap_err();
    assert!(error.contains("in row 0") && error.contains("bidirectional DShot is on"), "{error}");
    let error = silent.device("excite --nominal 0.5 --periods 10 --out @stand --motor-poles 14").unwrap_err();
    assert!(error.contains("gave no speed") && error.contains("nothing was written"), "{error}");
    let read: usize = error.split("after ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap().parse().unwrap();
    assert!(read < 10_000, "{read} rows of 115 000: {error}");
    assert_eq!(silent.names(), ["free.partial", "model.toml"]);
}

/// Holds an identified point against the motor on the stand.
fn assert_found(point: &Value) {
    let off = |key: &str, truth: f64| (point[key].as_f64().unwrap() / truth - 1.0).abs();
    assert!(off("gain", GAIN) < 2e-3, "{point}");
    assert!(off("time_constant_s", TIME_CONSTANT_S) < 2e-3, "{point}");
}

#[test]
fn excitations_at_several_levels_follow_each_other_into_one_folder() {
    let bench = Bench::new(Trouble::None, FAST);
    // The second one can start only when the motor has come to rest from the first.
    bench.device(&format!("excite --nominal 0.4,0.5 --periods 1 --out @stand {SENSOR}")).unwrap();
    let added = bench.device(&format!("excite --nominal 0.6,0.5 --periods 1 --out @stand {SENSOR}")).unwrap();
    assert_eq!(added["records"][1], "u050_multisine_2.csv");
    let identified = bench.rotorlead("identify @stand --out @found.toml").unwrap();
    let points = identified["points"].as_array().unwrap();
    assert_eq!(points.iter().map(|point| point["nominal"].as_f64().unwrap()).collect::<Vec<_>>(), [0.4, 0.5, 0.6]);
    points.iter().for_each(assert_found);
}

#[test]
fn slow_rows_neither_look_like_a_silent_controller_nor_make_a_silent_host() {
    // 16 s of the controller's to fill a frame, 1.6 s of the host's: eight times the dead-man, three times the timeout.
    let bench = Bench::new(Trouble::None, Pace { speed: 10.0, ..Pace::default() });
    let command = format!("excite --nominal 0.5 --periods 1 --divisor 2500 --out @stand {SENSOR}");
    assert_eq!(bench.within("0.5", &command).unwrap()["rows"], 20);
    assert_eq!(bench.device("faults").unwrap()["dead_man"], 0);
    let command = format!("record --seconds 10 --divisor 2500 --out @free {SENSOR}");
    assert_eq!(bench.within("0.5", &command).unwrap()["rows"], 20);
}

#[test]
fn an_excitation_with_one_wrong_sample_is_no_record() {
    // In the second period of 10 s, after a ramp of at most 2 s.
    let bench = Bench::new(Trouble::WrongRow(15_000), FAST);
    let error = bench.device(&format!("excite --nominal 0.5 --periods 1 --out @stand {SENSOR}")).unwrap_err();
    assert!(error.contains("bit for bit"), "{error}");
    assert!(!bench.path("stand").exists());
}

#[test]
fn an_excitation_that_the_dead_man_has_ended_says_so() {
    let bench = Bench::new(Trouble::LosesKeepAlives, FAST);
    let error = bench.device(&format!("excite --nominal 0.5 --periods 1 --out @stand {SENSOR}")).unwrap_err();
    assert!(error.contains("heard nothing from this program for 200 ms"), "{error}");
    assert!(!bench.path("stand").exists());
}

#[test]
fn a_recording_has_a_row_for_every_tick() {
    let bench = Bench::new(Trouble::None, FAST);
    bench.device(&format!("record --seconds 0.5 --out @free {SENSOR}")).unwrap();
    let experiment = Experiment::read(&bench.path("free")).unwrap();
    assert_eq!(experiment.sample_rate_hz, Some(5000.0));
    assert_eq!(experiment.records[0].time_s.len(), 2500);
}

/// A pulse of standard PWM.
fn pulse(command: f64) -> Signal {
    let width_ticks = (f64::from(TIMER_HZ) * 1e-3 * (1.0 + command)).round() as u32;
    Signal::Pulse { width_ticks, period_ticks: TIMER_HZ / 400 }
}

#[test]
fn records_of_a_motor_that_something_else_drives_add_up_to_an_experiment() {
    let plays_square = Arc::new(AtomicBool::new(false));
    let square = Arc::clone(&plays_square);
    let mut multisine = Multisine::new(ODD_LINES_30_HZ, NOMINAL, 0.05, 5000.0).unwrap();
    multisine.start(None);
    let input = move |time_s: f64| match time_s {
        _ if time_s < 0.1 => pulse(0.0),
        _ if square.load(Ordering::Relaxed) => pulse(if time_s % 2.0 < 1.0 { 0.55 } else { 0.45 }),
        _ => pulse(multisine.update().to_f64()),
    };
    let bench = Bench::driven(Trouble::None, FAST, input);
    let periodic = |excitation: &str, period: u32, more: &str| {
        format!(
            "record --excitation {excitation} --nominal 0.5 --period {period} --divisor 5 {more} --out @stand {SENSOR}"
        )
    };
    // Until it is armed.
    bench.device(&format!("record --seconds 0.5 --out @before {SENSOR}")).unwrap();
    bench.device(&periodic("multisine", 10, "--seconds 30")).unwrap();
    plays_square.store(true, Ordering::Relaxed);
    bench.device(&periodic("square", 2, "--seconds 8 --amplitude 0.05 --role validate")).unwrap();
    // Something that does not fit is refused, and what is there stays.
    let error = bench.device(&format!("record --seconds 1 --divisor 1 --out @stand {SENSOR}")).unwrap_err();
    assert!(error.contains("sample_rate_hz") && error.contains("5000 Hz"), "{error}");

    let experiment = Experiment::read(&bench.path("stand")).unwrap();
    let [multisine, square] = &experiment.records[..] else { panic!("{:?}", experiment.records.len()) };
    assert_eq!((&*multisine.file, &*square.file), ("u050_multisine.csv", "u050_square.csv"));
    assert_eq!(experiment.esc_frame_hz, Some(INPUT_HZ));
    assert_eq!((multisine.period_s, square.period_s), (Some(10.0), Some(2.0)));
    assert!((multisine.amplitude.unwrap() - 0.05).abs() < 1e-4, "{:?}", multisine.amplitude);
    assert_eq!(
        (square.excitation, square.amplitude, square.role),
        (Excitation::Square, Some(0.05), Some(Role::Validate))
    );
    let point = bench.rotorlead("identify @stand --out @found.toml").unwrap()["points"][0].clone();
    assert_found(&point);
    // An edge takes effect up to an ESC's frame and a row, 3.5 ms, from where the record has it: 3 % of the step at most,
    // gone with the time constant. That costs 1.7 % of the fit.
    assert!(point["fit_square_percent"].as_f64().unwrap() > 98.0, "{point}");
}

#[test]
fn a_record_of_nothing_in_particular_says_what_identify_lacks() {
    let bench = Bench::new(Trouble::None, FAST);
    bench.device(&format!("record --seconds 0.5 --out @free {SENSOR}")).unwrap();
    let error = bench.rotorlead("identify @free --out @found.toml").unwrap_err();
    for said in ["u000_free.csv is `free`", "excitation = \"multisine\"", "period_s", "experiment.toml"] {
        assert!(error.contains(said), "{said}: {error}");
    }
}

#[test]
fn a_recording_that_cannot_be_one_is_refused_before_it_starts() {
    let bench = Bench::new(Trouble::None, FAST);
    for (arguments, said) in [
        ("--excitation square --nominal 0.5 --seconds 4", "--period"),
        ("--excitation multisine --period 10 --seconds 4", "--nominal"),
        ("--excitation square --nominal 0.5 --period 10 --seconds 4", "less than one period"),
        ("--excitation square --nominal 0.5 --period 0.0123 --divisor 5 --seconds 4", "no whole number"),
        ("--excitation square --nominal 1.5 --period 1 --seconds 4", "from 0 to 1"),
        ("--seconds 1e9", "from 0.0001 to 100000"),
    ] {
        let error = bench.device(&format!("record {arguments} --out @stand {SENSOR}")).unwrap_err();
        assert!(error.contains(said), "{said}: {error}");
    }
    assert_eq!(bench.names(), ["model.toml"]);
}

#[test]
fn rows_before_a_gap_or_a_break_are_kept_apart() {
    for (trouble, said, rows) in [
        (Trouble::LosesARecord, "32 samples are missing at tick 288", 288),
        (Trouble::Vanishes(20), "of 2500 rows, 640 had arrived", 640),
        (Trouble::FallsSilent(20), "no answer to record", 640),
    ] {
        let bench = Bench::new(trouble, FAST);
        let error = bench.device(&format!("record --seconds 0.5 --out @free {SENSOR}")).unwrap_err();
        assert!(error.contains(said), "{trouble:?}: {error}");
        assert!(error.contains("free.partial"), "{error}");
        assert_eq!(bench.names(), ["free.partial", "model.toml"]);
        let kept = Experiment::read(&bench.path("free.partial")).unwrap();
        assert_eq!((kept.records[0].time_s.len(), kept.records[0].excitation), (rows, Excitation::Free));
    }
}

#[test]
fn excitations_before_a_break_are_kept_and_the_rest_is_named() {
    // A record of one period is some 720 frames of 32 rows.
    let bench = Bench::new(Trouble::Vanishes(1000), FAST);
    let error = bench.device(&format!("excite --nominal 0.4,0.5,0.6 --periods 1 --out @stand {SENSOR}")).unwrap_err();
    for said in ["at --nominal 0.5", "holds the 1 records before", "--nominal 0.5,0.6"] {
        assert!(error.contains(said), "{error}");
    }
    assert_eq!(bench.names(), ["model.toml", "stand"]);
    assert_eq!(Experiment::read(&bench.path("stand")).unwrap().records.len(), 1);
}

const SHORT: &str =
    "[[record]]\nnominal = 0.5\nexcitation = \"square\"\namplitude = 0.05\nhalf_period_s = 0.5\nperiods = 2\n";
const INJECT: &str = "inject --model @model.toml --plan @plan.toml --out @pil";

#[test]
fn injected_commands_come_back_as_the_hosts_path_has_them() {
    for (trouble, wrong) in
        [(Trouble::None, None), (Trouble::Noise, None), (Trouble::WrongOutput(12_345), Some(12_345))]
    {
        let bench = Bench::new(trouble, Pace::default());
        bench.device("set motor.*.compensate true").unwrap();
        // Within the answer to a step.
        bench.device("set motor.0.max 0.6").unwrap();
        bench.device("set motor.0.idle 0.2").unwrap();
        bench.plan(SHORT);
        let outcome = bench.device(INJECT);
        let json = bench.json();
        assert_eq!(json["samples"], 15_002);
        let first = &json["played"][0]["first_difference"];
        match wrong {
            None => {
                outcome.unwrap();
                assert_eq!((&json["different"], first), (&Value::from(0), &Value::Null));
            }
            Some(sample) => {
                let error = outcome.unwrap_err();
                assert!(error.contains("1 of 1 records differ") && error.contains("sample 12345"), "{error}");
                assert_eq!((&json["different"], &first["sample"]), (&Value::from(1), &Value::from(sample)));
            }
        }
        let experiment = Experiment::read(&bench.path("pil")).unwrap();
        let outputs = experiment.records[0].esc_command.as_ref().unwrap();
        let largest = outputs.iter().copied().fold(0.0, f64::max);
        assert!((largest - 0.6).abs() < 1e-8, "the limit is never reached: {largest}");
    }
}

#[test]
fn an_injected_experiment_is_the_simulated_one() {
    let bench = Bench::new(Trouble::None, Pace::default());
    bench.plan(SHORT);
    bench.device(&format!("{INJECT} --compensate true")).unwrap();
    bench
        .rotorlead("simulate --model @model.toml --plan @plan.toml --compensator @pil/compensator.toml --out @host")
        .unwrap();
    let [pil, host] = ["pil", "host"].map(|name| Experiment::read(&bench.path(name)).unwrap());
    assert!(pil == host);
}

#[test]
fn the_window_of_an_injection_is_kept_full() {
    let bench = Bench::new(Trouble::None, Pace { needs_full_window: true, ..Pace::default() });
    bench.plan(&SHORT.repeat(2));
    // A window that is not full waits for longer than the default holds a motor.
    bench.device("set motor.*.hold_ms 1000").unwrap();
    bench.device(INJECT).unwrap();
    // Nothing fills the window behind the last two blocks of each record, nor behind the command that stops the motor.
    assert_eq!(bench.controller.starved(), 2 * (INJECT_WINDOW));
}

#[test]
fn an_injection_goes_over_a_slow_line() {
    let slow = Pace { eager: false, bytes_per_s: Some(19_000.0), ..Pace::default() };
    let bench = Bench::new(Trouble::None, slow);
    bench.plan(&SHORT.replace("periods = 2", "periods = 1\nwarm_up_periods = 0"));
    let start = std::time::Instant::now();
    let outcome = bench.device(&format!("{INJECT} --compensate true")).unwrap();
    println!("5002 samples of a square wave in {:.2} s", start.elapsed().as_secs_f64());
    assert_eq!((&outcome["samples"], &outcome["different"]), (&Value::from(5002), &Value::from(0)));
}

#[test]
#[ignore = "a measurement, in time: half a minute"]
fn how_long_a_multisine_takes_over_a_slow_line() {
    let slow = Pace { eager: false, bytes_per_s: Some(19_000.0), ..Pace::default() };
    let bench = Bench::new(Trouble::None, slow);
    bench.plan("[[record]]\nnominal = 0.5\nexcitation = \"multisine\"\nlines = 225\namplitude = 0.05\nperiods = 1\nwarm_up_periods = 1\n");
    let start = std::time::Instant::now();
    let outcome = bench.device(&format!("{INJECT} --compensate true")).unwrap();
    let seconds = start.elapsed().as_secs_f64();
    println!("{} samples in {seconds:.1} s: {:.0} a second", outcome["samples"], 100_002.0 / seconds);
    assert_eq!(outcome["different"], 0);
}

fn paper_model() -> Model {
    let point = |&(nominal, gain, pole): &(f64, f64, f64)| {
        format!("[[point]]\nnominal = {nominal}\ngain = {gain}\ntime_constant_s = {}\n", 1.0 / pole)
    };
    toml::from_str(&format!("format = 1\n{}", TABLE_1.iter().map(point).collect::<String>())).unwrap()
}

#[test]
fn a_sample_of_the_papers_experiment_costs_few_bytes() {
    let (mut frame, settings) = ([0; FRAME_BYTES], Settings::default());
    let mut costs = Vec::new();
    let plan = Plan { records: Plan::paper(&paper_model()).records[4..6].to_vec(), ..Plan::paper(&paper_model()) };
    for plan in [plan.clone(), plan.compensated("c.toml")] {
        let plan = Plan { compensator: None, ..plan };
        run_through(&plan, &paper_model(), None, |_, start, commands| {
            let mut channel = path(&settings, 0, true).unwrap();
            channel.tick(Input::Command(Command::ZERO));
            channel.tick(Input::Command(start));
            let outputs: Vec<EscCommand> =
                commands.iter().map(|&command| channel.tick(Input::Command(command))).collect();
            let mut bytes = [0; 2];
            for (first, (samples, outputs)) in
                commands.chunks(INJECT_SAMPLES).zip(outputs.chunks(INJECT_SAMPLES)).enumerate()
            {
                let series = |block: Vec<i32>| Series::try_from(&block[..]).unwrap();
                let samples = series(samples.iter().map(|command| command.to_bits()).collect());
                let block = series(outputs.iter().map(|output| output.to_bits()).collect());
                let first = (first * INJECT_SAMPLES) as u32;
                let request = Request::Inject(InjectRequest { motor: 0, first, samples });
                bytes[0] += encode(0, &request, &mut frame).unwrap();
                let reply = Message::Injected(Injected { first, outputs: block });
                bytes[1] += encode(0, &reply, &mut frame).unwrap();
            }
            let samples = commands.len() as f64;
            costs.push(bytes.map(|bytes| bytes as f64 / samples));
            Ok::<_, BenchError>(outputs.iter().map(|output| output.command().unwrap_or(Command::ZERO)).collect())
        })
        .unwrap();
    }
    println!("bytes a sample, there and back: {costs:.3?}");
    let [multisine_150, square, multisine_225, _] = costs[..] else { panic!("{costs:?}") };
    assert!(multisine_150[0] < 2.7 && multisine_150[1] < 3.0, "{multisine_150:?}");
    assert!(multisine_225[0] < 2.9 && multisine_225[1] < 3.1, "{multisine_225:?}");
    assert!(square[0] < 1.2 && square[1] < 1.3, "{square:?}");
}

#[test]
fn bandwidths_of_injected_records_are_those_of_the_sampled_system() {
    let bench = Bench::new(Trouble::None, Pace::default());
    // A response is one number without the limit.
    bench.device("set output.slew_per_s 0").unwrap();
    paper_model().write(&bench.path("model.toml")).unwrap();
    let plan = |nominal: f64| {
        format!(
            "[[record]]\nnominal = {nominal}\nexcitation = \"multisine\"\nlines = 225\namplitude = 0.05\nperiods = 2\n"
        )
    };
    bench.plan(&format!("esc_frame_hz = 600\n{}", TABLE_1.map(|(nominal, ..)| plan(nominal)).concat()));
    let outcome = bench.device(&format!("{INJECT} --compensate true")).unwrap();
    assert_eq!((&outcome["different"], &outcome["samples"]), (&Value::from(0), &Value::from(6 * 150_002)));
    let command =
        "bandwidth --model @model.toml --compensator @pil/compensator.toml --sampled --esc-frame 600 --records @pil";
    let bandwidths = bench.rotorlead(command).unwrap();
    let (points, measured) = (bandwidths["points"].as_array().unwrap(), bandwidths["measured"].as_array().unwrap());
    assert_eq!((points.len(), measured.len()), (6, 6));
    for (point, measured) in points.iter().zip(measured) {
        let (predicted, found) =
            (point["compensated_rad_s"].as_f64().unwrap(), measured["bandwidth_rad_s"].as_f64().unwrap());
        println!("{}: {predicted:.2} rad/s predicted, {found:.2} found", point["nominal"]);
        assert!((found / predicted - 1.0).abs() < 0.02, "{point} {measured}");
    }
}

#[test]
fn an_injection_that_breaks_leaves_nothing_and_says_how_far_it_was() {
    for trouble in [Trouble::Vanishes(150), Trouble::FallsSilent(150)] {
        let bench = Bench::new(trouble, Pace::default());
        bench.plan(&SHORT.repeat(2));
        let error = bench.device(INJECT).unwrap_err();
        assert!(error.contains("after 15000 of 30000 samples, 0 of them different"), "{trouble:?}: {error}");
        assert_eq!(bench.names(), ["model.toml", "plan.toml"]);
    }
}

#[test]
fn what_cannot_be_injected_is_refused() {
    let bench = Bench::new(Trouble::None, Pace::default());
    for (plan, arguments, said) in [
        (SHORT, "--motor 4", "there is no motor 4"),
        (SHORT, "--plan @no.toml", "does not exist"),
        (
            "loop_rate_hz = 1000\n[[record]]\nnominal = 0.5\nexcitation = \"step\"\namplitude = 0.1\nhold_s = 1\n",
            "",
            "the controller's 5000 Hz",
        ),
        (
            "compensator = \"c.toml\"\n[[record]]\nnominal = 0.5\nexcitation = \"step\"\namplitude = 0.1\nhold_s = 1\n",
            "",
            "--compensate true",
        ),
    ] {
        bench.plan(plan);
        let command =
            if arguments.starts_with("--plan") { INJECT.replace("--plan @plan.toml ", "") } else { INJECT.into() };
        let error = bench.device(format!("{command} {arguments}").trim_end()).unwrap_err();
        assert!(error.contains(said), "{said}: {error}");
    }
    assert!(!bench.path("pil").exists());
}

#[test]
fn a_controller_that_is_not_there_is_named() {
    let commands = [
        "info".to_owned(),
        INJECT.into(),
        format!("excite --nominal 0.5 --out @new {SENSOR}"),
        format!("record --seconds 1 --out @new {SENSOR}"),
    ];
    let [silent, other] = [Trouble::Silent, Trouble::OtherVersion].map(|trouble| Bench::new(trouble, FAST));
    for command in &commands {
        for bench in [&silent, &other] {
            bench.plan(SHORT);
        }
        let error = silent.within("0.3", command).unwrap_err();
        assert!(error.contains("no answer to") && error.contains("within 0.3 s"), "{error}");
        let error = other.within("0.3", command).unwrap_err();
        assert!(
            error.contains(&format!("speaks version {} of the link, and this program version {VERSION}", VERSION + 1)),
            "{error}"
        );
        for address in ["tcp:127.0.0.1:1", "/dev/no-such-port"] {
            let error = silent.rotorlead(&format!("device --port {address} {command}")).unwrap_err();
            assert!(error.contains("cannot be opened"), "{error}");
        }
        assert_eq!(silent.names(), ["model.toml", "plan.toml"]);
        assert_eq!(other.names(), ["model.toml", "plan.toml"]);
    }
}
