//! The stored settings: ranges, and what a power cut or a wrong byte in flash can do.

use host_tests::flash::Flash;
use host_tests::fuzz::{LAYOUT, fuzz_settings, stored};
use host_tests::{OMEGA_G_RAD_S, cases, paper_curve, paper_design};
use proptest::prelude::*;
use rotorlead::compensator::{CommandRange, Filter, InverseFilter};
use rotorlead::controller::{FilterError, filters};
use rotorlead::design::{CurvePoint, DesignError, InverseDesign, InverseError, LeadDesign, RotorCurve, SpeedCurve};
use rotorlead::dshot::Value;
use rotorlead::link::{FRAME_BYTES, Message, PAYLOAD_BYTES, Request, encode};
use rotorlead::settings::{
    CompensatorKind, ExcitationLimits, HIGHEST_IDLE, Inverse, Key, Lead, Levels, MOTORS, MotorSettings, NoSignal,
    Origin, Problem, Pulse, PulseProtocol, SaveError, SettingId, Settings, SettingsError, Store, Validated, Warning,
};
use rotorlead::throttle::Command;

/// Four pages a sector: a save in four erases.
const SECTOR: usize = 2048;
const PAGE: usize = 512;
type Nor = Flash<SECTOR>;

fn store(flash: Nor) -> Store<Nor> {
    Store::new(flash, Nor::SECTORS)
}

/// Valid settings that differ from all others by `number`.
fn numbered(number: u16) -> Validated {
    let mut settings = Settings { recorder_divisor: number + 1, ..Settings::default() };
    settings.lead.omega_z_rad_s = 10.0 + f64::from(number) / 1000.0;
    settings.validate().unwrap()
}

/// The same with an inverse, and a curve for each motor: a set of two pages.
fn numbered_with_curves(number: u16) -> Validated {
    let mut settings = Settings::clone(&numbered(number));
    settings.compensator = CompensatorKind::Inverse;
    for (motor, factor) in settings.motors.iter_mut().zip([1.0, 0.9, 1.1, 1.2]) {
        let factor = factor + 0.001 * f64::from(number);
        let points = paper_curve().into_iter().map(|point| CurvePoint { tau_s: factor * point.tau_s, ..point });
        motor.curve = Some(RotorCurve::through(&points.collect::<Vec<_>>()).unwrap());
    }
    settings.validate().unwrap()
}

/// The curve of a motor whose time constant is the same at every command, but for one.
fn curve_with(index: usize, tau_s: f32) -> Option<RotorCurve> {
    Some(RotorCurve::from_time_constants_s(std::array::from_fn(|i| if i == index { tau_s } else { 0.1 })))
}

/// A flash in which the sets 0 to `saves - 1` were saved one after the other.
fn saved(saves: u16) -> Nor {
    let mut store = store(Nor::blank());
    for number in 0..saves {
        store.save(&numbered(number)).unwrap();
    }
    store.into_flash()
}

fn bits(value: f64) -> i32 {
    Command::saturating_from_f64(value).to_bits()
}

#[test]
fn every_code_of_a_protocol_is_in_its_table() {
    for (code, protocol) in (0..).zip(PulseProtocol::ALL) {
        assert_eq!(postcard::from_bytes(&[code]), Ok(protocol));
        let named = PulseProtocol::ALL.iter().filter(|other| other.name() == protocol.name());
        assert_eq!(named.count(), 1, "{}", protocol.name());
    }
    assert!(postcard::from_bytes::<PulseProtocol>(&[PulseProtocol::ALL.len() as u8]).is_err());
}

#[test]
fn the_defaults_are_valid_and_hold_the_papers_compensator() {
    let settings = Settings::default().validate().unwrap();
    assert_eq!(settings, Validated::default());
    assert_eq!(settings.warnings().iter().count(), 0);
    let design = LeadDesign::new(settings.lead.into(), f64::from(settings.loop_rate_hz), None).unwrap();
    assert_eq!(design.coefficients(), paper_design().coefficients());
}

#[test]
fn a_value_outside_its_range_is_refused_by_name() {
    type Change = fn(&mut Settings);
    let refused: &[(&str, Change)] = &[
        ("loop_rate_hz", |s| s.loop_rate_hz = 999),
        ("loop_rate_hz", |s| s.loop_rate_hz = 10_001),
        ("omega_z_rad_s", |s| s.lead.omega_z_rad_s = f64::NAN),
        ("omega_z_rad_s", |s| s.lead.omega_z_rad_s = -1.0),
        ("omega_z_rad_s", |s| s.lead.omega_z_rad_s = s.lead.omega_f_rad_s),
        ("omega_f_rad_s", |s| s.lead.omega_f_rad_s = f64::INFINITY),
        ("omega_f_rad_s", |s| s.lead.omega_f_rad_s = 2001.0),
        ("damping", |s| s.lead.damping = 0.29),
        ("damping", |s| s.lead.damping = f64::NAN),
        ("inverse.natural_rad_s", |s| s.inverse.natural_rad_s = 0.0),
        ("inverse.natural_rad_s", |s| s.inverse.natural_rad_s = f64::NAN),
        ("inverse.natural_rad_s", |s| s.inverse.natural_rad_s = 2001.0),
        ("inverse.damping", |s| s.inverse.damping = 0.29),
        ("inverse.damping", |s| s.inverse.damping = 2.01),
        ("inverse.damping", |s| s.inverse.damping = f64::NAN),
        ("output.slew_per_s", |s| s.slew_per_s = -1.0),
        ("output.slew_per_s", |s| s.slew_per_s = 1.1e6),
        ("output.slew_per_s", |s| s.slew_per_s = f64::NAN),
        ("inverse.compensate_from", |s| s.inverse.compensate_from = -1),
        ("inverse.compensate_from", |s| s.inverse.compensate_from = Command::ONE.to_bits() + 1),
        ("inverse.compensate_to", |s| s.inverse.compensate_to = Command::ONE.to_bits() + 1),
        ("inverse.compensate_to", |s| {
            s.inverse.compensate_from = bits(0.5);
            s.inverse.compensate_to = bits(0.5) - 1;
        }),
        ("motor.0.time_constant_s", |s| s.motors[0].curve = curve_with(0, 0.0)),
        ("motor.1.time_constant_s", |s| s.motors[1].curve = curve_with(13, f32::NAN)),
        ("motor.2.time_constant_s", |s| s.motors[2].curve = curve_with(32, 1001.0)),
        ("motor.3.time_constant_s", |s| s.motors[3].curve = curve_with(7, -0.1)),
        ("motor.0.time_constant_s", |s| s.compensator = CompensatorKind::Inverse),
        ("motor.2.time_constant_s", |s| {
            s.compensator = CompensatorKind::Inverse;
            [0, 1, 3].into_iter().for_each(|motor| s.motors[motor].curve = curve_with(0, 0.1));
        }),
        ("input.frame_hz", |s| s.input.frame_hz = 39),
        ("input.frame_hz", |s| s.input.frame_hz = 4001),
        ("output.frame_hz", |s| s.output.frame_hz = 0),
        ("stop", |s| s.stop = -1),
        ("stop", |s| s.stop = 1),
        ("stop", |s| {
            s.stop = bits(0.5);
            s.motors.iter_mut().for_each(|motor| {
                (motor.disarming, motor.arming) = (Some(bits(0.55)), Some(bits(0.6)));
            });
        }),
        ("stop_pulses_ms", |s| s.stop_pulses_ms = 60_001),
        ("motor.1.disarming", |s| s.motors[1].disarming = Some(s.stop)),
        ("motor.1.disarming", |s| s.motors[1].disarming = Some(-1)),
        ("motor.1.arming", |s| s.motors[1].arming = Some(Levels::PULSES.disarming)),
        ("motor.1.arming", |s| s.motors[1].disarming = Some(bits(0.06))),
        ("motor.1.arming", |s| s.motors[1].arming = Some(HIGHEST_IDLE + 1)),
        ("motor.0.arming", |s| {
            s.input.protocol = PulseProtocol::Dshot600;
            (s.motors[0].disarming, s.motors[0].arming) = (Some(bits(0.1)), Some(bits(0.1) - 1));
        }),
        ("motor.1.arming", |s| s.motors[1].arming = Some(i32::MIN)),
        ("motor.2.idle", |s| s.motors[2].idle = Some(Levels::PULSES.arming - 1)),
        ("motor.2.idle", |s| s.motors[2].idle = Some(i32::MAX)),
        ("motor.2.idle", |s| s.motors[2].idle = Some(HIGHEST_IDLE + 1)),
        ("motor.2.idle", |s| s.motors[2].idle = Some(bits(0.5))),
        ("motor.3.max", |s| s.motors[3].max = Levels::PULSES.idle),
        ("motor.3.max", |s| s.motors[3].max = Command::ONE.to_bits() + 1),
        ("motor.0.hold_ms", |s| s.motors[0].hold_ms = 1001),
        ("excitation.max_duration_s", |s| s.excitation.max_duration_s = 0),
        ("excitation.max_command", |s| s.excitation.max_command = Command::ONE.to_bits() + 1),
        ("excitation.max_amplitude", |s| s.excitation.max_amplitude = 0),
        ("excitation.max_amplitude", |s| s.excitation.max_amplitude = bits(0.26)),
        ("excitation.arm_ms", |s| s.excitation.arm_ms = 10_001),
        ("excitation.ramp_ms", |s| s.excitation.ramp_ms = 99),
        ("recorder_divisor", |s| s.recorder_divisor = 0),
        ("recorder_divisor", |s| s.recorder_divisor = 5001),
    ];
    for (name, change) in refused {
        let mut settings = Settings::default();
        change(&mut settings);
        let error = settings.clone().validate().unwrap_err();
        assert_eq!(error.place.to_string(), *name, "{error}");
        assert!(error.to_string().contains(name), "{error}");

        // And on load, where its checksum is right.
        let mut flash = Nor::blank();
        let bytes = stored(LAYOUT, 1, &postcard::to_stdvec(&settings).unwrap());
        for start in [0, SECTOR] {
            flash.bytes[start..start + bytes.len()].copy_from_slice(&bytes);
        }
        let loaded = store(flash).load();
        assert_eq!((loaded.settings, loaded.origin), (Validated::default(), Origin::DefaultsBad), "{name}");
    }
}

/// The ends of their ranges are taken, and a curve may be stored for a lead too.
#[test]
fn the_ends_of_an_inverses_ranges_are_taken() {
    let taken: &[fn(&mut Settings)] = &[
        |s| s.inverse.natural_rad_s = 2000.0,
        |s| s.inverse.damping = 0.3,
        |s| s.inverse.damping = 2.0,
        |s| s.slew_per_s = 0.0,
        |s| s.slew_per_s = 1e6,
        |s| (s.inverse.compensate_from, s.inverse.compensate_to) = (0, 0),
        |s| (s.inverse.compensate_from, s.inverse.compensate_to) = (Command::ONE.to_bits(), Command::ONE.to_bits()),
        |s| s.motors[1].curve = curve_with(3, 1000.0),
        |s| s.motors[1].curve = curve_with(3, 1.001e-6),
    ];
    for (index, change) in taken.iter().enumerate() {
        let mut settings = Settings::default();
        change(&mut settings);
        let checked = settings.validate();
        assert!(checked.is_ok(), "{index}: {checked:?}");
    }
}

#[test]
fn an_inverse_takes_the_curve_of_every_motor() {
    for missing in 0..MOTORS {
        let mut settings = Settings::clone(&numbered_with_curves(1));
        settings.motors[missing].curve = None;
        let place = SettingId { key: Key::TimeConstantS, motor: Some(missing as u8) };
        assert_eq!(settings.clone().validate(), Err(SettingsError { place, problem: Problem::NoCurve }));
        // A lead does not need it.
        settings.compensator = CompensatorKind::Lead;
        assert!(settings.validate().is_ok());
    }
}

/// On the controller's path from settings, and on the host's from the same points: the same integers.
#[test]
fn each_motor_gets_the_inverse_of_its_own_points() {
    let mut settings = Settings { loop_rate_hz: 4000, compensator: CompensatorKind::Inverse, ..Settings::default() };
    settings.slew_per_s = 60.0;
    settings.inverse =
        Inverse { natural_rad_s: 120.0, damping: 0.8, compensate_from: bits(0.25), compensate_to: bits(0.75) };
    let points = [1.0, 0.9, 1.1, 1.3].map(|factor| {
        let curve = paper_curve().into_iter().map(|point| CurvePoint { tau_s: factor * point.tau_s, ..point });
        curve.collect::<Vec<_>>()
    });
    for (motor, points) in settings.motors.iter_mut().zip(&points) {
        motor.curve = Some(RotorCurve::through(points).unwrap());
    }
    let reference = settings.inverse.reference();
    let range = CommandRange {
        lowest: Command::saturating_from_bits(settings.inverse.compensate_from),
        highest: Command::saturating_from_bits(settings.inverse.compensate_to),
    };
    let settings = settings.validate().unwrap();
    for (filter, points) in filters(&settings).unwrap().into_iter().zip(&points) {
        let design = InverseDesign::new(reference, 4000.0, points).unwrap();
        // 60 a second are 983 whole steps of 2^-16 in a tick of 250 us.
        let slew = design.slew_limit(60.0).unwrap();
        assert_eq!(slew.per_tick(), 983 << 13);
        assert_eq!(filter, Filter::Inverse(InverseFilter { coefficients: *design.coefficients(), slew, range }));
    }
    let [a, b, ..] = filters(&settings).unwrap();
    assert_ne!(a, b);
}

#[test]
fn an_inverse_that_cannot_be_designed_is_refused_with_its_motor() {
    let mut settings = Settings::clone(&numbered_with_curves(0));
    settings.motors[2].curve = curve_with(5, 0.2);
    let error = filters(&settings.validate().unwrap()).unwrap_err();
    let FilterError::Inverse { motor: 2, error: InverseError::CurveTooSteep { .. } } = error else {
        panic!("{error:?}")
    };
    assert!(error.to_string().contains("motor.2.time_constant_s"), "{error}");

    let mut settings = Settings::clone(&numbered_with_curves(0));
    settings.slew_per_s = 0.01;
    let error = filters(&settings.validate().unwrap()).unwrap_err();
    assert!(
        matches!(
            error,
            FilterError::Inverse { motor: 0, error: InverseError::Parameter(DesignError::SlewTooSlow { .. }) }
        ),
        "{error:?}"
    );
    assert!(error.to_string().contains("slew_per_s is 0.01"), "{error}");
}

/// The longest of every number.
#[test]
fn the_longest_set_fits_its_pages_and_a_frame() {
    let one = Command::ONE.to_bits();
    let mut settings = Settings::clone(&numbered_with_curves(0));
    settings.loop_rate_hz = 10_000;
    (settings.inverse.compensate_from, settings.inverse.compensate_to) = (one - 1, one);
    let fast = Pulse { protocol: PulseProtocol::RawDuty, frame_hz: 600 };
    (settings.input, settings.output, settings.stop, settings.stop_pulses_ms) = (fast, fast, bits(0.03), 60_000);
    for motor in &mut settings.motors {
        (motor.disarming, motor.arming, motor.idle) = (Some(bits(0.18)), Some(bits(0.19)), Some(HIGHEST_IDLE));
        motor.max = bits(0.9);
        motor.hold_ms = 1000;
    }
    settings.excitation = ExcitationLimits {
        max_duration_s: 600,
        max_command: one,
        max_amplitude: bits(0.25),
        arm_ms: 10_000,
        ramp_ms: 10_000,
    };
    settings.recorder_divisor = 5000;
    let [from, to] = [0.9, 1.0].map(Command::saturating_from_f64);
    settings.speeds = [Some(SpeedCurve::new(from, to, [52_000, 65_000, 77_000])); MOTORS];
    let settings = settings.validate().unwrap();

    let body = postcard::to_stdvec(&*settings).unwrap();
    let set = stored(LAYOUT, 1, &body);
    assert_eq!((body.len(), set.len()), (798, 814));
    assert!(set.len() <= 2 * PAGE);
    let mut stored = store(Nor::blank());
    stored.save(&settings).unwrap();
    assert_eq!((stored.load().settings, stored.load().origin), (settings.clone(), Origin::Stored));

    let mut frame = [0; FRAME_BYTES];
    let settings = Settings::clone(&settings);
    // Version, tag, kind of message, body and checksum; a byte of COBS for 254, and a zero at either end.
    let payload = 3 + body.len() + 4;
    assert!(payload <= PAYLOAD_BYTES);
    let bound = payload + payload / 254 + 1 + 2;
    assert!(encode(1, &Request::SetSettings(settings.clone()), &mut frame).unwrap() <= bound);
    assert!(encode(1, &Message::Settings(settings), &mut frame).unwrap() <= bound);
}

#[test]
fn a_pulse_that_leaves_no_gap_in_its_frame_is_refused() {
    let with = |protocol, frame_hz| {
        let output = Pulse { protocol, frame_hz };
        Settings { output, ..Settings::default() }.validate().map(|_| ())
    };
    for (protocol, frame_hz, longest_us, max_frame_hz) in [
        (PulseProtocol::StandardPwm, 600, 2000, 495),
        (PulseProtocol::StandardPwm, 496, 2000, 495),
        (PulseProtocol::OneShot125, 4000, 250, 3703),
        (PulseProtocol::OneShot125, 3704, 250, 3703),
    ] {
        let place = SettingId { key: Key::OutputFrameHz, motor: None };
        let problem = Problem::PulseTooLong { longest_us, max_frame_hz };
        assert_eq!(with(protocol, frame_hz), Err(SettingsError { place, problem }));
        assert_eq!(with(protocol, max_frame_hz), Ok(()));
    }
}

#[test]
fn a_raw_duty_without_edges_is_refused() {
    let with = |stop: f64, max: f64| {
        let mut settings = Settings { stop: bits(stop), ..Settings::default() };
        settings.output = Pulse { protocol: PulseProtocol::RawDuty, frame_hz: 600 };
        for motor in &mut settings.motors {
            motor.max = bits(max);
        }
        settings.validate().map(|_| ()).map_err(|error| error.place.to_string())
    };
    // 20 us are 1.2 % of a frame at 600 Hz.
    assert_eq!(with(0.0, 0.98), Err("stop".to_owned()));
    assert_eq!(with(0.0119, 0.98), Err("stop".to_owned()));
    assert_eq!(with(0.0121, 1.0), Err("motor.0.max".to_owned()));
    assert_eq!(with(0.0121, 0.9881), Err("motor.0.max".to_owned()));
    assert_eq!(with(0.0121, 0.9879), Ok(()));
    assert_eq!(with(0.03, 0.9879), Ok(()));
    assert_eq!(with(0.0301, 0.9879), Err("stop".to_owned()), "no ESC stops above 3 %");
}

/// 20 us, the shortest level, are above 3 % of a frame.
#[test]
fn a_stop_is_at_most_3_percent_to_the_step() {
    let with = |stop: i32| {
        let mut settings = Settings { stop, ..Settings::default() };
        settings.output = Pulse { protocol: PulseProtocol::RawDuty, frame_hz: 600 };
        settings.motors.iter_mut().for_each(|motor| motor.max = Command::saturating_from_f64(0.988).to_bits());
        settings.validate()
    };
    let decimal = |value: f64| Command::saturating_from_f64(value).to_bits();
    // 20 us of 600 Hz are 0.012. The decimals at both limits are taken.
    for stop in [decimal(0.012), decimal(0.03)] {
        assert!(with(stop).is_ok(), "{stop}");
    }
    for stop in [decimal(0.012) - 1, decimal(0.03) + 1] {
        assert!(matches!(with(stop).unwrap_err().problem, Problem::NoEdges { .. }), "{stop}");
    }
}

#[test]
fn a_raw_duty_above_1500_hz_is_refused() {
    let with = |change: fn(&mut Settings, Pulse), frame_hz| {
        let mut settings = Settings { stop: bits(0.03), ..Settings::default() };
        settings.output = Pulse { protocol: PulseProtocol::RawDuty, frame_hz: 600 };
        settings.motors.iter_mut().for_each(|motor| motor.max = bits(0.9));
        change(&mut settings, Pulse { protocol: PulseProtocol::RawDuty, frame_hz });
        settings.validate().map(|_| ()).map_err(|error| error.place.to_string())
    };
    assert_eq!(with(|s, pulse| s.output = pulse, 1500), Ok(()));
    assert_eq!(with(|s, pulse| s.output = pulse, 1501), Err("output.frame_hz".to_owned()));
    assert_eq!(with(|s, pulse| s.input = pulse, 1501), Err("input.frame_hz".to_owned()));
}

#[test]
fn frames_that_the_compensator_outruns_are_warned_of() {
    // Amplified up to 100 Hz: frames at 200 Hz are the limit.
    let warnings = |input, output, compensate| {
        let pulse = |frame_hz| Pulse { protocol: PulseProtocol::StandardPwm, frame_hz };
        let mut settings = Settings { input: pulse(input), output: pulse(output), ..Settings::default() };
        let omega_g = settings.lead.omega_f_rad_s.powi(2) / settings.lead.omega_z_rad_s;
        assert!((omega_g / OMEGA_G_RAD_S - 1.0).abs() < 1e-12);
        settings.motors[3].compensate = compensate;
        settings.validate().unwrap().warnings().iter().collect::<Vec<_>>()
    };
    assert_eq!(warnings(50, 400, true), [Warning::SlowFrames(Key::InputFrameHz)]);
    assert_eq!(
        warnings(150, 199, true),
        [Warning::SlowFrames(Key::InputFrameHz), Warning::SlowFrames(Key::OutputFrameHz)]
    );
    assert_eq!(warnings(201, 210, true), []);
    assert_eq!(warnings(50, 60, false), []);
    // Two or more frames to a pulse follow nothing, and others need room to wait for the pulse.
    assert_eq!(warnings(50, 100, false), []);
    assert_eq!(warnings(50, 50, false), [Warning::FramesCannotFollow]);
    assert_eq!(warnings(400, 401, false), []);
}

#[test]
fn a_low_arming_threshold_is_warned_of() {
    let warnings = |arming| {
        let mut settings = Settings::default();
        settings.motors[2].disarming = Some(bits(0.02));
        settings.motors[2].arming = Some(bits(arming));
        settings.validate().unwrap().warnings().iter().collect::<Vec<_>>()
    };
    assert_eq!(warnings(0.039), [Warning::LowArming]);
    assert_eq!(warnings(0.04), []);
}

#[test]
fn a_high_idle_and_levels_above_frames_are_warned_of() {
    let warnings = |change: fn(&mut Settings)| {
        let mut settings = Settings::default();
        change(&mut settings);
        settings.validate().unwrap().warnings().iter().collect::<Vec<_>>()
    };
    assert_eq!(warnings(|s| s.motors[1].idle = Some(bits(0.1))), []);
    assert_eq!(warnings(|s| s.motors[1].idle = Some(bits(0.101))), [Warning::HighIdle]);
    assert_eq!(warnings(|s| s.motors[1].arming = Some(HIGHEST_IDLE)), [Warning::HighIdle], "the idle rises with it");
    let dshot = |settings: &mut Settings| {
        (settings.input.protocol, settings.output.protocol) = (PulseProtocol::Dshot600, PulseProtocol::Dshot600);
    };
    assert_eq!(warnings(dshot), [], "no clock makes a throttle of a stop");
    for level in 0..3 {
        let mut settings = Settings::default();
        dshot(&mut settings);
        let motor = &mut settings.motors[2];
        *[&mut motor.disarming, &mut motor.arming, &mut motor.idle][level] = Some(bits(0.05));
        let warnings = settings.validate().unwrap().warnings();
        assert_eq!(warnings.iter().collect::<Vec<_>>(), [Warning::LevelsAboveFrames]);
    }
}

/// What a frame says is not asked again: 48 turns a motor, and 0 stops it.
#[test]
fn frames_have_no_threshold_unless_one_is_chosen_and_chosen_ones_take_the_others_along() {
    let mut settings = Settings::default();
    assert_eq!(settings.levels(&settings.motors[0]), Levels::PULSES);
    settings.input.protocol = PulseProtocol::Dshot600;
    let lowest = Value::LOWEST_THROTTLE.command().to_bits();
    let levels = |disarming, arming, idle| Levels { disarming, arming, idle };
    assert_eq!(settings.levels(&settings.motors[0]), levels(lowest, lowest, lowest));
    settings.motors[0].disarming = Some(bits(0.01));
    assert_eq!(settings.levels(&settings.motors[0]), levels(bits(0.01), bits(0.01), bits(0.01)));
    settings.motors[0].arming = Some(bits(0.02));
    assert_eq!(settings.levels(&settings.motors[0]), levels(bits(0.01), bits(0.02), bits(0.02)));
    settings.motors[0].idle = Some(bits(0.03));
    assert_eq!(settings.levels(&settings.motors[0]), levels(bits(0.01), bits(0.02), bits(0.03)));
    assert!(settings.clone().validate().is_ok());
    // A raw duty has no edges at so low a command: the levels stay above its stop.
    settings.motors[0] = MotorSettings::default();
    settings.output = Pulse { protocol: PulseProtocol::RawDuty, frame_hz: 600 };
    settings.stop = bits(0.02);
    settings.motors.iter_mut().for_each(|motor| motor.max = bits(0.98));
    assert_eq!(settings.levels(&settings.motors[0]).idle, bits(0.02) + 1);
    assert!(settings.validate().is_ok());
}

#[test]
fn more_frames_or_pulses_than_ticks_are_refused_or_warned_of() {
    let dshot = |loop_rate_hz, frame_hz| {
        let protocol = PulseProtocol::Dshot600Bidirectional;
        let pulse = Pulse { protocol, frame_hz };
        Settings { loop_rate_hz, input: pulse, output: pulse, ..Settings::default() }.validate()
    };
    assert!(dshot(4000, 8000).is_ok());
    let error = dshot(1000, 8000).unwrap_err();
    assert_eq!(error.place, SettingId { key: Key::InputFrameHz, motor: None });
    assert_eq!(error.problem, Problem::FramesOutrunTicks { min_loop_rate_hz: 4000 });
    assert!(error.to_string().contains("loop_rate_hz to 4000 or more"), "{error}");
    assert!(dshot(3999, 8000).is_err());

    let oneshot = |loop_rate_hz| {
        let pulse = Pulse { protocol: PulseProtocol::OneShot125, frame_hz: 2000 };
        let output = Pulse { frame_hz: 2100, ..pulse };
        let settings = Settings { loop_rate_hz, input: pulse, output, ..Settings::default() };
        settings.validate().unwrap().warnings().iter().collect::<Vec<_>>()
    };
    assert_eq!(oneshot(2001), []);
    assert_eq!(oneshot(2000), [Warning::PulsesOutrunTicks]);
}

#[test]
fn settings_of_the_first_layout_are_migrated_and_ground_nobody() {
    let motor = |compensate: bool, arming: f64, idle: f64| {
        let mut bytes = vec![u8::from(compensate)];
        for level in [arming, idle, 0.95] {
            bytes.extend(postcard::to_stdvec(&bits(level)).unwrap());
        }
        bytes.extend(postcard::to_stdvec(&150_u16).unwrap());
        bytes
    };
    // As the documentation of that layout had it: loop rate, filter, pulses, stop, motors, excitation, recorder.
    let set = |output: Pulse, stop: f64, arming: f64| {
        let today = Settings::default();
        let mut bytes = postcard::to_stdvec(&(4000_u32, today.lead, today.input, output, bits(stop))).unwrap();
        for index in 0..4 {
            bytes.extend(motor(index == 2, arming, arming + 0.04));
        }
        bytes.extend(postcard::to_stdvec(&(60_u16, bits(0.6), bits(0.05), 1500_u16, 7_u16)).unwrap());
        bytes
    };
    let loaded = |body: &[u8]| {
        let mut flash = Nor::blank();
        let bytes = stored(1, 5, body);
        for start in [0, SECTOR] {
            flash.bytes[start..start + bytes.len()].copy_from_slice(&bytes);
        }
        store(flash).load()
    };
    let servo = Pulse { protocol: PulseProtocol::StandardPwm, frame_hz: 400 };
    let old = loaded(&set(servo, 0.0, 0.03));
    assert_eq!(old.origin, Origin::Migrated);
    let settings = &old.settings;
    assert_eq!((settings.loop_rate_hz, settings.output, settings.stop), (4000, servo, 0));
    assert_eq!(settings.no_signal, NoSignal::NoPulses, "no ESC is armed by an update");
    assert_eq!((settings.excitation.max_duration_s, settings.recorder_divisor), (60, 7));
    for (index, motor) in settings.motors.iter().enumerate() {
        let same = (motor.compensate, motor.arming, motor.idle, motor.max, motor.hold_ms);
        assert_eq!(same, (index == 2, Some(bits(0.03)), Some(bits(0.07)), bits(0.95), 150), "what armed arms");
        assert!((f64::from(motor.disarming.unwrap()) / f64::from(bits(0.03)) - 0.8).abs() < 1e-6);
    }
    // A stop that would not be taken any more is made one that is; a raw duty keeps its own.
    let paper = Pulse { protocol: PulseProtocol::RawDuty, frame_hz: 600 };
    for (output, stop, expected) in [(servo, 0.01, 0.0), (paper, 0.02, 0.02), (paper, 0.1, 0.03)] {
        let old = loaded(&set(output, stop, 0.15));
        assert_eq!(old.origin, Origin::Migrated, "{stop}");
        assert!((old.settings.stop - bits(expected)).abs() <= 1, "{stop}");
    }
    // The next save has today's layout.
    let mut flash = Nor::blank();
    let bytes = stored(1, 5, &set(servo, 0.0, 0.03));
    flash.bytes[..bytes.len()].copy_from_slice(&bytes);
    let mut mended = store(flash);
    mended.save(&old.settings).unwrap();
    assert_eq!((mended.load().settings, mended.load().origin), (old.settings, Origin::Stored));
    // Of an unknown layout nothing is taken.
    let mut flash = Nor::blank();
    let bytes = stored(9, 1, &postcard::to_stdvec(&Settings::default()).unwrap());
    flash.bytes[..bytes.len()].copy_from_slice(&bytes);
    assert_eq!(store(flash).load().origin, Origin::DefaultsBad);
}

/// The bytes of the second layout: loop rate; zero, poles and damping as `f64`; input and output; stop, what there is without a
/// signal, stop pulses; four motors of compensate, disarming, arming, idle, max, hold; the excitation's duration, command,
/// amplitude, time to arm and ramp; the divisor.
const LAYOUT_2: &str = "a01f 0000000000002c40 0000000000005940 000000000000e83f 029003 012c 00 01 d00f \
     00 a8b8bd14 b2e6cc19 b2e6cc19 8080808004 64 00 a8b8bd14 b2e6cc19 b2e6cc19 8080808004 64 \
     01 a8b8bd14 b2e6cc19 b2e6cc19 8080808002 9601 00 a8b8bd14 b2e6cc19 b2e6cc19 8080808004 64 \
     3c 8080808003 e6cc9933 b817 d00f 07";

#[test]
fn settings_of_the_second_layout_are_migrated_to_a_lead_without_curves() {
    let hex: String = LAYOUT_2.split_whitespace().collect();
    let digits = hex.as_bytes().chunks(2).map(|pair| std::str::from_utf8(pair).unwrap());
    let body: Vec<u8> = digits.map(|pair| u8::from_str_radix(pair, 16).unwrap()).collect();
    let bytes = stored(2, 5, &body);
    let mut flash = Nor::blank();
    for start in [0, SECTOR] {
        flash.bytes[start..start + bytes.len()].copy_from_slice(&bytes);
    }
    let mut store = store(flash);
    let loaded = store.load();
    assert_eq!(loaded.origin, Origin::Migrated);
    let mut expected = Settings {
        loop_rate_hz: 4000,
        lead: Lead { omega_z_rad_s: 14.0, omega_f_rad_s: 100.0, damping: 0.75 },
        input: Pulse { protocol: PulseProtocol::OneShot125, frame_hz: 400 },
        output: Pulse { protocol: PulseProtocol::StandardPwm, frame_hz: 44 },
        no_signal: NoSignal::StopPulses,
        recorder_divisor: 7,
        ..Settings::default()
    };
    expected.motors[2].compensate = true;
    expected.motors[2].max = bits(0.5);
    expected.motors[2].hold_ms = 150;
    expected.excitation.max_duration_s = 60;
    assert_eq!(*loaded.settings, expected);
    assert_eq!(loaded.settings.compensator, CompensatorKind::Lead);
    assert!(loaded.settings.motors.iter().all(|motor| motor.curve.is_none()));
    // The next save has today's layout. A set that was cut short has none.
    store.save(&loaded.settings).unwrap();
    assert_eq!((store.load().settings, store.load().origin), (loaded.settings, Origin::Stored));
    let mut flash = Nor::blank();
    let bytes = stored(2, 5, &body[..body.len() - 1]);
    flash.bytes[..bytes.len()].copy_from_slice(&bytes);
    assert_eq!(self::store(flash).load().origin, Origin::DefaultsBad);
}

/// The bytes of the third layout: loop rate; kind; zero, poles and damping; the inverse's poles, damping, slew and range; input and
/// output; stop, what there is without a signal, stop pulses; four motors of compensate, disarming, arming, idle, max, hold, curve; the
/// excitation; the divisor.
const LAYOUT_3: &str = "a01f 00 0000000000002c40 0000000000005940 000000000000e83f \
     15144196cb8d5740 cd3b7f669ea0e63f 0000000000004440 00 8080808004 059003 059003 00 00 d00f \
     00 a8b8bd14 b2e6cc19 b2e6cc19 8080808004 64 00 01 a2e1f551 c2eba361 c6c2eb63 8080808004 64 00 \
     00 a8b8bd14 b2e6cc19 b2e6cc19 8080808004 64 00 00 a8b8bd14 b2e6cc19 b2e6cc19 8080808004 64 00 \
     78 8080808003 e6cc9933 b817 d00f 07";

/// What nobody had chosen becomes what the input's protocol has; what somebody chose stays; the slew is now that of every
/// compensator.
#[test]
fn settings_of_the_third_layout_are_migrated_and_a_dshot_input_loses_the_levels_of_pulses() {
    let hex: String = LAYOUT_3.split_whitespace().collect();
    let digits = hex.as_bytes().chunks(2).map(|pair| std::str::from_utf8(pair).unwrap());
    let body: Vec<u8> = digits.map(|pair| u8::from_str_radix(pair, 16).unwrap()).collect();
    let load = |body: &[u8]| {
        let bytes = stored(3, 5, body);
        let mut flash = Nor::blank();
        for start in [0, SECTOR] {
            flash.bytes[start..start + bytes.len()].copy_from_slice(&bytes);
        }
        store(flash).load()
    };
    let loaded = load(&body);
    assert_eq!(loaded.origin, Origin::Migrated);
    let line = Pulse { protocol: PulseProtocol::Dshot600, frame_hz: 400 };
    let mut expected = Settings {
        loop_rate_hz: 4000,
        lead: Lead { omega_z_rad_s: 14.0, omega_f_rad_s: 100.0, damping: 0.75 },
        input: line,
        output: line,
        recorder_divisor: 7,
        ..Settings::default()
    };
    let chosen = &mut expected.motors[1];
    chosen.compensate = true;
    (chosen.disarming, chosen.arming, chosen.idle) = (Some(85_899_345), Some(102_005_473), Some(104_689_827));
    assert_eq!(*loaded.settings, expected);
    let lowest = Value::LOWEST_THROTTLE.command().to_bits();
    assert_eq!(loaded.settings.levels(&loaded.settings.motors[0]).arming, lowest);

    // A level beyond what is allowed now makes no pulses.
    let half = postcard::to_stdvec(&bits(0.5)).unwrap();
    let mut beyond = body.clone();
    let place = beyond.windows(4).position(|window| window == [0xb2, 0xe6, 0xcc, 0x19]).unwrap() + 4;
    beyond.splice(place..place + 4, half);
    assert_eq!(load(&beyond).origin, Origin::DefaultsBad);
}

/// The bytes of the fourth layout: as the third, but for the inverse's slew, which is behind the output, the resumption behind the stop
/// pulses, and levels that may be none.
const LAYOUT_4: &str = "8827 01 e17a14ae47412c40 15144196cb8d5740 cd3b7f669ea0e63f \
     15144196cb8d5740 cd3b7f669ea0e63f 00 8080808004 01ea03 01ef03 0000000000003440 00 00 d00f 00 \
     00 00 00 00 8080808004 64 CURVE 01 01a2e1f551 01c2eba361 01c6c2eb63 8080808004 64 CURVE \
     00 00 00 00 8080808004 64 CURVE 00 00 00 00 8080808004 64 CURVE \
     78 8080808003 e6cc9933 b817 d00f 07";

#[test]
fn settings_of_the_fourth_layout_are_migrated_without_speeds() {
    // Time constants of 1/16 s.
    let curve = format!("01 {}", "0000803d".repeat(33));
    let hex: String = LAYOUT_4.replace("CURVE", &curve).split_whitespace().collect();
    let digits = hex.as_bytes().chunks(2).map(|pair| std::str::from_utf8(pair).unwrap());
    let body: Vec<u8> = digits.map(|pair| u8::from_str_radix(pair, 16).unwrap()).collect();
    let bytes = stored(4, 5, &body);
    let mut flash = Nor::blank();
    for start in [0, SECTOR] {
        flash.bytes[start..start + bytes.len()].copy_from_slice(&bytes);
    }
    let loaded = store(flash).load();
    assert_eq!(loaded.origin, Origin::Migrated);
    let mut expected =
        Settings { compensator: CompensatorKind::Inverse, resume: false, recorder_divisor: 7, ..Settings::default() };
    let tau_s = RotorCurve::from_time_constants_s([1.0 / 16.0; 33]);
    expected.motors.iter_mut().for_each(|motor| motor.curve = Some(tau_s));
    let chosen = &mut expected.motors[1];
    chosen.compensate = true;
    (chosen.disarming, chosen.arming, chosen.idle) = (Some(85_899_345), Some(102_005_473), Some(104_689_827));
    assert_eq!(*loaded.settings, expected);
    assert_eq!(loaded.settings.speeds, [None; MOTORS]);
}

/// Speeds are asked for where they are used, with replies to go by.
#[test]
fn a_correction_needs_speeds_that_rise_and_replies() {
    let erpm = |from: f64, to: f64, erpm: [u32; 3]| {
        let [from, to] = [from, to].map(Command::saturating_from_f64);
        Some(SpeedCurve::new(from, to, erpm))
    };
    let good = erpm(0.3, 0.5, [52_000, 65_000, 77_000]);
    let rpm = |change: &dyn Fn(&mut Settings)| {
        let output = Pulse { protocol: PulseProtocol::Dshot300Bidirectional, frame_hz: 1000 };
        let mut settings = Settings { compensator: CompensatorKind::Rpm, output, ..Settings::default() };
        for motor in &mut settings.motors {
            motor.curve = Some(RotorCurve::from_time_constants_s([0.05; 33]));
        }
        settings.motors[2].compensate = true;
        settings.speeds[2] = good;
        change(&mut settings);
        settings.validate().map(drop).map_err(|error| (error.place.to_string(), error.problem, error.to_string()))
    };
    assert_eq!(rpm(&|_| {}), Ok(()));
    let refused = |change: &dyn Fn(&mut Settings), place: &str, problem: Problem| {
        let (found, why, sentence) = rpm(change).unwrap_err();
        assert_eq!((&*found, why), (place, problem), "{sentence}");
        assert!(sentence.contains(place), "{sentence}");
    };
    refused(&|settings| settings.speeds[2] = None, "motor.2.erpm", Problem::NoSpeed);
    refused(&|settings| settings.motors[3].curve = None, "motor.3.time_constant_s", Problem::NoCurve);
    refused(&|settings| settings.output.protocol = PulseProtocol::Dshot300, "output.protocol", Problem::NeedsReplies);
    for speeds in [[52_000, 52_000, 52_000], [52_000, 80_000, 77_000], [52_000, 50_000, 77_000]] {
        let falls = |settings: &mut Settings| settings.speeds[1] = erpm(0.3, 0.5, speeds);
        refused(&falls, "motor.1.erpm", Problem::SpeedFalls);
    }
    for (from, to, speeds) in [
        (0.3, 0.34, [52_000, 65_000, 77_000]),
        (0.5, 0.3, [52_000, 65_000, 77_000]),
        (0.3, 0.5, [999, 65_000, 77_000]),
        (0.3, 0.5, [52_000, 65_000, 1_000_001]),
        (0.3, 0.5, [52_000, u32::MAX, 77_000]),
    ] {
        let (place, problem, _) = rpm(&|settings| settings.speeds[1] = erpm(from, to, speeds)).unwrap_err();
        assert!(place == "motor.1.erpm" && matches!(problem, Problem::OutOfRange { .. }), "{place} {problem:?}");
    }
}

#[test]
fn what_was_saved_is_loaded_through_many_saves_and_few_erases() {
    let mut store = store(Nor::blank());
    assert_eq!(store.load().origin, Origin::DefaultsBlank);
    for number in 0..101 {
        store.save(&numbered(number)).unwrap();
        let loaded = store.load();
        assert_eq!((loaded.settings, loaded.origin), (numbered(number), Origin::Stored));
    }
    // Four to a sector; the first four need none.
    assert_eq!(store.into_flash().erases, 2 * 25);
}

#[test]
fn one_wrong_byte_anywhere_changes_nothing() {
    // Sectors with one used slot, some, and all.
    for saves in [1, 3, 4, 5, 8] {
        let flash = saved(saves);
        for address in 0..flash.bytes.len() {
            for wrong in [0x00, 0xff, flash.bytes[address] ^ 0x01, flash.bytes[address] ^ 0x80] {
                let mut flash = flash.clone();
                flash.bytes[address] = wrong;
                let mut store = store(flash);
                let loaded = store.load();
                assert_eq!(loaded.settings, numbered(saves - 1), "byte {address} is {wrong:#x} after {saves} saves");
                assert!(matches!(loaded.origin, Origin::Stored | Origin::StoredOnce));
            }
        }
    }
}

#[test]
fn a_wrong_byte_in_each_copy_gives_the_defaults_and_says_so() {
    let flash = saved(1);
    let used = flash.bytes[..PAGE].iter().rposition(|&byte| byte != 0xff).unwrap() + 1;
    println!("{used} bytes of {PAGE}");
    for address in 0..used {
        let mut flash = flash.clone();
        flash.bytes[address] ^= 0x10;
        flash.bytes[SECTOR + (address * 7) % used] ^= 0x02;
        let mut store = store(flash);
        let loaded = store.load();
        assert_eq!((loaded.settings, loaded.origin), (Validated::default(), Origin::DefaultsBad), "byte {address}");
        // And that can be mended.
        store.save(&numbered(9)).unwrap();
        assert_eq!(store.load().origin, Origin::Stored);
    }
}

/// Cuts the power at every byte of a save of `new` into `flash`; gives what is left each time.
fn cuts<'a>(flash: &'a Nor, new: &'a Validated) -> impl Iterator<Item = Nor> + 'a {
    let steps = {
        let mut whole = store(flash.clone());
        whole.save(new).unwrap();
        whole.into_flash().steps - flash.steps
    };
    (0..steps).map(move |cut| {
        let mut cut_short = store(Nor { cut_after: Some(cut), ..flash.clone() });
        assert_eq!(cut_short.save(new), Err(SaveError::Flash), "cut after {cut} bytes");
        let mut left = cut_short.into_flash();
        left.power_on();
        left
    })
}

#[test]
fn a_power_cut_at_any_byte_of_a_save_leaves_the_old_or_the_new_set() {
    // With and without an erase, in either direction.
    for (saves, erases_backwards) in [(1, false), (3, false), (4, false), (4, true), (5, false)] {
        let flash = Nor { erases_backwards, ..saved(saves) };
        let (old, new, newer) = (numbered(saves - 1), numbered(saves), numbered(100));
        let (mut olds, mut news) = (0, 0);
        for left in cuts(&flash, &new) {
            let loaded = store(left.clone()).load();
            if loaded.settings == old {
                olds += 1;
            } else {
                assert_eq!(loaded.settings, new);
                news += 1;
            }
            let mut mended = store(left);
            mended.save(&newer).unwrap();
            let loaded = mended.load();
            assert_eq!((loaded.settings, loaded.origin), (newer.clone(), Origin::Stored));
        }
        println!(
            "{saves} saves before, backwards {erases_backwards}: {olds} cuts leave the old set, {news} the new one"
        );
        assert!(olds > 0 && news > 0);
    }
}

#[test]
fn a_second_power_cut_while_mending_the_first_leaves_one_of_the_sets_too() {
    let flash = saved(2);
    let (old, new, newer) = (numbered(1), numbered(2), numbered(3));
    for left in cuts(&flash, &new) {
        let first = store(left.clone()).load().settings;
        assert!(first == old || first == new);
        for left in cuts(&left, &newer).step_by(3) {
            let second = store(left).load().settings;
            assert!(second == first || second == newer);
        }
    }
}

#[test]
fn a_cut_in_the_very_first_save_leaves_defaults_or_the_new_set() {
    for left in cuts(&Nor::blank(), &numbered(7)) {
        let loaded = store(left).load();
        assert!(loaded.settings == Validated::default() || loaded.settings == numbered(7));
    }
}

#[test]
fn a_worn_byte_is_found_when_it_is_written_and_the_old_set_stays() {
    let flash = saved(1);
    // Page 1 of the first sector, where the next save begins.
    let mut store = store(Nor { worn: Some((PAGE + 20, 0xff)), ..flash });
    assert_eq!(store.save(&numbered(1)), Err(SaveError::ReadBack));
    assert_eq!(store.load().settings, numbered(0));
}

/// Settings with four curves take two pages.
#[test]
fn a_set_of_two_pages_is_as_safe() {
    let filled = |saves: u16| {
        let mut filled = store(Nor::blank());
        for number in 0..saves {
            filled.save(&numbered_with_curves(number)).unwrap();
            let loaded = filled.load();
            assert_eq!((loaded.settings, loaded.origin), (numbered_with_curves(number), Origin::Stored));
        }
        filled.into_flash()
    };
    // Two sets to a sector.
    let flash = filled(9);
    assert_eq!(flash.erases, 2 * 4);
    assert!(flash.bytes[PAGE..2 * PAGE].iter().any(|&byte| byte != 0xff), "a set takes a second page");
    for address in 0..flash.bytes.len() {
        for wrong in [0x00, 0xff, flash.bytes[address] ^ 0x01, flash.bytes[address] ^ 0x80] {
            let mut flash = flash.clone();
            flash.bytes[address] = wrong;
            assert_eq!(store(flash).load().settings, numbered_with_curves(8), "byte {address} is {wrong:#x}");
        }
    }
    // Without an erase and with one; after sets of one page, and before one.
    let mixed = |sets: &[Validated]| {
        let mut store = store(Nor::blank());
        sets.iter().for_each(|set| store.save(set).unwrap());
        store.into_flash()
    };
    let (long, short) = (numbered_with_curves(100), numbered(101));
    for (before, old, new) in [
        (filled(1), numbered_with_curves(0), &long),
        (filled(2), numbered_with_curves(1), &long),
        (mixed(&[numbered(0), numbered(1), numbered(2)]), numbered(2), &long),
        (mixed(&[numbered(0), numbered_with_curves(1)]), numbered_with_curves(1), &short),
    ] {
        let mut seen = [0; 2];
        for left in cuts(&before, new) {
            let loaded = store(left.clone()).load().settings;
            let is_new = loaded == *new;
            assert!(is_new || loaded == old);
            seen[usize::from(is_new)] += 1;
            let mut mended = store(left);
            mended.save(&numbered_with_curves(9)).unwrap();
            assert_eq!((mended.load().settings, mended.load().origin), (numbered_with_curves(9), Origin::Stored));
        }
        println!("{} cuts leave the old set, {} the new one", seen[0], seen[1]);
        assert!(seen[0] > 0 && seen[1] > 0);
    }
}

#[test]
fn the_stored_form_is_the_documented_one() {
    let flash = saved(1);
    let expected = stored(LAYOUT, 1, &postcard::to_stdvec(&*numbered(0)).unwrap());
    assert_eq!(flash.bytes[..expected.len()], expected);
    assert_eq!(flash.bytes[SECTOR..SECTOR + expected.len()], expected);
}

proptest! {
    #![proptest_config(cases(2000))]

    #[test]
    fn no_bytes_in_flash_make_the_loader_panic_or_load_what_is_not_valid(
        bytes in proptest::collection::vec(any::<u8>(), 0..2200)
    ) {
        fuzz_settings(&bytes);
    }

    #[test]
    fn nor_do_settings_with_some_bytes_changed(
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4)
    ) {
        let mut bytes = postcard::to_stdvec(&Settings::default()).unwrap();
        for (index, byte) in changes {
            *index.get_mut(&mut bytes) = byte;
        }
        fuzz_settings(&bytes);
    }
}
