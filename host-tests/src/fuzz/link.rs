//! Any bytes on the line, and in the settings' flash.

use rotorlead::design::{RotorCurve, SpeedCurve};
use rotorlead::link::{
    CHECKSUM, ExciteRequest, FRAME_BYTES, Faults, InjectRequest, Injected, LineSet, Message, PAYLOAD_BYTES, Receiver,
    Record, RecordRequest, Request, Series, Source, VERSION, encode,
};
use rotorlead::settings::{CompensatorKind, MOTORS, Origin, Pulse, PulseProtocol, Settings, Store, Validated};
use rotorlead::throttle::Command;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::flash::Flash;

/// Sectors of the fuzzed flash: two of the longest sets each.
const SECTOR: usize = 2048;

/// Bytes from a line, as they are and as the body of a frame whose checksum is right.
///
/// # Panics
/// When the link's code does, or a frame is neither a message nor counted, or a good frame after it is not received.
pub fn fuzz_link(bytes: &[u8]) {
    receive::<Request>(bytes.iter().copied());
    receive::<Message>(bytes.iter().copied());
    let body = &bytes[..bytes.len().min(PAYLOAD_BYTES - 6)];
    let framed = frame(VERSION, 0, body);
    receive::<Request>(framed.iter().copied());
    receive::<Message>(framed.iter().copied());
}

fn receive<T: DeserializeOwned + Serialize>(bytes: impl Iterator<Item = u8>) {
    let mut receiver = Receiver::<T>::new();
    let mut frame = [0; FRAME_BYTES];
    let (mut ends, mut count, mut inside) = (0, 0, false);
    for byte in bytes.chain([0]) {
        ends += u32::from(byte == 0 && inside);
        inside = byte != 0;
        let Some(received) = receiver.push(byte) else { continue };
        count += 1;
        // What was accepted is a message: it can be sent again, and arrives as it was.
        let length = encode(received.tag, &received.message, &mut frame).expect("every message fits a frame");
        let mut other = Receiver::<T>::new();
        let again = frame[..length].iter().find_map(|&byte| other.push(byte)).expect("a frame that was just written");
        assert_eq!(again.tag, received.tag);
        let bytes = |message: &T| postcard::to_stdvec(message).expect("it fitted a frame");
        assert_eq!(bytes(&again.message), bytes(&received.message));
    }
    assert_eq!(count + receiver.faults().total(), ends, "a frame is received or counted");
}

/// A frame around any body, as the documentation of `rotorlead::link` has it, without that crate's code for it.
#[must_use]
pub fn frame(version: u8, tag: u8, body: &[u8]) -> Vec<u8> {
    let mut envelope = vec![version, tag];
    envelope.extend_from_slice(body);
    envelope.extend_from_slice(&CHECKSUM.checksum(&envelope).to_le_bytes());
    let mut frame = vec![0];
    frame.extend(cobs::encode_vec(&envelope));
    frame.push(0);
    frame
}

/// Bytes found in flash: as the content of both sectors, and as stored settings whose checksum is right.
///
/// # Panics
/// When the settings' code does, or what it loads is not valid, or a save after it does not hold.
pub fn fuzz_settings(bytes: &[u8]) {
    let mut content = vec![0xff; 2 * SECTOR];
    let length = bytes.len().min(content.len());
    content[..length].copy_from_slice(&bytes[..length]);
    load_and_save(content);

    let body = &bytes[..bytes.len().min(SECTOR / 2 - 16)];
    for layout in [1, 2, 3, 4, LAYOUT] {
        let mut content = vec![0xff; 2 * SECTOR];
        let set = stored(layout, 1, body);
        content[..set.len()].copy_from_slice(&set);
        load_and_save(content);
    }
}

fn load_and_save(content: Vec<u8>) {
    let mut store = Store::new(Flash::<SECTOR>::holding(content), Flash::<SECTOR>::SECTORS);
    let loaded = store.load();
    let settings: Settings = (*loaded.settings).clone();
    assert!(settings.validate().is_ok(), "settings that were loaded are valid");
    if matches!(loaded.origin, Origin::DefaultsBlank | Origin::DefaultsBad) {
        assert_eq!(loaded.settings, Validated::default());
    }
    store.save(&loaded.settings).expect("a flash without faults");
    let again = store.load();
    assert_eq!((again.settings, again.origin), (loaded.settings, Origin::Stored));
}

/// Today's layout of stored settings.
pub const LAYOUT: u16 = 5;

/// A stored set around any body, as the documentation of `rotorlead::settings` has it.
#[must_use]
pub fn stored(layout: u16, sequence: u32, body: &[u8]) -> Vec<u8> {
    let mut set = b"RLST".to_vec();
    set.extend_from_slice(&layout.to_le_bytes());
    set.extend_from_slice(&(body.len() as u16).to_le_bytes());
    set.extend_from_slice(&sequence.to_le_bytes());
    set.extend_from_slice(body);
    set.extend_from_slice(&CHECKSUM.checksum(&set).to_le_bytes());
    set
}

/// Bytes to start a fuzzer of [`fuzz_link`] from: the body of every request and of the longest messages, and a line with
/// several frames on it.
///
/// # Panics
/// Never: every message fits.
#[must_use]
pub fn link_corpus() -> Vec<(&'static str, Vec<u8>)> {
    let body = |request: &Request| postcard::to_stdvec(request).expect("memory is not short");
    let message = |message: &Message| postcard::to_stdvec(message).expect("memory is not short");
    fn series<const N: usize>(samples: &[i32]) -> Series<N> {
        Series::try_from(samples).expect("few samples")
    }
    let excite =
        ExciteRequest { motor: 2, lines: LineSet::Odd45Hz, nominal: 1 << 28, amplitude: 1 << 25, periods: 300 };
    let inject = InjectRequest { motor: 1, first: 300, samples: series(&[5, 5, 4, -1]) };
    let ramp: Vec<i32> = (0..32).map(|n| n << 20).collect();
    let column = series(&ramp);
    let record = Record {
        motor: 1,
        divisor: 5,
        first_tick: 1000,
        input: column.clone(),
        before: column.clone(),
        after: column.clone(),
        adc: column.clone(),
        turn_us: column,
    };
    let mut line = vec![1, 2, 3];
    for request in [Request::Info, Request::KeepAlive, Request::Faults] {
        line.extend(frame(VERSION, 7, &body(&request)));
    }
    line.extend(frame(VERSION.wrapping_add(1), 7, &[0]));
    vec![
        ("info", body(&Request::Info)),
        ("get_settings", body(&Request::GetSettings)),
        ("set_settings", body(&Request::SetSettings(Settings::default()))),
        ("set_settings_curves", body(&Request::SetSettings(with_curves()))),
        ("save_settings", body(&Request::SaveSettings)),
        ("set_mode", body(&Request::SetMode { motor: 3, source: Source::Inject, compensate: true })),
        ("excite", body(&Request::Excite(excite))),
        ("keep_alive", body(&Request::KeepAlive)),
        ("stop_excitation", body(&Request::StopExcitation)),
        ("record_stop", body(&Request::Record(None))),
        ("record", body(&Request::Record(Some(RecordRequest { motor: 1, divisor: 500 })))),
        ("inject", body(&Request::Inject(inject))),
        ("faults", body(&Request::Faults)),
        ("boot_loader", body(&Request::BootLoader)),
        ("answer_faults", message(&Message::Faults(Faults::default()))),
        ("answer_injected", message(&Message::Injected(Injected { first: 128, outputs: series(&[1 << 29, 1 << 29]) }))),
        ("answer_record", message(&Message::Record(record))),
        ("line", line),
    ]
}

/// An inverse with the paper's curve and speeds for each motor: the longest settings.
fn with_curves() -> Settings {
    let mut settings = Settings { compensator: CompensatorKind::Inverse, ..Settings::default() };
    let curve = RotorCurve::through(&crate::paper_curve()).ok();
    let [from, to] = [0.4, 0.65].map(Command::saturating_from_f64);
    let speeds = Some(SpeedCurve::new(from, to, [52_000, 65_000, 77_000]));
    settings.motors.iter_mut().for_each(|motor| motor.curve = curve);
    settings.speeds = [speeds; MOTORS];
    settings
}

/// The defaults in the second layout.
const LAYOUT_2: &str = "8827e17a14ae47412c4015144196cb8d5740cd3b7f669ea0e63f01900301c2030000d00f00a8b8bd14b2e6cc19b2e6cc19\
    80808080046400a8b8bd14b2e6cc19b2e6cc1980808080046400a8b8bd14b2e6cc19b2e6cc1980808080046400a8b8bd14b2e6cc19b2e6cc19\
    808080800464788080808003e6cc9933b817d00f01";

/// Bytes to start a fuzzer of [`fuzz_settings`] from: stored settings of each protocol, with curves and of the second layout, with
/// and without a slot around them, and a whole flash.
///
/// # Panics
/// Never: every set fits.
#[must_use]
pub fn settings_corpus() -> Vec<(&'static str, Vec<u8>)> {
    let body = |settings: &Settings| postcard::to_stdvec(settings).expect("memory is not short");
    let paper = Pulse { protocol: PulseProtocol::RawDuty, frame_hz: 600 };
    let fast = Pulse { protocol: PulseProtocol::OneShot125, frame_hz: 3000 };
    let duty = Settings { input: paper, output: paper, stop: 1 << 23, ..Settings::default() };
    let oneshot = Settings { input: fast, output: fast, loop_rate_hz: 10_000, ..Settings::default() };
    let defaults = body(&Settings::default());
    let digits = LAYOUT_2.as_bytes().chunks(2).map(|pair| std::str::from_utf8(pair).expect("digits"));
    let layout_2 = digits.map(|pair| u8::from_str_radix(pair, 16).expect("digits")).collect();
    let mut flash = vec![0xff; 2 * SECTOR];
    for (start, sequence) in [(0, 2), (SECTOR / 2, 4), (SECTOR, 3)] {
        let slot = stored(LAYOUT, sequence, &defaults);
        flash[start..start + slot.len()].copy_from_slice(&slot);
    }
    vec![
        ("blank", Vec::new()),
        ("defaults", defaults.clone()),
        ("duty", body(&duty)),
        ("oneshot", body(&oneshot)),
        ("curves", body(&with_curves())),
        ("layout_2", layout_2),
        ("set", stored(LAYOUT, 1, &defaults)),
        ("flash", flash),
    ]
}
