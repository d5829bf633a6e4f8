//! Any bytes as the log of another tool.

use std::io::Write as _;
use std::path::Path;

use flate2::{Compression, write::ZlibEncoder};
use miette::Diagnostic as _;
use rotorlead_sim::record::import::{Import, ImportOptions, import_bytes};

/// What messages have to call the log.
const FILE: &str = "fuzzed.log";

/// Memory that an import may take at a time, beside the log. Most is taken by compressed data: a byte of the file may
/// inflate to 64 one-byte numbers, each of which becomes doubles in the vector, in the column and as its time, and the
/// place of its row; and lists take twice as much while they grow. Other formats take up to 400 bytes for a row of two.
#[must_use]
pub fn import_memory_bound(length: usize) -> usize {
    (4 << 20) + 64 * 32 * length
}

/// Bytes as a log of any format, which is told from them.
///
/// # Panics
/// When the importer does, or takes what no experiment is, or refuses without saying why, where and what to do.
fn check(bytes: &[u8]) {
    let options = ImportOptions::default();
    match import_bytes(Path::new(FILE), bytes, &options) {
        Ok(Import { experiment, summary }) => {
            let [record] = &experiment.records[..] else { panic!("{} records", experiment.records.len()) };
            assert!(record.time_s.is_sorted_by(|a, b| a < b), "time does not increase");
            assert!(record.command.iter().all(|c| (0.0..=1.0).contains(c)), "a command outside 0..1");
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

/// The first byte says whether the others are a log as they are or what comes behind `prefix`.
fn check_behind(prefix: &[u8], data: &[u8]) {
    match data {
        [form, bytes @ ..] if form % 2 == 1 => check(&[prefix, bytes].concat()),
        [_, bytes @ ..] => check(bytes),
        [] => check(&[]),
    }
}

const RCBENCHMARK: &[u8] = "Time (s),ESC signal (µs),Motor Electrical Speed (RPM),Thrust (N)\n".as_bytes();
const ESC32: &[u8] = b"Timestamp,Duty,RPM\n";
const ULOG: &[u8] = b"ULog\x01\x12\x35\x01\0\0\0\0\0\0\0\0";

/// Behind a byte that chooses: any log, or the rows of a stand's.
pub fn fuzz_import_rcbenchmark(data: &[u8]) {
    check_behind(RCBENCHMARK, data);
}

/// Behind a byte that chooses: any log, or the rows of an ESC's telemetry.
pub fn fuzz_import_esc32(data: &[u8]) {
    check_behind(ESC32, data);
}

/// Behind a byte that chooses: any log, or the messages of a ULog.
pub fn fuzz_import_ulog(data: &[u8]) {
    check_behind(ULOG, data);
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
    check_behind(b"H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\n", data);
}
