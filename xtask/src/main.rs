//! Set-up, tests and benchmarks of the workspace: `cargo xtask help` lists them.

mod bench;
mod run;
mod setup;
mod test;

use std::process::ExitCode;

const HELP: &str = "\
Usage: cargo xtask COMMAND

  setup    installs what the other commands need beside a Rust toolchain
  test     every test there is: formatting, lints, documentation, host tests, the build for the controller
  bench    measures filters and the simulated stand side by side, in one run
  help     prints this
";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match arguments.as_slice() {
        ["setup"] => setup::all(),
        ["test"] => test::all(),
        ["bench"] => bench::all(),
        ["help" | "--help" | "-h"] | [] => {
            print!("{HELP}");
            return ExitCode::SUCCESS;
        }
        [command, ..] => {
            eprintln!("error: no such command or option: {command}\n\n{HELP}");
            return ExitCode::from(2);
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
