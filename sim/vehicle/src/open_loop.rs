//! A loop that is open, and what is left of it to the edge of stability.

use std::f64::consts::PI;

use num_complex::Complex64;

/// An open loop as a Bode plot shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopCurve {
    /// Frequency in rad/s, and response.
    pub response: Vec<(f64, Complex64)>,
    /// Phase above -180 degrees where the magnitude is 1, the least where it is so several times, degrees; `None` without a crossover.
    pub phase_margin_deg: Option<LoopMargin>,
    /// How far the magnitude is under 1 where the phase first passes -180 degrees, decibels; `None` where it does not.
    pub gain_margin_db: Option<LoopMargin>,
}

/// A margin, and where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopMargin {
    /// Frequency, rad/s.
    pub omega_rad_s: f64,
    /// The margin in its unit.
    pub value: f64,
}

/// A place between the frequencies `before` and the next, `part` of the way.
#[derive(Clone, Copy, Debug)]
struct Place {
    before: usize,
    part: f64,
}

/// The phase without jumps, from between -360 and 0 degrees on, radians.
fn unwrapped(response: &[Complex64]) -> Vec<f64> {
    let mut last: Option<f64> = None;
    let phases = response.iter().map(|value| {
        let phase = value.arg();
        let phase = match last {
            None if phase > 0.0 => phase - 2.0 * PI,
            None => phase,
            Some(last) => phase - ((phase - last) / (2.0 * PI)).round() * 2.0 * PI,
        };
        last = Some(phase);
        phase
    });
    phases.collect()
}

/// A loop that is open, whose gain is to be chosen: `L` of unit gain.
#[derive(Clone, Debug)]
pub struct OpenLoop {
    pub(crate) response: Vec<Complex64>,
    /// Its phase, continuous, radians.
    phase: Vec<f64>,
    /// Its square magnitude.
    power: Vec<f64>,
    /// The largest of it where the phase is -180 degrees or below; 0 where it is nowhere.
    power_beyond: f64,
}

impl OpenLoop {
    pub fn new(response: Vec<Complex64>) -> Self {
        let phase = unwrapped(&response);
        let power: Vec<f64> = response.iter().map(|value| value.norm_sqr()).collect();
        let beyond = phase.iter().zip(&power).filter(|(phase, _)| **phase <= -PI);
        let power_beyond = beyond.fold(0.0, |most: f64, (_, power)| most.max(*power));
        Self { response, phase, power, power_beyond }
    }

    /// Whether the phase stays above -180 degrees wherever the loop amplifies: such a loop is stable at every lower gain too, which one
    /// needs whose motors saturate.
    pub fn is_stable_from_below(&self, gain: f64) -> bool {
        gain * gain * self.power_beyond < 1.0
    }

    /// `max |1 / (1 + gain L)|`. Infinite unless the loop is stable at every lower gain too.
    pub fn max_sensitivity(&self, gain: f64) -> f64 {
        if !self.is_stable_from_below(gain) {
            return f64::INFINITY;
        }
        let inverse = self.response.iter().map(|open| (1.0 + gain * open).norm_sqr());
        inverse.fold(f64::INFINITY, f64::min).recip().sqrt()
    }

    /// The smallest phase above -180 degrees at a magnitude of 1, from neighbors on either side of it; infinite without a crossover.
    pub fn phase_margin_deg(&self, gain: f64) -> f64 {
        let phases = self.gain_crossovers(gain).map(|Place { before, part }| self.phase_at(before, part));
        phases.fold(f64::INFINITY, |least, phase| least.min((PI + phase).to_degrees()))
    }

    /// Where the magnitude is 1.
    fn gain_crossovers(&self, gain: f64) -> impl Iterator<Item = Place> {
        self.power.windows(2).enumerate().filter_map(move |(before, power)| {
            let [low, high] = [power[0], power[1]].map(|power| gain * gain * power);
            let crosses = (low >= 1.0) != (high >= 1.0);
            crosses.then(|| Place { before, part: low.ln() / (low / high).ln() })
        })
    }

    /// Where the phase first passes -180 degrees.
    fn phase_crossover(&self) -> Option<Place> {
        let before = self.phase.windows(2).position(|phase| phase[0] > -PI && phase[1] <= -PI)?;
        Some(Place { before, part: (self.phase[before] + PI) / (self.phase[before] - self.phase[before + 1]) })
    }

    fn phase_at(&self, before: usize, part: f64) -> f64 {
        self.phase[before] + part * (self.phase[before + 1] - self.phase[before])
    }

    /// What is drawn of it at a gain, with the margins' places.
    pub fn curve(&self, omega_rad_s: &[f64], gain: f64) -> LoopCurve {
        let omega =
            |Place { before, part }| omega_rad_s[before] * (omega_rad_s[before + 1] / omega_rad_s[before]).powf(part);
        let db = |before: usize| 10.0 * (gain * gain * self.power[before]).log10();
        let worst = self
            .gain_crossovers(gain)
            .min_by(|a, b| self.phase_at(a.before, a.part).total_cmp(&self.phase_at(b.before, b.part)));
        let gain_margin = self.phase_crossover().map(|place| {
            let Place { before, part } = place;
            LoopMargin { omega_rad_s: omega(place), value: -(db(before) + part * (db(before + 1) - db(before))) }
        });
        let phase_margin = worst.map(|place| LoopMargin {
            omega_rad_s: omega(place),
            value: (PI + self.phase_at(place.before, place.part)).to_degrees(),
        });
        let response = omega_rad_s.iter().copied().zip(self.response.iter().map(|open| gain * open)).collect();
        LoopCurve { response, phase_margin_deg: phase_margin, gain_margin_db: gain_margin }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Vec<f64> {
        (0..400).map(|index| 0.2 * 15_000_f64.powf(f64::from(index) / 399.0)).collect()
    }

    #[test]
    fn margins_are_those_of_an_analytic_loop() {
        // k exp(-s T) / s: phase margin 90 degrees - k T, and instability at k T = pi / 2.
        let (omega, delay_s) = (grid(), 0.01);
        let open: Vec<Complex64> =
            omega.iter().map(|&w| Complex64::cis(-w * delay_s) / Complex64::new(0.0, w)).collect();
        let chain = OpenLoop::new(open);
        for gain in [10.0, 40.0, 80.0] {
            let expected = 90.0 - (gain * delay_s).to_degrees();
            let found = chain.phase_margin_deg(gain);
            assert!((found - expected).abs() < 0.02, "{found} is not {expected}");
        }
        // The optimum of the integrator with dead time (k T = 0.5) is known: Ms about 1.6.
        let at_half = chain.max_sensitivity(50.0);
        let exact = (1..200_000).map(|i| f64::from(i) * 1e-3);
        let exact = exact.map(|w| 1.0 / (1.0 + 50.0 * Complex64::cis(-w * delay_s) / Complex64::new(0.0, w)).norm());
        let exact = exact.fold(0.0, f64::max);
        assert!((at_half / exact - 1.0).abs() < 5e-3, "{at_half} is not {exact}");
        assert!(chain.max_sensitivity(156.0).is_finite());
        assert!(chain.max_sensitivity(160.0).is_infinite());
    }

    #[test]
    fn the_margins_of_a_curve_are_at_its_crossovers() {
        // k exp(-s T) / s passes 1 at k and -180 degrees at pi / 2 T, where it is 2 k T / pi.
        let (omega, delay_s, gain) = (grid(), 0.01, 40.0);
        let open = omega.iter().map(|&w| Complex64::cis(-w * delay_s) / Complex64::new(0.0, w)).collect();
        let curve = OpenLoop::new(open).curve(&omega, gain);
        let (phase, magnitude) = (curve.phase_margin_deg.unwrap(), curve.gain_margin_db.unwrap());
        assert!((phase.omega_rad_s / gain - 1.0).abs() < 1e-6, "{phase:?}");
        assert!((phase.value - (90.0 - (gain * delay_s).to_degrees())).abs() < 0.02, "{phase:?}");
        let at = 0.5 * PI / delay_s;
        assert!((magnitude.omega_rad_s / at - 1.0).abs() < 1e-3, "{magnitude:?}");
        assert!((magnitude.value - 20.0 * (at / gain).log10()).abs() < 0.01, "{magnitude:?}");
    }

    #[test]
    fn a_chain_that_only_a_high_gain_makes_stable_is_refused() {
        // Two integrators and a late zero: beyond -180 degrees at low frequencies.
        let omega = grid();
        let open: Vec<Complex64> = omega
            .iter()
            .map(|&w| {
                let s = Complex64::new(0.0, w);
                1e3 * (1.0 + s / 10.0) / (s * s * (1.0 + s / 2.0))
            })
            .collect();
        assert!(OpenLoop::new(open).max_sensitivity(1.0).is_infinite());
    }
}
