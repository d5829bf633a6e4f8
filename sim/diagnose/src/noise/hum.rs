//! Mains hum in a record: sinusoids near 50 or 60 Hz and their multiples, whose exact frequency the grid decides.
//!
//! Their frequency is no whole number of periods of a record, so they leak onto its lines; and where it is, they repeat as the
//! response does. Neither is noise that a smooth density describes, nor anything that a motor does.
//!
//! The search of `identify::spectra::noise::sinusoid` is another one: it looks at what turns between periods, before there is a model,
//! and this one at one residual of a model, in which a hum that repeats with the periods shows too.

use std::f64::consts::TAU;

use rotorlead_numerics::sample::median;

use crate::noise::whitening::Whitening;

/// What a grid may have, hertz. Standard: the two nominal frequencies of public mains.
const MAINS_HZ: [f64; 2] = [50.0, 60.0];
/// How far the grid may be off. Standard: 0.25 Hz of 50 Hz covers the 0.2 Hz that Continental Europe allows in steady state (Regulation
/// (EU) 2017/1485, annex III). More would take in lines of noise, and less miss a grid at its limit.
const MAINS_TOLERANCE: f64 = 0.005;
/// A line has to stand out of its surroundings by this factor of power. Derived: a line of noise does with `e^-16`, with 1e-6 where its
/// surroundings are known to 13 %; the largest of some hundred lines does once in thousands of records.
const PEAK_OVER_BACKGROUND: f64 = 16.0;
/// Lines to either side that are the surroundings. Derived: the median of 121 exponential variables is known to
/// `1 / (ln 2 sqrt(121))`, 13 %. More reach farther over a density that is not level.
const BACKGROUND_LINES: usize = 60;
/// Multiples that are looked for where the hum itself is there. Chosen: iron and rectifiers make the first few large; each costs one
/// transform.
const MULTIPLES: u32 = 5;
/// How often the search for a frequency narrows by a third. Derived: it narrows from two lines to `2 (2/3)^30`, 1e-5 of a line, which
/// turns a sinusoid by 1e-4 rad over a record.
const NARROWINGS: u32 = 30;

/// The hum in the rows of a residual; empty if there is none. Searched only above the excited band: below it, a model error could pass for
/// hum.
pub(crate) fn estimate_hum(residual: &[f64], rate_hz: f64, excited_hz: f64) -> Vec<f64> {
    let mut hum = Vec::new();
    for mains_hz in MAINS_HZ.into_iter().filter(|mains_hz| mains_hz * (1.0 - MAINS_TOLERANCE) > excited_hz) {
        let mut left = residual.to_vec();
        let Some(fundamental_hz) = find_near(&left, rate_hz, mains_hz, mains_hz * MAINS_TOLERANCE) else { continue };
        let resolution_hz = rate_hz / residual.len() as f64;
        let mut sum = vec![0.0; residual.len()];
        for multiple in 1..=MULTIPLES {
            let hz = f64::from(multiple) * fundamental_hz;
            if let Some(hz) = find_near(&left, rate_hz, hz, f64::from(multiple) * resolution_hz) {
                let sinusoid = sinusoid_at(&left, rate_hz, hz);
                left.iter_mut().zip(&sinusoid).for_each(|(left, part)| *left -= part);
                sum.iter_mut().zip(&sinusoid).for_each(|(sum, part)| *sum += part);
            }
        }
        if hum.is_empty() {
            hum = sum;
        } else {
            hum.iter_mut().zip(&sum).for_each(|(hum, part)| *hum += part);
        }
    }
    hum
}

/// The frequency of the sinusoid that stands out within `reach_hz` of `hz`. `None` where none does.
fn find_near(rows: &[f64], rate_hz: f64, hz: f64, reach_hz: f64) -> Option<f64> {
    let spectrum = Whitening::unit(rows.len()).spectrum(rows);
    let line_hz = rate_hz / rows.len() as f64;
    let line_of = |hz: f64| (hz / line_hz).round() as usize;
    let near = line_of(hz - reach_hz).max(1)..(line_of(hz + reach_hz) + 1).min(spectrum.len());
    let peak = near.max_by(|a, b| spectrum[*a].norm_sqr().total_cmp(&spectrum[*b].norm_sqr()))?;
    let around = peak.saturating_sub(BACKGROUND_LINES)..(peak + BACKGROUND_LINES + 1).min(spectrum.len());
    // The median of an exponential variable is ln 2 of its mean.
    let mean = median(around.map(|line| spectrum[line].norm_sqr()))? / 2.0_f64.ln();
    if spectrum[peak].norm_sqr() < PEAK_OVER_BACKGROUND * mean || mean == 0.0 {
        return None;
    }
    let power = |hz: f64| {
        let (re, im) = fourier_sums(rows, rate_hz, hz);
        re * re + im * im
    };
    let (mut low, mut high) = ((peak as f64 - 1.0) * line_hz, (peak as f64 + 1.0) * line_hz);
    for _ in 0..NARROWINGS {
        let third = (high - low) / 3.0;
        if power(low + third) < power(high - third) { low += third } else { high -= third }
    }
    Some(0.5 * (low + high))
}

/// `sum x cos` and `sum x sin` at a frequency.
fn fourier_sums(rows: &[f64], rate_hz: f64, hz: f64) -> (f64, f64) {
    let step = num_complex::Complex64::cis(TAU * hz / rate_hz);
    let mut turn = num_complex::Complex64::ONE;
    let (mut re, mut im) = (0.0, 0.0);
    for x in rows {
        re += x * turn.re;
        im += x * turn.im;
        turn *= step;
    }
    (re, im)
}

/// The sinusoid of that frequency that fits best, by least squares over many of its periods.
fn sinusoid_at(rows: &[f64], rate_hz: f64, hz: f64) -> Vec<f64> {
    let (re, im) = fourier_sums(rows, rate_hz, hz);
    let scale = 2.0 / rows.len() as f64;
    let angle = TAU * hz / rate_hz;
    (0..rows.len()).map(|row| scale * (re * (angle * row as f64).cos() + im * (angle * row as f64).sin())).collect()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    #[test]
    fn hum_is_taken_out_to_below_the_noise_and_noise_stays() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let noise: Vec<f64> = (0..30_000).map(|_| StandardNormal.sample(&mut rng)).collect();
        assert!(estimate_hum(&noise, 1000.0, 30.0).is_empty());
        for hz in [49.93, 50.0, 60.11] {
            let hum: Vec<f64> = (0..30_000)
                .map(|row| TAU * hz * f64::from(row) / 1000.0)
                .map(|angle| (angle + 1.0).sin() + 0.3 * (3.0 * angle + 2.0).sin())
                .collect();
            let rows: Vec<f64> = noise.iter().zip(&hum).map(|(noise, hum)| noise + hum).collect();
            let off: f64 =
                estimate_hum(&rows, 1000.0, 30.0).iter().zip(&hum).map(|(found, hum)| (found - hum).powi(2)).sum();
            // Amplitude, phase and frequency of two sinusoids take about one row's variance each.
            assert!(off < 25.0, "{hz} Hz: {off}");
            assert!(estimate_hum(&rows, 1000.0, 80.0).is_empty(), "what is excited is the motor's");
        }
    }
}
