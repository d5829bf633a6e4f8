//! Installs what a Rust toolchain may lack: formatter, lints, the targets, compilers for C and C++, the emulators, Python, and a
//! browser.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use ::emulator::rp2040;

use crate::board;
use crate::python_environment::{DIST, DOWNLOAD_LIMIT, TESTS};
use crate::run::{Result, cargo, command, output, run_within, target_folder};
use crate::tools::{self, Tool};
use crate::{apt, emulator, python_environment, web};

/// The smallest Cortex-M, which has neither a division of 64 bits nor a compare-and-swap.
pub const SMALLEST_CORE: &str = "thumbv6m-none-eabi";
/// Debian's compiler that comes with the source of its library, and a linker.
const DEBIAN_PACKAGES: [&str; 4] = ["rustc-web", "cargo-web", "rust-web-src", "lld"];
/// Where that compiler and its library's source are.
const DEBIAN_FOLDER: &str = "/usr/bin";
const DEBIAN_SOURCE: &str = "lib/rustlib/src/rust/library/core/Cargo.toml";

/// Debian's package of the program that installs packages for node.
const NPM: &str = "npm";

/// Compilers for the examples of the C interface, and Debian's package that has both.
const COMPILERS: [&str; 2] = ["cc", "c++"];
const COMPILERS_PACKAGE: &str = "g++";

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
                    .env("CARGO_TARGET_DIR", self.cargo_folder());
                cargo
            }
        }
    }

    /// Its linker, for an archive without a program.
    pub fn linker(self) -> Result<Command> {
        match self.origin {
            Origin::Rustup => {
                let said = |what| output(&mut command("rustc", &["--print", what])).ok_or("rustc says nothing");
                let (sysroot, host) = (said("sysroot")?, said("host-tuple")?);
                let folder = Path::new(sysroot.trim()).join("lib/rustlib").join(host.trim());
                Ok(command(&folder.join("bin/rust-lld").to_string_lossy(), &["-flavor", "gnu"]))
            }
            Origin::Debian => Ok(command("ld.lld", &[])),
        }
    }

    /// Where its builds end up.
    pub fn folder(self) -> PathBuf {
        self.cargo_folder().join(self.target)
    }

    /// Cargo's target folder.
    pub fn cargo_folder(self) -> PathBuf {
        match self.origin {
            Origin::Rustup => target_folder(),
            Origin::Debian => target_folder().join("debian"),
        }
    }
}

/// Something that a Rust toolchain may lack.
struct Need {
    name: String,
    is_there: Box<dyn Fn() -> bool>,
    install: Box<dyn Fn() -> Result>,
}

/// Everything that builds and tests need beside a Rust toolchain.
fn needs() -> Result<Vec<Need>> {
    let component = |name: &'static str, subcommand: &'static str| Need {
        name: name.to_owned(),
        is_there: Box::new(move || runs("cargo", &[subcommand, "--version"])),
        install: Box::new(move || rustup(&["component", "add", name])),
    };
    let target = |target: &'static str| Need {
        name: format!("the target {target}"),
        is_there: Box::new(move || toolchain(target).is_ok()),
        install: Box::new(move || add_target(target)),
    };
    let mut needs = vec![component("rustfmt", "fmt"), component("clippy", "clippy")];
    let boards = board::all()?.iter().map(|board| board.target.as_str());
    needs.extend(boards.chain([SMALLEST_CORE, web::TARGET]).collect::<BTreeSet<_>>().into_iter().map(target));
    needs.push(Need {
        name: emulator_name(),
        is_there: Box::new(has_emulator),
        install: Box::new(|| apt::install_at_least(emulator::PACKAGE, emulator::OLDEST)),
    });
    needs.push(Need {
        name: "a compiler for C and C++, cc and c++".to_owned(),
        is_there: Box::new(|| COMPILERS.iter().all(|program| runs(program, &["--version"]))),
        install: Box::new(|| apt::install(&[COMPILERS_PACKAGE])),
    });
    needs.extend(rp2040_needs());
    needs.push(Need {
        name: web::NPM_PACKAGES.map(|(name, version)| format!("{name} {version}")).join(", "),
        is_there: Box::new(web::has_packages),
        install: Box::new(web::install_packages),
    });
    needs.extend(python_needs());
    needs.push(tool(&tools::SEMVER_CHECKS));
    needs.push(Need {
        name: BROWSER_PACKAGE.to_owned(),
        is_there: Box::new(|| BROWSERS.iter().any(|program| runs(program, &["--version"]))),
        install: Box::new(|| apt::install(&[BROWSER_PACKAGE])),
    });
    Ok(needs)
}

/// The emulator of the RP2040, and what executes it.
fn rp2040_needs() -> [Need; 3] {
    let has_package = || rp2040::is_installed(&rp2040::package_folder());
    [
        Need {
            name: format!("node {} or later", rp2040::OLDEST_NODE),
            is_there: Box::new(|| rp2040::node_version().is_some_and(|version| version >= rp2040::OLDEST_NODE)),
            install: Box::new(|| apt::install_at_least(rp2040::NODE_PACKAGE, rp2040::OLDEST_NODE)),
        },
        Need {
            name: NPM.to_owned(),
            // Needed only for packages.
            is_there: Box::new(move || has_package() && web::has_packages() || runs(NPM, &["--version"])),
            install: Box::new(|| apt::install(&[NPM])),
        },
        Need {
            name: format!("{} {}", rp2040::NPM_PACKAGE, rp2040::VERSION),
            is_there: Box::new(has_package),
            install: Box::new(install_rp2040),
        },
    ]
}

/// Python, and what builds and tests its package.
fn python_needs() -> [Need; 2] {
    let (major, minor) = python_environment::OLDEST;
    [
        Need {
            name: format!("Python {major}.{minor} or later with venv, python3 or what PYTHON names"),
            is_there: Box::new(python_environment::is_there),
            install: Box::new(|| apt::install(&python_environment::DEBIAN_PACKAGES)),
        },
        Need {
            name: format!("the Python packages of {}", TESTS.requirements),
            is_there: Box::new(|| TESTS.has_packages()),
            install: Box::new(|| TESTS.install_packages()),
        },
    ]
}

/// An error where Python or what builds its package is missing.
pub fn python() -> Result {
    let missing = missing(python_needs());
    if missing.is_empty() { Ok(()) } else { Err(missing_error(&missing)) }
}

/// A program that the Python packages bring, with its arguments; an error where they are missing.
pub fn python_tool(name: &str, arguments: &[&str]) -> Result<Command> {
    python()?;
    Ok(TESTS.tool(name, arguments))
}

/// Installs npm's package into cargo's target folder, from the registry that npm is set to.
fn install_rp2040() -> Result {
    let package = format!("{}@{}", rp2040::NPM_PACKAGE, rp2040::VERSION);
    let folder = rp2040::package_folder();
    let arguments = ["install", "--no-package-lock", "--no-audit", "--no-fund", "--prefix"];
    run_within(command(NPM, &arguments).arg(folder).arg(package), DOWNLOAD_LIMIT)
}

/// What makes the program of a release: on any system that cargo builds on.
fn dist_needs() -> Vec<Need> {
    let page = Need {
        name: format!("the target {}", web::TARGET),
        is_there: Box::new(|| toolchain(web::TARGET).is_ok()),
        install: Box::new(|| add_target(web::TARGET)),
    };
    let environment = Need {
        name: format!("the Python packages of {}", DIST.requirements),
        is_there: Box::new(|| DIST.has_packages()),
        install: Box::new(|| DIST.install_packages()),
    };
    let [python, _] = python_needs();
    [page, python, environment].into_iter().chain([&tools::ABOUT, &tools::CYCLONEDX].map(tool)).collect()
}

/// A tool that cargo compiles.
fn tool(tool: &'static Tool) -> Need {
    Need { name: tool.name(), is_there: Box::new(|| tool.is_there()), install: Box::new(|| tool.install()) }
}

/// An error that names what is missing of that which makes the program of a release.
pub fn dist() -> Result {
    let missing = missing(dist_needs());
    if missing.is_empty() {
        Ok(())
    } else {
        Err(format!("missing: {}; `cargo xtask setup --dist` installs what is missing", missing.join(", ")))
    }
}

/// Installs what is missing, and says what.
pub fn all() -> Result {
    install(needs()?)
}

/// Installs what is missing of that which makes the program of a release.
pub fn all_for_dist() -> Result {
    install(dist_needs())
}

fn install(needs: impl IntoIterator<Item = Need>) -> Result {
    for need in needs.into_iter().filter(|need| !(need.is_there)()) {
        eprintln!("xtask: installs {}", need.name);
        (need.install)().map_err(|error| format!("{} is missing.\n{error}", need.name))?;
        if !(need.is_there)() {
            return Err(format!("{} was installed, but cannot be used", need.name));
        }
    }
    Ok(())
}

/// An error that names what is missing, and how it is installed. Changes nothing.
pub fn check() -> Result {
    let missing = missing(needs()?);
    if missing.is_empty() { Ok(()) } else { Err(missing_error(&missing)) }
}

/// Names of what is not there.
fn missing(needs: impl IntoIterator<Item = Need>) -> Vec<String> {
    needs.into_iter().filter(|need| !(need.is_there)()).map(|need| need.name).collect()
}

fn missing_error(missing: &[String]) -> String {
    format!(
        "missing: {}; `cargo xtask test --setup` or `cargo xtask setup` installs what is missing",
        missing.join(", ")
    )
}

/// An error where there is no QEMU that has the controller's clock registers.
pub fn emulator() -> Result {
    if has_emulator() { Ok(()) } else { Err(missing_error(&[emulator_name()])) }
}

fn emulator_name() -> String {
    format!("{} {} or later", emulator::PROGRAM, emulator::OLDEST)
}

fn has_emulator() -> bool {
    emulator::version().is_some_and(|version| version >= emulator::OLDEST)
}

/// What builds for the controller.
pub fn target() -> Result<Toolchain> {
    toolchain(&board::default()?.target)
}

/// What builds for a target: rustup's library for it, or else Debian's compiler.
pub fn toolchain(target: &'static str) -> Result<Toolchain> {
    let of = |origin| Toolchain { origin, target };
    let libraries = output(&mut command("rustc", &["--print", "target-libdir", "--target", target]));
    if libraries.is_some_and(|folder| Path::new(folder.trim()).is_dir()) {
        Ok(of(Origin::Rustup))
    } else if has_debian() {
        Ok(of(Origin::Debian))
    } else {
        Err(missing_error(&[format!("the target {target}")]))
    }
}

/// Adds a compiler of an older version.
pub fn add_compiler(version: &str) -> Result {
    rustup(&["toolchain", "install", version, "--profile", "minimal"])
}

/// Adds rustup's library of a system for which a release has a program.
pub fn add_system(target: &str) -> Result {
    rustup(&["target", "add", target])
}

/// Adds rustup's library for a target, or Debian's compiler where rustup's server cannot be reached.
fn add_target(target: &str) -> Result {
    let Err(first) = rustup(&["target", "add", target]) else { return Ok(()) };
    eprintln!("xtask: {first}\nxtask: tries Debian's compiler instead");
    apt::install(&DEBIAN_PACKAGES).map_err(|second| format!("{first}\n{second}"))
}

/// Whether Debian's compiler is here with the source of its own library.
fn has_debian() -> bool {
    let sysroot = output(&mut command("/usr/bin/rustc", &["--print", "sysroot"]));
    let source = sysroot.is_some_and(|folder| Path::new(folder.trim()).join(DEBIAN_SOURCE).is_file());
    source && runs("ld.lld", &["--version"]) && Path::new("/usr/bin/cargo").is_file()
}

fn runs(program: &str, arguments: &[&str]) -> bool {
    output(&mut command(program, arguments)).is_some()
}

fn rustup(arguments: &[&str]) -> Result {
    run_within(&mut command("rustup", arguments), DOWNLOAD_LIMIT).map_err(|error| {
        format!("{error}\nThis needs rustup and its download server: run `rustup {}` by hand", arguments.join(" "))
    })
}
