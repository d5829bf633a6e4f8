//! The fuzzers' claims on their stored corpora, and on mutations of these. `fuzz/` runs the same functions under
//! libFuzzer.

use std::path::PathBuf;

use host_tests::fuzz::*;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

type Corpus = Vec<(&'static str, Vec<u8>)>;

type Fuzzer = (&'static str, fn(&[u8]), fn() -> Corpus);

/// Name, entry point, and the made part of the corpus. The stored one has what libFuzzer found beside it.
const FUZZERS: [Fuzzer; 9] = [
    ("capture", fuzz_capture, capture_corpus),
    ("import_blackbox", fuzz_import_blackbox, import_blackbox_corpus),
    ("import_esc32", fuzz_import_esc32, import_esc32_corpus),
    ("import_mat", fuzz_import_mat, import_mat_corpus),
    ("import_plain", fuzz_import_plain, import_plain_corpus),
    ("import_rcbenchmark", fuzz_import_rcbenchmark, import_rcbenchmark_corpus),
    ("import_ulog", fuzz_import_ulog, import_ulog_corpus),
    ("link", fuzz_link, link_corpus),
    ("settings", fuzz_settings, settings_corpus),
];

fn folder(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("corpus").join(name)
}

/// Every stored file, in the order of the names.
fn stored(name: &str) -> Vec<Vec<u8>> {
    let folder = folder(name);
    let entries = std::fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.iter().map(|file| std::fs::read(file).unwrap()).collect()
}

/// The named files are what they are named after, as seen through each fuzzer's own encoding.
#[test]
fn the_corpora_are_stored_as_they_are_made() {
    for (name, _, made) in FUZZERS {
        for (file, bytes) in made() {
            let file = folder(name).join(file);
            if std::env::var_os("UPDATE_CORPUS").is_some() {
                std::fs::create_dir_all(folder(name)).unwrap();
                std::fs::write(&file, &bytes).unwrap();
            }
            let stored = std::fs::read(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
            assert!(stored == bytes, "{} differs: UPDATE_CORPUS=1 writes it anew", file.display());
        }
    }
}

#[test]
fn the_corpora_keep_the_claims() {
    for (name, fuzz, _) in FUZZERS {
        let corpus = stored(name);
        assert!(
            corpus.len() > 10 || name == "settings" || name.starts_with("import_") && corpus.len() > 2,
            "{name}: {} files",
            corpus.len()
        );
        corpus.iter().for_each(|bytes| fuzz(bytes));
    }
}

/// Every mutation that fuzzers begin with, from a fixed seed. `FUZZ_EXECUTIONS` sets how many for each fuzzer.
#[test]
fn mutations_of_the_corpora_keep_the_claims() {
    let executions: u64 = std::env::var("FUZZ_EXECUTIONS").map_or(20_000, |count| count.parse().unwrap());
    for (name, fuzz, _) in FUZZERS {
        let corpus = stored(name);
        let mut random = ChaCha8Rng::seed_from_u64(20_260);
        for _ in 0..executions {
            fuzz(&mutated(&corpus, &mut random));
        }
    }
}

fn mutated(corpus: &[Vec<u8>], random: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = corpus[random.random_range(0..corpus.len())].clone();
    for _ in 0..random.random_range(1..6) {
        let at = random.random_range(0..=bytes.len());
        match random.random_range(0..6) {
            0 if at < bytes.len() => bytes[at] ^= 1 << random.random_range(0..8),
            1 if at < bytes.len() => bytes[at] = random.random(),
            2 => bytes.insert(at, random.random()),
            3 if at < bytes.len() => drop(bytes.remove(at)),
            4 => bytes.truncate(at),
            _ => {
                let other = &corpus[random.random_range(0..corpus.len())];
                let from = random.random_range(0..=other.len());
                bytes.splice(at..at, other[from..(from + 60).min(other.len())].iter().copied());
            }
        }
    }
    bytes
}
