//! A sinusoid that runs through all periods on a frequency of its own, such as mains hum, found and subtracted.
//!
//! A sinusoid at `f` bins, no whole number, shows in period `p` at bin `k` as
//!
//! ```text
//! A e^(2 pi j f p) D(f - k),    D(x) = e^(j pi x) sin(pi x) / (pi x)
//! ```
//!
//! It turns from period to period while the response does not, so what of it the mean over periods leaves
//! over tells `f` and `A`: `f` by search, `A` by least squares. All of it is then subtracted, from the
//! lines that it falls on and from the many on which it leaks. A frequency that is a whole number of bins
//! does not turn and is no business of this file.
//!
//! The diagnosis has a search of its own, `diagnose::noise::hum`: it looks at one residual of a model, in which a hum that repeats with the
//! periods shows too, and this one at what turns between periods, before there is a model.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

/// Bins to either side of the strongest one that the sinusoid is fitted to. Chosen: beyond is 2.4 % of its power at most, half a bin off
/// the strongest, by the sum of `(sin(pi x) / (pi x))^2`; more bins have more noise than sinusoid.
const REACH: usize = 8;
/// What turns by less than this (share of its power that is not in the mean) is not distinguished from the response. Chosen: of two
/// periods the share is `sin(pi f)^2`, so a fourteenth of a turn is enough; with less, the subtraction amplifies noise more than 20 times.
const LEAST_TURN: f64 = 0.05;
/// It has to explain at least this share of the scatter around its bin, else it is none. Chosen: a lone sinusoid explains nearly all; noise
/// of several bins and periods is no sinusoid for the most part.
const LEAST_SHARE: f64 = 0.5;
/// Bins to either side in which that is decided. Chosen: they hold 92 % of its power or more, by the same sum, and little else.
const CORE: usize = 2;

/// A sinusoid of constant frequency and amplitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sinusoid {
    /// Frequency in bins.
    pub bin: f64,
    /// Its complex amplitude in the first period.
    pub amplitude: Complex64,
}

impl Sinusoid {
    /// The one that explains most of how `periods` scatter around the bin at `peak`, by place; the first place is
    /// `first_bin`.
    pub fn fit(periods: &[Vec<Complex64>], first_bin: usize, peak: usize) -> Option<Self> {
        let count = periods.len() as f64;
        let places = peak.saturating_sub(REACH)..(peak + REACH + 1).min(periods.first()?.len());
        let mean: Vec<Complex64> =
            places.clone().map(|k| periods.iter().map(|p| p[k]).sum::<Complex64>() / count).collect();
        // Explained energy and amplitude of a frequency, over some of the places.
        let projected = |bin: f64, places: std::ops::Range<usize>, offset: usize| {
            let turns: Vec<Complex64> = (0..periods.len()).map(|p| Complex64::cis(TAU * bin * p as f64)).collect();
            let still = turns.iter().sum::<Complex64>() / count;
            let turning = 1.0 - still.norm_sqr();
            if turning < LEAST_TURN {
                return (0.0, Complex64::ZERO);
            }
            let (mut product, mut power) = (Complex64::ZERO, 0.0);
            for (place, k) in places.enumerate() {
                let leak = leak(bin - (first_bin + k) as f64);
                for (turn, period) in turns.iter().zip(periods) {
                    product += ((turn - still) * leak).conj() * (period[k] - mean[place + offset]);
                }
                power += leak.norm_sqr() * turning * count;
            }
            (product.norm_sqr() / power, product / power)
        };
        let energy = |bin: f64| projected(bin, places.clone(), 0).0;
        let middle = (first_bin + peak) as f64;
        // Over all periods the phase tells the frequency to a fraction of one over their number: a fifth of that, chosen, is within the
        // peak. Up to ten periods 0.02 is finer still.
        let step = (0.2 / count).min(0.02);
        let steps = (1.0 / step).ceil() as i64;
        let best =
            (-steps..=steps).map(|i| middle + step * i as f64).max_by(|a, b| energy(*a).total_cmp(&energy(*b)))?;
        let bin = highest(energy, best - step, best + step);
        let (_, amplitude) = projected(bin, places.clone(), 0);

        let core = peak.saturating_sub(CORE).max(places.start)..(peak + CORE + 1).min(places.end);
        let offset = core.start - places.start;
        let scatter: f64 =
            core.clone().map(|k| periods.iter().map(|p| (p[k] - mean[k - places.start]).norm_sqr()).sum::<f64>()).sum();
        let (explained, _) = projected(bin, core, offset);
        (explained > LEAST_SHARE * scatter).then_some(Self { bin, amplitude })
    }

    /// Takes it out of all bins of all periods.
    pub fn subtract_from(&self, periods: &mut [Vec<Complex64>], first_bin: usize) {
        for (p, period) in periods.iter_mut().enumerate() {
            let amplitude = self.amplitude * Complex64::cis(TAU * self.bin * p as f64);
            for (k, value) in period.iter_mut().enumerate() {
                *value -= amplitude * leak(self.bin - (first_bin + k) as f64);
            }
        }
    }
}

/// What a bin shows of a sinusoid of unit amplitude, `distance` bins above it.
fn leak(distance: f64) -> Complex64 {
    let x = PI * distance;
    // Nearer, `sin(x) / x` is one to the last digit.
    if x.abs() < 1e-9 { Complex64::ONE } else { Complex64::cis(x) * (x.sin() / x) }
}

/// Where a function with one peak between `low` and `high` has it (golden section).
fn highest(value: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    // The golden section, `(sqrt(5) - 1) / 2`.
    const RATIO: f64 = 0.618_033_988_749_894_9;
    // 1e-10 of the interval, `0.618^48`.
    for _ in 0..48 {
        let (left, right) = (high - RATIO * (high - low), low + RATIO * (high - low));
        if value(left) < value(right) { low = left } else { high = right }
    }
    f64::midpoint(low, high)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::testing::noise;

    #[test]
    fn a_sinusoid_is_found_and_noise_is_none() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for count in [2, 4, 14] {
            let mut periods: Vec<Vec<Complex64>> =
                (0..count).map(|_| (0..60).map(|_| noise(&mut rng)).collect()).collect();
            let none = periods.clone();
            let hum = Sinusoid { bin: 130.37, amplitude: Complex64::new(0.0, 60.0) };
            Sinusoid { amplitude: -hum.amplitude, ..hum }.subtract_from(&mut periods, 100);
            let found = Sinusoid::fit(&periods, 100, 30).unwrap();
            assert!((found.bin - hum.bin).abs() < 0.02, "{found:?}");
            assert!((found.amplitude - hum.amplitude).norm() < 4.0, "{found:?}");
            if count > 2 {
                assert_eq!(Sinusoid::fit(&none, 100, 30), None);
            }
        }
    }
}
