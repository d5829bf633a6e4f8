//! Options about the pulses in and out.

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use rotorlead::protocol::{PulseProtocol, UsualFrames};
use rotorlead_design::Latency;

use super::UsageError;

/// The pulses between which the controller sits.
#[derive(Args, Clone, Copy, Debug)]
pub struct LatencyArguments {
    /// Pulses of the flight controller, for the latency that the phases count
    #[arg(long, value_name = "PROTOCOL", value_parser = protocol(), default_value = "standard_pwm")]
    input_protocol: PulseProtocol,
    #[arg(long, value_name = "HZ", allow_negative_numbers = true, help = format!(
        "Their rate; {} unless given", usual_rates(|frames| frames.input_hz)
    ))]
    input_frame: Option<u16>,
    /// Pulses to the ESC; as the input's unless given
    #[arg(long, value_name = "PROTOCOL", value_parser = protocol())]
    output_protocol: Option<PulseProtocol>,
    #[arg(long, value_name = "HZ", allow_negative_numbers = true, help = format!(
        "Their highest rate; {} unless given. Above --input-frame and under twice that, frames start with the input's pulses; \
         otherwise, and for raw_duty, at this rate. DShot in and out goes out as it comes",
        usual_rates(|frames| frames.output_hz)
    ))]
    output_frame: Option<u16>,
}

/// The protocols as help lists them: pulses of a width first, and frames of bits last.
fn listed() -> Vec<PulseProtocol> {
    let mut protocols = PulseProtocol::ALL.to_vec();
    protocols.sort_by_key(|protocol| (protocol.dshot().is_some(), protocol.range_us().is_none()));
    protocols
}

/// A protocol by its name.
fn protocol() -> impl TypedValueParser<Value = PulseProtocol> {
    let value = |protocol: PulseProtocol| PossibleValue::new(protocol.name()).help(protocol.specification().summary);
    let named = |name: String| listed().into_iter().find(|protocol| protocol.name() == name);
    PossibleValuesParser::new(listed().into_iter().map(value)).try_map(move |name| named(name).ok_or("no protocol"))
}

/// The usual rates of all protocols, in words.
fn usual_rates(rate_hz: fn(UsualFrames) -> u16) -> String {
    let rate_hz = |protocol: PulseProtocol| rate_hz(protocol.specification().usual_frames);
    let pulses = listed().into_iter().filter(|protocol| protocol.dshot().is_none());
    let pulses: Vec<String> = pulses.map(|protocol| format!("{} for {}", rate_hz(protocol), protocol.name())).collect();
    format!("{} and {} for DShot", pulses.join(", "), rate_hz(PulseProtocol::Dshot600)).replacen(" for", " Hz for", 1)
}

impl LatencyArguments {
    /// The latency of a controller with a loop at `loop_rate_hz`.
    pub fn latency(&self, loop_rate_hz: f64) -> Result<Latency, UsageError> {
        let usual = |protocol: PulseProtocol| protocol.specification().usual_frames;
        let protocol = self.input_protocol;
        let input = protocol.at(self.input_frame.unwrap_or(usual(protocol).input_hz));
        let protocol = self.output_protocol.unwrap_or(protocol);
        let output = protocol.at(self.output_frame.unwrap_or(usual(protocol).output_hz));
        Latency::new(input, output, loop_rate_hz).map_err(|error| {
            UsageError::new(
                format!("a controller refuses these pulses: {error}"),
                "give --input-frame, --output-frame and the protocols as the controller's settings have them",
            )
        })
    }
}
