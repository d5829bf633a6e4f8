//! A [`Signal`] in one word, for the way from the inputs to the control tick.

use super::Signal;

/// What an input has for a control tick: [`Signal`] without the period and the reason of a loss, which no motor needs, and
/// with what tells an open line from one with pulses of another protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct InputReading(u32);

impl InputReading {
    /// [`Signal::Nothing`].
    pub const NOTHING: Self = Self(u32::MAX);
    /// [`Signal::Lost`].
    pub const LOST: Self = Self(u32::MAX - 1);
    /// As [`Self::NOTHING`] or [`Self::LOST`], but there is something on the line ([`super::Decoder::read`]).
    pub const UNREADABLE: Self = Self(u32::MAX - 2);
    /// [`Signal::Unchanged`].
    pub const UNCHANGED: Self = Self(u32::MAX - 3);

    /// A new pulse of so many timer ticks. Decoders accept none of more than 2^30; one that reads as something else here
    /// would only be no pulse.
    #[must_use]
    #[inline]
    pub const fn pulse(width_ticks: u32) -> Self {
        Self(width_ticks)
    }

    /// Whether pulses come: there is a new one, or the last is still good.
    #[must_use]
    #[inline]
    pub const fn is_live(self) -> bool {
        self.0 <= Self::UNCHANGED.0
    }

    /// Whether somebody drives the line, be it with pulses of another protocol.
    #[must_use]
    #[inline]
    pub const fn is_driven(self) -> bool {
        self.0 <= Self::UNREADABLE.0
    }

    /// Width of the new pulse, timer ticks; `None` where there is none.
    #[must_use]
    #[inline]
    pub const fn width_ticks(self) -> Option<u32> {
        if self.0 < Self::UNCHANGED.0 { Some(self.0) } else { None }
    }
}

impl From<Signal> for InputReading {
    #[inline]
    fn from(signal: Signal) -> Self {
        match signal {
            Signal::Nothing => Self::NOTHING,
            Signal::Pulse { width_ticks, .. } => Self::pulse(width_ticks),
            Signal::Unchanged => Self::UNCHANGED,
            Signal::Lost(_) => Self::LOST,
        }
    }
}
