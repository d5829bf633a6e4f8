//! What the holds between control loop and rotor do to a sinusoid.

use nalgebra::Complex;

use super::esc_frame::SAME_MOMENT_FRAMES;

/// Mean response of "held by the control loop, then taken over by the ESC once per frame" at `omega_rad_s`.
///
/// `command_rate_hz` is the rate of the control loop and `esc_frame_hz` that of the ESC's frames (both above 0; `None`
/// when the ESC takes over a command at once). It is the ratio of the component at `omega` in the continuous signal
/// that drives the rotor to the sinusoid that the control loop samples. Frame 0 starts on a tick.
///
/// # Derivation
/// The command is `u_k = e^(j omega k T)`, held for a tick `T = 1 / command_rate`. Frame `n` starts at
/// `t_n = n F`, `F = 1 / esc_frame`, takes over `u_k` of the last tick before it, `k = floor(t_n / T)`, and holds
/// it for `F`. Over one frame the Fourier integral of that against `e^(-j omega t)` gives
///
/// ```text
/// e^(-j omega a_n) (1 - e^(-j omega F)) / (j omega F),     a_n = t_n - T floor(t_n / T)
/// ```
///
/// a zero-order hold of a frame, and the age `a_n` of the command when the frame takes it over. The mean over all
/// frames is what an empirical transfer function estimate sees; what differs from frame to frame goes to other
/// frequencies. With `command_rate / esc_frame = p / q` in lowest terms the ages take the values `i T / q`,
/// `i = 0..q`, equally often, so
///
/// ```text
/// mean e^(-j omega a_n) = e^(-j omega T (q - 1) / (2 q)) sin(omega T / 2) / (q sin(omega T / (2 q)))
/// ```
///
/// For 5 kHz and 600 Hz, `p / q = 25 / 3`. For incommensurate rates `q` is without bound and the mean becomes that of
/// a zero-order hold of a tick. For a frame rate that is a multiple of the command rate the product is exactly the
/// hold of a tick.
///
/// # What it leaves out
/// The differing ages make images at `esc_frame / q` and its multiples from every line (200 Hz, 400 Hz, ... for 5 kHz
/// and 600 Hz). Rows sampled at a rate of which some of these are multiples see them folded onto the line itself,
/// after the rotor has attenuated them: for the paper's bench at 1 kHz rows 4e-4 of the response at 29.9 Hz.
#[must_use]
pub fn hold_response(command_rate_hz: f64, esc_frame_hz: Option<f64>, omega_rad_s: f64) -> Complex<f64> {
    hold_response_at_phase(command_rate_hz, esc_frame_hz, 0.0, omega_rad_s)
}

/// [`hold_response`] with frame 0 starting `frame_phase` (0..1) of a frame after a tick.
///
/// The ages then are `i T / q` plus the same remainder of `frame_phase F` modulo `T / q` for all: one more delay, of
/// less than `T / q`.
#[must_use]
pub fn hold_response_at_phase(
    command_rate_hz: f64,
    esc_frame_hz: Option<f64>,
    frame_phase: f64,
    omega_rad_s: f64,
) -> Complex<f64> {
    let tick_s = 1.0 / command_rate_hz;
    let Some(esc_frame_hz) = esc_frame_hz else {
        return zero_order_hold(tick_s, omega_rad_s);
    };
    let ticks_per_frame = command_rate_hz / esc_frame_hz;
    let q = frames_per_pattern(ticks_per_frame);
    let half = 0.5 * omega_rad_s * tick_s;
    let mean = if half == 0.0 { 1.0 } else { half.sin() / (q * (half / q).sin()) };
    // Frames that meet ticks do so within SAME_MOMENT_FRAMES, as in the simulated ESC.
    let same_moment = SAME_MOMENT_FRAMES * ticks_per_frame;
    let remainder = ((frame_phase * ticks_per_frame + same_moment).rem_euclid(1.0 / q) - same_moment).max(0.0);
    let remainder_s = remainder * tick_s;
    let delay_s = 0.5 * tick_s * (q - 1.0) / q + remainder_s;
    zero_order_hold(1.0 / esc_frame_hz, omega_rad_s) * Complex::from_polar(mean, -omega_rad_s * delay_s)
}

/// Mean delay of [`hold_response`], seconds: below the first zero of its magnitude, at the rate of the frames, its phase is
/// `-omega` times this.
#[must_use]
pub fn hold_delay_s(command_rate_hz: f64, esc_frame_hz: Option<f64>) -> f64 {
    let tick_s = 1.0 / command_rate_hz;
    let Some(esc_frame_hz) = esc_frame_hz else { return 0.5 * tick_s };
    let q = frames_per_pattern(command_rate_hz / esc_frame_hz);
    0.5 / esc_frame_hz + 0.5 * tick_s * (q - 1.0) / q
}

/// `(1 - e^(-j omega d)) / (j omega d)`: the hold of a sample for `duration_s`.
pub(super) fn zero_order_hold(duration_s: f64, omega_rad_s: f64) -> Complex<f64> {
    let half = 0.5 * omega_rad_s * duration_s;
    let sinc = if half == 0.0 { 1.0 } else { half.sin() / half };
    Complex::from_polar(sinc, -half)
}

/// After how many frames the pattern of frames and ticks repeats: the `q` of the fraction `p / q` in lowest terms that
/// `ticks_per_frame` (above 0) is the nearest number to, by its continued fraction. A ratio that is no fraction of
/// small numbers ends at a `q` of millions, which serves as well as infinity. A pattern that comes back to within
/// [`SAME_MOMENT_FRAMES`] is one: a rate that is written with ten digits means the fraction.
pub fn frames_per_pattern(ticks_per_frame: f64) -> f64 {
    let (mut before, mut q) = (0.0, 1.0);
    let mut rest = ticks_per_frame;
    // Derived: denominators at least double every two terms, so q^2 passes 1 / epsilon within 52. Chosen: beyond 1e7 frames, hours, no
    // record sees the pattern repeat.
    for _ in 0..52 {
        let p = (ticks_per_frame * q).round();
        if (ticks_per_frame * q - p).abs() <= SAME_MOMENT_FRAMES * ticks_per_frame || q > 1e7 {
            break;
        }
        rest = 1.0 / (rest - rest.floor());
        (before, q) = (q, rest.floor() * q + before);
    }
    q
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// The Fourier integral, frame by frame in whole numbers: `q` frames of `p` ticks of `1 / q` parts each.
    fn brute_force(command_rate_hz: f64, p: u64, q: u64, phase_parts: f64, omega: f64) -> Complex<f64> {
        let (tick_s, frame_s) = (1.0 / command_rate_hz, p as f64 / q as f64 / command_rate_hz);
        let mut sum = Complex::new(0.0, 0.0);
        for n in 0..q {
            let start_s = (n as f64 * p as f64 + phase_parts) / q as f64 * tick_s;
            let taken_s = ((n * p + phase_parts.floor() as u64) / q) as f64 * tick_s;
            // e^(j omega taken) times the integral of e^(-j omega t) over the frame.
            let end = Complex::from_polar(1.0, -omega * (start_s + frame_s));
            let begin = Complex::from_polar(1.0, -omega * start_s);
            sum += Complex::from_polar(1.0, omega * taken_s) * (end - begin) / Complex::new(0.0, -omega * frame_s);
        }
        sum / q as f64
    }

    #[test]
    fn the_closed_form_is_the_fourier_integral() {
        for (command_rate_hz, p, q) in
            [(5000.0, 25, 3), (5000.0, 500, 49), (5000.0, 25, 2), (1000.0, 5, 3), (5000.0, 5, 8)]
        {
            let frame_hz = command_rate_hz * q as f64 / p as f64;
            for f_hz in [0.1, 1.0, 29.9, 44.9, 133.0, 480.0] {
                for phase_parts in [0.0, 0.4, 1.7] {
                    let omega = TAU * f_hz;
                    let ours = hold_response_at_phase(command_rate_hz, Some(frame_hz), phase_parts / p as f64, omega);
                    let theirs = brute_force(command_rate_hz, p, q, phase_parts, omega);
                    assert!((ours - theirs).norm() < 1e-11, "{p}/{q} at {f_hz} Hz: {ours} for {theirs}");
                }
            }
        }
    }

    #[test]
    fn the_phase_is_that_of_the_mean_delay() {
        for esc_frame_hz in [None, Some(400.0), Some(600.0), Some(490.0), Some(5000.0)] {
            for omega in [1.0, TAU * 29.9, TAU * 300.0] {
                let phase = hold_response(5000.0, esc_frame_hz, omega).arg();
                let delay_s = hold_delay_s(5000.0, esc_frame_hz);
                assert!((phase + omega * delay_s).abs() < 1e-9, "{esc_frame_hz:?} at {omega}: {phase}");
            }
        }
    }

    #[test]
    fn frames_at_a_multiple_of_the_ticks_add_nothing() {
        for multiple in [1.0, 2.0, 7.0] {
            for f_hz in [0.0, 0.1, 44.9, 2000.0] {
                let (with, without) = (
                    hold_response(5000.0, Some(5000.0 * multiple), TAU * f_hz),
                    hold_response(5000.0, None, TAU * f_hz),
                );
                assert!((with - without).norm() < 1e-13, "{multiple} at {f_hz} Hz: {with} for {without}");
            }
        }
    }

    #[test]
    fn incommensurate_rates_hold_for_a_tick_and_a_frame() {
        let omega = TAU * 44.9;
        let frame_hz = 600.0 * std::f64::consts::SQRT_2;
        let expected = zero_order_hold(1.0 / 5000.0, omega) * zero_order_hold(1.0 / frame_hz, omega);
        assert!((hold_response(5000.0, Some(frame_hz), omega) - expected).norm() < 1e-8);
    }

    #[test]
    fn fractions_are_recognized() {
        for (ratio, expected) in
            [(25.0 / 3.0, 3.0), (5000.0 / 490.0, 49.0), (12.5, 2.0), (1.0, 1.0), (0.625, 8.0), (50.0, 1.0)]
        {
            assert_eq!(frames_per_pattern(ratio), expected, "{ratio}");
        }
        assert!(frames_per_pattern(std::f64::consts::PI) > 1e6);
    }
}
