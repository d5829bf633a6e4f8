//! The normalised command, as far as the excitation needs it.

/// A command in [0, 1], Q2.29: 1.0 is `1 << 29`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Command(i32);

impl Command {
    /// 0.0.
    pub const ZERO: Self = Self(0);
    /// 1.0.
    pub const ONE: Self = Self(1 << 29);

    /// The nearest command; what lies outside [0, 1] saturates, NaN becomes zero.
    #[must_use]
    pub fn saturating_from_f64(value: f64) -> Self {
        Self::saturating_from_bits((value * f64::from(Self::ONE.0) + 0.5) as i32)
    }

    /// From Q2.29 bits; what lies outside [0, 1] saturates.
    #[must_use]
    pub const fn saturating_from_bits(bits: i32) -> Self {
        if bits < 0 {
            Self::ZERO
        } else if bits > Self::ONE.0 {
            Self::ONE
        } else {
            Self(bits)
        }
    }

    /// Its value, exactly.
    #[must_use]
    pub fn to_f64(self) -> f64 {
        f64::from(self.0) / f64::from(Self::ONE.0)
    }

    /// Its Q2.29 bits.
    #[must_use]
    pub const fn to_bits(self) -> i32 {
        self.0
    }
}
