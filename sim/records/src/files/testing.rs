//! What the tests of reading and writing share.

use std::fs;
use std::path::{Path, PathBuf};

use miette::{Diagnostic, GraphicalReportHandler, GraphicalTheme};

/// A folder of a test's own, removed at its end.
pub struct Scratch(tempfile::TempDir);

impl Scratch {
    #[expect(clippy::new_without_default, reason = "it makes a folder")]
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("the system has a folder for temporary files"))
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    /// Writes a file in it and returns its path.
    pub fn file(&self, name: &str, text: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path().join(name);
        fs::write(&path, text).expect("a test can write into its own folder");
        path
    }

    /// The names in it, hidden ones too, sorted.
    pub fn names(&self) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(self.path())
            .expect("a test can read its own folder")
            .map(|entry| entry.expect("and its entries").file_name())
            .map(|name| name.to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }
}

/// The report that a user sees, without color and unbroken.
pub fn report(error: &impl Diagnostic) -> String {
    let mut text = String::new();
    GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor())
        .with_width(1000)
        .render_report(&mut text, error)
        .expect("a String takes every text");
    text
}

/// Asserts that the report of `error` contains every one of `parts`.
#[track_caller]
pub fn assert_report(error: impl Diagnostic, parts: &[&str]) {
    let text = report(&error);
    for part in parts {
        assert!(text.contains(part), "no `{part}` in:\n{text}");
    }
}
