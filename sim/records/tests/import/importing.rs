//! What the tests of the importers share.

use std::fs;
use std::path::{Path, PathBuf};

use miette::Diagnostic as _;
use rotorlead_records::import::{Import, ImportError, ImportOptions, import};

/// A stored sample.
pub fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

/// Imports these bytes, from a file whose name says nothing of their format.
pub fn imported(bytes: &[u8], options: &ImportOptions) -> Result<Import, ImportError> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.csv");
    fs::write(&file, bytes).unwrap();
    import(&file, options)
}

/// The message, which has to name the file, and the remedy, which has to be there.
pub fn message(result: Result<Import, ImportError>) -> String {
    let error = result.unwrap_err();
    let help = error.help().expect("every error has a remedy").to_string();
    let message = error.to_string();
    assert!(message.contains("log.csv"), "{message}");
    format!("{message} | {help}")
}
