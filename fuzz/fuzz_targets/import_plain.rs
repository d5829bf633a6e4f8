//! See `host_tests::fuzz::fuzz_import_plain`; and that memory is bounded by the file.
#![no_main]

use host_tests::fuzz::{FuzzedFormat, fuzz_import_plain};
use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    fuzz_import_plain(data);
    let used = MEMORY.peak_usage().saturating_sub(before);
    assert!(used <= FuzzedFormat::Plain.memory_bound(data.len()), "{used} bytes for a log of {}", data.len());
});
