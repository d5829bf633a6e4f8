//! The holds between the recorded command and the actuator's continuous input.
//!
//! A loop at `f_c` writes the command `c(n / f_c)` and leaves it standing until its next tick: a
//! staircase. The ESC looks at the staircase at the start of each of its frames, `t_m = m / f_e`,
//! and holds what it saw until the next one:
//!
//! ```text
//! e(t) = c(t_m - d_m)   for t_m <= t < t_(m+1),   d_m = t_m - floor(t_m f_c) / f_c
//! ```
//!
//! With `f_c / f_e = p / q` in lowest terms the lag `d_m` takes the values `0, 1/q .. (q-1)/q` of a
//! loop tick in turn, so `e` answers `c(t) = e^(j w t)` with lines at `w + 2 pi l f_e / q`. The one
//! at `w` itself has exactly
//!
//! ```text
//! H(w) = [(1/q) sum_i e^(-j w i / (q f_c))] * sinc(w / (2 f_e)) e^(-j w / (2 f_e))
//! ```
//!
//! a mean lag of `(q - 1) / (2 q f_c)` and a zero-order hold of one frame. This is the linear,
//! time-invariant part ([`HoldChain::response`], which is [`hold_response`]). Where loop and frame have no common period the
//! lag is spread evenly over a tick and the bracket becomes a zero-order hold of one tick.
//!
//! The other lines are images. Rows at `f_r` see an image at `w + 2 pi n f_r` *on* the line `w`,
//! so the response that the rows show is not `H(w) G(w)` but `sum_n H_n(w) G(w + 2 pi n f_r)`
//! ([`HoldChain::images`]). With 1 kHz rows that follow a 5 kHz loop through 600 Hz frames the
//! images are below 5e-4 of the response up to 30 Hz; with the hold at the row rate itself they are
//! `(w / f_r)^2 / 12`, 0.3 % at 30 Hz and 1 kHz, the well-known difference between `H G` and the
//! step-invariant transform. The fits therefore use the images, and are within 5e-5 of running the
//! chain in the first case and 2e-4 in the second.
//!
//! Frame, loop and rows are taken to start together. The phase between frame and loop cannot be
//! seen in the rows: any other phase adds less than `1 / (q f_c)` (67 us at 5 kHz and 600 Hz) to
//! the lag. Nor do images matter when the clocks are not locked; they then average out.

use std::f64::consts::TAU;

use num_complex::Complex64;
use rotorlead_plant::{frames_per_pattern, hold_response};

use crate::error::IdentifyError;

/// Images up to this multiple of the row rate are kept on both sides.
///
/// A first-order plant and a hold both fall with frequency, so image `n` falls with `1 / n^2` and
/// what is left out is `(2 / MAX_IMAGE) / (pi^2 / 3)`, 4 %, of the images' sum. Chosen: double halves that for double the time.
const MAX_IMAGE: i64 = 16;

/// Clocks whose pattern repeats after more frames than this count as not locked. Chosen: the lag then takes 256 values within a tick,
/// as good as spread evenly; time goes with their number, and real clocks are not locked so finely.
const MOST_FRAMES: f64 = 256.0;

/// Sample and hold at the loop's rate, then at the ESC's frame rate, seen by rows at a third.
#[derive(Clone, Debug, PartialEq)]
pub struct HoldChain {
    row_rate_hz: f64,
    command_rate_hz: f64,
    esc_frame_hz: Option<f64>,
    takeover_rate_hz: f64,
    /// `p / q` of command over takeover rate; `None` when the clocks have no common period.
    ratio: Option<(u64, u64)>,
    /// What of the images does not depend on the line.
    shifts: Vec<Shift>,
}

/// One multiple of the row rate by which an image is shifted.
#[derive(Clone, Debug, PartialEq)]
struct Shift {
    /// `2 pi n f_r`.
    omega_rad_s: f64,
    /// `e^(-j pi n f_r / f_e)`: the hold's half-frame delay of this shift.
    half_frame: Complex64,
    /// `e^(-2 pi j n f_r t_m) / q` at each frame start of the lag's cycle.
    frames: Vec<Complex64>,
}

/// One frequency that appears on a line of the rows, and how strongly the holds excite it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HoldImage {
    /// Frequency at the actuator in rad/s; negative below zero.
    pub omega_rad_s: f64,
    /// Complex amplitude at the actuator's input for a command `e^(j w t)`.
    pub weight: Complex64,
}

impl HoldChain {
    /// The chain of an experiment: rows at `row_rate_hz`, the command updated at `command_rate_hz`
    /// (the row rate where `None`), taken over at `esc_frame_hz` (at once where `None`).
    ///
    /// # Errors
    /// [`IdentifyError::Rate`] when a rate is not positive and finite.
    pub fn new(
        row_rate_hz: f64,
        command_rate_hz: Option<f64>,
        esc_frame_hz: Option<f64>,
    ) -> Result<Self, IdentifyError> {
        let positive = |name: &'static str, value: f64| {
            if value.is_finite() && value > 0.0 { Ok(value) } else { Err(IdentifyError::Rate { name, value }) }
        };
        let row_rate_hz = positive("sample_rate_hz", row_rate_hz)?;
        let command_rate_hz = positive("command_rate_hz", command_rate_hz.unwrap_or(row_rate_hz))?;
        let takeover_rate_hz = positive("esc_frame_hz", esc_frame_hz.unwrap_or(command_rate_hz))?;
        let ratio = fraction(command_rate_hz / takeover_rate_hz);
        let shifts = ratio.map_or_else(Vec::new, |(_, q)| shifts(row_rate_hz, takeover_rate_hz, q));
        Ok(Self { row_rate_hz, command_rate_hz, esc_frame_hz, takeover_rate_hz, ratio, shifts })
    }

    /// Rate at which the response is sampled, hertz.
    #[must_use]
    pub fn row_rate_hz(&self) -> f64 {
        self.row_rate_hz
    }

    /// Rate at which the ESC takes over the command, hertz, where there are frames.
    #[must_use]
    pub fn esc_frame_hz(&self) -> Option<f64> {
        self.esc_frame_hz
    }

    /// The time-invariant part `H(w)`, from command samples to the actuator's continuous input.
    #[must_use]
    pub fn response(&self, omega_rad_s: f64) -> Complex64 {
        hold_response(self.command_rate_hz, self.esc_frame_hz, omega_rad_s)
    }

    /// All that the rows see on the line `w`: the line itself first, then its images.
    ///
    /// The response of a plant `G` at the rows is the sum of `weight * G(omega)`.
    #[must_use]
    pub fn images(&self, omega_rad_s: f64) -> Vec<HoldImage> {
        let mut images = vec![HoldImage { omega_rad_s, weight: self.response(omega_rad_s) }];
        let Some((p, q)) = self.ratio else {
            return images;
        };
        let lag_step = omega_rad_s / (q as f64 * self.command_rate_hz);
        let lags: Vec<_> =
            (0..q).map(|m| Complex64::cis(-lag_step * (m as u128 * p as u128 % q as u128) as f64)).collect();
        let half_frame = Complex64::cis(-0.5 * omega_rad_s / self.takeover_rate_hz);
        for shift in &self.shifts {
            let modulation: Complex64 = lags.iter().zip(&shift.frames).map(|(l, f)| l * f).sum();
            let omega = omega_rad_s + shift.omega_rad_s;
            let delay = half_frame * shift.half_frame;
            // The hold is sin(x) / x e^(-j x) with x = omega / (2 f_e), and e^(-j x) is `delay`.
            let hold = delay * (-delay.im * 2.0 * self.takeover_rate_hz / omega);
            let weight = modulation * hold;
            // Chosen: smaller ones are the rounding of images that cancel.
            if weight.norm() > 1e-9 {
                images.push(HoldImage { omega_rad_s: omega, weight });
            }
        }
        images
    }
}

/// The fraction `p / q` in lowest terms that a ratio of two rates is; `None` when the clocks count as not locked.
fn fraction(ratio: f64) -> Option<(u64, u64)> {
    let q = frames_per_pattern(ratio);
    (q <= MOST_FRAMES).then(|| ((ratio * q).round() as u64, q as u64))
}

/// The multiples of the row rate at which the frames' pattern, of `q` frames, has lines.
fn shifts(row_rate_hz: f64, takeover_rate_hz: f64, q: u64) -> Vec<Shift> {
    // Its lines lie f_e / q apart, of which every `stride`-th multiple of the row rate is one.
    let Some((stride, _)) = fraction(takeover_rate_hz / q as f64 / row_rate_hz) else {
        return Vec::new();
    };
    let stride = i64::try_from(stride).unwrap_or(i64::MAX).max(1);
    let rows_per_frame = row_rate_hz / takeover_rate_hz;
    (1..=MAX_IMAGE / stride)
        .flat_map(|i| [i * stride, -i * stride])
        .map(|n| Shift {
            omega_rad_s: TAU * row_rate_hz * n as f64,
            half_frame: Complex64::cis(-0.5 * TAU * rows_per_frame * n as f64),
            frames: (0..q).map(|m| Complex64::cis(-TAU * rows_per_frame * n as f64 * m as f64) / q as f64).collect(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// Response of `1 / (tau s + 1)` at the rows to `cos(w t)`, by running it: ticks of 1/15000 s
    /// hold every event of 1 kHz rows, a 5 kHz loop and 600 Hz frames.
    fn brute_force(line_hz: f64, tau_s: f64, row_ticks: usize, loop_ticks: usize, frame_ticks: usize) -> Complex64 {
        const TICK_HZ: f64 = 15_000.0;
        let period = 150_000; // 10 s, a multiple of all ticks and of the line's period
        let decay = (-1.0 / (TICK_HZ * tau_s)).exp();
        let (mut state, mut staircase, mut input) = (0.0, 0.0, 0.0);
        let mut sum = Complex64::ZERO;
        for tick in 0..2 * period {
            if tick >= period && tick % row_ticks == 0 {
                let phase = TAU * line_hz * tick as f64 / TICK_HZ;
                sum += Complex64::cis(-phase) * state;
            }
            if tick % loop_ticks == 0 {
                staircase = (TAU * line_hz * tick as f64 / TICK_HZ).cos();
            }
            if tick % frame_ticks == 0 {
                input = staircase;
            }
            state = input + (state - input) * decay;
        }
        sum * 2.0 / (period / row_ticks) as f64
    }

    fn at_rows(chain: &HoldChain, omega: f64, tau_s: f64) -> Complex64 {
        let plant = |w: f64| 1.0 / Complex64::new(1.0, w * tau_s);
        chain.images(omega).iter().map(|i| i.weight * plant(i.omega_rad_s)).sum()
    }

    #[test]
    fn the_chain_agrees_with_running_it() {
        // rows, loop, frame in ticks of 1/15000 s; worst error with images, and without
        let cases = [
            (15, Some(3), Some(25), 5e-5, 5e-4),
            (3, Some(3), Some(25), 2e-6, 2e-5),
            (15, Some(3), None, 3e-5, 2e-4),
            (15, None, None, 2e-4, 3e-3),
            (15, None, Some(25), 5e-5, 6e-4),
        ];
        for (rows, command, frame, exact, time_invariant) in cases {
            let rate = |ticks: usize| 15_000.0 / ticks as f64;
            let chain = HoldChain::new(rate(rows), command.map(rate), frame.map(rate)).unwrap();
            let (mut worst, mut worst_linear) = (0.0f64, 0.0f64);
            for line_hz in [0.1, 5.1, 14.9, 29.9] {
                for tau_s in [0.1593, 0.0708] {
                    let omega = TAU * line_hz;
                    let loop_ticks = command.unwrap_or(rows);
                    let truth = brute_force(line_hz, tau_s, rows, loop_ticks, frame.unwrap_or(loop_ticks));
                    let linear = chain.response(omega) / Complex64::new(1.0, omega * tau_s);
                    worst = worst.max((at_rows(&chain, omega, tau_s) / truth - 1.0).norm());
                    worst_linear = worst_linear.max((linear / truth - 1.0).norm());
                }
            }
            println!("{rows} {command:?} {frame:?}: {worst:.1e}, without images {worst_linear:.1e}");
            assert!(worst < exact, "{rows} {command:?} {frame:?}: {worst:e}");
            assert!(worst_linear < time_invariant, "{rows} {command:?} {frame:?}: {worst_linear:e}");
        }
    }

    #[test]
    fn at_low_frequency_the_chain_is_half_a_frame_and_the_mean_of_the_three_lags_of_5_khz_under_600_hz() {
        let chain = HoldChain::new(1000.0, Some(5000.0), Some(600.0)).unwrap();
        let omega = 1e-3;
        let lag = -chain.response(omega).arg() / omega;
        assert!((lag - 1.0 / 15_000.0 - 1.0 / 1200.0).abs() < 1e-12);
    }

    #[test]
    fn clocks_without_a_common_period_lag_half_a_tick_and_leave_no_image() {
        let chain = HoldChain::new(1000.0, Some(5000.0), Some(600.0 * PI / 3.0)).unwrap();
        let lag = -chain.response(1e-3).arg() / 1e-3;
        assert!((lag - 1e-4 - 0.5 / (200.0 * PI)).abs() < 1e-10);
        assert_eq!(chain.images(10.0).len(), 1);
    }

    #[test]
    fn rates_of_zero_or_nan_are_refused() {
        assert!(HoldChain::new(0.0, None, None).is_err());
        assert!(HoldChain::new(1000.0, Some(f64::NAN), None).is_err());
        assert!(HoldChain::new(1000.0, None, Some(-600.0)).is_err());
    }
}
