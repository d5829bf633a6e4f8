//! What settings mean for the timers of a board.

use crate::capture::{TIMEOUT_MS, Timing};
use crate::dshot::Line;
use crate::settings::{PulseProtocol, Validated};
use crate::throttle::{Command, EscCommand, PulseScale};

/// Counts of the timer that puts out the pulses: 16 bits.
const COUNTER_RANGE: u32 = 1 << 16;
/// A frame that follows the input waits for this many eighths of the input's frame, since the flight controller's clock may
/// be off, and for as long as two pulses can be further apart where they are seen: the range of their widths, and a control
/// tick.
const PATIENCE_EIGHTHS: u32 = 9;
/// One over the longest time for which the control task can be interrupted between reading the count of a frame and ending
/// it: a byte of the link and edges of all inputs (`super::load`) at 16 MHz, the slowest clock.
const INTERRUPTED_HZ: u32 = 25_000;

/// The timer of the output pulses: its divider and its frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frames {
    /// The counter counts at the timer's clock over this, from 1.
    pub divider: u32,
    /// Frequency of the counter, hertz.
    pub counter_hz: u32,
    /// Shortest frame, counts: one over `output.frame_hz`.
    pub shortest: u32,
    /// Longest frame, counts. Longer than the shortest where frames follow the input's pulses: they wait for the next one.
    pub longest: u32,
    /// A frame that ends by itself within so many counts is not ended early: it could have begun anew in between, and a pulse
    /// would last longer.
    pub restart_margin: u32,
}

impl Frames {
    /// `None` where the timer cannot make them.
    fn new(settings: &Validated, timer_hz: u32) -> Option<Self> {
        let output_hz = u32::from(settings.output.frame_hz);
        let input_hz = u32::from(settings.input.frame_hz);
        let follows = settings.output_follows_input();
        // In counts of a counter; at most 17/8 of 2^32 / 40 and 2^32 / 1000.
        let longest = |counter_hz: u32, shortest: u32| {
            if !follows {
                return shortest;
            }
            let input_frame = counter_hz.checked_div(input_hz).unwrap_or(0);
            let range = match settings.input.protocol.range_us() {
                Some((shortest, longest)) => counter_hz / 1_000_000 * (longest - shortest),
                None => input_frame,
            };
            let tick = counter_hz.checked_div(settings.loop_rate_hz).unwrap_or(0);
            (input_frame / 8 * PATIENCE_EIGHTHS + range + tick).max(shortest)
        };
        let undivided = timer_hz.checked_div(output_hz)?.saturating_add(1);
        // The smallest divider with which the longest frame fits the counter.
        let divider = longest(timer_hz, undivided).div_ceil(COUNTER_RANGE).max(1);
        let counter_hz = timer_hz / divider;
        let shortest = match settings.output.protocol {
            // The duty is a share of just this many counts.
            PulseProtocol::RawDuty => settings.output.scale(counter_hz).ok()?.high_ticks(),
            // Never faster than the frame rate.
            _ => counter_hz.div_ceil(output_hz),
        };
        let longest = longest(counter_hz, shortest);
        let restart_margin = counter_hz / INTERRUPTED_HZ;
        (longest <= COUNTER_RANGE).then_some(Self { divider, counter_hz, shortest, longest, restart_margin })
    }

    /// Frames in a second, where so many pulses come in.
    const fn rate(&self, input_hz: u32) -> u32 {
        let (Some(fastest), Some(slowest)) =
            (self.counter_hz.checked_div(self.shortest), self.counter_hz.checked_div(self.longest))
        else {
            return 0;
        };
        match input_hz {
            // Frames that wait for no pulse come at their own rate.
            0 => fastest,
            _ if input_hz >= fastest => fastest,
            _ if input_hz <= slowest => slowest,
            _ => input_hz,
        }
    }

    /// Whether frames begin with the input's pulses.
    #[must_use]
    pub const fn follow_input(&self) -> bool {
        self.longest > self.shortest
    }
}

/// When frames of DShot go out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameRate {
    /// One for each that came in, some so many control ticks apart.
    Relayed(u32),
    /// One in so many control ticks.
    Ticks(u32),
}

impl FrameRate {
    /// From one frame to the next, in control ticks.
    #[must_use]
    pub const fn ticks(self) -> u32 {
        match self {
            Self::Relayed(ticks) | Self::Ticks(ticks) => ticks,
        }
    }
}

/// What the inputs have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputPlan {
    /// What they take for a pulse.
    Pulses(Timing),
    /// Frames.
    Dshot {
        /// On such lines.
        line: Line,
        /// The last one is good for so many control ticks.
        timeout_ticks: u32,
    },
}

impl InputPlan {
    fn new(settings: &Validated, timer_hz: u32) -> Option<Self> {
        let rate_hz = settings.loop_rate_hz;
        Some(match settings.input.protocol.dshot() {
            Some(line) => Self::Dshot { line, timeout_ticks: super::ticks(TIMEOUT_MS, rate_hz) },
            None => Self::Pulses(Timing::new(settings.input, timer_hz, rate_hz).ok()?),
        })
    }

    /// Of the pulses, where there are any.
    #[must_use]
    pub const fn timing(&self) -> Option<Timing> {
        match self {
            Self::Pulses(timing) => Some(*timing),
            Self::Dshot { .. } => None,
        }
    }
}

/// What the outputs have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputPlan {
    /// Pulses.
    Pulses {
        /// What they mean.
        scale: PulseScale,
        /// Their frames.
        frames: Frames,
    },
    /// Frames of bits.
    Dshot {
        /// On such lines.
        line: Line,
        /// When.
        rate: FrameRate,
    },
}

impl OutputPlan {
    fn new(settings: &Validated, timer_hz: u32) -> Option<Self> {
        if let Some(line) = settings.output.protocol.dshot() {
            let rate = if settings.relays_frames() {
                FrameRate::Relayed(settings.frame_ticks(settings.input))
            } else {
                FrameRate::Ticks(settings.frame_ticks(settings.output))
            };
            return Some(Self::Dshot { line, rate });
        }
        let frames = Frames::new(settings, timer_hz)?;
        let scale = settings.output.scale(frames.counter_hz).ok()?;
        // A pulse without a gap behind it would be a line that is always high.
        (longest_pulse_ticks(settings, scale) < frames.shortest).then_some(Self::Pulses { scale, frames })
    }

    /// Pulses or frames in a second, where so many come in.
    pub(super) const fn frame_hz(&self, input_hz: u32, loop_rate_hz: u32) -> u32 {
        match self {
            // Throttles that come in one tick go out as one.
            Self::Dshot { rate: FrameRate::Relayed(_), .. } => {
                if input_hz < loop_rate_hz {
                    input_hz
                } else {
                    loop_rate_hz
                }
            }
            Self::Dshot { rate: FrameRate::Ticks(ticks), .. } => match loop_rate_hz.checked_div(*ticks) {
                Some(rate) => rate,
                None => 0,
            },
            Self::Pulses { frames, .. } => frames.rate(input_hz),
        }
    }

    /// The lines with frames of bits, where there are any.
    #[must_use]
    pub const fn line(&self) -> Option<Line> {
        match self {
            Self::Dshot { line, .. } => Some(*line),
            Self::Pulses { .. } => None,
        }
    }

    /// Scale and frames of the pulses, where there are any.
    #[must_use]
    pub const fn pulses(&self) -> Option<(PulseScale, Frames)> {
        match self {
            Self::Pulses { scale, frames } => Some((*scale, *frames)),
            Self::Dshot { .. } => None,
        }
    }
}

/// Everything that settings mean for a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    /// The inputs.
    pub input: InputPlan,
    /// What their pulses mean.
    pub input_scale: PulseScale,
    /// The outputs.
    pub output: OutputPlan,
}

impl Plan {
    /// For capture and output timers that count at `timer_hz`. Where they do not tell pulses apart
    /// ([`ClockReport::tells_pulses_apart`](super::ClockReport::tells_pulses_apart)) every pulse counts as an armed one, which
    /// no motor turns on that has not been seen disarmed, and which ends an excitation or an injection. The numbers in frames of
    /// DShot need no clock.
    ///
    /// `None` where a timer does not suit the pulses.
    #[must_use]
    pub fn new(settings: &Validated, timer_hz: u32, tells_pulses_apart: bool) -> Option<Self> {
        let input = InputPlan::new(settings, timer_hz)?;
        let is_readable = tells_pulses_apart || input.timing().is_none();
        let input_scale = if is_readable { settings.input.scale(timer_hz).ok()? } else { PulseScale::FULL };
        Some(Self { input, input_scale, output: OutputPlan::new(settings, timer_hz)? })
    }
}

/// Width of the longest pulse that an output may have, in counts.
#[must_use]
pub fn longest_pulse_ticks(settings: &Validated, output_scale: PulseScale) -> u32 {
    let highest = match settings.output.protocol.range_us() {
        Some(_) => Command::ONE,
        // No channel puts out more.
        None => settings.motors.iter().fold(Command::ZERO, |highest, motor| {
            highest.max(Command::saturating_from_bits(motor.max.max(settings.stop)))
        }),
    };
    output_scale.to_width_ticks(EscCommand::from(highest))
}
