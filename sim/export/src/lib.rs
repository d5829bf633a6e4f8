//! What flight stacks and simulators call the numbers of a model: their thrust curves, time constants and rotor constants.
//!
//! Each parameter has its stack's own [`Definition`] and normalization, an interval that covers with 95 %, and is refused
//! where the model or the records cannot tell it.

mod betaflight;
mod c_header;
mod definition;
mod files;
mod fit;
mod frequency;
mod frequency_formats;
mod lag;
mod law;
mod levels;
mod maps;
mod remarks;
mod replay;
mod rotor;
mod simulators;
mod stepping;

use rotorlead_plant::Model;
use rotorlead_records::Experiment;
use serde::Serialize;

pub use betaflight::{FirmwareRelease, ThrustLinear};
pub use c_header::c_header;
use definition::StackParameter;
pub use definition::{Definition, Stack};
pub use files::{
    ExportSettings, Exported, ExportedValues, Exporter, FrequencyExport, FrequencyFormat, StackExport, Target,
    is_exported,
};
pub use frequency::{FrequencyResponses, MeasuredLine, TransferFunction};
use lag::{ConfidenceInterval, Direction, LagEstimate};
use law::ThrustLaw;
use maps::Maps;
pub use replay::{RecordFit, Replay};
pub use stepping::{Lagging, Stepping};

/// What a person says of the vehicle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StackOptions {
    /// The command at which a time constant is taken, 0..1; the middle of those measured unless given.
    pub at: Option<f64>,
    /// The commands that the stack's lowest and highest motor outputs are, 0..1; [`Stack::output_range`] unless given.
    pub output_range: Option<(f64, f64)>,
    /// The steps of the simulation, seconds; [`Stepping::step_s`] unless given.
    pub step_s: Option<f64>,
}

/// One parameter of a stack.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// What it is.
    #[serde(flatten)]
    pub definition: &'static Definition,
    /// Its value as the stack takes it, rounded where the stack takes integers.
    pub value: f64,
    /// Lower end of its 95 % interval; `None` where the model has no uncertainty for it.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
    /// The command at which it is taken, where it depends on it.
    pub at: Option<f64>,
    /// The lowest and the highest command whose measurements it is from.
    pub measured: (f64, f64),
    /// The worst error of the stack's law over them, % of full thrust.
    pub worst_error_percent: Option<f64>,
    /// What to know before it is flown.
    pub notes: Vec<String>,
}

/// A parameter that is not known.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Refusal {
    /// The parameter.
    pub name: &'static str,
    /// The releases of the stack that mean it so, where others do not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub releases: Option<&'static str>,
    /// What is missing, and what to do.
    pub why: String,
}

impl Refusal {
    /// The parameter's name, and of which releases it is where others mean another thing by it.
    #[must_use]
    pub fn full_name(&self) -> String {
        definition::full_name(self.name, self.releases)
    }
}

/// All that is known for a stack.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StackParameters {
    /// The stack.
    pub stack: Stack,
    /// What is known.
    pub parameters: Vec<Parameter>,
    /// What is not.
    pub refused: Vec<Refusal>,
}

/// A model's parameters under the names of `stack`. `experiment` adds the responses that the model does not have: thrust
/// beside speed, or the other way around.
#[must_use]
pub fn stack_parameters(
    stack: Stack,
    model: &Model,
    experiment: Option<&Experiment>,
    options: StackOptions,
) -> StackParameters {
    let known = KnownMotor::new(stack, model, experiment, options);
    let (mut parameters, mut refused) = (Vec::new(), Vec::new());
    for definition in stack.definitions() {
        match known.raw(definition.quantity).and_then(|raw| raw.in_units(definition)) {
            Ok(parameter) => parameters.push(parameter),
            Err(why) => refused.push(Refusal { name: definition.name, releases: definition.releases, why }),
        }
    }
    StackParameters { stack, parameters, refused }
}

/// Standard: the 97.5 % quantile of the normal distribution.
const NORMAL_95: f64 = 1.959_964;

/// What is known of the motor, and where it is asked for.
struct KnownMotor<'a> {
    model: &'a Model,
    maps: Maps,
    at: Option<f64>,
    range: (f64, f64),
    /// Of the simulation, seconds; zero for a stack that is none.
    step_s: f64,
}

/// A quantity in SI units.
struct RawParameter {
    band: ConfidenceInterval,
    at: Option<f64>,
    measured: (f64, f64),
    worst_error_percent: Option<f64>,
    notes: Vec<String>,
}

impl<'a> KnownMotor<'a> {
    fn new(stack: Stack, model: &'a Model, experiment: Option<&Experiment>, options: StackOptions) -> Self {
        Self {
            model,
            maps: Maps::from_model(model, experiment),
            at: options.at,
            // A stack without one has no parameter that depends on it.
            range: options.output_range.or(stack.output_range()).unwrap_or((0.0, 1.0)),
            step_s: options.step_s.or(stack.steppings().first().map(|stepping| stepping.step_s)).unwrap_or(0.0),
        }
    }

    fn raw(&self, quantity: StackParameter) -> Result<RawParameter, String> {
        match quantity {
            StackParameter::ThrustCurve(law) => self.thrust_curve(law),
            StackParameter::TimeConstant => self.lag(|lag| Ok(lag.time_constant_s)),
            StackParameter::CornerFrequency => self.lag(|lag| Ok(lag.time_constant_s.inverse())),
            StackParameter::TimeConstantUp => self.lag(|lag| lag.directed(self.model, Direction::Up)),
            StackParameter::TimeConstantDown => self.lag(|lag| lag.directed(self.model, Direction::Down)),
            StackParameter::RateUp => self.lag(|lag| Ok(lag.directed(self.model, Direction::Up)?.inverse())),
            StackParameter::RateDown => self.lag(|lag| Ok(lag.directed(self.model, Direction::Down)?.inverse())),
            StackParameter::DeadTime => self.dead_time(self.step_s),
            StackParameter::DeadTimeSteps => self.dead_time(1.0),
            StackParameter::TopSpeed => Ok(at_top(rotor::top_speed_rad_s(&self.maps, self.range)?)),
            StackParameter::TopThrust => Ok(at_top(rotor::top_thrust_n(&self.maps, self.range)?)),
            StackParameter::SpeedRate => self.speed_rate(),
            StackParameter::MotorConstant => {
                let found = rotor::motor_constant(&self.maps)?;
                let worst_error_percent = Some(found.worst_error_percent);
                let (band, measured) = (found.n_per_rad2_s2, found.measured);
                Ok(RawParameter { band, at: None, measured, worst_error_percent, notes: Vec::new() })
            }
        }
    }

    fn lag(&self, band: impl Fn(LagEstimate) -> Result<ConfidenceInterval, String>) -> Result<RawParameter, String> {
        let lag = LagEstimate::from_model(self.model, self.at)?;
        let mut notes = Vec::new();
        if self.at.is_none() {
            notes.push(String::from("taken in the middle of the commands measured: state that of hover with `--at`"));
        }
        if lag.delay_s > 0.0 {
            notes.push(format!("the model's dead time of {:.1} ms is not part of it", 1e3 * lag.delay_s));
        }
        Ok(RawParameter {
            band: band(lag)?,
            at: Some(lag.at),
            measured: lag.measured,
            worst_error_percent: None,
            notes,
        })
    }

    /// The dead time in whole steps, each of which counts `unit`.
    fn dead_time(&self, unit: f64) -> Result<RawParameter, String> {
        let lag = LagEstimate::from_model(self.model, self.at)?;
        let of = |delay_s: f64| delay_s / self.step_s * unit;
        let steps = (lag.delay_s / self.step_s).round();
        if steps == 0.0 {
            return Err(match lag.delay_s {
                0.0 => String::from("the model has no dead time: leave it out"),
                delay_s => format!(
                    "the model's dead time of {:.2} ms is less than half a step of {:.2} ms: leave it out, or state the steps per second with `--step-rate`",
                    1e3 * delay_s,
                    1e3 * self.step_s
                ),
            });
        }
        let std_s = self.model.points.iter().filter_map(|point| point.delay_s_std).reduce(f64::max);
        let end = |sign: f64| std_s.map(|std_s| of((lag.delay_s + sign * NORMAL_95 * std_s).max(0.0)));
        let band = ConfidenceInterval { value: steps * unit, low: end(-1.0), high: end(1.0) };
        let note = format!(
            "{steps} step{} of {:.4} ms for {:.2} ms; leave it out where it is the log's: a logger's delay is no motor's",
            if steps == 1.0 { "" } else { "s" },
            1e3 * self.step_s,
            1e3 * lag.delay_s
        );
        Ok(RawParameter {
            band,
            at: Some(lag.at),
            measured: lag.measured,
            worst_error_percent: None,
            notes: vec![note],
        })
    }

    fn speed_rate(&self) -> Result<RawParameter, String> {
        let at = match LagEstimate::from_model(self.model, self.at) {
            Ok(lag) => lag.at,
            Err(_) => 0.5 * (self.range.0 + self.range.1),
        };
        let band = rotor::speed_rate_rad_s2(self.model, &self.maps, at)?;
        let note = "the model limits the command ahead of the lag, the simulator the speed itself: ramps of large steps agree, small ones do not";
        Ok(RawParameter {
            band,
            at: Some(at),
            measured: (at, at),
            worst_error_percent: None,
            notes: vec![note.to_owned()],
        })
    }

    fn thrust_curve(&self, law: ThrustLaw) -> Result<RawParameter, String> {
        let (low, high) = self.range;
        let (map, is_speed) = match (&self.maps.thrust_n, &self.maps.rpm) {
            (Some(map), _) => (map, false),
            (None, Some(map)) => (map, true),
            (None, None) => {
                return Err(String::from(
                    "neither thrust nor rotor speed is known at steady levels: identify a staircase, or give its folder with `--records`",
                ));
            }
        };
        let square = |(command, rpm): (f64, f64)| (command, rpm * rpm);
        let levels: Vec<(f64, f64)> =
            maps::with_standstill(map).map(|level| if is_speed { square(level) } else { level }).collect();
        let found = fit::fit(law, &levels, self.range)?;
        let mut notes = vec![format!(
            "holds for motor outputs from {low} to {high} of the command, which `--output-range` changes"
        )];
        if !found.interpolated.is_empty() {
            let commands: Vec<String> = found.interpolated.iter().map(f64::to_string).collect();
            notes.push(format!(
                "the thrust at {} is interpolated by a cubic through the four levels around it; the interval holds its error",
                commands.join(" and at ")
            ));
        }
        if !found.parameter.excludes(0.0) {
            notes.push(String::from(
                "0, which is no linearization, is in the interval: the measurement does not ask for one",
            ));
        }
        if is_speed {
            notes.push(String::from("no thrust was measured: it is taken to go with the square of the rotor speed"));
        }
        Ok(RawParameter {
            band: ConfidenceInterval::from_estimate(found.parameter),
            at: None,
            measured: found.measured,
            worst_error_percent: Some(found.worst_error_percent),
            notes,
        })
    }
}

/// A quantity at the level of the highest motor output.
fn at_top((band, command): (ConfidenceInterval, f64)) -> RawParameter {
    let measured = (command, command);
    RawParameter { band, at: Some(command), measured, worst_error_percent: None, notes: Vec::new() }
}

impl RawParameter {
    /// The parameter in its stack's unit, whole where the stack wants it so; refused beyond what the stack takes.
    fn in_units(mut self, definition: &'static Definition) -> Result<Parameter, String> {
        let ConfidenceInterval { value: exact, low, high } = self.band.times(definition.scale);
        // Plus zero: a stack need not know a minus zero.
        let mut value = if definition.is_integer { exact.round() + 0.0 } else { exact };
        if let (Some((least, most)), Some(low), Some(high)) = (definition.bounds, low, high)
            && !(least..=most).contains(&value)
            && low <= most
            && high >= least
        {
            value = value.clamp(least, most);
            // That of the fitted value is not its own.
            self.worst_error_percent = None;
            self.notes.push(format!(
                "the measurement says {exact:.4}, beyond the {least} to {most} that the stack takes: its interval holds {value}"
            ));
        }
        if let Some((least, most)) = definition.bounds.filter(|(least, most)| !(*least..=*most).contains(&value)) {
            let interval = match (low, high) {
                (Some(low), Some(high)) => format!(" ({low:.4} to {high:.4})"),
                _ => String::new(),
            };
            return Err(format!(
                "the measurement says {exact:.4}{interval}, and it is of use from {least} to {most}: it cannot describe this motor{}",
                self.worst_error_percent
                    .map_or(String::new(), |worst| format!(" (worst error of its law {worst:.1} % of full thrust)"))
            ));
        }
        if definition.is_integer && value != exact {
            self.notes.push(format!("rounded from {exact:.3}: the stack takes whole numbers"));
        }
        Ok(Parameter {
            definition,
            value,
            low,
            high,
            at: self.at,
            measured: self.measured,
            worst_error_percent: self.worst_error_percent,
            notes: self.notes,
        })
    }
}

#[cfg(test)]
mod tests;
