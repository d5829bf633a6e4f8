//! What `dist` made, as a user installs it: each in a home of its own with nothing in it, and run on a sample there.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use tempfile::TempDir;

use super::{folder, names, program, read, version};
use crate::packages;
use crate::run::{Result, path_with, root};

/// What is typed first with a program that has just been installed.
const FIRST: [&[&str]; 4] = [
    &["--version"],
    &["sample", "staircase"],
    &["identify", "staircase.csv", "--out", "model.toml"],
    &["design", "model.toml", "--out", "compensator.toml"],
];

/// What the Python package is tried on, and how.
const SAMPLE: &str = "sim/cli/samples/staircase.csv";
const EXAMPLE: &str = "python/example.py";
const IDENTIFY: &str =
    "import rotorlead; print(rotorlead.identify(rotorlead.Records.from_log('staircase.csv')).headline)";

/// From the packages for a registry, from the archive, and from the wheel.
pub fn run() -> Result {
    let folder = folder();
    let names = names(&folder).map_err(|error| format!("{error}: `cargo xtask dist` makes it"))?;
    let named = |end: &str| {
        let found = names.iter().find(|name| name.ends_with(end)).map(|name| folder.join(name));
        found.ok_or_else(|| format!("{}: nothing that ends in {end}: `cargo xtask dist` makes it", folder.display()))
    };
    archive(&named(&format!("{}.tar.gz", program::host()?))?)?;
    python("wheel", &named(".whl")?)?;
    python("Python sources", &named(&format!("rotorlead-{}.tar.gz", version()?))?)?;
    from_packages(&folder.join("crates"))
}

/// A user's machine.
struct Home {
    folder: TempDir,
    /// Where programs are found first.
    programs: PathBuf,
}

impl Home {
    /// One with nothing in it, but for a folder of programs that is named from it.
    fn new(title: &str, programs: &str) -> Result<Self> {
        println!("== {title}");
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let programs = folder.path().join(programs);
        Ok(Self { folder, programs })
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Runs a command as a transcript shows it, and says how long it took.
    fn run(&self, name: &str, arguments: &[&str]) -> Result {
        let line = std::iter::once(name).chain(arguments.iter().copied()).collect::<Vec<_>>().join(" ");
        println!("$ {line}");
        let start = Instant::now();
        // Looked for here: the path of this process would be searched else.
        let own = self.programs.join(name);
        let status = self.command(if own.exists() { &own } else { Path::new(name) }).args(arguments).status();
        let status = status.map_err(|error| format!("{name}: {error}"))?;
        println!("# {:.1} s", start.elapsed().as_secs_f64());
        if status.success() { Ok(()) } else { Err(format!("{line} ended with {status}")) }
    }

    /// A program that finds in this home what it would find in a user's.
    fn command(&self, program: &Path) -> Command {
        let mut command = Command::new(program);
        command.current_dir(self.path()).env("HOME", self.path()).env("CARGO_HOME", self.path().join(".cargo"));
        command.env("PATH", path_with(&self.programs)).env_remove("CARGO_TARGET_DIR");
        command
    }

    fn first(&self) -> Result {
        FIRST.iter().try_for_each(|arguments| self.run("rotorlead", arguments))
    }
}

/// The program out of the archive.
fn archive(path: &Path) -> Result {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let top = name.trim_end_matches(".tar.gz");
    let home = Home::new("archive", top)?;
    home.run("tar", &["xzf", &path.to_string_lossy()])?;
    home.run("ls", &[top])?;
    home.first()
}

/// The Python package, in an environment of its own.
fn python(title: &str, path: &Path) -> Result {
    let home = Home::new(title, "venv/bin")?;
    home.run("python3", &["-m", "venv", "venv"])?;
    home.run("pip", &["install", "--quiet", &path.to_string_lossy(), "matplotlib"])?;
    for file in [SAMPLE, EXAMPLE] {
        let from = root().join(file);
        let to = home.path().join(from.file_name().unwrap_or_default());
        fs::copy(from, to).map_err(|error| format!("{file}: {error}"))?;
    }
    home.run("python", &["-c", IDENTIFY])?;
    home.run("python", &["example.py", "figure.png"])
}

/// The program, compiled from the packages as `cargo install` does it from a registry.
fn from_packages(folder: &Path) -> Result {
    let home = Home::new("packages", ".cargo/bin")?;
    let (mut manifest, mut patches) = (None, String::from("[patch.crates-io]\n"));
    for name in names(folder)? {
        let name = name.trim_end_matches(".crate");
        let package = home.path().join("packages").join(name);
        let package = packages::unpack(&read(&folder.join(format!("{name}.crate")))?, &package)?.display().to_string();
        let package_name = name.rsplit_once('-').map_or(name, |(package_name, _)| package_name);
        if package_name == program::PACKAGE {
            manifest = Some(package);
        } else {
            patches += &format!("{package_name}.path = {package:?}\n");
        }
    }
    let manifest = manifest.ok_or_else(|| format!("{}: no {}", folder.display(), program::PACKAGE))?;
    // In the place of the registry, for what no registry has.
    let settings = home.path().join(".cargo");
    fs::create_dir_all(&settings)
        .and_then(|()| fs::write(settings.join("config.toml"), patches))
        .map_err(|error| format!("{}: {error}", settings.display()))?;
    home.run("rustc", &["--version"])?;
    home.run("cargo", &["install", "--path", &manifest])?;
    home.first()
}
