//! `rotorlead export`

mod syntax;
mod text;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use rotorlead_export::{ReplayRecords, Stack, StackOptions, StackParameters, stack_parameters};
use rotorlead_plant::Model;
use rotorlead_records::files::{AcceptedRange, OutputFolder};
use rotorlead_records::{Experiment, Finding};
use rotorlead_results::judged;
use serde_json::{Value, json};

use super::UsageError;
use super::model_argument::ModelArgument;
use super::outcome::{JsonOption, Outcome, Verbosity};
use super::parameters::{number, range};
use syntax::Syntax;
use text::{about_replay, parameters_text};

/// Prints a model's parameters as a flight stack or a simulator calls them
///
/// Each is in the stack's own syntax below a comment with its 95 % interval, its definition and where the stack says so: thrust
/// curves are fitted to the static map in the stack's normalization, time constants are those of the model at one command. What
/// the measurements cannot tell is refused, and what is missing is said. With --records, a simulator's own law is run on the records
/// beside the model. See docs/export.md.
#[derive(Args, Debug)]
pub struct Export {
    #[command(flatten)]
    model: ModelArgument,
    /// The flight stack or simulator
    #[arg(long = "for", value_name = "STACK", value_enum)]
    stack: StackName,
    /// Write a file for each stack into this folder, which is made
    #[arg(long, value_name = "DIR", required_if_eq("stack", "all"))]
    out: Option<PathBuf>,
    /// Also take steady thrust or rotor speed, where the model has not got it, from this experiment's records, and replay those that
    /// are held out, or all, through the law of a simulator
    #[arg(long, value_name = "DIR")]
    records: Option<PathBuf>,
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
    pub(super) json: JsonOption,
}

/// The stacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum StackName {
    /// `thrust_linear`
    Betaflight,
    /// `THR_MDL_FAC`
    Px4,
    /// `MOT_THST_EXPO`
    Ardupilot,
    /// `ACT_FREQ`
    Paparazzi,
    /// `indi_act_time_constant_ms`, `indi_act_nonlinearity`, `indi_act_max_rpm`
    Indiflight,
    /// `timeConstantUp`, `timeConstantDown`, `maxRotVelocity`, `motorConstant` of the motor plugin
    Gazebo,
    /// `thrust_range`, `max_thrust_rate`, `thrust_const_range`, `tau_inc_range`, `tau_dec_range` of `ThrusterCfg`
    IsaacLab,
    /// `motor_thrust_constant`, `motor_time_constant_increasing` and `_decreasing`, `max_thrust`, `max_thrust_rate`
    AerialGym,
    /// `rotor_dyn_coef`, `rpm2thrust`, `thrust_max`
    Crazyflow,
    /// `tau_m`, `k_eta`, `rotor_speed_max`
    Rotorpy,
    /// `kf`
    GymPybulletDrones,
    /// `SIH_T_TAU`, `SIH_T_MAX`
    Px4Sih,
    /// `dynprm`, `gainprm`, `delay`, `nsample` of a general actuator
    Mujoco,
    /// `motor_tau`, `motor_omega_max`, `thrust_map`
    Flightmare,
    /// Each of them, with --out
    All,
}

impl StackName {
    /// The stack; `None` for all.
    fn stack(self) -> Option<Stack> {
        Some(match self {
            Self::Betaflight => Stack::Betaflight,
            Self::Px4 => Stack::Px4,
            Self::Ardupilot => Stack::Ardupilot,
            Self::Paparazzi => Stack::Paparazzi,
            Self::Indiflight => Stack::Indiflight,
            Self::Gazebo => Stack::Gazebo,
            Self::IsaacLab => Stack::IsaacLab,
            Self::AerialGym => Stack::AerialGym,
            Self::Crazyflow => Stack::Crazyflow,
            Self::Rotorpy => Stack::Rotorpy,
            Self::GymPybulletDrones => Stack::GymPybulletDrones,
            Self::Px4Sih => Stack::Px4Sih,
            Self::Mujoco => Stack::Mujoco,
            Self::Flightmare => Stack::Flightmare,
            Self::All => return None,
        })
    }

    fn name(self) -> String {
        self.to_possible_value().expect("none is skipped").get_name().to_owned()
    }
}

/// Motors of a vehicle unless it is said.
const MOTORS: u8 = 4;

/// What is exported for a stack.
struct Exported {
    name: String,
    extension: &'static str,
    text: String,
    json: Value,
    found: StackParameters,
}

impl Export {
    /// Runs the command and says what came out.
    pub fn say(&self, verbosity: Verbosity) -> miette::Result<()> {
        self.json.answer(self.out.as_deref(), || self.run(), verbosity)
    }

    fn run(&self) -> miette::Result<Outcome> {
        self.check_use()?;
        let model = Model::read_with_map_alone(self.model.path())?;
        let experiment = self.records.as_deref().map(Experiment::read).transpose()?;
        let names: Vec<StackName> = match self.stack {
            StackName::All => {
                StackName::value_variants().iter().copied().filter(|name| *name != StackName::All).collect()
            }
            one => vec![one],
        };
        // A model is compared with records where a simulator asks for it.
        let simulators = names.iter().filter_map(|name| name.stack()).any(Stack::has_step);
        let records =
            experiment.as_ref().filter(|_| simulators).map(|experiment| ReplayRecords::new(&model, experiment));
        let exported = names.iter().filter_map(|name| {
            Some(self.exported(name.stack()?, name.name(), &model, experiment.as_ref(), records.as_ref()))
        });
        let (mut known, unknown): (Vec<Exported>, Vec<Exported>) =
            exported.partition(|exported| !exported.found.parameters.is_empty());
        if known.is_empty() {
            return Err(nothing_known(&unknown, self.model.path()));
        }
        let Some(out) = &self.out else {
            let Exported { text, json, .. } = known.remove(0);
            return Ok(Outcome { json, ..Outcome::new(text, &()) });
        };
        let folder = OutputFolder::create(out)?;
        let mut text = String::new();
        for Exported { name, extension, text: content, .. } in &known {
            let file = format!("{name}.{extension}");
            folder.write(&file, content.as_bytes())?;
            writeln!(text, "Written to {}", out.join(file).display()).expect("a string takes all");
        }
        folder.commit()?;
        for Exported { name, found, .. } in &unknown {
            writeln!(text, "Nothing is known for {name}: {}", reasons(found)).expect("a string takes all");
        }
        let json: Vec<Value> = known.into_iter().chain(unknown).map(|exported| exported.json).collect();
        Ok(Outcome::new(text, &json!({ "stacks": json })))
    }

    fn exported(
        &self,
        stack: Stack,
        name: String,
        model: &Model,
        experiment: Option<&Experiment>,
        records: Option<&Result<Option<ReplayRecords>, String>>,
    ) -> Exported {
        let options =
            StackOptions { at: self.at, output_range: self.output_range, step_s: self.step_rate.map(f64::recip) };
        let found = stack_parameters(stack, model, experiment, options);
        let motors = if stack.is_per_motor() { self.motors.unwrap_or(MOTORS) } else { 1 };
        let warnings: Vec<String> = judged(model).iter().map(Finding::sentence).collect();
        let syntax = Syntax::for_stack(stack);
        let comments = warnings.iter().map(|warning| syntax.comment(&[format!("warning: {warning}")]) + "\n");
        let mut text = comments.collect::<String>();
        if !stack.remarks().is_empty() {
            let remarks: Vec<String> = stack.remarks().iter().map(ToString::to_string).collect();
            text += &(syntax.comment(&remarks) + "\n");
        }
        text += &parameters_text(&found, &syntax, motors);
        let mut json = serde_json::to_value(&found).expect("keys are text, and no value fails to be written");
        json["warnings"] = json!(warnings);
        let replayed = records.filter(|_| stack.has_step()).map(|records| match records {
            Ok(None) => Ok((Vec::new(), false)),
            Ok(Some(records)) => Ok((records.replays(stack, options)?, records.held_out)),
            Err(why) => Err(why.clone()),
        });
        match replayed {
            Some(Ok((replays, held_out))) => {
                for replay in &replays {
                    text += &format!("\n{}", syntax.comment(&about_replay(replay, held_out)));
                }
                json["replays"] = json!(replays);
            }
            Some(Err(why)) => {
                text += &format!("\n{}", syntax.comment(&[format!("the records were not replayed: {why}")]));
                json["not_replayed"] = json!(why);
            }
            None => {}
        }
        Exported { name, extension: syntax.extension, text, json, found }
    }

    /// Refuses options that none of the stack's parameters depends on.
    fn check_use(&self) -> Result<(), UsageError> {
        let Some(stack) = self.stack.stack() else { return Ok(()) };
        let name = self.stack.name();
        let refuse = |option: &str, of: &str| {
            Err(UsageError::new(format!("{option} is {of}, and {name} has none"), format!("leave {option} out")))
        };
        if self.at.is_some() && !stack.has_time_constant() {
            return refuse("--at", "the command of a time constant");
        }
        if self.output_range.is_some() && stack.output_range().is_none() {
            return refuse("--output-range", "for thrust curves and the highest speed");
        }
        if self.step_rate.is_some() && !stack.has_step() {
            return refuse("--step-rate", "for the steps of a simulator");
        }
        if self.motors.is_some() && !stack.is_per_motor() {
            return refuse("--motors", "for parameters of each motor");
        }
        Ok(())
    }
}

fn reasons(found: &StackParameters) -> String {
    let reasons = found.refused.iter().map(|refusal| format!("{}: {}", refusal.name, refusal.why));
    reasons.collect::<Vec<_>>().join("; ")
}

fn nothing_known(unknown: &[Exported], model: &Path) -> miette::Report {
    let reasons: Vec<String> = unknown.iter().map(|exported| reasons(&exported.found)).collect();
    miette::miette!(
        help = "docs/export.md says what each parameter is from, and what to record",
        "`{}` tells none of the parameters: {}",
        model.display(),
        reasons.join("; ")
    )
}
