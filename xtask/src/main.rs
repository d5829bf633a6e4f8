//! Set-up, tests and benchmarks of the workspace: `cargo xtask help` lists them.

mod apt;
mod bench;
mod blind;
mod docs;
mod emulator;
mod firmware;
mod image;
mod readme;
mod run;
mod setup;
mod statistics;
mod test;

use std::process::ExitCode;

const HELP: &str = "\
Usage: cargo xtask COMMAND

  setup    installs what the other commands need beside a Rust toolchain
  build    builds the image for the controller; says what flash, RAM and stack it takes, and that it cannot panic;
           with --update-readme writes the former into the README
  emulate  [PORT] runs that image in QEMU, with its link on a TCP port
  flash    flashes that image with a debug probe, and shows its log
  test     every test there is: formatting, lints, documentation, host tests, and the controller's image: its build, its checks,
           its tests in QEMU, its instruction counts
  statistics
           decides at full count what is claimed of estimates: coverage, spread, bias, orders; some hours. REPEATS and CASE
           make it shorter
  bench    measures filters, the simulated stand and identification side by side, in one run;
           with --firmware [--json FILE] instructions on the controller's core, in QEMU;
           with --identify [--largest] [--json FILE] identification alone, from CSV files to a model, beside NumPy and SciPy
           where PYTHON (python3 if not set) has them; --largest goes to 10^8 rows: minutes, and 5 GB in target/
           with --diagnose [--json FILE] a diagnosis with the whole catalog, and how its time grows with the rows
  blind    [--set tune|report] [--kinds A,B] [--seeds N] [--jobs N] [--keep DIR] [--rivals family|all] [--only-ceilings]
           asks `rotorlead diagnose` about cases whose truth it does not see, and scores the answers; the whole report set
           against all rivals writes docs/confusion.md
  docs     writes the catalog of effects into docs/diagnosis.md
  help     prints this
";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match arguments.as_slice() {
        ["setup"] => setup::all(),
        ["build"] => firmware::build().map(drop),
        ["build", "--update-readme"] => firmware::build().and_then(readme::update),
        ["emulate"] => firmware::emulate(emulator::DEFAULT_PORT),
        ["emulate", port] => match port.parse() {
            Ok(port) => firmware::emulate(port),
            Err(_) => Err(format!("{port} is not a TCP port")),
        },
        ["flash"] => firmware::flash(),
        ["test"] => test::all(),
        ["docs"] => docs::write(),
        ["blind", options @ ..] => blind::run_cases(options),
        ["statistics"] => statistics::all(),
        ["bench"] => bench::all(),
        ["bench", "--firmware"] => bench::firmware(None),
        ["bench", "--firmware", "--json", file] => bench::firmware(Some(file)),
        ["bench", "--identify"] => bench::identify(false, None),
        ["bench", "--identify", "--json", file] => bench::identify(false, Some(file)),
        ["bench", "--identify", "--largest"] => bench::identify(true, None),
        ["bench", "--identify", "--largest", "--json", file] => bench::identify(true, Some(file)),

        ["bench", "--diagnose"] => bench::diagnose(None),
        ["bench", "--diagnose", "--json", file] => bench::diagnose(Some(file)),
        ["help" | "--help" | "-h"] | [] => {
            print!("{HELP}");
            return ExitCode::SUCCESS;
        }
        unknown => {
            eprintln!("error: no such command: {}\n\n{HELP}", unknown.join(" "));
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
