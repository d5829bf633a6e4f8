//! What can be wrong with a file.

use miette::{Diagnostic, NamedSource, SourceCode as _, SourceSpan};
use std::borrow::Cow;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

use super::Fault;
use super::excerpt::Excerpt;

/// What is wrong with a file that was to be read or written: its name, the place and the remedy.
#[derive(Debug, Error, Diagnostic)]
pub enum FileError {
    /// There is nothing at the path.
    #[error("`{}` does not exist", path.display())]
    #[diagnostic(help("{remedy}"))]
    Missing {
        /// The path as it was given.
        path: PathBuf,
        /// What to do about it.
        remedy: &'static str,
    },
    /// The file is there, with nothing but white space in it.
    #[error("`{}` is empty", path.display())]
    #[diagnostic(help("check that the program that wrote it finished, and that this is the right file"))]
    Empty {
        /// The path as it was given.
        path: PathBuf,
    },
    /// More than is read into memory.
    #[error("`{}` is longer than {} MB", path.display(), most / 1_000_000)]
    #[diagnostic(help(
        "check that this is the right file; rows that are more than these are split into several records"
    ))]
    TooLong {
        /// The path as it was given.
        path: PathBuf,
        /// The greatest length, bytes.
        most: u64,
    },
    /// The operating system refused.
    #[error("cannot {action} `{}`", path.display())]
    #[diagnostic(help("check the path, its permissions and the free space of its disk"))]
    Io {
        /// `read`, `write`...
        action: &'static str,
        /// The path concerned.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// A file was given where a folder is needed.
    #[error("`{}` is not a folder", path.display())]
    #[diagnostic(help("{remedy}"))]
    NotAFolder {
        /// The path as it was given.
        path: PathBuf,
        /// What to do about it.
        remedy: Cow<'static, str>,
    },
    /// A folder was given where a file is to be written.
    #[error("`{}` is a folder, not a file", path.display())]
    #[diagnostic(help("give the name of a file in it"))]
    NotAFile {
        /// The path as it was given.
        path: PathBuf,
    },
    /// The folder in which to write does not exist.
    #[error("cannot write `{}`: there is no folder `{}`", path.display(), parent.display())]
    #[diagnostic(help("create that folder first, or write to another one"))]
    NoParent {
        /// The path that was to be written.
        path: PathBuf,
        /// The folder that is missing.
        parent: PathBuf,
    },
    /// The destination folder holds something already.
    #[error("the folder `{}` exists and is not empty", path.display())]
    #[diagnostic(help("remove it, or give another folder: nothing is overwritten"))]
    FolderInUse {
        /// The path as it was given.
        path: PathBuf,
    },
    /// A destination such as `.` or `..`, beside which nothing can be built.
    #[error("`{}` does not say what the folder is to be called", path.display())]
    #[diagnostic(help("give the name of a new folder"))]
    Unnamed {
        /// The path as it was given.
        path: PathBuf,
    },
    /// A name that would be written outside its folder, or not on every system.
    #[error("`{name}` is not the name of a file inside `{}`", folder.display())]
    #[diagnostic(help("use a relative name with `/` between its parts, without `..`"))]
    NotInside {
        /// The name.
        name: String,
        /// The folder in which it should be.
        folder: PathBuf,
    },
    /// A log was given where a file of settings is needed.
    #[error("`{}` is a log or other data, and not {needed}", path.display())]
    #[diagnostic(help("{remedy}; `rotorlead identify {} --out model.toml` makes a model of a log", path.display()))]
    Log {
        /// The path as it was given.
        path: PathBuf,
        /// What is needed, as people call it.
        needed: &'static str,
        /// Where that comes from.
        remedy: &'static str,
    },
    /// Values that no reader would accept were to be written.
    #[error("nothing was written to `{}`: {fault}", path.display())]
    #[diagnostic(help("{}", fault.help))]
    Refused {
        /// The path that was to be written.
        path: PathBuf,
        /// Which value, and why.
        fault: Box<Fault>,
    },
    /// Values in memory that no reader would accept.
    #[error("`{name}`: {fault}")]
    #[diagnostic(help("{}", fault.help))]
    Faulty {
        /// The file that would have them.
        name: String,
        /// Which value, and why.
        fault: Box<Fault>,
    },
    /// A place in a text.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Located(Box<Located>),
}

impl FileError {
    /// Refuses to write `path` because of `fault`.
    #[must_use]
    pub fn refused(path: &Path, fault: Fault) -> Self {
        Self::Refused { path: path.to_owned(), fault: Box::new(fault) }
    }

    /// Line and column of the place in the file, both from one, where the complaint is about one.
    #[must_use]
    pub fn line_and_column(&self) -> Option<(usize, usize)> {
        let Self::Located(located) = self else { return None };
        let place = located.source_code.read_span(&located.span, 0, 0).ok()?;
        Some((place.line() + 1, place.column() + 1))
    }

    /// The path of the file that the complaint is about a place in, as it was given.
    #[must_use]
    pub fn file_name(&self) -> Option<&str> {
        let Self::Located(located) = self else { return None };
        Some(located.source_code.name())
    }
}

/// A complaint about a place in a text, shown with the text around it.
#[derive(Debug, Error, Diagnostic)]
#[error("{message}")]
#[diagnostic(help("{help}"))]
pub struct Located {
    /// What is wrong, with the names of key or column.
    pub message: String,
    /// What is said beside the place.
    pub label: String,
    /// What to do about it.
    pub help: String,
    /// The file's name and text.
    #[source_code]
    pub source_code: NamedSource<Excerpt>,
    /// The place, in bytes of the text.
    #[label("{label}")]
    pub span: SourceSpan,
}
