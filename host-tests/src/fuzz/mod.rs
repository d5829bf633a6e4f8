//! Entry points for fuzzers: each takes any bytes, and panics where a claim does not hold.

mod capture;
mod fleet;
mod import;
mod link;

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
    /// The format of its logs, which bounds the memory that they may take, if it has logs.
    pub format: Option<FuzzedFormat>,
}

/// Every fuzzer.
pub const FUZZERS: [Fuzzer; 11] = [
    fuzzer("capture", fuzz_capture, capture_corpus, None),
    fuzzer("fleet", fuzz_fleet, fleet_corpus, None),
    fuzzer("import_blackbox", fuzz_import_blackbox, import_blackbox_corpus, Some(FuzzedFormat::Blackbox)),
    fuzzer("import_dataflash", fuzz_import_dataflash, import_dataflash_corpus, Some(FuzzedFormat::DataFlash)),
    fuzzer("import_esc32", fuzz_import_esc32, import_esc32_corpus, Some(FuzzedFormat::Esc32)),
    fuzzer("import_mat", fuzz_import_mat, import_mat_corpus, Some(FuzzedFormat::Mat)),
    fuzzer("import_plain", fuzz_import_plain, import_plain_corpus, Some(FuzzedFormat::Plain)),
    fuzzer("import_rcbenchmark", fuzz_import_rcbenchmark, import_rcbenchmark_corpus, Some(FuzzedFormat::RcBenchmark)),
    fuzzer("import_ulog", fuzz_import_ulog, import_ulog_corpus, Some(FuzzedFormat::Ulog)),
    fuzzer("link", fuzz_link, link_corpus, None),
    fuzzer("settings", fuzz_settings, settings_corpus, None),
];

const fn fuzzer(
    name: &'static str,
    run: fn(&[u8]),
    named_inputs: fn() -> Vec<(&'static str, Vec<u8>)>,
    format: Option<FuzzedFormat>,
) -> Fuzzer {
    Fuzzer { name, run, named_inputs, format }
}
