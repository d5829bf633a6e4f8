//! Right structure, wrong numbers.

use num_complex::Complex64;

use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site};

/// What it is called in files.
pub const ID: &str = "parameter_error";

/// A first-order lag whose gain or time constant is not the model's.
pub static KIND: Kind = Kind {
    id: ID,
    title: "wrong gain or time constant",
    site: Site::Base,
    equation: "G(s) = K (1 + gain_error) / (tau (1 + time_constant_error) s + 1)",
    parameters: &[
        Parameter::fitted("gain_error", "", "the part by which the gain is larger than the model's")
            .possible(-0.95, 20.0)
            .linear(-0.3, 0.3, &[0.0]),
        Parameter::fitted("time_constant_error", "", "the part by which the time constant is larger than the model's")
            .possible(-0.95, 20.0)
            .linear(-0.5, 0.8, &[0.0]),
    ],
    signature: "Measured over simulated is (1 + a s) / (1 + b s) times a number, the same shape at every nominal command and \
                amplitude, without harmonics.",
    confusions: &[
        Confusion {
            with: super::second_pole::ID,
            recipe: &Recipe::HIGH_FREQUENCIES,
            experiment: "Excite up to ten times the pole: one lag ends at 90 degrees, two go on to 180.",
        },
        Confusion {
            with: super::supply_sag::ID,
            recipe: &Recipe::LONG_LOADS,
            experiment: "Excite down to a hundredth of the pole, or log the voltage: a wrong gain stays the same down to \
                         standstill.",
        },
    ],
    remedy: "the numbers of the model are wrong, not the motor: take the improved model (`--out-model`) in place of the given one, and design \
             again",
    sources: &["Charla, Yao & Voyles, eq. (1): the model itself"],
    linearity: Linearity::Exact,
    shows: Shows::Anywhere,
    search: Search::Values,
    check: Kind::any,
    part: |values, _| match *values {
        [0.0, 0.0] => Part::Nothing,
        _ => Part::Base { gain: 1.0 + values[0], time_constant: 1.0 + values[1] },
    },
    response: |values, point, omega_rad_s| {
        let x = omega_rad_s * point.lag.time_constant_s;
        (1.0 + values[0]) * Complex64::new(1.0, x) / Complex64::new(1.0, x * (1.0 + values[1]))
    },
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{active, point, step};

    #[test]
    fn it_is_the_lag_with_other_numbers() {
        let wrong = active(&KIND, &[0.25, -0.4]);
        for (row, &y) in step(0.1, 0.3, &[wrong]).iter().enumerate() {
            let exact = 0.1 * 10.0 * 1.25 * (1.0 - (-(row as f64) * 1e-3 / 0.06).exp());
            assert!((y - exact).abs() < 1e-12);
        }
        let other = Complex64::new(12.5, 0.0) / Complex64::new(1.0, 30.0 * 0.06);
        let response = (KIND.response)(&[0.25, -0.4], &point(), 30.0) * point().lag.frequency_response(30.0);
        assert!((response - other).norm() < 1e-14);
    }
}
