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
    // Never unlocked: whoever waits for it is to wait for the end.
    std::mem::forget(paths);
}

fn made() -> MutexGuard<'static, Vec<PathBuf>> {
    MADE.lock().unwrap_or_else(PoisonError::into_inner)
}
