//! The lines as the fit sees them: checked and weighted.

use num_complex::Complex64;

use super::ParametricError;
use crate::frequency_response::FrequencyResponse;

/// Checked lines.
#[derive(Clone, Debug)]
pub(super) struct WeightedLines {
    pub(super) omega_rad_s: Vec<f64>,
    pub(super) response: Vec<Complex64>,
    /// One over the noise's standard deviation.
    pub(super) weight: Vec<f64>,
}

impl WeightedLines {
    /// Checks `response`.
    pub(super) fn new(response: &FrequencyResponse) -> Result<Self, ParametricError> {
        // Below three, weights from the samples have no finite variance (Pintelon & Schoukens, 2012, section 12.3).
        let degrees_of_freedom = response.degrees_of_freedom;
        if degrees_of_freedom.is_nan() || degrees_of_freedom < 3.0 {
            return Err(ParametricError::NoiseUnknown { degrees_of_freedom });
        }
        let largest = response.lines.iter().map(|line| line.response.norm()).fold(0.0, f64::max);
        // Lines without noise get the rounding error as their noise. Chosen: 1e-8, about the square root of a double's rounding unit.
        let floor = (1e-8 * largest).powi(2);
        let mut data = Self { omega_rad_s: vec![], response: vec![], weight: vec![] };
        let mut last = 0.0;
        for line in &response.lines {
            let omega_rad_s = line.omega_rad_s;
            let bad = |what| Err(ParametricError::Line { omega_rad_s, what });
            if !(omega_rad_s > last && omega_rad_s.is_finite()) {
                return bad("not above the one before it");
            }
            if !line.response.is_finite() {
                return bad("not a number");
            }
            if !(line.variance >= 0.0 && line.variance.is_finite()) || largest == 0.0 {
                return bad("without a usable variance");
            }
            last = omega_rad_s;
            data.omega_rad_s.push(omega_rad_s);
            data.response.push(line.response);
            data.weight.push(line.variance.max(floor).sqrt().recip());
        }
        Ok(data)
    }

    pub(super) fn len(&self) -> usize {
        self.omega_rad_s.len()
    }

    /// The highest frequency.
    pub(super) fn top_rad_s(&self) -> f64 {
        self.omega_rad_s.last().copied().unwrap_or(1.0)
    }

    /// The lines whose index has this remainder by two.
    pub(super) fn half(&self, remainder: usize) -> Self {
        fn pick<T: Copy>(all: &[T], remainder: usize) -> Vec<T> {
            all.iter().skip(remainder).step_by(2).copied().collect()
        }
        Self {
            omega_rad_s: pick(&self.omega_rad_s, remainder),
            response: pick(&self.response, remainder),
            weight: pick(&self.weight, remainder),
        }
    }
}
