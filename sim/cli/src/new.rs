//! `rotorlead new`

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use miette::{IntoDiagnostic as _, miette};
use rotorlead_plant::bench::{Plan, first_period};
use rotorlead_records::files::OutputFolder;
use serde_json::json;

use super::outcome::{JsonOption, Outcome, Verbosity};

const PLAN: &str = include_str!("new/plan.toml");
const EXAMPLE_MODEL: &str = include_str!("new/example-model.toml");
const EXPERIMENT: &str = include_str!("new/experiment.toml");
const CHECKLIST: &str = include_str!("new/CHECKLIST.md");
const README: &str = include_str!("new/README.md");

/// What can be done at once, in this order.
const REHEARSAL: [&str; 6] = [
    "rotorlead simulate example-model.toml --plan plan.toml --out rehearsal",
    "rotorlead check rehearsal",
    "rotorlead identify rehearsal --out rehearsed.toml",
    "rotorlead validate rehearsal --model rehearsed.toml",
    "rotorlead design rehearsed.toml --out rehearsed-filter.toml",
    "rotorlead bandwidth rehearsed.toml --compensator rehearsed-filter.toml",
];

/// Makes the excitation of another level.
const EXCITATION: &str = "rotorlead excite --band 0.1..30 --nominal 0.5 --amplitude 0.05 --out u050.csv";

/// What is done with records of a stand.
const STAND: [&str; 5] = [
    "rotorlead check stand",
    "rotorlead identify stand --out model.toml --report identification.html",
    "rotorlead validate stand --model model.toml",
    "rotorlead design model.toml --out compensator.toml",
    "rotorlead bandwidth model.toml --compensator compensator.toml",
];

/// Makes a folder to begin an experiment with
///
/// A plan with comments, one period of its excitation, a motor to rehearse with, the description of the records to come, a
/// checklist for a safe run on the stand, and a page that says what to do with them.
#[derive(Args, Debug)]
pub struct New {
    /// The folder, which is made; it may be there already when it is empty
    #[arg(value_name = "DIR")]
    pub(super) folder: PathBuf,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl New {
    /// Runs the command and says what came out.
    pub fn say(&self, verbosity: Verbosity) -> miette::Result<()> {
        self.json.check(Some(&self.folder))?;
        let (folder, outcome) = self.made()?;
        self.json.say_with_folder(folder, outcome, verbosity)
    }

    /// The folder, which lacks but its name, and what is said of it.
    fn made(&self) -> miette::Result<(OutputFolder, Outcome)> {
        let plan: Plan = toml::from_str(PLAN).into_diagnostic()?;
        let readme = README
            .replace("{rehearsal}", &REHEARSAL.join("\n"))
            .replace("{excitation}", EXCITATION)
            .replace("{stand}", &STAND.join("\n"));
        let excitation = excitation(&plan)?;
        let files = [
            ("README.md", "what to do, in which order", readme.as_str()),
            ("CHECKLIST.md", "for a safe run on the stand: read it first", CHECKLIST),
            ("plan.toml", "what to run, level by level", PLAN),
            ("excitation.csv", "one period of its first multisine", &excitation),
            ("example-model.toml", "a motor to rehearse with", EXAMPLE_MODEL),
            ("stand/experiment.toml", "describes your records, which go beside it", EXPERIMENT),
        ];
        let folder = OutputFolder::create(&self.folder)?;
        for (name, _, content) in files {
            folder.write(name, content.as_bytes())?;
        }

        let mut text = String::new();
        for (name, purpose, _) in files {
            writeln!(text, "  {name:<22} {purpose}").into_diagnostic()?;
        }
        write!(text, "\nTo rehearse without a stand, in the folder:\n\n  {}\n", REHEARSAL.join("\n  "))
            .into_diagnostic()?;
        writeln!(text, "\nWritten to {}", self.folder.display()).into_diagnostic()?;
        let json = json!({
            "folder": self.folder,
            "files": files.map(|(name, ..)| name),
            "commands": REHEARSAL,
        });
        Ok((folder, Outcome::new(text, &json)))
    }
}

/// One period of the plan's first record, tick by tick.
fn excitation(plan: &Plan) -> miette::Result<String> {
    let period = first_period(plan).map_err(|fault| miette!(help = fault.help.clone(), "{fault}"))?;
    let mut csv = String::from("time_s,command\n");
    for (tick, command) in period.iter().enumerate() {
        writeln!(csv, "{},{command:.6}", tick as f64 / f64::from(plan.loop_rate_hz)).into_diagnostic()?;
    }
    Ok(csv)
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::Model;

    use super::*;

    #[test]
    fn the_plan_and_the_model_go_together_and_start_low() {
        let plan: Plan = toml::from_str(PLAN).unwrap();
        assert_eq!(plan.check(), Ok(()));
        let model: Model = toml::from_str(EXAMPLE_MODEL).unwrap();
        assert_eq!(model.check(), Ok(()));
        assert!(plan.records.iter().all(|record| model.at(record.nominal).is_ok()));
        assert!(plan.records.is_sorted_by_key(|record| record.nominal));
    }
}
