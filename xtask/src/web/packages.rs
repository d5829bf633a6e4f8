//! What drives a browser: packages of npm.

use std::path::PathBuf;
use std::time::Duration;

use crate::run::{Result, command, run_within, target_folder};

/// The packages with their versions.
pub const NPM_PACKAGES: [(&str, &str); 2] = [("puppeteer-core", "24.43.1"), ("axe-core", "4.14.1")];

/// Longest that a download may take. A server that cannot be reached must not hang the tests.
const DOWNLOAD_LIMIT: Duration = Duration::from_secs(300);

/// Where they are installed.
pub fn folder() -> PathBuf {
    target_folder().join("web-tests")
}

/// Whether they are there, of these versions.
pub fn has_packages() -> bool {
    NPM_PACKAGES.iter().all(|(name, version)| {
        let described = std::fs::read_to_string(folder().join("node_modules").join(name).join("package.json"));
        let described = described.ok().and_then(|text| serde_json::from_str::<serde_json::Value>(&text).ok());
        described.is_some_and(|described| described["version"] == *version)
    })
}

/// Installs them into cargo's target folder, from the registry that npm is set to.
pub fn install_packages() -> Result {
    let arguments = ["install", "--no-package-lock", "--no-audit", "--no-fund", "--ignore-scripts", "--prefix"];
    let mut install = command("npm", &arguments);
    install.arg(folder()).args(NPM_PACKAGES.map(|(name, version)| format!("{name}@{version}")));
    run_within(&mut install, DOWNLOAD_LIMIT)
}
