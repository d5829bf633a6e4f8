//! What a question came to, once, for whoever reads it.

use rotorlead_records::Finding;
use serde_json::{Map, Value, json};

use crate::figure::Figure;
use crate::report::{Section, Verdict};
use crate::table::{Audience, Table};
use crate::words::{paragraph, remark};

/// Findings that a terminal shows beside tables; what further ones say changes the answer less.
const MOST_FINDINGS: usize = 4;
/// Sentences of the verdict that a terminal shows below its headline.
const MOST_SENTENCES: usize = 2;

/// An answer: what came out, what is to be known of it, and the numbers behind it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answer {
    /// Name of its place in a report.
    pub name: &'static str,
    /// Its heading there.
    pub title: &'static str,
    /// What the numbers say, in sentences.
    pub text: Vec<String>,
    /// What came out.
    pub verdict: Verdict,
    /// What is wrong with what it rests on, each with what to do.
    pub findings: Vec<Finding>,
    /// The numbers.
    pub tables: Vec<Table>,
    /// The pictures.
    pub figures: Vec<Figure>,
    /// What programs read beside the headline, the findings and the tables.
    pub values: Map<String, Value>,
}

/// An answer as a terminal shows it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Text {
    /// The tables, and the findings that weigh most.
    pub shown: String,
    /// Whatever is not among them, for who asks for it.
    pub detail: String,
    /// The verdict, which comes last.
    pub verdict: String,
}

impl Answer {
    /// For a terminal.
    #[must_use]
    pub fn text(&self) -> Text {
        let tables = |weights: &[Audience]| -> Vec<String> {
            self.tables.iter().filter(|table| weights.contains(&table.weight)).map(Table::text).collect()
        };
        let findings = |findings: &[Finding]| -> String { findings.iter().map(remark).collect() };
        // Where there is nothing else, they are the answer.
        let most = if self.tables.is_empty() { usize::MAX } else { MOST_FINDINGS };
        let (first, folded) = self.findings.split_at(self.findings.len().min(most));
        let said = || self.text.iter().map(|sentence| paragraph(sentence, "  ")).collect();
        let shown = tables(&[Audience::Shown])
            .into_iter()
            .chain((!self.text.is_empty()).then(said))
            .chain((!first.is_empty()).then(|| findings(first)));
        let mut shown = shown.collect::<Vec<_>>().join("\n");
        if !folded.is_empty() {
            let warnings = if folded.len() == 1 { "warning" } else { "warnings" };
            shown += &format!("{} further {warnings} of less weight: --verbose prints what they say\n", folded.len());
        }
        let detail = tables(&[Audience::Detail, Audience::Terminal])
            .into_iter()
            .chain((!folded.is_empty()).then(|| findings(folded)));
        let mut detail = detail.collect::<Vec<_>>().join("\n");
        let mut said = self.verdict.sentences.clone();
        let rest = said.split_off(said.len().min(MOST_SENTENCES));
        let listed = |sentences: &[String]| -> String {
            sentences.iter().map(|sentence| paragraph(&format!("- {sentence}"), "  ")).collect()
        };
        if let (Some(last), false) = (said.last_mut(), rest.is_empty()) {
            detail += &format!("\n{}", listed(&rest));
            *last += &format!(" ({} more: --verbose)", rest.len());
        }
        let verdict = paragraph(&self.verdict.headline, "  ") + &listed(&said);
        Text { shown, detail, verdict }
    }

    /// For programs: the headline, the findings as sentences, the rows of tables that have a key, and the further values.
    #[must_use]
    pub fn json(&self) -> Value {
        let mut object = Map::new();
        object.insert("headline".to_owned(), json!(self.verdict.headline));
        for table in &self.tables {
            if let Some(key) = table.key {
                object.insert(key.to_owned(), table.json());
            }
        }
        let sentences: Vec<String> = self.findings.iter().map(Finding::sentence).collect();
        object.insert("warnings".to_owned(), json!(sentences));
        object.extend(self.values.clone());
        Value::Object(object)
    }

    /// For a report.
    #[must_use]
    pub fn section(&self) -> Section {
        let tables =
            self.tables.iter().filter(|table| !matches!(table.weight, Audience::Programs | Audience::Terminal));
        Section {
            text: self.text.clone(),
            tables: tables.cloned().collect(),
            figures: self.figures.clone(),
            ..Section::new(self.name, self.title)
        }
    }

    /// The findings as a report lists them.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        self.findings.iter().map(Finding::sentence).collect()
    }
}
