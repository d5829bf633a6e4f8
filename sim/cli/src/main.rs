//! The command line of Rotorlead; see `rotorlead --help`.

use std::io::{IsTerminal as _, Write as _, stderr};
use std::process::ExitCode;

use miette::{MietteHandler, MietteHandlerOpts};
use rotorlead_records::files::remove_unfinished;
use textwrap::{WordSeparator, WordSplitter};

use rotorlead_cli::{Arguments, Exit};

fn main() -> ExitCode {
    miette::set_hook(Box::new(|_| Box::new(reports()))).expect("nothing has set another one before");
    clean_up_when_interrupted();
    let result = Arguments::of_command_line().and_then(Arguments::run);
    if let Err(report) = &result {
        // Nobody is left to read it when standard error is closed.
        let _ = writeln!(stderr(), "{report:?}");
    }
    Exit::of(&result).into()
}

/// Has Ctrl-C and SIGTERM remove what is unfinished. Where no handler can be set, they end the program as they do any other.
#[cfg(unix)]
fn clean_up_when_interrupted() {
    use signal_hook::consts::{SIGINT, SIGTERM};
    let Ok(mut signals) = signal_hook::iterator::Signals::new([SIGINT, SIGTERM]) else { return };
    let wait = move || match signals.forever().next() {
        Some(SIGTERM) => end(Exit::Terminated),
        _ => end(Exit::Interrupted),
    };
    let _ = std::thread::Builder::new().spawn(wait);
}

/// Has Ctrl-C remove what is unfinished. Where no handler can be set, it ends the program as it does any other.
#[cfg(not(unix))]
fn clean_up_when_interrupted() {
    let _ = ctrlc::set_handler(|| end(Exit::Interrupted));
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
