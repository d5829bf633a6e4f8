//! The frozen answers of the tool: what it said of a list of cases, and whether it still says so.
//!
//! A case is a script `host-tests/answers/CASE.sh`. It is run in an empty folder with `rotorlead` and `blind` on its path, and
//! every `*.json` that it leaves there is one answer. The answers lie beside it, compressed, as one object from file to answer.
//! A change that must not alter what the tool finds is compared with them; one that alters it on purpose freezes them anew.

mod compare;

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::time::Instant;

use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use serde_json::Value;

use crate::run::{Result, cargo, command, release_folder, root, run, target_folder};
pub use compare::{Comparison, Renamed, Tolerance};

/// Where scripts, answers and the table of renamed keys lie.
const FOLDER: &str = "host-tests/answers";
/// Differences that are printed of one case; the rest are counted.
const SHOWN: usize = 20;

/// Answers by the name of their file.
type Answers = BTreeMap<String, Value>;

/// Runs the cases and compares their answers with the frozen ones.
///
/// Options: `--freeze` replaces the frozen answers instead, `--estimates` allows for another solver, and each name selects a case.
pub fn run_cases(options: &[&str]) -> Result {
    let (flags, names): (Vec<&str>, Vec<&str>) = options.iter().partition(|option| option.starts_with("--"));
    if let Some(unknown) = flags.iter().find(|flag| !["--freeze", "--estimates"].contains(flag)) {
        return Err(format!("answers: there is no option {unknown}; there are --freeze and --estimates"));
    }
    let all = cases()?;
    if let Some(unknown) = names.iter().find(|name| !all.iter().any(|case| case == *name)) {
        return Err(format!("answers: there is no case {unknown} in {FOLDER}; there are {}", all.join(", ")));
    }
    run(&mut cargo(&["build", "--release", "--locked", "--bin", "rotorlead", "--bin", "blind"]))?;
    let renamed = Renamed::read(&path("renamed.txt"))?;
    let tolerance = if flags.contains(&"--estimates") { Tolerance::ESTIMATES } else { Tolerance::EQUAL };
    let mut different = Vec::new();
    for case in all.iter().filter(|case| names.is_empty() || names.contains(&case.as_str())) {
        let start = Instant::now();
        let found = run_case(case)?;
        let seconds = start.elapsed().as_secs_f64();
        let file = path(&format!("{case}.json.gz"));
        if flags.contains(&"--freeze") {
            write(&file, &found)?;
            println!("{case}: {} answers frozen, {seconds:.0} s", found.len());
            continue;
        }
        let comparison = Comparison::compare(&read(&file)?, &found, &renamed, tolerance);
        println!(
            "{case}: {} answers, {} values, {} differ, largest relative difference {:.1e}, {seconds:.0} s",
            found.len(),
            comparison.values,
            comparison.differences.len(),
            comparison.largest
        );
        comparison.differences.iter().take(SHOWN).for_each(|difference| println!("  {difference}"));
        if !comparison.differences.is_empty() {
            different.push(case.as_str());
        }
    }
    match different.as_slice() {
        [] => Ok(()),
        cases => Err(format!(
            "the answers of {} differ from the frozen ones; where that is meant, freeze them: cargo xtask answers --freeze {}",
            cases.join(", "),
            cases.join(" ")
        )),
    }
}

fn path(name: &str) -> PathBuf {
    root().join(FOLDER).join(name)
}

/// Names of the scripts, sorted.
fn cases() -> Result<Vec<String>> {
    let folder = root().join(FOLDER);
    let entries = fs::read_dir(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let names = entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned());
    let mut cases: Vec<String> = names.filter_map(|name| name.strip_suffix(".sh").map(str::to_owned)).collect();
    cases.sort();
    Ok(cases)
}

/// Runs a case's script in a folder of its own, which stays there to be looked at.
fn run_case(case: &str) -> Result<Answers> {
    let folder = target_folder().join("answers").join(case);
    let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
    if folder.exists() {
        fs::remove_dir_all(&folder).map_err(failed)?;
    }
    fs::create_dir_all(&folder).map_err(failed)?;
    let programs = std::env::join_paths(
        std::iter::once(release_folder()).chain(std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default())),
    )
    .map_err(|error| format!("PATH: {error}"))?;
    let logs = std::env::var_os("ROTORLEAD_DATA").map_or_else(|| root().join("../shared/data"), PathBuf::from);
    let log = File::create(folder.join("printed.txt")).map_err(failed)?;
    let script = path(&format!("{case}.sh"));
    let mut shell = command("sh", &["-eu"]);
    shell
        .arg(&script)
        .current_dir(&folder)
        .env("PATH", programs)
        .env("SOURCES", root())
        .env("LOGS", logs)
        .stdout(log.try_clone().map_err(failed)?)
        .stderr(log);
    run(&mut shell).map_err(|error| format!("{error}: see {}", folder.join("printed.txt").display()))?;
    let mut answers = Answers::new();
    for entry in fs::read_dir(&folder).map_err(failed)?.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.ends_with(".json") {
            let text = fs::read_to_string(entry.path()).map_err(failed)?;
            let answer = serde_json::from_str(&text).map_err(|error| format!("{case}/{name}: {error}"))?;
            answers.insert(name, answer);
        }
    }
    if answers.is_empty() { Err(format!("{} leaves no answer", script.display())) } else { Ok(answers) }
}

fn read(file: &Path) -> Result<Answers> {
    let opened = File::open(file).map_err(|error| format!("{}: {error}", file.display()))?;
    serde_json::from_reader(GzDecoder::new(BufReader::new(opened)))
        .map_err(|error| format!("{}: {error}", file.display()))
}

fn write(file: &Path, answers: &Answers) -> Result {
    let failed = |error: std::io::Error| format!("{}: {error}", file.display());
    let mut encoder = GzEncoder::new(File::create(file).map_err(failed)?, Compression::best());
    serde_json::to_writer(&mut encoder, answers).map_err(|error| format!("{}: {error}", file.display()))?;
    encoder.finish().map(drop).map_err(failed)
}
