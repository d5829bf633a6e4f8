//! The command line: one file per command, which reads what it is given, calls one module of this crate, and says what
//! came out, for people and as JSON.

mod bandwidth;
mod browser;
mod check;
mod compare;
mod completions;
mod demo;
mod design;
mod device;
mod diagnose;
mod excite;
mod exit;
mod export;
mod fleet;
mod help;
mod help_pages;
mod identify;
mod identify_align;
mod identify_stand;
mod import;
mod latency;
mod log_arguments;
mod man;
mod measured;
mod model_argument;
mod new;
mod out_option;
mod outcome;
mod overwrite_guard;
mod parameters;
mod progress;
mod redact;
mod redesign;
mod replacement;
mod report;
mod report_option;
mod report_pages;
mod sample;
mod serve;
mod simulate;
mod start;
mod usage_error;
mod validate;
mod vehicle;

use std::borrow::Cow;
use std::io::{Write as _, stdout};

use clap::builder::UnknownArgumentValueParser;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, CommandFactory as _, FromArgMatches as _, Parser, Subcommand};

use rotorlead_answer::words::fit_terminal;
use rotorlead_records::files::printable;
use terminal_size::{Width, terminal_size_of};

pub use self::exit::Exit;
pub use self::help_pages::{HelpPage, help_pages};
use self::outcome::Verbosity;
pub use self::usage_error::UsageError;

/// Identifies the lag of a motor with its propeller from thrust-stand records, designs the compensator that
/// speeds it up, and tests the very filter that flies on simulated actuators.
#[derive(Debug, Parser)]
#[command(name = "rotorlead", version, max_term_width = 80, after_help = AFTER_HELP)]
pub struct Arguments {
    /// Print nothing but errors and JSON: no tables, no progress
    #[arg(long, short, global = true)]
    quiet: bool,
    /// Print the detail too: distortion, static map, each record's fit, the integers of a compensator, where a residual lies
    #[arg(long, short, global = true, conflicts_with = "quiet")]
    verbose: bool,
    /// Let outputs replace files of another kind too
    #[arg(long, global = true)]
    force: bool,
    #[command(subcommand)]
    command: Command,
}

const AFTER_HELP: &str = "\
From a log to a compensator:
  rotorlead identify LOG --out model.toml      the lag at each level
  rotorlead design   model.toml --out compensator.toml

From several records of one motor:
  rotorlead import   LOG... --out stand        logs of a thrust stand become an experiment
  rotorlead check    stand                     what is wrong with it, if anything
  rotorlead identify stand --out model.toml

Without a log, `rotorlead sample` has some to try this on; with a stand and no
log yet, `rotorlead new DIR` makes a folder to begin with.

Exit status: 0 done, 1 failed, 2 wrong use, 129 hung up, 130 interrupted,
131 quit, 143 terminated.";

/// Declares the commands: of each its type, how it is run, and a line that it takes, which its help begins with.
macro_rules! commands {
    ($($name:ident($arguments:ty), $run:ident, $example:literal;)*) => {
        #[derive(Debug, Subcommand)]
        enum Command {
            $($name($arguments),)*
        }

        impl Command {
            fn run(&self, verbosity: Verbosity) -> miette::Result<()> {
                match self {
                    $(Self::$name(command) => commands!(@$run command, verbosity),)*
                }
            }
        }

        const EXAMPLES: &[&str] = &[$($example),*];
    };
    // An outcome, for people and as JSON.
    (@answers $command:ident, $verbosity:ident) => { $command.json.answer(None, || $command.run(), $verbosity) };
    // The same, where its JSON may go into the folder that it makes.
    (@answers_into_folder $command:ident, $verbosity:ident) => {
        $command.json.answer(Some(&$command.out), || $command.run(), $verbosity)
    };
    // The same of both, and the report opened where that is asked.
    (@reports $command:ident, $verbosity:ident) => {
        $command.json.answer(None, || $command.run(), $verbosity).map(|()| $command.report.open())
    };
    (@reports_into_folder $command:ident, $verbosity:ident) => {
        $command.json.answer(Some(&$command.out), || $command.run(), $verbosity).map(|()| $command.report.open())
    };
    // What it finds, in an order of its own.
    (@says $command:ident, $verbosity:ident) => { $command.say($verbosity) };
    // A script or a page.
    (@prints $command:ident, $verbosity:ident) => { $command.run() };
}

// In the order of the work. A new command is a file with its module above, and a line here.
commands! {
    Sample(sample::Sample), answers, "rotorlead sample staircase.csv";
    New(new::New), says, "rotorlead new first";
    Demo(demo::Demo), says, "rotorlead demo";
    Excite(excite::Excite), reports, "rotorlead excite --band 0.1..30 --out command.csv";
    Simulate(simulate::Simulate), reports_into_folder, "rotorlead simulate model.toml --out sim";
    Import(import::Import), answers_into_folder, "rotorlead import run1.csv run2.csv --excitation staircase --out stand";
    Check(check::Check), says, "rotorlead check stand";
    Identify(identify::Identify), reports, "rotorlead identify log.csv --excitation staircase --out model.toml";
    Validate(validate::Validate), reports, "rotorlead validate stand --model model.toml";
    Compare(compare::Compare), reports, "rotorlead compare before.csv after.csv --excitation staircase";
    Design(design::Design), reports, "rotorlead design model.toml --out compensator.toml";
    Bandwidth(bandwidth::Bandwidth), reports, "rotorlead bandwidth model.toml --compensator compensator.toml";
    Vehicle(vehicle::Vehicle), reports, "rotorlead vehicle model.toml";
    Export(export::Export), says, "rotorlead export model.toml --for px4";
    Diagnose(diagnose::Diagnose), reports, "rotorlead diagnose stand --report diagnosis.html";
    Fleet(fleet::Fleet), reports, "rotorlead fleet logs";
    Report(report::ReportCommand), says, "rotorlead report log.csv --excitation staircase";
    Redact(redact::Redact), answers, "rotorlead redact log.csv --out copy.csv";
    Device(device::Device), says, "rotorlead device --port /dev/ttyUSB0 info";
    Serve(serve::Serve), prints, "rotorlead serve";
    Completions(completions::Completions), prints, "rotorlead completions bash";
    Man(man::Man), prints, "rotorlead man --out man";
}

impl Arguments {
    /// What the command line says. Wrong use, `--help` and `--version` end the program here, and so does a command line that asks nothing,
    /// after a few words on how to begin.
    ///
    /// # Errors
    /// When help, version or how to begin cannot be printed; a [`UsageError`] where outputs are in each other's place, or
    /// in that of what is read; when an output would replace a file of another kind, and that is not forced.
    pub fn from_command_line() -> miette::Result<Self> {
        if std::env::args_os().len() <= 1 {
            outcome::print_bytes(start::text().as_bytes())?;
            std::process::exit(Exit::Done.status().into());
        }
        let matches = match command_line().try_get_matches() {
            Ok(matches) => matches,
            Err(asked) if !asked.use_stderr() => {
                outcome::printed(asked.print().and_then(|()| stdout().flush()))?;
                std::process::exit(Exit::Done.status().into());
            }
            Err(wrong) => refuse(&with_out_for_response(wrong)),
        };
        overwrite_guard::check(&command_line(), &matches)?;
        let arguments = Self::from_arg_matches(&matches).unwrap_or_else(|error| refuse(&error));
        if !arguments.force {
            overwrite_guard::check_replaced(&command_line(), &matches)?;
        }
        Ok(arguments)
    }

    /// Runs the command that was asked for and prints what it says.
    ///
    /// # Errors
    /// A report for a person: what is wrong, where, and what to do. A [`UsageError`] where options do not go together.
    pub fn run(self) -> miette::Result<()> {
        let verbosity = match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (false, true) => Verbosity::Verbose,
            (false, false) => Verbosity::Normal,
        };
        if verbosity == Verbosity::Quiet {
            progress::hide();
        }
        if let Some((Width(columns), _)) = terminal_size_of(stdout()) {
            fit_terminal(columns.into());
        }
        self.command.run(verbosity)
    }
}

/// Ends the program with what is wrong with the command line. Where that quotes what a terminal would obey, it is said without colors.
fn refuse(wrong: &clap::Error) -> ! {
    let plain = std::env::args_os().any(|argument| matches!(printable(&argument.to_string_lossy()), Cow::Owned(_)));
    if plain {
        eprint!("{}", printable(&wrong.render().to_string()));
        std::process::exit(wrong.exit_code());
    }
    wrong.exit()
}

/// The command line with its commands; the help of each begins with an example, and the long one says how it ends.
fn command_line() -> clap::Command {
    fn with_exit_status(command: clap::Command) -> clap::Command {
        command.after_long_help(exit::STATUS).mut_subcommands(with_exit_status)
    }
    help::with_common_options(Arguments::command())
        .mut_subcommands(|command| with_out_for_output(help::with_layout(with_exit_status(command))))
}

/// Has `--output` lead to `--out` where nothing else is called so: what looks most like it is about pulses.
fn with_out_for_output(command: clap::Command) -> clap::Command {
    let command = command.mut_subcommands(with_out_for_output);
    let is_taken = |argument: &Arg| argument.get_all_aliases().is_some_and(|names| names.contains(&"output"));
    if command.get_arguments().any(is_taken) || command.get_arguments().all(|argument| argument.get_id() != "out") {
        return command;
    }
    let parser = UnknownArgumentValueParser::suggest_arg("--out");
    command.arg(Arg::new("output").long("output").value_name("FILE").hide(true).value_parser(parser))
}

/// Says where a file goes to who wrote it behind `--output`, which once named the response.
fn with_out_for_response(mut wrong: clap::Error) -> clap::Error {
    let is_of_response = wrong.get(ContextKind::InvalidArg).is_some_and(|of| of.to_string().starts_with("--response"));
    if wrong.kind() == ErrorKind::InvalidValue && is_of_response {
        let tip = "where a file goes is said by '--out'".into();
        wrong.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip]));
    }
    wrong
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_command_line_is_consistent() {
        super::command_line().debug_assert();
    }
}
