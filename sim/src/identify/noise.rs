//! Noise variance per line, pooled over neighbors.
//!
//! The sample variance of two to four periods has 2 to 6 degrees of freedom. Weights that follow
//! it favor the lines that happen to look quiet, and their standard errors come out several times
//! too small. Noise spectra are smooth over a hertz or two, so the variances of neighboring
//! lines are averaged instead (Pintelon & Schoukens, *System Identification*, 2012, ch. 2 and 12,
//! on what few degrees of freedom do to weighted least squares).

use num_complex::Complex64;

/// Averages `values` over the nearest `2 half_width + 1` neighbors.
///
/// At the ends the window keeps its width and becomes one-sided, so that every line has the same
/// degrees of freedom. Returns the averages and the number of neighbors in each.
pub(super) fn pool(values: &[f64], half_width: usize) -> (Vec<f64>, usize) {
    let width = (2 * half_width + 1).min(values.len());
    let pooled = (0..values.len())
        .map(|k| {
            let first = k.saturating_sub(width / 2).min(values.len() - width);
            values[first..first + width].iter().sum::<f64>() / width as f64
        })
        .collect();
    (pooled, width)
}

/// Noise power `E |N|^2` at each excited bin, from the `count` unexcited bins nearest to it.
///
/// `None` when fewer than three of `bins` are unexcited. The mean (bin 0) is never used.
pub(super) fn from_unexcited(spectrum: &[Complex64], excited: &[usize], count: usize) -> Option<(Vec<f64>, usize)> {
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
            let first = above.saturating_sub(count / 2).min(quiet.len() - count);
            quiet[first..first + count].iter().map(|&q| spectrum[q].norm_sqr()).sum::<f64>() / count as f64
        })
        .collect();
    Some((powers, count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_keeps_its_width_at_the_ends() {
        let (pooled, width) = pool(&[1.0, 2.0, 3.0, 4.0, 5.0], 1);
        assert_eq!(width, 3);
        assert_eq!(pooled, [2.0, 2.0, 3.0, 4.0, 4.0]);
        assert_eq!(pool(&[1.0, 3.0], 5), (vec![2.0, 2.0], 2));
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
