//! The stand swings.

use std::f64::consts::TAU;

use num_complex::Complex64;

use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site};
use crate::filter::{Interval, MEMORY_TIME_CONSTANTS, Mode, ResponseStage};
use crate::stage::Memory;

/// What it is called in files.
pub const ID: &str = "stand_resonance";

/// One structural mode between thrust and sensor.
pub static KIND: Kind = Kind {
    id: ID,
    title: "resonance of the stand",
    site: Site::Stand,
    equation: "1 - participation s (s + 2 damping w) / (s^2 + 2 damping w s + w^2), w = 2 pi frequency_hz: 1 is a sensor that \
               carries the whole mode; above 1 there is a zero in the right half plane",
    parameters: &[
        Parameter::fitted("participation", "", "the part of the force that the mode passes on")
            .possible(-5.0, 5.0)
            .linear(-1.0, 2.0, &[-0.3, 0.3, 1.0]),
        Parameter::fitted("frequency_hz", "Hz", "undamped natural frequency").null(f64::NAN).possible(0.1, 5000.0).log(
            8.0,
            120.0,
            &[10.0, 14.0, 20.0, 28.0, 40.0, 56.0, 80.0],
        ),
        Parameter::fitted("damping", "", "damping ratio").null(f64::NAN).possible(1e-4, 0.99).log(0.01, 0.2, &[0.03]),
    ],
    signature: "A narrow peak, with a dip beside it, at a frequency that no command moves. Absent in the speed. Steps ring.",
    confusions: &[
        Confusion {
            with: super::second_pole::ID,
            recipe: &Recipe::HIGH_FREQUENCIES,
            experiment: "Excite across the suspected frequency in steps of a tenth of its width: a pole has no peak.",
        },
        Confusion {
            with: super::inflow_lead::ID,
            recipe: &Recipe::HIGH_FREQUENCIES,
            experiment: "A hammer on the stand with the motor off shows the mode, and not the air.",
        },
    ],
    remedy: "it is the stand's, not the motor's: stiffen the stand until the mode lies above the band, or divide it out (`rotorlead identify \
             --stand-model`), and record again; never compensate it",
    sources: &[
        "Ewins, Modal Testing, 2nd ed., ch. 2: one mode of a structure with its residue",
        "thrust stands ring at 12 to 85 Hz with damping of 0.02 to 0.1",
    ],
    linearity: Linearity::Exact,
    shows: Shows::InForce,
    search: Search::Peak,
    check: Kind::any,
    part: |values, _| match values[0] {
        0.0 => Part::Nothing,
        participation => Part::response(Resonance::new(participation, TAU * values[1], values[2])),
    },
    response: |values, _, omega_rad_s| {
        let [participation, frequency_hz, damping] = [values[0], values[1], values[2]];
        if participation == 0.0 {
            return Complex64::ONE;
        }
        let (w, s) = (TAU * frequency_hz, Complex64::new(0.0, omega_rad_s));
        let swing = s * (s + 2.0 * damping * w);
        1.0 - participation * swing / (swing + w * w)
    },
};

/// `(1 - g) u + g w^2 / w_d Im x`, with `x` the mode at the pole `-damping w + j w_d`.
struct Resonance {
    direct: f64,
    /// Participation times `w^2 / w_d`.
    swing: f64,
    pole: Complex64,
    mode: Mode<Complex64>,
}

impl Resonance {
    fn new(participation: f64, w: f64, damping: f64) -> Self {
        let damped = w * (1.0 - damping * damping).sqrt();
        let pole = Complex64::new(-damping * w, damped);
        Self { direct: 1.0 - participation, swing: participation * w * w / damped, pole, mode: Mode::new(pole) }
    }

    fn output(&self, input: f64, slope: f64) -> (f64, f64) {
        let x = self.mode.state();
        (self.direct * input + self.swing * x.im, self.direct * slope + self.swing * (self.pole * x).im)
    }
}

impl ResponseStage for Resonance {
    fn settle(&mut self, level: f64) -> f64 {
        self.mode.settle(level);
        level
    }

    fn advance(&mut self, signal: &mut Interval) {
        let (start, start_slope) = self.output(signal.start, signal.start_slope);
        self.mode.advance(signal);
        (signal.end, signal.end_slope) = self.output(signal.end, signal.end_slope);
        (signal.start, signal.start_slope) = (start, start_slope);
    }

    fn memory(&self) -> Memory {
        Memory::Seconds(MEMORY_TIME_CONSTANTS / -self.pole.re)
    }

    fn time_scale_s(&self) -> f64 {
        1.0 / self.pole.norm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{active, point, step};

    #[test]
    fn the_peak_is_at_its_frequency_with_its_height() {
        let values = [1.0, 30.0, 0.05];
        let at = |omega: f64| (KIND.response)(&values, &point(), omega).norm();
        // The classical peak of a second-order system: at w sqrt(1 - 2 z^2), 1 / (2 z sqrt(1 - z^2)) high.
        let peak = TAU * 30.0 * (1.0 - 2.0 * 0.05_f64.powi(2)).sqrt();
        assert!((at(peak) - 1.0 / (0.1 * (1.0 - 0.05_f64.powi(2)).sqrt())).abs() < 1e-9);
        assert!(at(peak) > at(peak * 1.001) && at(peak) > at(peak * 0.999));
    }

    #[test]
    fn a_lagged_step_rings_as_the_partial_fractions_say() {
        let (g, w, z, t1) = (1.4, TAU * 24.0, 0.04, 0.1);
        let pole = Complex64::new(-z * w, w * (1.0_f64 - z * z).sqrt());
        // Residues of H(s) / (s (1 + t1 s)).
        let h = |s: Complex64| 1.0 - g * s * (s + 2.0 * z * w) / (s * s + 2.0 * z * w * s + w * w);
        let numerator = g * pole * (pole + 2.0 * z * w);
        let ring = -numerator / (pole - pole.conj()) / (pole * (1.0 + t1 * pole));
        for (row, y) in step(0.1, 0.4, &[active(&KIND, &[g, 24.0, z])]).iter().enumerate() {
            let t = row as f64 * 1e-3;
            let slow = h(Complex64::from(-1.0 / t1)).re;
            let exact = 1.0 - slow * (-t / t1).exp() + 2.0 * (ring * (pole * t).exp()).re;
            assert!((y - exact).abs() < 1e-8, "row {row}: {y} for {exact}");
        }
    }
}
