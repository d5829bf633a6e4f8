//! `rotorlead man`

use std::path::PathBuf;

use clap::{Args, Command};
use clap_mangen::Man as Page;
use miette::IntoDiagnostic as _;
use rotorlead_records::files::{all_or_nothing, make_folder, write_file};

use super::command_line;
use super::outcome::print_bytes;
use super::report_option::check_folder;

/// Prints the manual page, or writes one for every command
///
/// To read it: rotorlead man | man -l -
#[derive(Args, Debug)]
pub struct Man {
    /// Write rotorlead.1 and a page for each command into this folder, which is made where it is not there
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Man {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<()> {
        let mut command = command_line().disable_help_subcommand(true);
        // Names the commands as they are called: `rotorlead device record`.
        command.build();
        let Some(folder) = &self.out else { return print_bytes(&page(&command)?) };
        check_folder(folder)?;
        all_or_nothing(|| {
            make_folder(folder)?;
            let mut commands = vec![&command];
            while let Some(command) = commands.pop() {
                let name = command.get_display_name().unwrap_or(command.get_name());
                write_file(&folder.join(format!("{name}.1")), &page(command)?)?;
                commands.extend(command.get_subcommands());
            }
            Ok(())
        })
    }
}

fn page(command: &Command) -> miette::Result<Vec<u8>> {
    let mut text = Vec::new();
    Page::new(command.clone()).render(&mut text).into_diagnostic()?;
    Ok(text)
}
