//! Classifies an actuator against the uncompensated one, by bandwidth and disturbance peak.

use serde::Serialize;

use crate::study::Row;

/// Ratios closer to 1 than this make no difference. Chosen: tuned gains are up to 2 % short of their limit (tests of `tuning`), so that
/// less may come of the search; more hides a peak of x1.08 (`docs/vehicle.md`).
const SAME: f64 = 0.05;
/// What an actuator is worth beside the bare one, by bandwidth and disturbance peak.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Benefit {
    /// Better in one, and no worse in the other; or a gain set where the bare actuator has none.
    Better,
    /// No difference.
    Same,
    /// Better in one and worse in the other.
    Mixed,
    /// Worse in one, and no better in the other.
    Worse,
}

impl Benefit {
    /// In one word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Better => "better",
            Self::Same => "same",
            Self::Mixed => "mixed",
            Self::Worse => "worse",
        }
    }
}

/// An actuator's results over those of the bare one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ratios {
    /// Rate-loop bandwidths.
    pub bandwidth: f64,
    /// Disturbance peaks.
    pub disturbance_peak: f64,
    /// Settling times, where both settle.
    pub settling: Option<f64>,
}

impl Row {
    /// The results over those of `bare`, where both have some.
    #[must_use]
    pub fn ratios(&self, bare: &Self) -> Option<Ratios> {
        let (own, bare) = (self.performance.as_ref()?, bare.performance.as_ref()?);
        Some(Ratios {
            bandwidth: own.margins.bandwidth_rad_s / bare.margins.bandwidth_rad_s,
            disturbance_peak: own.disturbance_peak_deg / bare.disturbance_peak_deg,
            settling: own.settling_s.zip(bare.settling_s).map(|(own, bare)| own / bare),
        })
    }

    /// What it is worth beside `bare`; `None` for an actuator that has no gain set where the bare one has none either.
    #[must_use]
    pub fn benefit(&self, bare: &Self) -> Option<Benefit> {
        let Some(Ratios { bandwidth, disturbance_peak, .. }) = self.ratios(bare) else {
            return match (&self.performance, &bare.performance) {
                (Some(_), None) => Some(Benefit::Better),
                (None, Some(_)) => Some(Benefit::Worse),
                _ => None,
            };
        };
        let is_better = bandwidth > 1.0 + SAME || disturbance_peak < 1.0 - SAME;
        let is_worse = bandwidth < 1.0 - SAME || disturbance_peak > 1.0 + SAME;
        Some(match (is_better, is_worse) {
            (true, false) => Benefit::Better,
            (false, true) => Benefit::Worse,
            (true, true) => Benefit::Mixed,
            (false, false) => Benefit::Same,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motor_control::MotorControlKind;
    use crate::response::Margins;
    use crate::study::Performance;
    use crate::tuning::Gains;

    fn row(actuator: MotorControlKind, bandwidth_rad_s: f64, disturbance_peak_deg: f64) -> Row {
        let gains = Gains { rate_p_1_s: 1.0, integral_time_s: 1.0, derivative_time_s: 0.0, attitude_p_1_s: 1.0 };
        let margins = Margins { max_sensitivity: 1.6, phase_margin_deg: 50.0, actuator_noise: 0.01, bandwidth_rad_s };
        let performance = Performance {
            gains,
            margins,
            disturbance_peak_deg,
            settling_s: Some(0.1),
            disturbed: Vec::new(),
            open: None,
        };
        Row { actuator, performance: Some(performance) }
    }

    const INVERSE: MotorControlKind = MotorControlKind::Inverse { omega_f_rad_s: 150.0 };

    #[test]
    fn worth_is_by_bandwidth_and_peak() {
        let bare = row(MotorControlKind::None, 80.0, 1.0);
        for (bandwidth, peak, expected) in [
            (100.0, 0.5, Benefit::Better),
            (100.0, 1.02, Benefit::Better),
            (82.0, 0.98, Benefit::Same),
            (100.0, 1.4, Benefit::Mixed),
            (60.0, 2.0, Benefit::Worse),
            (81.0, 1.2, Benefit::Worse),
        ] {
            assert_eq!(row(INVERSE, bandwidth, peak).benefit(&bare), Some(expected), "{bandwidth}, {peak}");
        }
        let none = Row { actuator: MotorControlKind::None, performance: None };
        assert_eq!(bare.benefit(&none), Some(Benefit::Better));
        assert_eq!(none.benefit(&bare), Some(Benefit::Worse));
        assert_eq!(none.benefit(&none), None);
    }
}
