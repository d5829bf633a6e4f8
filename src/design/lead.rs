//! The continuous compensator.

use libm::{log10, pow, sqrt};
use num_complex::Complex64;

use super::error::within;
use super::{BANDWIDTH_DROP_DB, DAMPING_RANGE, DEFAULT_DAMPING, DesignError, FREQUENCY_RANGE_RAD_S};

/// The continuous compensator
/// `C(s) = omega_f^2 (s / omega_z + 1) / (s^2 + 2 damping omega_f s + omega_f^2)`, eq. (3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeadParameters {
    /// Frequency of the zero, which stands on the pole of the fastest motor, rad/s.
    pub omega_z_rad_s: f64,
    /// Frequency of the pair of poles, rad/s.
    pub omega_f_rad_s: f64,
    /// Damping ratio of the poles.
    pub damping: f64,
}

impl LeadParameters {
    /// The paper's design from identified poles `1 / tau_s` and `omega_g_rad_s`, the highest frequency that is to be
    /// amplified: the zero on the fastest pole (2), the damping of (4), the poles at their geometric mean (5).
    ///
    /// # Errors
    /// When there are no poles, one is not finite or outside [`FREQUENCY_RANGE_RAD_S`], or `omega_g_rad_s` is or is not
    /// above all of them.
    pub fn from_poles(poles_rad_s: &[f64], omega_g_rad_s: f64) -> Result<Self, DesignError> {
        let mut omega_z_rad_s = 0.0;
        for &pole in poles_rad_s {
            let pole = within("pole_rad_s", pole, FREQUENCY_RANGE_RAD_S)?;
            if pole > omega_z_rad_s {
                omega_z_rad_s = pole;
            }
        }
        if omega_z_rad_s == 0.0 {
            return Err(DesignError::NoPoles);
        }
        let omega_g_rad_s = within("omega_g_rad_s", omega_g_rad_s, FREQUENCY_RANGE_RAD_S)?;
        Self { omega_z_rad_s, omega_f_rad_s: sqrt(omega_z_rad_s * omega_g_rad_s), damping: DEFAULT_DAMPING }.checked()
    }

    /// Itself, when the parameters make sense at some loop rate.
    ///
    /// # Errors
    /// When a parameter is not finite or out of range, or the zero is not below the poles.
    pub fn checked(self) -> Result<Self, DesignError> {
        within("omega_z_rad_s", self.omega_z_rad_s, FREQUENCY_RANGE_RAD_S)?;
        within("omega_f_rad_s", self.omega_f_rad_s, FREQUENCY_RANGE_RAD_S)?;
        within("damping", self.damping, DAMPING_RANGE)?;
        if self.omega_z_rad_s >= self.omega_f_rad_s {
            return Err(DesignError::ZeroNotBelowPoles {
                omega_z_rad_s: self.omega_z_rad_s,
                omega_f_rad_s: self.omega_f_rad_s,
            });
        }
        Ok(self)
    }

    /// Highest frequency that is amplified, by the asymptotes: `omega_f^2 / omega_z`, eq. (5) solved for it.
    #[must_use]
    pub fn omega_g_rad_s(&self) -> f64 {
        self.omega_f_rad_s * self.omega_f_rad_s / self.omega_z_rad_s
    }

    /// Peak gain by the asymptotes, `eta_f = 10 log10(omega_g / omega_z)` in dB, eq. (5). The true peak is lower.
    #[must_use]
    pub fn asymptotic_peak_db(&self) -> f64 {
        10.0 * log10(self.omega_g_rad_s() / self.omega_z_rad_s)
    }

    /// `omega_s_min = omega_z / 10^(3/20)` (below eq. 2): actuators with a slower pole gain little.
    #[must_use]
    pub fn slowest_helped_rad_s(&self) -> f64 {
        self.omega_z_rad_s / pow(10.0, BANDWIDTH_DROP_DB / 20.0)
    }

    /// `C(j omega)`, eq. (3).
    #[must_use]
    pub fn response(&self, omega_rad_s: f64) -> Complex64 {
        let (w, wf) = (omega_rad_s, self.omega_f_rad_s);
        Complex64::new(wf * wf, wf * wf * w / self.omega_z_rad_s)
            / Complex64::new(wf * wf - w * w, 2.0 * self.damping * wf * w)
    }
}
