//! `rotorlead device` against what is no good controller: whatever comes over the line, each subcommand ends soon and says why.

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::thread;
use std::time::{Duration, Instant};

use rotorlead::link::{
    BrownOut, ChannelState, Clock, CrystalCheck, FRAME_BYTES, Faults, Info, Message, PanicPlace, Path, Receiver,
    Record, Request, ResetReason, Series, encode,
};
use rotorlead::settings::{MOTORS, Origin, Settings};

use crate::stand::{Stand, report};

/// What is wrong with a board, which else answers whatever it is asked, and has nothing behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    /// It sends noise without end, and answers nothing.
    Noise,
    /// Each answer stops in the middle, and then the line closes.
    HalfAFrame,
    /// Its settings are no numbers.
    NoNumbers,
    /// Of a recording it sends records without a row, without end.
    EmptyRecords,
    /// A recording is begun, and no record comes.
    NoRecords,
}

/// Every subcommand, each as it would do something.
const SUBCOMMANDS: [&str; 10] = [
    "info",
    "get",
    "get output.protocol",
    "set output.protocol dshot300",
    "save",
    "faults",
    "stop",
    "record --out recorded --seconds 1 --newtons-per-count 1e-4 --zero-count 1000",
    "excite --out excited --nominal 0.5 --newtons-per-count 1e-4 --zero-count 1000",
    "inject --model model.toml --out injected",
];

const INFO: Info = Info {
    firmware: [1, 0, 0],
    clock: Clock::Crystal,
    core_hz: 168_000_000,
    timer_hz: 84_000_000,
    crystal: CrystalCheck::NotChecked,
    may_arm: true,
    ticks: 0,
    reset: ResetReason::PowerOn,
    brown_out: BrownOut::Level3,
    settings: Origin::Stored,
    outputs_enabled: true,
    bench_enabled: true,
    motors: [ChannelState::NoSignal; MOTORS],
    paths: [Path::SILENT; MOTORS],
    resumed: [false; MOTORS],
};

/// A board that takes connections until the test ends; gives its address.
fn board(fault: Option<Fault>, info: Info) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp:{}", listener.local_addr().unwrap());
    thread::spawn(move || {
        while let Ok((line, _)) = listener.accept() {
            // It ends when the program closes it.
            let _ = serve(line, fault, &info);
        }
    });
    address
}

fn serve(mut line: TcpStream, fault: Option<Fault>, info: &Info) -> std::io::Result<()> {
    line.set_read_timeout(Some(Duration::from_millis(5)))?;
    let mut receiver = Receiver::<Request>::new();
    let (mut recording, mut noise) = (None, 1_u8);
    loop {
        let mut bytes = [0; 256];
        let length = match line.read(&mut bytes) {
            Ok(0) => return Ok(()),
            Ok(length) => length,
            Err(_) => 0,
        };
        if fault == Some(Fault::Noise) {
            let next = || {
                noise = noise.wrapping_mul(29).wrapping_add(71);
                noise
            };
            line.write_all(&std::iter::repeat_with(next).take(512).collect::<Vec<_>>())?;
            continue;
        }
        let requests: Vec<_> = bytes[..length].iter().filter_map(|&byte| receiver.push(byte)).collect();
        for request in requests {
            let answer = match &request.message {
                Request::Info => Message::Info(*info),
                Request::GetSettings => Message::Settings(settings(fault)),
                Request::SetSettings(_) => Message::SettingsTaken(Default::default()),
                Request::Faults => Message::Faults(Faults::default()),
                Request::Inject(_) => continue,
                Request::Record(of) => {
                    recording = of.map(|_| request.tag);
                    Message::Done
                }
                _ => Message::Done,
            };
            let frame = framed(request.tag, &answer);
            if fault == Some(Fault::HalfAFrame) {
                return line.write_all(&frame[..frame.len() / 2]);
            }
            line.write_all(&frame)?;
        }
        if let Some(tag) = recording.filter(|_| fault == Some(Fault::EmptyRecords)) {
            let [input, before, after, adc, turn_us] = std::array::from_fn(|_| Series::default());
            let empty = Record { motor: 0, divisor: 5, first_tick: 0, input, before, after, adc, turn_us };
            line.write_all(&framed(tag, &Message::Record(empty)))?;
        }
    }
}

fn settings(fault: Option<Fault>) -> Settings {
    let mut settings = Settings::default();
    if fault == Some(Fault::NoNumbers) {
        settings.lead.damping = f64::NAN;
        settings.slew_per_s = f64::INFINITY;
        settings.motors[0].max = i32::MIN;
    }
    settings
}

fn framed(tag: u8, message: &Message) -> Vec<u8> {
    let mut frame = [0; FRAME_BYTES];
    let length = encode(tag, message, &mut frame).unwrap();
    frame[..length].to_vec()
}

/// Runs a subcommand against such a board and gives its exit status and standard error. It has to end within some answers' time.
fn outcome(stand: &Stand, address: &str, subcommand: &str) -> (Option<i32>, String) {
    let mut command = stand.command(&format!("device --port {address} --timeout 0.3 {subcommand}"));
    let start = Instant::now();
    let assert = command.timeout(Duration::from_secs(60)).assert();
    let said = report(&assert);
    assert!(start.elapsed() < Duration::from_secs(30), "`{subcommand}` takes {:?}: {said}", start.elapsed());
    assert!(!said.contains("panicked"), "`{subcommand}`: {said}");
    (assert.get_output().status.code(), said)
}

/// All subcommands, at the same time; those in `good` succeed all the same, and the others say one of `parts`.
fn each_ends(fault: Fault, good: &[&str], parts: &[&str]) {
    let address = board(Some(fault), INFO);
    for subcommand in SUBCOMMANDS {
        let stand = Stand::new();
        let (status, said) = outcome(&stand, &address, subcommand);
        let is_good = good.iter().any(|good| subcommand.starts_with(good));
        assert_eq!(status, Some(if is_good { 0 } else { 1 }), "{fault:?}, `{subcommand}`: {said}");
        if !is_good {
            assert!(parts.iter().any(|part| said.contains(part)), "{fault:?}, `{subcommand}`: {said}");
            assert!(said.contains("help: "), "{fault:?}, `{subcommand}`: {said}");
        }
    }
}

#[test]
fn noise_is_no_answer() {
    each_ends(Fault::Noise, &[], &["no answer to"]);
}

#[test]
fn a_line_that_closes_in_an_answer_is_named() {
    each_ends(Fault::HalfAFrame, &[], &["end of file"]);
}

#[test]
fn settings_that_are_no_numbers_are_not_taken_for_settings() {
    each_ends(Fault::NoNumbers, &["info", "save", "faults", "stop"], &["settings are none that it could run with"]);
}

#[test]
fn records_without_a_row_end_a_recording() {
    let good = ["info", "get", "set", "save", "faults", "stop"];
    each_ends(Fault::EmptyRecords, &good, &["answered record with something else", "no answer to"]);
}

#[test]
fn records_that_do_not_come_end_a_recording() {
    let good = ["info", "get", "set", "save", "faults", "stop"];
    each_ends(Fault::NoRecords, &good, &["no answer to"]);
}

#[test]
fn the_place_of_a_panic_is_said() {
    let info = Info { reset: ResetReason::Panic(PanicPlace::new("src/tick.rs", 77)), ..INFO };
    let stand = Stand::new();
    let text = stand.run(&format!("device --port {} info", board(None, info)));
    assert!(text.contains("started by Panic at src/tick.rs:77\n"), "{text}");
}

#[test]
fn a_time_that_no_clock_counts_is_wrong_use() {
    let stand = Stand::new();
    for seconds in ["1e20", "1e300", "100001", "0", "nan"] {
        let arguments = format!("device --port tcp:127.0.0.1:1 --timeout {seconds} info");
        stand.refuses(&arguments, 2, &["--timeout", "0.0001 to 100000: seconds"]);
    }
}
