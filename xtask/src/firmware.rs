//! The image for the controller: builds it, checks it, and writes it as files for flashing.

use std::path::PathBuf;
use std::process::Command;

use crate::board::{self, Board, Emulator};
use crate::image::{Calls, Function, Image, flash_files};
use crate::run::{Result, beside, cargo, command, output, run};
use crate::sizes::{self, Sizes};
use crate::{emulator, setup};

/// A feature of the firmware that puts an indexing panic into its control task.
pub const PLANTED: &str = "planted-panic";
/// Set, tests write the pages that they hold.
const UPDATE: &str = "ROTORLEAD_UPDATE_PAGES";
/// How probe-rs runs an image, beside the chip. A core that the probe halts in its reset or fault would leave the last pulses running.
pub const PROBE_OPTIONS: [&str; 2] = ["--no-catch-reset", "--no-catch-hardfault"];
/// The test that runs the paper's experiment at every level.
const EVERY_LEVEL: &str = "every_level_of_the_paper";

/// Builds the image, prints its sizes, checks it, and writes the files that flash it.
pub fn build(board: &'static Board) -> Result<Sizes> {
    build_files(board).map(|(sizes, _)| sizes)
}

/// As [`build`], and says which files these are.
pub fn build_files(board: &'static Board) -> Result<(Sizes, [PathBuf; 2])> {
    let path = build_image(board, &[])?;
    let map = &board.flash;
    flash_files::remove(map, &path)?;
    let bytes = std::fs::read(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let image = Image::read(&bytes)?;
    println!("image  {}", path.display());
    println!("flash  {:>7} bytes of {}", image.flash_bytes, map.image_bytes);
    println!("RAM    {:>7} bytes of {}", image.ram_bytes, board.ram().len());
    let stack = stack(board, &image)?;
    no_panic(board, &image)?;
    println!("panics none reachable from {}", board.interrupts().collect::<Vec<_>>().join(", "));
    let files = flash_files::write(map, &bytes, &path, image.stack_start)?;
    println!("bin    {:>7} bytes: {}", files.bin.bytes, files.bin.path.display());
    println!("{:<6} {:>7} bytes: {}", map.form.extension(), files.formed.bytes, files.formed.path.display());
    let sizes = Sizes { flash: image.flash_bytes, ram: image.ram_bytes, stack };
    Ok((sizes, [files.bin.path, files.formed.path]))
}

/// Builds the image for a board and gives its path.
pub fn build_image(board: &'static Board, features: &[&str]) -> Result<PathBuf> {
    let toolchain = setup::toolchain(&board.target)?;
    let all: Vec<&str> = board.feature.as_deref().into_iter().chain(features.iter().copied()).collect();
    let mut build = toolchain.cargo(&["build", "--package", &board.package, "--bin", &board.binary, "--locked"]);
    build.args(["--profile", "firmware", "--features", &all.join(",")]);
    // Variants go to a folder of their own, so that none is ever flashed.
    let folder =
        if features.is_empty() { toolchain.cargo_folder() } else { beside(&mut build, &toolchain.cargo_folder()) };
    run(&mut build)?;
    Ok(folder.join(&board.target).join("firmware").join(&board.binary))
}

/// Runs a board's image in its emulator, with its link on a TCP port of this machine.
pub fn emulate(board: &'static Board, port: &str) -> Result {
    let port = port.parse().map_err(|_| format!("{port} is not a TCP port"))?;
    setup::emulator()?;
    match board.emulator {
        Some(Emulator::Qemu) => emulator::run_image(board, &build_image(board, &[])?, port),
        Some(Emulator::Rp2040js) => {
            let mut pico = cargo(&["run", "--package", "host-tests", "--example", "pico", "--locked", "--"]);
            eprintln!("xtask: the link is at tcp:127.0.0.1:{port}; Ctrl-C ends the emulator");
            run(with_image(pico.arg(port.to_string()), board)?)
        }
        None => Err(format!("no emulator runs the {}", board.name)),
    }
}

/// Flashes the default board's image with a debug probe and shows its log.
pub fn flash() -> Result {
    let board = board::default()?;
    let chip = board.probe_chip.as_ref().ok_or_else(|| format!("no debug probe flashes the {}", board.name))?;
    if output(&mut command("probe-rs", &["--version"])).is_none() {
        return Err("probe-rs is missing: `cargo install probe-rs-tools --locked` installs it".to_owned());
    }
    let path = build_image(board, &[])?;
    run(command("probe-rs", &["run", "--chip", chip]).args(PROBE_OPTIONS).arg(path))
}

/// Writes into each board's page what its image takes.
pub fn state_sizes() -> Result {
    board::all()?.iter().try_for_each(|board| sizes::update(board, build(board)?))
}

/// What `build` checks, what the pages say of sizes, and that the check for panics finds one that is planted.
pub fn check() -> Result {
    for board in board::all()? {
        sizes::check(board, build(board)?)?;
        let panicking = build_image(board, &[PLANTED])?;
        let bytes = std::fs::read(&panicking).map_err(|error| format!("{}: {error}", panicking.display()))?;
        match no_panic(board, &Image::read(&bytes)?) {
            Ok(()) => return Err("the check for panics does not see the one that was planted".to_owned()),
            Err(found) => eprintln!("xtask: as it should, the check finds the planted panic: {found}"),
        }
    }
    Ok(())
}

/// What the images do in the emulators, but for what takes as long at every level of the paper. The tests hold the table of
/// scenarios in `docs/firmware.md`, or with `is_update` write it.
pub fn test(is_update: bool) -> Result {
    let mut tests = in_emulator(&["emulator", "rp2040", "scenarios"], &["--skip", EVERY_LEVEL])?;
    if !is_update {
        return run(&mut tests);
    }
    run(tests.env(UPDATE, "1"))?;
    // What the library alone proves of a row of that table.
    run(cargo(&["test", "--workspace", "--locked", "--test", "controller", "a_power_cut"]).env(UPDATE, "1"))
}

/// The paper's experiment at every level, with the image in the loop.
pub fn every_level() -> Result {
    run(&mut in_emulator(&["emulator"], &[EVERY_LEVEL])?)
}

/// The tests of these targets, with the images.
fn in_emulator(targets: &[&str], options: &[&str]) -> Result<Command> {
    setup::emulator()?;
    // Of the whole workspace, as the other tests are: of one package alone its dependencies would be compiled anew.
    let mut test = cargo(&["test", "--workspace", "--locked"]);
    test.args(targets.iter().flat_map(|target| ["--test", target])).args(["--", "--include-ignored"]);
    // The emulated time does not wait for a machine that is busy with more emulators than it has cores.
    test.args(["--test-threads", "2"]).args(options);
    for board in board::all()?.iter().filter(|board| board.emulator.is_some()) {
        test.env(format!("ROTORLEAD_PANICKING_{}_IMAGE", board.name.to_uppercase()), build_image(board, &[PLANTED])?);
        with_image(&mut test, board)?;
    }
    Ok(test)
}

/// Names a board's image to a program of the tests.
pub fn with_image<'a>(command: &'a mut Command, board: &'static Board) -> Result<&'a mut Command> {
    Ok(command.env(format!("ROTORLEAD_{}_IMAGE", board.name.to_uppercase()), build_image(board, &[])?))
}

/// Everything that ends in a panic goes through here.
fn panics(function: &Function) -> bool {
    function.names.iter().any(|name| name.contains("core::panicking::") || name.contains("rust_begin_unwind"))
}

fn no_panic(board: &Board, image: &Image) -> Result {
    let calls = Calls::from_image(image);
    if !image.functions.iter().any(panics) {
        return Err("the image has no panic handler: the names that this looks for have changed".to_owned());
    }
    for name in board.interrupts() {
        let root = image.function_named(name).ok_or_else(|| format!("the image has no interrupt {name}"))?;
        cannot_panic(&calls, root, name)?;
    }
    Ok(())
}

/// An error where a function can panic, or calls through a pointer, so that nobody knows.
pub fn cannot_panic(calls: &Calls<'_>, root: usize, name: &str) -> Result {
    let indirect = calls.indirect(root);
    if !indirect.is_empty() {
        return Err(format!("{name} calls through pointers, in {}", indirect.join(", ")));
    }
    match calls.path(root, panics) {
        Some(path) => Err(format!("{name} can panic: {}", path.join(" -> "))),
        None => Ok(()),
    }
}

/// Deepest stack: the idle task, and on top of it one interrupt of each priority.
fn stack(board: &Board, image: &Image) -> Result<u64> {
    let calls = Calls::from_image(image);
    let function = |name| image.function_named(name).ok_or_else(|| format!("the image has no function {name}"));
    if !calls.reachable(function("Reset")?).contains(&function("main")?) {
        return Err("the way from Reset to main is not seen, so the stack of all that it calls is not known".to_owned());
    }
    let mut total = 0;
    let above = board.exceptions_above.iter().map(String::as_str);
    for name in ["Reset"].into_iter().chain(board.interrupts()).chain(above) {
        let root = function(name)?;
        // Handlers of faults and panics do not return: they throw the stack away.
        let depth = calls.depth(root, &panics)?;
        let frame = if name == "Reset" { 0 } else { board.interrupt_frame_bytes };
        total += depth.bytes + frame;
        println!("stack  {:>7} bytes for {name}: {}", depth.bytes + frame, depth.path.join(" -> "));
    }
    println!("stack  {total:>7} bytes at worst of {}", image.stack_bytes);
    let total = u64::from(total);
    if total > image.stack_bytes { Err("the stack does not fit".to_owned()) } else { Ok(total) }
}
