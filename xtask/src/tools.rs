//! Cargo's own tools that no index of Python packages has ready-built: compiled once, into cargo's target folder.

use std::path::PathBuf;
use std::process::Command;

use crate::run::{Result, cargo, command, output, run, target_folder};

/// A package of crates.io with a program of its name.
pub struct Tool {
    package: &'static str,
    version: &'static str,
    /// How it is compiled, beside its version.
    options: &'static [&'static str],
}

/// For a tool that works for a second: to optimize it takes minutes.
const UNOPTIMIZED: &[&str] = &["--debug"];

/// Finds what a caller of the library would have to change.
pub const SEMVER_CHECKS: Tool = Tool { package: "cargo-semver-checks", version: "0.51.0", options: UNOPTIMIZED };
/// Collects the licenses of what is linked. It compares texts, for which it is optimized.
pub const ABOUT: Tool = Tool { package: "cargo-about", version: "0.9.3", options: &["--features=cli"] };
/// Lists what is linked, as CycloneDX.
pub const CYCLONEDX: Tool = Tool { package: "cargo-cyclonedx", version: "0.5.9", options: UNOPTIMIZED };

impl Tool {
    /// What a list of missing things calls it.
    pub fn name(&self) -> String {
        format!("{} {}", self.package, self.version)
    }

    /// Whether it is there, of this version.
    pub fn is_there(&self) -> bool {
        let list = output(cargo(&["install", "--list", "--root"]).arg(folder()));
        list.is_some_and(|list| list.lines().any(|line| line == format!("{} v{}:", self.package, self.version)))
    }

    /// Compiles it.
    pub fn install(&self) -> Result {
        let mut install = cargo(&["install", "--locked", "--version", self.version, self.package]);
        run(install.args(self.options).arg("--root").arg(folder()).env("CARGO_PROFILE_DEV_DEBUG", "0"))
    }

    /// A call of it.
    pub fn call(&self, arguments: &[&str]) -> Command {
        command(&folder().join("bin").join(self.package).to_string_lossy(), arguments)
    }
}

fn folder() -> PathBuf {
    target_folder().join("tools")
}
