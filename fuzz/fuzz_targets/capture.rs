//! See `host_tests::fuzz::fuzz_capture`.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| host_tests::fuzz::fuzz_capture(data));
