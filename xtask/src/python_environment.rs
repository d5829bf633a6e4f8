//! Environments of Python packages in cargo's target folder: that in which the Python package is built and tested, and that of a release.

use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;

use crate::run::{Result, command, output, path_with, root, run_within, target_folder};

/// The oldest Python that loads the module: PyO3's feature `abi3-py39`.
pub const OLDEST: (u32, u32) = (3, 9);
/// Debian's packages of it.
pub const DEBIAN_PACKAGES: [&str; 2] = ["python3", "python3-venv"];
/// Longest that a download may take. A server that cannot be reached must not hang the tests.
pub const DOWNLOAD_LIMIT: Duration = Duration::from_secs(300);

/// Where the tests run, and what they take.
pub const TESTS: Environment = Environment { folder: "python", requirements: "python/tests/requirements.txt" };
/// What makes a release.
pub const DIST: Environment = Environment { folder: "dist-tools", requirements: "xtask/dist-requirements.txt" };

/// Whether there is a Python that can make an environment.
pub fn is_there() -> bool {
    let (major, minor) = OLDEST;
    let code = format!("import ensurepip, sys, venv; sys.exit(sys.version_info < ({major}, {minor}))");
    output(&mut command(&interpreter(), &["-c", &code])).is_some()
}

/// The Python that makes environments.
fn interpreter() -> String {
    std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned())
}

/// Python packages of fixed versions.
pub struct Environment {
    /// In cargo's target folder.
    folder: &'static str,
    /// The file that lists them.
    pub requirements: &'static str,
}

impl Environment {
    /// Whether it has what the requirements ask for today.
    pub fn has_packages(&self) -> bool {
        let read = |path: PathBuf| std::fs::read(path).ok();
        let wanted = read(root().join(self.requirements));
        wanted.is_some()
            && read(self.installed()) == wanted
            && output(&mut self.tool("python", &["--version"])).is_some()
    }

    /// Makes it, from the index that pip is set to.
    pub fn install_packages(&self) -> Result {
        run_within(command(&interpreter(), &["-m", "venv", "--clear"]).arg(self.folder()), DOWNLOAD_LIMIT)?;
        run_within(&mut self.tool("pip", &["install", "--quiet", "--requirement", self.requirements]), DOWNLOAD_LIMIT)?;
        // Last: an environment that lacks something is made anew.
        std::fs::copy(root().join(self.requirements), self.installed())
            .map(drop)
            .map_err(|error| format!("{}: {error}", self.installed().display()))
    }

    /// A program of it. What that keeps for the next time stays in there.
    pub fn tool(&self, name: &str, arguments: &[&str]) -> Command {
        let mut tool = command(&self.programs().join(name).to_string_lossy(), arguments);
        tool.env("PYTHONDONTWRITEBYTECODE", "1")
            .env("PIP_DISABLE_PIP_VERSION_CHECK", "1")
            .env("MPLCONFIGDIR", self.folder().join("matplotlib"))
            .env("MYPY_CACHE_DIR", self.folder().join("mypy"));
        tool
    }

    /// Lets a program of it find the others.
    pub fn on_path<'a>(&self, tool: &'a mut Command) -> &'a mut Command {
        tool.env("PATH", path_with(&self.programs()))
    }

    /// Where its programs are.
    fn programs(&self) -> PathBuf {
        self.folder().join(if cfg!(windows) { "Scripts" } else { "bin" })
    }

    /// Where it is.
    pub fn folder(&self) -> PathBuf {
        target_folder().join(self.folder)
    }

    /// What was asked for when it was made.
    fn installed(&self) -> PathBuf {
        self.folder().join("requirements.txt")
    }
}
