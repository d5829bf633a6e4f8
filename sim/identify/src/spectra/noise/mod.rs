//! Noise variance per line, pooled over neighbors.
//!
//! The sample variance of two to four periods has 2 to 6 degrees of freedom. Weights that follow
//! it favor the lines that happen to look quiet, and their standard errors come out several times
//! too small. Noise spectra are smooth over a hertz or two, so the variances of neighboring
//! lines are averaged instead (Pintelon & Schoukens, *System Identification*, 2012, ch. 2 and 12,
//! on what few degrees of freedom do to weighted least squares).
//!
//! What is averaged is the ratio to a smooth shape ([`shape`]): drift makes the noise of a stand rise
//! toward low frequency, and a plain mean over a window that can only reach upward would be too low
//! at the lowest lines. Of noise behind a low-pass from 1 Hz, lines 0.4 Hz apart and windows of eleven, it is a third of the
//! truth there. Lines that stand out ([`disturbed`]) are left out. Mains hum makes such lines; what of it
//! is a sinusoid is taken out before ([`sinusoid`]).

mod disturbed;
mod shape;
pub(crate) mod sinusoid;

use num_complex::Complex64;
use rotorlead_numerics::sample::window;

/// The noise of a set of lines.
pub(crate) struct Pooled {
    /// Variance at each line; where the line stands out, what its neighbors have.
    pub variance: Vec<f64>,
    /// How many lines each variance is the average of.
    pub neighbors: usize,
    /// Whether a line is much noisier than its neighbors.
    pub stands_out: Vec<bool>,
}

/// Pools the sample variances `sample` of lines at `bins` (increasing), each of `dof` complex degrees
/// of freedom, over the nearest `2 half_width + 1` lines that do not stand out.
///
/// At the ends the window keeps its width and becomes one-sided, so that every line has the same
/// degrees of freedom.
///
/// Below `rounding` a variance is the computer's, and no line stands out for it.
pub(crate) fn pool(sample: &[f64], bins: &[usize], dof: f64, half_width: usize, rounding: f64) -> Pooled {
    let seen: Vec<f64> = sample.iter().map(|s| s.max(rounding)).collect();
    let stands_out = disturbed::find(&ratios(&seen, &shape::fit(&seen, bins, dof, |_| true)), dof);
    let shape = shape::fit(sample, bins, dof, |k| !stands_out[k]);
    let ratio = ratios(sample, &shape);
    let calm: Vec<usize> = (0..sample.len()).filter(|&k| !stands_out[k]).collect();
    let width = (2 * half_width + 1).min(calm.len());
    let variance = (0..sample.len())
        .map(|k| {
            let place = calm.partition_point(|&c| c < k);
            shape[k] * calm[window(place, width, calm.len())].iter().map(|&c| ratio[c]).sum::<f64>() / width as f64
        })
        .collect();
    Pooled { variance, neighbors: width, stands_out }
}

/// The shift of [`density`]'s shape: every line rests on itself and what the spline makes of the next ones. Chosen: with none, the
/// logarithm stretches the lowest lines without end; with [`shape`]'s 11, the lowest are averaged.
const DENSITY_SHIFT_LINES: f64 = 2.0;

/// The smooth density of noise at lines at `bins` (increasing) of one spectrum, from their powers. Lines that stand out do
/// not count.
///
/// The spline follows the mean of a logarithm, which is below the logarithm of the mean by the same everywhere; the mean
/// ratio to the shape makes up for that.
pub fn density(power: &[f64], bins: &[usize]) -> Vec<f64> {
    let stands_out = disturbed::find(&ratios(power, &shape::fit(power, bins, 1.0, |_| true)), 1.0);
    let shape = shape::shifted(power, bins, 1.0, DENSITY_SHIFT_LINES, |k| !stands_out[k]);
    let calm = (0..power.len()).filter(|&k| !stands_out[k]);
    let (sum, count) = calm.fold((0.0, 0.0), |(sum, count), k| (sum + power[k] / shape[k], count + 1.0));
    let mean = if count > 0.0 { sum / count } else { 1.0 };
    shape.into_iter().map(|shape| shape * mean).collect()
}

/// The place of the line that stands out most; arguments as of [`pool`].
pub(crate) fn strongest(sample: &[f64], bins: &[usize], dof: f64, rounding: f64) -> Option<usize> {
    let seen: Vec<f64> = sample.iter().map(|s| s.max(rounding)).collect();
    let ratio = ratios(&seen, &shape::fit(&seen, bins, dof, |_| true));
    let stands_out = disturbed::all(&ratio, dof);
    (0..ratio.len()).filter(|&k| stands_out[k]).max_by(|&a, &b| ratio[a].total_cmp(&ratio[b]))
}

fn ratios(sample: &[f64], shape: &[f64]) -> Vec<f64> {
    sample.iter().zip(shape).map(|(s, shape)| s / shape).collect()
}

/// Noise power `E |N|^2` at each excited bin, from the `count` unexcited bins nearest to it.
///
/// `None` when fewer than three of `bins` are unexcited: weights of fewer have no finite variance. The mean (bin 0) is never used.
pub(crate) fn from_unexcited(spectrum: &[Complex64], excited: &[usize], count: usize) -> Option<(Vec<f64>, usize)> {
    let top = excited.last()? + count;
    let mut is_excited = vec![false; spectrum.len()];
    for &bin in excited {
        is_excited[bin] = true;
    }
    // The last bin of an even length is real: it has half the degrees of freedom.
    let quiet: Vec<usize> = (1..spectrum.len().saturating_sub(1).min(top)).filter(|&bin| !is_excited[bin]).collect();
    let count = count.min(quiet.len());
    if count < 3 {
        return None;
    }
    let powers = excited
        .iter()
        .map(|&bin| {
            let above = quiet.partition_point(|&q| q < bin);
            quiet[window(above, count, quiet.len())].iter().map(|&q| spectrum[q].norm_sqr()).sum::<f64>() / count as f64
        })
        .collect();
    Some((powers, count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_keeps_its_width_at_the_ends() {
        let pooled = pool(&[1.0, 2.0, 3.0, 4.0, 5.0], &[1, 2, 3, 4, 5], 1.0, 1, 0.0);
        assert_eq!(pooled.neighbors, 3);
        assert_eq!(pooled.variance, [2.0, 2.0, 3.0, 4.0, 4.0]);
        assert_eq!(pool(&[1.0, 3.0], &[1, 3], 1.0, 5, 0.0).variance, [2.0, 2.0]);
    }

    #[test]
    fn noise_that_rises_toward_low_frequency_is_not_flattened_at_the_ends() {
        // First-order noise with its corner at bin 16, exactly known.
        let bins: Vec<usize> = (0..150).map(|k| 2 * k + 1).collect();
        let truth: Vec<f64> = bins.iter().map(|&b| 1.0 / (1.0 + (b as f64 / 16.0).powi(2))).collect();
        let pooled = pool(&truth, &bins, 100.0, 5, 0.0);
        let ratio: Vec<f64> = pooled.variance.iter().zip(&truth).map(|(v, t)| v / t).collect();
        // A plain mean over the lowest 11 lines would be 31 % too low at the first. Too high is less harm than too low.
        assert!(ratio.iter().all(|&r| r > 0.9 && r < 1.35), "{ratio:?}");
        assert!(ratio[5..].iter().all(|&r| r < 1.1), "{ratio:?}");
    }

    #[test]
    fn noise_free_lines_have_no_noise() {
        let pooled = pool(&[0.0; 60], &(1..61).collect::<Vec<_>>(), 1.0, 5, 0.0);
        assert!(pooled.variance.iter().all(|&v| v == 0.0) && !pooled.stands_out.contains(&true));
    }

    #[test]
    fn excited_bins_and_the_mean_do_not_count_as_noise() {
        let mut spectrum = vec![Complex64::new(2.0, 0.0); 40];
        spectrum[0] = Complex64::new(1e6, 0.0);
        let excited: Vec<usize> = (1..20).step_by(2).collect();
        for &bin in &excited {
            spectrum[bin] = Complex64::new(1e6, 0.0);
        }
        let (powers, count) = from_unexcited(&spectrum, &excited, 6).expect("even bins are quiet");
        assert_eq!(count, 6);
        assert!(powers.iter().all(|&p| p == 4.0));
        let all: Vec<usize> = (1..39).collect();
        assert!(from_unexcited(&spectrum, &all, 6).is_none());
    }
}
