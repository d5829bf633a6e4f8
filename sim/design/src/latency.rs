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

use rotorlead::protocol::UsualFrames;
use rotorlead::settings::{HIGHEST_STOP, Pulse, PulseProtocol, Settings, SettingsError, Validated};
use rotorlead::throttle::Command;
use serde::Serialize;

/// From a fall of the line until it is the end of a pulse: 8 samples of the input filter at 42 MHz, and the 2 us for
/// which the line has to stay low (docs/firmware.md, "From pulse in to pulse out"). Derived: 0.19 us and 2 us.
const INPUT_FILTER_S: f64 = 2.2e-6;
/// After a frame of DShot the line stays low for so many of its bits until it is the frame's end. Derived: within a frame no low is as
/// long, as even a zero is high for 3 eighths of its bit.
const DSHOT_GAP_BITS: f64 = 1.0;

/// When an output frame starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FrameStart {
    /// At its own rate: a new value waits for the next frame.
    FreeRunning,
    /// With the value of a fresh input pulse, as soon as the frame under way has its shortest length.
    FollowsInput,
}

/// Time that one step takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
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
    /// The wait for the next output frame. Its worst is what it adds to the worst of the others.
    pub output_frame: Delay,
}

impl Latency {
    /// For these pulses and this loop. The output follows the input where a controller with these settings lets it.
    ///
    /// # Errors
    /// [`SettingsError`] where a controller refuses the pulses.
    pub fn new(input: Pulse, output: Pulse, loop_rate_hz: f64) -> Result<Self, SettingsError> {
        let mut settings = Settings { input, output, ..Settings::default() };
        if output.protocol == PulseProtocol::RawDuty {
            // Duties that have edges at every frame rate.
            settings.stop = HIGHEST_STOP;
            settings.motors.iter_mut().for_each(|motor| motor.max = Command::ONE.to_bits() - HIGHEST_STOP);
        }
        Ok(Self::from_settings(&settings.validate()?, loop_rate_hz))
    }

    /// With the pulses of standard PWM at their usual rates.
    #[must_use]
    pub fn standard(loop_rate_hz: f64) -> Self {
        let protocol = PulseProtocol::StandardPwm;
        let UsualFrames { input_hz, output_hz } = protocol.specification().usual_frames;
        let (input, output) = (protocol.at(input_hz), protocol.at(output_hz));
        let settings = Settings { input, output, ..Settings::default() };
        // They are valid: a test holds them to it.
        Self::from_settings(&settings.validate().unwrap_or_default(), loop_rate_hz)
    }

    fn from_settings(settings: &Validated, loop_rate_hz: f64) -> Self {
        let (input, output) = (settings.input, settings.output);
        let tick_s = 1.0 / loop_rate_hz;
        let (shortest_s, longest_s) = pulse_range_s(input);
        // The loop's rate need not be one that a controller takes.
        let follows = settings.output_follows_input() && f64::from(input.frame_hz) < loop_rate_hz;
        let (frame_start, output_frame) = if settings.relays_frames() {
            (FrameStart::FollowsInput, Delay::default())
        } else if output.protocol.dshot().is_some() {
            // A frame goes out at every tick, or at one in so many.
            let ticks_per_frame = (loop_rate_hz * frame_s(output)).ceil().max(1.0);
            (FrameStart::FreeRunning, Delay::wait((ticks_per_frame - 1.0) * tick_s))
        } else if follows {
            // A pulse read too soon after the last one waits until the running output frame has its minimum length. That frame is
            // shorter than an input frame, so the latency with the wait never exceeds the longest latency of a pulse that does not
            // wait: the worst case gains nothing.
            let mean_s = mean_wait_s(frame_s(input), frame_s(output), tick_s);
            (FrameStart::FollowsInput, Delay { mean_s, worst_s: 0.0 })
        } else {
            (FrameStart::FreeRunning, Delay::wait(frame_s(output)))
        };
        Self {
            input,
            output,
            loop_rate_hz,
            frame_start,
            input_pulse: Delay { mean_s: 0.5 * (shortest_s + longest_s), worst_s: longest_s },
            input_filter: Delay { mean_s: input_filter_s(input), worst_s: input_filter_s(input) },
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

/// How long the pulses of a steady command wait on average, where frames follow them: pulses are read at ticks, so that
/// some are read closer together than the flight controller sends them, and the output frame under way may not have its
/// length by then. Each wait follows from the one before, while the clocks drift by one tick.
fn mean_wait_s(input_s: f64, output_s: f64, tick_s: f64) -> f64 {
    /// Chosen: the pulses pass through a tick in as many steps; fewer make the mean coarser, more cost only time.
    const PULSES: u32 = 10_000;
    let ticks_apart = input_s / tick_s + 1.0 / f64::from(PULSES);
    let read_s = |n: u32| (f64::from(n) * ticks_apart).ceil() * tick_s;
    let (mut wait_s, mut sum_s) = (0.0_f64, 0.0);
    for n in 1..=PULSES {
        let apart_s = read_s(n) - read_s(n - 1);
        // One that comes while the one before still waits begins with the same frame.
        let is_same_frame = apart_s == 0.0 || wait_s > apart_s;
        wait_s = if is_same_frame { wait_s - apart_s } else { (wait_s + output_s - apart_s).max(0.0) };
        sum_s += wait_s;
    }
    sum_s / f64::from(PULSES)
}

/// Seconds between two frames.
fn frame_s(pulse: Pulse) -> f64 {
    1.0 / f64::from(pulse.frame_hz)
}

/// The shortest and the longest pulse, seconds.
fn pulse_range_s(pulse: Pulse) -> (f64, f64) {
    match pulse.protocol.range_us() {
        Some((shortest_us, longest_us)) => (1e-6 * f64::from(shortest_us), 1e-6 * f64::from(longest_us)),
        None => (0.0, frame_s(pulse)),
    }
}

/// From the end of a pulse until it is known as one.
fn input_filter_s(pulse: Pulse) -> f64 {
    pulse.protocol.dshot().map_or(INPUT_FILTER_S, |line| DSHOT_GAP_BITS / f64::from(line.speed.bits_per_s()))
}

#[cfg(test)]
mod tests {
    use rotorlead::settings::{FASTEST_RAW_DUTY_HZ, Key};

    use super::*;
    use PulseProtocol::{Dshot300, Dshot600, OneShot125, RawDuty, StandardPwm};

    fn latency(protocol: PulseProtocol, input_hz: u16, output_hz: u16) -> Latency {
        let pulse = |frame_hz| Pulse { protocol, frame_hz };
        Latency::new(pulse(input_hz), pulse(output_hz), 5000.0).unwrap()
    }

    #[test]
    fn free_running_frames_have_the_latency_of_their_steps() {
        // Milliseconds and degrees at 94 rad/s, to the digits of the firmware's documentation.
        for (protocol, hz, mean_ms, worst_ms, degrees) in
            [(StandardPwm, 400, 2.85, 4.7, 15.4), (RawDuty, 600, 1.77, 3.5, 9.5), (OneShot125, 3703, 0.42, 0.72, 2.3)]
        {
            let latency = latency(protocol, hz, hz);
            assert_eq!(latency.frame_start, FrameStart::FreeRunning);
            let Delay { mean_s, worst_s } = latency.total();
            assert!((1e3 * mean_s - mean_ms).abs() <= 0.005, "{protocol:?}: {mean_s}");
            let digit = if worst_ms < 1.0 { 0.005 } else { 0.05 };
            assert!((1e3 * worst_s - worst_ms).abs() <= digit, "{protocol:?}: {worst_s}");
            assert!(((94.0 * mean_s).to_degrees() - degrees).abs() <= 0.05, "{protocol:?}: {mean_s}");
        }
        // Exactly: half of 1000 to 2000 us, the filter, half a tick, half a frame.
        let pwm = latency(StandardPwm, 400, 400).total();
        assert!((pwm.mean_s - (1500.0 + 2.2 + 100.0 + 1250.0) * 1e-6).abs() < 1e-15);
        assert!((pwm.worst_s - (2000.0 + 2.2 + 200.0 + 2500.0) * 1e-6).abs() < 1e-15);
    }

    #[test]
    fn frames_that_follow_the_input_wait_only_for_the_length_of_the_frame_under_way() {
        for (protocol, input_hz, output_hz, wait_us) in [
            (StandardPwm, 400, 450, 0.0),
            // After 2 and 3.
            (OneShot125, 2000, 2400, 0.5 * (1e6 / 2400.0 - 400.0)),
            (StandardPwm, 50, 60, 0.0),
            // Read after 12 and 13 ticks of 200 us by turns: every other one is 2400 us after the one before.
            (StandardPwm, 400, 410, 0.5 * (1e6 / 410.0 - 2400.0)),
        ] {
            let latency = latency(protocol, input_hz, output_hz);
            assert_eq!(latency.frame_start, FrameStart::FollowsInput);
            let found_us = 1e6 * latency.output_frame.mean_s;
            assert!((found_us - wait_us).abs() < 1e-2, "{latency:?}");
            let worst_s = latency.input_pulse.worst_s + INPUT_FILTER_S + 200e-6;
            assert!((latency.total().worst_s - worst_s).abs() < 1e-15, "{latency:?}");
        }
        assert_eq!(Latency::standard(5000.0), latency(StandardPwm, 400, 450));
    }

    #[test]
    fn frames_follow_where_the_controller_locks_them_to_the_input() {
        for (input_hz, output_hz, start) in [
            (400, 350, FrameStart::FreeRunning),
            (400, 400, FrameStart::FreeRunning),
            (400, 401, FrameStart::FollowsInput),
            (200, 399, FrameStart::FollowsInput),
            (200, 400, FrameStart::FreeRunning),
        ] {
            assert_eq!(latency(StandardPwm, input_hz, output_hz).frame_start, start, "{input_hz} -> {output_hz}");
        }
        assert_eq!(latency(RawDuty, 400, 450).frame_start, FrameStart::FreeRunning);
    }

    #[test]
    fn frames_wait_for_a_tick_and_those_for_pulses_for_theirs() {
        // A frame of 27 us, a gap of a bit, half a tick.
        let relayed = latency(Dshot600, 4000, 4000);
        assert_eq!(relayed.frame_start, FrameStart::FollowsInput);
        assert!((relayed.total().mean_s - (27.0 + 1e6 / 600e3 + 100.0) * 1e-6).abs() < 1e-12, "{relayed:?}");
        let pulse = |protocol, frame_hz| Pulse { protocol, frame_hz };
        for (output_hz, ticks) in [(5000, 1.0), (4000, 2.0), (1000, 5.0)] {
            let mixed = Latency::new(pulse(StandardPwm, 400), pulse(Dshot300, output_hz), 5000.0).unwrap();
            assert_eq!(mixed.frame_start, FrameStart::FreeRunning);
            assert!((mixed.output_frame.worst_s - (ticks - 1.0) * 200e-6).abs() < 1e-12, "{mixed:?}");
        }
    }

    #[test]
    fn pulses_that_a_controller_refuses_are_refused() {
        let good = Latency::standard(5000.0).input;
        for (protocol, frame_hz) in
            [(StandardPwm, 39), (StandardPwm, 496), (OneShot125, 3704), (RawDuty, FASTEST_RAW_DUTY_HZ + 1)]
        {
            let bad = Pulse { protocol, frame_hz };
            for (input, output, key) in [(bad, good, Key::InputFrameHz), (good, bad, Key::OutputFrameHz)] {
                assert_eq!(Latency::new(input, output, 5000.0).unwrap_err().place.key, key, "{bad:?}");
            }
        }
        latency(RawDuty, FASTEST_RAW_DUTY_HZ, FASTEST_RAW_DUTY_HZ);
    }
}
