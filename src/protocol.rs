//! The protocols of an ESC's line: their names, how each expresses a command, and what that takes on a timer.
//!
//! What differs from one protocol to another stands in [`PulseProtocol::specification`] alone.

use core::fmt;

use crate::dshot::{BELOW_THROTTLE, HIGHEST, Line, Speed};
use crate::throttle::PulseScale;

/// How a command is expressed on a line. The order is that of the codes on the link and in flash: a new protocol comes last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "settings", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
pub enum PulseProtocol {
    /// The duty cycle is the command: 0 is no pulse and 1 the whole frame. The paper's ESC takes it at 600 Hz.
    RawDuty,
    /// Servo pulses, 1000 to 2000 µs.
    StandardPwm,
    /// The servo pulse at an eighth of its length, 125 to 250 µs.
    OneShot125,
    /// Frames of bits, at 150 kbit/s. Their rate counts at an output whose input has pulses.
    Dshot150,
    /// The same at 300 kbit/s.
    Dshot300,
    /// The same at 600 kbit/s.
    Dshot600,
    /// Frames at 300 kbit/s that the ESC answers. An input has them only where the output has such frames, too.
    Dshot300Bidirectional,
    /// The same at 600 kbit/s.
    Dshot600Bidirectional,
}

/// What a protocol is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Specification {
    /// What commands, files and JSON call it.
    pub name: &'static str,
    /// What prose calls it.
    pub title: &'static str,
    /// What a list of protocols says of it.
    pub summary: &'static str,
    /// What stands for a command.
    pub form: Form,
    /// How often pulses or frames come unless told otherwise.
    pub usual_frames: UsualFrames,
}

/// Frames per second: as the slowest of the usual flight controllers sends them, and as fast as many an ESC takes them. Those of a
/// raw duty are the paper's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UsualFrames {
    /// At the input.
    pub input_hz: u16,
    /// At the output, at most.
    pub output_hz: u16,
}

/// What stands for a command on a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// The share of the frame in which the line is high.
    Duty,
    /// The width of a pulse.
    Width {
        /// That of 0, microseconds.
        shortest_us: u32,
        /// That of 1, microseconds.
        longest_us: u32,
    },
    /// A throttle value in a frame of 16 bits (DShot), and for a stop the value below the lowest.
    Frames(Line),
}

/// A protocol, and how often its pulses or frames come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "settings", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
pub struct Pulse {
    /// What a pulse's width means.
    pub protocol: PulseProtocol,
    /// Frames per second.
    pub frame_hz: u16,
}

impl PulseProtocol {
    /// All of them, in the order of their codes.
    pub const ALL: [Self; 8] = [
        Self::RawDuty,
        Self::StandardPwm,
        Self::OneShot125,
        Self::Dshot150,
        Self::Dshot300,
        Self::Dshot600,
        Self::Dshot300Bidirectional,
        Self::Dshot600Bidirectional,
    ];

    /// The table of the protocols.
    #[must_use]
    pub const fn specification(self) -> Specification {
        match self {
            Self::RawDuty => Specification {
                name: "raw_duty",
                title: "raw duty",
                summary: "The duty cycle is the command",
                form: Form::Duty,
                usual_frames: UsualFrames { input_hz: 600, output_hz: 600 },
            },
            Self::StandardPwm => Specification {
                name: "standard_pwm",
                title: "standard PWM",
                summary: "1000 to 2000 us",
                form: Form::Width { shortest_us: 1000, longest_us: 2000 },
                usual_frames: UsualFrames { input_hz: 400, output_hz: 450 },
            },
            Self::OneShot125 => Specification {
                name: "oneshot125",
                title: "OneShot125",
                summary: "125 to 250 us",
                form: Form::Width { shortest_us: 125, longest_us: 250 },
                usual_frames: UsualFrames { input_hz: 2000, output_hz: 2400 },
            },
            Self::Dshot150 => Specification {
                name: "dshot150",
                title: "DShot150",
                summary: "Frames at 150 kbit/s",
                form: Form::Frames(Line::one_way(Speed::Dshot150)),
                usual_frames: UsualFrames { input_hz: 4000, output_hz: 5000 },
            },
            Self::Dshot300 => Specification {
                name: "dshot300",
                title: "DShot300",
                summary: "Frames at 300 kbit/s",
                form: Form::Frames(Line::one_way(Speed::Dshot300)),
                usual_frames: UsualFrames { input_hz: 4000, output_hz: 5000 },
            },
            Self::Dshot600 => Specification {
                name: "dshot600",
                title: "DShot600",
                summary: "Frames at 600 kbit/s",
                form: Form::Frames(Line::one_way(Speed::Dshot600)),
                usual_frames: UsualFrames { input_hz: 4000, output_hz: 5000 },
            },
            Self::Dshot300Bidirectional => Specification {
                name: "dshot300_bidirectional",
                title: "bidirectional DShot300",
                summary: "Frames at 300 kbit/s that the ESC answers",
                form: Form::Frames(Line::bidirectional(Speed::Dshot300)),
                usual_frames: UsualFrames { input_hz: 4000, output_hz: 4000 },
            },
            Self::Dshot600Bidirectional => Specification {
                name: "dshot600_bidirectional",
                title: "bidirectional DShot600",
                summary: "Frames at 600 kbit/s that the ESC answers",
                form: Form::Frames(Line::bidirectional(Speed::Dshot600)),
                usual_frames: UsualFrames { input_hz: 4000, output_hz: 4000 },
            },
        }
    }

    /// What commands, files and JSON call it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.specification().name
    }

    /// What its line has, where that is DShot.
    #[must_use]
    pub const fn dshot(self) -> Option<Line> {
        match self.specification().form {
            Form::Frames(line) => Some(line),
            Form::Duty | Form::Width { .. } => None,
        }
    }

    /// Whether its frames are answered.
    #[must_use]
    pub const fn is_bidirectional(self) -> bool {
        matches!(self.dshot(), Some(Line { is_bidirectional: true, .. }))
    }

    /// The shortest and the longest pulse, microseconds, and for DShot the length of a frame, rounded up; a raw duty has none: it
    /// is bounded by the levels.
    #[must_use]
    pub const fn range_us(self) -> Option<(u32, u32)> {
        match self.specification().form {
            Form::Duty => None,
            Form::Width { shortest_us, longest_us } => Some((shortest_us, longest_us)),
            Form::Frames(line) => Some((line.speed.frame_us(), line.speed.frame_us())),
        }
    }

    /// With so many frames a second.
    #[must_use]
    pub const fn at(self, frame_hz: u16) -> Pulse {
        Pulse { protocol: self, frame_hz }
    }
}

impl Pulse {
    /// Raw duty as in the paper: 600 Hz.
    pub const PAPER: Self = PulseProtocol::RawDuty.at(600);

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
        Ok(PulseScale::from_span(low as u32, span_ticks))
    }

    /// Widths of the shortest and the longest pulse in ticks of a timer that counts at `timer_hz`, to the nearest tick. DShot
    /// needs no timer.
    fn range_ticks(self, timer_hz: u32) -> Option<(u64, u64)> {
        let timer_hz = u64::from(timer_hz);
        let microseconds = |us: u32| (u64::from(us) * timer_hz + 500_000) / 1_000_000;
        match self.protocol.specification().form {
            Form::Duty => {
                let frame_hz = u64::from(self.frame_hz);
                Some((0, (timer_hz + frame_hz / 2).checked_div(frame_hz)?))
            }
            Form::Width { shortest_us, longest_us } => Some((microseconds(shortest_us), microseconds(longest_us))),
            Form::Frames(_) => Some((BELOW_THROTTLE.into(), HIGHEST.into())),
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
            let raw_duties = [Pulse::PAPER, PulseProtocol::RawDuty.at(4000)];
            for pulse in PulseProtocol::ALL.map(|protocol| protocol.at(400)).into_iter().chain(raw_duties) {
                let scale = pulse.scale(timer_hz).unwrap();
                for ticks in scale.low_ticks()..=scale.high_ticks() {
                    assert_eq!(scale.to_ticks(scale.to_command(ticks)), ticks, "{pulse:?} at {timer_hz} Hz");
                }
            }
        }
    }

    #[test]
    fn the_widest_span_survives_the_round_trip_at_its_worst_places() {
        let scale = PulseProtocol::RawDuty.at(1).scale(PulseScale::MAX_SPAN_TICKS).unwrap();
        let span = scale.high_ticks();
        for ticks in (0..5000).chain(span / 2 - 5000..span / 2 + 5000).chain(span - 5000..=span) {
            assert_eq!(scale.to_ticks(scale.to_command(ticks)), ticks);
        }
    }

    #[test]
    fn the_ends_of_the_pulse_range_are_zero_and_one_exactly() {
        for protocol in PulseProtocol::ALL {
            let scale = protocol.at(600).scale(84_000_000).unwrap();
            assert_eq!(scale.to_command(scale.low_ticks()), Command::ZERO);
            assert_eq!(scale.to_command(scale.high_ticks()), Command::ONE);
            assert_eq!(scale.to_command(0), Command::ZERO);
            assert_eq!(scale.to_command(u32::MAX), Command::ONE);
        }
    }

    #[test]
    fn presets_have_the_widths_of_their_protocols() {
        let scale = |protocol: PulseProtocol| protocol.at(600).scale(84_000_000).unwrap();
        let microseconds = |ticks: u32| f64::from(ticks) / 84.0;
        assert_eq!(microseconds(scale(PulseProtocol::StandardPwm).low_ticks()), 1000.0);
        assert_eq!(microseconds(scale(PulseProtocol::StandardPwm).high_ticks()), 2000.0);
        assert_eq!(microseconds(scale(PulseProtocol::OneShot125).low_ticks()), 125.0);
        assert_eq!(microseconds(scale(PulseProtocol::OneShot125).high_ticks()), 250.0);
        assert_eq!(scale(PulseProtocol::RawDuty).low_ticks(), 0);
        assert_eq!(scale(PulseProtocol::RawDuty).high_ticks(), 140_000);
    }

    #[test]
    fn a_timer_that_does_not_suit_is_refused_with_the_remedy() {
        assert_eq!(PulseProtocol::RawDuty.at(0).scale(1), Err(PulseError::NoFrame));
        let slow = PulseProtocol::OneShot125.at(400).scale(500_000).unwrap_err();
        assert!(std::format!("{slow}").contains("faster timer"), "{slow}");
        let fast = PulseProtocol::RawDuty.at(1).scale(u32::MAX).unwrap_err();
        assert!(std::format!("{fast}").contains("slower timer"), "{fast}");
    }
}
