//! A continuous-time transfer function by its gain, poles and zeros.

use num_complex::Complex64;

/// `G(s) = K prod(1 - s / z_i) / prod(1 - s / p_i)`.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferFunction {
    /// Static gain `K = G(0)`, output units per input unit.
    pub gain: f64,
    /// Poles in rad/s; complex ones come with their conjugates.
    pub poles: Vec<Complex64>,
    /// Zeros in rad/s; complex ones come with their conjugates.
    pub zeros: Vec<Complex64>,
}

impl TransferFunction {
    /// The response at a frequency in rad/s.
    #[must_use]
    pub fn response(&self, omega_rad_s: f64) -> Complex64 {
        let s = Complex64::new(0.0, omega_rad_s);
        // Factor by factor in turn: the products by themselves could leave the range of numbers.
        let mut value = Complex64::from(self.gain);
        for index in 0..self.poles.len().max(self.zeros.len()) {
            if let Some(zero) = self.zeros.get(index) {
                value *= 1.0 - s / zero;
            }
            if let Some(pole) = self.poles.get(index) {
                value /= 1.0 - s / pole;
            }
        }
        value
    }

    /// Whether every pole is in the left half plane.
    #[must_use]
    pub fn is_stable(&self) -> bool {
        self.poles.iter().all(|pole| pole.re < 0.0)
    }

    /// Whether a zero is in the right half plane.
    #[must_use]
    pub fn is_non_minimum_phase(&self) -> bool {
        self.zeros.iter().any(|zero| zero.re > 0.0)
    }
}
