//! Options about the pulses in and out, and what the chain's phase is said to be.

use clap::{Args, ValueEnum};
use rotorlead::settings::{Pulse, PulseProtocol};
use serde_json::{Value, json};

use super::WrongUse;
use super::outcome::paragraph;
use crate::design::{BandwidthPoint, ChainPhase, Delay, FrameStart, Latency};
use crate::identify::Bandwidth;
use crate::report::bandwidth_cell;

/// The pulses between which the controller sits.
#[derive(Args, Clone, Copy, Debug)]
pub struct LatencyArguments {
    /// Pulses of the flight controller, for the latency that the phases count
    #[arg(long, value_name = "PROTOCOL", value_enum, default_value = "standard_pwm")]
    input_protocol: PulseName,
    /// Their rate; 400 Hz for standard_pwm, 2000 for oneshot125 and 600 for raw_duty unless given
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    input_frame: Option<u16>,
    /// Pulses to the ESC; as the input's unless given
    #[arg(long, value_name = "PROTOCOL", value_enum)]
    output_protocol: Option<PulseName>,
    /// Their highest rate; 450 Hz for standard_pwm, 2400 for oneshot125 and 600 for raw_duty unless given. Above
    /// --input-frame and under twice that, frames start with the input's pulses; otherwise, and for raw_duty, at this rate
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
}

impl From<PulseName> for PulseProtocol {
    fn from(name: PulseName) -> Self {
        match name {
            PulseName::StandardPwm => Self::StandardPwm,
            PulseName::OneShot125 => Self::OneShot125,
            PulseName::RawDuty => Self::RawDuty,
        }
    }
}

/// Frames per second in and out unless given. Those of standard PWM are a controller's defaults, and those of a raw duty
/// the paper's.
const fn default_frames_hz(protocol: PulseProtocol) -> (u16, u16) {
    match protocol {
        PulseProtocol::StandardPwm => (400, 450),
        PulseProtocol::OneShot125 => (2000, 2400),
        PulseProtocol::RawDuty => (600, 600),
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

impl From<PulseProtocol> for PulseName {
    fn from(protocol: PulseProtocol) -> Self {
        match protocol {
            PulseProtocol::StandardPwm => Self::StandardPwm,
            PulseProtocol::OneShot125 => Self::OneShot125,
            PulseProtocol::RawDuty => Self::RawDuty,
        }
    }
}

/// A value as it is given on the command line.
fn name(value: impl ValueEnum) -> String {
    value.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

/// The latency with its steps and what they are computed from.
pub fn latency_json(latency: &Latency) -> Value {
    let delay = |delay: Delay| json!({ "mean_s": delay.mean_s, "worst_s": delay.worst_s });
    let pulse = |pulse: Pulse| json!({ "protocol": name(PulseName::from(pulse.protocol)), "frame_hz": pulse.frame_hz });
    let total = latency.total();
    let start = match latency.frame_start {
        FrameStart::FollowsInput => "follows_input",
        FrameStart::FreeRunning => "free_running",
    };
    json!({
        "mean_s": total.mean_s,
        "worst_s": total.worst_s,
        "input": pulse(latency.input),
        "output": pulse(latency.output),
        "output_start": start,
        "loop_rate_hz": latency.loop_rate_hz,
        "steps": {
            "input_pulse": delay(latency.input_pulse),
            "input_filter": delay(latency.input_filter),
            "tick": delay(latency.tick),
            "output_frame": delay(latency.output_frame),
        },
    })
}

/// Which pure delays the phases count, to be printed below their table.
pub fn counted_delays(latency: &Latency, phases: &[ChainPhase]) -> String {
    let total = latency.total();
    let pulse = |pulse: Pulse| format!("{} at {} Hz", name(PulseName::from(pulse.protocol)), pulse.frame_hz);
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

/// Said where dead time takes the use from what the compensator gains ([`ChainPhase::is_gain_lost`]), with the numbers of
/// the point that it takes most from.
pub fn lost_gain(points: &[BandwidthPoint], phases: &[ChainPhase]) -> Option<String> {
    let lost: Vec<_> = points.iter().zip(phases).filter(|(point, phase)| phase.is_gain_lost(point)).collect();
    let lag_deg = |(point, phase): &(&BandwidthPoint, &ChainPhase)| {
        (highest_rad_s(point.compensated) * phase.dead_time_s()).to_degrees()
    };
    let worst = lost.iter().max_by(|a, b| lag_deg(a).total_cmp(&lag_deg(b)))?;
    let (point, phase) = worst;
    let whole = phase.compensated.phase_deg.map(|deg| format!(", and the phase of the whole chain is {deg:.0}"));
    let cell = |bandwidth| bandwidth_cell(bandwidth, 1);
    Some(format!(
        "warning: dead time makes the gained bandwidth worthless at {} of {} points. At u_nom {:.3} the compensator promises {} \
         rad/s instead of {}, but the dead time of {:.1} ms (model {:.1}, pulse in to pulse out {:.1}) alone lags {:.0} degrees \
         there{}. A controller can use the chain up to {} rad/s, where it lags 90 degrees ({} without the compensator). {}",
        lost.len(),
        points.len(),
        point.nominal,
        cell(point.compensated),
        cell(point.uncompensated),
        1e3 * phase.dead_time_s(),
        1e3 * phase.model_dead_time_s,
        1e3 * phase.latency_s,
        lag_deg(worst),
        whole.unwrap_or_default(),
        cell(phase.compensated.minus_90),
        cell(phase.uncompensated.minus_90),
        remedy(phase),
    ))
}

/// What to do, by the larger part of the dead time.
fn remedy(phase: &ChainPhase) -> &'static str {
    if phase.model_dead_time_s > phase.latency_s {
        "Find out whether the logger or the stand's command makes the dead time: then record again without it, as with \
         `rotorlead device record`, and identify again. Where ESC and motor make it, use another ESC or protocol. A lower \
         --omega-g does not shorten it, but amplifies less noise above what can be used"
    } else {
        "Use shorter and faster pulses: --input-protocol and --output-protocol oneshot125, or a higher --input-frame with an \
         --output-frame some percent above it"
    }
}

/// Warnings for a place that has its own mark of them.
pub fn without_mark(warnings: &[String]) -> Vec<String> {
    warnings.iter().map(|warning| warning.trim_start_matches("warning: ").to_owned()).collect()
}

/// The frequency, or up to where there is none.
fn highest_rad_s(bandwidth: Bandwidth) -> f64 {
    match bandwidth {
        Bandwidth::At(omega) | Bandwidth::Beyond(omega) => omega,
    }
}

#[cfg(test)]
mod tests {
    use rotorlead::settings::Settings;

    use super::*;
    use crate::bench::device::set;

    #[test]
    fn protocols_have_the_names_of_a_controllers_settings() {
        for protocol in PulseName::value_variants() {
            let mut settings = Settings::default();
            set(&mut settings, "input.protocol", &name(*protocol)).unwrap();
            assert_eq!(settings.input.protocol, PulseProtocol::from(*protocol));
        }
    }

    #[test]
    fn default_frames_are_those_of_a_controller() {
        let Settings { input, output, .. } = Settings::default();
        assert_eq!(default_frames_hz(input.protocol), (input.frame_hz, output.frame_hz));
    }
}
