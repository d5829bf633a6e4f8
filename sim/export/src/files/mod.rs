//! What is known of a motor as files that stacks, simulators and programs take.

mod syntax;
mod target;
mod text;

use std::cell::OnceCell;

use rotorlead_plant::{CompensatorDesign, Model};
use rotorlead_records::Experiment;
use serde::Serialize;

use super::replay::{Replay, ReplayRecords};
use super::{FrequencyResponses, Refusal, Stack, StackOptions, StackParameters, stack_parameters};
use syntax::Syntax;
pub use target::{FrequencyFormat, Target};
use text::{about_replay, parameters_text};

/// Motors of a vehicle unless it is said.
const MOTORS: u8 = 4;

/// What the first line of a stack's file holds.
const HEAD: &str = "Parameters by rotorlead for ";

/// Whether a file that starts so is one of those that are exported.
#[must_use]
pub fn is_exported(beginning: &str) -> bool {
    let first = beginning.lines().next().unwrap_or_default();
    first.contains(HEAD) || super::frequency_formats::HEADS.iter().any(|head| beginning.starts_with(head))
}

/// A motor whose numbers are exported.
pub struct Exporter<'a> {
    model: &'a Model,
    experiment: Option<&'a Experiment>,
    settings: ExportSettings<'a>,
    replayed: OnceCell<Result<Option<ReplayRecords<'a>>, String>>,
}

/// What a person says of the vehicle and of the files.
#[derive(Clone, Debug, Default)]
pub struct ExportSettings<'a> {
    /// Where parameters are taken.
    pub options: StackOptions,
    /// Motors, for stacks that take a value for each; 4 unless given.
    pub motors: Option<u8>,
    /// A compensator in front of the motor, for frequency responses.
    pub compensator: Option<&'a CompensatorDesign>,
    /// What to know of the model, which stands above a stack's parameters.
    pub warnings: Vec<String>,
}

/// What is written for one target.
pub struct Exported {
    /// The file.
    pub content: Vec<u8>,
    /// The same for programs.
    pub values: ExportedValues,
}

/// The values of a file.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum ExportedValues {
    /// Of a stack or a simulator.
    Stack(StackExport),
    /// Of a program that takes frequency responses.
    Frequency(FrequencyExport),
}

/// Frequency responses, and what to know of the model.
#[derive(Debug, Serialize)]
pub struct FrequencyExport {
    #[serde(flatten)]
    found: FrequencyResponses,
    warnings: Vec<String>,
}

impl ExportedValues {
    /// What to know of the model.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        match self {
            Self::Stack(stack) => &stack.warnings,
            Self::Frequency(frequency) => &frequency.warnings,
        }
    }

    /// How well a simulator explains records, of each of its versions the record that it explains least; or why that is not known.
    #[must_use]
    pub fn fits(&self) -> Vec<String> {
        let Self::Stack(StackExport { replays, not_replayed, .. }) = self else { return Vec::new() };
        let fits = replays.iter().flatten().map(|replay| {
            let worst = replay.records.iter().min_by(|a, b| a.fit_percent.total_cmp(&b.fit_percent));
            worst.map_or_else(
                || format!("{}: it diverges", replay.stepping.name),
                |record| {
                    format!(
                        "{}: {} {:.1} % fit, the model {:.1} %",
                        replay.stepping.name, record.file, record.fit_percent, record.model_fit_percent
                    )
                },
            )
        });
        let none = replays.as_ref().filter(|replays| replays.is_empty());
        let none = none.map(|_| String::from("nothing was replayed: no record moves its command"));
        fits.chain(none).chain(not_replayed.iter().map(|why| format!("nothing was replayed: {why}"))).collect()
    }
}

/// Parameters of a stack, and how well a simulator explains records with them.
#[derive(Debug, Serialize)]
pub struct StackExport {
    #[serde(flatten)]
    found: StackParameters,
    warnings: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    replays: Option<Vec<Replay>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    not_replayed: Option<String>,
}

impl<'a> Exporter<'a> {
    /// Of `model`, to which `experiment` adds responses that it has not got.
    #[must_use]
    pub fn new(model: &'a Model, experiment: Option<&'a Experiment>, settings: ExportSettings<'a>) -> Self {
        Self { model, experiment, settings, replayed: OnceCell::new() }
    }

    /// What is known for `target`.
    ///
    /// # Errors
    /// Why nothing is, of each of its parameters.
    pub fn export(&self, target: Target) -> Result<Exported, Vec<Refusal>> {
        match target {
            Target::Stack(stack) => self.stack(stack, target),
            Target::Frequency(format) => self.frequency(format),
        }
    }

    fn stack(&self, stack: Stack, target: Target) -> Result<Exported, Vec<Refusal>> {
        let options = self.settings.options;
        let found = stack_parameters(stack, self.model, self.experiment, options);
        if found.parameters.is_empty() {
            return Err(found.refused);
        }
        let motors = if stack.is_per_motor() { self.settings.motors.unwrap_or(MOTORS) } else { 1 };
        let syntax = Syntax::for_stack(stack);
        let mut text = syntax.comment(&[format!("{HEAD}{}", target.name())]) + "\n";
        for warning in &self.settings.warnings {
            text += &(syntax.comment(&[format!("warning: {warning}")]) + "\n");
        }
        if !stack.remarks().is_empty() {
            let remarks: Vec<String> = stack.remarks().iter().map(ToString::to_string).collect();
            text += &(syntax.comment(&remarks) + "\n");
        }
        text += &parameters_text(&found, &syntax, motors);
        let replayed = self.experiment.filter(|_| stack.has_step()).map(|experiment| self.replay(stack, experiment));
        let (replays, not_replayed) = match replayed {
            Some(Ok((replays, held_out))) => {
                for replay in &replays {
                    text += &format!("\n{}", syntax.comment(&about_replay(replay, held_out)));
                }
                (Some(replays), None)
            }
            Some(Err(why)) => {
                text += &format!("\n{}", syntax.comment(&[format!("the records were not replayed: {why}")]));
                (None, Some(why))
            }
            None => (None, None),
        };
        let warnings = self.settings.warnings.clone();
        let values = ExportedValues::Stack(StackExport { found, warnings, replays, not_replayed });
        Ok(Exported { content: text.into_bytes(), values })
    }

    /// The records through the simulator's law, and whether they are held out.
    fn replay(&self, stack: Stack, experiment: &'a Experiment) -> Result<(Vec<Replay>, bool), String> {
        match self.replayed.get_or_init(|| ReplayRecords::new(self.model, experiment)) {
            Ok(Some(records)) => Ok((records.replays(stack, self.settings.options)?, records.held_out)),
            Ok(None) => Ok((Vec::new(), false)),
            Err(why) => Err(why.clone()),
        }
    }

    fn frequency(&self, format: FrequencyFormat) -> Result<Exported, Vec<Refusal>> {
        let refused = |why| vec![Refusal { name: "frequency response", releases: None, why }];
        let experiment = self.experiment.ok_or_else(|| refused(String::from("it is of records: give `--records`")))?;
        let ExportSettings { compensator, options, .. } = self.settings;
        let found = FrequencyResponses::new(self.model, experiment, compensator, options.at).map_err(refused)?;
        let content = match format {
            FrequencyFormat::Matlab => found.mat(),
            FrequencyFormat::PythonControl => found.python().into_bytes(),
            FrequencyFormat::Csv => found.csv().into_bytes(),
        };
        let warnings = self.settings.warnings.clone();
        Ok(Exported { content, values: ExportedValues::Frequency(FrequencyExport { found, warnings }) })
    }
}
