//! The memory of an import is bounded by the log's length. Alone in its file: the meter counts the whole process.

use host_tests::fuzz::{FUZZERS, Fuzzer};
use peak_alloc::PeakAlloc;
use rotorlead_records::import::FORMATS;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

#[test]
fn memory_is_bounded_by_the_length_of_the_log() {
    for format in FORMATS {
        let of_format = |fuzzer: &Fuzzer| fuzzer.log_format() == Some(format);
        let fuzzer =
            FUZZERS.into_iter().find(of_format).unwrap_or_else(|| panic!("no fuzzer has logs of {}", format.name));
        let Fuzzer { name, named_inputs, .. } = fuzzer;
        let mut worst = 0.0;
        let made = named_inputs();
        let stored = corpus::read(name).unwrap_or_else(|error| panic!("{error}"));
        // A last message or row repeated makes long logs of the shortest rows: there the factor shows, not the constant.
        let long = made.iter().map(|(_, bytes)| [&bytes[..], &bytes[bytes.len() - 5..].repeat(200_000)].concat());
        for bytes in stored.into_values().chain(long) {
            let factor = fuzzer.run_metered(&bytes, &MEMORY) as f64 / bytes.len() as f64;
            if bytes.len() > 100_000 {
                worst = f64::max(worst, factor);
            }
        }
        println!("{name}: at most {worst:.0} bytes per byte of a long log");
        // The meter counts.
        assert!(worst > 1.0, "{name}");
    }
}
