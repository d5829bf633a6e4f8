//! A line of a frequency response, and what stands between command and actuator there.

use num_complex::Complex64;

use crate::frequency_response::hold::{HoldChain, HoldImage};
use crate::spectra::SpectralLine;

/// One frequency at which the response is known.
#[derive(Clone, Debug, PartialEq)]
pub struct FitLine {
    /// Frequency in rad/s.
    pub omega_rad_s: f64,
    /// Response over command.
    pub response: Complex64,
    /// Its noise variance.
    pub variance: f64,
    /// Degrees of freedom of `variance`.
    pub dof: f64,
    /// How many neighbors share what is known of `variance`.
    pub pooled: f64,
    /// Which frequencies the actuator sees on this line, with what weight: holds and known filter.
    pub images: Vec<HoldImage>,
}

impl FitLine {
    /// A line of a spectrum behind the holds of its record.
    #[must_use]
    pub fn new(line: &SpectralLine, holds: &HoldChain) -> Self {
        Self {
            omega_rad_s: line.omega_rad_s,
            response: line.ratio(),
            variance: line.ratio_variance(),
            dof: line.dof,
            pooled: line.pooled as f64,
            images: holds.images(line.omega_rad_s),
        }
    }

    /// The same line with a filter of this response in front of the holds.
    ///
    /// The filter shapes the command's samples, before any hold makes images of them: all images
    /// carry its response at the line itself.
    #[must_use]
    pub fn behind(mut self, filter: Complex64) -> Self {
        for image in &mut self.images {
            image.weight *= filter;
        }
        self
    }

    /// The same line with something of this response (argument in rad/s) behind the actuator, such as a stand.
    ///
    /// It acts in continuous time: each image passes it at its own frequency.
    #[must_use]
    pub fn through(mut self, follower: impl Fn(f64) -> Complex64) -> Self {
        for image in &mut self.images {
            image.weight *= follower(image.omega_rad_s);
        }
        self
    }

    /// What the rows show of an actuator with this response (argument in rad/s), holds and filter included.
    #[must_use]
    pub fn seen(&self, actuator: impl Fn(f64) -> Complex64) -> Complex64 {
        self.images.iter().map(|image| image.weight * actuator(image.omega_rad_s)).sum()
    }
}
