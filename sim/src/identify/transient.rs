//! Does the first period carry a transient?
//!
//! An actuator that starts from rest needs a few time constants until it repeats itself. What it
//! lacks until then is smooth in frequency and largest at the lowest lines. Under the hypothesis of
//! no transient, the first period differs from the mean of the other `P - 1` by noise alone:
//!
//! ```text
//! F_g = [sum |Y_1 - mean|^2 / (1 + 1/(P-1)) / n] / [sum_(p >= 2) |Y_p - mean|^2 / (n (P-2))]
//! ```
//!
//! over a group `g` of `n` neighbouring lines, in which the noise is as good as white, follows
//! F(2 n, 2 n (P-2)). The first period is dropped when any group's tail probability is below the
//! level divided by the number of groups (Bonferroni), so that a record without transient loses a
//! period with no more than that probability. With two periods the denominator is the noise of the
//! second period's unexcited lines.

use num_complex::Complex64;

use super::statistics::f_upper_tail;

/// Lines in a group: enough for power, few enough for the noise to be flat.
const GROUP: usize = 10;

/// The outcome of the test on one record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransientTest {
    /// Tail probability, corrected for the number of groups; `None` when nothing could be compared
    /// (one period, or two with every line excited).
    pub p_value: Option<f64>,
    /// The level below which the first period is dropped.
    pub level: f64,
}

impl TransientTest {
    /// Whether the first period carries a transient.
    #[must_use]
    pub fn is_present(&self) -> bool {
        self.p_value.is_some_and(|p| p < self.level)
    }
}

/// Tests the first of `periods`, each the response at the excited lines.
///
/// `quiet_power` is the noise power at each line and the number of bins it was averaged over, for
/// records of two periods.
pub(super) fn test(periods: &[Vec<Complex64>], quiet_power: Option<&(Vec<f64>, usize)>, level: f64) -> TransientTest {
    let others = periods.len().saturating_sub(1) as f64;
    let Some((first, rest)) = periods.split_first().filter(|(_, rest)| !rest.is_empty()) else {
        return TransientTest { p_value: None, level };
    };
    let lines = first.len();
    let groups = (lines / GROUP).max(1);
    let mut smallest: Option<f64> = None;
    for group in 0..groups {
        // The last group takes the rest.
        let end = if group + 1 == groups { lines } else { (group + 1) * GROUP };
        let range = group * GROUP..end;
        let n = range.len() as f64;
        let (mut difference, mut spread, mut quiet) = (0.0, 0.0, 0.0);
        for line in range {
            let mean = rest.iter().map(|p| p[line]).sum::<Complex64>() / others;
            difference += (first[line] - mean).norm_sqr();
            spread += rest.iter().map(|p| (p[line] - mean).norm_sqr()).sum::<f64>();
            quiet += quiet_power.map_or(0.0, |(power, _)| power[line]);
        }
        let (noise, noise_dof) = if rest.len() > 1 {
            (spread / (n * (others - 1.0)), 2.0 * n * (others - 1.0))
        } else if let Some((_, bins)) = quiet_power {
            // Neighbouring lines share bins; a group spans about as many bins as lines.
            (quiet / n, 2.0 * n.max(*bins as f64))
        } else {
            return TransientTest { p_value: None, level };
        };
        let difference = difference / (1.0 + 1.0 / others) / n;
        let p = if difference <= noise {
            1.0 // also two noise-free periods, 0 / 0
        } else {
            f_upper_tail(difference / noise, 2.0 * n, noise_dof)
        };
        smallest = Some(smallest.map_or(p, |s| s.min(p)));
    }
    TransientTest { p_value: smallest.map(|p| (p * groups as f64).min(1.0)), level }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    fn noise(rng: &mut ChaCha8Rng) -> Complex64 {
        Complex64::new(StandardNormal.sample(rng), StandardNormal.sample(rng))
    }

    /// Periods of 150 lines of noise, falling by a factor of ten, and a decaying transient.
    fn periods(rng: &mut ChaCha8Rng, count: usize, transient: f64) -> Vec<Vec<Complex64>> {
        (0..count)
            .map(|p| {
                (0..150)
                    .map(|k| {
                        let f = k as f64 / 150.0;
                        let shape = 1.0 / Complex64::new(1.0, 20.0 * f);
                        let first = if p == 0 { transient } else { 0.0 };
                        noise(rng) / (1.0 + 9.0 * f) + shape * first
                    })
                    .collect()
            })
            .collect()
    }

    #[test]
    fn the_false_alarm_rate_is_the_level_and_a_transient_is_seen() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for count in [3, 4, 8] {
            let runs = 2000;
            let alarms = |rng: &mut ChaCha8Rng, transient| {
                (0..runs).filter(|_| test(&periods(rng, count, transient), None, 0.05).is_present()).count() as f64
                    / f64::from(runs)
            };
            // 2000 runs at 0.05: standard deviation 0.0049, so 0.033 .. 0.066 is 3.2 of them or more from
            // the rate that 15 groups at a fifteenth of the level have, 1 - (1 - 0.05 / 15)^15 = 0.0488.
            let rate = alarms(&mut rng, 0.0);
            assert!((0.033..0.066).contains(&rate), "{count} periods: {rate}");
            // Six times the noise of a line, at the lowest ones.
            assert!(alarms(&mut rng, 6.0) > 0.99);
        }
    }

    #[test]
    fn one_period_cannot_be_tested_and_two_need_quiet_lines() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        assert_eq!(test(&periods(&mut rng, 1, 9.0), None, 0.05).p_value, None);
        let two = periods(&mut rng, 2, 9.0);
        assert_eq!(test(&two, None, 0.05).p_value, None);
        let quiet = (0..150).map(|k| 2.0 / (1.0 + 9.0 * f64::from(k) / 150.0).powi(2)).collect();
        assert!(test(&two, Some(&(quiet, 11)), 0.05).is_present());
    }

    #[test]
    fn periods_that_repeat_exactly_have_no_transient() {
        let same = vec![vec![Complex64::ONE; 30]; 4];
        assert!(!test(&same, None, 0.05).is_present());
    }
}
