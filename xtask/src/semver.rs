//! What a caller of the library would have to change since the version that is kept.

use std::fs;

use crate::packages;
use crate::run::{Result, root, run};
use crate::sum::sha256;
use crate::tools::SEMVER_CHECKS;

/// The package of the library.
const PACKAGE: &str = "rotorlead";
/// The feature that brings all of its interface that a host can build.
const FEATURE: &str = "controller";
/// The package that callers have, and the file with its sum, as `sha256sum` writes it.
const KEPT: &str = "xtask/released/rotorlead.crate";
const SUM: &str = "xtask/released/rotorlead.crate.sha256";

/// An error where the library breaks callers of the version that is kept, and its own version does not say so.
pub fn check() -> Result {
    if !SEMVER_CHECKS.is_there() {
        return Err(format!("missing: {}; `cargo xtask setup` installs it", SEMVER_CHECKS.name()));
    }
    let archive = read(KEPT)?;
    if read(SUM)? != line(&archive).into_bytes() {
        return Err(format!("{KEPT} does not have the sum in {SUM}: take both from one commit"));
    }
    // Outside of the workspace, to which it would belong else.
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let kept = packages::unpack(&archive, folder.path())?;
    let mut checks = SEMVER_CHECKS.call(&["semver-checks", "--package", PACKAGE, "--only-explicit-features"]);
    run(checks.args(["--features", FEATURE, "--baseline-root"]).arg(kept))
}

/// Keeps today's package as the one that callers have.
pub fn freeze() -> Result {
    let archives = packages::archives(&[packages::manifest(PACKAGE)?], &["--no-verify"])?;
    let [archive] = &archives[..] else { return Err(format!("{} archives of one package", archives.len())) };
    let bytes = fs::read(archive).map_err(|error| format!("{}: {error}", archive.display()))?;
    for (path, content) in [(KEPT, &bytes[..]), (SUM, line(&bytes).as_bytes())] {
        fs::write(root().join(path), content).map_err(|error| format!("{path}: {error}"))?;
    }
    Ok(())
}

/// What the file of the sum holds for an archive.
fn line(archive: &[u8]) -> String {
    format!("{}  rotorlead.crate\n", sha256(archive))
}

fn read(path: &str) -> Result<Vec<u8>> {
    fs::read(root().join(path)).map_err(|error| format!("{path}: {error}"))
}
