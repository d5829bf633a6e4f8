//! The command line: one file per command, which reads what it is given, calls one module of this crate, and says what
//! came out, for people and as JSON.

mod bandwidth;
mod demo;
mod design;
mod device;
mod diagnose;
mod diagnose_bandwidths;
mod excite;
mod help_pages;
mod identify;
mod identify_align;
mod identify_intervals;
mod identify_laws;
mod identify_map;
mod identify_stand;
mod identify_tables;
mod import;
mod outcome;
mod parameters;
mod progress;
mod redesign;
mod report;
mod report_option;
mod report_pages;
mod simulate;
mod validate;
mod wrong_use;

use std::path::Path;

use clap::{Parser, Subcommand};

pub use self::help_pages::{HelpPage, help_pages};
use self::outcome::{JsonOption, Outcome};
use self::report_option::ReportOption;
pub use self::wrong_use::WrongUse;

/// Identifies the lag of a motor with its propeller from thrust-stand records, designs the lead compensator that
/// speeds it up, and tests the very filter that flies on simulated actuators.
#[derive(Debug, Parser)]
#[command(name = "rotorlead", version, max_term_width = 100, after_help = AFTER_HELP)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
}

const AFTER_HELP: &str = "\
From a log to a compensator:
  rotorlead import   LOG --out stand           a log of a thrust stand becomes an experiment
  rotorlead identify stand --out model.toml    the lag at each level
  rotorlead design   --model model.toml --out compensator.toml

Exit status: 0 done, 1 failed, 2 wrong use.";

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::Demo),
    Excite(excite::Excite),
    Simulate(simulate::Simulate),
    Import(import::Import),
    Identify(identify::Identify),
    Validate(validate::Validate),
    Design(design::Design),
    Bandwidth(bandwidth::Bandwidth),
    Diagnose(diagnose::Diagnose),
    Report(report::ReportCommand),
    Device(device::Device),
}

impl Arguments {
    /// Runs the command that was asked for and prints what it says.
    ///
    /// # Errors
    /// A report for a person: what is wrong, where, and what to do. A [`WrongUse`] where options do not go together.
    pub fn run(self) -> miette::Result<()> {
        match self.command {
            Command::Demo(command) => say(&command.json, Some(&command.out), Some(&command.report), || command.run()),
            Command::Excite(command) => {
                say(&command.json, command.out.as_deref(), Some(&command.report), || command.run())
            }
            Command::Simulate(command) => {
                say(&command.json, Some(&command.out), Some(&command.report), || command.run())
            }
            Command::Import(command) => say(&command.json, Some(&command.out), None, || command.run()),
            Command::Identify(command) => {
                say(&command.json, Some(&command.out), Some(&command.report), || command.run())
            }
            Command::Validate(command) => say(&command.json, None, Some(&command.report), || command.run()),
            Command::Design(command) => say(&command.json, Some(&command.out), Some(&command.report), || command.run()),
            Command::Bandwidth(command) => say(&command.json, None, Some(&command.report), || command.run()),
            Command::Diagnose(command) => {
                say(&command.json, command.out_model.as_deref(), Some(&command.report), || command.run())
            }
            Command::Report(command) => say(&command.json, Some(&command.out), None, || command.run()),
            Command::Device(command) => command.say(),
        }
    }
}

/// Runs a command, whose own output goes to `out`, and says what came out.
fn say(
    json: &JsonOption,
    out: Option<&Path>,
    report: Option<&ReportOption>,
    run: impl FnOnce() -> miette::Result<Outcome>,
) -> miette::Result<()> {
    json.check(out)?;
    report.map_or(Ok(()), |report| report.check_apart(json))?;
    json.say(run()?)
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        super::Arguments::command().debug_assert();
    }
}
