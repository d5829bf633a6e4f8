//! Stored inputs of the fuzzers: beside this crate's `src`, one archive (`.tar.gz`) for each fuzzer.
//!
//! `xtask` and the host tests share it, so that it has few dependencies.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use tar::{Archive, Builder, Header};

/// What went wrong, in words for a person.
pub type Result<T = ()> = std::result::Result<T, String>;

/// Inputs of one fuzzer, each under its file name.
pub type Inputs = BTreeMap<String, Vec<u8>>;

const ENDING: &str = ".tar.gz";

/// Where a fuzzer's archive is.
#[must_use]
pub fn archive(fuzzer: &str) -> PathBuf {
    folder().join(format!("{fuzzer}{ENDING}"))
}

fn folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Names of the fuzzers that have an archive, in their order.
///
/// # Errors
/// When the folder cannot be read.
pub fn fuzzers() -> Result<Vec<String>> {
    let files = list_files(folder())?;
    Ok(files.iter().filter_map(|name| name.strip_suffix(ENDING)).map(str::to_owned).collect())
}

/// A fuzzer's stored inputs, at least one.
///
/// # Errors
/// When the archive is missing, broken or empty.
pub fn read(fuzzer: &str) -> Result<Inputs> {
    let path = archive(fuzzer);
    if !path.is_file() {
        return Err(format!("{}: there is no such file; stored are: {}", path.display(), fuzzers()?.join(", ")));
    }
    read_archive(&path)
}

fn read_archive(path: &Path) -> Result<Inputs> {
    let read = || {
        let mut inputs = Inputs::new();
        for entry in Archive::new(GzDecoder::new(File::open(path)?)).entries()? {
            let mut entry = entry?;
            let name = entry.path()?.display().to_string();
            let mut bytes = Vec::new();
            entry.read_to_end(&mut bytes)?;
            if inputs.insert(name.clone(), bytes).is_some() {
                return Err(io::Error::other(format!("{name} is in it twice")));
            }
        }
        Ok(inputs)
    };
    let inputs = read().map_err(|error| format!("{}: {error}", path.display()))?;
    if inputs.is_empty() { Err(format!("{}: there is no input in it", path.display())) } else { Ok(inputs) }
}

/// Stores the inputs of a fuzzer instead of those that it has.
///
/// # Errors
/// When the archive cannot be written.
pub fn write(fuzzer: &str, inputs: &Inputs) -> Result {
    write_archive(&archive(fuzzer), inputs)
}

/// The same inputs make the same archive: it names no time and no user.
fn write_archive(path: &Path, inputs: &Inputs) -> Result {
    let write = || {
        let mut archive = Builder::new(GzEncoder::new(File::create(path)?, Compression::best()));
        for (name, bytes) in inputs {
            let mut header = Header::new_ustar();
            header.set_mode(0o644);
            header.set_size(bytes.len() as u64);
            archive.append_data(&mut header, name, &bytes[..])?;
        }
        archive.into_inner()?.finish().map(drop)
    };
    write().map_err(|error: io::Error| format!("{}: {error}", path.display()))
}

/// Writes inputs as files of a folder, which has no others then.
///
/// # Errors
/// When the folder cannot be written.
pub fn unpack(inputs: &Inputs, folder: &Path) -> Result {
    let failed = |error: io::Error| format!("{}: {error}", folder.display());
    if folder.exists() {
        fs::remove_dir_all(folder).map_err(failed)?;
    }
    fs::create_dir_all(folder).map_err(failed)?;
    inputs.iter().try_for_each(|(name, bytes)| fs::write(folder.join(name), bytes)).map_err(failed)
}

/// The files of a folder as inputs.
///
/// # Errors
/// When they cannot be read.
pub fn pack(folder: &Path) -> Result<Inputs> {
    let read = |name: String| {
        let file = folder.join(&name);
        let bytes = fs::read(&file).map_err(|error| format!("{}: {error}", file.display()))?;
        Ok((name, bytes))
    };
    list_files(folder)?.into_iter().map(read).collect()
}

/// Names of the files of a folder, in their order.
fn list_files(folder: &Path) -> Result<Vec<String>> {
    let names = || {
        let mut names = Vec::new();
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            if entry.file_type()?.is_file() {
                names.push(entry.file_name().to_string_lossy().into_owned());
            }
        }
        names.sort();
        Ok(names)
    };
    names().map_err(|error: io::Error| format!("{}: {error}", folder.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inputs() -> Inputs {
        [("b", vec![1, 2, 3]), ("a", Vec::new()), ("c", vec![0; 5000])]
            .map(|(name, bytes)| (name.to_owned(), bytes))
            .into()
    }

    #[test]
    fn an_archive_has_what_was_written_and_is_always_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let [first, second] = ["first.tar.gz", "second.tar.gz"].map(|name| folder.path().join(name));
        write_archive(&first, &inputs()).unwrap();
        write_archive(&second, &inputs()).unwrap();
        assert_eq!(read_archive(&first).unwrap(), inputs());
        assert_eq!(fs::read(&first).unwrap(), fs::read(&second).unwrap());
    }

    #[test]
    fn an_empty_or_cut_archive_is_refused_by_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("some.tar.gz");
        write_archive(&file, &Inputs::new()).unwrap();
        assert!(read_archive(&file).unwrap_err().ends_with("some.tar.gz: there is no input in it"));
        write_archive(&file, &inputs()).unwrap();
        let bytes = fs::read(&file).unwrap();
        fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
        assert!(read_archive(&file).unwrap_err().contains("some.tar.gz: "));
    }

    #[test]
    fn a_missing_archive_is_refused_with_the_names_of_those_that_there_are() {
        let error = read("no-such-fuzzer").unwrap_err();
        assert!(error.contains("no-such-fuzzer.tar.gz") && error.contains("settings"), "{error}");
    }

    #[test]
    fn a_folder_gets_the_inputs_and_gives_them_back() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("inner");
        unpack(&[("old".to_owned(), vec![9])].into(), &inner).unwrap();
        unpack(&inputs(), &inner).unwrap();
        assert_eq!(pack(&inner).unwrap(), inputs());
    }
}
