//! Discrete Fourier transforms of any length: `X_k = sum_n x_n e^(-j 2 pi k n / N)`, and the inverse without its factor `1 / N`.
//!
//! The planner is generic over its numbers and would be compiled into each crate that asks for a plan, which is about half of
//! what the compiler generates for it. Here it is compiled once.

use std::sync::Arc;

use realfft::RealFftPlanner;
pub use realfft::{ComplexToReal, RealToComplex};
pub use rustfft::Fft;
use rustfft::FftPlanner;

/// The transform of `length` complex samples, in place.
#[must_use]
pub fn forward(length: usize) -> Arc<dyn Fft<f64>> {
    FftPlanner::new().plan_fft_forward(length)
}

/// The inverse of [`forward`], `length` times as large.
#[must_use]
pub fn inverse(length: usize) -> Arc<dyn Fft<f64>> {
    FftPlanner::new().plan_fft_inverse(length)
}

/// The lines from zero to half the rate of `length` real samples.
#[must_use]
pub fn real_forward(length: usize) -> Arc<dyn RealToComplex<f64>> {
    RealFftPlanner::new().plan_fft_forward(length)
}

/// The inverse of [`real_forward`], `length` times as large.
#[must_use]
pub fn real_inverse(length: usize) -> Arc<dyn ComplexToReal<f64>> {
    RealFftPlanner::new().plan_fft_inverse(length)
}
