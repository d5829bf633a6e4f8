//! `rotorlead export`

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use rotorlead_export::{Parameter, Stack, StackOptions, StackParameters, stack_parameters};
use rotorlead_plant::Model;
use rotorlead_records::files::AcceptedRange;
use rotorlead_records::{Experiment, Finding};
use rotorlead_results::judged;
use serde_json::json;

use super::UsageError;
use super::export_conversion::Conversion;
use super::export_frequency::{FrequencyFormat, FrequencyOptions};
use super::model_argument::ModelArgument;
use super::outcome::{JsonOption, Outcome};
use super::parameters::{number, range};

/// Prints a model's parameters as a flight stack or a simulator calls them
///
/// Each is in the stack's own syntax below a comment with its 95 % interval, its definition and where the stack says so: thrust
/// curves are fitted to the static map in the stack's normalization, time constants are those of the model at one command. What
/// the measurements cannot tell is refused, and what is missing is said. See docs/export.md.
#[derive(Args, Debug)]
pub struct Export {
    #[command(flatten)]
    model: ModelArgument,
    /// The flight stack, simulator or program
    #[arg(long = "for", value_name = "STACK", value_enum, required = true)]
    stack: Option<StackName>,
    /// Also take steady thrust or rotor speed, where the model has not got it, from this experiment's records
    #[arg(long, value_name = "DIR")]
    records: Option<PathBuf>,
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
    frequency: FrequencyOptions,
    #[command(flatten)]
    conversion: Conversion,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

/// For whom.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum StackName {
    /// `thrust_linear`, of each of the two laws that releases have
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
    /// Frequency responses of the records and of the model, as a MAT-file for `frd`, `idfrd` and `tf`
    Matlab,
    /// The same for `control.FRD` and `control.tf` of Python
    PythonControl,
    /// The same as a table
    Csv,
}

impl StackName {
    /// The stack; or the program, which takes frequency responses.
    fn stack(self) -> Result<Stack, FrequencyFormat> {
        Ok(match self {
            Self::Betaflight => Stack::Betaflight,
            Self::Px4 => Stack::Px4,
            Self::Ardupilot => Stack::Ardupilot,
            Self::Paparazzi => Stack::Paparazzi,
            Self::Indiflight => Stack::Indiflight,
            Self::Gazebo => Stack::Gazebo,
            Self::Matlab => return Err(FrequencyFormat::Matlab),
            Self::PythonControl => return Err(FrequencyFormat::PythonControl),
            Self::Csv => return Err(FrequencyFormat::Csv),
        })
    }
}

/// Motors of a vehicle unless it is said.
const MOTORS: u8 = 4;

impl Export {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        if let Some(converted) = self.conversion.run() {
            return converted;
        }
        let name = self.stack.expect("it is required where nothing is converted");
        self.check_use(name)?;
        let model = Model::read_with_map_alone(self.model.path())?;
        let experiment = self.records.as_deref().map(Experiment::read).transpose()?;
        let stack = match (name.stack(), &experiment) {
            (Ok(stack), _) => stack,
            (Err(format), Some(experiment)) => return self.frequency.run(format, &model, experiment, self.at),
            (Err(_), None) => {
                return Err(UsageError::new("no frequency response without records", "add --records DIR").into());
            }
        };
        let options = StackOptions { at: self.at, output_range: self.output_range };
        let found = stack_parameters(stack, &model, experiment.as_ref(), options);
        if found.parameters.is_empty() {
            return Err(nothing_known(&found, self.model.path()));
        }
        let motors = if stack.is_per_motor() { self.motors.unwrap_or(MOTORS) } else { 1 };
        let warnings: Vec<String> = judged(&model).iter().map(Finding::sentence).collect();
        let comments =
            warnings.iter().map(|warning| Syntax::for_stack(stack).comment(&[format!("warning: {warning}")]) + "\n");
        let mut outcome = Outcome::new(comments.collect::<String>() + &text(&found, motors), &found);
        outcome.json["warnings"] = json!(warnings);
        Ok(outcome)
    }

    /// Refuses options that nothing depends on which is asked for.
    fn check_use(&self, name: StackName) -> Result<(), UsageError> {
        let stack = name.stack().ok();
        let name = name.to_possible_value().expect("none is skipped");
        let name = name.get_name();
        let refuse = |option: &str, of: &str| {
            Err(UsageError::new(format!("{option} is {of}, and {name} has none"), format!("leave {option} out")))
        };
        if self.at.is_some() && stack.is_some_and(|stack| !stack.has_time_constant()) {
            return refuse("--at", "the command of a time constant");
        }
        if self.output_range.is_some() && stack.is_none_or(|stack| stack.output_range().is_none()) {
            return refuse("--output-range", "for thrust curves and the highest speed");
        }
        if self.motors.is_some() && !stack.is_some_and(Stack::is_per_motor) {
            return refuse("--motors", "for parameters of each motor");
        }
        match self.frequency.given() {
            Some(option) if stack.is_some() => refuse(option, "for frequency responses"),
            _ => Ok(()),
        }
    }
}

fn nothing_known(found: &StackParameters, model: &Path) -> miette::Report {
    let reasons: Vec<String> = found
        .refused
        .iter()
        .map(|refusal| format!("{}: {}", named(refusal.name, refusal.releases), refusal.why))
        .collect();
    miette::miette!(
        help = "docs/export.md says what each parameter is from, and what to record",
        "`{}` tells none of the parameters: {}",
        model.display(),
        reasons.join("; ")
    )
}

/// The parameters in the stack's syntax, below comments in its syntax.
fn text(found: &StackParameters, motors: u8) -> String {
    let syntax = Syntax::for_stack(found.stack);
    let known = found.parameters.iter().map(|parameter| {
        let line = (syntax.line)(parameter.definition.name, &digits(parameter.value), motors);
        format!("{}{line}\n", syntax.comment(&about(parameter)))
    });
    let unknown = found
        .refused
        .iter()
        .map(|refusal| format!("{} is not known: {}", named(refusal.name, refusal.releases), refusal.why))
        .map(|refusal| syntax.comment(&[refusal]));
    known.chain(unknown).collect::<Vec<_>>().join("\n")
}

/// A parameter's name, and of which releases it is where others mean another thing by it.
fn named(name: &str, releases: Option<&str>) -> String {
    releases.map_or_else(|| name.to_owned(), |releases| format!("{name} of releases {releases}"))
}

/// The comment above a parameter.
fn about(parameter: &Parameter) -> Vec<String> {
    let unit = if parameter.definition.unit == "1" { String::new() } else { format!(" {}", parameter.definition.unit) };
    let name = named(parameter.definition.name, parameter.definition.releases);
    let mut of = format!("{name} = {}{unit}", digits(parameter.value));
    match (parameter.low, parameter.high) {
        (Some(low), Some(high)) => write!(of, ", 95 % interval {} to {}", digits(low), digits(high)),
        _ => write!(of, ", whose interval is not in the model"),
    }
    .expect("a string takes all");
    if let Some(at) = parameter.at {
        write!(of, ", at a command of {}", command(at)).expect("a string takes all");
    }
    let (low, high) = parameter.measured;
    if low < high {
        write!(of, "; measured at commands from {} to {}", command(low), command(high)).expect("a string takes all");
    }
    if let Some(worst) = parameter.worst_error_percent {
        write!(of, ", where the law errs by at most {worst:.1} % of full thrust").expect("a string takes all");
    }
    let mut lines = vec![of, parameter.definition.definition.to_owned()];
    lines.extend(parameter.notes.iter().cloned());
    lines.push(format!("source: {}", parameter.definition.source));
    lines
}

/// Magnitude below which a number is what rounding leaves of zero.
const ROUNDING: f64 = 1e-12;

/// Four significant digits, or all of a whole number.
fn digits(value: f64) -> String {
    let value = if value.abs() < ROUNDING { 0.0 } else { value };
    if value == value.trunc() && value.abs() < 1e9 {
        return format!("{value}");
    }
    let decimals = 3 - value.abs().log10().floor() as i32;
    if decimals > 6 { format!("{value:.3e}") } else { format!("{value:.*}", decimals.max(0) as usize) }
}

/// A command to a thousandth.
fn command(value: f64) -> String {
    format!("{}", (1e3 * value).round() / 1e3)
}

/// How a stack writes parameters down.
struct Syntax {
    /// What a comment begins with, its further lines, and its end.
    comment: [&'static str; 3],
    /// Name, value and motors as a line.
    line: fn(&str, &str, u8) -> String,
}

/// Columns of a comment.
const WIDTH: usize = 110;

impl Syntax {
    /// Paragraphs as one comment.
    fn comment(&self, paragraphs: &[String]) -> String {
        let [begin, next, end] = self.comment;
        // A comment in XML ends with two hyphens, so that options are named without them.
        let plain = |words: &String| if end.is_empty() { words.clone() } else { words.replace("--", "option ") };
        let paragraphs: Vec<String> = paragraphs.iter().map(plain).collect();
        let lines: Vec<_> = paragraphs.iter().flat_map(|words| textwrap::wrap(words, WIDTH)).collect();
        format!("{begin}{}{end}\n", lines.join(&format!("\n{next}")))
    }

    fn for_stack(stack: Stack) -> Self {
        let script = ["# ", "# ", ""];
        let xml = ["<!-- ", "     ", " -->"];
        match stack {
            Stack::Betaflight => Self { comment: script, line: |name, value, _| format!("set {name} = {value}") },
            Stack::Px4 => Self { comment: script, line: |name, value, _| format!("param set {name} {value}") },
            Stack::Ardupilot => Self { comment: script, line: |name, value, _| format!("{name},{value}") },
            Stack::Paparazzi => Self {
                comment: xml,
                line: |name, value, motors| {
                    format!("<define name=\"{name}\" value=\"{{{}}}\"/>", repeat_for_motors(value, motors, ", "))
                },
            },
            Stack::Indiflight => Self {
                comment: script,
                line: |name, value, motors| format!("set {name} = {}", repeat_for_motors(value, motors, ",")),
            },
            Stack::Gazebo => Self { comment: xml, line: |name, value, _| format!("<{name}>{value}</{name}>") },
        }
    }
}

fn repeat_for_motors(value: &str, motors: u8, separator: &str) -> String {
    vec![value; usize::from(motors)].join(separator)
}
