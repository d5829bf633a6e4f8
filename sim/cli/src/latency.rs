//! Options about the pulses in and out, and what the chain's phase is said to be.

use clap::{Args, ValueEnum};
use rotorlead::settings::{Pulse, PulseProtocol};
use rotorlead_identify::design::{Chain, ChainPhase, FrameStart, Latency, STANDARD_FRAMES_HZ};
use rotorlead_results::protocol_name;

use super::WrongUse;
use rotorlead_answer::words::paragraph;

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

/// Which pure delays the phases count, to be printed below their table.
pub fn counted_delays(latency: &Latency, phases: &[ChainPhase]) -> String {
    let total = latency.total();
    let pulse = |pulse: Pulse| format!("{} at {} Hz", protocol_name(pulse.protocol), pulse.frame_hz);
    let start = match latency.frame_start {
        FrameStart::FollowsInput => "frames follow the input",
        FrameStart::FreeRunning => "frames run freely",
    };
    let said = format!(
        "  Phases are of the whole chain, with its pure delays: {:.2} ms on average from pulse in to pulse out ({:.2} at most; {} \
         in, {} out, {start}), and {} in the model. A rate controller's crossover has to lie below -90 degrees.",
        1e3 * total.mean_s,
        1e3 * total.worst_s,
        pulse(latency.input),
        pulse(latency.output),
        dead_times(phases),
    );
    paragraph(&said, "  ")
}

/// What of the latency the holds of a sampled chain stand for, to be printed below [`counted_delays`]; nothing for a
/// continuous one.
pub fn counted_holds(latency: &Latency, chain: Chain, phases: &[ChainPhase]) -> String {
    let (Chain::Sampled { esc_frame_hz, .. }, Some(phase)) = (chain, phases.first()) else { return String::new() };
    let ms = |delay_s: f64| format!("{:.2} ms", 1e3 * delay_s);
    let [passed_on, filtered] = [phase.uncompensated.waits_s, phase.compensated.waits_s].map(ms);
    let waits = match (latency.frame_start, esc_frame_hz) {
        (_, None) => format!("{filtered} for tick and output frame: no --esc-frame is held"),
        (FrameStart::FreeRunning, Some(hz)) => format!(
            "{filtered} for the holds of tick and ESC frame at {hz} Hz, in place of {} of waits",
            ms(latency.tick.mean_s + latency.output_frame.mean_s)
        ),
        (FrameStart::FollowsInput, Some(hz)) => format!(
            "{passed_on} for the tick without the compensator, and {filtered} with it: what the filter comes to between \
             two pulses waits for the next frame, half an ESC frame at {hz} Hz"
        ),
    };
    let known = ms(latency.input_pulse.mean_s + latency.input_filter.mean_s);
    paragraph(&format!("  With --sampled that is {known} for the pulse in and its filter, and {waits}."), "  ")
}

/// The dead time of the model, in milliseconds.
fn dead_times(phases: &[ChainPhase]) -> String {
    let ms = phases.iter().map(|phase| 1e3 * phase.model_dead_time_s);
    let (low, high) = ms.fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), ms| (low.min(ms), high.max(ms)));
    match (format!("{low:.2}"), format!("{high:.2}")) {
        (_, high) if high == "0.00" => "no dead time".to_owned(),
        (low, high) if low == high => format!("{high} ms of dead time"),
        (low, high) => format!("{low} to {high} ms of dead time"),
    }
}

#[cfg(test)]
mod tests {
    use rotorlead::settings::Settings;
    use rotorlead_device::set;

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
