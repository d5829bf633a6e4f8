//! Puts the web page into the program, where `ROTORLEAD_WEB` names the folder that `cargo xtask build --web` made of it.

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::GzEncoder;

fn main() {
    println!("cargo::rerun-if-env-changed=ROTORLEAD_WEB");
    println!("cargo::rerun-if-changed=build.rs");
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo says it"));
    let mut list = String::from("&[");
    if let Some(folder) = std::env::var_os("ROTORLEAD_WEB") {
        println!("cargo::rerun-if-changed={}", Path::new(&folder).display());
        for (name, path) in files(Path::new(&folder)) {
            let packed = format!("{name}.gz");
            fs::write(out.join(&packed), gzip(&path)).expect("cargo's folder takes files");
            write!(list, "({name:?}, include_bytes!({packed:?})),").expect("a string takes all");
        }
    }
    list.push(']');
    fs::write(out.join("web_files.rs"), list).expect("cargo's folder takes files");
}

/// The files of a folder, sorted by name.
fn files(folder: &Path) -> Vec<(String, PathBuf)> {
    let entries = fs::read_dir(folder).unwrap_or_else(|error| panic!("ROTORLEAD_WEB, {}: {error}", folder.display()));
    let paths = entries.map(|entry| entry.expect("a folder lists its files").path());
    let mut files: Vec<(String, PathBuf)> =
        paths.map(|path| (path.file_name().unwrap_or_default().to_string_lossy().into_owned(), path)).collect();
    files.sort();
    files
}

fn gzip(path: &Path) -> Vec<u8> {
    let bytes = fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut packed = GzEncoder::new(Vec::new(), Compression::best());
    packed.write_all(&bytes).expect("memory takes all");
    packed.finish().expect("memory takes all")
}
