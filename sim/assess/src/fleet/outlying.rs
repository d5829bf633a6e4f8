//! What stands out among numbers most of which are alike.

use rotorlead_numerics::sample::{STD_PER_MEDIAN_DEVIATION, median};

/// A score from which on a number stands out. Standard: Iglewicz and Hoaglin, 1993. Of normal numbers one in 2000 does.
pub const OUTLIER_Z_SCORE: f64 = 3.5;
/// Numbers below which nothing is scored: their spread is not known. Chosen: a median deviation of eight withstands three bad ones
/// and scatters by 40 % already.
pub const FEWEST_SCORED: usize = 8;

/// Distances from the median in standard deviations, both as most of the numbers have them: the modified z-scores of B. Iglewicz and
/// D. Hoaglin, "How to Detect and Handle Outliers", 1993. `None` of fewer than [`FEWEST_SCORED`], and where most are the same.
pub(super) fn modified_z_scores(values: &[f64]) -> Option<Vec<f64>> {
    if values.len() < FEWEST_SCORED {
        return None;
    }
    let middle = median(values.iter().copied())?;
    let spread = median(values.iter().map(|value| (value - middle).abs()))?;
    (spread > 0.0).then(|| values.iter().map(|value| (value - middle) / (STD_PER_MEDIAN_DEVIATION * spread)).collect())
}
