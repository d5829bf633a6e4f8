//! A file that is complete or absent.

use std::cell::RefCell;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use tempfile::TempPath;

use super::FileError;
use super::interrupt::{forget_folder, make_unfinished, remember_folder, unless_interrupted};

thread_local! {
    /// What each [`all_or_nothing`] that this thread is in has written so far, the innermost last.
    static PENDING: RefCell<Vec<Pending>> = const { RefCell::new(Vec::new()) };
}

/// Files that are complete beside their destinations, and folders that were made for them.
#[derive(Default)]
struct Pending {
    files: Vec<(TempPath, PathBuf)>,
    folders: Vec<PathBuf>,
}

/// Does `act`, whose files ([`write_file`]) get their names together when it succeeds. Where it fails, or one of them finds no
/// room, all that stood in their places stays as it was, and a folder that was made for them ([`make_folder`]) goes again.
///
/// Counts for the thread that calls it alone.
///
/// # Errors
/// Those of `act`, and the operating system's at the end.
pub fn all_or_nothing<T, E: From<FileError>>(act: impl FnOnce() -> Result<T, E>) -> Result<T, E> {
    /// Also when `act` panics: the next one must not find these.
    struct Scope;
    impl Drop for Scope {
        fn drop(&mut self) {
            let pending = PENDING.with_borrow_mut(Vec::pop).unwrap_or_default();
            drop(pending.files);
            pending.folders.iter().for_each(|folder| forget_folder(folder));
        }
    }
    PENDING.with_borrow_mut(|pending| pending.push(Pending::default()));
    let scope = Scope;
    let done = act()?;
    let files = PENDING.with_borrow_mut(|pending| pending.last_mut().map(|pending| std::mem::take(&mut pending.files)));
    unless_interrupted(|| files.unwrap_or_default().into_iter().try_for_each(|(file, target)| persist(file, &target)))?;
    drop(scope);
    Ok(done)
}

/// Makes a folder where it is not there; the one that it stands in has to be. Where nothing comes to be in it, as when the program
/// is interrupted, it goes again.
///
/// # Errors
/// When the operating system refuses.
pub fn make_folder(path: &Path) -> Result<(), FileError> {
    if path.is_dir() {
        return Ok(());
    }
    remember_folder(path, || fs::create_dir(path)).map_err(|source| FileError::Io {
        action: "create",
        path: path.to_owned(),
        source,
    })?;
    PENDING.with_borrow_mut(|pending| {
        if let Some(pending) = pending.last_mut() {
            pending.folders.push(path.to_owned());
        }
    });
    Ok(())
}

/// Writes `bytes` to `path`: beside it first, then renamed over it once they are on the disk.
///
/// Whoever reads `path` sees the old content or the new one, never a part of either. The file gets
/// the permissions that any new file gets (the umask's). A symbolic link is followed. What is no
/// regular file, such as `/dev/stdout` or a pipe, is written to directly.
///
/// # Errors
/// When `path` is a folder, its folder does not exist, or the operating system refuses.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    write_file_parts(path, [bytes])
}

/// [`write_file`] of a file that comes in parts, one after the other.
///
/// # Errors
/// As for [`write_file`].
pub fn write_file_parts<P: AsRef<[u8]>>(path: &Path, parts: impl IntoIterator<Item = P>) -> Result<(), FileError> {
    let failed = failed_to_write(path);
    match fs::metadata(path) {
        Ok(found) if found.is_dir() => Err(FileError::NotAFile { path: path.to_owned() }),
        Ok(found) if found.is_file() => {
            let target = fs::canonicalize(path).map_err(failed)?;
            replace(&target, parts)
        }
        Ok(_) => File::create(path).and_then(|file| write_all(file, parts)).map_err(failed),
        Err(_) => {
            existing_parent(path)?;
            replace(path, parts)
        }
    }
}

/// Refuses what [`write_file`] would refuse, so that it is said before the work and not after it. Nothing stays at or
/// beside `path`.
///
/// # Errors
/// Those of [`write_file`], except for a disk that is full.
pub fn check_writable(path: &Path) -> Result<(), FileError> {
    let failed = failed_to_write(path);
    let target = match fs::metadata(path) {
        Ok(found) if found.is_dir() => return Err(FileError::NotAFile { path: path.to_owned() }),
        Ok(found) if found.is_file() => fs::canonicalize(path).map_err(failed)?,
        Ok(_) => return Ok(()), // Opening a pipe would wait for its reader.
        Err(_) => {
            existing_parent(path)?;
            path.to_owned()
        }
    };
    temporary(&target, 0o666, |builder| builder.tempfile_in(parent(&target))).map(drop).map_err(failed)
}

pub(super) fn write_all<P: AsRef<[u8]>>(mut file: impl Write, parts: impl IntoIterator<Item = P>) -> io::Result<()> {
    parts.into_iter().try_for_each(|part| file.write_all(part.as_ref()))
}

/// Writes a file that gets its name at once, or at the end of the [`all_or_nothing`] that this is in.
fn replace<P: AsRef<[u8]>>(target: &Path, parts: impl IntoIterator<Item = P>) -> Result<(), FileError> {
    let complete = || {
        let mut file = temporary(target, 0o666, |builder| builder.tempfile_in(parent(target)))?;
        write_all(&mut file, parts)?;
        file.as_file().sync_all()?;
        Ok(file.into_temp_path())
    };
    let file = complete().map_err(failed_to_write(target))?;
    let at_once = PENDING.with_borrow_mut(|pending| match pending.last_mut() {
        Some(pending) => {
            pending.files.push((file, target.to_owned()));
            None
        }
        None => Some(file),
    });
    at_once.map_or(Ok(()), |file| unless_interrupted(|| persist(file, target)))
}

/// Gives a complete file its name.
fn persist(file: TempPath, target: &Path) -> Result<(), FileError> {
    file.persist(target).map_err(|error| failed_to_write(target)(error.error))?;
    sync_folder(parent(target));
    Ok(())
}

fn failed_to_write(path: &Path) -> impl Fn(io::Error) -> FileError + Copy {
    move |source| FileError::Io { action: "write", path: path.to_owned(), source }
}

/// The folder in which `path` stands.
pub(super) fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Refuses a path whose folder does not exist: a misspelled path would else grow a tree.
pub(super) fn existing_parent(path: &Path) -> Result<(), FileError> {
    let parent = parent(path);
    if parent.is_dir() {
        Ok(())
    } else {
        Err(FileError::NoParent { path: path.to_owned(), parent: PathBuf::from(parent) })
    }
}

/// Makes a file or folder for what will be renamed to `target`: its name is hidden, and
/// recognizable if the power fails. `mode` is what the umask is applied to; without it a temporary
/// file would be its owner's alone, also after the rename.
pub(super) fn temporary<T: AsRef<Path>>(
    target: &Path,
    mode: u32,
    make: impl FnOnce(&tempfile::Builder<'_, '_>) -> io::Result<T>,
) -> io::Result<T> {
    let mut prefix = OsString::from(".");
    prefix.push(target.file_name().unwrap_or_default());
    prefix.push(".");
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(".part");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(mode));
    #[cfg(not(unix))]
    let _ = mode;
    make_unfinished(|| make(&builder))
}

/// Makes a rename in `folder` last through a power failure, where the system can do that.
/// The rename has happened by then, so a refusal is no failure of the write.
pub(super) fn sync_folder(folder: &Path) {
    let _ = File::open(folder).and_then(|folder| folder.sync_all());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::testing::{Scratch, assert_report};

    #[test]
    fn a_file_replaces_the_old_one_and_leaves_nothing_beside_it() {
        let scratch = Scratch::new();
        let path = scratch.file("model.toml", "old");
        write_file(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(scratch.names(), ["model.toml"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_file_has_the_permissions_of_any_new_file() {
        use std::os::unix::fs::PermissionsExt;
        let scratch = Scratch::new();
        let ours = scratch.path().join("ours");
        write_file(&ours, b"x").unwrap();
        let ordinary = scratch.file("ordinary", "x");
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&ordinary));
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_followed_and_a_device_is_written_to() {
        let scratch = Scratch::new();
        let real = scratch.file("real", "old");
        let link = scratch.path().join("link");
        std::os::unix::fs::symlink(&real, &link).unwrap();
        write_file(&link, b"new").unwrap();
        assert_eq!(fs::read(&real).unwrap(), b"new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        write_file(Path::new("/dev/null"), b"gone").unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
    }

    #[test]
    fn a_folder_as_a_file_is_refused() {
        let scratch = Scratch::new();
        let error = write_file(scratch.path(), b"x").unwrap_err();
        assert_report(error, &["is a folder", "name of a file in it"]);
    }

    #[test]
    fn a_missing_folder_is_named_and_not_made() {
        let scratch = Scratch::new();
        let error = write_file(&scratch.path().join("no/model.toml"), b"x").unwrap_err();
        assert_report(error, &["model.toml", "there is no folder", "create that folder"]);
        assert!(scratch.names().is_empty());
    }

    #[test]
    fn a_bare_name_stands_in_the_current_folder() {
        assert_eq!(parent(Path::new("model.toml")), Path::new("."));
        assert_eq!(parent(Path::new("a/model.toml")), Path::new("a"));
    }
}
