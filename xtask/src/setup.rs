//! Installs what a Rust toolchain may lack: formatter, lints, the targets, the emulator, and a browser.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use crate::board::BOARD;
use crate::run::{Result, cargo, command, output, run_within};
use crate::{apt, emulator, library};

/// Longest that a download may take. A server that cannot be reached must not hang the tests.
const DOWNLOAD_LIMIT: Duration = Duration::from_secs(300);
/// Debian's compiler that comes with the source of its library, and a linker.
const DEBIAN_PACKAGES: [&str; 4] = ["rustc-web", "cargo-web", "rust-web-src", "lld"];
/// Where that compiler and its library's source are.
const DEBIAN_FOLDER: &str = "/usr/bin";
const DEBIAN_SOURCE: &str = "lib/rustlib/src/rust/library/core/Cargo.toml";

/// Debian's package of Chromium, and the names under which it or its like may be there.
const BROWSER_PACKAGE: &str = "chromium";
const BROWSERS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome-stable", "google-chrome"];

/// What builds for a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Toolchain {
    origin: Origin,
    target: &'static str,
}

/// Where a toolchain comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Origin {
    /// The toolchain that builds for the host, with the target's library from rustup.
    Rustup,
    /// Debian's, which builds the library from its source: for machines that do not reach rustup's server.
    Debian,
}

impl Toolchain {
    /// cargo with the arguments that a build for the target needs, beside those given.
    pub fn cargo(self, arguments: &[&str]) -> Command {
        match self.origin {
            Origin::Rustup => {
                let mut cargo = cargo(arguments);
                cargo.args(["--target", self.target]);
                cargo
            }
            Origin::Debian => {
                let mut cargo = command("/usr/bin/cargo", arguments);
                let path = std::env::var("PATH").unwrap_or_default();
                cargo
                    .args(["--target", self.target, "-Zbuild-std=core,panic_abort"])
                    // Compiler and library source must be of one version.
                    .env("PATH", format!("{DEBIAN_FOLDER}:{path}"))
                    .env("RUSTC", "/usr/bin/rustc")
                    .env("RUSTC_BOOTSTRAP", "1")
                    .env("RUSTFLAGS", "-C linker=ld.lld")
                    .env_remove("RUSTUP_TOOLCHAIN")
                    // The two compilers must not throw away each other's work.
                    .env("CARGO_TARGET_DIR", crate::run::root().join("target/debian"));
                cargo
            }
        }
    }

    /// Where its builds end up.
    pub fn folder(self) -> std::path::PathBuf {
        let folder = match self.origin {
            Origin::Rustup => "target",
            Origin::Debian => "target/debian",
        };
        crate::run::root().join(folder).join(self.target)
    }
}

/// Everything.
pub fn all() -> Result {
    components()?;
    targets()?;
    emulator()?;
    browser()
}

/// rustfmt and clippy.
pub fn components() -> Result {
    for (component, subcommand) in [("rustfmt", "fmt"), ("clippy", "clippy")] {
        if output(&mut command("cargo", &[subcommand, "--version"])).is_none() {
            rustup(&["component", "add", component])?;
        }
    }
    Ok(())
}

/// The targets of the image and of the library.
pub fn targets() -> Result {
    library::CORES.into_iter().try_for_each(|core| toolchain(core).map(drop))
}

/// What builds for the controller.
pub fn target() -> Result<Toolchain> {
    toolchain(BOARD.target)
}

/// What builds for a target: rustup's library for it, or else Debian's compiler.
pub fn toolchain(target: &'static str) -> Result<Toolchain> {
    let of = |origin| Toolchain { origin, target };
    let libraries = output(&mut command("rustc", &["--print", "target-libdir", "--target", target]));
    if libraries.is_some_and(|folder| Path::new(folder.trim()).is_dir()) {
        return Ok(of(Origin::Rustup));
    }
    if has_debian() {
        return Ok(of(Origin::Debian));
    }
    let Err(first) = rustup(&["target", "add", target]) else { return Ok(of(Origin::Rustup)) };
    eprintln!("xtask: {first}\nxtask: tries Debian's compiler instead");
    apt::install(&DEBIAN_PACKAGES).map_err(|second| format!("the target {target} is missing.\n{first}\n{second}"))?;
    if has_debian() { Ok(of(Origin::Debian)) } else { Err(format!("{} installed, but incomplete", DEBIAN_PACKAGES[0])) }
}

/// Whether Debian's compiler is here with the source of its own library.
fn has_debian() -> bool {
    let sysroot = output(&mut command("/usr/bin/rustc", &["--print", "sysroot"]));
    let source = sysroot.is_some_and(|folder| Path::new(folder.trim()).join(DEBIAN_SOURCE).is_file());
    source && output(&mut command("ld.lld", &["--version"])).is_some() && Path::new("/usr/bin/cargo").is_file()
}

/// QEMU, new enough to have the controller's clock registers.
pub fn emulator() -> Result {
    match emulator::version() {
        Some(version) if version >= emulator::OLDEST => return Ok(()),
        Some(version) => eprintln!("xtask: QEMU {version} is too old: {} models the clock registers", emulator::OLDEST),
        None => {}
    }
    apt::install_at_least(emulator::PACKAGE, emulator::OLDEST)?;
    match emulator::version() {
        Some(version) if version >= emulator::OLDEST => Ok(()),
        _ => Err(format!("{} is installed, but does not run as {}", emulator::PACKAGE, emulator::PROGRAM)),
    }
}

/// Chromium, in which the reports are opened.
pub fn browser() -> Result {
    let is_there = || BROWSERS.iter().any(|program| output(&mut command(program, &["--version"])).is_some());
    if is_there() {
        return Ok(());
    }
    apt::install(&[BROWSER_PACKAGE])?;
    if is_there() {
        Ok(())
    } else {
        Err(format!("{BROWSER_PACKAGE} is installed, but does not run as {}", BROWSERS[0]))
    }
}

fn rustup(arguments: &[&str]) -> Result {
    run_within(&mut command("rustup", arguments), DOWNLOAD_LIMIT).map_err(|error| {
        format!("{error}\nThis needs rustup and its download server: run `rustup {}` by hand", arguments.join(" "))
    })
}
