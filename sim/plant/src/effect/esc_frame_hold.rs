//! The ESC takes over a command once per frame.

use num_complex::Complex64;

use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site};
use crate::esc_frame::EscFrame;
use crate::hold::zero_order_hold;

/// What it is called in files.
pub const ID: &str = "esc_frame_hold";

/// A zero-order hold, before any frames that the experiment itself states.
pub static KIND: Kind = Kind {
    id: ID,
    title: "hold of the ESC's frame",
    site: Site::Command,
    equation: "v(t) = u(t_n) for t_n <= t < t_(n+1), t_n = (n + phase) / frame_hz; on average (1 - e^(-s F)) / (s F), F = 1 / frame_hz",
    parameters: &[
        Parameter::fitted("frame_hz", "Hz", "how often a command is taken over")
            .null(f64::INFINITY)
            .possible(0.5, 1e6)
            .log(20.0, 2000.0, &[50.0, 100.0, 200.0, 400.0]),
        Parameter::fitted("phase", "", "the part of a frame from the first command to the first frame")
            .possible(0.0, 1.0)
            .linear(0.0, 1.0, &[0.0])
            .optional(0.0),
    ],
    signature: "Half a frame of delay, a droop of sin(x)/x with x = pi f / frame_hz, and images of every line at multiples of \
                the frame rate plus and minus it.",
    confusions: &[Confusion {
        with: super::transport_delay::ID,
        recipe: &Recipe::OTHER_FRAMES,
        experiment: "Change the frame rate of the ESC's protocol, or excite near half the suspected frame rate and look for \
                     the image at frame_hz - f: a delay has none.",
    }],
    remedy: "send the command with a protocol of more frames a second (OneShot125, DShot), and record again",
    sources: &[
        "Franklin, Powell & Workman, Digital Control of Dynamic Systems, sec. 5.3: the hold and its images",
        "Charla, Yao & Voyles: 600 Hz; analog PWM at 50 to 490 Hz",
    ],
    linearity: Linearity::Mean,
    shows: Shows::BetweenLevels,
    search: Search::Frames,
    check: Kind::any,
    part: |values, _| match EscFrame::new(values[0], values[1].rem_euclid(1.0)) {
        Ok(frame) => Part::command(frame),
        // Frames without end: it takes over every command at once.
        Err(_) => Part::Nothing,
    },
    // The mean over frames that have no fixed phase to the commands: a response that is smooth in the frame rate. What a fixed
    // ratio does is in `hold_response_at_phase`.
    response: |values, _, omega_rad_s| {
        if values[0].is_finite() { zero_order_hold(1.0 / values[0], omega_rad_s) } else { Complex64::ONE }
    },
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{active, after_command_stages, seen_response};

    #[test]
    fn the_mean_response_is_that_of_the_hold() {
        for (frame_hz, omega) in [(61.803_398_87, 20.0), (161.803_398_87, 90.0), (40.451, 60.0)] {
            let values = [frame_hz, 0.3];
            // Ticks of 50 us: their own hold is divided out.
            let seen = seen_response(&[active(&KIND, &values)], omega);
            let expected = (KIND.response)(&values, &crate::testing::point(), omega);
            assert!((seen - expected).norm() < 3e-3, "{frame_hz}: {seen} for {expected}");
        }
    }

    #[test]
    fn a_row_sees_the_command_of_its_frame() {
        // Rows of 1 ms, frames of 5 ms that begin 2 ms after the first.
        let command: Vec<f64> = (0..50).map(|k| 0.5 + f64::from(k) * 1e-3).collect();
        let out = after_command_stages(&[active(&KIND, &[200.0, 0.4])], &command);
        for (k, level) in out.iter().enumerate() {
            let taken = if k < 2 { 0 } else { (k - 2) / 5 * 5 + 2 };
            assert_eq!(*level, command[taken], "row {k}");
        }
    }
}
