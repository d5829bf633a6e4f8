//! `rotorlead report`

use std::path::{Path, PathBuf};

use clap::Args;
use miette::WrapErr as _;
use rotorlead_answer::words::{paragraph, remark};
use rotorlead_answer::{Report, Tone, Verdict};
use rotorlead_design::redesign::KindOptions;
use rotorlead_design::{DesignOptions, InverseOptions};
use rotorlead_plant::Model;
use rotorlead_records::files::{check_writable, printable, write_file};
use rotorlead_records::import::shell_word;
use rotorlead_records::{Excitation, Experiment};
use rotorlead_report::html;
use rotorlead_results::{Asked, Overview, Watch};
use serde_json::json;

use super::identify::not_identified;
use super::measured::{Measured, Reading, is_log};
use super::outcome::{JsonOption, Outcome, Verbosity};
use super::parameters::{KindName, PurposeOption};
use super::replacement::report_at;
use super::report_option::{DEFAULT_REPORT, FiguresOption, OpenOption, this_command};
use super::{diagnose, progress, report_pages};

/// Everything that an experiment or a log says, in one report: identification, validation, compensator, bandwidth and diagnosis
///
/// One HTML file with the verdict, tables, interactive figures and the commands that give each part by itself. It needs no
/// network. A part that the records do not allow is left out, and the report says why.
#[derive(Args, Debug)]
pub struct ReportCommand {
    #[command(flatten)]
    measured: Measured,
    /// Where the report goes
    #[arg(long, value_name = "FILE", default_value = DEFAULT_REPORT)]
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
    open: OpenOption,
    #[command(flatten)]
    figures: FiguresOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl ReportCommand {
    /// Runs the command, says what came out, and opens the report where that is asked.
    pub fn say(&self, verbosity: Verbosity) -> miette::Result<()> {
        self.json.answer(None, || self.run(), verbosity)?;
        self.open.open(&self.out);
        Ok(())
    }

    fn run(&self) -> miette::Result<Outcome> {
        check_writable(&self.out)?;
        self.figures.check()?;
        let given = self.given();
        let model = given.as_deref().map(Model::read).transpose()?;
        let Reading { mut experiment, text: of_log, logs, .. } = self.measured.read(u64::MAX)?;
        self.measured.choose_output(&mut experiment)?;
        let asked = Asked {
            model: model.as_ref(),
            kind: self.kind.map(KindName::kind),
            purpose: self.purpose.purpose(),
            with_diagnosis: !self.no_diagnosis,
        };
        let bar = progress::estimate("identifying", diagnose::STEPS);
        let watch = Watch { stage: &|stage| bar.set_message(stage), step: &|| progress::step(&bar) };
        // What was found in a log may say why nothing comes of it.
        let folder = self.measured.path();
        let overview = Overview::from_experiment(&experiment, folder.into(), asked, watch)
            .map_err(|error| not_identified(error, is_log(folder)))
            .wrap_err_with(|| format!("nothing was identified from `{}`", folder.display()))
            .inspect_err(|_| eprint!("{}", printable(&of_log)))?;
        bar.finish_and_clear();
        let judged = given.as_deref().map(|file| report_pages::file("Model that was judged", file));
        let report = Report {
            facts: [report_pages::records(&experiment, self.measured.path()), judged.into_iter().collect()].concat(),
            sections: overview.sections(&experiment),
            commands: self.commands(&overview, &experiment, given.as_deref()),
            verdict: overview.verdict(&experiment),
            warnings: overview.warnings(),
            ..report_pages::report("Experiment", experiment.name.clone(), Verdict::new(Tone::Plain, ""))
        };
        let figures = self.figures.write(&report)?;
        write_file(&self.out, html(&report)?.as_bytes())?;

        let mut text = if of_log.is_empty() { of_log } else { of_log + "\n" };
        text.push_str(&paragraph(&report.verdict.headline, ""));
        for sentence in &report.verdict.sentences {
            text.push_str(&paragraph(sentence, ""));
        }
        let warnings: String = overview.grouped_findings().iter().map(remark).collect();
        if !warnings.is_empty() {
            text = text + "\n" + &warnings;
        }
        text.push_str(&figures);
        text.push_str(&report_at(&self.out));
        let mut outcome = Outcome::new(text, &overview.values(&experiment, &report));
        if let Some(logs) = logs {
            outcome.json["logs"] = json!(logs);
        }
        Ok(outcome)
    }

    /// The model that is judged: the one given, or the one that lies with the records.
    fn given(&self) -> Option<PathBuf> {
        self.model.clone().or_else(|| Some(self.measured.path().join("model.toml")).filter(|file| file.is_file()))
    }

    /// The report again, and each part by itself.
    fn commands(&self, overview: &Overview, experiment: &Experiment, given: Option<&Path>) -> Vec<String> {
        let quoted = |path: &Path| shell_word(&path.display().to_string()).into_owned();
        let (folder, model) =
            (quoted(self.measured.as_folder()), given.map_or_else(|| "model.toml".to_owned(), quoted));
        let mut commands = vec![this_command()];
        commands.extend(self.measured.import_command());
        if given.is_none() {
            commands.push(format!("rotorlead identify {folder} --out {model}"));
        }
        commands.push(format!("rotorlead validate {folder} --model {model}"));
        let judged = given.map(|_| format!(" --model {model}")).unwrap_or_default();
        let papers = DesignOptions::default().omega_g_rad_s;
        let own = match &overview.options {
            Ok(KindOptions::Lead(DesignOptions { omega_g_rad_s, .. })) if *omega_g_rad_s < papers => {
                format!(" --kind lead --omega-g {omega_g_rad_s:.1}")
            }
            Ok(KindOptions::Lead(_)) => " --kind lead".to_owned(),
            Ok(KindOptions::Inverse(InverseOptions { omega_f_rad_s: Some(omega), .. })) => {
                format!(" --kind inverse --natural {omega:.0}")
            }
            Ok(KindOptions::Inverse(_)) => " --kind inverse".to_owned(),
            Err(_) => String::new(),
        };
        let (extended, compensated) = (" --out-model improved.toml", " --redesign --out-compensator compensator.toml");
        // Steps have their lags level by level, which the compensator is designed for with or without effects.
        if overview.missing().is_some() && !overview.is_of_steps() {
            commands.push(format!("rotorlead diagnose {folder}{judged}{extended}{compensated}{own}"));
            return commands;
        }
        commands.push(format!("rotorlead diagnose {folder}{judged}"));
        if overview.designed.is_ok() {
            commands.push(format!("rotorlead design {model}{own} --out compensator.toml"));
            // Of multisines alone a bandwidth is measured.
            let is_measured = experiment.records.iter().any(|record| record.excitation == Excitation::Multisine);
            let records = if is_measured { format!(" --records {folder}") } else { String::new() };
            commands.push(format!("rotorlead bandwidth {model} --compensator compensator.toml{records}"));
        }
        commands
    }
}
