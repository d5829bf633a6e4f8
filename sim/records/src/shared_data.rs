//! Measured data that tests read, and that are not in this repository.

use std::path::{Path, PathBuf};

/// A log of a real motor. The logs are not in this repository: they are looked for in `$ROTORLEAD_DATA`, else in `shared/data`
/// beside the workspace. Without them this is `None`, and says that the test is skipped.
///
/// # Panics
/// Where `CI` is set and the log is missing.
#[must_use]
pub fn real_log(name: &str) -> Option<PathBuf> {
    let sets = ["alspitz_esc_test", "sar_simulation"].map(|set| format!("{set}/{name}"));
    let [first, second] = &sets;
    data(if data_folder().join(second).exists() { second } else { first })
}

fn data_folder() -> PathBuf {
    std::env::var_os("ROTORLEAD_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"), PathBuf::from)
}

/// A file or folder beside the logs, as [`real_log`].
///
/// # Panics
/// As [`real_log`].
#[must_use]
pub fn data(name: &str) -> Option<PathBuf> {
    let file = data_folder().join(name);
    if !file.exists() {
        let message = format!("{} is not there", file.display());
        assert!(std::env::var_os("CI").is_none(), "{message}");
        eprintln!("skipped: {message}");
        return None;
    }
    Some(file)
}
