//! `rotorlead report`

mod parts;
mod words;

use std::path::PathBuf;

use clap::Args;
use rotorlead_plant::Model;
use rotorlead_records::files::{check_writable, printable, write_file};
use rotorlead_report::html;
use serde_json::json;

use parts::{Asked, Parts};

use super::measured::{Measured, Reading};
use super::outcome::{JsonOption, Outcome};
use super::parameters::{KindName, PurposeOption};
use super::replaced::report_at;
use super::report_option::FiguresOption;
use rotorlead_answer::words::paragraph;

/// Everything that an experiment or a log says, in one report: identification, validation, compensator, bandwidth and diagnosis
///
/// One HTML file with the verdict, tables, interactive figures and the commands that give each part by itself. It needs no
/// network. A part that the records do not allow is left out, and the report says why.
#[derive(Args, Debug)]
pub struct ReportCommand {
    #[command(flatten)]
    measured: Measured,
    /// Where the report goes
    #[arg(long, value_name = "FILE", default_value = "report.html")]
    pub(super) out: PathBuf,
    /// The model to be judged; unless given, DIR/model.toml where it is there, or else the lags that the records show
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// What to design: the paper's lead, or an inverse; what is recommended for the purpose unless given
    #[arg(long, value_enum)]
    kind: Option<KindName>,
    #[command(flatten)]
    purpose: PurposeOption,
    /// Leave the diagnosis out, which takes the longest
    #[arg(long)]
    no_diagnosis: bool,
    #[command(flatten)]
    figures: FiguresOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl ReportCommand {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        check_writable(&self.out)?;
        self.figures.check()?;
        let given = self.given();
        let model = given.as_deref().map(Model::read).transpose()?;
        let Reading { mut experiment, text: of_log, logs, .. } = self.measured.read(u64::MAX)?;
        self.measured.choose_output(&mut experiment)?;
        // What was found in a log may say why nothing comes of it.
        let parts = Parts::of(&experiment, self.measured.path(), model.as_ref(), !self.no_diagnosis, self.asked())
            .inspect_err(|_| eprint!("{}", printable(&of_log)))?;
        let report = parts.report(self, &experiment, given.as_deref());
        let figures = self.figures.write(&report)?;
        write_file(&self.out, html(&report)?.as_bytes())?;

        let mut text = if of_log.is_empty() { of_log } else { of_log + "\n" };
        text.push_str(&paragraph(&report.verdict.headline, ""));
        for sentence in &report.verdict.sentences {
            text.push_str(&paragraph(sentence, ""));
        }
        text.push_str(&figures);
        text.push_str(&report_at(&self.out));
        let mut outcome = Outcome::new(text, &parts.json(&report, &experiment));
        if let Some(logs) = logs {
            outcome.json["logs"] = json!(logs);
        }
        Ok(outcome)
    }

    fn asked(&self) -> Asked {
        Asked { kind: self.kind.map(KindName::kind), purpose: self.purpose.purpose() }
    }

    /// The model that is judged: the one given, or the one that lies with the records.
    fn given(&self) -> Option<PathBuf> {
        self.model.clone().or_else(|| Some(self.measured.path().join("model.toml")).filter(|file| file.is_file()))
    }
}
