//! `rotorlead export`

mod conversion;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};
use rotorlead_export::{ExportSettings, Exported, ExportedValues, Exporter, Refusal, StackOptions, Target};
use rotorlead_plant::{CompensatorDesign, Model};
use rotorlead_records::Experiment;
use rotorlead_records::files::{AcceptedRange, OutputFolder, check_writable, write_file};
use rotorlead_results::export_warnings;
use serde_json::{Value, json};

use super::UsageError;
use super::model_argument::ModelArgument;
use super::outcome::{JsonOption, Outcome, Verbosity};
use super::parameters::{number, range};
use super::replacement::written_to;
use conversion::Conversion;

/// Prints a model's parameters as a flight stack or a simulator calls them
///
/// Each is in the stack's own syntax below a comment with its 95 % interval, its definition and where the stack says so: thrust
/// curves are fitted to the static map in the stack's normalization, time constants are those of the model at one command. What
/// the measurements cannot tell is refused, and what is missing is said. With --records, a simulator's own law is run on the records
/// beside the model, and matlab, python-control and csv get their frequency response. See docs/export.md.
#[derive(Args, Debug)]
pub struct Export {
    #[command(flatten)]
    model: ModelArgument,
    /// The flight stack, simulator or program
    #[arg(long = "for", value_name = "STACK", value_enum, required = true)]
    target: Option<TargetName>,
    /// File; of all, the folder that is made with a file for each. Standard output unless given, but for all and for matlab
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Also take steady thrust or rotor speed, where the model has not got it, from this experiment's records; replay those that
    /// are held out, or all, through the law of a simulator; and take the frequency response from its multisines
    #[arg(long, value_name = "DIR")]
    records: Option<PathBuf>,
    /// A compensator in front of the motor: matlab, python-control and csv then also get both together
    #[arg(long, value_name = "FILE")]
    compensator: Option<PathBuf>,
    /// Steps per second of the simulation; the simulator's own unless given
    #[arg(long, value_name = "HZ", value_parser = number(AcceptedRange::SAMPLE_RATE_HZ), allow_negative_numbers = true)]
    step_rate: Option<f64>,
    /// Command at which a time constant is taken, such as that of hover; the middle of those measured unless given
    #[arg(long, value_name = "COMMAND", value_parser = number(AcceptedRange::DUTY), allow_negative_numbers = true)]
    at: Option<f64>,
    /// Commands that are the stack's lowest and highest motor output: 0.15..0.95 for ardupilot (MOT_SPIN_MIN, MOT_SPIN_MAX),
    /// 0.055..1 for betaflight (its idle and motor_output_limit), and 0..1 unless given
    #[arg(long, value_name = "LOW..HIGH", value_parser = range(AcceptedRange::DUTY), allow_negative_numbers = true)]
    output_range: Option<(f64, f64)>,
    /// Motors, for stacks that take a value for each; 4 unless given
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u8).range(1..=32), allow_negative_numbers = true)]
    motors: Option<u8>,
    #[command(flatten)]
    conversion: Conversion,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

/// For whom, as it is typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TargetName {
    One(Target),
    All,
}

impl ValueEnum for TargetName {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: LazyLock<Vec<TargetName>> =
            LazyLock::new(|| Target::all().map(TargetName::One).chain([TargetName::All]).collect());
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(match self {
            Self::One(target) => PossibleValue::new(target.name()).help(target.about()),
            Self::All => PossibleValue::new("all").help("Each of them, into a folder"),
        })
    }
}

impl Export {
    /// Runs the command and says what came out.
    pub fn say(&self, verbosity: Verbosity) -> miette::Result<()> {
        let folder = self.out.as_deref().filter(|_| self.target == Some(TargetName::All));
        self.json.answer(folder, || self.run(), verbosity)
    }

    fn run(&self) -> miette::Result<Outcome> {
        if let Some(converted) = self.conversion.run() {
            return converted;
        }
        let name = self.target.expect("it is required where nothing is converted");
        match name {
            TargetName::One(target) => self.check_use(target)?,
            TargetName::All if self.out.is_none() => {
                return Err(UsageError::new("a folder is not printed", "add --out DIR").into());
            }
            TargetName::All => {}
        }
        let model = Model::read_with_map_alone(self.model.path())?;
        let experiment = self.records.as_deref().map(Experiment::read).transpose()?;
        let compensator = self.compensator.as_deref().map(CompensatorDesign::read).transpose()?;
        let step_s = self.step_rate.map(f64::recip);
        let settings = ExportSettings {
            options: StackOptions { at: self.at, output_range: self.output_range, step_s },
            motors: self.motors,
            compensator: compensator.as_ref(),
            warnings: export_warnings(&model, compensator.as_ref()),
        };
        let exporter = Exporter::new(&model, experiment.as_ref(), settings);
        match (name, &self.out) {
            (TargetName::One(target), out) => self.one(&exporter, target, out.as_deref()),
            (TargetName::All, Some(out)) => self.all(&exporter, out),
            (TargetName::All, None) => unreachable!("it was refused"),
        }
    }

    fn one(&self, exporter: &Exporter, target: Target, out: Option<&Path>) -> miette::Result<Outcome> {
        out.map_or(Ok(()), check_writable)?;
        let Exported { content, values } =
            exporter.export(target).map_err(|refused| self.nothing_known(&reasons(&refused)))?;
        let Some(out) = out else {
            return Ok(Outcome::new(String::from_utf8_lossy(&content).into_owned(), &values));
        };
        let written = written_to(out);
        write_file(out, &content)?;
        let warnings = values.warnings().iter().map(|warning| format!("warning: {warning}\n\n"));
        Ok(Outcome::new(format!("{}{written}\n{}", warnings.collect::<String>(), fits(&values)), &values))
    }

    fn all(&self, exporter: &Exporter, out: &Path) -> miette::Result<Outcome> {
        let folder = OutputFolder::create(out)?;
        let (mut text, mut unknown, mut stacks, mut frequency) =
            (String::new(), String::new(), Vec::new(), Value::Null);
        for target in Target::all() {
            match exporter.export(target) {
                Ok(Exported { content, values }) => {
                    let file = format!("{}.{}", target.name(), target.extension());
                    folder.write(&file, &content)?;
                    writeln!(text, "Written to {}", out.join(file).display()).expect("a string takes all");
                    text += &fits(&values);
                    match values {
                        ExportedValues::Stack(values) => stacks.push(json!(values)),
                        ExportedValues::Frequency(values) => frequency = json!(values),
                    }
                }
                Err(refused) => {
                    writeln!(unknown, "Nothing is known for {}: {}", target.name(), reasons(&refused))
                        .expect("a string takes all");
                    if let Some(stack) = target.stack() {
                        stacks.push(json!({ "stack": stack, "parameters": [], "refused": refused }));
                    }
                }
            }
        }
        if text.is_empty() {
            return Err(self.nothing_known(&unknown));
        }
        folder.commit()?;
        Ok(Outcome::new(text + &unknown, &json!({ "stacks": stacks, "frequency_response": frequency })))
    }

    /// Refuses options that nothing depends on which is asked for.
    fn check_use(&self, target: Target) -> Result<(), UsageError> {
        let given = [
            (self.at.is_some(), "--at"),
            (self.output_range.is_some(), "--output-range"),
            (self.step_rate.is_some(), "--step-rate"),
            (self.motors.is_some(), "--motors"),
            (self.compensator.is_some(), "--compensator"),
        ];
        for (_, option) in given.into_iter().filter(|(is_given, _)| *is_given) {
            if let Some(purpose) = target.foreign(option) {
                let message = format!("{option} is {purpose}, and {} has none", target.name());
                return Err(UsageError::new(message, format!("leave {option} out")));
            }
        }
        if target.stack().is_none() && self.records.is_none() {
            return Err(UsageError::new("no frequency response without records", "add --records DIR"));
        }
        if !target.is_text() && self.out.is_none() {
            return Err(UsageError::new("a MAT-file is not printed", "add --out FILE"));
        }
        Ok(())
    }

    fn nothing_known(&self, reasons: &str) -> miette::Report {
        miette::miette!(
            help = "docs/export.md says what each parameter is from, and what to record",
            "nothing is known from `{}`: {}",
            self.model.path().display(),
            reasons.trim_end()
        )
    }
}

/// How well a simulator explains records, below the file that is written for it.
fn fits(values: &ExportedValues) -> String {
    values.fits().into_iter().map(|fit| format!("  {fit}\n")).collect()
}

fn reasons(refused: &[Refusal]) -> String {
    let reasons = refused.iter().map(|refusal| format!("{}: {}", refusal.full_name(), refusal.why));
    reasons.collect::<Vec<_>>().join("; ")
}
