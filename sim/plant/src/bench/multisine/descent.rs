//! Lowers the peak of a multisine by its phases alone.
//!
//! Two methods, one after the other. Clipping (Van der Ouderaa, Schoukens & Renneboog 1988) cuts
//! the waveform's tops, keeps the phases of what is left and puts the amplitudes back; it moves far
//! in a few rounds. Descent on the norm of order 2p (Guillaume, Schoukens, Pintelon & Kollár 1991)
//! with growing p then approaches the peak itself, as `||x||_2p -> max |x|`.
//!
//! The least-squares problem of one descent step, `r_i = (x_i / s)^p` over the grid, never forms its
//! Jacobian: the product of two lines' derivatives is a sum and a difference frequency, so the normal
//! matrix is read off the Fourier transform of `(x / s)^(2p - 2)`, in the number of lines squared.

use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector};
use num_complex::Complex64;
use rotorlead_fourier::{self as fourier, ComplexToReal, RealToComplex};

use super::LineSet;

/// Samples per period and top harmonic. The early stages need no exact peak; the last ones do. Derived: 4 hold all sums of two harmonics,
/// and a peak between the samples of a grid that is 32 times finer is at most 0.5 % higher (see [`super::Multisine::peak`]). Chosen: twice
/// the least for the early ones.
const COARSE_OVERSAMPLING: usize = 8;
const FINE_OVERSAMPLING: usize = 32;

/// Rounds of clipping, and the clip level in parts of the peak, from the first to the last. Chosen: a low level moves far and a high one
/// settles; with these, the descent brings the controller's sets to 1.40 and 1.39 (`host-tests/tests/controller/excitation.rs`).
const CLIP_ROUNDS: usize = 400;
const CLIP_LEVELS: (f64, f64) = (0.80, 0.98);

/// Orders 2p of the norm, in turn. Chosen: each starts near enough to the minimum of the one before, by a factor of 1.5 to 2. Derived: at
/// 550 a peak that one sample in a hundred has counts to 0.8 %, `1 - 0.01^(1 / 550)`.
const ORDERS: [i32; 12] = [4, 8, 12, 20, 32, 48, 72, 108, 162, 244, 366, 550];
/// The order from which on the fine grid is used. Chosen: from here on the norm follows the peak to 3 %, `1 - 0.01^(1 / 162)`, and a coarse
/// grid may miss 8 % of that, `1 / cos(pi / 8) - 1`; earlier takes four times the time.
const FINE_FROM_ORDER: i32 = 162;
/// Most steps of an order. Chosen: a stage ends sooner where a step gains nothing; more only take time.
const STEPS_PER_ORDER: usize = 60;
/// A stage ends when a step lowers the norm by less than this part. Chosen: 60 such steps would lower a peak by less than 1e-7; a larger
/// one ends stages early.
const SMALLEST_GAIN: f64 = 1e-9;

/// More lines than these are left as clipping has them: the work and the memory of a step of the descent go with the cube and the square of
/// their number. Chosen: a third more than the 225 of the larger of the controller's sets.
const MOST_DESCENDED: usize = 300;
/// On a grid of more samples there are fewer rounds of clipping, and no fewer than the second number. Chosen: 65 536 samples of 8 to the
/// top harmonic reach up to 4096 odd lines; fewer than 20 rounds would hardly leave the start.
const CLIPPED_SAMPLES: usize = 1 << 16;
const FEWEST_ROUNDS: usize = 20;

/// One period on a grid, and the way there and back.
struct Grid<'a> {
    lines: &'a LineSet,
    samples: usize,
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
}

impl<'a> Grid<'a> {
    fn new(lines: &'a LineSet, oversampling: usize) -> Self {
        // At least four times the top harmonic: sums of two harmonics stay below half the grid.
        let samples = (lines.top_harmonic() as usize * oversampling).next_power_of_two();
        Self { lines, samples, forward: fourier::real_forward(samples), inverse: fourier::real_inverse(samples) }
    }

    fn waveform(&self, phases: &[f64]) -> Vec<f64> {
        let mut spectrum = self.inverse.make_input_vec();
        for ((&harmonic, &amplitude), &phase) in self.lines.harmonics().iter().zip(self.lines.amplitudes()).zip(phases)
        {
            spectrum[harmonic as usize] = Complex64::from_polar(amplitude / 2.0, phase);
        }
        let mut samples = self.inverse.make_output_vec();
        self.inverse.process(&mut spectrum, &mut samples).expect("both vectors are the plan's own");
        samples
    }

    /// `sum_i signal_i e^(-j m theta_i)` for m = 0, 1, ...
    fn spectrum(&self, mut signal: Vec<f64>) -> Vec<Complex64> {
        let mut spectrum = self.forward.make_output_vec();
        self.forward.process(&mut signal, &mut spectrum).expect("both vectors are the plan's own");
        spectrum
    }

    fn clip(&self, phases: &mut [f64], level: f64) {
        let mut samples = self.waveform(phases);
        let bound = level * peak(&samples);
        for sample in &mut samples {
            *sample = sample.clamp(-bound, bound);
        }
        let spectrum = self.spectrum(samples);
        for (phase, &harmonic) in phases.iter_mut().zip(self.lines.harmonics()) {
            *phase = spectrum[harmonic as usize].arg();
        }
    }

    /// Levenberg-Marquardt on the norm of order `order` (even).
    fn descend(&self, phases: &mut Vec<f64>, order: i32) {
        let count = phases.len();
        let harmonics = self.lines.harmonics();
        let mut samples = self.waveform(phases);
        let mut norm = norm(&samples, order);
        // Marquardt's damping. Chosen: it starts near Gauss-Newton, grows by 4 and shrinks by 8, and gives up at 1e6, where a step is a
        // millionth of Gauss-Newton's.
        let mut damping = 1e-3;
        for _ in 0..STEPS_PER_ORDER {
            let scale = peak(&samples);
            let weights = self.spectrum(samples.iter().map(|x| (x / scale).powi(order - 2)).collect());
            let slopes = self.spectrum(samples.iter().map(|x| (x / scale).powi(order - 1)).collect());
            // Derivative of x by phase k: -a_k sin(m_k theta + phase_k).
            let rotor: Vec<Complex64> = phases
                .iter()
                .zip(self.lines.amplitudes())
                .map(|(&phase, &amplitude)| Complex64::from_polar(amplitude, phase))
                .collect();
            let gradient = DVector::from_fn(count, |k, _| -(rotor[k] * slopes[harmonics[k] as usize].conj()).im);
            let mut normal = DMatrix::zeros(count, count);
            for k in 0..count {
                for l in 0..=k {
                    let difference = weights[(harmonics[k] - harmonics[l]) as usize].conj();
                    let sum = weights[(harmonics[k] + harmonics[l]) as usize].conj();
                    normal[(k, l)] =
                        0.5 * ((rotor[k] * rotor[l].conj() * difference).re - (rotor[k] * rotor[l] * sum).re);
                }
            }
            let mut improved = None;
            while damping < 1e6 {
                let mut damped = normal.clone();
                for k in 0..count {
                    damped[(k, k)] *= 1.0 + damping;
                }
                if let Some(factor) = Cholesky::new(damped) {
                    let step = factor.solve(&gradient) * (-2.0 * scale / f64::from(order));
                    let trial: Vec<f64> = phases.iter().zip(step.iter()).map(|(p, s)| p + s).collect();
                    let trial_samples = self.waveform(&trial);
                    let trial_norm = self::norm(&trial_samples, order);
                    if trial_norm < norm {
                        improved = Some((trial, trial_samples, trial_norm));
                        break;
                    }
                }
                damping *= 4.0;
            }
            let Some((trial, trial_samples, trial_norm)) = improved else {
                return;
            };
            let gain = 1.0 - trial_norm / norm;
            (*phases, samples, norm) = (trial, trial_samples, trial_norm);
            damping = (damping / 8.0).max(1e-9);
            if gain < SMALLEST_GAIN {
                return;
            }
        }
    }
}

/// The phases of lower peak that are reached from `phases`; `done` is called after each stage.
pub(super) fn lower_peak(lines: &LineSet, mut phases: Vec<f64>, mut done: impl FnMut()) -> Vec<f64> {
    let coarse = Grid::new(lines, COARSE_OVERSAMPLING);
    // As much work as on the grid of a few hundred lines.
    let rounds = (CLIP_ROUNDS * CLIPPED_SAMPLES / coarse.samples).clamp(FEWEST_ROUNDS, CLIP_ROUNDS);
    for round in 0..rounds {
        let part = round as f64 / rounds as f64;
        coarse.clip(&mut phases, CLIP_LEVELS.0 + (CLIP_LEVELS.1 - CLIP_LEVELS.0) * part);
    }
    done();
    if lines.harmonics().len() > MOST_DESCENDED {
        ORDERS.iter().for_each(|_| done());
        return within_a_turn(phases);
    }
    let fine = Grid::new(lines, FINE_OVERSAMPLING);
    for order in ORDERS {
        let grid = if order < FINE_FROM_ORDER { &coarse } else { &fine };
        grid.descend(&mut phases, order);
        done();
    }
    within_a_turn(phases)
}

fn within_a_turn(phases: Vec<f64>) -> Vec<f64> {
    phases.into_iter().map(|phase| phase.rem_euclid(TAU)).collect()
}

/// How often [`lower_peak`] calls back.
pub(super) const STAGES: usize = 1 + ORDERS.len();

/// The largest magnitude.
pub(super) fn peak(samples: &[f64]) -> f64 {
    samples.iter().fold(0.0, |peak, x| x.abs().max(peak))
}

/// `(mean |x|^order)^(1 / order)`, scaled by the peak on the way so that nothing overflows.
fn norm(samples: &[f64], order: i32) -> f64 {
    let scale = peak(samples);
    let mean = samples.iter().map(|x| (x / scale).powi(order)).sum::<f64>() / samples.len() as f64;
    scale * mean.powf(1.0 / f64::from(order))
}
