//! A folder that is complete or absent.

use std::fs::{self, File};
use std::io;
use std::path::{Component, Path, PathBuf};

use tempfile::TempDir;

use super::FileError;
use super::interrupt::unless_interrupted;
use super::write::{existing_parent, parent, sync_folder, temporary, write_all};

/// A folder under construction: built beside its destination, renamed to it by
/// [`OutputFolder::commit`], removed when dropped before.
///
/// An interrupted process removes it ([`remove_unfinished`](super::remove_unfinished)). One that is killed leaves a hidden
/// folder `.NAME.*.part` beside the destination, which may be removed.
#[derive(Debug)]
pub struct OutputFolder {
    building: TempDir,
    destination: PathBuf,
}

impl OutputFolder {
    /// Begins a folder that will be `destination`: a path where there is nothing, or an empty
    /// folder. A symbolic link is followed.
    ///
    /// # Errors
    /// When `destination` holds something, is a file or has no name (`.`), its own folder does not
    /// exist, or the operating system refuses.
    pub fn create(destination: &Path) -> Result<Self, FileError> {
        if destination.file_name().is_none() {
            return Err(FileError::Unnamed { path: destination.to_owned() });
        }
        refuse_in_use(destination)?;
        existing_parent(destination)?;
        // A link to an empty folder stays; what it points to is what gives way.
        let followed = destination
            .is_symlink()
            .then(|| fs::canonicalize(destination))
            .transpose()
            .map_err(failed("follow", destination))?;
        let destination = followed.as_deref().unwrap_or(destination);
        let building = temporary(destination, 0o777, |builder| builder.tempdir_in(parent(destination)))
            .map_err(failed("create", destination))?;
        Ok(Self { building, destination: destination.to_owned() })
    }

    /// Where the folder will be.
    #[must_use]
    pub fn destination(&self) -> &Path {
        &self.destination
    }

    /// Where the folder is now, for whoever needs to write files without this type.
    #[must_use]
    pub fn building(&self) -> &Path {
        self.building.path()
    }

    /// Writes the file `name` in it, and the folders that its name goes through.
    ///
    /// # Errors
    /// When [`is_plain_name`] refuses the name, the folder has such a file already, or the
    /// operating system refuses.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), FileError> {
        self.write_parts(name, [bytes])
    }

    /// [`OutputFolder::write`] of a file that comes in parts, one after the other.
    ///
    /// # Errors
    /// As for [`OutputFolder::write`].
    pub fn write_parts<P: AsRef<[u8]>>(&self, name: &str, parts: impl IntoIterator<Item = P>) -> Result<(), FileError> {
        if !is_plain_name(name) {
            return Err(FileError::NotInside { name: name.to_owned(), folder: self.destination.clone() });
        }
        write_through(&self.building().join(name), parts).map_err(failed("write", &self.destination.join(name)))
    }

    /// Renames the folder to its destination.
    ///
    /// # Errors
    /// When something has appeared at the destination meanwhile, or the operating system refuses;
    /// nothing is left behind then.
    pub fn commit(self) -> Result<(), FileError> {
        refuse_in_use(&self.destination)?;
        sync_folder(self.building());
        // An empty folder there gives way, here and not at the start: until now nothing is final.
        // One that has been filled this very moment is refused by the system.
        unless_interrupted(|| {
            if self.destination.is_dir() {
                fs::remove_dir(&self.destination).map_err(failed("replace", &self.destination))?;
            }
            fs::rename(self.building(), &self.destination).map_err(failed("create", &self.destination))
        })?;
        let _ = self.building.keep(); // It has moved: there is nothing to remove under its old name.
        sync_folder(parent(&self.destination));
        Ok(())
    }
}

/// Whether `name` is a relative path that stays inside the folder it is relative to, on every
/// system: parts that are joined by `/`, none of them `.` or `..`, without `\` and `:`.
#[must_use]
pub fn is_plain_name(name: &str) -> bool {
    let parts: PathBuf = Path::new(name).components().filter(|part| matches!(part, Component::Normal(_))).collect();
    // Components drop `.`, a last `/` and doubled ones: the comparison as text does not.
    !name.is_empty() && parts.as_os_str() == name && !name.contains(['\\', ':', '\0'])
}

fn refuse_in_use(destination: &Path) -> Result<(), FileError> {
    let in_use = FileError::FolderInUse { path: destination.to_owned() };
    match fs::read_dir(destination).map(|mut entries| entries.next().is_none()) {
        Ok(true) => Ok(()),
        Ok(false) => Err(in_use),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) if error.kind() == io::ErrorKind::NotADirectory => {
            Err(FileError::NotAFolder { path: destination.to_owned(), remedy: "give the path of a new folder".into() })
        }
        Err(error) => Err(failed("read", destination)(error)),
    }
}

fn write_through<P: AsRef<[u8]>>(path: &Path, parts: impl IntoIterator<Item = P>) -> io::Result<()> {
    let mut file = unless_interrupted(|| {
        fs::create_dir_all(parent(path))?;
        File::create_new(path)
    })?;
    write_all(&mut file, parts)?;
    file.sync_all()
}

fn failed(action: &'static str, path: &Path) -> impl Fn(io::Error) -> FileError {
    move |source| FileError::Io { action, path: path.to_owned(), source }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::testing::{Scratch, assert_report};

    #[test]
    fn a_folder_appears_at_commit_and_not_before() {
        let scratch = Scratch::new();
        let destination = scratch.path().join("stand");
        let folder = OutputFolder::create(&destination).unwrap();
        folder.write("experiment.toml", b"a").unwrap();
        folder.write("records/u050.csv", b"b").unwrap();
        assert!(!destination.exists());
        folder.commit().unwrap();
        assert_eq!(scratch.names(), ["stand"]);
        assert_eq!(fs::read(destination.join("records/u050.csv")).unwrap(), b"b");
        assert_eq!(fs::read(destination.join("experiment.toml")).unwrap(), b"a");
    }

    #[test]
    fn a_name_is_written_once() {
        let scratch = Scratch::new();
        let folder = OutputFolder::create(&scratch.path().join("stand")).unwrap();
        folder.write("a.csv", b"a").unwrap();
        assert_report(folder.write("a.csv", b"b").unwrap_err(), &["stand/a.csv", "exists"]);
    }

    #[test]
    fn a_dropped_folder_leaves_nothing() {
        let scratch = Scratch::new();
        let folder = OutputFolder::create(&scratch.path().join("stand")).unwrap();
        folder.write("a.csv", b"a").unwrap();
        assert_eq!(scratch.names().len(), 1);
        drop(folder);
        assert!(scratch.names().is_empty());
    }

    #[test]
    fn an_empty_destination_is_used() {
        let scratch = Scratch::new();
        let destination = scratch.path().join("stand");
        fs::create_dir(&destination).unwrap();
        let folder = OutputFolder::create(&destination).unwrap();
        folder.write("a.csv", b"a").unwrap();
        folder.commit().unwrap();
        assert_eq!(fs::read(destination.join("a.csv")).unwrap(), b"a");
    }

    #[test]
    fn a_full_destination_is_refused_at_both_ends() {
        let scratch = Scratch::new();
        let destination = scratch.path().join("stand");
        let folder = OutputFolder::create(&destination).unwrap();
        folder.write("a.csv", b"ours").unwrap();
        fs::create_dir(&destination).unwrap();
        fs::write(destination.join("a.csv"), "theirs").unwrap();
        let parts = ["stand", "not empty", "give another folder"];
        assert_report(OutputFolder::create(&destination).unwrap_err(), &parts);
        assert_report(folder.commit().unwrap_err(), &parts);
        assert_eq!(fs::read(destination.join("a.csv")).unwrap(), b"theirs");
        assert_eq!(scratch.names(), ["stand"]);
    }

    #[test]
    fn a_file_as_destination_is_refused() {
        let scratch = Scratch::new();
        let path = scratch.file("stand", "x");
        let error = OutputFolder::create(&path).unwrap_err();
        assert_report(error, &["stand", "is not a folder", "new folder"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_to_an_empty_folder_is_followed() {
        let scratch = Scratch::new();
        let (real, link) = (scratch.path().join("real"), scratch.path().join("link"));
        fs::create_dir(&real).unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        let folder = OutputFolder::create(&link).unwrap();
        folder.write("a.csv", b"a").unwrap();
        folder.commit().unwrap();
        assert!(link.is_symlink());
        assert_eq!(fs::read(real.join("a.csv")).unwrap(), b"a");
        assert_eq!(scratch.names(), ["link", "real"]);
    }

    #[test]
    fn a_destination_without_a_name_is_refused() {
        for destination in [".", "..", "/"] {
            let error = OutputFolder::create(Path::new(destination)).unwrap_err();
            assert_report(error, &[&format!("`{destination}`"), "name of a new folder"]);
        }
    }

    #[test]
    fn a_missing_parent_is_named() {
        let scratch = Scratch::new();
        let error = OutputFolder::create(&scratch.path().join("no/stand")).unwrap_err();
        assert_report(error, &["no/stand", "there is no folder", "create that folder"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_folder_and_its_files_have_ordinary_permissions() {
        use std::os::unix::fs::PermissionsExt;
        let scratch = Scratch::new();
        let destination = scratch.path().join("stand");
        let folder = OutputFolder::create(&destination).unwrap();
        folder.write("a.csv", b"a").unwrap();
        folder.commit().unwrap();
        let ordinary = scratch.path().join("ordinary");
        fs::create_dir(&ordinary).unwrap();
        fs::write(ordinary.join("a.csv"), "a").unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&destination), mode(&ordinary));
        assert_eq!(mode(&destination.join("a.csv")), mode(&ordinary.join("a.csv")));
    }

    #[test]
    fn names_that_leave_the_folder_are_refused() {
        for name in ["a.csv", "a b.csv", "records/a.csv", ".hidden", "..a"] {
            assert!(is_plain_name(name), "{name}");
        }
        for name in ["", ".", "..", "../a.csv", "a/../b", "/a.csv", "./a.csv", "a//b", "a/", "a\\b", "C:a", "a\0b"] {
            assert!(!is_plain_name(name), "{name:?}");
        }
        let scratch = Scratch::new();
        let folder = OutputFolder::create(&scratch.path().join("stand")).unwrap();
        let error = folder.write("../a.csv", b"x").unwrap_err();
        assert_report(error, &["`../a.csv`", "stand", "without `..`"]);
    }
}
