//! Which model is fitted: how many poles and zeros.

use std::fmt;

use super::ParametricError;

/// The most poles of a model. Chosen: twice the order of the paper's stand; more poles than modes cancel against zeros.
pub const MOST_POLES: usize = 16;

/// The structure `K (zeros) / (poles)` of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Structure {
    /// Number of poles, 1 to [`MOST_POLES`].
    pub poles: usize,
    /// Number of zeros, at most the number of poles.
    pub zeros: usize,
}

impl Structure {
    /// `K / (1 + s tau)`.
    pub const FIRST_ORDER: Self = Self::new(1, 0);
    /// `K / (1 + 2 zeta s / w_n + s^2 / w_n^2)`; its two poles may also be real.
    pub const SECOND_ORDER: Self = Self::new(2, 0);

    /// So many poles and zeros.
    #[must_use]
    pub const fn new(poles: usize, zeros: usize) -> Self {
        Self { poles, zeros }
    }

    /// Number of real parameters.
    #[must_use]
    pub const fn parameters(self) -> usize {
        1 + self.poles + self.zeros
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
        write!(f, "{} pole{}, {} zero{}", self.poles, s(self.poles), self.zeros, s(self.zeros))
    }
}
