//! `model.toml`: what is known of one actuator.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// One actuator: a first-order lag at each nominal command, and what else is known of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Version of the file's layout; 1.
    pub format: u32,
    /// The linear models, by increasing nominal command.
    #[serde(rename = "point", default)]
    pub points: Vec<Point>,
    /// Steady response against command.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub static_map: Option<StaticMap>,
    /// What the actuator does beyond a first-order lag.
    #[serde(rename = "effect", default, skip_serializing_if = "Vec::is_empty")]
    pub effects: Vec<Effect>,
    /// Where the numbers come from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
}

/// The linear model `gain e^(-s delay) / (time_constant s + 1)` around one nominal command (1).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// Command around which it holds, 0..1.
    pub nominal: f64,
    /// Static gain in response units (newtons or revolutions per minute) per unit of command.
    pub gain: f64,
    /// Standard error of `gain`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_std: Option<f64>,
    /// Time constant in seconds, rising and falling alike.
    pub time_constant_s: f64,
    /// Standard error of `time_constant_s`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_constant_s_std: Option<f64>,
    /// Dead time in seconds, beyond the holds of command and ESC frame.
    #[serde(default)]
    pub delay_s: f64,
    /// Standard error of `delay_s`; absent when the delay was not estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delay_s_std: Option<f64>,
    /// Time constant of steps up to this level, seconds (step and staircase records).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_constant_up_s: Option<f64>,
    /// Time constant of steps down to this level, seconds (step and staircase records).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_constant_down_s: Option<f64>,
    /// % fit of the frequency response, where one was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fit_frequency_percent: Option<f64>,
    /// % fit on the square wave, where one was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fit_square_percent: Option<f64>,
    /// % fit on the steps of this level, where there are any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fit_step_percent: Option<f64>,
}

/// Steady response at a set of commands, linear between them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StaticMap {
    /// Commands, increasing, 0..1.
    pub command: Vec<f64>,
    /// Steady responses, newtons or revolutions per minute.
    pub response: Vec<f64>,
}

/// One effect of the catalogue, by its kind and parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Effect {
    /// Its identifier in the catalogue.
    pub kind: String,
    /// Parameters by name, in the units that the name carries.
    #[serde(default)]
    pub parameters: BTreeMap<String, f64>,
    /// Standard errors by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub std: BTreeMap<String, f64>,
}

/// Where a model's numbers come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// The records used.
    pub records: Vec<String>,
    /// The version of this tool.
    pub version: String,
    /// `thrust_n` or `rpm`.
    pub output: crate::record::Output,
    /// Rate at which the command was updated, hertz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command_rate_hz: Option<f64>,
    /// Rate at which the ESC takes over a command, hertz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub esc_frame_hz: Option<f64>,
}
