//! What a command says: text for people, JSON for programs.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::Value;

use crate::files::write_file;

/// What came out of a command.
#[derive(Debug)]
pub struct Outcome {
    /// For people; ends with a line break.
    pub text: String,
    /// The same for programs.
    pub json: Value,
}

/// Where the JSON goes.
#[derive(Args, Debug)]
pub struct JsonOption {
    /// Also write what is printed as JSON; with `-`, to standard output and instead of the text
    #[arg(long = "json", value_name = "FILE")]
    json: Option<PathBuf>,
}

impl JsonOption {
    /// Prints the outcome, or writes it, or both.
    pub fn say(&self, outcome: Outcome) -> miette::Result<()> {
        let json = || format!("{:#}\n", outcome.json);
        match self.json.as_deref() {
            Some(file) if file == Path::new("-") => print!("{}", json()),
            Some(file) => {
                write_file(file, json().as_bytes())?;
                print!("{}", outcome.text);
            }
            None => print!("{}", outcome.text),
        }
        Ok(())
    }
}
