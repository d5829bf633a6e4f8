//! The environment in which the Python package is built and tested.

use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;

use crate::run::{Result, command, output, root, run_within, target_folder};

/// The oldest Python that loads the module: PyO3's feature `abi3-py39`.
pub const OLDEST: (u32, u32) = (3, 9);
/// Debian's packages of it.
pub const DEBIAN_PACKAGES: [&str; 2] = ["python3", "python3-venv"];
/// What is installed into the environment of the tests.
pub const REQUIREMENTS: &str = "python/tests/requirements.txt";
/// Longest that their download may take.
const DOWNLOAD_LIMIT: Duration = Duration::from_secs(300);

/// Whether there is a Python that can make an environment.
pub fn is_there() -> bool {
    let (major, minor) = OLDEST;
    let code = format!("import ensurepip, sys, venv; sys.exit(sys.version_info < ({major}, {minor}))");
    output(&mut command(&interpreter(), &["-c", &code])).is_some()
}

/// Whether the environment has what the requirements ask for today.
pub fn has_packages() -> bool {
    let read = |path: PathBuf| std::fs::read(path).ok();
    let wanted = read(root().join(REQUIREMENTS));
    wanted.is_some() && read(installed()) == wanted && output(&mut tool("python", &["--version"])).is_some()
}

/// Makes the environment in cargo's target folder, from the index that pip is set to.
pub fn install_packages() -> Result {
    run_within(command(&interpreter(), &["-m", "venv", "--clear"]).arg(folder()), DOWNLOAD_LIMIT)?;
    run_within(&mut tool("pip", &["install", "--quiet", "--requirement", REQUIREMENTS]), DOWNLOAD_LIMIT)?;
    // Last: an environment that lacks something is made anew.
    std::fs::copy(root().join(REQUIREMENTS), installed())
        .map(drop)
        .map_err(|error| format!("{}: {error}", installed().display()))
}

/// A program of the environment. What it keeps for the next time stays in there.
pub fn tool(name: &str, arguments: &[&str]) -> Command {
    let mut tool = command(&folder().join("bin").join(name).to_string_lossy(), arguments);
    tool.env("PYTHONDONTWRITEBYTECODE", "1")
        .env("PIP_DISABLE_PIP_VERSION_CHECK", "1")
        .env("MPLCONFIGDIR", folder().join("matplotlib"))
        .env("MYPY_CACHE_DIR", folder().join("mypy"));
    tool
}

/// The environment.
pub fn folder() -> PathBuf {
    target_folder().join("python")
}

/// What was asked for when it was made.
fn installed() -> PathBuf {
    folder().join("requirements.txt")
}

/// The Python that makes it.
fn interpreter() -> String {
    std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned())
}
