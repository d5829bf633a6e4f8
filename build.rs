//! Tells the library what its core lacks, and the linker where the memories of the application's board are: this only for that
//! board, and not for a firmware that takes the library without it.

use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() {
    println!("cargo:rerun-if-changed=src/board/board.x");
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=src");
    println!("cargo:rustc-env=ROTORLEAD_SOURCES={}", checksum(Path::new("src"), 0x811C_9DC5));
    println!("cargo:rustc-check-cfg=cfg(narrow_multiplier)");
    // The ARMv6-M cores have no product of 64 bits: src/multiply.rs.
    if env::var("TARGET").is_ok_and(|target| target.starts_with("thumbv6m")) {
        println!("cargo:rustc-cfg=narrow_multiplier");
    }
    let is_board = env::var_os("CARGO_FEATURE_STM32F405").is_some();
    if !is_board || env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::write(out.join("board.x"), include_str!("src/board/board.x")).expect("OUT_DIR is writable");
    // The linker looks for memory.x in the folder that cargo runs in, and then here: for a package that was taken from elsewhere.
    fs::write(out.join("memory.x"), include_str!("memory.x")).expect("OUT_DIR is writable");
    println!("cargo:rustc-link-search={}", out.display());
    // The vector table and sections (cortex-m-rt), and the table of log messages (defmt).
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rustc-link-arg-bins=-Tdefmt.x");
    // Sections that must start on a word boundary, whatever their alignment says.
    println!("cargo:rustc-link-arg-bins=--nmagic");
    // `cargo xtask build` reads calls and references from the relocations. They are not part of what is flashed.
    println!("cargo:rustc-link-arg-bins=--emit-relocs");
}

/// FNV-1a over every file of a folder, in the order of their names: what a firmware leaves in memory over a reset is only for one of the
/// same sources.
fn checksum(folder: &Path, start: u32) -> u32 {
    let mut paths: Vec<PathBuf> =
        fs::read_dir(folder).expect("the folder is readable").map(|entry| entry.expect("it is").path()).collect();
    paths.sort();
    paths.iter().fold(start, |hash, path| {
        if path.is_dir() {
            return checksum(path, hash);
        }
        let bytes = fs::read(path).expect("the file is readable");
        bytes.iter().fold(hash, |hash, &byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
    })
}
