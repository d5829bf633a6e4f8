//! Statistics of samples.

use std::ops::Range;

/// A normal distribution's standard deviation over the median of its absolute deviations: `1 / Phi^-1(3/4)`.
pub const STD_PER_MEDIAN_DEVIATION: f64 = 1.482_602_218_505_602;

/// Arithmetic mean; zero of nothing.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Sample variance about the mean, with divisor `n - 1`; zero of fewer than two values.
#[must_use]
pub fn variance(values: &[f64]) -> f64 {
    let mean = mean(values);
    // In two passes: the sum of squares less the square of the sum cancels (Chan, Golub and LeVeque 1983).
    let square: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    if values.len() > 1 { square / (values.len() as f64 - 1.0) } else { 0.0 }
}

/// The middle value, of an even number the upper of the two in the middle; `None` of nothing. It is one of the values, so that
/// of times or levels it is one that occurs.
#[must_use]
pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    let middle = values.len() / 2;
    (middle < values.len()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The least and the greatest value; infinite, the greatest below the least, of nothing.
#[must_use]
pub fn extent(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &value| (low.min(value), high.max(value)))
}

/// Averages `values` over the nearest `2 half_width + 1` neighbors ([`window`]).
#[must_use]
pub fn moving_mean(values: &[f64], half_width: usize) -> Vec<f64> {
    let width = (2 * half_width + 1).min(values.len());
    (0..values.len()).map(|k| mean(&values[window(k, width, values.len())])).collect()
}

/// The `width` places nearest to `place` among `count`, of which there are as many. At the ends the window keeps its
/// width and becomes one-sided.
#[must_use]
pub fn window(place: usize, width: usize, count: usize) -> Range<usize> {
    let first = place.saturating_sub(width / 2).min(count - width);
    first..first + width
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_of_known_samples() {
        assert_eq!(median([]), None);
        assert_eq!(median([3.0]), Some(3.0));
        assert_eq!(median([5.0, 1.0, 4.0]), Some(4.0));
        assert_eq!(median([4.0, 1.0, 3.0, 2.0]), Some(3.0));
        assert_eq!(median([1.0, f64::INFINITY, -1.0, f64::NEG_INFINITY, 0.0]), Some(0.0));
    }

    #[test]
    fn few_values_have_no_variance() {
        assert_eq!((mean(&[]), variance(&[])), (0.0, 0.0));
        assert_eq!((mean(&[7.0]), variance(&[7.0])), (7.0, 0.0));
        assert_eq!((mean(&[1.0, 2.0, 3.0, 4.0]), variance(&[1.0, 2.0, 3.0, 4.0])), (2.5, 5.0 / 3.0));
    }

    #[test]
    fn the_extent_of_nothing_is_empty() {
        assert_eq!(extent(&[2.0, -1.0, 0.5]), (-1.0, 2.0));
        assert_eq!(extent(&[]), (f64::INFINITY, f64::NEG_INFINITY));
    }

    #[test]
    fn the_window_keeps_its_width_at_the_ends() {
        assert_eq!(moving_mean(&[1.0, 2.0, 3.0, 4.0, 5.0], 1), [2.0, 2.0, 3.0, 4.0, 4.0]);
        assert_eq!(moving_mean(&[1.0, 3.0], 5), [2.0, 2.0]);
    }
}
