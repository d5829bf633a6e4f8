//! The list of all that is linked (a software bill of materials, SBOM), as CycloneDX.

use std::fs;
use std::path::Path;

use crate::packages;
use crate::run::{Result, root, run};
use crate::tools::CYCLONEDX;

/// What the tool calls the files that it puts beside every manifest of the workspace.
const NAME: &str = "rotorlead-sbom";

/// The list of a package of the workspace for a target, without what only its build takes.
pub fn list(package: &str, target: &str) -> Result<Vec<u8>> {
    let manifests = packages::manifests()?;
    let folders: Vec<&Path> = manifests.iter().filter_map(packages::folder).collect();
    let named = manifests.iter().find(|manifest| packages::name(manifest) == package);
    let folder = named.and_then(packages::folder);
    let made = run(&mut CYCLONEDX.call(&[
        "cyclonedx",
        "--format",
        "json",
        "--spec-version",
        "1.5",
        "--no-build-deps",
        "--target",
        target,
        "--override-filename",
        NAME,
    ]));
    let file = |folder: &Path| folder.join(format!("{NAME}.json"));
    let list = made.and_then(|()| {
        let path = folder.map(file).ok_or_else(|| format!("the workspace has no package {package}"))?;
        fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))
    });
    for path in folders.into_iter().map(file).filter(|path| path.exists()) {
        fs::remove_file(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    }
    // Where it was made is nobody's business.
    Ok(list?.replace(&format!("path+file://{}", root().display()), "path+file://.").into_bytes())
}
