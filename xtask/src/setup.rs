//! Installs what a Rust toolchain may lack: formatter, lints, and the controller's target.

use std::time::Duration;

use crate::run::{Result, command, output, run_within};

/// The controller: a Cortex-M4 with a single-precision FPU.
pub const TARGET: &str = "thumbv7em-none-eabihf";
/// Longest that a download may take. A server that cannot be reached must not hang the tests.
const DOWNLOAD_LIMIT: Duration = Duration::from_secs(300);

/// Everything.
pub fn all() -> Result {
    components()?;
    target()
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

/// The standard library of the controller's target.
pub fn target() -> Result {
    let libraries = output(&mut command("rustc", &["--print", "target-libdir", "--target", TARGET]));
    if libraries.is_some_and(|folder| std::path::Path::new(folder.trim()).is_dir()) {
        return Ok(());
    }
    rustup(&["target", "add", TARGET])
}

fn rustup(arguments: &[&str]) -> Result {
    run_within(&mut command("rustup", arguments), DOWNLOAD_LIMIT).map_err(|error| {
        format!("{error}\nThis needs rustup and its download server: run `rustup {}` by hand", arguments.join(" "))
    })
}
