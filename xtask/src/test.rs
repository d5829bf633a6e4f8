//! Every test there is.

use crate::run::{Result, cargo, run};
use crate::setup;

/// Formatting, lints, documentation, host tests, and the controller's crate for the controller.
pub fn all() -> Result {
    setup::all()?;
    run(&mut cargo(&["fmt", "--all", "--check"]))?;
    run(&mut cargo(&["clippy", "--workspace", "--all-targets", "--locked", "--", "-D", "warnings"]))?;
    run(&mut cargo(&["test", "--workspace", "--locked"]))?;
    run(cargo(&["doc", "--workspace", "--no-deps", "--locked"]).env("RUSTDOCFLAGS", "-D warnings"))?;
    // The host's builds link the standard library somewhere; this one has none to link.
    run(&mut cargo(&["build", "--package", "rotorlead", "--lib", "--release", "--locked", "--target", setup::TARGET]))
}
