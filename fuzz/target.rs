//! The fuzzer that the target is named after: `host_tests::fuzz::FUZZERS`. Where it has logs, their memory is bounded too.
#![no_main]

use std::sync::LazyLock;

use host_tests::fuzz::{FUZZERS, Fuzzer};
use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

static FUZZER: LazyLock<Fuzzer> = LazyLock::new(|| {
    let name = env!("CARGO_BIN_NAME");
    FUZZERS.into_iter().find(|fuzzer| fuzzer.name == name).unwrap_or_else(|| panic!("there is no fuzzer {name}"))
});

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let fuzzer = *FUZZER;
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    (fuzzer.run)(data);
    let used = MEMORY.peak_usage().saturating_sub(before);
    if let Some(format) = fuzzer.format {
        assert!(used <= format.memory_bound(data.len()), "{used} bytes for a log of {}", data.len());
    }
});
