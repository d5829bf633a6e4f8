//! The bandwidth at each point of a model, before and after compensation.

use num_complex::Complex64;
use rotorlead::design::LeadParameters;
use rotorlead_plant::{ActiveEffect, CompensatorDesign, Model, OperatingPoint, Point, hold_response};
use serde::Serialize;

use rotorlead_identify::frequency_response::bandwidth::{Bandwidth, compute_bandwidth};

/// Highest frequency that is searched for a bandwidth, rad/s. Chosen: 1.6 kHz, far above what a propeller follows; higher costs only time.
const SEARCHED_UP_TO_RAD_S: f64 = 1e4;

/// Which form of the compensated actuator is meant.
#[derive(Clone, Copy, Debug)]
pub enum Chain<'a> {
    /// C(s) and the lag, as the paper's Table 3 simulates them.
    Continuous(&'a LeadParameters),
    /// The same of a design, where an inverse is the lead that it is for small signals at each point.
    Designed(&'a CompensatorDesign),
    /// What runs: the filter with its rounded coefficients, the hold of its loop and that of the ESC's frame.
    Sampled {
        /// The filter and its loop.
        design: &'a CompensatorDesign,
        /// Rate at which the ESC takes over a command, hertz; `None` for an ESC without frames.
        esc_frame_hz: Option<f64>,
    },
}

/// The bandwidths at one nominal command.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BandwidthPoint {
    /// Command around which they hold, 0..1.
    pub nominal: f64,
    /// Of the actuator alone.
    #[serde(rename = "uncompensated_rad_s")]
    pub uncompensated: Bandwidth,
    /// With the compensator in front.
    #[serde(rename = "compensated_rad_s")]
    pub compensated: Bandwidth,
}

/// The smallest frequencies at which the response at each point of `model` is 3 dB under its static value.
///
/// A delay does not change them, and is left out, and so are the model's effects.
#[must_use]
pub fn bandwidths(model: &Model, chain: Chain) -> Vec<BandwidthPoint> {
    bandwidths_with(model, &[], chain)
}

/// [`bandwidths`] of small signals with the linearized `effects`. Those without a frequency response
/// ([`Linearity::Absent`](rotorlead_plant::effect::Linearity::Absent)) are left out.
#[must_use]
pub fn bandwidths_with(model: &Model, effects: &[ActiveEffect], chain: Chain) -> Vec<BandwidthPoint> {
    let limit = chain.limit_rad_s();
    let at = |point: &Point| {
        let around = OperatingPoint { nominal: point.nominal, lag: point.lag(), response: 0.0 };
        let actuator = |omega: f64| {
            let plain = lag(point, omega) * chain.holds(omega);
            effects.iter().fold(plain, |response, effect| response * effect.response(&around, omega))
        };
        BandwidthPoint {
            nominal: point.nominal,
            uncompensated: compute_bandwidth(actuator, limit),
            compensated: compute_bandwidth(|omega| chain.filter(point.nominal, omega) * actuator(omega), limit),
        }
    };
    model.points.iter().map(at).collect()
}

/// `K / (tau s + 1)`, eq. (1).
fn lag(point: &Point, omega_rad_s: f64) -> Complex64 {
    point.gain / Complex64::new(1.0, point.time_constant_s * omega_rad_s)
}

impl<'a> Chain<'a> {
    /// The compensator, where it is a design.
    #[must_use]
    pub fn design(self) -> Option<&'a CompensatorDesign> {
        match self {
            Self::Continuous(_) => None,
            Self::Designed(design) | Self::Sampled { design, .. } => Some(design),
        }
    }

    /// The lead that the compensator is at a nominal command, for small signals; `None` where it is bypassed.
    #[must_use]
    pub fn lead_at(self, nominal: f64) -> Option<LeadParameters> {
        match self {
            Self::Continuous(lead) => Some(*lead),
            Self::Designed(design) | Self::Sampled { design, .. } => design.lead_at(nominal),
        }
    }
}

impl Chain<'_> {
    pub(super) fn filter(&self, nominal: f64, omega_rad_s: f64) -> Complex64 {
        match self {
            Self::Continuous(_) | Self::Designed(_) => {
                self.lead_at(nominal).map_or(Complex64::ONE, |lead| lead.response(omega_rad_s))
            }
            Self::Sampled { design, .. } => design.response(nominal, omega_rad_s),
        }
    }

    pub(super) fn holds(&self, omega_rad_s: f64) -> Complex64 {
        match self {
            Self::Continuous(_) | Self::Designed(_) => Complex64::ONE,
            Self::Sampled { design, esc_frame_hz } => hold_response(design.loop_rate_hz(), *esc_frame_hz, omega_rad_s),
        }
    }

    /// A sampled system has no response of its own above half its rate.
    pub(super) fn limit_rad_s(&self) -> f64 {
        match self {
            Self::Continuous(_) | Self::Designed(_) => SEARCHED_UP_TO_RAD_S,
            Self::Sampled { design, esc_frame_hz } => {
                let rate_hz = esc_frame_hz.map_or(design.loop_rate_hz(), |frame| frame.min(design.loop_rate_hz()));
                SEARCHED_UP_TO_RAD_S.min(std::f64::consts::PI * rate_hz)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::testing::table_1;
    use rotorlead_plant::{Catalog, Effect};

    use super::*;

    #[test]
    fn effects_with_a_frequency_response_move_the_bandwidth_and_others_do_not() {
        let lead = LeadParameters { omega_z_rad_s: 14.13, omega_f_rad_s: 94.2, damping: 0.707 };
        let chain = Chain::Continuous(&lead);
        let plain = bandwidths(&table_1(), chain);
        let with = |kind: &str, parameters: &[(&str, f64)]| {
            let parameters = parameters.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
            let effect = Effect { kind: kind.to_owned(), parameters, std: Default::default() };
            let effects = Catalog::standard().active_effects(&Model { effects: vec![effect], ..table_1() }).unwrap();
            bandwidths_with(&table_1(), &effects, chain)
        };
        for (kind, parameters) in [
            ("transport_delay", ("delay_s", 0.01)),
            ("backlash", ("half_width", 0.01)),
            ("slew_limit", ("rate_per_s", 1.0)),
        ] {
            for (a, b) in with(kind, &[parameters]).iter().zip(&plain) {
                let apart = |a: Bandwidth, b: Bandwidth| (a.rad_s().unwrap() / b.rad_s().unwrap() - 1.0).abs();
                assert!(apart(a.uncompensated, b.uncompensated) < 1e-12, "{kind}");
                assert!(apart(a.compensated, b.compensated) < 1e-12, "{kind}");
            }
        }
        // Two lags: (1 + a x)(1 + b x) = 10^0.3 with x the square of the bandwidth.
        for (point, found) in table_1().points.iter().zip(with("second_pole", &[("time_constant_s", 0.03)])) {
            let (a, b) = (point.time_constant_s.powi(2), 0.03_f64.powi(2));
            let x = (((a + b).powi(2) + 4.0 * a * b * (10f64.powf(0.3) - 1.0)).sqrt() - (a + b)) / (2.0 * a * b);
            assert!((found.uncompensated.rad_s().unwrap() / x.sqrt() - 1.0).abs() < 1e-12);
        }
        // A time constant that is wrong by half: the bandwidth of a lag goes by its inverse.
        for (a, b) in with("parameter_error", &[("gain_error", 0.2), ("time_constant_error", -0.5)]).iter().zip(&plain)
        {
            assert!((a.uncompensated.rad_s().unwrap() / b.uncompensated.rad_s().unwrap() - 2.0).abs() < 1e-12);
        }
    }
}
