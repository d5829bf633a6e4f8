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
    FUZZER.run_metered(data, &MEMORY);
});
