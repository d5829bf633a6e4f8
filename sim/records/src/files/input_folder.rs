//! A folder that is read, on disk or in memory.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::{FileError, TextFile, checksum_of, checksum_of_files};

/// Files by their names: a folder in memory.
pub type FilesInMemory = BTreeMap<String, Vec<u8>>;

/// A folder whose files are read: what a browser was given has no place on a disk.
#[derive(Clone, Copy, Debug)]
pub enum InputFolder<'a> {
    /// On disk.
    OnDisk(&'a Path),
    /// In memory; messages call its files by their names alone.
    InMemory(&'a FilesInMemory),
}

impl<'a> From<&'a Path> for InputFolder<'a> {
    fn from(folder: &'a Path) -> Self {
        Self::OnDisk(folder)
    }
}

impl<'a> From<&'a FilesInMemory> for InputFolder<'a> {
    fn from(files: &'a FilesInMemory) -> Self {
        Self::InMemory(files)
    }
}

impl InputFolder<'_> {
    /// What messages call a file in it, and on disk its path.
    #[must_use]
    pub fn path(self, name: &str) -> PathBuf {
        match self {
            Self::OnDisk(folder) => folder.join(name),
            Self::InMemory(_) => name.into(),
        }
    }

    /// Whether a file is in it.
    #[must_use]
    pub fn has(self, name: &str) -> bool {
        match self {
            Self::OnDisk(folder) => folder.join(name).exists(),
            Self::InMemory(files) => files.contains_key(name),
        }
    }

    /// How long a file is, bytes; zero where it is not there.
    #[must_use]
    pub fn length(self, name: &str) -> u64 {
        match self {
            Self::OnDisk(folder) => folder.join(name).metadata().map_or(0, |file| file.len()),
            Self::InMemory(files) => files.get(name).map_or(0, |bytes| bytes.len() as u64),
        }
    }

    /// Reads a file, as [`TextFile::read`].
    ///
    /// # Errors
    /// As [`TextFile::read`].
    pub fn text(self, name: &str) -> Result<TextFile, FileError> {
        let path = self.path(name);
        match self {
            Self::OnDisk(_) => TextFile::read(&path),
            Self::InMemory(files) => match files.get(name) {
                Some(bytes) => TextFile::from_bytes(&path, bytes.clone()),
                None => Err(FileError::Missing { path, remedy: "give this file with the others" }),
            },
        }
    }

    /// By which files can be seen to be the same, one behind the other; `None` where they are none, or one is not there.
    pub fn checksum<'b>(self, names: impl IntoIterator<Item = &'b str>) -> Option<String> {
        match self {
            Self::OnDisk(folder) => checksum_of_files(names.into_iter().map(|name| folder.join(name))),
            Self::InMemory(files) => {
                let parts: Option<Vec<&[u8]>> = names.into_iter().map(|name| Some(&**files.get(name)?)).collect();
                parts.filter(|parts| !parts.is_empty()).map(|parts| checksum_of(&parts))
            }
        }
    }
}
