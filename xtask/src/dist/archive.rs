//! Archives that have the same bytes whenever they are made of the same files.

use std::collections::BTreeMap;
use std::io::{Cursor, Write as _};
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use zip::write::SimpleFileOptions;

use super::{names, read};
use crate::run::Result;

/// Files by their names, with `/` between folders.
#[derive(Default)]
pub struct Files(BTreeMap<String, File>);

/// One of them.
struct File {
    bytes: Vec<u8>,
    is_program: bool,
}

impl File {
    const fn mode(&self) -> u32 {
        if self.is_program { 0o755 } else { 0o644 }
    }
}

impl Files {
    /// Adds a file.
    pub fn add(&mut self, name: impl Into<String>, bytes: impl Into<Vec<u8>>) {
        self.0.insert(name.into(), File { bytes: bytes.into(), is_program: false });
    }

    /// Adds a program.
    pub fn add_program(&mut self, name: impl Into<String>, bytes: impl Into<Vec<u8>>) {
        self.0.insert(name.into(), File { bytes: bytes.into(), is_program: true });
    }

    /// Adds what is in a folder, with what is in its folders, below `prefix`.
    pub fn add_folder(&mut self, prefix: &str, folder: &Path) -> Result {
        for name in names(folder)? {
            self.add(format!("{prefix}/{name}"), read(&folder.join(name))?);
        }
        Ok(())
    }

    /// A tar file, compressed by gzip, all in a folder `top`.
    pub fn tar_gz(&self, top: &str) -> Result<Vec<u8>> {
        let failed = |error: std::io::Error| format!("{top}.tar.gz: {error}");
        let mut tar = tar::Builder::new(GzEncoder::new(Vec::new(), Compression::best()));
        for (name, file) in &self.0 {
            let mut header = tar::Header::new_gnu();
            header.set_size(file.bytes.len() as u64);
            header.set_mode(file.mode());
            header.set_mtime(0);
            tar.append_data(&mut header, format!("{top}/{name}"), &file.bytes[..]).map_err(failed)?;
        }
        tar.into_inner().and_then(GzEncoder::finish).map_err(failed)
    }

    /// A zip file, all in a folder `top`.
    pub fn zip(&self, top: &str) -> Result<Vec<u8>> {
        let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
        for (name, file) in &self.0 {
            // Its time of files is 1980, the first that the format has.
            let options = SimpleFileOptions::DEFAULT.unix_permissions(file.mode());
            zip.start_file(format!("{top}/{name}"), options).map_err(|error| format!("{top}.zip: {error}"))?;
            zip.write_all(&file.bytes).map_err(|error| format!("{top}.zip: {error}"))?;
        }
        zip.finish().map(Cursor::into_inner).map_err(|error| format!("{top}.zip: {error}"))
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;

    use flate2::read::GzDecoder;

    use super::Files;

    fn files() -> Files {
        let mut files = Files::default();
        files.add_program("rotorlead", *b"program");
        files.add("man/rotorlead.1", "page".repeat(1000));
        files
    }

    #[test]
    fn a_tar_file_unpacks_to_what_went_in_and_programs_can_be_executed() {
        let packed = files().tar_gz("top").unwrap();
        let mut tar = tar::Archive::new(GzDecoder::new(&packed[..]));
        let mut found = Vec::new();
        for entry in tar.entries().unwrap() {
            let mut entry = entry.unwrap();
            let (path, mode) = (entry.path().unwrap().display().to_string(), entry.header().mode().unwrap());
            let mut text = String::new();
            entry.read_to_string(&mut text).unwrap();
            found.push((path, mode, text));
        }
        let page = ("top/man/rotorlead.1".to_owned(), 0o644, "page".repeat(1000));
        assert_eq!(found, [page, ("top/rotorlead".to_owned(), 0o755, "program".to_owned())]);
    }

    #[test]
    fn a_zip_file_unpacks_to_what_went_in() {
        let packed = files().zip("top").unwrap();
        assert!(packed.len() < 1000);
        let mut zip = zip::ZipArchive::new(std::io::Cursor::new(packed)).unwrap();
        let mut text = String::new();
        zip.by_name("top/rotorlead").unwrap().read_to_string(&mut text).unwrap();
        assert_eq!(text, "program");
        assert_eq!(zip.len(), 2);
    }

    #[test]
    fn the_same_files_make_the_same_bytes() {
        assert_eq!(files().tar_gz("top").unwrap(), files().tar_gz("top").unwrap());
        assert_eq!(files().zip("top").unwrap(), files().zip("top").unwrap());
    }
}
