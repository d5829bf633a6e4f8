//! The command line of Rotorlead; see `rotorlead --help`.

use std::io::{IsTerminal as _, Write as _, stderr};
use std::process::ExitCode;

use miette::{MietteHandler, MietteHandlerOpts};
use rotorlead_records::files::{PrintableReports, remove_unfinished};
use textwrap::{WordSeparator, WordSplitter};

use rotorlead_cli::{Arguments, Exit};

fn main() -> ExitCode {
    miette::set_hook(Box::new(|_| Box::new(PrintableReports(reports())))).expect("nothing has set another one before");
    clean_up_when_interrupted();
    work_alone_where_no_thread_can_start();
    let result = Arguments::from_command_line().and_then(Arguments::run);
    if let Err(report) = &result {
        // Nobody is left to read it when standard error is closed.
        let _ = writeln!(stderr(), "{report:?}");
    }
    Exit::from_result(&result).into()
}

/// Has what asks the program to end remove what is unfinished. Where no handler can be set, it ends the program as it does any other.
#[cfg(unix)]
fn clean_up_when_interrupted() {
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;

    use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGXFSZ};
    // The limit on a file's size is then an error of the write, as a full disk is.
    let _ = signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)));
    let ends = [SIGINT, SIGQUIT, SIGTERM].into_iter().chain((!is_ignored(SIGHUP)).then_some(SIGHUP));
    let Ok(mut signals) = signal_hook::iterator::Signals::new(ends) else { return };
    let wait = move || match signals.forever().next() {
        Some(SIGTERM) => end(Exit::Terminated),
        Some(SIGHUP) => end(Exit::HungUp),
        Some(SIGQUIT) => end(Exit::Quit),
        _ => end(Exit::Interrupted),
    };
    let _ = std::thread::Builder::new().spawn(wait);
}

/// Whether the program was started so that this signal does not end it, as `nohup` does. No, where the system does not say.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or_default();
    mask & (1 << (signal - 1)) != 0
}

/// Has Ctrl-C remove what is unfinished. Where no handler can be set, it ends the program as it does any other.
#[cfg(not(unix))]
fn clean_up_when_interrupted() {
    let _ = ctrlc::set_handler(|| end(Exit::Interrupted));
}

/// Has this thread do all work where the system has no thread left for others, which would else be a panic.
fn work_alone_where_no_thread_can_start() {
    // A pool for all is made once, whatever becomes of it: another one is tried first.
    if rayon::ThreadPoolBuilder::new().build().is_err() {
        let _ = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
    }
}

fn end(exit: Exit) -> ! {
    remove_unfinished();
    std::process::exit(exit.status().into())
}

/// Reports as wide as the terminal, and unwrapped where there is none: what goes to a file is searched by lines.
/// Lines break at spaces alone, so that a path can be copied. Colors are for terminals, unless the environment asks.
fn reports() -> MietteHandler {
    MietteHandlerOpts::new()
        .wrap_lines(stderr().is_terminal())
        .break_words(false)
        .word_separator(WordSeparator::AsciiSpace)
        .word_splitter(WordSplitter::NoHyphenation)
        .build()
}
