//! `rotorlead completions`

use clap::Args;
use clap_complete::{Shell, generate};

use super::command_line;
use super::outcome::print_bytes;

/// Prints a script that completes commands and options in a shell
///
/// For bash: rotorlead completions bash > ~/.local/share/bash-completion/completions/rotorlead
#[derive(Args, Debug)]
pub struct Completions {
    /// The shell
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

impl Completions {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<()> {
        let mut script = Vec::new();
        generate(self.shell, &mut command_line(), "rotorlead", &mut script);
        print_bytes(&script)
    }
}
