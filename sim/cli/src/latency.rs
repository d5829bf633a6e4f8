//! Options about the pulses in and out.

use clap::{Args, ValueEnum};
use rotorlead::settings::{Pulse, PulseProtocol};
use rotorlead_design::{Latency, STANDARD_FRAMES_HZ};

use super::WrongUse;

/// The pulses between which the controller sits.
#[derive(Args, Clone, Copy, Debug)]
pub struct LatencyArguments {
    /// Pulses of the flight controller, for the latency that the phases count
    #[arg(long, value_name = "PROTOCOL", value_enum, default_value = "standard_pwm")]
    input_protocol: PulseName,
    /// Their rate; 400 Hz for standard_pwm, 2000 for oneshot125, 600 for raw_duty and 4000 for DShot unless given
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    input_frame: Option<u16>,
    /// Pulses to the ESC; as the input's unless given
    #[arg(long, value_name = "PROTOCOL", value_enum)]
    output_protocol: Option<PulseName>,
    /// Their highest rate; 450 Hz for standard_pwm, 2400 for oneshot125, 600 for raw_duty and 5000 for DShot unless given. Above
    /// --input-frame and under twice that, frames start with the input's pulses; otherwise, and for raw_duty, at this rate. DShot
    /// in and out goes out as it comes
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    output_frame: Option<u16>,
}

/// A protocol, as the settings of a controller name it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PulseName {
    /// 1000 to 2000 us
    #[value(name = "standard_pwm")]
    StandardPwm,
    /// 125 to 250 us
    #[value(name = "oneshot125")]
    OneShot125,
    /// The duty cycle is the command
    #[value(name = "raw_duty")]
    RawDuty,
    /// Frames at 150 kbit/s
    Dshot150,
    /// Frames at 300 kbit/s
    Dshot300,
    /// Frames at 600 kbit/s
    Dshot600,
    /// Frames at 300 kbit/s that the ESC answers
    #[value(name = "dshot300_bidirectional")]
    Dshot300Bidirectional,
    /// Frames at 600 kbit/s that the ESC answers
    #[value(name = "dshot600_bidirectional")]
    Dshot600Bidirectional,
}

impl From<PulseName> for PulseProtocol {
    fn from(name: PulseName) -> Self {
        match name {
            PulseName::StandardPwm => Self::StandardPwm,
            PulseName::OneShot125 => Self::OneShot125,
            PulseName::RawDuty => Self::RawDuty,
            PulseName::Dshot150 => Self::Dshot150,
            PulseName::Dshot300 => Self::Dshot300,
            PulseName::Dshot600 => Self::Dshot600,
            PulseName::Dshot300Bidirectional => Self::Dshot300Bidirectional,
            PulseName::Dshot600Bidirectional => Self::Dshot600Bidirectional,
        }
    }
}

/// Frames per second in and out unless given. Those of a raw duty are the paper's.
const fn default_frames_hz(protocol: PulseProtocol) -> (u16, u16) {
    match protocol {
        PulseProtocol::StandardPwm => (STANDARD_FRAMES_HZ[0], STANDARD_FRAMES_HZ[1]),
        PulseProtocol::OneShot125 => (2000, 2400),
        PulseProtocol::RawDuty => (600, 600),
        PulseProtocol::Dshot150 | PulseProtocol::Dshot300 | PulseProtocol::Dshot600 => (4000, 5000),
        PulseProtocol::Dshot300Bidirectional | PulseProtocol::Dshot600Bidirectional => (4000, 4000),
    }
}

impl LatencyArguments {
    /// The latency of a controller with a loop at `loop_rate_hz`.
    pub fn latency(&self, loop_rate_hz: f64) -> Result<Latency, WrongUse> {
        let protocol = PulseProtocol::from(self.input_protocol);
        let input = Pulse { protocol, frame_hz: self.input_frame.unwrap_or(default_frames_hz(protocol).0) };
        let protocol = self.output_protocol.map_or(protocol, PulseProtocol::from);
        let output = Pulse { protocol, frame_hz: self.output_frame.unwrap_or(default_frames_hz(protocol).1) };
        Latency::new(input, output, loop_rate_hz).map_err(|error| {
            WrongUse::new(
                format!("a controller refuses these pulses: {error}"),
                "give --input-frame, --output-frame and the protocols as the controller's settings have them",
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use rotorlead::settings::Settings;
    use rotorlead_device::set;
    use rotorlead_results::protocol_name;

    use super::*;

    #[test]
    fn protocols_have_the_names_of_a_controllers_settings() {
        for protocol in PulseName::value_variants() {
            let mut settings = Settings::default();
            let name = protocol.to_possible_value().unwrap();
            set(&mut settings, "input.protocol", name.get_name()).unwrap();
            assert_eq!(settings.input.protocol, PulseProtocol::from(*protocol));
            assert_eq!(protocol_name(settings.input.protocol), name.get_name());
        }
    }
}
