//! Figures that compare: everything in one table comes from one run.

mod application;
mod cycles;
mod diagnose;
mod filters;
mod host;
mod inputs;
pub mod machine;
mod process;
mod report;
mod rp2040;
pub mod trace;

use std::path::{Path, PathBuf};

use crate::board::{Board, Emulator};
use crate::image::Image;
use crate::run::{Result, cargo, run};
use crate::{firmware, setup};

pub use diagnose::diagnose;
pub use host::identify;

/// The filter beside its peers, the simulated stand, and identification beside its peers.
pub fn all() -> Result {
    run(&mut cargo(&["bench", "--package", "host-tests", "--bench", "filter", "--locked"]))?;
    run(&mut cargo(&["bench", "--package", "rotorlead-plant", "--bench", "plant", "--locked"]))?;
    identify(false, None)
}

/// What the image costs on a board's core: in rp2040js cycles of its handlers, and in QEMU instructions of its interrupts, and of the
/// filter beside its peers.
pub fn firmware(board: &'static Board, json: Option<&str>) -> Result {
    let missed = match board.emulator {
        Some(Emulator::Rp2040js) => {
            let report = rp2040::measure(board)?;
            say(&report, &report.json(), json)?;
            report.missed()
        }
        Some(Emulator::Qemu) => {
            let report = measure(board)?;
            say(&report, &report.json(), json)?;
            report.missed()
        }
        None => return Err(format!("nothing emulates the {}", board.name)),
    };
    // The figures must hold what is said of them.
    if missed.is_empty() { Ok(()) } else { Err(missed.join("\n")) }
}

/// Prints a table, and writes its numbers to a file; with `-` these go to standard output and nothing else does.
fn say(table: &impl std::fmt::Display, numbers: &serde_json::Value, json: Option<&str>) -> Result {
    if json != Some("-") {
        print!("{table}");
    }
    match json {
        Some("-") => println!("{numbers:#}"),
        Some(file) => std::fs::write(file, format!("{numbers:#}\n")).map_err(|error| format!("{file}: {error}"))?,
        None => {}
    }
    Ok(())
}

fn measure(board: &'static Board) -> Result<report::Report> {
    let path = firmware::build_image(board, &[])?;
    let interrupts = with_image(&path, |image| application::measure(&path, image))?;
    let path = build_filters()?;
    let filters = with_image(&path, |image| filters::measure(&path, image))?;
    Ok(report::Report { filters, interrupts })
}

fn with_image<T>(path: &Path, measure: impl FnOnce(&Image) -> Result<T>) -> Result<T> {
    let bytes = std::fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
    measure(&Image::read(&bytes)?)
}

/// Builds the image with the filters, as the application is built.
fn build_filters() -> Result<PathBuf> {
    let toolchain = setup::target()?;
    let mut build = toolchain.cargo(&["build", "--package", "firmware-bench", "--locked", "--profile", "firmware"]);
    run(&mut build)?;
    Ok(toolchain.folder().join("firmware").join("firmware-bench"))
}
