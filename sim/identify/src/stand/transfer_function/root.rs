//! Poles and zeros with their standard errors.

use std::f64::consts::TAU;

use nalgebra::DVector;
use num_complex::Complex64;
use serde::ser::SerializeStruct as _;
use serde::{Serialize, Serializer};

use super::sections::{Placed, Section};
use crate::estimate::Estimate;
use crate::estimate::uncertainty::Uncertainty;

/// A real pole or zero, or a complex pair of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Root {
    /// The root in rad/s; of a pair, the one in the upper half plane.
    pub value: Complex64,
    /// Magnitude of the root in rad/s: a pair's undamped frequency, a real root's corner frequency. For its interval use
    /// [`Estimate::interval_of_logarithm`].
    pub frequency_rad_s: Estimate,
    /// Damping ratio `-Re / |root|`: below one in magnitude for pairs, exactly one or minus one for real roots. Negative
    /// in the right half plane. For a pair's interval use [`Estimate::interval_of_logarithm`].
    pub damping: Estimate,
}

impl Serialize for Root {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut values = serializer.serialize_struct("Root", 6)?;
        values.serialize_field("frequency_hz", &(self.frequency_rad_s.value / TAU))?;
        values.serialize_field("frequency_hz_std", &(self.frequency_rad_s.std / TAU))?;
        values.serialize_field("damping", &self.damping.value)?;
        values.serialize_field("damping_std", &self.damping.std)?;
        values.serialize_field("real_rad_s", &self.value.re)?;
        values.serialize_field("imaginary_rad_s", &self.value.im)?;
        values.end()
    }
}

impl Root {
    /// Whether it stands for itself and its conjugate.
    #[must_use]
    pub fn is_pair(&self) -> bool {
        self.value.im != 0.0
    }

    /// Time constant of a real root in seconds; `None` of a pair. Negative in the right half plane. For its interval use
    /// [`Estimate::interval_of_logarithm`].
    #[must_use]
    pub fn time_constant_s(&self) -> Option<Estimate> {
        let Estimate { value, std, dof } = self.frequency_rad_s;
        let time_constant_s = self.damping.value / value;
        (!self.is_pair()).then(|| Estimate { value: time_constant_s, std: time_constant_s.abs() * std / value, dof })
    }
}

/// The roots of one section.
pub(super) fn roots((section, at): Placed<'_>, parameters: &[f64], uncertainty: &Uncertainty) -> Vec<Root> {
    let coefficients = &parameters[at.clone()];
    let estimate = |value: f64, derivatives: [f64; 2]| {
        let mut gradient = DVector::zeros(parameters.len());
        for (index, derivative) in at.clone().zip(derivatives) {
            gradient[index] = derivative;
        }
        uncertainty.estimate(value, &gradient)
    };
    let values = section.roots(coefficients);
    match *coefficients {
        [c1, c2] if values[0].im != 0.0 => {
            let frequency = section.scale_rad_s / c2.sqrt();
            let damping = 0.5 * c1 / c2.sqrt();
            vec![Root {
                value: values[0],
                frequency_rad_s: estimate(frequency, [0.0, -0.5 * frequency / c2]),
                damping: estimate(damping, [0.5 / c2.sqrt(), -0.5 * damping / c2]),
            }]
        }
        _ => values.iter().map(|value| real_root(section, coefficients, *value, estimate)).collect(),
    }
}

fn real_root(
    section: &Section,
    coefficients: &[f64],
    value: Complex64,
    estimate: impl Fn(f64, [f64; 2]) -> Estimate,
) -> Root {
    let x = value.re / section.scale_rad_s;
    // dx / dc_i = -x^i / (c_1 + 2 c_2 x), from the section being zero at x.
    let slope = coefficients[0] + 2.0 * coefficients.get(1).copied().unwrap_or(0.0) * x;
    let by = section.scale_rad_s * x.signum() / slope;
    Root {
        value,
        frequency_rad_s: estimate(value.re.abs(), [-by * x, -by * x * x]),
        damping: estimate(-value.re.signum(), [0.0, 0.0]),
    }
}
