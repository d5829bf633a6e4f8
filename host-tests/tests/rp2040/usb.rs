//! The link by USB: a host that sets the controller up, reads, goes deaf, sleeps or is unplugged.

use emulator::rp2040::{Emulator, Handler, Plug, PlugEvent, Run, Trace};
use host_tests::pins::{self, OUTPUT_1, ms};
use rotorlead::dshot::Speed;
use rotorlead::link::{ExciteRequest, Faults, LineSet, Message, Record, RecordRequest, Refusal, Request};
use rotorlead::settings::{DEAD_MAN_MS, Pulse, PulseProtocol, Settings};
use rotorlead::throttle::Command;
use rotorlead_rp2040::generated::USB_RESERVED;

use super::link::{FITTED, answers, chosen, messages, requests};

/// When the controller answers for sure, and the host has set it up.
const STARTED: u64 = 37_500_000;
const SYSTICK: u32 = 15;
const USB: u32 = 16 + 5;

/// A controller with these settings at a USB host from the start on, with its jumper fitted.
fn plugged(settings: &Settings, what: PlugEvent, end: u64) -> Run {
    let mut run = pins::run(settings, end);
    run.inputs.push(FITTED);
    run.plug.push(Plug { cycle: 0, what });
    run.handlers_from = STARTED;
    run
}

fn trace(run: &Run) -> Trace {
    let trace = pins::trace(Emulator::Node, run);
    let complaints: Vec<_> = trace.unmodelled.iter().filter(|what| what.starts_with("USB")).collect();
    assert!(complaints.is_empty(), "{complaints:?}");
    assert!(trace.resets.is_empty(), "{:?}", trace.resets);
    trace
}

fn handler(trace: &Trace, exception: u32) -> Handler {
    *trace.handler(exception).unwrap()
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn a_host_sets_it_up_and_the_link_is_where_the_last_request_came() {
    for what in [PlugEvent::Plugged, PlugEvent::PluggedIntoNoisyHub] {
        let mut run = plugged(&Settings::default(), what, STARTED + ms(420.0));
        run.usb_in = requests(STARTED, 200.0, &[Request::SetSettings(chosen()), Request::GetSettings]);
        run.usb_in.extend(requests(STARTED + ms(400.0), 0.0, &[Request::Info]));
        run.uart_in = requests(STARTED + ms(300.0), 50.0, &[Request::Info, Request::GetSettings]);
        run.watch.push(USB_RESERVED);
        let trace = trace(&run);
        let by_usb = messages(&trace.usb);
        let [Message::SettingsTaken(_), Message::Settings(settings), Message::Info(info)] = &by_usb[..] else {
            panic!("{by_usb:?}")
        };
        assert_eq!(*settings, chosen());
        assert!(info.bench_enabled && info.outputs_enabled, "{info:?}");
        let by_uart = answers(&trace);
        let [Message::Info(_), Message::Settings(settings)] = &by_uart[..] else { panic!("{by_uart:?}") };
        assert_eq!(*settings, chosen());
        let [set_up] = trace.usb_set_ups[..] else { panic!("{:?}", trace.usb_set_ups) };
        let usb = handler(&trace, USB);
        println!("{what:?}: set up after {:.1} ms, at most {} cycles", set_up as f64 / ms(1.0) as f64, usb.most_cycles);
        assert_eq!(trace.edges_on(USB_RESERVED).count(), 0, "{what:?}: the reserved pin is not driven");
        assert!(trace.conflicts.is_empty());
    }
}

/// With the lead in the path of motor 0 at the rate at which 150 lines are played, a frame of DShot in each tick, and short ramps.
fn settings() -> Settings {
    let output = Pulse { protocol: PulseProtocol::Dshot600, frame_hz: 1000 };
    let mut settings = Settings { loop_rate_hz: 1000, output, stop_pulses_ms: 20, ..Settings::default() };
    settings.motors[0].compensate = true;
    (settings.excitation.arm_ms, settings.excitation.ramp_ms) = (10, RAMP_MS);
    settings
}

/// From a full command to the stop.
const RAMP_MS: u16 = 100;

fn excite() -> Request {
    let bits = |command| Command::saturating_from_f64(command).to_bits();
    let (nominal, amplitude) = (bits(0.5), bits(0.05));
    Request::Excite(ExciteRequest { motor: 0, lines: LineSet::Odd30Hz, nominal, amplitude, periods: 1 })
}

/// An excitation that is recorded and kept alive for so many milliseconds, and stopped then.
fn excitation(alive_ms: f64) -> Vec<(f64, Request)> {
    let mut asked = vec![(0.0, Request::Record(Some(RecordRequest { motor: 0, divisor: 1 }))), (5.0, excite())];
    asked.extend((1..).map(|n| 25.0 * f64::from(n)).take_while(|at| *at < alive_ms).map(|at| (at, Request::KeepAlive)));
    asked
}

/// Bytes of these requests, so many milliseconds after the start.
fn at(asked: &[(f64, Request)]) -> Vec<emulator::rp2040::Bytes> {
    asked
        .iter()
        .flat_map(|(at_ms, request)| requests(STARTED + ms(*at_ms), 0.0, std::slice::from_ref(request)))
        .collect()
}

/// The commands before and after the lead, in the records.
fn recorded(messages: &[Message]) -> Vec<(i32, i32)> {
    let records = messages.iter().filter_map(|message| match message {
        Message::Record(record) => Some(record),
        _ => None,
    });
    let rows = |Record { before, after, .. }: &Record| -> Vec<(i32, i32)> {
        before.as_slice().iter().copied().zip(after.as_slice().iter().copied()).collect()
    };
    records.flat_map(rows).collect()
}

/// What the UART was answered to the request for it.
fn faults(trace: &Trace) -> Faults {
    let mut answers = answers(trace).into_iter();
    let faults = answers.find_map(|answer| if let Message::Faults(faults) = answer { Some(faults) } else { None });
    faults.expect("the UART has the controller's ear")
}

/// What goes out from the first command on that is no stop.
fn played(trace: &Trace) -> Vec<u16> {
    let frames = pins::decode_frames(trace, OUTPUT_1, Speed::Dshot600, 1.0);
    frames.into_iter().map(|(_, bits)| bits).skip_while(|bits| *bits == 0).collect()
}

/// By the UART all of it is held to the library in the scenarios.
#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn an_excitation_and_its_record_are_the_same_by_usb_as_by_the_uart() {
    let asked = excitation(180.0);
    let end = STARTED + ms(200.0);
    let (mut by_uart, mut by_usb) = (pins::run(&settings(), end), plugged(&settings(), PlugEvent::Plugged, end));
    by_uart.inputs.push(FITTED);
    by_uart.handlers_from = STARTED;
    (by_uart.uart_in, by_usb.usb_in) = (at(&asked), at(&asked));
    for run in [&mut by_uart, &mut by_usb] {
        run.uart_in.extend(requests(STARTED + ms(190.0), 0.0, &[Request::Faults]));
    }
    let (by_uart, by_usb) = (trace(&by_uart), trace(&by_usb));
    let (uart_frames, usb_frames) = (played(&by_uart), played(&by_usb));
    let common = uart_frames.len().min(usb_frames.len());
    assert!(common > 170, "{common} frames");
    assert_eq!(uart_frames[..common], usb_frames[..common]);
    let rows = |bytes: &[u8]| -> Vec<(i32, i32)> {
        recorded(&messages(bytes)).into_iter().skip_while(|(before, _)| *before == 0).collect()
    };
    let (uart_rows, usb_rows) = (rows(&by_uart.uart), rows(&by_usb.usb));
    let common = uart_rows.len().min(usb_rows.len());
    assert!(common > 130, "{} and {} rows", uart_rows.len(), usb_rows.len());
    assert_eq!(uart_rows[..common], usb_rows[..common]);
    for (name, trace) in [("UART", &by_uart), ("USB", &by_usb)] {
        let ticks = handler(trace, SYSTICK);
        let faults = faults(trace);
        assert_eq!((faults.missed_deadlines, faults.record_dropped), (0, 0));
        println!("by the {name}: {} ticks, of which the longest took {} cycles", ticks.calls, ticks.most_cycles);
        assert!(ticks.calls.abs_diff(200) <= 1, "{} ticks", ticks.calls);
    }
    let usb = handler(&by_usb, USB);
    println!(
        "the handler of USB: {} calls, {} cycles in all, {} at most",
        usb.calls, usb.total_cycles, usb.most_cycles
    );
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn a_motor_stops_when_the_host_is_unplugged_sleeps_or_reads_nothing() {
    const LOST_MS: f64 = 150.0;
    // What a deaf host sends is heard until the controller has nowhere to put its records.
    let cases = [(PlugEvent::Unplugged, 0.0), (PlugEvent::Suspended, 0.0), (PlugEvent::Deaf, 200.0)];
    for (what, heard_ms) in cases {
        let mut run = plugged(&settings(), PlugEvent::Plugged, STARTED + ms(LOST_MS + 860.0));
        run.plug.push(Plug { cycle: STARTED + ms(LOST_MS), what });
        let alive_ms = if what == PlugEvent::Deaf { LOST_MS + 800.0 } else { LOST_MS };
        run.usb_in = at(&excitation(alive_ms));
        // The UART has the link again.
        run.uart_in = requests(STARTED + ms(LOST_MS + 840.0), 0.0, &[Request::Faults]);
        let trace = trace(&run);
        let frames = pins::decode_frames(&trace, OUTPUT_1, Speed::Dshot600, 1.0);
        let turns = |frame: &&(u64, u16)| frame.1 != 0;
        let first = frames.iter().find(turns).unwrap().0;
        let last = frames.iter().rfind(turns).unwrap().0;
        assert!(first < STARTED + ms(30.0));
        let after_ms = (last as f64 / ms(1.0) as f64) - STARTED as f64 / ms(1.0) as f64 - LOST_MS;
        println!("{what:?}: at the stop {after_ms:.0} ms later");
        let longest_ms = heard_ms + f64::from(DEAD_MAN_MS) + f64::from(RAMP_MS);
        assert!(after_ms < longest_ms, "{what:?}: {after_ms} ms");
        assert!(after_ms > f64::from(DEAD_MAN_MS) - 25.0, "{what:?}: {after_ms} ms: something else has stopped it");
        let ticks = handler(&trace, SYSTICK);
        let expected = (run.until_cycle - STARTED) / ms(1.0);
        assert!(ticks.calls.abs_diff(expected) <= 1, "{what:?}: {} ticks of {expected}", ticks.calls);
        let faults = faults(&trace);
        assert_eq!((faults.missed_deadlines, faults.dead_man), (0, 1), "{what:?}: {faults:?}");
    }
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn a_host_that_comes_back_sets_it_up_anew() {
    let mut run = plugged(&Settings::default(), PlugEvent::Plugged, STARTED + ms(80.0));
    run.usb_in = requests(STARTED, 60.0, &[Request::GetSettings, Request::Info]);
    let plug = [(20.0, PlugEvent::Unplugged), (30.0, PlugEvent::Plugged), (50.0, PlugEvent::Suspended)];
    run.plug.extend(plug.map(|(at_ms, what)| Plug { cycle: STARTED + ms(at_ms), what }));
    run.plug.push(Plug { cycle: STARTED + ms(70.0), what: PlugEvent::Resumed });
    let trace = trace(&run);
    assert_eq!(trace.usb_set_ups.len(), 2, "{:?}", trace.usb_set_ups);
    let answers = messages(&trace.usb);
    assert!(matches!(answers[..], [Message::Settings(_), Message::Info(_)]), "{answers:?}");
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn the_boot_loader_is_called_with_the_jumper_alone_and_the_outputs_go_low() {
    for is_fitted in [true, false] {
        let mut run = plugged(&chosen(), PlugEvent::Plugged, STARTED + ms(150.0));
        if !is_fitted {
            run.inputs.clear();
        }
        run.inputs.extend(pins::pulses(pins::INPUT_1, pins::us(500.0), ms(2.5), run.until_cycle, |_| pins::us(1000.0)));
        run.usb_in = requests(STARTED, 0.0, &[Request::BootLoader]);
        let trace = trace(&run);
        let answers = messages(&trace.usb);
        if is_fitted {
            assert_eq!(answers, [Message::Done]);
            let left = trace.boot_loader.unwrap();
            assert!((STARTED + ms(100.0)..STARTED + ms(102.0)).contains(&left), "{left}");
            let highs = trace.edges_on(OUTPUT_1).filter(|edge| edge.is_high);
            let (before, after): (Vec<_>, Vec<_>) = highs.partition(|edge| edge.cycle < left);
            assert!(!before.is_empty() && after.is_empty(), "{} and {}", before.len(), after.len());
        } else {
            assert_eq!(answers, [Message::Refused(Refusal::BenchDisabled)]);
            assert_eq!(trace.boot_loader, None);
        }
    }
}
