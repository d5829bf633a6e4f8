//! Reading and writing files: text with located errors, output that is complete or absent.
//!
//! Reading ([`TextFile`], [`TomlFile`]) keeps the text, so that whatever is wrong with it, now or
//! when its values are checked later, is shown where it stands. Of a file that is too long to keep, `TextBlocks` gives
//! one part after the other, which know their line numbers. Writing ([`write_file`],
//! [`OutputFolder`]) happens beside the destination and is renamed when it is complete: a run that
//! fails half way leaves nothing that could be taken for a result.
//!
//! A rule on values is written once, as a function that returns a [`Fault`]: reading shows the
//! fault in the file's text, writing refuses with it before anything is written.

mod accepted_range;
mod blocks;
mod checksum;
pub mod csv_rows;
mod did_you_mean;
mod error;
mod excerpt;
mod fault;
mod folder;
mod input_folder;
mod interrupt;
mod mat5;
mod printable;
mod text;
mod toml_file;
mod write;

#[cfg(any(test, feature = "testing"))]
#[doc(hidden)]
pub mod testing;

pub use accepted_range::{AcceptedRange, shown, shown_to};
pub(crate) use blocks::TextBlocks;
pub use checksum::{checksum, checksum_of, checksum_of_files};
pub use did_you_mean::did_you_mean;
pub use error::{FileError, Located};
pub use excerpt::Excerpt;
pub use fault::{Fault, KeyPath};
pub use folder::{OutputFolder, is_plain_name};
pub use input_folder::{FilesInMemory, InputFolder};
pub use interrupt::remove_unfinished;
pub use mat5::{MAT5_HEAD, MatVariable, mat5};
pub use printable::{PrintableReport, PrintableReports, is_order, printable, printable_line};
pub use text::{TextFile, bytes_read};
pub use toml_file::{TomlFile, to_toml, write_toml};
pub use write::{all_or_nothing, check_writable, make_folder, write_file, write_file_parts};
