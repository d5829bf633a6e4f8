//! What an interrupted program leaves behind: nothing.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

/// Where temporary files and folders were made. Those that were renamed or removed since are no longer there: names are drawn,
/// so that nothing else is.
static MADE: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());
/// Folders that were made for files that have not got their names yet: those that are empty go again.
static FOLDERS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A folder into which another thread was writing is tried so often...
const ATTEMPTS: usize = 50;
/// ...after as long each.
const PAUSE: Duration = Duration::from_millis(10);

/// Makes a temporary file or folder, and remembers it.
pub(super) fn make_unfinished<T: AsRef<Path>>(make: impl FnOnce() -> io::Result<T>) -> io::Result<T> {
    let mut paths = made();
    let temporary = make()?;
    let path = temporary.as_ref();
    // The working directory may be another by then.
    paths.push(std::path::absolute(path).unwrap_or_else(|_| path.to_owned()));
    Ok(temporary)
}

/// Makes a folder for files, and remembers it.
pub(super) fn remember_folder(path: &Path, make: impl FnOnce() -> io::Result<()>) -> io::Result<()> {
    unless_interrupted(|| {
        make()?;
        folders().push(std::path::absolute(path).unwrap_or_else(|_| path.to_owned()));
        Ok(())
    })
}

/// Removes such a folder if nothing came to be in it, and remembers it no more.
pub(super) fn forget_folder(path: &Path) {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    unless_interrupted(|| {
        let _ = fs::remove_dir(&path);
        folders().retain(|known| *known != path);
    });
}

/// Does what must not happen while unfinished files are removed: gives one its name, or makes another.
pub(super) fn unless_interrupted<T>(act: impl FnOnce() -> T) -> T {
    let _paths = made();
    act()
}

/// Removes every temporary file and folder that has not got its name yet. To be called when the program is interrupted, by
/// the thread that then ends it: no other thread gives a file its name any more once this has begun.
pub fn remove_unfinished() {
    let paths = made();
    for path in paths.iter() {
        for _ in 0..ATTEMPTS {
            let removed = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
            match removed {
                Ok(()) => break,
                Err(error) if error.kind() == io::ErrorKind::NotFound => break,
                Err(_) => thread::sleep(PAUSE),
            }
        }
    }
    for folder in folders().iter() {
        // One that is not empty stays.
        let _ = fs::remove_dir(folder);
    }
    // Never unlocked: whoever waits for it is to wait for the end.
    std::mem::forget(paths);
}

fn folders() -> MutexGuard<'static, Vec<PathBuf>> {
    FOLDERS.lock().unwrap_or_else(PoisonError::into_inner)
}

fn made() -> MutexGuard<'static, Vec<PathBuf>> {
    MADE.lock().unwrap_or_else(PoisonError::into_inner)
}
