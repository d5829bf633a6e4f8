//! The compensator's parameters, as stored.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use crate::design::{LeadParameters, ReferenceModel};

/// What a compensator runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum CompensatorKind {
    /// The lead of [`Settings::lead`](super::Settings::lead).
    Lead,
    /// The conditioned inverse of [`Settings::inverse`](super::Settings::inverse) and each motor's
    /// [`curve`](super::MotorSettings::curve).
    Inverse,
    /// The inverse, which goes by the speed that the ESCs say: its gain is corrected to what
    /// [`Settings::speeds`](super::Settings::speeds) has for each motor's commands.
    Rpm,
}

/// The continuous lead compensator. See [`LeadParameters`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Lead {
    /// Frequency of the zero, rad/s.
    pub omega_z_rad_s: f64,
    /// Frequency of the pair of poles, rad/s.
    pub omega_f_rad_s: f64,
    /// Damping ratio of the poles.
    pub damping: f64,
}

/// The conditioned inverse, but for the rotors. See [`crate::inverse`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Inverse {
    /// Natural frequency of the reference model, rad/s.
    pub natural_rad_s: f64,
    /// Damping ratio of the reference model.
    pub damping: f64,
    /// The inverse is bypassed for commands below this.
    pub compensate_from: i32,
    /// The inverse is bypassed for commands above this.
    pub compensate_to: i32,
}

impl From<Lead> for LeadParameters {
    fn from(Lead { omega_z_rad_s, omega_f_rad_s, damping }: Lead) -> Self {
        Self { omega_z_rad_s, omega_f_rad_s, damping }
    }
}

impl From<LeadParameters> for Lead {
    fn from(LeadParameters { omega_z_rad_s, omega_f_rad_s, damping }: LeadParameters) -> Self {
        Self { omega_z_rad_s, omega_f_rad_s, damping }
    }
}

impl Inverse {
    /// The response that the rotors are to have.
    #[must_use]
    pub const fn reference(&self) -> ReferenceModel {
        ReferenceModel { omega_f_rad_s: self.natural_rad_s, damping: self.damping }
    }
}
