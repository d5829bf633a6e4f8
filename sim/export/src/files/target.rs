//! For whom a file is.

use super::{Stack, Syntax};

/// A program that takes frequency responses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrequencyFormat {
    /// A MAT-file.
    Matlab,
    /// A Python module.
    PythonControl,
    /// A table.
    Csv,
}

/// For whom a motor's numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// Parameters under a stack's or a simulator's names.
    Stack(Stack),
    /// Frequency responses of the records and of the model.
    Frequency(FrequencyFormat),
}

impl Target {
    /// Every one.
    pub fn all() -> impl Iterator<Item = Self> {
        let formats = [FrequencyFormat::Matlab, FrequencyFormat::PythonControl, FrequencyFormat::Csv];
        Stack::ALL.map(Self::Stack).into_iter().chain(formats.map(Self::Frequency))
    }

    /// What it is asked for by.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Stack(stack) => stack.name(),
            Self::Frequency(FrequencyFormat::Matlab) => "matlab",
            Self::Frequency(FrequencyFormat::PythonControl) => "python-control",
            Self::Frequency(FrequencyFormat::Csv) => "csv",
        }
    }

    /// What is written for it.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Self::Stack(stack) => stack.about(),
            Self::Frequency(FrequencyFormat::Matlab) => {
                "Frequency responses of the records and of the model, as a MAT-file for `frd`, `idfrd` and `tf`"
            }
            Self::Frequency(FrequencyFormat::PythonControl) => "The same for `control.FRD` and `control.tf` of Python",
            Self::Frequency(FrequencyFormat::Csv) => "The same as a table",
        }
    }

    /// What the name of its file ends with.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Self::Stack(stack) => Syntax::for_stack(stack).extension,
            Self::Frequency(FrequencyFormat::Matlab) => "mat",
            Self::Frequency(FrequencyFormat::PythonControl) => "py",
            Self::Frequency(FrequencyFormat::Csv) => "csv",
        }
    }

    /// Whether it can be shown as text.
    #[must_use]
    pub fn is_text(self) -> bool {
        self != Self::Frequency(FrequencyFormat::Matlab)
    }

    /// The stack or simulator.
    #[must_use]
    pub fn stack(self) -> Option<Stack> {
        match self {
            Self::Stack(stack) => Some(stack),
            Self::Frequency(_) => None,
        }
    }

    /// What an option of the command line is for, where nothing of this target depends on it.
    #[must_use]
    pub fn foreign(self, option: &str) -> Option<&'static str> {
        let stack = self.stack();
        let is = |has: fn(Stack) -> bool| stack.is_some_and(has);
        let (has, purpose) = match option {
            "--at" => (stack.is_none_or(Stack::has_time_constant), "the command of a time constant"),
            "--output-range" => (is(|stack| stack.output_range().is_some()), "for thrust curves and the highest speed"),
            "--step-rate" => (is(Stack::has_step), "for the steps of a simulator"),
            "--motors" => (is(Stack::is_per_motor), "for parameters of each motor"),
            "--compensator" => (stack.is_none(), "for frequency responses"),
            _ => return None,
        };
        (!has).then_some(purpose)
    }
}
