//! The memory of an import is bounded by the log's length. Alone in its file: the meter counts the whole process.

use std::path::Path;

use host_tests::fuzz::*;
use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Highest use of memory beyond that before.
fn used(work: impl FnOnce()) -> usize {
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    work();
    MEMORY.peak_usage().saturating_sub(before)
}

/// Name, format, entry point and corpus.
type Fuzzer = (&'static str, FuzzedFormat, fn(&[u8]), Vec<(&'static str, Vec<u8>)>);

#[test]
fn memory_is_bounded_by_the_length_of_the_log() {
    let fuzzers: [Fuzzer; 6] = [
        ("import_blackbox", FuzzedFormat::Blackbox, fuzz_import_blackbox, import_blackbox_corpus()),
        ("import_esc32", FuzzedFormat::Esc32, fuzz_import_esc32, import_esc32_corpus()),
        ("import_mat", FuzzedFormat::Mat, fuzz_import_mat, import_mat_corpus()),
        ("import_plain", FuzzedFormat::Plain, fuzz_import_plain, import_plain_corpus()),
        ("import_rcbenchmark", FuzzedFormat::RcBenchmark, fuzz_import_rcbenchmark, import_rcbenchmark_corpus()),
        ("import_ulog", FuzzedFormat::Ulog, fuzz_import_ulog, import_ulog_corpus()),
    ];
    for (name, format, fuzz, made) in fuzzers {
        let mut worst = 0.0;
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(name);
        let stored = std::fs::read_dir(&folder).unwrap().map(|entry| std::fs::read(entry.unwrap().path()).unwrap());
        // A last message or row repeated makes long logs of the shortest rows: there the factor shows, not the constant.
        let long = made.iter().map(|(_, bytes)| [&bytes[..], &bytes[bytes.len() - 5..].repeat(200_000)].concat());
        for bytes in stored.chain(long) {
            let used = used(|| fuzz(&bytes));
            assert!(used <= format.memory_bound(bytes.len()), "{name}: {used} for {}", bytes.len());
            let factor = used as f64 / bytes.len() as f64;
            if bytes.len() > 100_000 {
                worst = f64::max(worst, factor);
            }
        }
        println!("{name}: at most {worst:.0} bytes per byte of a long log");
        // The meter counts.
        assert!(worst > 1.0, "{name}");
    }
}
