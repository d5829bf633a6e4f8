//! Multisines of low crest factor: for a given peak, the most power in each line.
//!
//! [`optimize`] looks for the phases, [`Multisine`] is the result, and [`flight`] brings it into the
//! integers of the controller's generator.

mod descent;
mod detection;
mod error;
pub mod flight;
mod line_set;

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rotorlead_fourier as fourier;

pub use detection::{DetectionRecipe, DetectionSet};
pub use error::MultisineError;
pub use line_set::LineSet;

/// Samples per period and top harmonic of the grid on which a peak is judged. Derived: a peak is overstated by 8e-5 at most, `1 / cos(pi /
/// 256) - 1`.
const PEAK_OVERSAMPLING: usize = 256;

/// How far the phases of the starts after the first are from Schroeder's, radians either way. Chosen: enough to reach other minima, not so
/// far that the good start is lost; at half a turn they would be random.
const START_SPREAD_RAD: f64 = 0.5;

/// How to look for phases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Search {
    /// Seed of the starts after the first.
    pub seed: u64,
    /// How many starts; at least one is made. The first has Schroeder's phases.
    pub starts: u32,
}

impl Default for Search {
    fn default() -> Self {
        // Chosen: the controller's own sets are of three starts; time goes with their number, and any seed will do.
        Self { seed: 1, starts: 3 }
    }
}

/// How far a search has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Stages done.
    pub done: usize,
    /// Stages in all.
    pub total: usize,
    /// Crest factor of the best start so far.
    pub best_crest_factor: Option<f64>,
}

/// A periodic sum of cosines, `x(theta) = sum_k a_k cos(m_k theta + phase_k)`, that crosses zero
/// upwards at `theta = 0`.
#[derive(Clone, Debug, PartialEq)]
pub struct Multisine {
    lines: LineSet,
    phases_rad: Vec<f64>,
    peak: f64,
}

impl Multisine {
    /// `lines` with the given phases, in radians, shifted in time to start at zero: at the crossing
    /// with the gentlest slope of the period (and with its sign changed if that crossing goes down),
    /// so that the first commands change least from tick to tick and an actuator is disturbed
    /// least by the start. A set of odd lines crosses everything twice, once up and once down; the
    /// change of sign makes both the same signal.
    ///
    /// # Errors
    /// [`MultisineError::Amplitude`] when there are not as many phases as lines, or one is not finite.
    pub fn starting_at_zero(lines: LineSet, mut phases_rad: Vec<f64>) -> Result<Self, MultisineError> {
        let bad = phases_rad.iter().position(|phase| !phase.is_finite());
        if bad.is_some() || phases_rad.len() != lines.harmonics().len() {
            let place = bad.unwrap_or(phases_rad.len().min(lines.harmonics().len()));
            return Err(MultisineError::Amplitude { place });
        }
        let (theta, slope) = gentlest_crossing(&lines, &phases_rad);
        let turn = if slope < 0.0 { PI } else { 0.0 };
        for (phase, &harmonic) in phases_rad.iter_mut().zip(lines.harmonics()) {
            *phase = (*phase + f64::from(harmonic) * theta + turn).rem_euclid(TAU);
        }
        let samples = peak_grid(&lines);
        let peak = descent::peak(&sampled(&lines, &phases_rad, samples))
            / (PI * f64::from(lines.top_harmonic()) / samples as f64).cos();
        Ok(Self { lines, phases_rad, peak })
    }

    /// The lines.
    #[must_use]
    pub fn lines(&self) -> &LineSet {
        &self.lines
    }

    /// Phases of the cosines in radians, 0 to 2 pi.
    #[must_use]
    pub fn phases_rad(&self) -> &[f64] {
        &self.phases_rad
    }

    /// The largest `|x|` at any `theta`, in units of the lines' amplitudes: never understated, and
    /// overstated by 8e-5 of itself at most.
    ///
    /// It is the peak over `M` even samples divided by `cos(pi n / M)`, `n` the top harmonic: no
    /// trigonometric polynomial of degree `n` rises higher between its samples (Ehlich & Zeller,
    /// Mathematische Zeitschrift 86, 1964).
    #[must_use]
    pub fn peak(&self) -> f64 {
        self.peak
    }

    /// One period in `samples` even samples, from `theta = 0`.
    #[must_use]
    pub fn waveform(&self, samples: usize) -> Vec<f64> {
        sampled(&self.lines, &self.phases_rad, samples)
    }

    /// Peak over root mean square of one period in `samples` even samples: on the controller's grid,
    /// `samples` is loop rate times period.
    #[must_use]
    pub fn crest_factor(&self, samples: usize) -> f64 {
        let waveform = self.waveform(samples);
        let mean_square = waveform.iter().map(|x| x * x).sum::<f64>() / samples as f64;
        descent::peak(&waveform) / mean_square.sqrt()
    }
}

/// Looks for phases of low crest factor. Deterministic for a seed on one machine; between machines
/// the last digits may differ with the processor's Fourier transform.
///
/// `progress` is called after every stage of every start.
///
/// Sources: Schroeder, IEEE Trans. Inf. Theory 16 (1970) for the first start; Van der Ouderaa,
/// Schoukens & Renneboog, IEEE Trans. Instrum. Meas. 37 (1988) for clipping; Guillaume, Schoukens,
/// Pintelon & Kollár, IEEE Trans. Instrum. Meas. 40 (1991) for the descent.
///
/// # Errors
/// None for a valid [`LineSet`]; the type is that of [`Multisine::starting_at_zero`].
pub fn optimize(
    lines: &LineSet,
    search: &Search,
    mut progress: impl FnMut(Progress),
) -> Result<Multisine, MultisineError> {
    let mut rng = ChaCha8Rng::seed_from_u64(search.seed);
    let starts = search.starts.max(1);
    let total = starts as usize * descent::STAGES;
    let mut done = 0;
    let mut best: Option<Multisine> = None;
    for start in 0..starts {
        let mut phases = schroeder(lines);
        if start > 0 {
            for phase in &mut phases {
                *phase += rng.random_range(-START_SPREAD_RAD..START_SPREAD_RAD);
            }
        }
        let best_crest_factor = best.as_ref().map(|best| best.peak / lines.rms());
        let phases = descent::lower_peak(lines, phases, || {
            done += 1;
            progress(Progress { done, total, best_crest_factor });
        });
        let found = Multisine::starting_at_zero(lines.clone(), phases)?;
        if best.as_ref().is_none_or(|best| found.peak < best.peak) {
            best = Some(found);
        }
    }
    best.ok_or(MultisineError::NoLine)
}

/// Schroeder's phases: the group delay of each line is the power below it, so that the sum sweeps
/// through its band once a period.
fn schroeder(lines: &LineSet) -> Vec<f64> {
    let power: f64 = lines.amplitudes().iter().map(|a| a * a).sum();
    let (mut below, mut phase) = (0.0, 0.0);
    lines
        .amplitudes()
        .iter()
        .map(|a| {
            let this = phase;
            below += a * a / power;
            phase -= TAU * below;
            this
        })
        .collect()
}

fn peak_grid(lines: &LineSet) -> usize {
    (lines.top_harmonic() as usize * PEAK_OVERSAMPLING).next_power_of_two()
}

fn sampled(lines: &LineSet, phases_rad: &[f64], samples: usize) -> Vec<f64> {
    if samples <= 2 * lines.top_harmonic() as usize {
        // The inverse transform has no bins for all lines: aliases are summed as they fall.
        return (0..samples).map(|i| value_and_slope(lines, phases_rad, TAU * i as f64 / samples as f64).0).collect();
    }
    let inverse = fourier::real_inverse(samples);
    let mut spectrum = inverse.make_input_vec();
    for ((&harmonic, &amplitude), &phase) in lines.harmonics().iter().zip(lines.amplitudes()).zip(phases_rad) {
        spectrum[harmonic as usize] = Complex64::from_polar(amplitude / 2.0, phase);
    }
    let mut waveform = inverse.make_output_vec();
    inverse.process(&mut spectrum, &mut waveform).expect("both vectors are the plan's own");
    waveform
}

/// `x` and `dx / dtheta`.
fn value_and_slope(lines: &LineSet, phases_rad: &[f64], theta: f64) -> (f64, f64) {
    let mut sum = (0.0, 0.0);
    for ((&harmonic, &amplitude), &phase) in lines.harmonics().iter().zip(lines.amplitudes()).zip(phases_rad) {
        let (sin, cos) = (f64::from(harmonic) * theta + phase).sin_cos();
        sum.0 += amplitude * cos;
        sum.1 -= amplitude * f64::from(harmonic) * sin;
    }
    sum
}

/// Angle and slope where `|dx / dtheta|` is least among the zeros of `x`.
fn gentlest_crossing(lines: &LineSet, phases_rad: &[f64]) -> (f64, f64) {
    let samples = peak_grid(lines);
    let step = TAU / samples as f64;
    let waveform = sampled(lines, phases_rad, samples);
    // x has no mean, so a period holds at least two crossings. Their slope on the fine grid tells
    // the gentlest; only that one is then solved for.
    let slope_after = |i: usize| (waveform[(i + 1) % samples] - waveform[i]).abs();
    let gentlest = (0..samples)
        .filter(|&i| (waveform[i] < 0.0) != (waveform[(i + 1) % samples] < 0.0))
        .min_by(|&a, &b| slope_after(a).total_cmp(&slope_after(b)))
        .unwrap_or(0);
    let (mut low, mut high) = (gentlest as f64 * step, (gentlest + 1) as f64 * step);
    let falls = waveform[gentlest] >= 0.0;
    // Bisection to the last bit of theta.
    while low < f64::midpoint(low, high) && f64::midpoint(low, high) < high {
        let middle = f64::midpoint(low, high);
        if (value_and_slope(lines, phases_rad, middle).0 >= 0.0) == falls {
            low = middle;
        } else {
            high = middle;
        }
    }
    (low, value_and_slope(lines, phases_rad, low).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHORT: Search = Search { seed: 1, starts: 1 };

    #[test]
    fn the_search_beats_its_start_and_repeats_for_its_seed() {
        // Neither odd nor equal nor without gaps.
        let harmonics: Vec<u32> = (2..60).filter(|m| m % 7 != 0).collect();
        let amplitudes = harmonics.iter().map(|&m| 1.0 / f64::from(m).sqrt()).collect();
        let lines = LineSet::new(harmonics, amplitudes).unwrap();
        let start = Multisine::starting_at_zero(lines.clone(), schroeder(&lines)).unwrap();
        let search = Search { seed: 5, starts: 2 };
        let mut calls = Vec::new();
        let found = optimize(&lines, &search, |progress| calls.push(progress)).unwrap();
        println!("crest: {} -> {}", start.crest_factor(8192), found.crest_factor(8192));
        assert!(found.crest_factor(8192) < 1.5 && start.crest_factor(8192) > 1.6);
        assert_eq!(found, optimize(&lines, &search, |_| ()).unwrap());
        assert!(calls.iter().enumerate().all(|(i, p)| p.done == i + 1 && p.total == calls.len()));
    }

    #[test]
    fn it_starts_at_zero_going_up_at_the_gentlest_crossing() {
        let lines = LineSet::odd(20).unwrap();
        let found = optimize(&lines, &SHORT, |_| ()).unwrap();
        let (value, slope) = value_and_slope(&lines, found.phases_rad(), 0.0);
        assert!(value.abs() < 1e-11 && slope > 0.0, "{value:e} {slope}");
        let waveform = found.waveform(65536);
        for pair in waveform.windows(2).filter(|pair| pair[0] * pair[1] < 0.0) {
            assert!((pair[1] - pair[0]).abs() > slope * TAU / 65536.0 * 0.999);
        }
    }

    #[test]
    fn the_peak_is_never_understated_and_hardly_overstated() {
        for count in [1, 2, 5, 33] {
            let found = optimize(&LineSet::odd(count).unwrap(), &SHORT, |_| ()).unwrap();
            // 30 times finer than the grid of the bound, and not a multiple of it.
            let dense = descent::peak(&found.waveform(30 * 256 * 2 * count as usize + 1));
            assert!(found.peak() >= dense && found.peak() < dense * (1.0 + 8e-5), "{count} lines");
        }
        let one = optimize(&LineSet::odd(1).unwrap(), &SHORT, |_| ()).unwrap();
        assert!((one.crest_factor(1024) - 2.0_f64.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn a_waveform_on_a_coarse_grid_is_the_same_function() {
        let found = optimize(&LineSet::odd(10).unwrap(), &SHORT, |_| ()).unwrap();
        let (coarse, fine) = (found.waveform(12), found.waveform(120));
        for (i, x) in coarse.iter().enumerate() {
            assert!((x - fine[10 * i]).abs() < 1e-12);
        }
    }
}
