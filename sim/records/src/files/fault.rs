//! A rule that a value breaks, independent of whether the value comes from a file.

use std::fmt;

/// A value that breaks a rule: which one, why, and what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Which value.
    pub place: KeyPath,
    /// Which rule it breaks, as the end of a sentence that begins with the place.
    pub message: String,
    /// What to do about it.
    pub help: String,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.place.0.is_empty() { f.write_str(&self.message) } else { write!(f, "{}: {}", self.place, self.message) }
    }
}

/// The way to a value through the keys and items of a TOML file.
///
/// Printed with items counted from one: `` `point` 2, `gain` ``.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct KeyPath(pub(super) Vec<Step>);

/// One step of a [`KeyPath`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// Into the value of a key.
    Key(String),
    /// Into an item of an array, counted from zero.
    Item(usize),
}

impl KeyPath {
    /// The file as a whole.
    #[must_use]
    pub fn root() -> Self {
        Self::default()
    }

    /// The value of `key`.
    #[must_use]
    pub fn key(&self, key: &str) -> Self {
        self.step(Step::Key(key.to_owned()))
    }

    /// Item `index` of an array, counted from zero.
    #[must_use]
    pub fn item(&self, index: usize) -> Self {
        self.step(Step::Item(index))
    }

    fn step(&self, step: Step) -> Self {
        let mut steps = self.0.clone();
        steps.push(step);
        Self(steps)
    }

    /// A fault at this place.
    #[must_use]
    pub fn fault(self, message: impl Into<String>, help: impl Into<String>) -> Fault {
        Fault { place: self, message: message.into(), help: help.into() }
    }

    /// The keys on the way, the last one first.
    pub(super) fn keys_from_last(&self) -> impl Iterator<Item = &str> {
        self.0.iter().rev().filter_map(|step| match step {
            Step::Key(key) => Some(key.as_str()),
            Step::Item(_) => None,
        })
    }

    /// Accepts zero and finite numbers above it: a standard error, whatever it is one of.
    ///
    /// # Errors
    /// A fault at this place for anything else.
    pub fn not_negative(self, value: f64) -> Result<(), Fault> {
        if value >= 0.0 && value.is_finite() {
            return Ok(());
        }
        let rule = "a finite number of 0 or more";
        Err(self.fault(format!("{value} is not {rule}"), format!("give a value that is {rule}")))
    }
}

impl fmt::Display for KeyPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (position, step) in self.0.iter().enumerate() {
            match step {
                Step::Key(key) if position == 0 => write!(f, "`{key}`")?,
                Step::Key(key) => write!(f, ", `{key}`")?,
                Step::Item(index) => write!(f, " {}", index + 1)?,
            }
        }
        Ok(())
    }
}
