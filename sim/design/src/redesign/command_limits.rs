//! What a lead asks of an actuator whose command may go only so far, or change only so fast.
//!
//! A sinusoid of amplitude `A` ahead of `C(s)` is `A |C(j w)|` behind it, and changes by at most `w A |C(j w)|` per second.
//! Where that passes the bound of the actuator, the lead's extra command does not reach the motor. No filter helps far beyond:
//! for a response that is still within 3 dB the fundamental of the command has to be `A / sqrt(2) |G(0) / G(j w)|`. What changes
//! by at most `r` per second has a fundamental of at most `4 r / (pi w)`: a triangle's, `8 / pi^2` of its peak `pi r / (2 w)`.
//! What stays `h` under a clip on one side and `H` on the other, with its mean kept, has one of at most
//! `2 / pi (h + H) sin(pi h / (h + H))`: that of pulses; a square wave's `4 h / pi` where `h = H`.

use std::f64::consts::{FRAC_2_PI, PI};

use num_complex::Complex64;
use rotorlead_plant::ActiveEffect;
use rotorlead_plant::effect::Kind;
use rotorlead_plant::effect::{saturation, slew_limit};
use serde::Serialize;

use rotorlead_identify::frequency_response::bandwidth::MINUS_3_DB;

/// Frequencies are searched from this part of the highest one on. Chosen: four decades below the bandwidth a lead amplifies nothing.
const LOWEST_PART: f64 = 1e-4;
/// Factor from one of them to the next. Chosen: a frequency known to 1 %, by some 900 of them.
const FACTOR: f64 = 1.01;

/// A bound of the command at one nominal command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bound {
    /// The effect that is the bound.
    pub kind: &'static Kind,
    /// The most that is followed: duty, or duty per second.
    pub most: f64,
    /// The largest fundamental of what is followed: duty, or duty times rad/s.
    pub fundamental: f64,
    /// Whether it bounds the rate of change.
    pub of_rate: bool,
}

/// What a lead asks of a bound.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Limit {
    /// The effect that is the bound.
    pub kind: &'static Kind,
    /// The most that is followed: duty from the nominal command for a clip, duty per second for a slew limit.
    pub most: f64,
    /// The command behind the filter passes it from this frequency on, rad/s; `None`: nowhere below the bandwidth.
    pub passed_from_rad_s: Option<f64>,
    /// Largest amplitude ahead of the filter that stays within it up to the bandwidth.
    pub largest_amplitude: f64,
    /// The highest frequency, rad/s, at which this amplitude can come within 3 dB around its mean, with any filter.
    pub reachable_rad_s: f64,
}

impl Bound {
    /// The bounds that `effects` set around `nominal`.
    pub fn from_effects(effects: &[ActiveEffect], nominal: f64) -> Vec<Self> {
        let bound = |effect: &ActiveEffect| {
            let kind = effect.kind();
            match kind.id {
                slew_limit::ID => {
                    let most = effect.slew_per_s()?;
                    Some(Self { kind, most, fundamental: 2.0 * FRAC_2_PI * most, of_rate: true })
                }
                saturation::ID => {
                    let (above, below) = (effect.value("max")? - nominal, nominal - effect.value("min")?);
                    let (most, width) = (above.min(below).max(0.0), above + below);
                    let fundamental = FRAC_2_PI * width * (PI * most / width).sin();
                    Some(Self { kind, most, fundamental, of_rate: false })
                }
                _ => None,
            }
        };
        effects.iter().filter_map(bound).collect()
    }

    fn asked(&self, amplitude: f64, omega_rad_s: f64) -> f64 {
        if self.of_rate { amplitude * omega_rad_s } else { amplitude }
    }

    /// What `lead` asks of it up to `bandwidth_rad_s` with an amplitude ahead of it; `actuator` is its response.
    pub fn against(
        self,
        amplitude: f64,
        bandwidth_rad_s: f64,
        lead: impl Fn(f64) -> Complex64,
        actuator: impl Fn(f64) -> Complex64,
    ) -> Limit {
        let omegas = || {
            let low = LOWEST_PART * bandwidth_rad_s;
            (0_i32..).map(move |step| low * FACTOR.powi(step)).take_while(|omega| *omega < bandwidth_rad_s)
        };
        let asked = |omega: f64| self.asked(amplitude * lead(omega).norm(), omega);
        let highest = omegas().chain([bandwidth_rad_s]).map(asked).fold(0.0, f64::max);
        let needed = |omega: f64| self.asked(MINUS_3_DB * amplitude * (actuator(0.0) / actuator(omega)).norm(), omega);
        // It grows with the frequency; far above all bandwidths it is passed by any bound that is one. A billionth of 100 rad/s takes some
        // 40 halvings.
        let (mut low, mut high) = (0.0, 1e6);
        while high - low > 1e-9 * high {
            let middle = 0.5 * (low + high);
            if needed(middle) <= self.fundamental { low = middle } else { high = middle }
        }
        Limit {
            kind: self.kind,
            most: self.most,
            passed_from_rad_s: omegas().find(|omega| asked(*omega) > self.most),
            largest_amplitude: amplitude * self.most / highest,
            reachable_rad_s: low,
        }
    }
}
