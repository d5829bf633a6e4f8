//! Up to which frequency a stand passes a force as it is.

use std::f64::consts::TAU;

use crate::estimate::Estimate;
use crate::stand::transfer_function::ParametricFit;

/// The deviation from the static value that ends the usable range: 3 dB to either side. Standard: half or twice the power ends a band.
pub(super) const DEVIATION_DB: f64 = 3.0;

/// Points of the search up to the highest line. Chosen: at a top of 300 Hz they are 0.08 Hz apart, and a mode at 60 Hz with a damping of
/// 0.001 is 0.12 Hz wide.
const POINTS: usize = 4000;

/// The lowest frequency in hertz at which the response is 3 dB above or below its static value, with the standard error
/// that follows from the model's; `None` where this is nowhere between zero and `top_rad_s`.
pub(super) fn usable_hz(fit: &ParametricFit, top_rad_s: f64) -> Option<Estimate> {
    let limit = DEVIATION_DB * std::f64::consts::LN_10 / 20.0;
    let of_logarithm = |omega: f64| (fit.response(omega) / fit.gain.value).norm().ln();
    let is_off = |omega: f64| of_logarithm(omega).abs() > limit;
    let step = top_rad_s / POINTS as f64;
    let index = (1..=POINTS).find(|i| is_off(step * *i as f64))?;
    let (mut low, mut high) = (step * (index - 1) as f64, step * index as f64);
    // Sixty halvings take a bracket to a double's last bit, of 53.
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        *(if is_off(middle) { &mut high } else { &mut low }) = middle;
    }
    // Derived: near the cube root of the rounding unit, 6e-6, rounding and the cubic term of a central difference balance.
    let h = 1e-5 * high;
    let slope = (of_logarithm(high + h) - of_logarithm(high - h)) / (2.0 * h);
    Some(Estimate { value: high / TAU, std: fit.attenuation_std(high) / slope.abs() / TAU, dof: fit.gain.dof })
}
