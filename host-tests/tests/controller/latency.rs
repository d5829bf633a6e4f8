//! From a flight controller's pulse to the ESC's: the controller's own tick and frames, on a timer in memory.

use host_tests::board::{CRYSTAL, TestBoard, TestHardware, TestOutputs, facts};
use host_tests::flash::Flash;
use host_tests::rig::SECTOR;
use rotorlead::capture::{InputReading, Signal};
use rotorlead::controller::{Control, FrameAction, FramePacer, Frames, InputPulse, OutputPlan, Plan};
use rotorlead::settings::{MOTORS, Pulse, PulseProtocol, Settings, Store, Validated};
use rotorlead::throttle::Command;
use rotorlead_design::Latency as ModelLatency;

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

/// The commands of a flight controller, by the number of the pulse.
#[derive(Clone, Copy, Debug)]
enum Commands {
    /// One half, always.
    Half,
    /// From 0.45 to 0.55.
    AroundHalf,
    /// Whole steps and small ones, so that pulses end as far apart and as close together as they can.
    Steps,
}

impl Commands {
    fn get(self, n: u32) -> f64 {
        match self {
            Self::Half => 0.5,
            Self::AroundHalf => 0.45 + 0.1 * f64::from(n * 7 % 11) / 11.0,
            Self::Steps => {
                // One of five levels for one to eight pulses, by the bits of a multiplicative hash.
                let run = (n / 8).wrapping_mul(0x9E37_79B1);
                let level = if n % 8 < 1 + (run >> 29) { run >> 13 } else { run >> 17 };
                f64::from(level % 5) / 4.0
            }
        }
    }
}

/// Seconds that are measured, and those before.
const MEASURED_S: f64 = 18.0;
const CATCH_UP_S: f64 = 2.0;

/// From the beginning of each input pulse to the beginning of the output pulse that has its value, for a flight controller
/// whose clock is `drift` off; and the shortest and the longest frame, seconds.
fn latency(settings: &Validated, drift: f64, commands: Commands) -> (Latency, [f64; 2]) {
    play(settings, &Plan::new(settings, CRYSTAL.timer_hz, true).unwrap(), drift, commands, 0)
}

/// The frames of outputs with pulses.
fn frames(plan: &Plan) -> Frames {
    plan.output.pulses().expect("outputs with pulses").1
}

/// [`latency`] of frames that run by themselves.
fn free_latency(settings: &Validated, drift: f64) -> Latency {
    let mut plan = Plan::new(settings, CRYSTAL.timer_hz, true).unwrap();
    if let OutputPlan::Pulses { frames, .. } = &mut plan.output {
        frames.longest = frames.shortest;
    }
    play(settings, &plan, drift, Commands::AroundHalf, 0).0
}

/// [`latency`] with another plan, and with interrupts that take so many counts each time that a frame is ended.
fn play(settings: &Validated, plan: &Plan, drift: f64, commands: Commands, interrupted: u32) -> (Latency, [f64; 2]) {
    let timer_hz = CRYSTAL.timer_hz;
    let mut store = Store::new(Flash::<SECTOR>::blank(), Flash::<SECTOR>::SECTORS);
    store.save(settings).unwrap();
    let (mut board, ..) = TestBoard::start(store, facts(CRYSTAL));
    board.control.reconfigure(settings, &channels(settings), plan);
    let control: &mut Control<TestHardware> = &mut board.control;
    control.parts_mut().outputs.starts.clear();
    control.parts_mut().outputs.interrupted = interrupted;

    let input = settings.input.scale(timer_hz).unwrap();
    let counter_hz = f64::from(frames(plan).counter_hz);
    let tick_s = 1.0 / f64::from(settings.loop_rate_hz);
    let counts_per_tick = counter_hz * tick_s;
    let period_s = (1.0 + drift) / f64::from(settings.input.frame_hz);
    let command = |n: u32| Command::saturating_from_f64(commands.get(n));
    let (mut begun, mut all) = (Vec::new(), Vec::new());
    let (mut next, mut frames_seen) = (0_u32, 0);
    // Every pulse that waits goes out with the first frame since.
    let mut go_out = |outputs: &TestOutputs, begun: &mut Vec<f64>| {
        let starts = &outputs.starts[frames_seen..];
        frames_seen = outputs.starts.len();
        if let Some(&start) = starts.first() {
            let start_s = start as f64 / counter_hz;
            all.extend(begun.drain(..).map(|rise_s| 1e3 * (start_s - rise_s)));
        }
    };
    let ticks = ((CATCH_UP_S + MEASURED_S) / tick_s) as u32;
    for tick in 1..=ticks {
        let now_s = f64::from(tick) * tick_s;
        let outputs = &mut control.parts_mut().outputs;
        let step = f64::from(tick) * counts_per_tick - outputs.time as f64;
        outputs.advance(step.max(0.0).round() as u32);
        go_out(outputs, &mut begun);
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
        control.run([signal.into(), InputReading::NOTHING, InputReading::NOTHING, InputReading::NOTHING], true);
        go_out(&control.parts_mut().outputs, &mut begun);
    }
    // Until the frames have caught up with the input, which takes them long where their rates are nearly the same.
    all.drain(..(CATCH_UP_S / period_s) as usize);
    let starts = &control.parts_mut().outputs.starts;
    let lengths: Vec<f64> = starts.windows(2).skip(20).map(|pair| (pair[1] - pair[0]) as f64 / counter_hz).collect();
    let extremes = lengths.iter().fold([f64::INFINITY, 0.0], |[low, high]: [f64; 2], &s| [low.min(s), high.max(s)]);
    let count = all.len() as f64;
    let mean = all.iter().sum::<f64>() / count;
    let jitter = (all.iter().map(|ms| (ms - mean).powi(2)).sum::<f64>() / count).sqrt();
    (Latency { mean, worst: all.iter().fold(0.0, |worst: f64, &ms| worst.max(ms)), jitter }, extremes)
}

fn channels(settings: &Validated) -> [rotorlead::channel::Channel; MOTORS] {
    rotorlead::controller::channels(settings, rotorlead::controller::filters(settings).unwrap()).unwrap()
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
        let settings = settings(protocol, hz, hz);
        assert!(!settings.output_follows_input());
        let (found, _) = latency(&settings, 1e-3, Commands::AroundHalf);
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
            let before = free_latency(&settings, drift);
            let (after, [shortest, _]) = latency(&settings, drift, Commands::AroundHalf);
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
    let gain = free_latency(&settings, 1e-3).mean - latency(&settings, 1e-3, Commands::AroundHalf).0.mean;
    assert!((1.0..1.3).contains(&gain), "{gain}");
}

/// Protocol, and frames per second in and out, at which frames follow.
const FOLLOWING: [(PulseProtocol, u16, u16); 8] = [
    (PulseProtocol::StandardPwm, 400, 450),
    (PulseProtocol::StandardPwm, 400, 401),
    (PulseProtocol::StandardPwm, 333, 400),
    (PulseProtocol::StandardPwm, 490, 495),
    (PulseProtocol::StandardPwm, 50, 60),
    (PulseProtocol::OneShot125, 2000, 2400),
    (PulseProtocol::OneShot125, 3000, 3300),
    (PulseProtocol::OneShot125, 3400, 3600),
];
const LOOP_RATES_HZ: [u32; 3] = [1000, 5000, 10_000];

#[test]
fn the_models_latency_is_that_of_the_timer() {
    let following = FOLLOWING.map(|(protocol, input_hz, output_hz)| (protocol, input_hz, protocol, output_hz));
    let mixed = [(PulseProtocol::StandardPwm, 400, PulseProtocol::OneShot125, 450)];
    for (input_protocol, input_hz, protocol, output_hz) in following.into_iter().chain(mixed) {
        for loop_rate_hz in LOOP_RATES_HZ {
            let mut changed = Settings::clone(&settings(input_protocol, input_hz, output_hz));
            changed.output.protocol = protocol;
            changed.loop_rate_hz = loop_rate_hz;
            let settings = changed.validate().unwrap();
            assert_eq!(
                settings.output_follows_input(),
                u32::from(input_hz) < loop_rate_hz,
                "{input_hz} -> {output_hz}"
            );
            if !settings.output_follows_input() {
                // Ticks that are rarer than pulses lose some.
                continue;
            }
            let model = ModelLatency::new(settings.input, settings.output, f64::from(loop_rate_hz)).unwrap();
            let [mean_ms, worst_ms] = [model.total().mean_s, model.total().worst_s].map(|s| 1e3 * s);
            // The phase of the pulses goes through one tick, one way and the other.
            for drift in [-1.0, 1.0].map(|ticks| ticks / f64::from(loop_rate_hz) / MEASURED_S) {
                let (steady, _) = latency(&settings, drift, Commands::Half);
                let (steps, _) = latency(&settings, drift, Commands::Steps);
                let at = format!("{protocol:?} {input_hz} -> {output_hz} at {loop_rate_hz} Hz, drift {drift}");
                println!("{at}: {mean_ms:.3}, {worst_ms:.3}; {steady:?} {steps:?}");
                assert!((steady.mean - mean_ms).abs() < 0.01, "{at}: {mean_ms} ms, and {steady:?}");
                assert!(steps.worst <= worst_ms + 1e-3, "{at}: {worst_ms} ms, and {steps:?}");
            }
        }
    }
}

#[test]
fn frames_never_come_faster_than_their_rate_and_no_pulse_is_cut() {
    // The input faster than the output may be, as fast, and slower; the timer in memory panics where a pulse is cut or made
    // longer.
    for (input_hz, output_hz) in [(490, 450), (450, 450), (449, 450), (400, 450), (240, 450), (50, 400)] {
        // The last are those of a flight controller that sends at another rate than the settings say.
        for drift in DRIFTS.into_iter().chain([-0.1, 0.1, 0.125, 0.2]) {
            for commands in [Commands::AroundHalf, Commands::Steps] {
                let settings = settings(PulseProtocol::StandardPwm, input_hz, output_hz);
                let plan = Plan::new(&settings, CRYSTAL.timer_hz, true).unwrap();
                let interrupted = frames(&plan).restart_margin;
                let (_, [shortest, longest]) = play(&settings, &plan, drift, commands, interrupted);
                assert!(shortest >= 1.0 / f64::from(output_hz) - 1e-9, "{input_hz} -> {output_hz}: {shortest} s");
                let waits =
                    if settings.output_follows_input() { 9.0 / 8.0 / f64::from(input_hz) + 1.2e-3 } else { 0.0 };
                let patience = waits.max(1.0 / f64::from(output_hz));
                assert!(longest <= patience + 1e-6, "{input_hz} -> {output_hz}: {longest} s");
            }
        }
    }
}

#[test]
fn without_pulses_frames_come_at_their_rate() {
    let Frames { shortest, longest, restart_margin, .. } =
        frames(&Plan::new(&Validated::default(), CRYSTAL.timer_hz, true).unwrap());
    let mut pacer = FramePacer::new(&Frames { divider: 1, counter_hz: 1, shortest, longest, restart_margin });
    assert_eq!(pacer.tick(InputPulse::None, 100), FrameAction::EndAt(shortest));
    for count in [3000, 100, 3000] {
        assert_eq!(pacer.tick(InputPulse::None, count), FrameAction::None);
    }
    // Pulses come: the frames wait for them.
    assert_eq!(pacer.tick(InputPulse::New, 100), FrameAction::EndAt(shortest));
    assert_eq!(pacer.tick(InputPulse::Awaited, 4300), FrameAction::None, "it is under way");
    assert_eq!(pacer.tick(InputPulse::Awaited, 50), FrameAction::EndAt(longest), "the next one waits");
    assert_eq!(pacer.tick(InputPulse::Awaited, shortest), FrameAction::None);
    assert_eq!(pacer.tick(InputPulse::New, shortest), FrameAction::Restart);
    // Just before its end it is left alone.
    assert_eq!(pacer.tick(InputPulse::New, longest - restart_margin - 1), FrameAction::Restart);
    assert_eq!(pacer.tick(InputPulse::New, longest - restart_margin), FrameAction::None);
    // And none come any more.
    assert_eq!(pacer.tick(InputPulse::None, 4300), FrameAction::EndAt(shortest));
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
fn the_latencies_of_the_documentation_are_those_of_the_model() {
    let rows = documented();
    assert_eq!(rows.len(), 5);
    for row in rows {
        let number = |cell: &str| cell.split([' ', '°']).next().unwrap().parse::<f64>().unwrap();
        let (input_hz, output_hz) = (number(&row[1]), number(&row[2]));
        let protocol = PulseProtocol::ALL.into_iter().find(|protocol| protocol.specification().title == row[0]);
        let protocol = protocol.unwrap_or_else(|| panic!("there is no {}", row[0]));
        let settings = settings(protocol, input_hz as u16, output_hz as u16);
        let follows = settings.output_follows_input();
        assert_eq!(row[3], if follows { "follow" } else { "run freely" }, "{row:?}");
        let model = ModelLatency::new(settings.input, settings.output, 5000.0).unwrap().total();
        let (mean, most) = (1e3 * model.mean_s, 1e3 * model.worst_s);
        let degrees = (94.0 * 1e-3 * mean).to_degrees();
        let (found, _) = latency(&settings, 1e-3, Commands::AroundHalf);
        println!("{row:?}: {mean:.3} {most:.3} {degrees:.2} {found:?}");
        for (cell, value, unit) in [(4, mean, 0.01), (5, most, 0.01), (6, degrees, 0.1), (7, found.jitter, 0.01)] {
            assert!((number(&row[cell]) - value).abs() <= 0.51 * unit, "{row:?}: {} is {value}", row[cell]);
        }
        let (steps, _) = latency(&settings, 1e-3, Commands::Steps);
        assert!(found.worst <= most && steps.worst <= most, "{row:?}: {found:?} {steps:?}");
    }
}
