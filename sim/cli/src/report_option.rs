//! `--report` and `--figures`: what a run found, for people with eyes.

use std::path::{Path, PathBuf};

use clap::Args;
use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};
use rotorlead_answer::words::paragraph;
use rotorlead_answer::{Figure, Report};
use rotorlead_records::files::{FileError, check_writable, make_folder, write_file};
use rotorlead_records::import::{MissingOption, shell_word};
use rotorlead_report::{FigureError, html, png, svg};

use super::browser::open_file;
use super::replacement::{self, Typed, check_figure, report_at};
use super::{UsageError, progress};

/// What a report is called that nobody names.
pub(super) const DEFAULT_REPORT: &str = "report.html";

/// Where the report and its figures go.
#[derive(Args, Clone, Debug)]
pub struct ReportOption {
    /// Also write a report: one HTML file with the verdict, tables and interactive figures, which needs no network
    #[arg(long = "report", value_name = "FILE")]
    report: Option<PathBuf>,
    #[command(flatten)]
    open: OpenOption,
    #[command(flatten)]
    pub(super) figures: FiguresOption,
}

/// Whether a report is shown at once.
#[derive(Args, Clone, Copy, Debug)]
pub struct OpenOption {
    /// Open the report in the browser
    #[arg(long)]
    open: bool,
}

impl OpenOption {
    /// Opens the report where that is asked. It has to be there: files that a command writes are renamed at its end.
    pub fn open(self, report: &Path) {
        if self.open {
            open_file(report);
        }
    }
}

/// Where figures go.
#[derive(Args, Clone, Debug)]
pub struct FiguresOption {
    /// Also write every figure as SVG and PNG, and the numbers of figures and tables as CSV, into this folder, which is made
    /// where it is not there
    #[arg(long, value_name = "DIR")]
    figures: Option<PathBuf>,
    #[arg(from_global)]
    force: bool,
}

impl ReportOption {
    /// Refuses what cannot be written, and a report that is to be opened and has no name, before any work is done.
    pub fn check(&self) -> miette::Result<()> {
        if self.open.open && self.report.is_none() {
            let help = "name it too: --report report.html --open";
            return Err(UsageError::new("--open opens the report, and --report names none", help).into());
        }
        self.report.as_deref().map_or(Ok(()), check_writable)?;
        Ok(self.figures.check()?)
    }

    /// The same where a report that is to be opened and has no name goes into `folder`, which the command makes.
    pub fn in_folder(&self, folder: &Path) -> miette::Result<Self> {
        if !self.open.open || self.report.is_some() {
            self.check()?;
            return Ok(self.clone());
        }
        let file = folder.join(DEFAULT_REPORT);
        if !self.figures.force {
            replacement::check(&file, "--report", Typed::Nothing, ("", "report"))?;
        }
        self.figures.check()?;
        Ok(Self { report: Some(file), ..self.clone() })
    }

    /// Opens the report that was written, where that is asked.
    pub fn open(&self) {
        if let Some(file) = &self.report {
            self.open.open(file);
        }
    }

    /// Where the report goes.
    pub fn file(&self) -> Option<&Path> {
        self.report.as_deref()
    }

    /// Writes what was asked for, and says where it is. The report is made only where it is.
    pub fn write(&self, report: impl FnOnce() -> Report) -> miette::Result<String> {
        if self.report.is_none() && self.figures.figures.is_none() {
            return Ok(String::new());
        }
        let report = report();
        let mut text = self.figures.write(&report)?;
        if let Some(file) = &self.report {
            write_file(file, html(&report)?.as_bytes())?;
            text.push_str(&report_at(file));
        }
        Ok(text)
    }
}

impl FiguresOption {
    /// Refuses a folder that cannot be made, before any work is done.
    pub fn check(&self) -> Result<(), FileError> {
        self.figures.as_deref().map_or(Ok(()), check_folder)
    }

    /// Writes the figures and tables of a report where a folder is given, and says so.
    pub fn write(&self, report: &Report) -> miette::Result<String> {
        let Some(folder) = &self.figures else { return Ok(String::new()) };
        make_folder(folder)?;
        let figures: Vec<&Figure> = report.sections.iter().flat_map(|section| &section.figures).collect();
        // Bitmaps take their time: they are drawn side by side.
        let bar = progress::bar("drawing", figures.len() as u64);
        let draw = |figure: &&Figure| {
            let drawn = (svg(figure)?, png(figure)?);
            bar.inc(1);
            Ok(drawn)
        };
        let drawn: Vec<_> = figures.par_iter().map(draw).collect();
        bar.finish_and_clear();
        let write = |name: &str, end: &str, content: &[u8]| -> miette::Result<()> {
            let file = folder.join(format!("{name}.{end}"));
            if !self.force {
                check_figure(&file, content)?;
            }
            Ok(write_file(&file, content)?)
        };
        for (figure, drawn) in figures.iter().zip(drawn) {
            let (svg, png): (String, Vec<u8>) = drawn.map_err(|error: FigureError| error)?;
            write(&figure.name, "svg", svg.as_bytes())?;
            write(&figure.name, "png", &png)?;
            write(&figure.name, "csv", figure.csv().as_bytes())?;
        }
        let tables: Vec<_> = report.sections.iter().flat_map(|section| &section.tables).collect();
        for table in &tables {
            write(&table.name, "csv", table.csv().as_bytes())?;
        }
        let listed = |what: &str, names: Vec<&str>| {
            let line = format!("{what} in {}: {}", folder.display(), names.join(", "));
            if names.is_empty() { String::new() } else { paragraph(&line, "  ") }
        };
        let figures = listed("Figures", figures.iter().map(|figure| figure.name.as_str()).collect());
        let tables = listed("Tables", tables.iter().map(|table| table.name.as_str()).collect());
        Ok(format!("\n{figures}{tables}"))
    }
}

/// The command that is running, as it would be typed again.
pub fn this_command() -> String {
    typed(arguments())
}

/// The same with these options, in place of those that say another value of the same, or less of the same column.
pub fn this_command_with(options: &[MissingOption]) -> String {
    let is_replaced = |name: &str, value: &str| {
        let is_less =
            |option: &MissingOption| option.value.strip_prefix(value).is_some_and(|rest| rest.starts_with(':'));
        options.iter().any(|option| option.name == name && (name != "--column" || is_less(option)))
    };
    let (mut given, mut words) = (arguments().peekable(), Vec::new());
    while let Some(word) = given.next() {
        let next = given.peek().map_or("", String::as_str);
        match word.split_once('=') {
            Some((name, value)) if is_replaced(name, value) => {}
            None if is_replaced(&word, next) => drop(given.next()),
            _ => words.push(word),
        }
    }
    words.extend(options.iter().flat_map(|option| [option.name.to_owned(), option.value.clone()]));
    typed(words)
}

/// The words of the command line behind the program's name.
pub fn arguments() -> impl Iterator<Item = String> {
    std::env::args_os().skip(1).map(|argument| argument.to_string_lossy().into_owned())
}

/// The program with these words behind its name, as they are typed in a shell.
pub fn typed(words: impl IntoIterator<Item = String>) -> String {
    let words = words.into_iter().map(|word| shell_word(&word).into_owned());
    std::iter::once("rotorlead".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

/// Refuses a folder that cannot be made, before the work.
pub fn check_folder(path: &Path) -> Result<(), FileError> {
    if path.is_dir() {
        Ok(())
    } else if path.exists() {
        Err(FileError::NotAFolder { path: path.to_owned(), remedy: "give the path of a folder".into() })
    } else {
        check_writable(path)
    }
}
