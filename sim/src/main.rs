//! The command line of Rotorlead; see `rotorlead --help`.

use std::io::{IsTerminal as _, Write as _, stderr};
use std::process::ExitCode;

use clap::Parser;
use miette::{MietteHandler, MietteHandlerOpts};
use rotorlead_sim::command::{Arguments, WrongUse};
use textwrap::{WordSeparator, WordSplitter};

fn main() -> ExitCode {
    miette::set_hook(Box::new(|_| Box::new(reports()))).expect("nothing has set another one before");
    match Arguments::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(report) => {
            // Nobody is left to be told when standard error is closed.
            let _ = writeln!(stderr(), "{report:?}");
            if report.is::<WrongUse>() { ExitCode::from(2) } else { ExitCode::FAILURE }
        }
    }
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
