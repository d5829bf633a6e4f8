//! Fourier coefficients of consecutive periods, from samples that come in pieces of any length.

use std::sync::Arc;

use num_complex::Complex64;
use rotorlead_fourier::{RealToComplex, real_forward};

/// Transforms one period after the other.
pub(super) struct PeriodTransform {
    fft: Arc<dyn RealToComplex<f64>>,
    period: Vec<f64>,
    filled: usize,
    spectrum: Vec<Complex64>,
    scratch: Vec<Complex64>,
}

impl PeriodTransform {
    /// For periods of `length` samples, one or more.
    pub(super) fn new(length: usize) -> Self {
        Self::with(real_forward(length))
    }

    /// Another for periods of the same length.
    pub(super) fn another(&self) -> Self {
        Self::with(Arc::clone(&self.fft))
    }

    fn with(fft: Arc<dyn RealToComplex<f64>>) -> Self {
        let (period, spectrum, scratch) = (fft.make_input_vec(), fft.make_output_vec(), fft.make_scratch_vec());
        Self { fft, period, filled: 0, spectrum, scratch }
    }

    /// Bins of a period's spectrum, from the mean to half the sampling rate.
    pub(super) fn bins(&self) -> usize {
        self.spectrum.len()
    }

    /// Adds samples, and calls `each` with the spectrum of every period that they complete: amplitudes of `e^(j w t)` times
    /// two.
    pub(super) fn add(&mut self, mut samples: &[f64], mut each: impl FnMut(&[Complex64])) {
        let length = self.period.len();
        while !samples.is_empty() {
            let (now, later) = samples.split_at(samples.len().min(length - self.filled));
            self.period[self.filled..self.filled + now.len()].copy_from_slice(now);
            self.filled += now.len();
            samples = later;
            if self.filled == length {
                self.filled = 0;
                self.fft
                    .process_with_scratch(&mut self.period, &mut self.spectrum, &mut self.scratch)
                    .expect("all buffers are the plan's own");
                for bin in &mut self.spectrum {
                    *bin *= 2.0 / length as f64;
                }
                each(&self.spectrum);
            }
        }
    }
}

/// Spectra of the consecutive periods of `samples`, amplitudes of `e^(j w t)` times two.
pub(crate) fn transform(samples: &[f64], length: usize) -> Vec<Vec<Complex64>> {
    let mut spectra = Vec::new();
    PeriodTransform::new(length).add(samples, |spectrum| spectra.push(spectrum.to_vec()));
    spectra
}
