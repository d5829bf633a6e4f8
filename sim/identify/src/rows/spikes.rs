//! Readings that cannot be the rotor's.

use rotorlead_numerics::sample::{STD_PER_MEDIAN_DEVIATION, median};

use super::resolution::resolution;

/// Rows on each side of a reading that it is compared with. Chosen: a median of nine rides over four bad readings in a row and leaves any
/// monotone transient as it is; a wider one takes a short swing for a spike.
const HALF_WIDTH: usize = 4;
/// A spike is further from the median of its neighbors than this many standard deviations... Derived: one reading in 5e8 of normal noise.
const STDS: f64 = 6.0;
/// ...and than this share of that median. A rotor changes by less in the time of a reading or two and never goes back at once. Chosen: it
/// decides alone where most readings stand still; less removes steps of a coarse sensor, more leaves spikes in.
const SHARE: f64 = 0.05;

/// The response with spikes replaced by the median of their neighbors, and which rows those are.
///
/// Hampel's filter: the standard deviation is taken from the median of all distances from the running median
/// (Pearson 2002, Outliers in process modeling and identification), so the spikes themselves do
/// not widen it.
pub fn without_spikes(y: &[f64]) -> (Vec<f64>, Vec<bool>) {
    let n = y.len();
    let center: Vec<f64> = (0..n)
        .map(|k| {
            let half = HALF_WIDTH.min(k).min(n - 1 - k);
            median(y[k - half..=k + half].iter().copied()).unwrap_or(y[k])
        })
        .collect();
    // Standstill reads exactly zero and says nothing of the noise.
    let distances = (0..n).filter(|&k| center[k] != 0.0).map(|k| (y[k] - center[k]).abs());
    let Some(distance) = median(distances) else { return (y.to_vec(), vec![false; n]) };
    let std = STD_PER_MEDIAN_DEVIATION * distance;
    // A reading may be on the next count. Derived: nearer to one than to two.
    let least = (STDS * std).max(1.5 * resolution(y));
    let spike: Vec<bool> = (0..n).map(|k| (y[k] - center[k]).abs() > least.max(SHARE * center[k].abs())).collect();
    let clean = (0..n).map(|k| if spike[k] { center[k] } else { y[k] }).collect();
    (clean, spike)
}
