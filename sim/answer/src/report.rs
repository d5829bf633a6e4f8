//! A report of a run: words, tables and figures.

use serde::{Deserialize, Serialize};

use super::figure::Figure;
use super::table::Table;

/// All that a report says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// What kind of report it is.
    pub kind: String,
    /// What it is about.
    pub title: String,
    /// What came out, at the top.
    pub verdict: Verdict,
    /// With what it was done.
    pub facts: Vec<Fact>,
    /// What the reader should know, each with what to do.
    pub warnings: Vec<String>,
    /// The parts.
    pub sections: Vec<Section>,
    /// Commands that do it again, one a line.
    pub commands: Vec<String>,
}

/// What came out, in words.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Verdict {
    /// How good the news is.
    pub tone: Tone,
    /// One sentence.
    pub headline: String,
    /// More sentences.
    pub sentences: Vec<String>,
}

/// How good news are; also said in the words, since color alone says nothing to some.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Tone {
    /// Neither good nor bad.
    #[default]
    Plain,
    /// As it should be.
    Good,
    /// To be looked at.
    Attention,
    /// Not to be relied on.
    Bad,
}

/// A name and what it is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fact {
    /// What is stated.
    pub name: String,
    /// Its value.
    pub value: String,
}

/// A part with its own heading.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Section {
    /// Name of the place within the file.
    pub name: String,
    /// The heading.
    pub title: String,
    /// Paragraphs.
    pub text: Vec<String>,
    /// Tables, after the paragraphs.
    pub tables: Vec<Table>,
    /// Figures, after the tables.
    pub figures: Vec<Figure>,
}

impl Verdict {
    /// A headline alone.
    #[must_use]
    pub fn new(tone: Tone, headline: impl Into<String>) -> Self {
        Self { tone, headline: headline.into(), sentences: Vec::new() }
    }

    /// With more sentences.
    #[must_use]
    pub fn with(self, sentences: Vec<String>) -> Self {
        Self { sentences, ..self }
    }
}

impl Fact {
    /// A fact.
    #[must_use]
    pub fn new(name: &str, value: impl Into<String>) -> Self {
        Self { name: name.to_owned(), value: value.into() }
    }
}

impl Section {
    /// A heading with nothing below it yet.
    #[must_use]
    pub fn new(name: &str, title: &str) -> Self {
        Self { name: name.to_owned(), title: title.to_owned(), ..Self::default() }
    }
}
