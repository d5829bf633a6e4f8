//! The page's tests: in a browser, and number by number beside the program.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::packages;
use super::{page, program};
use crate::answers::{Comparison, Renamed, Tolerance};
use crate::board;
use crate::firmware;
use crate::run::{Result, cargo, command, root, run, target_folder};

/// Builds the page and a program with it, and drives it in a browser. With folders of experiments, or `--numbers` alone, what the
/// page's module says of these and of the logs of the tests is held to what the program says instead, number by number; with `--serial`
/// its serial port is driven.
pub fn test(options: &[&str]) -> Result {
    let (flags, folders): (Vec<&str>, Vec<&str>) = options.iter().partition(|option| option.starts_with("--"));
    if let Some(unknown) = flags.iter().find(|flag| !["--numbers", "--serial"].contains(flag)) {
        return Err(format!("web: there is no option {unknown}; there are --numbers and --serial"));
    }
    if !packages::has_packages() {
        return Err("the packages that drive a browser are missing: `cargo xtask setup` installs them".to_owned());
    }
    let data = std::env::var_os("ROTORLEAD_DATA").map_or_else(|| root().join("../shared/data"), PathBuf::from);
    let page = page()?;
    let modules = packages::folder().join("node_modules");
    if flags.contains(&"--serial") {
        return serial(&page, &modules);
    }
    if !flags.is_empty() {
        let program = program(&page, &["--release"])?;
        return numbers(&page, &modules, &program, &data, &folders);
    }
    let program = program(&page, &[])?;
    run(command("node", &["sim/web/tests/run.mjs"]).arg(&page).arg(modules).arg(program).arg(data))
}

/// Drives the page's serial port, at whose other end is a Pico in its emulator.
fn serial(page: &Path, modules: &Path) -> Result {
    run(&mut cargo(&["build", "--locked", "--package", "host-tests", "--example", "pico"]))?;
    run(&mut cargo(&["build", "--locked", "--package", "rotorlead-cli", "--bin", "rotorlead"]))?;
    let built = target_folder().join("debug");
    let mut node = command("node", &["sim/web/tests/serial.mjs"]);
    node.args([page, modules, &built.join("rotorlead"), &built.join("examples/pico")]);
    run(firmware::with_image(&mut node, board::named("rp2040")?)?)
}

/// Compares numbers: to 1e-9, or where a search ends elsewhere to 0.05 of a standard deviation, each of which is listed.
fn numbers(page: &Path, modules: &Path, program: &Path, data: &Path, folders: &[&str]) -> Result {
    let out = target_folder().join("web-numbers");
    if out.exists() {
        fs::remove_dir_all(&out).map_err(|error| format!("{}: {error}", out.display()))?;
    }
    let mut node = command("node", &["sim/web/tests/numbers.mjs"]);
    run(node.args([page, modules, program, data, &out]).args(folders))?;
    let (native, web) = (read(&out.join("native"))?, read(&out.join("web"))?);
    let renamed = Renamed::default();
    let exact = Comparison::compare(&native, &web, &renamed, Tolerance::EQUAL);
    println!("{} values, largest relative difference {:.1e}", exact.values, exact.largest);
    exact.differences.iter().for_each(|difference| println!("  beyond 1e-9: {difference}"));
    let apart = Comparison::compare(&native, &web, &renamed, Tolerance::ELSEWHERE).differences;
    if apart.is_empty() { Ok(()) } else { Err(format!("the page and the program differ:\n{}", apart.join("\n"))) }
}

/// The answers in a folder, by the names of their files.
fn read(folder: &Path) -> Result<BTreeMap<String, Value>> {
    let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
    let mut answers = BTreeMap::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let text = fs::read_to_string(entry.path()).map_err(failed)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        answers.insert(name.clone(), serde_json::from_str(&text).map_err(|error| format!("{name}: {error}"))?);
    }
    Ok(answers)
}
