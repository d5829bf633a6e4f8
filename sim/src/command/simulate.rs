//! `rotorlead simulate`

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use rotorlead::design::LeadDesign;
use serde_json::json;

use super::outcome::{JsonOption, Outcome};
use super::progress;
use crate::bench::{Plan, run};
use crate::design::{compensator_file, read_compensator};
use crate::files::OutputFolder;
use crate::plant::Model;
use crate::record::Experiment;

/// Runs an experiment on a simulated actuator, through the controller's own code
///
/// Without a plan it runs the paper's: a multisine and a square wave at each point of the model.
#[derive(Args, Debug)]
pub struct Simulate {
    /// The actuator
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// What to run; the paper's experiment unless given
    #[arg(long, value_name = "FILE")]
    plan: Option<PathBuf>,
    /// Put this compensator in front of the ESC
    #[arg(long, value_name = "FILE")]
    compensator: Option<PathBuf>,
    /// Seed of the noise, instead of the plan's
    #[arg(long, value_parser = clap::value_parser!(u64).range(..1 << 63))]
    seed: Option<u64>,
    /// The experiment's folder, which is made
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl Simulate {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        let model = Model::read(&self.model)?;
        let mut plan = match &self.plan {
            Some(file) => Plan::read(file)?,
            None => Plan::paper(&model),
        };
        if let Some(seed) = self.seed {
            plan.seed = seed;
        }
        let design = match (&self.compensator, &plan.compensator, &self.plan) {
            (Some(file), ..) => Some(read_compensator(file)?),
            (None, Some(file), Some(plan)) => Some(read_compensator(&beside(plan, file))?),
            (None, Some(file), None) => Some(read_compensator(file)?),
            (None, None, _) => None,
        };
        if design.is_some() {
            plan.compensator = Some(PathBuf::from("compensator.toml"));
        }
        // Before the work, so that a folder in the way is found early.
        let folder = OutputFolder::create(&self.out)?;
        let experiment = simulate(&plan, &model, design.as_ref())?;
        experiment.write_into(&folder)?;
        if let Some(design) = &design {
            compensator_file(design).write(&folder.building().join("compensator.toml"))?;
        }
        folder.commit()?;

        let rows: usize = experiment.records.iter().map(|record| record.time_s.len()).sum();
        let mut text = format!("{} records, {rows} rows\n", experiment.records.len());
        for record in &experiment.records {
            writeln!(text, "  {}  {} rows", record.file, record.time_s.len()).expect("a string takes all");
        }
        writeln!(text, "Written to {}", self.out.display()).expect("a string takes all");
        let json = json!({
            "name": experiment.name,
            "seed": plan.seed,
            "records": experiment.records.iter()
                .map(|record| json!({ "file": record.file, "nominal": record.nominal, "rows": record.time_s.len() }))
                .collect::<Vec<_>>(),
        });
        Ok(Outcome { text, json })
    }
}

/// Runs a plan with a bar.
pub fn simulate(plan: &Plan, model: &Model, design: Option<&LeadDesign>) -> miette::Result<Experiment> {
    let bar = progress::bar("simulating", 1);
    let experiment = run(plan, model, design, &|progress| {
        bar.set_length(progress.total as u64);
        bar.set_position(progress.done as u64);
    })?;
    bar.finish_and_clear();
    Ok(experiment)
}

/// `file` as seen from the folder of `from`.
fn beside(from: &Path, file: &Path) -> PathBuf {
    from.parent().unwrap_or(Path::new("")).join(file)
}
