//! The command line of Rotorlead; see `rotorlead --help`.

use std::io::{IsTerminal as _, Write as _, stderr};
use std::process::ExitCode;

use miette::{MietteHandler, MietteHandlerOpts};
use rotorlead_sim::command::{Arguments, Exit};
use rotorlead_sim::files::remove_unfinished;
use textwrap::{WordSeparator, WordSplitter};

fn main() -> ExitCode {
    miette::set_hook(Box::new(|_| Box::new(reports()))).expect("nothing has set another one before");
    // Where no handler can be set, Ctrl-C ends the program as it does any other.
    let _ = ctrlc::set_handler(|| {
        remove_unfinished();
        std::process::exit(Exit::Interrupted.status().into());
    });
    let result = Arguments::of_command_line().run();
    if let Err(report) = &result {
        // Nobody is left to be told when standard error is closed.
        let _ = writeln!(stderr(), "{report:?}");
    }
    Exit::of(&result).into()
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
