//! Files of random bytes: refused, never a panic.

use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::stand::{AIRFRAME, MODEL, PLAN, Stand};

/// Files per kind and command.
const FILES: usize = 6;

/// Bytes of any kind.
fn bytes(random: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = vec![0; random.random_range(1..3000)];
    random.fill_bytes(&mut bytes);
    bytes
}

/// Text of the characters that TOML and CSV are made of.
fn text(random: &mut ChaCha8Rng) -> Vec<u8> {
    const CHARACTERS: &[u8] = b"0123456789.-+e,,,\n\n\r\t =[]{}\"'#truefalsnominalgain_\xc3\xb5";
    let length = random.random_range(1..3000);
    (0..length).map(|_| CHARACTERS[random.random_range(0..CHARACTERS.len())]).collect()
}

/// A good file with one byte turned into a control character, which no text has.
fn damaged(random: &mut ChaCha8Rng, good: &str) -> Vec<u8> {
    let mut bytes = good.as_bytes().to_vec();
    let at = random.random_range(0..bytes.len());
    bytes[at] = 0x01;
    bytes
}

/// Commands with the file of theirs that is spoiled.
const COMMANDS: [(&str, &str); 9] = [
    ("identify stand --out found.toml", "stand/experiment.toml"),
    ("identify stand --out found.toml", "stand/step.csv"),
    ("validate stand --model model.toml", "stand/step.csv"),
    ("design --kind lead --model model.toml --out c.toml", "model.toml"),
    ("bandwidth --model model.toml", "model.toml"),
    ("bandwidth --model model.toml --compensator spoiled.toml", "spoiled.toml"),
    ("simulate --model model.toml --plan plan.toml --out sim", "plan.toml"),
    ("vehicle --airframe airframe.toml --model model.toml", "airframe.toml"),
    ("import spoiled.csv --out imported", "spoiled.csv"),
];

#[test]
fn random_files_are_refused_and_named() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for (arguments, spoiled) in COMMANDS {
        for index in 0..FILES {
            let stand = Stand::new();
            stand.write(spoiled, if index % 2 == 0 { bytes(&mut random) } else { text(&mut random) });
            stand.refuses(arguments, 1, &[spoiled]);
        }
    }
}

#[test]
fn one_damaged_byte_in_a_good_file_is_refused_and_named() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    for (arguments, spoiled, good) in [
        ("design --kind lead --model model.toml --out c.toml", "model.toml", MODEL),
        ("simulate --model model.toml --plan plan.toml --out sim", "plan.toml", PLAN),
        ("vehicle --airframe airframe.toml --model model.toml", "airframe.toml", AIRFRAME),
    ] {
        for _ in 0..FILES {
            let stand = Stand::new();
            stand.write(spoiled, damaged(&mut random, good));
            stand.refuses(arguments, 1, &[spoiled]);
        }
    }
}

#[test]
fn rows_cut_anywhere_never_panic() {
    // What is left may be a good record; whatever is said of it, it is said by a report or a result.
    let mut random = ChaCha8Rng::seed_from_u64(3);
    for _ in 0..FILES {
        let stand = Stand::new();
        let text = stand.read("stand/step.csv");
        stand.write("stand/step.csv", &text[..random.random_range(0..text.len())]);
        let output = stand.command("identify stand --out found.toml").output().unwrap();
        let report = String::from_utf8(output.stderr).unwrap();
        assert!(matches!(output.status.code(), Some(0 | 1)) && !report.contains("panicked"), "{report}");
        assert_eq!(stand.path("found.toml").exists(), output.status.success());
    }
}
