//! The fuzzers' claims on their stored corpora, and on mutations of these. `fuzz/` runs the same functions under
//! libFuzzer.

use corpus::Inputs;
use host_tests::fuzz::FUZZERS;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

fn stored(name: &str) -> Inputs {
    corpus::read(name).unwrap_or_else(|error| panic!("{error}"))
}

/// The named inputs are what they are named after, as seen through each fuzzer's own encoding.
#[test]
fn the_corpora_are_stored_as_they_are_made() {
    for fuzzer in FUZZERS {
        let made: Inputs = (fuzzer.named_inputs)().into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect();
        let is_there = corpus::archive(fuzzer.name).exists();
        if std::env::var_os("UPDATE_CORPUS").is_some() {
            let mut inputs = if is_there { stored(fuzzer.name) } else { Inputs::new() };
            inputs.extend(made.clone());
            corpus::write(fuzzer.name, &inputs).unwrap();
        }
        let stored = stored(fuzzer.name);
        for (input, bytes) in &made {
            let same = stored.get(input) == Some(bytes);
            assert!(same, "{}: {input} is missing or differs: UPDATE_CORPUS=1 writes it anew", fuzzer.name);
        }
    }
}

#[test]
fn every_archive_and_every_target_is_of_a_fuzzer() {
    let names = FUZZERS.map(|fuzzer| fuzzer.name);
    assert_eq!(corpus::fuzzers().unwrap(), names);
    let manifest: toml::Value = toml::from_str(include_str!("../../../fuzz/Cargo.toml")).unwrap();
    let targets = manifest["bin"].as_array().unwrap().iter().map(|target| target["name"].as_str().unwrap());
    assert_eq!(targets.collect::<Vec<_>>(), names);
}

#[test]
fn the_corpora_keep_the_claims() {
    for fuzzer in FUZZERS {
        let inputs = stored(fuzzer.name);
        // Those that libFuzzer found are there too.
        let least = match fuzzer.name {
            "capture" => 100,
            "settings" => 200,
            _ => (fuzzer.named_inputs)().len(),
        };
        assert!(inputs.len() >= least, "{}: {} inputs", fuzzer.name, inputs.len());
        inputs.values().for_each(|bytes| (fuzzer.run)(bytes));
    }
}

/// Every mutation that fuzzers begin with, from a fixed seed. `FUZZ_EXECUTIONS` sets how many for each fuzzer.
#[test]
fn mutations_of_the_corpora_keep_the_claims() {
    let executions: u64 = std::env::var("FUZZ_EXECUTIONS").map_or(20_000, |count| count.parse().unwrap());
    for fuzzer in FUZZERS {
        let corpus: Vec<Vec<u8>> = stored(fuzzer.name).into_values().collect();
        let mut random = ChaCha8Rng::seed_from_u64(20_260);
        for _ in 0..executions {
            (fuzzer.run)(&mutated(&corpus, &mut random));
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
