//! `--figures`: the numbers behind tables and figures, as CSV.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::files::{FileError, check_writable, write_file};
use crate::identify::RecordValidation;
use crate::report::validation_csv;

/// Where the numbers go.
#[derive(Args, Debug)]
pub struct FiguresOption {
    /// Also write the numbers behind the paper's Table 2, Fig. 6 and Fig. 7 as CSV into this folder, which is made where
    /// it is not there
    #[arg(long = "figures", value_name = "DIR")]
    figures: Option<PathBuf>,
}

impl FiguresOption {
    /// Refuses a folder that cannot be made, before any work is done.
    pub fn check(&self) -> Result<(), FileError> {
        self.figures.as_deref().map_or(Ok(()), check_folder)
    }

    /// Writes the files, and says where they are.
    pub fn write(&self, records: &[RecordValidation]) -> Result<String, FileError> {
        let Some(folder) = &self.figures else { return Ok(String::new()) };
        make_folder(folder)?;
        let files = validation_csv(records);
        for (name, csv) in &files {
            write_file(&folder.join(name), csv.as_bytes())?;
        }
        Ok(format!("\nTable 2 and the data of Figs. 6 and 7: {} files in {}\n", files.len(), folder.display()))
    }
}

/// Refuses a folder that cannot be made, before the work.
pub fn check_folder(path: &Path) -> Result<(), FileError> {
    if path.is_dir() {
        Ok(())
    } else if path.exists() {
        Err(FileError::NotAFolder { path: path.to_owned(), remedy: "give the path of a folder" })
    } else {
        check_writable(path)
    }
}

/// Makes a folder where it is not there; the one that it stands in has to be.
pub fn make_folder(path: &Path) -> Result<(), FileError> {
    let failed = |source| FileError::Io { action: "create", path: path.to_owned(), source };
    std::fs::create_dir_all(path).map_err(failed)
}
