//! Small changes of the command are ignored.

use super::{Confusion, Kind, Linearity, Parameter, Part, Search, Shows, Site};
use crate::stage::{Levels, Memory};

/// Keeps the last command until the new one differs from it by the width.
pub static KIND: Kind = Kind {
    id: "dead_band",
    title: "dead band of command changes",
    site: Site::Command,
    equation: "v_k = u_k where |u_k - v_(k-1)| >= width, else v_(k-1)",
    parameters: &[Parameter::fitted("width", "duty", "the smallest change of the command that is taken over")
        .possible(0.0, 0.5)
        .log(0.0005, 0.04, &[0.001, 0.003, 0.01])
        // The command of a period of slow sinusoids travels some ten widths: in 1 % steps they add up to a tenth of one.
        .jumping(440)],
    signature: "Small amplitudes lose gain, and below the width there is no response at all. Stairs on a slow ramp, that begin \
                where the command turned; half a width of lag on average, independent of speed.",
    confusions: &[
        Confusion {
            with: "command_quantization",
            experiment: "A slow triangle with another turning point each time: the stairs of a dead band move with it.",
        },
        Confusion {
            with: "backlash",
            experiment: "A slow triangle: play follows smoothly once it is taken up, a dead band jumps by its width.",
        },
    ],
    sources: &[
        "Gelb & Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968, sec. 2.3",
        "input filters of ESCs ignore jitter of some microseconds of pulse width: 0.002 to 0.01",
    ],
    linearity: Linearity::Absent,
    shows: Shows::BetweenLevels,
    search: Search::Values,
    check: Kind::any,
    part: |values, _| match values[0] {
        0.0 => Part::Nothing,
        width => Part::command(Levels::new(
            // Each stair begins where the last one ended.
            Memory::Lasting, 
            move |held: f64, input: f64| if (input - held).abs() >= width { input } else { held },
        )),
    },
    response: Kind::unity,
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{active, after_command_stages, fundamental};

    #[test]
    fn what_is_below_the_width_does_not_come_out_and_a_ramp_comes_as_stairs() {
        assert!(fundamental(&[active(&KIND, &[0.02])], 0.019).norm() < 1e-12);
        let ramp: Vec<f64> = (0..100).map(|k| 0.25 + f64::from(k) / 1024.0).collect();
        let out = after_command_stages(&[active(&KIND, &[5.0 / 1024.0])], &ramp);
        for (k, level) in out.iter().enumerate() {
            assert_eq!(*level, 0.25 + (k / 5 * 5) as f64 / 1024.0);
        }
    }

    #[test]
    fn a_sine_of_many_widths_lags_by_half_a_width() {
        // Half a width behind in the direction of motion: a hysteresis of half-width w/2 with the gain of the stairs.
        let (a, w) = (0.2, 0.004);
        let lag = fundamental(&[active(&KIND, &[w])], a).im;
        let play = -4.0 * (w / 2.0) / (std::f64::consts::PI * a) * (1.0 - w / 2.0 / a);
        assert!((lag / play - 1.0).abs() < 0.02, "{lag} for {play}");
    }
}
