//! The command line of Rotorlead; see `rotorlead --help`.

use std::process::ExitCode;

use clap::Parser;
use rotorlead_sim::command::Arguments;

fn main() -> ExitCode {
    match Arguments::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(report) => {
            eprintln!("{report:?}");
            ExitCode::FAILURE
        }
    }
}
