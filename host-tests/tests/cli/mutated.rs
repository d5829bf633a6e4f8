//! A mutator that knows the fields of files and of the command line: whatever one holds, and whatever happens meanwhile, the promise of
//! [`super::promise`] is kept.
//!
//! It runs for some seconds with a seed of its own. With `ROTORLEAD_MUTATE_S=36000` in the environment it goes on for as many seconds
//! and counts what it finds, by command and kind of file, `ROTORLEAD_MUTATE_SEED` begins elsewhere, and `ROTORLEAD_PROGRAM` is
//! another program than the one of this source. A seed that is given alone, `ROTORLEAD_MUTATE_S=0`, is tried once.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rotorlead_records::files::AcceptedRange;

use crate::promise::{Broken, Kind, Trouble, hold};
use crate::stand::{MODEL, PLAN, Stand, everything};

/// How long the tests run it.
const SECONDS: u64 = 30;
/// Failures of one kind, command and file that are shown whole.
const SHOWN: usize = 2;

/// The folder into which all of them write.
const MADE: &str = "made";
/// Commands over all files. What stands for `@` is a number that is drawn.
const COMMANDS: [&str; 43] = [
    "check stand --json made/j.json",
    "check steady",
    "check sim",
    "identify stand --out made/m.toml --json made/j.json",
    "identify stand --static-map --out made/m.toml --report made/r.html",
    "identify steady --out made/m.toml",
    "identify sim --out made/m.toml --figures made/f --json made/j.json",
    "identify sim --delay none --out made/m.toml",
    "validate stand --model model.toml --json made/j.json",
    "validate sim --model model.toml --report made/r.html",
    "validate sim --model effects.toml",
    "diagnose stand --json made/j.json",
    "diagnose sim --redesign --out-model made/m.toml --out-plan made/p.toml --out-compensator made/c.toml",
    "report stand --no-diagnosis --out made/r.html",
    "report steady --out made/r.html --json made/j.json",
    "report sim --out made/r.html",
    "bandwidth --model model.toml --records sim --json made/j.json",
    "bandwidth --model model.toml --steps @ --json made/j.json",
    "bandwidth --model model.toml --sampled --esc-frame @",
    "bandwidth --model model.toml --lead @,@,@ --figures made/f",
    "bandwidth --model model.toml --compensator c.toml --steps 0.05 --report made/r.html",
    "design --model model.toml --kind inverse --natural @ --out made/c.toml --json made/j.json",
    "design --model effects.toml --kind inverse --out made/c.toml --report made/r.html",
    "design --model model.toml --omega-g @ --damping @ --out made/c.toml",
    "design --model model.toml --loop-rate @ --slew @ --out made/c.toml",
    "simulate --model model.toml --plan plan.toml --out made/sim --json made/j.json",
    "simulate --model effects.toml --plan compensated.toml --out made/sim",
    "export --for px4 --model model.toml --json made/j.json",
    "export --for betaflight --model model.toml --at @",
    "fleet fleet --json made/j.json --report made/r.html",
    "excite --band 0.1..@ --rate @ --period @ --starts 1 --out made/e.csv",
    "import stand/step.csv --out made/imported --json made/j.json",
    "import rcbenchmark.csv --out made/imported",
    "import esc32.csv --out made/imported --excitation free",
    "import vectors.mat --out made/imported --excitation steady",
    "import blackbox.bbl --out made/imported --excitation free",
    "import rcbenchmark.csv esc32.csv --fleet --out made/fleet --json made/j.json",
    "identify rcbenchmark.csv --json made/j.json",
    "identify esc32.csv --excitation staircase --response rpm --seconds 0..@ --out made/m.toml",
    "identify stand/step.csv --excitation step --nominal @ --report made/r.html",
    "identify vectors.mat --excitation steady --out made/m.toml",
    "identify blackbox.bbl --pulse-us 1000..@ --motor 1",
    "report stand/step.csv --excitation step --no-diagnosis --out made/r.html",
];

/// Those that simulate for seconds, which are drawn once in [`SELDOM`].
const SLOW: [&str; 3] = [
    "vehicle --airframe airframe.toml --model model.toml --json made/j.json --report made/r.html",
    "bandwidth --model effects.toml --kind inverse --robustness --json made/j.json",
    "bandwidth --model model.toml --compensator inverse.toml --sampled --robustness",
];
const SELDOM: f64 = 100.0;

/// Numbers that someone writes by a slip, and the ends of what a float holds.
const EXTREMES: [&str; 22] = [
    "0",
    "-1",
    "1e-3",
    "1000",
    "50",
    "0.02",
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
    "-inf",
    "0.5",
    "1",
    "100",
    "-0.0",
    "1e-9",
];
/// Factors of what is plausible.
const MILD: [f64; 6] = [0.1, 0.5, 0.9, 1.1, 2.0, 10.0];
/// What ends the program.
const SIGNALS: [&str; 4] = ["-HUP", "-INT", "-QUIT", "-TERM"];
/// What stands where a text is meant.
const TEXTS: [&str; 12] = [
    "multisine",
    "square",
    "step",
    "staircase",
    "steady",
    "chirp",
    "free",
    "",
    "thrust_n",
    "rpm",
    "../stand/step.csv",
    "a\u{1b}[31m\nerror: b",
];

fn one<'a, T>(random: &mut ChaCha8Rng, of: &'a [T]) -> &'a T {
    &of[random.random_range(0..of.len())]
}

/// Where numbers are in a text that are not part of a word, as ranges of bytes.
fn numbers(text: &str) -> Vec<(usize, usize)> {
    let is_part = |c: char| c.is_alphanumeric() || matches!(c, '.' | '_' | '-' | '+');
    let mut found = Vec::new();
    let mut begin = None;
    for (at, c) in text.char_indices().chain([(text.len(), '\n')]) {
        match (begin, is_part(c)) {
            (None, true) => begin = Some(at),
            (Some(from), false) => {
                found.extend(text[from..at].parse::<f64>().is_ok().then_some((from, at)));
                begin = None;
            }
            _ => {}
        }
    }
    found
}

/// A TOML file with a number, a text, a line or a table of another kind.
fn mutated_toml(random: &mut ChaCha8Rng, text: &str) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let at = random.random_range(0..lines.len());
    match random.random_range(0..12) {
        0 => drop(lines.remove(at)),
        1 => lines.push(lines[at].clone()),
        2 => {
            let with = random.random_range(0..lines.len());
            lines.swap(at, with);
        }
        3 => {
            let keys: Vec<&str> = AcceptedRange::ALL.iter().flat_map(|quantity| quantity.keys).copied().collect();
            let key = *one(random, &keys);
            lines.insert(at, format!("{key} = {}", one(random, &EXTREMES)));
        }
        4 => {
            if let Some(table) = lines.iter().rposition(|line| line.starts_with("[[")) {
                lines.extend_from_within(table..);
            }
        }
        5 | 6 => {
            let of_texts: Vec<usize> = (0..lines.len()).filter(|&line| lines[line].contains(" = \"")).collect();
            if !of_texts.is_empty() {
                let place = *one(random, &of_texts);
                let key = lines[place].split_once(" = ").unwrap().0.to_owned();
                lines[place] = format!("{key} = {:?}", one(random, &TEXTS));
            }
        }
        _ => {
            let places = numbers(text);
            let (from, to) = *one(random, &places);
            let number: f64 = text[from..to].parse().unwrap();
            let other = match random.random_bool(0.5) {
                true => (number * one(random, &MILD)).to_string(),
                false => (*one(random, &EXTREMES)).to_owned(),
            };
            return format!("{}{other}{}", &text[..from], &text[to..]);
        }
    }
    lines.join("\n") + "\n"
}

/// A table with columns, rows or cells of another shape.
fn mutated_table(random: &mut ChaCha8Rng, text: &str) -> String {
    let mut rows: Vec<Vec<String>> = text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect();
    for _ in 0..random.random_range(1..4) {
        let count = rows.len();
        let column = random.random_range(0..rows[0].len());
        let at = random.random_range(0..count);
        let extreme = *one(random, &EXTREMES);
        let value: f64 = extreme.parse().unwrap();
        let mut each = |of: &mut dyn FnMut(usize, f64) -> f64| {
            for (row, cells) in rows.iter_mut().enumerate().skip(1) {
                let number = cells.get(column).and_then(|cell| cell.parse::<f64>().ok());
                if let Some(number) = number {
                    cells[column] = of(row, number).to_string();
                }
            }
        };
        match random.random_range(0..20) {
            0 => each(&mut |_, _| value),
            1 => each(&mut |_, number| number * MILD[at % MILD.len()]),
            2 => each(&mut |_, number| number + value),
            3 => each(&mut |row, number| if row < at { number } else { number + value }),
            4 => each(&mut |_, number| -number),
            5 => each(&mut |_, number| (number * 4.0).round() / 4.0),
            6 => each(&mut |row, _| row as f64 / count as f64),
            7 => each(&mut |_, _| if random.random_bool(0.5) { 0.3 } else { 0.6 }),
            8 => each(&mut |_, number| number + random.random_range(-0.01..0.01)),
            9 => each(&mut |_, number| number * [1e-6, 1e-3, 1e3, 1e6, value][at % 5]),
            10 => rows.truncate(1 + at),
            11 => rows.swap(at, (at + count / 2) % count),
            12 => drop(rows.remove(at)),
            13 => rows.insert(at, rows[at].clone()),
            14 => rows[1..].reverse(),
            15 => rows.iter_mut().for_each(|row| row.truncate(column)),
            16 => rows.iter_mut().for_each(|row| row.extend(row.get(column).cloned())),
            17 => rows[0][column] = (*one(random, &TEXTS)).to_owned(),
            _ => {
                let cell = rows[at].get_mut(column);
                cell.into_iter().for_each(|cell| extreme.clone_into(cell));
            }
        }
        if rows.len() < 2 || rows[0].is_empty() {
            break;
        }
    }
    rows.iter().map(|row| row.join(",") + "\n").collect()
}

/// A binary log with numbers, bytes or blocks of another kind.
fn mutated_bytes(random: &mut ChaCha8Rng, bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..random.random_range(1..6) {
        let at = random.random_range(0..bytes.len());
        let value: f64 = one(random, &EXTREMES).parse().unwrap();
        let number = value.to_le_bytes();
        match random.random_range(0..6) {
            0 => bytes[at] = random.random(),
            1 => bytes.truncate(at.max(1)),
            2 => bytes.iter_mut().skip(at).zip(number).for_each(|(byte, new)| *byte = new),
            3 => bytes.iter_mut().skip(at).zip((value as f32).to_le_bytes()).for_each(|(byte, new)| *byte = new),
            4 => bytes.iter_mut().skip(at / 8 * 8).take(4).for_each(|byte| *byte = random.random_range(0..20)),
            _ => bytes.extend_from_within(at..(at + 64).min(bytes.len())),
        }
    }
    bytes
}

/// A stand with every kind of file.
fn good() -> Stand {
    let stand = Stand::new();
    let plan = "format = 1\nname = \"short\"\nseed = 1\nsample_rate_hz = 200\nloop_rate_hz = 200\nesc_frame_hz = 200\n\
        [noise]\nsigma_n = 0.02\n\
        [[record]]\nnominal = 0.45\nexcitation = \"multisine\"\namplitude = 0.04\nlines = 150\nperiods = 2\n\
        warm_up_periods = 1\nrole = \"fit\"\n\
        [[record]]\nnominal = 0.45\nexcitation = \"square\"\namplitude = 0.04\nhalf_period_s = 1\nperiods = 2\nrole = \"validate\"\n";
    stand.write("plan.toml", plan);
    stand.write("compensated.toml", format!("compensator = \"inverse.toml\"\n{plan}"));
    let effects = "[[effect]]\nkind = \"slew_limit\"\nparameters = { rate_per_s = 3.0 }\n\
        [[effect]]\nkind = \"stand_resonance\"\nparameters = { participation = 0.3, frequency_hz = 20.0, damping = 0.03 }\n\
        [[effect]]\nkind = \"transport_delay\"\nparameters = { delay_s = 0.003 }\n\
        [[effect]]\nkind = \"esc_frame_hold\"\nparameters = { frame_hz = 200.0, phase = 0.3 }\n\
        [[effect]]\nkind = \"second_pole\"\nparameters = { time_constant_s = 0.003 }\n";
    stand.write("effects.toml", stand.read("model.toml") + effects);
    stand.run("design --model model.toml --out c.toml");
    stand.run("design --model model.toml --kind inverse --out inverse.toml");
    stand.run("simulate --model model.toml --plan plan.toml --out sim");
    fs::create_dir_all(stand.path("steady")).unwrap();
    let experiment = stand.read("stand/experiment.toml");
    stand.write("steady/experiment.toml", experiment.replace("\"step\"\namplitude = 0.1", "\"steady\""));
    let steady = (0..12).map(|row| format!("{row},{},{}\n", f64::from(row) / 12.0, 0.08 * f64::from(row * row)));
    stand.write("steady/step.csv", format!("time_s,command,thrust_n\n{}", steady.collect::<String>()));
    for log in ["a", "b", "c"] {
        fs::create_dir_all(stand.path(&format!("fleet/{log}"))).unwrap();
        stand.write(&format!("fleet/{log}/model.toml"), stand.read("model.toml"));
    }
    stand.write("fleet/fleet.csv", "log,motor,date\na,M1,2026-01-15\nb,M1,2026-02-15\nc,M2,2026-02-15\n");
    for log in ["rcbenchmark.csv", "esc32.csv", "vectors.mat", "blackbox.bbl"] {
        let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../sim/records/tests/data").join(log);
        stand.write(log, fs::read(data).unwrap());
    }
    stand
}

/// What an output of this name may take the place of.
fn replaceable(name: &str) -> &'static str {
    match name.rsplit('/').next() {
        Some("j.json") => "{\"generator\": \"rotorlead 0\"}",
        Some("r.html") => "<!doctype html>\n<meta name=\"generator\" content=\"rotorlead 0\">\n",
        Some("m.toml") => MODEL,
        Some("c.toml") => "zero_rad_s = 1\n",
        Some("p.toml") => PLAN,
        Some("e.csv") => "time_s,command\n",
        _ => unreachable!("no command writes {name}"),
    }
}

/// One thing that is odd: a command, the file or the option that is, and what happens meanwhile.
struct Try {
    stand: Stand,
    words: Vec<String>,
    /// What was changed, for the count.
    of: String,
    trouble: Trouble,
}

impl Try {
    fn draw(seed: u64, good: &[(String, Vec<u8>)]) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let command =
            if random.random_bool(SELDOM.recip()) { *one(&mut random, &SLOW) } else { *one(&mut random, &COMMANDS) };
        let words = command.split_whitespace().map(|word| match word.contains('@') {
            true => word.split('@').collect::<Vec<_>>().join(*one(&mut random, &EXTREMES)),
            false => word.to_owned(),
        });
        let mut words: Vec<String> = words.collect();
        let is_read = |name: &str| words.iter().any(|word| name == word || name.starts_with(&format!("{word}/")));
        let named =
            |name: &str| is_read(name) || words.iter().any(|word| word == "compensated.toml") && name == "inverse.toml";
        let files: Vec<&(String, Vec<u8>)> = good.iter().filter(|(name, _)| named(name)).collect();
        let stand = Stand::empty();
        fs::create_dir(stand.path(MADE)).unwrap();
        for (name, bytes) in &files {
            stand.write_below(name, bytes);
        }
        let mut of = "options".to_owned();
        if !command.contains('@') && !files.is_empty() || random.random_bool(0.3) && !files.is_empty() {
            let (name, bytes) = *one(&mut random, &files);
            let text = || String::from_utf8_lossy(bytes).into_owned();
            let end = name.rsplit_once('.').map_or("", |(_, end)| end);
            let mutated = match end {
                "toml" => mutated_toml(&mut random, &text()).into_bytes(),
                "csv" => mutated_table(&mut random, &text()).into_bytes(),
                _ => mutated_bytes(&mut random, bytes),
            };
            stand.write_below(name, &mutated);
            let stem = name.rsplit('/').next().unwrap_or(name);
            of = if ["sim", "stand"].iter().any(|folder| name.starts_with(folder)) && end == "csv" {
                "record"
            } else {
                stem
            }
            .to_owned();
        }
        // Half of the outputs are there already, and most of these are such as the command may replace.
        for word in words.iter().filter(|word| word.starts_with(MADE) && word.contains('.')) {
            if random.random_bool(0.5) {
                stand.write(word, if seed.is_multiple_of(5) { "old" } else { replaceable(word) });
            }
        }
        let after = Duration::from_millis(random.random_range(1..120));
        let trouble = match random.random_range(0..20) {
            0 => Trouble::LittleRoom(1 << random.random_range(1..9)),
            1 => Trouble::Signal(SIGNALS[random.random_range(0..SIGNALS.len())], after),
            2 => Trouble::Twice,
            3 => {
                // An output in the place of what is read.
                let outputs: Vec<usize> = (0..words.len()).filter(|&at| words[at].starts_with(MADE)).collect();
                if !outputs.is_empty() && !files.is_empty() {
                    words[*one(&mut random, &outputs)] = one(&mut random, &files).0.clone();
                    of = "output is input".to_owned();
                }
                Trouble::None
            }
            _ => Trouble::None,
        };
        let of = match trouble {
            Trouble::None => of,
            Trouble::LittleRoom(_) => "little room".to_owned(),
            Trouble::Signal(..) => "signal".to_owned(),
            Trouble::Twice => "twice at once".to_owned(),
        };
        Self { stand, words, of, trouble }
    }

    fn hold(&self) -> Result<(), Broken> {
        hold(&self.stand.path(""), &self.words, self.trouble)
    }

    /// The command and the odd file, to be tried by hand.
    fn shown(&self, seed: u64) -> String {
        format!("seed {seed}: rotorlead {} ({}, {:?})", self.words.join(" "), self.of, self.trouble)
    }
}

/// Tries of one command with one odd thing, how long they took, and how often each kind of promise was broken.
#[derive(Default)]
struct Count {
    tries: usize,
    took: Duration,
    broken: BTreeMap<Kind, usize>,
}

/// By command and what is odd.
type Counts = BTreeMap<(String, String), Count>;

fn table(counts: &Counts) -> String {
    let mut text = String::from("command, what is odd, tries, seconds, broken promises\n");
    for ((command, of), Count { tries, took, broken }) in counts {
        let kinds: Vec<String> = broken.iter().map(|(kind, count)| format!("{kind:?} {count}")).collect();
        text += &format!("{command}, {of}, {tries}, {:.1}, {}\n", took.as_secs_f64(), kinds.join(" "));
    }
    let tries: usize = counts.values().map(|count| count.tries).sum();
    let broken: usize = counts.values().flat_map(|count| count.broken.values()).sum();
    text + &format!("all, all, {tries}, , {broken}\n")
}

#[test]
fn whatever_a_field_holds_the_program_ends_well() {
    let number = |name: &str| std::env::var(name).ok().and_then(|value| value.parse::<u64>().ok());
    let first = number("ROTORLEAD_MUTATE_SEED").unwrap_or(1);
    let until = Instant::now() + Duration::from_secs(number("ROTORLEAD_MUTATE_S").unwrap_or(SECONDS));
    let stand = good();
    let root = stand.path("");
    let relative = |path: &Path| path.strip_prefix(&root).unwrap().to_string_lossy().into_owned();
    let files = everything(&root).into_iter().filter_map(|(path, content)| Some((relative(&path), content?)));
    let files: Vec<(String, Vec<u8>)> = files.collect();
    let (mut counts, mut broken) = (Counts::new(), String::new());
    for seed in first.. {
        let drawn = Try::draw(seed, &files);
        let start = Instant::now();
        let held = drawn.hold();
        let count = counts.entry((drawn.words[0].clone(), drawn.of.clone())).or_default();
        count.tries += 1;
        count.took += start.elapsed();
        if let Err(found) = held {
            let times = count.broken.entry(found.kind).or_default();
            *times += 1;
            if *times <= SHOWN {
                broken += &format!("{}\n{found}\n\n", drawn.shown(seed));
            }
        }
        if Instant::now() > until {
            break;
        }
    }
    assert!(broken.is_empty(), "{broken}{}", table(&counts));
    println!("{}", table(&counts));
}
