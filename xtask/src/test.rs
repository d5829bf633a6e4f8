//! Every test there is, in parts that are timed.

use std::fs::File;
use std::process::Command;
use std::time::{Duration, Instant};

use crate::board;
use crate::run::{Result, cargo, command, run, target_folder};
use crate::setup;

/// A step of the tests: what the table of times calls it, and its commands, one after the other.
struct Part {
    name: &'static str,
    commands: Vec<Command>,
}

fn part(name: &'static str, commands: impl IntoIterator<Item = Command>) -> Part {
    Part { name, commands: commands.into_iter().collect() }
}

/// Formatting, lints, documentation, host tests, the library as another firmware takes it, and what the image for the
/// controller shows of itself. Changes nothing on the machine, and says what is missing; with `is_setup` installs that first.
pub fn all(is_setup: bool) -> Result {
    if is_setup {
        setup::all()?
    } else {
        setup::check()?
    };
    let mut times = Times::default();
    let result = times.all();
    times.print();
    result
}

/// How much of what a failed part printed is shown with its error.
const LAST_LINES: usize = 20;

/// What an edit is tried with: formatting, lints, the unit tests, the controller's tests and those of the command line but for the
/// browser's.
pub fn quick() -> Result {
    let mut times = Times::default();
    let mut tests = tests();
    tests.args(["--lib", "--bins", "--test", "controller", "--test", "cli"]);
    tests.args(["--", "--skip", "reports::"]);
    let result = [format(), lints(), part("unit, controller and command-line tests", [tests])]
        .into_iter()
        .try_for_each(|part| times.alone(part));
    times.print();
    result
}

fn format() -> Part {
    part("format", [cargo(&["fmt", "--all", "--check"])])
}

fn lints() -> Part {
    part("lints", [cargo(&["clippy", "--workspace", "--all-targets", "--locked", "--", "-D", "warnings"])])
}

/// The tests of the whole workspace, all that fail: of one package alone its dependencies would have other features, and be compiled anew.
fn tests() -> Command {
    cargo(&["test", "--workspace", "--locked", "--no-fail-fast"])
}

/// This program with other arguments.
fn xtask(argument: &str) -> Command {
    let program = std::env::current_exe().unwrap_or_else(|_| "xtask".into());
    command(&program.to_string_lossy(), &[argument])
}

/// How long each part took, in the order in which they ended.
#[derive(Default)]
struct Times {
    parts: Vec<(&'static str, Duration)>,
    whole: Duration,
}

impl Times {
    fn all(&mut self) -> Result {
        self.alone(format())?;
        let mut build = tests();
        build.arg("--no-run");
        self.alone(part("build of the tests", [build]))?;
        let mut pages = cargo(&["doc", "--workspace", "--no-deps", "--locked"]);
        pages.env("RUSTDOCFLAGS", "-D warnings");
        let emulated = board::all()?.iter().filter(|board| board.emulator.is_some());
        let costs = emulated.map(|board| {
            let mut cost = xtask("bench");
            cost.args(["--firmware", "--board", &board.name]);
            cost
        });
        let [mut c_sizes, mut c_counts] = [xtask("build"), xtask("bench")];
        c_sizes.arg("--c");
        c_counts.arg("--c");
        let last = [
            pages,
            xtask("book"),
            xtask("deny"),
            xtask("packages"),
            xtask("semver"),
            xtask("library"),
            xtask("check-image"),
            c_sizes,
            c_counts,
        ];
        let checks = lints().commands.into_iter().chain(last).chain(costs);
        self.beside([
            part("host tests", [tests()]),
            part("Python package and web page", [xtask("python"), xtask("web")]),
            part("lints, documentation, library, image and instruction counts", checks),
        ])?;
        // Alone: the emulated time does not wait for a busy machine.
        let mut serial = xtask("web");
        serial.arg("--serial");
        self.alone(part("emulator", [xtask("test-image"), serial]))
    }

    /// Runs a part with what it prints for all to see.
    fn alone(&mut self, part: Part) -> Result {
        let start = Instant::now();
        let result = part.commands.into_iter().try_for_each(|mut command| run(&mut command));
        self.add(part.name, start.elapsed());
        self.whole += start.elapsed();
        result
    }

    /// Runs parts at the same time. Each prints into a file, which is shown when it has ended. All end, also where one fails.
    fn beside<const N: usize>(&mut self, parts: [Part; N]) -> Result {
        let start = Instant::now();
        let (sender, ended) = std::sync::mpsc::channel();
        std::thread::scope(|scope| {
            for part in parts {
                let sender = sender.clone();
                scope.spawn(move || {
                    let (name, start) = (part.name, Instant::now());
                    let result = into_file(part);
                    // The receiver is there until all have ended.
                    let _ = sender.send((name, start.elapsed(), result));
                });
            }
            drop(sender);
            let mut failed = Vec::new();
            for (name, time, result) in ended {
                println!("== {name}, {:.0} s", time.as_secs_f64());
                match result {
                    Ok(printed) => print!("{printed}"),
                    Err((printed, error)) => {
                        print!("{printed}");
                        // Once more at the end, where it is looked for.
                        let lines: Vec<_> = printed.lines().collect();
                        let end = lines[lines.len().saturating_sub(LAST_LINES)..].join("\n");
                        failed.push(format!("{name}: {error}\n{end}"));
                    }
                }
                self.add(name, time);
            }
            self.whole += start.elapsed();
            if failed.is_empty() { Ok(()) } else { Err(failed.join("\n")) }
        })
    }

    fn add(&mut self, name: &'static str, time: Duration) {
        self.parts.push((name, time));
    }

    fn print(&self) {
        println!("\n     s  part");
        for (name, time) in &self.parts {
            println!("{:>6.0}  {name}", time.as_secs_f64());
        }
        println!("{:>6.0}  in all", self.whole.as_secs_f64());
    }
}

/// Runs a part's commands and gives what they print, beside the error where one fails.
fn into_file(part: Part) -> std::result::Result<String, (String, String)> {
    let path = target_folder().join("test").join(format!("{}.txt", part.name.replace(' ', "-")));
    let failed = |error: std::io::Error| (String::new(), format!("{}: {error}", path.display()));
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(failed)?;
    }
    let file = File::create(&path).map_err(failed)?;
    let mut result = Ok(());
    for mut command in part.commands {
        command.stdout(file.try_clone().map_err(failed)?).stderr(file.try_clone().map_err(failed)?);
        result = run(&mut command);
        if result.is_err() {
            break;
        }
    }
    let printed = String::from_utf8_lossy(&std::fs::read(&path).map_err(failed)?).into_owned();
    result.map(|()| printed.clone()).map_err(|error| (printed, error))
}
