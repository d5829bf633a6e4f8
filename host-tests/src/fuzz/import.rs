//! Any bytes as the log of another tool.

use std::io::Write as _;
use std::path::Path;

use flate2::{Compression, write::ZlibEncoder};
use miette::Diagnostic as _;
use rotorlead_sim::record::import::{Import, ImportOptions, import_bytes};

/// What messages have to call the log.
const FILE: &str = "fuzzed.log";

/// Memory that an import may take at a time, beside the log: for a row of two bytes, which is the shortest of all
/// formats, the columns of numbers and the text cells that it may become; and once more where a list grows. Compressed
/// data may inflate as far as `rotorlead_sim` lets it.
#[must_use]
pub fn import_memory_bound(length: usize) -> usize {
    (1 << 20) + 1024 * length
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

fn with_prefix(prefix: &[u8], bytes: &[u8]) {
    check(&[prefix, bytes].concat());
}

/// Bytes as they are, and as the rows of a stand's log.
pub fn fuzz_import_rcbenchmark(bytes: &[u8]) {
    check(bytes);
    with_prefix("Time (s),ESC signal (µs),Motor Electrical Speed (RPM),Thrust (N)\n".as_bytes(), bytes);
}

/// Bytes as they are, and as the rows of an ESC's telemetry.
pub fn fuzz_import_esc32(bytes: &[u8]) {
    check(bytes);
    with_prefix(b"Timestamp,Duty,RPM\n", bytes);
}

/// Bytes as they are, as the elements of a MATLAB file in either byte order, and as one compressed element.
pub fn fuzz_import_mat(bytes: &[u8]) {
    check(bytes);
    for order in [[0, 1, b'I', b'M'], [1, 0, b'M', b'I']] {
        let mut file = vec![b' '; 124];
        file.extend(order);
        file.extend(bytes);
        check(&file);
        // The fastest level: what matters is what comes out again.
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(bytes).and_then(|()| encoder.try_finish()).expect("memory takes all");
        let packed = encoder.finish().expect("memory takes all");
        file.truncate(128);
        let word = |value: u32| if order[0] == 0 { value.to_le_bytes() } else { value.to_be_bytes() };
        file.extend([word(15), word(packed.len() as u32)].concat());
        file.extend(packed);
        check(&file);
    }
}

/// Bytes as they are, and as the messages of a ULog.
pub fn fuzz_import_ulog(bytes: &[u8]) {
    check(bytes);
    with_prefix(b"ULog\x01\x12\x35\x01\0\0\0\0\0\0\0\0", bytes);
}

/// Bytes as they are.
pub fn fuzz_import_blackbox(bytes: &[u8]) {
    check(bytes);
}
