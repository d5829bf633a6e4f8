//! `rotorlead simulate`

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::WrapErr as _;
use rotorlead_answer::{Fact, Report, Tone, Verdict};
use rotorlead_plant::bench::{Plan, run};
use rotorlead_plant::{CompensatorDesign, Model};
use rotorlead_records::Experiment;
use rotorlead_records::files::{OutputFolder, TextFile};
use rotorlead_results::{read_plan, simulation_json, simulation_section};

use super::model_argument::ModelArgument;
use super::outcome::{JsonOption, Outcome};
use super::report_option::ReportOption;
use super::{progress, report_pages};

/// Runs an experiment on a simulated actuator, through the controller's own code
///
/// Without a plan it runs the paper's: a multisine and a square wave at each point of the model.
#[derive(Args, Debug)]
pub struct Simulate {
    #[command(flatten)]
    model: ModelArgument,
    /// What to run; the paper's experiment unless given
    #[arg(long, value_name = "FILE")]
    plan: Option<PathBuf>,
    /// Put this compensator in front of the ESC
    #[arg(long, value_name = "FILE")]
    compensator: Option<PathBuf>,
    /// Seed of the noise, instead of the plan's
    #[arg(long, value_parser = clap::value_parser!(u64).range(..1 << 63), allow_negative_numbers = true)]
    seed: Option<u64>,
    /// The experiment's folder, which is made
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    #[command(flatten)]
    pub(super) report: ReportOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl Simulate {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        self.report.check()?;
        let model = Model::read(self.model.path())?;
        let given = self.compensator.as_deref().map(CompensatorDesign::read).transpose()?;
        let (mut plan, design) = match &self.plan {
            Some(file) => {
                let folder = file.parent().unwrap_or(Path::new(""));
                read_plan(TextFile::read(file)?, &model, folder, given)?
            }
            None => (Plan::paper(&model), given),
        };
        if let Some(seed) = self.seed {
            plan.seed = seed;
        }
        if design.is_some() {
            plan.compensator = Some(PathBuf::from("compensator.toml"));
        }
        // Before the work, so that a folder in the way is found early.
        drop(OutputFolder::create(&self.out)?);
        let experiment = simulate(&plan, &model, design.as_ref()).wrap_err_with(|| match &self.plan {
            Some(plan) => format!("`{}` cannot be run on `{}`", plan.display(), self.model.path().display()),
            None => format!("the paper's experiment cannot be run on `{}`", self.model.path().display()),
        })?;
        let folder = OutputFolder::create(&self.out)?;
        experiment.write_into(&folder)?;
        if let Some(design) = &design {
            folder.write("compensator.toml", design.text(&self.out)?.as_bytes())?;
        }
        folder.commit()?;

        let rows: usize = experiment.records.iter().map(|record| record.time_s.len()).sum();
        let mut text = format!("{} records, {rows} rows\n", experiment.records.len());
        for record in &experiment.records {
            writeln!(text, "  {}  {} rows", record.file, record.time_s.len()).expect("a string takes all");
        }
        writeln!(text, "Written to {}", self.out.display()).expect("a string takes all");
        text.push_str(&self.report.write(|| {
            let headline = format!("{} records were simulated, {rows} rows.", experiment.records.len());
            let facts = report_pages::records(&experiment, &self.out);
            let seed = Fact::new("Seed of the noise", plan.seed.to_string());
            Report {
                facts: [facts, vec![report_pages::file("Model", self.model.path()), seed]].concat(),
                sections: vec![simulation_section(&experiment)],
                ..report_pages::report("Simulation", experiment.name.clone(), Verdict::new(Tone::Plain, headline))
            }
        })?);
        Ok(Outcome::new(text, &simulation_json(&experiment, plan.seed)))
    }
}

/// Runs a plan with a bar.
pub fn simulate(plan: &Plan, model: &Model, design: Option<&CompensatorDesign>) -> miette::Result<Experiment> {
    let bar = progress::bar("simulating", 1);
    let experiment = run(plan, model, design, &|progress| {
        bar.set_length(progress.total as u64);
        bar.set_position(progress.done as u64);
    })?;
    bar.finish_and_clear();
    Ok(experiment)
}
