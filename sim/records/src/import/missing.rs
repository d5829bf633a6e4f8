//! What an option would say that a log does not.

use std::borrow::Cow;
use std::fmt;

use super::Quantity;

/// What `KIND` of [`MissingOption::excitation`] may be.
pub const EXCITATIONS: &str = "`multisine`, `square` or `triangle`, each with `--period SECONDS`; `staircase` (levels held \
     one after the other), `step` (one), `chirp`, `random` (a random or \
     pseudo-random command), `steady` (each row is a steady point), or `free` for anything else";

/// An option of the command line that is needed, with a word in capitals where a value is to be filled in. Shown as it is typed in
/// a shell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MissingOption {
    /// Its name, such as `--column`.
    pub name: &'static str,
    /// Its value, such as `time=t:UNIT`.
    pub value: String,
}

impl MissingOption {
    pub(super) fn column(quantity: Quantity, header: &str, unit: &str) -> Self {
        Self { name: "--column", value: format!("{}={header}:{unit}", quantity.name()) }
    }

    /// What drove the command.
    #[must_use]
    pub fn excitation() -> Self {
        Self { name: "--excitation", value: String::from("KIND") }
    }

    /// After how many seconds the command repeats.
    #[must_use]
    pub fn period() -> Self {
        Self { name: "--period", value: String::from("SECONDS") }
    }

    /// How many poles the motor has.
    #[must_use]
    pub fn motor_poles() -> Self {
        Self { name: "--motor-poles", value: String::from("N") }
    }

    /// How many rows a second there are.
    #[must_use]
    pub fn rate() -> Self {
        Self { name: "--rate", value: String::from("HZ") }
    }

    pub(super) fn pulse_us() -> Self {
        Self { name: "--pulse-us", value: String::from("LOW..HIGH") }
    }
}

impl fmt::Display for MissingOption {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} {}", self.name, shell_word(&self.value))
    }
}

/// A word as it is typed in a shell.
#[must_use]
pub fn shell_word(word: &str) -> Cow<'_, str> {
    let is_plain = |c: char| c.is_alphanumeric() || "=:_-+./,".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return Cow::Borrowed(word);
    }
    // What cannot be quoted, a null byte, cannot be typed either.
    shlex::try_quote(word).unwrap_or(Cow::Borrowed(word))
}
