//! Tells the linker where the memories of the RP2040 are. Does nothing on a host.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    println!("cargo:rerun-if-changed=board.x");
    println!("cargo:rerun-if-changed=build.rs");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::write(out.join("board.x"), include_str!("board.x")).expect("OUT_DIR is writable");
    println!("cargo:rustc-link-search={}", out.display());
    // The vector table and sections (cortex-m-rt), and the table of log messages (defmt).
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rustc-link-arg-bins=-Tdefmt.x");
    // Sections that must start on a word boundary, whatever their alignment says.
    println!("cargo:rustc-link-arg-bins=--nmagic");
    // `cargo xtask build` reads calls and references from the relocations. They are not part of what is flashed.
    println!("cargo:rustc-link-arg-bins=--emit-relocs");
}
