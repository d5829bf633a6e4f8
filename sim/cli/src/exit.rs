//! How the program ends.

use std::process::ExitCode;

use super::UsageError;

/// The exit status, for scripts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// What was asked for is done. A reader of the output that stops early, such as `head`, is no failure.
    Done = 0,
    /// Data, a file or the controller stood in the way; the report on standard error says what to do.
    Failed = 1,
    /// The command line was wrong. This is what `clap` uses too.
    UsageError = 2,
    /// The terminal or the connection was closed (SIGHUP): 128 and the number of the signal, as shells have it.
    HungUp = 129,
    /// Ctrl-C (SIGINT): 128 and the number of the signal, as shells have it.
    Interrupted = 130,
    /// Ctrl-\ (SIGQUIT): likewise.
    Quit = 131,
    /// A request to end, such as `kill`, a batch system's time limit or a shutdown makes (SIGTERM): likewise.
    Terminated = 143,
}

/// What the long help of every command says of it.
pub(super) const STATUS: &str = "\
Exit status:
  0    done
  1    failed: the report on standard error says what is wrong, and what to do;
       what stood in the place of a file to be written stays
  2    wrong use of the command line
  129  ended by SIGHUP, as of a closed terminal; nothing half-written is left
  130  interrupted by Ctrl-C; nothing half-written is left
  131  ended by SIGQUIT; nothing half-written is left
  143  ended by SIGTERM, as `kill` sends it; nothing half-written is left";

impl Exit {
    /// What a run comes to.
    #[must_use]
    pub fn from_result(result: &miette::Result<()>) -> Self {
        match result {
            Ok(()) => Self::Done,
            Err(report) if report.is::<UsageError>() => Self::UsageError,
            Err(_) => Self::Failed,
        }
    }

    /// The number.
    #[must_use]
    pub fn status(self) -> u8 {
        self as u8
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit.status())
    }
}
