//! The packages that others may take from a registry: what a registry shows of each, and that each is complete.

use std::fs;
use std::path::{Path, PathBuf};

use flate2::read::GzDecoder;
use serde_json::Value;

use crate::run::{Result, cargo, command, output, run, target_folder};
use crate::setup;

/// What a manifest says of its package, besides its name.
const METADATA: [&str; 6] = ["description", "license", "readme", "rust_version", "keywords", "categories"];

/// The archive of each can be made, and its manifest leaves nothing out.
pub fn check() -> Result {
    let published = published()?;
    published.iter().try_for_each(metadata)?;
    published.iter().try_for_each(license)?;
    archives(&published, &["--no-verify", "--allow-dirty"]).map(drop)
}

/// Checks that the packages compile with the oldest compiler that their manifests promise.
pub fn check_with_oldest_compiler() -> Result {
    let published = published()?;
    let oldest = published.first().and_then(|manifest| manifest["rust_version"].as_str());
    let oldest = oldest.ok_or("Cargo.toml does not say: rust-version")?;
    setup::add_compiler(oldest)?;
    let mut check = command("rustup", &["run", oldest, "cargo", "check", "--locked"]);
    for manifest in &published {
        check.args(["--package", name(manifest)]);
    }
    // The two compilers must not throw away each other's work.
    run(check.env("CARGO_TARGET_DIR", target_folder().join("oldest")))
}

/// Archives of the packages, as `cargo package` makes them with these options.
pub fn archives(published: &[Value], options: &[&str]) -> Result<Vec<PathBuf>> {
    let mut package = cargo(&["package", "--locked"]);
    package.args(options);
    for manifest in published {
        package.args(["--package", name(manifest)]);
    }
    run(&mut package)?;
    let folder = target_folder().join("package");
    let archive = |manifest: &Value| folder.join(format!("{}-{}.crate", name(manifest), version(manifest)));
    Ok(published.iter().map(archive).collect())
}

/// The manifest of every package that is not kept back by `publish = false`, as cargo reads it.
pub fn published() -> Result<Vec<Value>> {
    let mut all = manifests()?;
    all.retain(|manifest| manifest["publish"].as_array().is_none_or(|registries| !registries.is_empty()));
    Ok(all)
}

/// The manifest of a package, as cargo reads it.
pub fn manifest(package: &str) -> Result<Value> {
    let found = manifests()?.into_iter().find(|manifest| name(manifest) == package);
    found.ok_or_else(|| format!("the workspace has no package {package}"))
}

/// The manifests of the workspace's packages.
pub fn manifests() -> Result<Vec<Value>> {
    let mut command = cargo(&["metadata", "--no-deps", "--format-version", "1", "--locked"]);
    let text = output(&mut command).ok_or("`cargo metadata --locked` fails")?;
    let mut metadata: Value = serde_json::from_str(&text).map_err(|error| format!("cargo metadata: {error}"))?;
    match metadata["packages"].take() {
        Value::Array(packages) => Ok(packages),
        other => Err(format!("cargo metadata: packages are {other}")),
    }
}

/// The name of the package with this manifest.
pub fn name(manifest: &Value) -> &str {
    manifest["name"].as_str().unwrap_or_default()
}

/// The version of the package with this manifest.
pub fn version(manifest: &Value) -> &str {
    manifest["version"].as_str().unwrap_or_default()
}

/// The folder of the package with this manifest.
pub fn folder(manifest: &Value) -> Option<&Path> {
    Path::new(manifest["manifest_path"].as_str()?).parent()
}

/// Puts what is in a package's archive into an empty folder, and gives the package's own folder in it.
pub fn unpack(archive: &[u8], folder: &Path) -> Result<PathBuf> {
    let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
    tar::Archive::new(GzDecoder::new(archive)).unpack(folder).map_err(failed)?;
    let entry = fs::read_dir(folder).map_err(failed)?.next();
    Ok(entry.ok_or_else(|| format!("{}: an empty package", folder.display()))?.map_err(failed)?.path())
}

/// An error where a package comes without the text of its license.
fn license(manifest: &Value) -> Result {
    match folder(manifest).map(|folder| folder.join("LICENSE")) {
        Some(text) if text.exists() => Ok(()),
        _ => Err(format!("{} has no LICENSE: a link to that of the root is enough", name(manifest))),
    }
}

/// An error where a manifest leaves out what a registry shows.
fn metadata(manifest: &Value) -> Result {
    let is_missing = |field: &&str| match &manifest[*field] {
        Value::String(text) => text.is_empty(),
        Value::Array(items) => items.is_empty(),
        _ => true,
    };
    let missing: Vec<&str> = METADATA.into_iter().filter(is_missing).collect();
    if missing.is_empty() {
        Ok(())
    } else {
        Err(format!("Cargo.toml of {} does not say: {}", name(manifest), missing.join(", ")))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::metadata;

    #[test]
    fn a_manifest_that_leaves_something_out_is_refused_by_name() {
        let mut manifest = json!({
            "name": "rotorlead",
            "description": "d", "license": "MIT", "readme": "README.md", "rust_version": "1.91", "keywords": ["a"],
            "categories": ["embedded"],
        });
        assert_eq!(metadata(&manifest), Ok(()));
        manifest["keywords"] = json!([]);
        manifest["readme"] = json!(null);
        assert_eq!(metadata(&manifest), Err("Cargo.toml of rotorlead does not say: readme, keywords".to_owned()));
    }
}
