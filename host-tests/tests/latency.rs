//! From a flight controller's pulse to the ESC's: the controller's own tick and frames, on a timer in memory.

use host_tests::board::{CRYSTAL, TestBoard, TestOutputs, facts};
use host_tests::flash::Flash;
use host_tests::rig::SECTOR;
use rotorlead::capture::{Reading, Signal};
use rotorlead::controller::{Control, FrameAction, FramePacer, Plan};
use rotorlead::settings::{MOTORS, Pulse, PulseProtocol, Settings, Store, Validated};
use rotorlead::throttle::{Command, PulseScale};

/// Mean, longest and standard deviation, milliseconds.
#[derive(Debug)]
struct Latency {
    mean: f64,
    worst: f64,
    jitter: f64,
}

/// Input filter and the time for which the line must have stayed low, seconds.
const RECOGNIZED_S: f64 = 2.2e-6;

fn settings(protocol: PulseProtocol, input_hz: u16, output_hz: u16) -> Validated {
    let bits = |value: f64| Command::saturating_from_f64(value).to_bits();
    let pulse = |frame_hz| Pulse { protocol, frame_hz };
    let mut settings = Settings { input: pulse(input_hz), output: pulse(output_hz), ..Settings::default() };
    if protocol == PulseProtocol::RawDuty {
        settings.stop = bits(0.02);
        settings.motors.iter_mut().for_each(|motor| motor.max = bits(0.98));
    }
    settings.validate().unwrap()
}

/// From the beginning of each input pulse to the beginning of the output pulse that has its value, over 20 s: commands
/// around one half, from a flight controller whose clock is `drift` off. `follows`: as the settings say; otherwise frames
/// run by themselves, as they did before they followed the input. Gives the shortest and the longest frame, too.
fn latency(settings: &Validated, drift: f64, follows: bool) -> (Latency, [f64; 2]) {
    let timer_hz = CRYSTAL.timer_hz;
    let mut plan = Plan::new(settings, timer_hz, true).unwrap();
    if !follows {
        plan.frames.longest = plan.frames.shortest;
    }
    let mut store = Store::new(Flash::<SECTOR>::blank(), Flash::<SECTOR>::SECTORS);
    store.save(settings).unwrap();
    let (mut board, ..) = TestBoard::start(store, facts(CRYSTAL));
    if !follows {
        // The same tick, whose frames wait for nothing.
        board.control.reconfigure(settings, channels(settings), &plan);
    }
    let control: &mut Control<TestOutputs> = &mut board.control;
    control.hardware_mut().starts.clear();

    let input = PulseScale::new(settings.input.protocol(), timer_hz).unwrap();
    let counter_hz = f64::from(plan.frames.counter_hz);
    let tick_s = 1.0 / f64::from(settings.loop_rate_hz);
    let counts_per_tick = counter_hz * tick_s;
    let period_s = (1.0 + drift) / f64::from(settings.input.frame_hz);
    let command =
        |n: u32| Command::saturating_from_f64(if n < 10 { 0.021 } else { 0.45 + 0.1 * f64::from(n * 7 % 11) / 11.0 });
    let (mut begun, mut all) = (Vec::new(), Vec::new());
    let (mut next, mut frames_seen) = (0_u32, 0);
    // Every pulse that waits goes out with the first frame since.
    let mut go_out = |hardware: &TestOutputs, begun: &mut Vec<f64>| {
        let starts = &hardware.starts[frames_seen..];
        frames_seen = hardware.starts.len();
        if let Some(&start) = starts.first() {
            let start_s = start as f64 / counter_hz;
            all.extend(begun.drain(..).map(|rise_s| 1e3 * (start_s - rise_s)));
        }
    };
    let ticks = (20.0 / tick_s) as u32;
    for tick in 1..=ticks {
        let now_s = f64::from(tick) * tick_s;
        let hardware = control.hardware_mut();
        let step = f64::from(tick) * counts_per_tick - hardware.time as f64;
        hardware.advance(step.round() as u32);
        go_out(hardware, &mut begun);
        // The newest pulse that has ended.
        let mut signal = if next == 0 { Signal::Nothing } else { Signal::Unchanged };
        loop {
            let rise_s = 0.001 + f64::from(next) * period_s;
            let width_ticks = input.to_ticks(command(next));
            if rise_s + f64::from(width_ticks) / f64::from(timer_hz) + RECOGNIZED_S > now_s {
                break;
            }
            signal = Signal::Pulse { width_ticks, period_ticks: (period_s * f64::from(timer_hz)) as u32 };
            begun.push(rise_s);
            next += 1;
        }
        control.run([signal.into(), Reading::NOTHING, Reading::NOTHING, Reading::NOTHING], true);
        go_out(control.hardware_mut(), &mut begun);
    }
    // Until the first frames have found the input.
    all.drain(..20);
    let lengths: Vec<f64> =
        control.hardware_mut().starts.windows(2).skip(20).map(|pair| (pair[1] - pair[0]) as f64 / counter_hz).collect();
    let extremes = lengths.iter().fold([f64::INFINITY, 0.0], |[low, high]: [f64; 2], &s| [low.min(s), high.max(s)]);
    let count = all.len() as f64;
    let mean = all.iter().sum::<f64>() / count;
    let jitter = (all.iter().map(|ms| (ms - mean).powi(2)).sum::<f64>() / count).sqrt();
    (Latency { mean, worst: all.iter().fold(0.0, |worst: f64, &ms| worst.max(ms)), jitter }, extremes)
}

fn channels(settings: &Validated) -> [rotorlead::channel::Channel; MOTORS] {
    let coefficients = rotorlead::controller::coefficients(settings).unwrap();
    rotorlead::controller::channels(settings, coefficients).unwrap()
}

/// Drifts of a flight controller's crystal, and one of an oscillator.
const DRIFTS: [f64; 4] = [-1e-2, -1e-4, 1e-4, 1e-2];

#[test]
fn frames_that_run_by_themselves_have_the_latencies_of_the_documentation() {
    for (protocol, hz, mean, worst) in [
        (PulseProtocol::StandardPwm, 400, 2.85, 4.7),
        (PulseProtocol::RawDuty, 600, 1.77, 3.5),
        (PulseProtocol::OneShot125, 3703, 0.42, 0.72),
    ] {
        let input_hz = if protocol == PulseProtocol::OneShot125 { 1000 } else { hz };
        let (found, _) = latency(&settings(protocol, input_hz, hz), 1e-3, false);
        println!("{protocol:?} at {hz} Hz, free: {found:?}");
        // Commands are around one half here, 0.45 to 0.55.
        assert!((found.mean - mean).abs() < 0.03 * mean, "{protocol:?}: {found:?}");
        assert!(found.worst <= worst, "{protocol:?}: {found:?}");
    }
}

#[test]
fn frames_that_follow_the_input_wait_for_a_tick_and_not_for_a_frame() {
    for (protocol, input_hz, output_hz) in [
        (PulseProtocol::StandardPwm, 400, 450),
        (PulseProtocol::StandardPwm, 333, 400),
        (PulseProtocol::OneShot125, 2000, 2400),
    ] {
        let settings = settings(protocol, input_hz, output_hz);
        let pulse_ms = if protocol == PulseProtocol::StandardPwm { 1.5 } else { 0.1875 };
        for drift in DRIFTS {
            let (before, _) = latency(&settings, drift, false);
            let (after, [shortest, _]) = latency(&settings, drift, true);
            println!("{protocol:?} {input_hz} -> {output_hz} Hz, drift {drift}: before {before:?}, after {after:?}");
            // The pulse, and half a tick of 200 us.
            assert!((after.mean - (pulse_ms + 0.1)).abs() < 0.05, "{after:?}");
            // The longest pulse here is 5 % of the range longer, and a tick.
            assert!(after.worst < pulse_ms * 1.05 + 0.21, "{after:?}");
            assert!(after.jitter < 0.08, "{after:?}");
            assert!(after.mean < before.mean && after.jitter < 0.5 * before.jitter, "{before:?} {after:?}");
            assert!(shortest >= 1.0 / f64::from(output_hz) - 1e-9, "a frame of {shortest} s");
        }
    }
    // About 1.2 ms less at 400 Hz.
    let settings = settings(PulseProtocol::StandardPwm, 400, 450);
    let gain = latency(&settings, 1e-3, false).0.mean - latency(&settings, 1e-3, true).0.mean;
    assert!((1.0..1.3).contains(&gain), "{gain}");
}

#[test]
fn frames_never_come_faster_than_their_rate_and_no_pulse_is_cut() {
    // The input faster than the output may be, as fast, and slower; the timer in memory panics where a pulse is cut.
    for (input_hz, output_hz) in [(490, 450), (450, 450), (449, 450), (400, 450), (240, 450), (50, 400)] {
        for drift in DRIFTS {
            let settings = settings(PulseProtocol::StandardPwm, input_hz, output_hz);
            let (_, [shortest, longest]) = latency(&settings, drift, true);
            assert!(shortest >= 1.0 / f64::from(output_hz) - 1e-9, "{input_hz} -> {output_hz}: {shortest} s");
            let patience = (9.0 / 8.0 / f64::from(input_hz) + 2e-4).max(1.0 / f64::from(output_hz));
            assert!(longest <= patience + 1e-6, "{input_hz} -> {output_hz}: {longest} s");
        }
    }
}

#[test]
fn without_pulses_the_frames_go_on_at_the_longest() {
    let plan = Plan::new(&Validated::default(), CRYSTAL.timer_hz, true).unwrap();
    let mut pacer = FramePacer::new(&plan.frames);
    for count in (0..plan.frames.longest).step_by(4200) {
        assert_eq!(pacer.tick(false, count), FrameAction::None);
    }
    // A pulse in a frame that is too young ends it at the shortest, and in an old one at once.
    assert_eq!(pacer.tick(true, 100), FrameAction::EndAt(plan.frames.shortest));
    assert_eq!(pacer.tick(true, 4300), FrameAction::None, "it is under way");
    assert_eq!(pacer.tick(false, 50), FrameAction::EndAt(plan.frames.longest), "the next one waits again");
    assert_eq!(pacer.tick(true, plan.frames.shortest), FrameAction::Restart);
}

/// The rows of the table in docs/firmware.md.
fn documented() -> Vec<Vec<String>> {
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/firmware.md");
    let text = std::fs::read_to_string(file).unwrap();
    let rows = text.lines().skip_while(|line| !line.starts_with("| protocol | Hz in ")).skip(2);
    let rows = rows.take_while(|line| line.starts_with('|'));
    rows.map(|row| row.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect()).collect()
}

#[test]
fn the_latencies_of_the_documentation_are_the_sums_of_its_steps() {
    let rows = documented();
    assert_eq!(rows.len(), 5);
    for row in rows {
        let number = |cell: &str| cell.split([' ', '°']).next().unwrap().parse::<f64>().unwrap();
        let (input_hz, output_hz) = (number(&row[1]), number(&row[2]));
        let (protocol, low_ms, high_ms) = match row[0].as_str() {
            "standard PWM" => (PulseProtocol::StandardPwm, 1.0, 2.0),
            "OneShot125" => (PulseProtocol::OneShot125, 0.125, 0.25),
            "raw duty" => (PulseProtocol::RawDuty, 0.0, 1e3 / input_hz),
            other => panic!("{other}"),
        };
        let settings = settings(protocol, input_hz as u16, output_hz as u16);
        let locked = settings.output_follows_input() && output_hz > input_hz;
        assert_eq!(row[3], if locked { "follow" } else { "run freely" }, "{row:?}");
        let (tick_ms, frame_ms, range_ms) = (0.2, 1e3 / output_hz, high_ms - low_ms);
        // Two pulses may end closer together than a frame, by the range of the pulse and a tick.
        let wait = if locked { (frame_ms - (1e3 / input_hz - range_ms - tick_ms)).max(0.0) } else { frame_ms };
        let mean =
            0.5 * (low_ms + high_ms) + 1e3 * RECOGNIZED_S + 0.5 * tick_ms + if locked { 0.0 } else { 0.5 * frame_ms };
        let most = high_ms + 1e3 * RECOGNIZED_S + tick_ms + wait;
        let degrees = (94.0 * 1e-3 * mean).to_degrees();
        let (found, _) = latency(&settings, 1e-3, locked);
        println!("{row:?}: {mean:.3} {most:.3} {degrees:.2} {found:?}");
        for (cell, value, unit) in [(4, mean, 0.01), (5, most, 0.01), (6, degrees, 0.1), (7, found.jitter, 0.01)] {
            assert!((number(&row[cell]) - value).abs() <= 0.51 * unit, "{row:?}: {} is {value}", row[cell]);
        }
        assert!(found.worst <= most, "{row:?}: {found:?}");
    }
}
