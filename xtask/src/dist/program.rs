//! The program for one target, with the page in it, and what belongs to it in a folder of a system.

use std::path::{Path, PathBuf};

use super::archive::Files;
use super::{licenses, read, write};
use crate::python_environment::DIST;
use crate::run::{Result, beside, cargo, command, output, root, run, target_folder, without_folders};

/// The package, and the program in it.
pub const PACKAGE: &str = "rotorlead-cli";
const PROGRAM: &str = "rotorlead";
/// Targets that zig links from any system, and what it calls them: with the oldest glibc that both Rust and it know.
const LINKED_BY_ZIG: [(&str, &str); 3] = [
    ("x86_64-unknown-linux-gnu", "x86_64-unknown-linux-gnu.2.17"),
    ("aarch64-unknown-linux-gnu", "aarch64-unknown-linux-gnu.2.17"),
    ("x86_64-pc-windows-gnu", "x86_64-pc-windows-gnu"),
];
/// What stands beside the program, from the root of the sources.
const PAGES: [&str; 5] = ["README.md", "LICENSE", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md"];
/// The pages that they lead to.
const DOCUMENTATION: &str = "docs";
/// Shells, and where the script of each is looked for.
const COMPLETIONS: [(&str, &str); 5] = [
    ("bash", "rotorlead.bash"),
    ("elvish", "rotorlead.elv"),
    ("fish", "rotorlead.fish"),
    ("powershell", "_rotorlead.ps1"),
    ("zsh", "_rotorlead"),
];

/// Puts the archive for a target into a folder, with the page of that folder in the program.
pub fn archive(target: &str, version: &str, page: &Path, into: &Path) -> Result {
    let program = build(target, page)?;
    let is_windows = target.contains("windows");
    let mut files = Files::default();
    files.add_program(if is_windows { "rotorlead.exe" } else { PROGRAM }, read(&program)?);
    for name in PAGES {
        files.add(name, read(&root().join(name))?);
    }
    files.add_folder(DOCUMENTATION, &root().join(DOCUMENTATION))?;
    files.add("THIRD-PARTY.txt", [licenses::texts(PACKAGE, target)?, licenses::asset_texts()?].concat());
    // What the program says of itself is the same on every target.
    let program = if target == host()? { program } else { debug_program()? };
    for (shell, file) in COMPLETIONS {
        let script = output(&mut command(&program.to_string_lossy(), &["completions", shell]));
        files.add(format!("completions/{file}"), script.ok_or_else(|| format!("no completions for {shell}"))?);
    }
    let pages = tempfile::tempdir().map_err(|error| error.to_string())?;
    run(command(&program.to_string_lossy(), &["--quiet", "man", "--out"]).arg(pages.path()))?;
    files.add_folder("man", pages.path())?;

    let top = format!("{PROGRAM}-{version}-{target}");
    let (end, bytes) = if is_windows { ("zip", files.zip(&top)?) } else { ("tar.gz", files.tar_gz(&top)?) };
    write(&into.join(format!("{top}.{end}")), &bytes)
}

/// Builds the program, with zig as the linker where that has the target, and gives its file.
fn build(target: &str, page: &Path) -> Result<PathBuf> {
    let zig = LINKED_BY_ZIG.iter().find(|(name, _)| *name == target);
    let arguments = ["--release", "--locked", "--package", PACKAGE, "--bin", PROGRAM, "--target"];
    let mut build = match zig {
        Some((_, name)) => {
            let mut build = DIST.tool("cargo-zigbuild", &["zigbuild"]);
            build.args(arguments).arg(name);
            DIST.on_path(&mut build);
            build
        }
        None => {
            let mut build = cargo(&["build"]);
            build.args(arguments).arg(target);
            build
        }
    };
    // The page is in this one alone.
    let folder = beside(build.env("ROTORLEAD_WEB", page), &target_folder().join("dist-build"));
    run(without_folders(&mut build))?;
    let name = if target.contains("windows") { "rotorlead.exe" } else { PROGRAM };
    Ok(folder.join(target).join("release").join(name))
}

/// The target of this machine.
pub fn host() -> Result<String> {
    let printed = output(&mut command("rustc", &["--print", "host-tuple"]));
    Ok(printed.ok_or("rustc does not say its host")?.trim().to_owned())
}

/// A program for this machine that says what another target's would.
fn debug_program() -> Result<PathBuf> {
    run(&mut cargo(&["build", "--locked", "--package", PACKAGE, "--bin", PROGRAM]))?;
    Ok(target_folder().join("debug").join(format!("{PROGRAM}{}", std::env::consts::EXE_SUFFIX)))
}
