//! How late a command is between the flight controller's pulse and the ESC's.
//!
//! ```text
//! input   ____|^^^^^^^^^^|______________________
//!             | pulse    |filter |tick  |frame
//! output  ______________________________|^^^^^^^^^^|___
//!             |<---------- latency ---->|
//! ```
//!
//! It counts from the beginning of the input pulse to the beginning of the output pulse that carries its value. The time
//! until the flight controller sends its next pulse, and the length of the pulse out, lie outside of the controller.

use miette::Diagnostic;
use rotorlead::settings::{FRAME_RANGE_HZ, Pulse, PulseProtocol, SHORTEST_LEVEL_US, longest_pulse_us};
use thiserror::Error;

/// From a fall of the line until it is the end of a pulse: 8 samples of the input filter at 42 MHz, and the 2 us for
/// which the line has to stay low (docs/firmware.md, "From pulse in to pulse out").
const INPUT_FILTER_S: f64 = 2.2e-6;

/// When an output frame starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameStart {
    /// At its own rate: a new value waits for the next frame.
    FreeRunning,
    /// With the value of a fresh input pulse, as soon as the output pulse under way has ended.
    FollowsInput,
}

/// Time that one step takes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Delay {
    /// On average, at mid command, seconds.
    pub mean_s: f64,
    /// At most, seconds.
    pub worst_s: f64,
}

impl Delay {
    /// A wait for the next of regular moments: half their distance on average.
    fn wait(interval_s: f64) -> Self {
        Self { mean_s: 0.5 * interval_s, worst_s: interval_s }
    }

    fn plus(self, other: Self) -> Self {
        Self { mean_s: self.mean_s + other.mean_s, worst_s: self.worst_s + other.worst_s }
    }
}

/// From the beginning of an input pulse to the beginning of the output pulse that carries its value, step by step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Latency {
    /// The flight controller's pulses.
    pub input: Pulse,
    /// The ESC's pulses.
    pub output: Pulse,
    /// Ticks of the control loop per second.
    pub loop_rate_hz: f64,
    /// When an output frame starts.
    pub frame_start: FrameStart,
    /// The input pulse itself: its value is known at its end.
    pub input_pulse: Delay,
    /// The input filter, and the time for which the line has to stay low.
    pub input_filter: Delay,
    /// The wait for the next tick of the control loop.
    pub tick: Delay,
    /// The wait for the next output frame.
    pub output_frame: Delay,
}

/// Why pulses and frames do not go together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error, Diagnostic)]
pub enum LatencyError {
    /// The frame rate is outside of what a controller takes.
    #[error("{option} is {frame_hz} Hz, outside its range {} to {} Hz", FRAME_RANGE_HZ.0, FRAME_RANGE_HZ.1)]
    #[diagnostic(help("give the frame rate that the controller is set to"))]
    FrameRate {
        /// The option.
        option: &'static str,
        /// Its value.
        frame_hz: u16,
    },
    /// The longest pulse and the gap after it are longer than the frame.
    #[error(
        "{option} is {frame_hz} Hz: the longest pulse, {longest_us} us, and a gap of {SHORTEST_LEVEL_US} us do not fit"
    )]
    #[diagnostic(help("use {max_frame_hz} Hz or less, or a shorter protocol"))]
    PulseTooLong {
        /// The option.
        option: &'static str,
        /// Its value.
        frame_hz: u16,
        /// The longest pulse of the protocol, microseconds.
        longest_us: u32,
        /// The highest rate that it fits.
        max_frame_hz: u32,
    },
    /// Of a raw duty the ratio to the frame is the value.
    #[error("raw_duty frames cannot follow the input: the value is the ratio of the pulse to its frame")]
    #[diagnostic(help("use --output-start free_running, or another --output-protocol"))]
    RatioOfFrame,
    /// The input is too fast.
    #[error("output frames cannot follow an input of {input_hz} Hz: the longest output pulse takes {longest_us} us")]
    #[diagnostic(help("lower --input-frame to {max_frame_hz} Hz, or use --output-start free_running"))]
    InputTooFast {
        /// Input pulses per second.
        input_hz: u16,
        /// The longest output pulse, microseconds.
        longest_us: u32,
        /// The highest input rate that can be followed.
        max_frame_hz: u32,
    },
}

/// Frames per second unless stated: the controller's default, the fastest OneShot125 that leaves a gap, the paper's ESC.
#[must_use]
pub const fn default_frame_hz(protocol: PulseProtocol) -> u16 {
    match protocol {
        PulseProtocol::StandardPwm => 400,
        PulseProtocol::OneShot125 => 3703,
        PulseProtocol::RawDuty => 600,
    }
}

impl Latency {
    /// For these pulses and this loop. Without a `frame_start` the output follows the input where it can.
    ///
    /// # Errors
    /// [`LatencyError`] when a frame cannot hold its pulse, or the output cannot follow the input as asked.
    pub fn new(
        input: Pulse,
        output: Pulse,
        loop_rate_hz: f64,
        frame_start: Option<FrameStart>,
    ) -> Result<Self, LatencyError> {
        check("--input-frame", input)?;
        check("--output-frame", output)?;
        let possible = can_follow(input, output);
        let frame_start = match frame_start {
            Some(FrameStart::FollowsInput) => possible.map(|()| FrameStart::FollowsInput)?,
            Some(FrameStart::FreeRunning) => FrameStart::FreeRunning,
            None => possible.map_or(FrameStart::FreeRunning, |()| FrameStart::FollowsInput),
        };
        Ok(Self::of(input, output, loop_rate_hz, frame_start))
    }

    /// Standard PWM at 400 Hz in and out, the output following the input: a controller's defaults.
    #[must_use]
    pub fn standard(loop_rate_hz: f64) -> Self {
        let protocol = PulseProtocol::StandardPwm;
        let pulse = Pulse { protocol, frame_hz: default_frame_hz(protocol) };
        Self::of(pulse, pulse, loop_rate_hz, FrameStart::FollowsInput)
    }

    fn of(input: Pulse, output: Pulse, loop_rate_hz: f64, frame_start: FrameStart) -> Self {
        let tick_s = 1.0 / loop_rate_hz;
        let (shortest_s, longest_s) = pulse_range_s(input);
        let output_frame = match frame_start {
            FrameStart::FreeRunning => Delay::wait(frame_s(output)),
            // At a steady command nothing is waited for but the jitter of a tick. Two input pulses are read a frame apart, less a
            // tick, and less the range of the pulse where the second is the shorter: what is left of the output pulse and its
            // gap has to be waited for.
            FrameStart::FollowsInput => {
                let apart_s = (frame_s(input) - (longest_s - shortest_s) - tick_s).max(tick_s);
                let occupied_s = pulse_range_s(output).1 + 1e-6 * f64::from(SHORTEST_LEVEL_US);
                Delay { mean_s: 0.0, worst_s: (occupied_s - apart_s).max(0.0) }
            }
        };
        Self {
            input,
            output,
            loop_rate_hz,
            frame_start,
            input_pulse: Delay { mean_s: 0.5 * (shortest_s + longest_s), worst_s: longest_s },
            input_filter: Delay { mean_s: INPUT_FILTER_S, worst_s: INPUT_FILTER_S },
            tick: Delay::wait(tick_s),
            output_frame,
        }
    }

    /// All steps together.
    #[must_use]
    pub fn total(&self) -> Delay {
        self.input_pulse.plus(self.input_filter).plus(self.tick).plus(self.output_frame)
    }
}

/// Seconds between two frames.
fn frame_s(pulse: Pulse) -> f64 {
    1.0 / f64::from(pulse.frame_hz)
}

/// The shortest and the longest pulse, seconds.
fn pulse_range_s(pulse: Pulse) -> (f64, f64) {
    match longest_pulse_us(pulse.protocol) {
        // Servo pulses and their eighths are half as long at command 0 as at 1.
        Some(longest_us) => (0.5e-6 * f64::from(longest_us), 1e-6 * f64::from(longest_us)),
        None => (0.0, frame_s(pulse)),
    }
}

/// The highest frame rate that holds a pulse of this length and its gap.
const fn highest_frame_hz(longest_us: u32) -> u32 {
    1_000_000 / (longest_us + SHORTEST_LEVEL_US)
}

fn check(option: &'static str, Pulse { protocol, frame_hz }: Pulse) -> Result<(), LatencyError> {
    if frame_hz < FRAME_RANGE_HZ.0 || frame_hz > FRAME_RANGE_HZ.1 {
        return Err(LatencyError::FrameRate { option, frame_hz });
    }
    match longest_pulse_us(protocol) {
        Some(longest_us) if u32::from(frame_hz) > highest_frame_hz(longest_us) => {
            let max_frame_hz = highest_frame_hz(longest_us);
            Err(LatencyError::PulseTooLong { option, frame_hz, longest_us, max_frame_hz })
        }
        _ => Ok(()),
    }
}

/// Whether every input pulse leaves the time for an output pulse.
fn can_follow(input: Pulse, output: Pulse) -> Result<(), LatencyError> {
    let longest_us = longest_pulse_us(output.protocol).ok_or(LatencyError::RatioOfFrame)?;
    let max_frame_hz = highest_frame_hz(longest_us);
    if u32::from(input.frame_hz) > max_frame_hz {
        return Err(LatencyError::InputTooFast { input_hz: input.frame_hz, longest_us, max_frame_hz });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use PulseProtocol::{OneShot125, RawDuty, StandardPwm};

    fn pulse(protocol: PulseProtocol) -> Pulse {
        Pulse { protocol, frame_hz: default_frame_hz(protocol) }
    }

    fn of(protocol: PulseProtocol, start: Option<FrameStart>) -> Latency {
        Latency::new(pulse(protocol), pulse(protocol), 5000.0, start).unwrap()
    }

    #[test]
    fn free_running_frames_have_the_latency_of_their_steps() {
        // Milliseconds and degrees at 94 rad/s, to the digits of the firmware's documentation.
        for (protocol, mean_ms, worst_ms, degrees) in
            [(StandardPwm, 2.85, 4.7, 15.4), (RawDuty, 1.77, 3.5, 9.5), (OneShot125, 0.42, 0.72, 2.3)]
        {
            let Delay { mean_s, worst_s } = of(protocol, Some(FrameStart::FreeRunning)).total();
            assert!((1e3 * mean_s - mean_ms).abs() <= 0.005, "{protocol:?}: {mean_s}");
            let digit = if worst_ms < 1.0 { 0.005 } else { 0.05 };
            assert!((1e3 * worst_s - worst_ms).abs() <= digit, "{protocol:?}: {worst_s}");
            assert!(((94.0 * mean_s).to_degrees() - degrees).abs() <= 0.05, "{protocol:?}: {mean_s}");
        }
        // Exactly: half of 1000 to 2000 us, the filter, half a tick, half a frame.
        let pwm = of(StandardPwm, Some(FrameStart::FreeRunning)).total();
        assert!((pwm.mean_s - (1500.0 + 2.2 + 100.0 + 1250.0) * 1e-6).abs() < 1e-15);
        assert!((pwm.worst_s - (2000.0 + 2.2 + 200.0 + 2500.0) * 1e-6).abs() < 1e-15);
    }

    #[test]
    fn frames_that_follow_the_input_wait_for_nothing_but_a_pulse_under_way() {
        for (protocol, mean_us, frame_us) in [
            (StandardPwm, 1602.2, 2020.0 - (2500.0 - 1000.0 - 200.0)),
            // The next pulse is read one tick later at the earliest.
            (OneShot125, 289.7, 270.0 - 200.0),
        ] {
            let latency = of(protocol, None);
            assert_eq!(latency.frame_start, FrameStart::FollowsInput);
            assert!((latency.total().mean_s - 1e-6 * mean_us).abs() < 1e-15);
            assert_eq!(latency.output_frame.mean_s, 0.0);
            assert!((latency.output_frame.worst_s - 1e-6 * frame_us).abs() < 1e-15, "{latency:?}");
        }
        // At 50 Hz every output pulse has ended long before.
        let slow = Pulse { protocol: StandardPwm, frame_hz: 50 };
        assert_eq!(Latency::new(slow, pulse(StandardPwm), 5000.0, None).unwrap().output_frame, Delay::default());
        assert_eq!(Latency::standard(5000.0), of(StandardPwm, None));
    }

    #[test]
    fn what_cannot_follow_runs_freely_unless_it_is_asked_to_follow() {
        let follows = Some(FrameStart::FollowsInput);
        let new = |input, output, start| Latency::new(pulse(input), pulse(output), 5000.0, start);
        for (input, output) in [(StandardPwm, RawDuty), (OneShot125, StandardPwm), (RawDuty, StandardPwm)] {
            assert_eq!(new(input, output, None).unwrap().frame_start, FrameStart::FreeRunning);
            let refused = new(input, output, follows).unwrap_err();
            assert_eq!(refused == LatencyError::RatioOfFrame, output == RawDuty, "{refused}");
        }
        assert_eq!(new(StandardPwm, OneShot125, None).unwrap().frame_start, FrameStart::FollowsInput);
    }

    #[test]
    fn frames_that_a_controller_refuses_are_refused() {
        let good = pulse(StandardPwm);
        for (protocol, frame_hz, remedy) in [
            (StandardPwm, 496, "495 Hz"),
            (OneShot125, 4000, "3703 Hz"),
            (RawDuty, 39, "set to"),
            (RawDuty, 4001, "set to"),
        ] {
            let bad = Pulse { protocol, frame_hz };
            for (input, output, option) in [(bad, good, "--input-frame"), (good, bad, "--output-frame")] {
                let error = Latency::new(input, output, 5000.0, None).unwrap_err();
                assert!(error.to_string().contains(option), "{error}");
                assert!(error.help().unwrap().to_string().contains(remedy), "{error}");
            }
        }
    }
}
