//! What readings in counts do not say: where within a count the response is.
//!
//! The error of such a reading has the variance `q^2 / 12`. Noise of some counts makes it another one in each reading, and a mean knows
//! more than a count. Where readings stand still they all have the same error, and their mean knows no more than one of them.

/// The step of a response's readings, response units: the smallest change from a row to the next. That of readings with many digits is
/// far below their noise.
#[must_use]
pub fn resolution(response: &[f64]) -> f64 {
    let changes = response.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let least = changes.filter(|change| *change > 0.0).fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 0.0 }
}

/// Standard deviation of the error by the resolution of a single reading.
#[must_use]
pub fn reading_std(resolution: f64) -> f64 {
    resolution / 12.0_f64.sqrt()
}

/// Standard deviation of the error that readings of one level have in common, which scatter by `std`.
///
/// Derived: readings on two counts, of which the share `p` is on the upper, are of a level within `|p - 1/2| q` of their mean, however
/// little noise there is: a third of that squared is its variance, and `p (1 - p) q^2` theirs. On one count it is `q^2 / 12`; noise of
/// half a count leaves none.
#[must_use]
pub fn common_std(resolution: f64, std: f64) -> f64 {
    ((0.25 * resolution * resolution - std * std) / 3.0).max(0.0).sqrt()
}

/// Of each reading, how many in a row stand with it on one count or the next to it.
#[must_use]
pub fn standing(readings: &[f64], resolution: f64) -> Vec<usize> {
    let mut standing = Vec::with_capacity(readings.len());
    while let Some(&first) = readings.get(standing.len()) {
        let (mut low, mut high) = (first, first);
        let stays = |reading: &&f64| {
            (low, high) = (low.min(**reading), high.max(**reading));
            // Derived: nearer to one count than to two.
            high - low < 1.5 * resolution
        };
        let count = readings[standing.len()..].iter().take_while(stays).count().max(1);
        standing.extend(std::iter::repeat_n(count, count));
    }
    standing
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_count_is_common_where_readings_stand_still() {
        assert_eq!(resolution(&[3.0, 3.0, 4.5, 7.5, 7.5]), 1.5);
        assert_eq!(resolution(&[3.0, 3.0]), 0.0);
        assert!((common_std(6.0, 0.0) - reading_std(6.0)).abs() < 1e-12);
        assert_eq!(common_std(6.0, 3.0), 0.0);
        assert_eq!(standing(&[0.0, 1.0, 3.0, 5.0, 6.0, 5.0, 5.0, 9.0], 1.0), [2, 2, 1, 4, 4, 4, 4, 1]);
    }
}
