//! Where the search for a lag starts.

use num_complex::Complex64;

use super::FitLine;
use crate::identify::IdentifyError;
use crate::plant::Lag;

/// Starting values for a given dead time from a linear problem (Levy): with `G` freed of holds,
/// `K - j w tau G = G`, weighted by the noise; then once more with the first denominator divided out
/// (Sanathanan & Koerner), which takes away most of the bias at high frequency.
pub(super) fn start(lines: &[FitLine], delay_s: f64) -> Result<Lag, IdentifyError> {
    let mut tau = 0.0;
    let mut gain = f64::NAN;
    for _ in 0..3 {
        // Normal equations of the two real unknowns.
        let (mut n11, mut n12, mut n22, mut r1, mut r2) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for line in lines {
            let s = Complex64::new(0.0, line.omega_rad_s);
            let known =
                line.images.first().map_or(Complex64::ONE, |i| i.weight) * Complex64::cis(-line.omega_rad_s * delay_s);
            let weight = known.norm_sqr() / line.variance / (1.0 + s * tau).norm_sqr();
            let response = line.response / known;
            let by_tau = -s * response;
            n11 += weight;
            n12 += weight * by_tau.re;
            n22 += weight * by_tau.norm_sqr();
            r1 += weight * response.re;
            r2 += weight * (by_tau.conj() * response).re;
        }
        let determinant = n11 * n22 - n12 * n12;
        gain = (n22 * r1 - n12 * r2) / determinant;
        tau = (n11 * r2 - n12 * r1) / determinant;
        if tau.is_nan() || tau <= 0.0 {
            break;
        }
    }
    if !(tau > 0.0 && gain.is_finite()) {
        // Too noisy, or no lag: start in the middle of the lines with the gain of the lowest.
        let lowest = &lines[0];
        tau = lines.len() as f64 / lines.iter().map(|l| l.omega_rad_s).sum::<f64>();
        gain = lowest.response.norm() * lowest.response.re.signum();
    }
    if gain == 0.0 || !gain.is_finite() {
        return Err(IdentifyError::NoFit { reason: "the response is zero" });
    }
    Ok(Lag { gain, time_constant_s: tau, delay_s })
}

/// The best start over a grid of dead times, an eighth of the highest line's period apart: the cost
/// has one minimum per half period.
pub(super) fn start_with_delay(lines: &[FitLine], max_delay_s: f64) -> Result<Lag, IdentifyError> {
    let top = lines.iter().map(|line| line.omega_rad_s).fold(0.0, f64::max);
    let step = std::f64::consts::TAU / top / 8.0;
    let count = (max_delay_s / step).ceil().min(1000.0) as usize;
    let cost = |lag: &Lag| {
        lines
            .iter()
            .map(|line| {
                let known = line.images.first().map_or(Complex64::ONE, |i| i.weight);
                let model = known * lag.frequency_response(line.omega_rad_s);
                (line.response - model).norm_sqr() / line.variance
            })
            .sum::<f64>()
    };
    (0..=count)
        .map(|i| start(lines, step * i as f64))
        .filter_map(Result::ok)
        .map(|lag| (cost(&lag), lag))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, lag)| lag)
        .ok_or(IdentifyError::NoFit { reason: "the response is zero" })
}
