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
//! over a group `g` of `n` neighboring lines, in which the noise is as good as white, follows
//! F(2 n, 2 n (P-2)). The smallest tail probability `p` of `m` groups, whose noise is independent, has
//! the tail probability `1 - (1 - p)^m`; below the level the first period is dropped, and the next one
//! is tested against those that are left. A record without transient so loses a period with the
//! probability of the level. No more than half of the periods are dropped: what is not steady by
//! then is no transient of the start. With two periods the denominator is the noise of the second
//! period's unexcited lines.

use num_complex::Complex64;
use rotorlead_numerics::statistics::f_upper_tail;

/// Lines in a group: enough for power, few enough for the noise to be flat. Chosen: of four periods and 150 lines at 5 %, ten lines show
/// a difference of 2.7 times the noise (F), single lines one of 106 times.
const GROUP: usize = 10;

/// The outcome of the test on one record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransientTest {
    /// Tail probability of the first period's difference, corrected for the number of groups; `None` when
    /// nothing could be compared (one period, or two with every line excited).
    pub p_value: Option<f64>,
    /// The level below which a period is dropped.
    pub level: f64,
    /// How many periods carry a transient.
    pub dropped: usize,
}

impl TransientTest {
    /// Whether the first period carries a transient.
    #[must_use]
    pub fn is_present(&self) -> bool {
        self.dropped > 0
    }
}

/// Tests the first of `periods`, each the response at the excited lines, and as long as one is dropped the next.
///
/// `quiet_power` is the noise power at each line and the number of bins it was averaged over, for
/// records of two periods.
pub(crate) fn test(periods: &[Vec<Complex64>], quiet_power: Option<&(Vec<f64>, usize)>, level: f64) -> TransientTest {
    let p_value = tail_of_first(periods, quiet_power);
    let mut dropped = 0;
    let mut p = p_value;
    while p.is_some_and(|p| p < level) && dropped < periods.len() / 2 {
        dropped += 1;
        p = tail_of_first(&periods[dropped..], quiet_power);
    }
    TransientTest { p_value, level, dropped }
}

/// Tail probability of the difference between the first period and the others.
fn tail_of_first(periods: &[Vec<Complex64>], quiet_power: Option<&(Vec<f64>, usize)>) -> Option<f64> {
    let (first, rest) = periods.split_first().filter(|(_, rest)| !rest.is_empty())?;
    let others = rest.len() as f64;
    let lines = first.len();
    let groups = (lines / GROUP).max(1);
    let mut smallest = 1.0_f64;
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
        } else {
            let (_, bins) = quiet_power?;
            // Neighboring lines share bins; a group spans about as many bins as lines.
            (quiet / n, 2.0 * n.max(*bins as f64))
        };
        let difference = difference / (1.0 + 1.0 / others) / n;
        // Two noise-free periods, 0 / 0, differ by nothing.
        if difference > noise {
            smallest = smallest.min(f_upper_tail(difference / noise, 2.0 * n, noise_dof));
        }
    }
    // The same as 1 - (1 - p)^groups, without losing small p.
    Some(-(groups as f64 * (-smallest).ln_1p()).exp_m1())
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
            // 2000 runs at 0.05: 100 alarms expected, standard deviation 9.7; outside 68..=133 falls one in 1700
            // (binomial).
            let rate = alarms(&mut rng, 0.0);
            println!("{count} periods: {rate}");
            assert!((0.034..=0.0665).contains(&rate), "{count} periods: {rate}");
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
    fn a_transient_over_two_periods_takes_both() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut slow = periods(&mut rng, 6, 40.0);
        for (k, value) in slow[1].iter_mut().enumerate() {
            *value += 8.0 / Complex64::new(1.0, 20.0 * k as f64 / 150.0);
        }
        let found = test(&slow, None, 0.01);
        assert_eq!(found.dropped, 2, "{found:?}");
    }

    #[test]
    fn periods_that_repeat_exactly_have_no_transient() {
        let same = vec![vec![Complex64::ONE; 30]; 4];
        assert!(!test(&same, None, 0.05).is_present());
    }
}
