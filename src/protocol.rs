//! How a command is expressed on a line, and what that takes on a timer.

use core::fmt;

use crate::dshot::{self, Speed};
use crate::throttle::PulseScale;

/// How a command is expressed on a line: as the width of a pulse, or as a number in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// The command is the duty cycle itself: 0 is no pulse and 1 the whole frame. The paper's ESC takes it at 600 Hz.
    RawDuty {
        /// Frames per second.
        frame_hz: u32,
    },
    /// Servo pulses, 1000 to 2000 µs.
    StandardPwm,
    /// OneShot125: the servo pulse at an eighth of its length, 125 to 250 µs.
    OneShot125,
    /// DShot: frames of 16 bits. What stands for a width is a throttle value, and for that of a stop the one below them.
    Dshot(Speed),
}

impl Protocol {
    /// Raw duty as in the paper: 600 Hz.
    pub const PAPER: Self = Self::RawDuty { frame_hz: 600 };

    /// The conversion on a timer that counts at `timer_hz`.
    ///
    /// # Errors
    /// When the pulse range spans too few or too many ticks, or the frame rate is zero.
    pub fn scale(self, timer_hz: u32) -> Result<PulseScale, PulseError> {
        let (low, high) = self.range_ticks(timer_hz).ok_or(PulseError::NoFrame)?;
        let span = high - low;
        if span > u64::from(PulseScale::MAX_SPAN_TICKS) {
            return Err(PulseError::TimerTooFast { span_ticks: span });
        }
        let span_ticks = span as u32;
        if span_ticks < PulseScale::MIN_SPAN_TICKS {
            return Err(PulseError::TimerTooSlow { span_ticks });
        }
        Ok(PulseScale::of_span(low as u32, span_ticks))
    }

    /// Widths of the shortest and the longest pulse in ticks of a timer that counts at `timer_hz`, to the nearest tick. DShot
    /// needs no timer.
    fn range_ticks(self, timer_hz: u32) -> Option<(u64, u64)> {
        let timer_hz = u64::from(timer_hz);
        let microseconds = |us: u64| (us * timer_hz + 500_000) / 1_000_000;
        match self {
            Self::RawDuty { frame_hz: 0 } => None,
            Self::RawDuty { frame_hz } => {
                let frame_hz = u64::from(frame_hz);
                Some((0, (timer_hz + frame_hz / 2) / frame_hz))
            }
            Self::StandardPwm => Some((microseconds(1000), microseconds(2000))),
            Self::OneShot125 => Some((microseconds(125), microseconds(250))),
            Self::Dshot(_) => Some((dshot::BELOW_THROTTLE.into(), dshot::HIGHEST.into())),
        }
    }
}

/// Why a protocol and a timer do not go together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PulseError {
    /// `frame_hz` is zero.
    NoFrame,
    /// The pulse range spans fewer ticks than [`PulseScale::MIN_SPAN_TICKS`]: the timer is too slow.
    TimerTooSlow {
        /// Ticks between the shortest and the longest pulse.
        span_ticks: u32,
    },
    /// The pulse range spans more ticks than [`PulseScale::MAX_SPAN_TICKS`], which a command could not tell apart.
    TimerTooFast {
        /// Ticks between the shortest and the longest pulse.
        span_ticks: u64,
    },
}

impl fmt::Display for PulseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoFrame => write!(f, "frame_hz is 0: a pulse needs a frame of at least 1 Hz"),
            Self::TimerTooSlow { span_ticks } => write!(
                f,
                "the pulse range is {span_ticks} timer ticks wide: at least {} are needed, use a faster timer clock",
                PulseScale::MIN_SPAN_TICKS
            ),
            Self::TimerTooFast { span_ticks } => write!(
                f,
                "the pulse range is {span_ticks} timer ticks wide: at most {} can be distinguished, use a slower timer clock",
                PulseScale::MAX_SPAN_TICKS
            ),
        }
    }
}

impl core::error::Error for PulseError {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::throttle::Command;

    /// Usual clocks, and odd ones that divide into nothing evenly.
    const TIMERS_HZ: [u32; 9] =
        [1_000_000, 8_000_000, 16_000_000, 72_000_000, 84_000_000, 168_000_000, 999_983, 11_059_201, 83_999_999];

    #[test]
    fn every_pulse_survives_the_round_trip_to_the_tick() {
        for timer_hz in TIMERS_HZ {
            let dshot = Protocol::Dshot(Speed::Dshot600);
            let raw_duty = Protocol::RawDuty { frame_hz: 4000 };
            for protocol in [Protocol::PAPER, raw_duty, Protocol::StandardPwm, Protocol::OneShot125, dshot] {
                let scale = protocol.scale(timer_hz).unwrap();
                for ticks in scale.low_ticks()..=scale.high_ticks() {
                    assert_eq!(scale.to_ticks(scale.to_command(ticks)), ticks, "{protocol:?} at {timer_hz} Hz");
                }
            }
        }
    }

    #[test]
    fn the_widest_span_survives_the_round_trip_at_its_worst_places() {
        let scale = Protocol::RawDuty { frame_hz: 1 }.scale(PulseScale::MAX_SPAN_TICKS).unwrap();
        let span = scale.high_ticks();
        for ticks in (0..5000).chain(span / 2 - 5000..span / 2 + 5000).chain(span - 5000..=span) {
            assert_eq!(scale.to_ticks(scale.to_command(ticks)), ticks);
        }
    }

    #[test]
    fn the_ends_of_the_pulse_range_are_zero_and_one_exactly() {
        for protocol in [Protocol::PAPER, Protocol::StandardPwm, Protocol::OneShot125] {
            let scale = protocol.scale(84_000_000).unwrap();
            assert_eq!(scale.to_command(scale.low_ticks()), Command::ZERO);
            assert_eq!(scale.to_command(scale.high_ticks()), Command::ONE);
            assert_eq!(scale.to_command(0), Command::ZERO);
            assert_eq!(scale.to_command(u32::MAX), Command::ONE);
        }
    }

    #[test]
    fn presets_have_the_widths_of_their_protocols() {
        let scale = |protocol: Protocol| protocol.scale(84_000_000).unwrap();
        let microseconds = |ticks: u32| f64::from(ticks) / 84.0;
        assert_eq!(microseconds(scale(Protocol::StandardPwm).low_ticks()), 1000.0);
        assert_eq!(microseconds(scale(Protocol::StandardPwm).high_ticks()), 2000.0);
        assert_eq!(microseconds(scale(Protocol::OneShot125).low_ticks()), 125.0);
        assert_eq!(microseconds(scale(Protocol::OneShot125).high_ticks()), 250.0);
        assert_eq!(scale(Protocol::PAPER).low_ticks(), 0);
        assert_eq!(scale(Protocol::PAPER).high_ticks(), 140_000);
    }

    #[test]
    fn a_timer_that_does_not_suit_is_refused_with_the_remedy() {
        assert_eq!(Protocol::RawDuty { frame_hz: 0 }.scale(1), Err(PulseError::NoFrame));
        let slow = Protocol::OneShot125.scale(500_000).unwrap_err();
        assert!(std::format!("{slow}").contains("faster timer"), "{slow}");
        let fast = Protocol::RawDuty { frame_hz: 1 }.scale(u32::MAX).unwrap_err();
        assert!(std::format!("{fast}").contains("slower timer"), "{fast}");
    }
}
