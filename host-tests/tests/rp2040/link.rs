//! The link, and the settings that it stores.

use emulator::rp2040::{Bytes, Edge, Emulator, Flash as Stored, PowerCut, Region, Run, Trace};
use host_tests::flash::Flash;
use host_tests::pins::{self, INPUT_1, JUMPER, OUTPUT_1, ms, pulses, read_pulses, us};
use host_tests::scenario::table::{self, Column};
use host_tests::scenario::yes;
use rotorlead::dshot::Speed;
use rotorlead::link::{Clock, FRAME_BYTES, Message, Receiver, Request, encode};
use rotorlead::settings::{Origin, Pulse, PulseProtocol, Settings, Store};

/// When the controller answers for sure.
const STARTED: u64 = 37_500_000;
/// Where the settings are when the run has ended.
const SETTINGS: Region = Region { address: 0x101F_E000, length: 8192 };
const SECTOR: usize = 4096;

/// Frames of requests, the first at `cycle` and each so many milliseconds after the one before.
pub fn requests(cycle: u64, apart_ms: f64, requests: &[Request]) -> Vec<Bytes> {
    let frame = |(tag, request): (u8, &Request)| {
        let mut bytes = [0; FRAME_BYTES];
        let length = encode(tag, request, &mut bytes).unwrap();
        Bytes { cycle: cycle + u64::from(tag - 1) * ms(apart_ms), bytes: bytes[..length].to_vec() }
    };
    (1..).zip(requests).map(frame).collect()
}

/// What was answered by the UART, in order.
pub fn answers(trace: &Trace) -> Vec<Message> {
    messages(&trace.uart)
}

/// The messages in bytes.
pub fn messages(bytes: &[u8]) -> Vec<Message> {
    let mut receiver = Receiver::<Message>::new();
    bytes.iter().filter_map(|byte| receiver.push(*byte)).map(|tagged| tagged.message).collect()
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn the_controller_says_what_it_is() {
    let mut run = pins::run(&Settings::default(), STARTED + ms(40.0));
    run.uart_in = requests(STARTED, 10.0, &[Request::Info, Request::GetSettings]);
    let trace = pins::trace(Emulator::Node, &run);
    let answers = answers(&trace);
    let [Message::Info(info), Message::Settings(settings)] = &answers[..] else { panic!("{answers:?}") };
    assert_eq!((info.clock, info.core_hz, info.timer_hz), (Clock::Crystal, 125_000_000, 25_000_000));
    assert!(info.may_arm, "{info:?}");
    assert_eq!(*settings, Settings::default());
}

/// Other settings than the defaults, in every way that matters at a pin.
pub fn chosen() -> Settings {
    let dshot = Pulse { protocol: PulseProtocol::Dshot600, frame_hz: 4000 };
    Settings { output: dshot, ..Settings::default() }
}

/// The jumper is fitted, or nothing could be stored in the first seconds.
pub const FITTED: Edge = Edge { cycle: 0, pin: JUMPER, is_high: false };

/// A controller with the defaults on which somebody sets others and saves them.
fn saving() -> Run {
    let mut run = pins::run(&Settings::default(), STARTED + ms(700.0));
    run.uart_in = requests(STARTED, 300.0, &[Request::SetSettings(chosen()), Request::SaveSettings]);
    run.inputs.push(FITTED);
    run.memory.push(SETTINGS);
    run
}

fn load(bytes: &[u8]) -> (Settings, Origin) {
    let loaded = Store::new(Flash::<SECTOR>::holding(bytes.to_vec()), Flash::<SECTOR>::SECTORS).load();
    (loaded.settings.into_settings(), loaded.origin)
}

/// Whether a controller with this flash puts out what the settings ask for: pulses for the defaults, frames for the others.
fn check_outputs(flash: &[u8], is_new: bool) {
    let mut run = Run::new(pins::image(), STARTED + ms(30.0));
    run.flash.push(Stored { offset: SETTINGS.address - 0x1000_0000, bytes: flash.to_vec() });
    run.watch.push(OUTPUT_1);
    run.inputs = pulses(INPUT_1, us(500.0), us(2500.0), run.until_cycle, |_| us(1000.0));
    let trace = pins::trace(Emulator::Node, &run);
    if is_new {
        assert!(pins::decode_frames(&trace, OUTPUT_1, Speed::Dshot600, 1.0).len() > 20);
    } else {
        let pulses = read_pulses(&trace, OUTPUT_1);
        assert!(pulses.len() > 10 && pulses.iter().all(|pulse| pulse.width == us(1000.0)), "{pulses:?}");
    }
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn settings_are_saved_and_a_power_cut_at_any_operation_leaves_the_old_or_the_new() {
    let trace = pins::trace(Emulator::Node, &saving());
    assert_eq!(answers(&trace).len(), 2, "{:?}", answers(&trace));
    assert!(trace.resets.is_empty(), "{:?}", trace.resets);
    assert_eq!(load(&trace.memory[0]), (chosen(), Origin::Stored));
    check_outputs(&trace.memory[0], true);
    let operations = trace.flash_operations;
    assert!(operations >= 2, "an erase and a page at least: {operations}");
    let mut seen = [0; 2];
    for operation in 0..operations {
        for bytes in [0, 100, 255] {
            let run = Run { power_cut: Some(PowerCut { operation, bytes }), ..saving() };
            let trace = pins::trace(Emulator::Node, &run);
            assert!(trace.power_is_cut, "operation {operation}");
            let (settings, origin) = load(&trace.memory[0]);
            assert!(
                matches!(origin, Origin::Stored | Origin::StoredOnce),
                "operation {operation}, byte {bytes}: {origin:?}"
            );
            let is_new = settings == chosen();
            assert!(is_new || settings == Settings::default(), "operation {operation}, byte {bytes}: {settings:?}");
            check_outputs(&trace.memory[0], is_new);
            seen[usize::from(is_new)] += 1;
        }
    }
    println!("{operations} operations: {} cuts left the old settings, {} the new", seen[0], seen[1]);
    assert!(seen.iter().all(|count| *count > 0), "{seen:?}");
    table::hold_cannot(table::POWER_CUT, &[(Column::Stm32, "no flash"), (Column::Rp2040Emu, "no ROM")]);
    table::hold(table::POWER_CUT, Column::Rp2040js, &yes());
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn frames_go_on_while_the_flash_is_erased_and_written() {
    let mut run = pins::run(&chosen(), STARTED + ms(300.0));
    let saved_at = STARTED + ms(100.0);
    run.uart_in = requests(saved_at, 0.0, &[Request::SaveSettings]);
    run.inputs = pulses(INPUT_1, us(500.0), us(2500.0), run.until_cycle, |_| us(1000.0));
    run.inputs.push(FITTED);
    run.watch.push(OUTPUT_1);
    let trace = pins::trace(Emulator::Node, &run);
    assert!(trace.faults.is_empty(), "{:?}", trace.faults);
    assert_eq!(trace.flash_operations, 2, "an erase and a page");
    let sent = pins::decode_frames(&trace, OUTPUT_1, Speed::Dshot600, 1.0);
    let until = run.until_cycle;
    let during = sent.iter().map(|(cycle, _)| *cycle).filter(|cycle| *cycle > saved_at);
    let during: Vec<u64> = std::iter::once(saved_at).chain(during).chain([until]).collect();
    let longest = during.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap();
    assert!(longest <= ms(0.5), "a gap of {} us", longest as f64 / 125.0);
    assert!(sent.iter().all(|(_, bits)| *bits == 0), "a stop and nothing else");
}
