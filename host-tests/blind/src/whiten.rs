//! Residuals in the frequency domain, where stationary noise is independent from bin to bin (Whittle's likelihood).

use std::sync::Arc;

use num_complex::Complex64;
use rotorlead_fourier::{RealToComplex, real_forward};

/// Transforms signals of one length.
pub struct Spectrum {
    transform: Arc<dyn RealToComplex<f64>>,
    input: Vec<f64>,
    output: Vec<Complex64>,
}

impl Spectrum {
    /// For signals of `rows` rows.
    #[must_use]
    pub fn new(rows: usize) -> Self {
        let transform = real_forward(rows);
        let (input, output) = (transform.make_input_vec(), transform.make_output_vec());
        Self { transform, input, output }
    }

    /// Real and imaginary parts of the bins `1..rows / 2`, in turns, times `weights`, over the root of the rows. Noise
    /// with these weights has unit power per bin, and `-sum of squares` is the log likelihood of a residual but for a
    /// constant. The mean is left out: a load cell's zero is anyone's guess.
    ///
    /// # Panics
    /// When `signal` has not the length that was stated.
    pub fn whitened(&mut self, signal: &[f64], weights: &[f64]) -> Vec<f64> {
        self.input.copy_from_slice(signal);
        self.transform.process(&mut self.input, &mut self.output).expect("buffers that the transform made");
        let scale = 1.0 / (signal.len() as f64).sqrt();
        let bins = self.output[1..].iter().zip(weights);
        bins.flat_map(|(bin, weight)| [bin.re * weight * scale, bin.im * weight * scale]).collect()
    }
}
