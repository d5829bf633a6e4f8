//! Any bytes as the log of another tool.

use std::io::Write as _;
use std::path::Path;

use flate2::{Compression, write::ZlibEncoder};
use miette::Diagnostic as _;
use rotorlead_records::Excitation;
use rotorlead_records::import::{Import, ImportOptions, import_bytes};

/// A sample log of the importers' tests.
macro_rules! sample {
    ($name:literal) => {
        include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/records/tests/data/", $name))
    };
}

/// What messages have to call the log.
const FILE: &str = "fuzzed.log";

/// Bytes as a log of any format, recognized by them.
///
/// # Panics
/// When the importer does, or takes what no experiment is, or refuses without saying why, where and what to do.
fn check(bytes: &[u8]) {
    // What a plain table does not say. A period has rows to find, and a mean.
    check_with(bytes, &multisine());
}

fn multisine() -> ImportOptions {
    ImportOptions {
        excitation: Some(Excitation::Multisine),
        period_s: Some(0.1),
        motor_poles: Some(14),
        ..ImportOptions::default()
    }
}

/// The same where a flight is none to refuse.
fn check_with(bytes: &[u8], options: &ImportOptions) {
    match import_bytes(Path::new(FILE), bytes, options) {
        Ok(Import { experiment, summary }) => {
            let [record] = &experiment.records[..] else { panic!("{} records", experiment.records.len()) };
            assert!(record.time_s.is_sorted_by(|a, b| a < b), "time does not increase");
            assert!(record.command.iter().all(|c| (0.0..=1.0).contains(c)), "a command outside 0..1");
            assert!((0.0..=1.0).contains(&record.nominal), "a nominal command outside 0..1");
            assert!(record.amplitude.is_some_and(|a| a > 0.0 && a <= 1.0), "an amplitude outside 0..1");
            assert!(record.thrust_n.is_some() || record.rpm.is_some(), "no response");
            let optional = [&record.thrust_n, &record.rpm, &record.voltage_v, &record.current_a];
            let columns = [&record.time_s, &record.command].into_iter().chain(optional.into_iter().flatten());
            for column in columns {
                assert_eq!(column.len(), summary.rows_taken, "columns of different lengths");
                assert!(column.iter().all(|x| x.is_finite()), "not a number");
            }
            let dropped: usize = summary.dropped.iter().map(|d| d.rows).sum();
            assert_eq!(summary.rows_taken + dropped, summary.rows_read, "rows vanished");
        }
        Err(error) => {
            assert!(error.to_string().contains(FILE), "{error}");
            assert!(error.help().is_some(), "{error}: no remedy");
        }
    }
}

/// An autopilot's log as one of a flight.
fn check_free(bytes: &[u8]) {
    check_with(bytes, &ImportOptions { excitation: Some(Excitation::Free), ..multisine() });
}

/// The first byte says whether the others are a log as they are or what comes behind `prefix`.
fn check_behind(prefix: &[u8], data: &[u8]) {
    match data {
        [form, bytes @ ..] if form % 2 == 1 => check(&[prefix, bytes].concat()),
        [_, bytes @ ..] => check(bytes),
        [] => check(&[]),
    }
}

/// [`check_behind`], and the second bit says whether a flight is refused.
fn check_autopilot_behind(prefix: &[u8], data: &[u8]) {
    match data {
        [form, bytes @ ..] if form & 3 == 3 => check_free(&[prefix, bytes].concat()),
        [form, bytes @ ..] if form & 3 == 2 => check_free(bytes),
        data => check_behind(prefix, data),
    }
}

const RCBENCHMARK: &[u8] = "Time (s),ESC signal (µs),Motor Electrical Speed (RPM),Thrust (N)\n".as_bytes();
const PLAIN: &[u8] = b"# logger\ntime_ms;pwm_us;thrust [g];rpm;Voltage (V)\n";
const PLAIN_WITHOUT_TIMES: &[u8] = b"pwm_us;thrust [g];rpm\n";
const ESC32: &[u8] = b"Timestamp,Duty,RPM\n";
const BLACKBOX_CSV: &[u8] = b"loopIteration, time (us), vbatLatest (V), motor[0], motor[1], eRPM[0], eRPM[1]\n";
const CRAZYFLIE: &[u8] = b"timestamp,motor.m1,motor.m2,rpm.m1,rpm.m2,pm.vbatMV\n";
const FLIGHT_STAND: &[u8] =
    "Time (s),Powertrain 1 - ESC throttle (μs),Powertrain 1 - force Fz (thrust) (kgf),Powertrain 1 - rotation speed \
                             (rpm)\n"
        .as_bytes();
const VESC: &[u8] = b"ms_today;input_voltage;current_in;erpm;duty_cycle;\n";
const ULOG: &[u8] = b"ULog\x01\x12\x35\x01\0\0\0\0\0\0\0\0";

/// Behind a byte that chooses: any log, or the rows of a stand's.
pub fn fuzz_import_rcbenchmark(data: &[u8]) {
    check_behind(RCBENCHMARK, data);
}

/// Behind a byte that chooses: any log, or the rows of a table with semicolons; with a bit that says whether nothing says what drove the
/// command, and one for a rate.
pub fn fuzz_import_plain(data: &[u8]) {
    match data {
        [form, bytes @ ..] if form & 2 != 0 => {
            let options = ImportOptions {
                excitation: None,
                rate_hz: (form & 4 != 0).then_some(100.0),
                columns: vec!["command=pwm_us:us".parse().expect("it is one")],
                ..multisine()
            };
            let header = if options.rate_hz.is_some() { PLAIN_WITHOUT_TIMES } else { PLAIN };
            check_with(&[header, bytes].concat(), &options);
        }
        data => check_behind(PLAIN, data),
    }
}

/// Behind a byte that chooses: any log, or the rows of a decoded blackbox; with a bit that says whether a flight is refused.
pub fn fuzz_import_blackbox_csv(data: &[u8]) {
    check_autopilot_behind(BLACKBOX_CSV, data);
}

/// Behind a byte that chooses: any log, or the rows of a Crazyflie's log variables; with a bit that says whether a flight is refused.
pub fn fuzz_import_crazyflie(data: &[u8]) {
    check_autopilot_behind(CRAZYFLIE, data);
}

/// Behind a byte that chooses: any log, or the rows of a stand's.
pub fn fuzz_import_flight_stand(data: &[u8]) {
    check_behind(FLIGHT_STAND, data);
}

/// Behind a byte that chooses: any log, or the rows of VESC Tool's.
pub fn fuzz_import_vesc(data: &[u8]) {
    check_behind(VESC, data);
}

/// Behind a byte that chooses: any log, or the rows of an ESC's telemetry.
pub fn fuzz_import_esc32(data: &[u8]) {
    check_behind(ESC32, data);
}

/// Behind a byte that chooses: any log, or the messages of a ULog.
pub fn fuzz_import_ulog(data: &[u8]) {
    check_autopilot_behind(ULOG, data);
}

/// Behind a byte that chooses: any log, the elements of a MATLAB file in either byte order, or what is in one compressed
/// element of it.
pub fn fuzz_import_mat(data: &[u8]) {
    let Some((form, bytes)) = data.split_first() else { return };
    let (big, compressed) = (form & 1 != 0, form & 2 != 0);
    if form & 4 != 0 {
        return check(bytes);
    }
    let mut file = vec![b' '; 124];
    file.extend(if big { [1, 0, b'M', b'I'] } else { [0, 1, b'I', b'M'] });
    if compressed {
        // The fastest level: what matters is what comes out again.
        let packed = packed(bytes, Compression::fast());
        let word = |value: u32| if big { value.to_be_bytes() } else { value.to_le_bytes() };
        file.extend([word(15), word(packed.len() as u32)].concat());
        file.extend(packed);
    } else {
        file.extend(bytes);
    }
    check(&file);
}

fn packed(bytes: &[u8], level: Compression) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), level);
    encoder.write_all(bytes).expect("memory takes all");
    encoder.finish().expect("memory takes all")
}

/// Behind a byte that chooses: any log, or a blackbox behind its first two lines.
pub fn fuzz_import_blackbox(data: &[u8]) {
    check_autopilot_behind(b"H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\n", data);
}

/// Behind a byte that chooses: any log, or the messages of a DataFlash log behind the format of formats.
pub fn fuzz_import_dataflash(data: &[u8]) {
    check_autopilot_behind(&sample!("bench.bin")[..FMT_LENGTH], data);
}

/// Bytes of the message that begins a DataFlash log.
const FMT_LENGTH: usize = 89;

/// The first `count` lines.
fn lines(text: &[u8], count: usize) -> Vec<u8> {
    text.split_inclusive(|&byte| byte == b'\n').take(count).flatten().copied().collect()
}

fn behind(form: u8, parts: &[&[u8]]) -> Vec<u8> {
    [&[form], &parts.concat()[..]].concat()
}

/// Bytes to start [`fuzz_import_rcbenchmark`] from: the sample's beginning, and bare rows.
#[must_use]
pub fn import_rcbenchmark_corpus() -> Vec<(&'static str, Vec<u8>)> {
    let row = |k: usize| format!("{}.{:03},{},{},\n", k / 143, k * 7 % 1000, 1200 + k, 5000 + k);
    let rows: String = (0..110).map(row).collect();
    vec![
        ("sample", behind(0, &[&lines(sample!("rcbenchmark.csv"), 130)])),
        ("rows", behind(1, &[rows.as_bytes()])),
        ("shortest_rows", behind(1, &["1\n".repeat(600).as_bytes()])),
    ]
}

/// Bytes to start [`fuzz_import_plain`] from: rows with decimal commas, a table with lines above it and below its names, one
/// with tabs and repeated stamps, and the shortest rows.
#[must_use]
pub fn import_plain_corpus() -> Vec<(&'static str, Vec<u8>)> {
    let row = |k: usize| format!("{};{};{},5;{};15,{}\n", 5 * k, 1400 + k % 50, 300 + k, 5000 + k, k % 10);
    let rows: String = (0..110).map(row).collect();
    let row = |k: usize| format!("{}.{:02},{},{}\n", k / 100, k % 100, k % 70, k % 9);
    let units: String = (0..110).map(row).collect();
    let units = format!("blue motor\n\n% 10 inch\ntime,throttle,thrust\n(s),[%],kgf\n{units}");
    let row = |k: usize| format!("{}\t{}\t{}\t\n", k / 2 * 2, k % 3, 100 + k);
    let tabs: String = (0..220).map(row).collect();
    let row =
        |k: usize| format!("{};{};{};{};15\n", 5 * k, if k / 3 * 37 % 5 < 2 { 1400 } else { 1500 }, 300 + k, 5000 + k);
    let random: String = (0..220).map(row).collect();
    let row = |k: usize| format!("{};;{}\n", 1400 + k, if k % 50 == 7 { 999_999 } else { 5000 });
    let glitches: String = (0..220).map(row).collect();
    vec![
        ("rows", behind(1, &[rows.as_bytes()])),
        ("units", behind(0, &[units.as_bytes()])),
        ("tabs", behind(0, &[b"t_us\tduty (%)\trpm\n", tabs.as_bytes()])),
        ("shortest_rows", behind(1, &["1;1\n".repeat(600).as_bytes()])),
        ("random", behind(2, &[random.as_bytes()])),
        ("glitches", behind(6, &[glitches.as_bytes()])),
    ]
}

/// Rows of numbers behind `header`, and the shortest rows.
fn table_corpus(header: &[u8], row: impl Fn(usize) -> String, shortest: &str) -> Vec<(&'static str, Vec<u8>)> {
    let rows: String = (0..110).map(row).collect();
    vec![
        ("whole", behind(0, &[header, rows.as_bytes()])),
        ("rows", behind(1, &[rows.as_bytes()])),
        ("shortest_rows", behind(1, &[shortest.repeat(600).as_bytes()])),
    ]
}

/// Bytes to start [`fuzz_import_blackbox_csv`] from: a decoded log, its rows, the shortest ones, and a flight.
#[must_use]
pub fn import_blackbox_csv_corpus() -> Vec<(&'static str, Vec<u8>)> {
    let row = |k: usize| format!("{k}, {}, 16.1, {}, {}, {}, 0\n", 1000 * k, 300 + 5 * k, 48 + k * k % 90, 500 + k);
    let mut corpus = table_corpus(BLACKBOX_CSV, row, "1,1,1,1\n");
    let rows: String = (0..110).map(row).collect();
    corpus.push(("flight", behind(3, &[rows.as_bytes()])));
    corpus
}

/// Bytes to start [`fuzz_import_crazyflie`] from: a table of log variables, its rows, and the shortest ones.
#[must_use]
pub fn import_crazyflie_corpus() -> Vec<(&'static str, Vec<u8>)> {
    let row = |k: usize| format!("{},{},0,{},0,3900\n", 10 * k, 20_000 + 100 * k, 9000 + k);
    table_corpus(CRAZYFLIE, row, "1,1,1,1\n")
}

/// Bytes to start [`fuzz_import_flight_stand`] from: a stand's log, its rows, and the shortest ones.
#[must_use]
pub fn import_flight_stand_corpus() -> Vec<(&'static str, Vec<u8>)> {
    let row = |k: usize| format!("{}.{:02},{},{}.5,{}\n", k / 100, k % 100, 1200 + k, k % 9, 5000 + k);
    table_corpus(FLIGHT_STAND, row, "1,1,1\n")
}

/// Bytes to start [`fuzz_import_vesc`] from: a log with semicolons, its rows, and the shortest ones.
#[must_use]
pub fn import_vesc_corpus() -> Vec<(&'static str, Vec<u8>)> {
    let row = |k: usize| format!("{};24.1;{};{};0.{:03};\n", 40_000_000 + 10 * k, k % 7, 70_000 + k, 200 + k);
    table_corpus(VESC, row, "1;1;1;1;1\n")
}

/// Bytes to start [`fuzz_import_esc32`] from: the sample's beginning, bare rows, and stamps centuries apart.
#[must_use]
pub fn import_esc32_corpus() -> Vec<(&'static str, Vec<u8>)> {
    let row = |k: usize| format!("2019-11-07 23:45:{}:{:03},15,{}\n", 10 + k / 100, k * 10 % 1000, 5000 + k);
    let rows: String = (0..110).map(row).collect();
    let far = |k: usize| format!("{:04}-01-01 00:00:00:{:09},1,1\n", if k < 60 { 1 } else { 9000 + k }, k);
    let far: String = (0..110).map(far).collect();
    vec![
        ("sample", behind(0, &[&lines(sample!("esc32.csv"), 112)])),
        ("rows", behind(1, &[rows.as_bytes()])),
        ("centuries", behind(1, &[far.as_bytes()])),
    ]
}

/// Bytes to start [`fuzz_import_ulog`] from: the sample, its messages, and the shortest messages.
#[must_use]
pub fn import_ulog_corpus() -> Vec<(&'static str, Vec<u8>)> {
    let log = sample!("esc_status.ulg");
    let mut short = b"\x16\0Factuator_motors:int8_t x;".to_vec();
    short.extend(b"\x0c\0A\0\0\0esc_status".iter().chain(&b"\x02\0D\0\0".repeat(400)));
    vec![
        ("sample", behind(0, &[log])),
        ("messages", behind(1, &[&log[ULOG.len()..12_000]])),
        ("shortest_messages", behind(1, &[&short])),
    ]
}

/// Bytes to start [`fuzz_import_dataflash`] from: the beginnings of the samples, and the shortest messages.
#[must_use]
pub fn import_dataflash_corpus() -> Vec<(&'static str, Vec<u8>)> {
    let (bench, chirp) = (sample!("bench.bin"), sample!("chirp.bin"));
    let format = |kind: u8, name: &[u8; 4], kinds: &[u8], labels: &[u8], length: u8| {
        let mut format = [&[0xa3, 0x95, 128, kind, length][..], name, kinds].concat();
        format.resize(25, 0);
        format.extend(labels);
        format.resize(FMT_LENGTH, 0);
        format
    };
    let mut short = format(1, b"ECRP", b"BBBB", b"TimeUS,PWM,Freq,RPM", 7);
    for k in 0..200 {
        short.extend([0xa3, 0x95, 1, k, 100 + k % 7, k, k]);
    }
    let mut pair = format(1, b"RCOU", b"BBB", b"TimeUS,C1,C2", 6);
    pair.extend(format(2, b"ESC\0", b"BBB", b"TimeUS,Instance,RPM", 6));
    for k in 0..200 {
        pair.extend([0xa3, 0x95, 1, k, 100 + k % 7, 100 + k % 5, 0xa3, 0x95, 2, k, 0, k]);
    }
    vec![
        ("bench", behind(0, &[&bench[..12_000]])),
        ("messages", behind(1, &[&bench[FMT_LENGTH..9000]])),
        ("flight", behind(2, &[&bench[..12_000]])),
        ("chirp", behind(0, &[&chirp[..6000]])),
        ("shortest_chirp", behind(3, &[&short])),
        ("shortest_pair", behind(3, &[&pair])),
    ]
}

/// Bytes to start [`fuzz_import_mat`] from: the sample, vectors of bytes, one to be packed, and packed ones of which the
/// last is a thousand times its length.
#[must_use]
pub fn import_mat_corpus() -> Vec<(&'static str, Vec<u8>)> {
    let log = sample!("vectors.mat");
    let element = |kind: u32, data: &[u8]| {
        let mut element = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
        element.extend(data);
        element.resize(element.len().next_multiple_of(8), 0);
        element
    };
    let vector = |name: &str, numbers: &[u8]| {
        let size = [(numbers.len() as u32).to_le_bytes(), 1_u32.to_le_bytes()].concat();
        let flags = [9, 0, 0, 0, 0, 0, 0, 0];
        let parts = [element(6, &flags), element(5, &size), element(1, name.as_bytes()), element(2, numbers)];
        element(14, &parts.concat())
    };
    let zip = |data: &[u8]| {
        let packed = packed(data, Compression::best());
        [&15_u32.to_le_bytes(), &(packed.len() as u32).to_le_bytes(), &packed[..]].concat()
    };
    let numbers: Vec<u8> = (0..110).collect();
    let vectors = [vector("t", &numbers), vector("u", &[1; 110]), vector("rpm", &numbers)];
    vec![
        ("sample", behind(4, &[log])),
        ("elements", behind(0, &[&log[128..]])),
        ("bytes", behind(0, &[&vectors.concat()])),
        ("to_be_packed", behind(2, &[&vectors[0]])),
        ("packed", behind(0, &[&vectors.each_ref().map(|v| zip(v)).concat()])),
        ("bomb", behind(0, &[&zip(&vector("t", &vec![0; 1 << 20]))])),
        ("bomb_of_no_interest", behind(0, &[&zip(&vector("x", &vec![0; 1 << 20])), &vectors.concat()])),
    ]
}

/// Bytes to start [`fuzz_import_blackbox`] from: the sample's first log and the beginning of its second, and frames of
/// one byte.
///
/// # Panics
/// When the sample has no second log.
#[must_use]
pub fn import_blackbox_corpus() -> Vec<(&'static str, Vec<u8>)> {
    let file = sample!("blackbox.bbl");
    let second = (1..file.len()).find(|&at| file[at..].starts_with(b"H Product")).expect("two logs are in the sample");
    let headers = "H Field I name:time,motor[0],eRPM[0]\nH Field I predictor:0,0,0\nH Field I encoding:1,1,1\n\
                   H Field P predictor:2,1,1\nH Field P encoding:9,9,9\nH motor_poles:14\nH motor_pwm_protocol:6\n\
                   H Firmware revision:Betaflight 4.5.0 (x) Y\nI\x01\x50\x20P";
    let frames = [headers.as_bytes(), &b"I\x02\x50\x20"[..], &b"P".repeat(400)].concat();
    vec![
        ("sample", behind(2, &[&file[..second + 3500]])),
        ("frames", behind(1, &[&lines(&file[second..], 30)[80..], &file[second + 1300..second + 4000]])),
        ("shortest_frames", behind(1, &[&frames])),
    ]
}
