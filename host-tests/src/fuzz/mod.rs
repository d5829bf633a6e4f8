//! Entry points for fuzzers: each takes any bytes, and panics where a claim does not hold.

mod capture;
mod fleet;
mod import;
mod link;

use peak_alloc::PeakAlloc;
use rotorlead_records::import::{FORMATS, LogFormat};

pub use capture::*;
pub use fleet::*;
pub use import::*;
pub use link::*;

/// One fuzzer.
#[derive(Clone, Copy, Debug)]
pub struct Fuzzer {
    /// Its name: that of its target in `fuzz/`, and of its archive of inputs.
    pub name: &'static str,
    /// Its entry point.
    pub run: fn(&[u8]),
    /// The named part of its stored inputs. The others are what libFuzzer found.
    pub named_inputs: fn() -> Vec<(&'static str, Vec<u8>)>,
    /// The name of the format of its logs, which bounds the memory that they may take, if it has logs.
    pub format: Option<&'static str>,
}

/// Memory that an import may take whatever the log's length, bytes. Chosen: lists and tables of a few rows; a log of some kilobytes is not
/// judged by its length.
const LEAST_MEMORY: usize = 4 << 20;

/// Every fuzzer.
pub const FUZZERS: [Fuzzer; 15] = [
    fuzzer("capture", fuzz_capture, capture_corpus, None),
    fuzzer("fleet", fuzz_fleet, fleet_corpus, None),
    fuzzer("import_blackbox", fuzz_import_blackbox, import_blackbox_corpus, Some("blackbox")),
    fuzzer("import_blackbox_csv", fuzz_import_blackbox_csv, import_blackbox_csv_corpus, Some("blackbox_csv")),
    fuzzer("import_crazyflie", fuzz_import_crazyflie, import_crazyflie_corpus, Some("crazyflie")),
    fuzzer("import_dataflash", fuzz_import_dataflash, import_dataflash_corpus, Some("dataflash")),
    fuzzer("import_esc32", fuzz_import_esc32, import_esc32_corpus, Some("esc32")),
    fuzzer("import_flight_stand", fuzz_import_flight_stand, import_flight_stand_corpus, Some("flight_stand")),
    fuzzer("import_mat", fuzz_import_mat, import_mat_corpus, Some("mat")),
    fuzzer("import_plain", fuzz_import_plain, import_plain_corpus, Some("plain")),
    fuzzer("import_rcbenchmark", fuzz_import_rcbenchmark, import_rcbenchmark_corpus, Some("rc_benchmark")),
    fuzzer("import_ulog", fuzz_import_ulog, import_ulog_corpus, Some("ulog")),
    fuzzer("import_vesc", fuzz_import_vesc, import_vesc_corpus, Some("vesc")),
    fuzzer("link", fuzz_link, link_corpus, None),
    fuzzer("settings", fuzz_settings, settings_corpus, None),
];

impl Fuzzer {
    /// The format of its logs, if it has logs.
    ///
    /// # Panics
    /// When there is no format of this name.
    #[must_use]
    pub fn log_format(&self) -> Option<&'static LogFormat> {
        let named = |name| FORMATS.into_iter().find(|format| format.name == name);
        self.format.map(|name| named(name).unwrap_or_else(|| panic!("no format {name}")))
    }

    /// Runs it on these bytes and gives the memory that this took, as `memory` meters it, which has to be the program's allocator.
    ///
    /// # Panics
    /// Where a claim does not hold, or where a log takes more memory than its format may.
    pub fn run_metered(&self, bytes: &[u8], memory: &PeakAlloc) -> usize {
        let before = memory.current_usage();
        memory.reset_peak_usage();
        (self.run)(bytes);
        let used = memory.peak_usage().saturating_sub(before);
        if let Some(format) = self.log_format() {
            let most = LEAST_MEMORY + format.memory_per_byte * bytes.len();
            assert!(used <= most, "{}: {used} bytes for a log of {}", self.name, bytes.len());
        }
        used
    }
}

const fn fuzzer(
    name: &'static str,
    run: fn(&[u8]),
    named_inputs: fn() -> Vec<(&'static str, Vec<u8>)>,
    format: Option<&'static str>,
) -> Fuzzer {
    Fuzzer { name, run, named_inputs, format }
}
