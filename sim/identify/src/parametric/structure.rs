//! Which model is fitted: how many poles and zeros, with or without a dead time.

use std::fmt;

use super::ParametricError;

/// The most poles of a model; the search is tried up to here.
pub const MOST_POLES: usize = 16;

/// The structure `e^(-s Td) K (zeros) / (poles)` of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Structure {
    /// Number of poles, 1 to [`MOST_POLES`].
    pub poles: usize,
    /// Number of zeros, at most the number of poles.
    pub zeros: usize,
    /// Whether a dead time is estimated.
    pub has_delay: bool,
}

impl Structure {
    /// `K / (1 + s tau)`.
    pub const FIRST_ORDER: Self = Self::new(1, 0);
    /// `K / (1 + 2 zeta s / w_n + s^2 / w_n^2)`; its two poles may also be real.
    pub const SECOND_ORDER: Self = Self::new(2, 0);

    /// Poles and zeros without a dead time.
    #[must_use]
    pub const fn new(poles: usize, zeros: usize) -> Self {
        Self { poles, zeros, has_delay: false }
    }

    /// The same with a dead time.
    #[must_use]
    pub const fn with_delay(self) -> Self {
        Self { has_delay: true, ..self }
    }

    /// Number of real parameters.
    #[must_use]
    pub const fn parameters(self) -> usize {
        1 + self.poles + self.zeros + self.has_delay as usize
    }

    /// Refuses what cannot be fitted to this many lines.
    pub(super) fn check(self, lines: usize) -> Result<(), ParametricError> {
        let Self { poles, zeros, .. } = self;
        if poles == 0 || poles > MOST_POLES || zeros > poles {
            return Err(ParametricError::Structure { poles, zeros, most: MOST_POLES });
        }
        // Two real numbers per line, and at least two of them left for the residual.
        if 2 * lines < self.parameters() + 2 {
            return Err(ParametricError::TooFewLines { lines, parameters: self.parameters() });
        }
        Ok(())
    }
}

impl fmt::Display for Structure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = |count: usize| if count == 1 { "" } else { "s" };
        let dead_time = if self.has_delay { ", dead time" } else { "" };
        write!(f, "{} pole{}, {} zero{}{dead_time}", self.poles, s(self.poles), self.zeros, s(self.zeros))
    }
}
