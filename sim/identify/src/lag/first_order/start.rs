//! Where the search for a lag starts.
//!
//! At the best point of a grid over time constant and dead time, each with the gain that is best there. A linear problem for
//! gain and time constant (Levy) would be cheaper, but multiplies the model by its denominator: as noisy as the response is
//! below 10 dB its time constant comes out far too short, and the search then ends beside the wrong dead time.

use num_complex::Complex64;
use rotorlead_plant::Lag;

use super::FitLine;
use crate::error::IdentifyError;

/// Distance of two time constants of the grid, a factor. Chosen: the nearest is off by a factor of 1.26, `sqrt(1.6)`, at most, within the
/// basin of the search; lines from 0.1 to 30 Hz take 22 of them.
const TIME_CONSTANT_STEP: f64 = 1.6;
/// Most dead times of the grid. Chosen: it bounds the time of the start; eight to a period of the highest line reach 1 s up to 125 Hz.
const MOST_DELAYS: usize = 1000;

/// A line as the grid sees it.
struct Seen {
    omega_rad_s: f64,
    weight: f64,
    /// Response over command, freed of what is known in front of the actuator at the line itself, images left aside; turned on
    /// by the dead time at hand.
    response: Complex64,
    /// One step of the dead time.
    turn: Complex64,
}

/// Starting values with a dead time from zero to `max_delay_s`.
pub(super) fn start(lines: &[FitLine], max_delay_s: f64) -> Result<Lag, IdentifyError> {
    let top = lines.iter().map(|line| line.omega_rad_s).fold(0.0, f64::max);
    let lowest = lines.iter().map(|line| line.omega_rad_s).fold(top, f64::min);
    // Chosen: an eighth of the highest line's period, as the cost has one minimum per half period.
    let delay_step_s = std::f64::consts::TAU / top / 8.0;
    let delays = ((max_delay_s / delay_step_s).ceil() as usize).min(MOST_DELAYS);
    let mut seen: Vec<Seen> = lines
        .iter()
        .map(|line| {
            let known = line.images.first().map_or(Complex64::ONE, |image| image.weight);
            Seen {
                omega_rad_s: line.omega_rad_s,
                weight: known.norm_sqr() / line.variance,
                response: line.response / known,
                turn: Complex64::cis(line.omega_rad_s * delay_step_s),
            }
        })
        .filter(|seen| seen.response.is_finite())
        .collect();
    // Chosen: poles from ten times above the highest line, where the lines show a flat response, to ten times below the lowest, where they
    // show only the ratio of gain and time constant.
    let time_constants: Vec<f64> = std::iter::successors(Some(0.1 / top), |tau| Some(tau * TIME_CONSTANT_STEP))
        .take_while(|tau| tau * lowest < 10.0)
        .collect();
    let mut best: Option<(f64, Lag)> = None;
    for step in 0..=delays {
        for &time_constant_s in &time_constants {
            let (mut product, mut power) = (0.0, 0.0);
            for line in &seen {
                let x = line.omega_rad_s * time_constant_s;
                let size = line.weight / (1.0 + x * x);
                // Re(conj(1 / (1 + j x)) G)
                product += size * (line.response.re - x * line.response.im);
                power += size;
            }
            // By how much the gain `product / power` lowers the cost.
            let gained = product * product / power;
            if best.as_ref().is_none_or(|(most, _)| gained > *most) && gained > 0.0 {
                let lag = Lag { gain: product / power, time_constant_s, delay_s: delay_step_s * step as f64 };
                best = Some((gained, lag));
            }
        }
        for line in &mut seen {
            line.response *= line.turn;
        }
    }
    best.map(|(_, lag)| lag).ok_or(IdentifyError::NoFit { reason: "the response is zero" })
}
