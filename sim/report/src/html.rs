//! A report as one HTML file that needs no network: a template, filled in. Whatever comes from data is escaped, by it or by
//! `words`.

mod swatch;

use std::io::Write as _;

use askama::Template;
use base64::Engine as _;
use flate2::Compression;
use flate2::write::DeflateEncoder;
use rotorlead_answer::{Fact, Figure, Panel, Report, Section, Table, Tone, Verdict};
use serde::Serialize;
use serde_json::Value;

use swatch::swatch;

use crate::figure::FigureError;
use crate::figure::interactive::{LIBRARY, LICENSE, plots};
#[cfg(feature = "drawing")]
use crate::figure::still::still;
use crate::markup::escape_markup;

/// How the page looks, and what it does.
const STYLE: &str = include_str!("../templates/report.css");
const FIGURES: &str = include_str!("../templates/figures.js");
const SCRIPT: &str = include_str!("../templates/report.js");

/// Tables with more rows are folded.
const LONG: usize = 24;

/// What stands over the commands.
const AGAIN: &str = "In the folder where this was run, with the same version. The same input gives the same file.";

#[derive(Template)]
#[template(path = "report.html")]
struct Page<'a> {
    report: &'a Report,
    verdict: DrawnVerdict<'a>,
    sections: Vec<DrawnSection<'a>>,
    warnings: DrawnWarnings<'a>,
    done: Done<'a>,
    version: &'static str,
    style: &'static str,
    figures: &'static str,
    script: &'static str,
    again: &'static str,
    license: &'static str,
    library: &'static str,
    /// Of all figures in their order; empty where there is none.
    plots: String,
}

#[derive(Template)]
#[template(path = "verdict.html")]
struct DrawnVerdict<'a> {
    verdict: &'a Verdict,
}

#[derive(Template)]
#[template(path = "warnings.html")]
struct DrawnWarnings<'a> {
    warnings: &'a [String],
}

/// What was done: the facts of a report.
#[derive(Template)]
#[template(path = "done.html")]
struct Done<'a> {
    facts: &'a [Fact],
}

#[derive(Template)]
#[template(path = "table.html")]
struct DrawnTable<'a> {
    table: &'a Table,
}

/// A section whose figures are drawn.
#[derive(Template)]
#[template(path = "section.html")]
struct DrawnSection<'a> {
    name: &'a str,
    title: &'a str,
    text: &'a [String],
    tables: Vec<DrawnTable<'a>>,
    figures: Vec<DrawnFigure<'a>>,
}

impl<'a> DrawnSection<'a> {
    fn new(section: &'a Section, still: Still) -> Result<Self, FigureError> {
        let drawn = |figure| Ok(DrawnFigure { figure, still: still(figure)? });
        let figures = section.figures.iter().map(drawn).collect::<Result<Vec<_>, _>>()?;
        let tables = section.tables.iter().map(|table| DrawnTable { table }).collect();
        Ok(Self { name: &section.name, title: &section.title, text: &section.text, tables, figures })
    }
}

struct DrawnFigure<'a> {
    figure: &'a Figure,
    still: String,
}

struct Entry<'a> {
    name: &'a str,
    swatch: String,
}

impl<'a> DrawnFigure<'a> {
    fn name(&self) -> &str {
        &self.figure.name
    }

    fn title(&self) -> &str {
        &self.figure.title
    }

    fn caption(&self) -> &str {
        &self.figure.caption
    }

    fn panels(&self) -> &[Panel] {
        &self.figure.panels
    }

    fn legend(&self) -> Vec<Entry<'a>> {
        self.figure.legend().into_iter().map(|series| Entry { name: &series.group, swatch: swatch(series) }).collect()
    }
}

/// A sentence as HTML: escaped, what stands between two backticks as code, and options of the command line in one piece.
#[must_use]
pub fn words(sentence: &str) -> String {
    let escaped = escape_markup(sentence).replace("+-", "±");
    let mut parts = escaped.split('`');
    let mut html = whole_options(parts.next().unwrap_or_default());
    while let Some(code) = parts.next() {
        match parts.next() {
            Some(after) => html.push_str(&format!("<code>{code}</code>{}", whole_options(after))),
            // The last one is alone.
            None => html.push_str(&format!("`{code}")),
        }
    }
    html
}

/// A command line as HTML.
fn command_line(command: &str) -> String {
    whole_options(&escape_markup(command))
}

/// The hyphens of an option are no places to break it at.
fn whole_options(text: &str) -> String {
    let is_option = |word: &str| word.strip_prefix("--").is_some_and(|name| name.starts_with(char::is_alphabetic));
    let words = text
        .split(' ')
        .map(|word| if is_option(word) { format!("<span class=\"option\">{word}</span>") } else { word.to_owned() });
    words.collect::<Vec<_>>().join(" ")
}

/// JSON as base64 of its compressed text, a third as long, in which there is no markup.
fn packed(json: &Value) -> String {
    let mut deflate = DeflateEncoder::new(Vec::new(), Compression::best());
    deflate.write_all(json.to_string().as_bytes()).expect("memory takes all");
    base64::prelude::BASE64_STANDARD.encode(deflate.finish().expect("memory takes all"))
}

/// The class that colors what is said in this tone.
fn class(tone: &Tone) -> &'static str {
    match tone {
        Tone::Plain => "plain",
        Tone::Good => "good",
        Tone::Attention => "warn",
        Tone::Bad => "bad",
    }
}

/// What draws a figure for who sees the page without scripts, or on paper: an element of HTML, which is written as it is.
type Still<'a> = &'a dyn Fn(&Figure) -> Result<String, FigureError>;

/// The whole file.
///
/// # Errors
/// When a figure cannot be drawn.
#[cfg(feature = "drawing")]
pub fn html(report: &Report) -> Result<String, FigureError> {
    html_with_stills(report, &still)
}

/// The whole file, with each figure as `still` draws it beside the interactive one.
///
/// # Errors
/// When a figure cannot be drawn.
pub fn html_with_stills(report: &Report, still: Still) -> Result<String, FigureError> {
    let drawn = |section| DrawnSection::new(section, still);
    let sections = report.sections.iter().map(drawn).collect::<Result<Vec<_>, _>>()?;
    let figures = || report.sections.iter().flat_map(|section| &section.figures);
    let plots = figures().map(plots).collect::<Result<Vec<_>, _>>()?.concat();
    let page = Page {
        report,
        verdict: DrawnVerdict { verdict: &report.verdict },
        sections,
        warnings: DrawnWarnings { warnings: &report.warnings },
        done: Done { facts: &report.facts },
        version: env!("CARGO_PKG_VERSION"),
        style: STYLE,
        figures: FIGURES,
        script: SCRIPT,
        again: AGAIN,
        license: LICENSE,
        library: LIBRARY,
        plots: if plots.is_empty() { String::new() } else { packed(&Value::from(plots)) },
    };
    rendered(&page, &report.title)
}

/// A template, filled in.
fn rendered(template: &impl Template, name: &str) -> Result<String, FigureError> {
    template.render().map_err(|error| FigureError::Drawing { name: name.to_owned(), reason: error.to_string() })
}

/// A report in parts, for a page that is there already. Its style is that of the one file, its figures are drawn by `figures.js`.
#[derive(Debug, Clone, Serialize)]
pub struct Fragments {
    /// The verdict, as HTML.
    pub verdict: String,
    /// The sections in their order.
    pub sections: Vec<Fragment>,
    /// The warnings, as HTML; empty where there are none.
    pub warnings: String,
    /// What was done, as HTML.
    pub done: String,
}

/// One section of a report.
#[derive(Debug, Clone, Serialize)]
pub struct Fragment {
    /// The section's, which is the `id` of its element too.
    pub name: String,
    /// Its heading.
    pub title: String,
    /// Its element.
    pub html: String,
    /// What `drawFigures` draws in it: a plot for each panel.
    pub plots: Vec<Value>,
}

impl Fragment {
    /// A section without the pictures that stand in for interactive figures.
    ///
    /// # Errors
    /// When a figure cannot be drawn.
    pub fn new(section: &Section) -> Result<Self, FigureError> {
        let drawn = DrawnSection::new(section, &|_| Ok(String::new()))?;
        let plots = section.figures.iter().map(plots).collect::<Result<Vec<_>, _>>()?.concat();
        let html = rendered(&drawn, &section.name)?;
        Ok(Self { name: section.name.clone(), title: section.title.clone(), html, plots })
    }
}

/// The parts of a report.
///
/// # Errors
/// When a figure cannot be drawn.
pub fn fragments(report: &Report) -> Result<Fragments, FigureError> {
    let warnings = match &*report.warnings {
        [] => String::new(),
        warnings => rendered(&DrawnWarnings { warnings }, &report.title)?,
    };
    Ok(Fragments {
        verdict: rendered(&DrawnVerdict { verdict: &report.verdict }, &report.title)?,
        sections: report.sections.iter().map(Fragment::new).collect::<Result<_, _>>()?,
        warnings,
        done: rendered(&Done { facts: &report.facts }, &report.title)?,
    })
}

/// A table as HTML, with its notes.
///
/// # Errors
/// When it cannot be written.
pub fn table_html(table: &Table) -> Result<String, FigureError> {
    rendered(&DrawnTable { table }, &table.caption)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_within_a_sentence_are_set_as_code_and_nothing_is_escape_markup() {
        assert_eq!(words("`a < b` and `c`: 1 > 0"), "<code>a &lt; b</code> and <code>c</code>: 1 &gt; 0");
        assert_eq!(words("a ` alone & <b>"), "a ` alone &amp; &lt;b&gt;");
        assert_eq!(words("with --lead and -3 dB"), "with <span class=\"option\">--lead</span> and -3 dB");
        assert_eq!(words("7.0 +- 0.1"), "7.0 ± 0.1");
        assert_eq!(words(""), "");
        assert_eq!(command_line("a --b 'c<d'"), "a <span class=\"option\">--b</span> 'c&lt;d'");
    }
}
