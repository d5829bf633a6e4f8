//! A mutator that knows the fields of the files: whatever a column or a key holds, the promise of [`super::robust`] is kept.
//!
//! It runs for some seconds with a seed of its own. `ROTORLEAD_MUTATE_S=36000` in the environment makes it run for as many
//! seconds, and `ROTORLEAD_MUTATE_SEED` begins elsewhere. What breaks a promise is printed with its files.

use std::time::{Duration, Instant};

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::robust::broken_promise;
use crate::stand::Stand;

/// How long the tests run it.
const SECONDS: u64 = 30;

/// Commands over all files, each with the files that it reads.
const COMMANDS: [(&str, &[&str]); 16] = [
    ("check stand", RECORDS),
    ("identify stand --out found.toml", RECORDS),
    ("identify stand --static-map --out found.toml", RECORDS),
    ("validate stand --model model.toml", RECORDS_AND_MODEL),
    ("diagnose stand", RECORDS),
    ("report stand --no-diagnosis --out page.html", RECORDS),
    ("bandwidth --model model.toml --records stand", RECORDS_AND_MODEL),
    ("bandwidth --model model.toml --steps 0.05", MODEL),
    ("bandwidth --model model.toml --kind inverse", MODEL),
    ("bandwidth --model model.toml --compensator c.toml", &["model.toml", "c.toml"]),
    ("design --model model.toml --kind inverse --out d.toml", MODEL),
    ("design --model model.toml --out d.toml", MODEL),
    ("simulate --model model.toml --plan plan.toml --out sim", &["model.toml", "plan.toml"]),
    ("vehicle --airframe airframe.toml --model model.toml", &["airframe.toml", "model.toml"]),
    ("export --for px4 --model model.toml", MODEL),
    ("import stand/step.csv --out imported", &["stand/step.csv"]),
];
const MODEL: &[&str] = &["model.toml"];
const RECORDS: &[&str] = &["stand/experiment.toml", "stand/step.csv"];
const RECORDS_AND_MODEL: &[&str] = &["stand/experiment.toml", "stand/step.csv", "model.toml"];

/// Numbers that someone writes by a slip, and the ends of what a float holds.
const EXTREMES: [&str; 18] = [
    "0",
    "-1",
    "1e-3",
    "1000",
    "1e-300",
    "5e-324",
    "1e9",
    "6e14",
    "9e18",
    "1e300",
    "1.7976931348623157e308",
    "-1e300",
    "nan",
    "inf",
    "0.5",
    "1",
    "100",
    "1e-9",
];
/// What records are said to be.
const EXCITATIONS: [&str; 7] = ["multisine", "square", "step", "staircase", "steady", "chirp", "free"];

/// A TOML file with one of its values replaced.
fn mutated_toml(random: &mut ChaCha8Rng, text: &str) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let is_value = |line: &String| {
        line.split_once(" = ").is_some_and(|(_, value)| value.starts_with(|c: char| c.is_ascii_digit()))
    };
    let places: Vec<usize> = (0..lines.len()).filter(|&line| is_value(&lines[line])).collect();
    let place = places[random.random_range(0..places.len())];
    let key = lines[place].split_once(" = ").unwrap().0.to_owned();
    match random.random_range(0..8) {
        0 => drop(lines.remove(place)),
        1 => lines.push(lines[place].clone()),
        _ => lines[place] = format!("{key} = {}", EXTREMES[random.random_range(0..EXTREMES.len())]),
    }
    let mut text = lines.join("\n") + "\n";
    if random.random_bool(0.5) {
        let excitation = EXCITATIONS[random.random_range(0..EXCITATIONS.len())];
        text = text.replacen("excitation = \"step\"", &format!("excitation = \"{excitation}\"\nperiod_s = 1.0"), 1);
    }
    text
}

/// A record with one column of another shape, or other times.
fn mutated_rows(random: &mut ChaCha8Rng, text: &str) -> String {
    let mut lines = text.lines();
    let header = lines.next().unwrap_or_default();
    let mut rows: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
    let count = rows.len();
    let extreme = |random: &mut ChaCha8Rng| EXTREMES[random.random_range(0..EXTREMES.len())].parse::<f64>().unwrap();
    for _ in 0..random.random_range(1..4) {
        let column = random.random_range(0..rows[0].len());
        let (at, value) = (random.random_range(0..count), extreme(random));
        match random.random_range(0..10) {
            0 => rows.iter_mut().for_each(|row| row[column] = value),
            1 => rows.iter_mut().for_each(|row| row[column] *= value),
            2 => rows.iter_mut().for_each(|row| row[column] += value),
            3 => rows.iter_mut().skip(at).for_each(|row| row[column] += value),
            4 => rows[at][column] = value,
            5 => rows.iter_mut().for_each(|row| row[column] = -row[column]),
            6 => rows.iter_mut().for_each(|row| row[column] = (row[column] * 4.0).round() / 4.0),
            7 => rows.iter_mut().enumerate().for_each(|(place, row)| row[column] = place as f64 / count as f64),
            8 => rows.iter_mut().for_each(|row| row[column] = if random.random_bool(0.5) { 0.3 } else { 0.6 }),
            _ => rows.truncate(2 + at),
        }
        if rows.len() < count {
            break;
        }
    }
    let line = |row: &Vec<f64>| row.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n";
    format!("{header}\n{}", rows.iter().map(line).collect::<String>())
}

#[test]
fn whatever_a_field_holds_the_program_ends_well() {
    let number = |name: &str| std::env::var(name).ok().and_then(|value| value.parse::<u64>().ok());
    let (seconds, first) =
        (number("ROTORLEAD_MUTATE_S").unwrap_or(SECONDS), number("ROTORLEAD_MUTATE_SEED").unwrap_or(1));
    let good = Stand::new();
    good.run("design --model model.toml --out c.toml");
    let until = Instant::now() + Duration::from_secs(seconds);
    let mut tried = 0;
    for seed in first.. {
        if Instant::now() > until {
            break;
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let stand = Stand::new();
        stand.write("c.toml", good.read("c.toml"));
        let (command, files) = COMMANDS[random.random_range(0..COMMANDS.len())];
        let file = files[random.random_range(0..files.len())];
        let text = good.read(file);
        let mutated =
            if file.ends_with(".csv") { mutated_rows(&mut random, &text) } else { mutated_toml(&mut random, &text) };
        stand.write(file, &mutated);
        let words: Vec<String> = command.split_whitespace().map(str::to_owned).collect();
        if let Some(broken) = broken_promise(&stand.path(""), &words) {
            let shown: String = mutated.chars().take(2000).collect();
            panic!("seed {seed}: `{command}` with this {file}\n{shown}\n{broken}");
        }
        tried += 1;
    }
    assert!(tried > 10, "{tried} in {seconds} s");
}
