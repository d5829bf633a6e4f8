//! The Python package: its wheel, the types that it states, and its tests.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::python_environment::{DIST, OLDEST, TESTS};
use crate::run::{Result, cargo, output, root, run, target_folder, without_folders};
use crate::setup;

/// What the wheel has of the licenses of what is linked, where it is for others: it stands there while such a wheel is built.
const THIRD_PARTY: &str = "python/package/rotorlead/THIRD-PARTY.txt";

/// Builds the wheel that is given to others, and says where it is.
pub fn build() -> Result {
    setup::python()?;
    let wheel = wheel(&target_folder().join("wheels"), maturin(&["--release"]))?;
    println!("{}", wheel.display());
    Ok(())
}

/// Puts the wheel, which on Linux runs with glibc 2.17 and later, and the sources that pip builds one of, into a folder. The wheel has
/// `third_party` in it, and the list of what is linked.
pub fn release(third_party: &[u8], sbom: &Path, into: &Path) -> Result {
    let text = root().join(THIRD_PARTY);
    let failed = |error: std::io::Error| format!("{THIRD_PARTY}: {error}");
    std::fs::write(&text, third_party).map_err(failed)?;
    let wheel = release_wheel(sbom, into);
    std::fs::remove_file(&text).map_err(failed)?;
    wheel?;
    run(DIST.tool("maturin", &["sdist", "--manifest-path", "python/Cargo.toml", "--out"]).arg(into))
}

fn release_wheel(sbom: &Path, into: &Path) -> Result {
    let mut wheel = DIST.tool("maturin", &["build", "--release", "--locked", "--manifest-path", "python/Cargo.toml"]);
    if cfg!(target_os = "linux") {
        wheel.args(["--zig", "--compatibility", "manylinux2014"]);
    }
    wheel.arg("--sbom-include").arg(sbom).arg("--out").arg(into);
    run(without_folders(DIST.on_path(&mut wheel)))
}

/// Builds a wheel of the tests' profile, installs it, and holds it to its types and to the command line.
pub fn test() -> Result {
    setup::python()?;
    let mut build = maturin(&["--profile", "dev"]);
    build.env("CARGO", root().join("python/tests/cargo.sh"));
    let wheel = wheel(&TESTS.folder().join("wheels"), build)?;
    run(TESTS.tool("pip", &["install", "--quiet", "--no-index", "--no-deps", "--force-reinstall"]).arg(wheel))?;
    let oldest = format!("{}.{}", OLDEST.0, OLDEST.1);
    run(&mut TESTS.tool("mypy", &["--strict", "--python-version", &oldest, "--package", "rotorlead"]))?;
    run(&mut TESTS.tool("mypy", &["--strict", "python/example.py"]))?;
    run(&mut TESTS.tool("stubtest", &["rotorlead._native"]))?;
    draws_nothing()?;
    let mut tests = TESTS.tool("python", &["-m", "unittest", "discover", "--start-directory", "python/tests"]);
    let program = target_folder().join("debug/rotorlead");
    run(tests.env("ROTORLEAD", &program))?;
    // RotorPy and crazyflow are held to theirs by hand: they bring more than the rest together.
    let code = "import sys; sys.exit(sys.version_info < (3, 11))";
    if output(&mut TESTS.tool("python", &["-c", code])).is_none() {
        eprintln!("exports are not held to MuJoCo: it has no package for a Python before 3.11");
        return Ok(());
    }
    let mut loaders = TESTS.tool("python", &["host-tests/simulators/check.py"]);
    run(loaders.arg(program).args(["mujoco", "control", "matlab"]))
}

/// Refuses a wheel with a plotter or a font: figures go to Python as numbers.
fn draws_nothing() -> Result {
    let linked = output(&mut cargo(&[
        "tree",
        "--locked",
        "--package",
        "rotorlead-python",
        "--edges",
        "normal",
        "--prefix",
        "none",
    ]));
    let linked = linked.ok_or("cargo tree says nothing")?;
    match linked.lines().find(|line| ["plotters ", "notosans "].iter().any(|name| line.starts_with(name))) {
        Some(package) => Err(format!("the Python package links {package}")),
        None => Ok(()),
    }
}

/// A call of maturin for the package.
fn maturin(arguments: &[&str]) -> Command {
    let mut maturin = TESTS.tool("maturin", &["build", "--locked", "--manifest-path", "python/Cargo.toml"]);
    maturin.args(arguments);
    maturin
}

/// The wheel that a call of maturin leaves, alone in a folder.
fn wheel(folder: &Path, mut maturin: Command) -> Result<PathBuf> {
    let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
    if folder.exists() {
        std::fs::remove_dir_all(folder).map_err(failed)?;
    }
    run(maturin.arg("--out").arg(folder))?;
    let mut files = std::fs::read_dir(folder).map_err(failed)?;
    Ok(files.next().ok_or("maturin leaves no wheel")?.map_err(failed)?.path())
}
