//! Frequency responses without a model, and what is known of their noise.

use num_complex::Complex64;

/// One line of a frequency response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResponseLine {
    /// Frequency in rad/s.
    pub omega_rad_s: f64,
    /// Response over command.
    pub response: Complex64,
    /// Variance of `response`: `E |dG|^2` (both parts together).
    pub variance: f64,
}

/// A non-parametric frequency response with what is known of its noise.
#[derive(Clone, Debug, PartialEq)]
pub struct FrequencyResponse {
    /// The lines, by frequency.
    pub lines: Vec<ResponseLine>,
    /// Degrees of freedom (of complex samples) behind each line's variance, after pooling; infinite where the
    /// variance is known.
    pub degrees_of_freedom: f64,
    /// Periods averaged (1 for arbitrary records).
    pub periods: usize,
}
