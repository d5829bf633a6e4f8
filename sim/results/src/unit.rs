//! Units of a response.

use rotorlead_records::Output;

/// The unit of a response, and of a static gain: newtons, or revolutions per minute, per unit of command.
#[must_use]
pub fn unit(output: Output) -> &'static str {
    match output {
        Output::ThrustN => "N",
        Output::Rpm => "rpm",
    }
}

/// What the response is, with its unit apart.
#[must_use]
pub fn quantity(output: Output) -> (&'static str, &'static str) {
    match output {
        Output::ThrustN => ("thrust", "N"),
        Output::Rpm => ("rotor speed", "rpm"),
    }
}

/// Decibels over one of its units per unit of command.
#[must_use]
pub(super) fn gain_decibels(output: Output) -> String {
    format!("dB over 1 {} per unit of command", unit(output))
}
