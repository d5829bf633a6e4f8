//! What a decoder takes for a pulse: limits in timer ticks, derived from the protocol.

use core::fmt;

use crate::protocol::{Form, Pulse, PulseError};

/// Slowest input frame rate, hertz: servo outputs run at 50 Hz, less a fifth for odd ones.
pub const SLOWEST_FRAME_HZ: u32 = 40;
/// Fastest input frame rate, hertz: the longest OneShot125 pulse just fits.
pub const FASTEST_FRAME_HZ: u32 = 4000;
/// Slowest rate of [`super::Decoder::poll`], hertz: the timeout is then still several polls long.
pub const SLOWEST_POLL_HZ: u32 = 100;

/// A pulse, or a gap in one, shorter than this is noise, in microseconds: the spikes that motor currents couple into a
/// servo lead last some hundreds of nanoseconds.
const GLITCH_US: u32 = 2;
/// The input counts as lost when no pulse was accepted for this long, in milliseconds: four frames at the slowest rate.
pub(crate) const TIMEOUT_MS: u32 = 100;
/// Edges between two polls beyond those of good pulses that are let pass: those of two glitches.
const SPARE_EDGES: u32 = 4;
/// Longest timeout in timer ticks. Ages of time stamps are compared as signed differences, which hold 2^31; half of it
/// leaves room for polls that come late.
const LONGEST_TIMEOUT_TICKS: u32 = 1 << 30;

/// The limits of one input, all in ticks of the capture timer.
///
/// | | pulse width | frame |
/// |---|---|---|
/// | servo pulse, OneShot125 | the protocol's range and a fifth of its span beyond either end | 9/10 of the longest pulse (so 555 Hz or 4444 Hz) to 11/10 of 1/40 s |
/// | raw duty | a glitch, to the frame less a glitch | 7/8 to 9/8 of the nominal frame |
///
/// Widths outside are noise or another protocol. Those a little outside the protocol's range come from uncalibrated
/// clocks and trims; [`PulseScale::to_command`](crate::throttle::PulseScale::to_command) takes them for the nearer end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    pub(super) min_width: u32,
    /// Longest pulse less the shortest.
    pub(super) width_span: u32,
    pub(super) min_period: u32,
    pub(super) max_period: u32,
    pub(super) glitch: u32,
    pub(super) timeout: u32,
    pub(super) edges_per_poll: u32,
}

/// Why there are no such limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimingError {
    /// The protocol does not go with the timer.
    Pulse(PulseError),
    /// The protocol has frames of bits, and no pulses.
    NoPulses,
    /// The frame rate is outside [`SLOWEST_FRAME_HZ`] to [`FASTEST_FRAME_HZ`].
    FrameRate {
        /// The frame rate.
        frame_hz: u32,
    },
    /// The decoder is polled less often than [`SLOWEST_POLL_HZ`].
    PollRate {
        /// The rate of polls.
        poll_hz: u32,
    },
    /// The timeout is outside its range.
    Timeout {
        /// The timeout asked for.
        timeout_ticks: u32,
        /// Shortest: twice the slowest frame, so that one missing pulse is no loss.
        min_ticks: u32,
        /// Longest: 2^30, so that wrapping time stamps stay comparable.
        max_ticks: u32,
    },
}

impl fmt::Display for TimingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Pulse(error) => error.fmt(f),
            Self::NoPulses => f.write_str(
                "DShot has frames of bits, and no pulses to decode: use `dshot::Receiver` for such an input",
            ),
            Self::FrameRate { frame_hz } => write!(
                f,
                "frame_hz is {frame_hz}: an input can be read from {SLOWEST_FRAME_HZ} to {FASTEST_FRAME_HZ} frames a second"
            ),
            Self::PollRate { poll_hz } => {
                write!(f, "the input is polled at {poll_hz} Hz: it needs at least {SLOWEST_POLL_HZ} Hz")
            }
            Self::Timeout { timeout_ticks, min_ticks, max_ticks } => {
                write!(f, "the input's timeout is {timeout_ticks} timer ticks, outside {min_ticks} to {max_ticks}")
            }
        }
    }
}

impl core::error::Error for TimingError {}

impl From<PulseError> for TimingError {
    fn from(error: PulseError) -> Self {
        Self::Pulse(error)
    }
}

impl Timing {
    /// Limits for `pulse` on a timer that counts at `timer_hz`, for a decoder that is polled at `poll_hz` (once per
    /// control tick). The timeout is 100 ms.
    ///
    /// # Errors
    /// When the timer does not suit the protocol, or a rate is out of range.
    pub fn new(pulse: Pulse, timer_hz: u32, poll_hz: u32) -> Result<Self, TimingError> {
        if poll_hz < SLOWEST_POLL_HZ {
            return Err(TimingError::PollRate { poll_hz });
        }
        let scale = pulse.scale(timer_hz)?;
        let (low, high) = (scale.low_ticks(), scale.high_ticks());
        let glitch = (timer_hz / 1_000_000 * GLITCH_US).max(1);
        let timeout = timer_hz / 1000 * TIMEOUT_MS;
        let (min_width, max_width, min_period, max_period) = match pulse.protocol.specification().form {
            Form::Duty => {
                let frame_hz = u32::from(pulse.frame_hz);
                if !(SLOWEST_FRAME_HZ..=FASTEST_FRAME_HZ).contains(&frame_hz) {
                    return Err(TimingError::FrameRate { frame_hz });
                }
                (glitch, high - glitch, high - high / 8, high + high / 8)
            }
            Form::Width { .. } => {
                let beyond = (high - low) / 5;
                let slowest = timer_hz / SLOWEST_FRAME_HZ;
                (low - beyond, high + beyond, high - high / 10, slowest + slowest / 10)
            }
            Form::Frames(_) => return Err(TimingError::NoPulses),
        };
        let frames_per_poll = timer_hz / poll_hz / min_period + 1;
        let edges_per_poll = 2 * frames_per_poll + SPARE_EDGES;
        let width_span = max_width - min_width;
        Self { min_width, width_span, min_period, max_period, glitch, timeout, edges_per_poll }
            .with_timeout_ticks(timeout)
    }

    /// The same limits with another timeout: how long the last pulse is good for.
    ///
    /// # Errors
    /// When it is under twice the slowest frame, or over 2^30 timer ticks.
    pub const fn with_timeout_ticks(self, timeout_ticks: u32) -> Result<Self, TimingError> {
        let (min_ticks, max_ticks) = (2 * self.max_period, LONGEST_TIMEOUT_TICKS);
        if timeout_ticks < min_ticks || timeout_ticks > max_ticks {
            return Err(TimingError::Timeout { timeout_ticks, min_ticks, max_ticks });
        }
        Ok(Self { timeout: timeout_ticks, ..self })
    }

    /// The same limits for edges that come through a queue of bounded length: no number of them is a flood.
    #[must_use]
    pub const fn without_flood(self) -> Self {
        Self { edges_per_poll: u32::MAX, ..self }
    }

    /// Whether some number of edges is a flood.
    #[must_use]
    pub(super) const fn has_flood(&self) -> bool {
        self.edges_per_poll != u32::MAX
    }

    /// Shortest and longest pulse that is accepted.
    #[must_use]
    pub const fn width_range_ticks(&self) -> (u32, u32) {
        (self.min_width, self.min_width + self.width_span)
    }

    /// Shortest and longest frame: a shorter one is refused, a longer one means that a pulse is missing.
    #[must_use]
    pub const fn period_range_ticks(&self) -> (u32, u32) {
        (self.min_period, self.max_period)
    }

    /// Levels that last less than this are noise.
    #[must_use]
    pub const fn glitch_ticks(&self) -> u32 {
        self.glitch
    }

    /// How long the last pulse is good for.
    #[must_use]
    pub const fn timeout_ticks(&self) -> u32 {
        self.timeout
    }

    /// Edges between two polls that are decoded; with one more the input is off until the next poll.
    #[must_use]
    pub const fn edges_per_poll(&self) -> u32 {
        self.edges_per_poll
    }
}
