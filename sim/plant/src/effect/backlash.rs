//! Play between command and effect.

use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site, two_digits};
use crate::stage::{Levels, Memory};

/// What it is called in files.
pub const ID: &str = "backlash";

/// The output moves only where the command pushes it.
pub static KIND: Kind = Kind {
    id: ID,
    title: "backlash",
    site: Site::Command,
    equation: "p_k = min(max(p_(k-1), u_k - half_width), u_k + half_width), v_k = p_k + compliance (u_k - p_k)",
    parameters: &[
        Parameter::fitted("half_width", "duty", "half the play between the two directions").possible(0.0, 0.5).log(
            0.001,
            0.05,
            &[0.003, 0.01, 0.02],
        ),
        // Anything from rigid play to one that hardly shows.
        Parameter::fitted("compliance", "", "part of the motion within the play that comes through")
            .possible(0.0, 1.0)
            .linear(0.0, 0.9, &[0.3, 0.6])
            .smooth()
            .shape(0.0, |compliance| {
                format!("{} % of the motion within its play comes through", two_digits(100.0 * compliance))
            }),
    ],
    signature: "Small amplitudes lose gain and lag behind, by the same at every frequency. Response against command is a loop \
                of the play's width that stays however slow the command is.",
    confusions: &[
        Confusion {
            with: super::dead_band::ID,
            recipe: &Recipe::SLOW_TURNS,
            experiment: "A slow triangle of ten times the play: after each turn play holds for its width and then follows \
                         smoothly, a dead band makes stairs all the way.",
        },
        Confusion {
            with: super::transport_delay::ID,
            recipe: &Recipe::AMPLITUDES,
            experiment: "Double the amplitude: the phase of play halves, that of a delay stays.",
        },
    ],
    remedy: "look for hysteresis at the ESC's input and send a digital command (DShot), which has none; take up the play of a servo or a linkage",
    sources: &["Gelb & Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968, sec. 2.3"],
    linearity: Linearity::Absent,
    shows: Shows::BetweenLevels,
    search: Search::Values,
    check: Kind::any,
    part: |values, _| match values[0] {
        0.0 => Part::Nothing,
        half_width => {
            let next = move |held: f64, input: f64| held.clamp(input - half_width, input + half_width);
            Part::command(Levels::new(Memory::TurningPoints(0.0), next).passing(values[1]))
        }
    },
    response: Kind::unity,
};

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use num_complex::Complex64;

    use super::*;
    use crate::testing::{active, fundamental};

    #[test]
    fn a_sine_through_play_has_its_describing_function() {
        // With k = 1 - 2 b / a: Re N = (pi/2 + asin k + k sqrt(1 - k^2)) / pi, Im N = -4 b (a - b) / (pi a^2).
        for b in [0.01_f64, 0.05, 0.08] {
            let a = 0.1;
            let k = 1.0 - 2.0 * b / a;
            let n = Complex64::new(
                (PI / 2.0 + k.asin() + k * (1.0 - k * k).sqrt()) / PI,
                -4.0 * b * (a - b) / (PI * a * a),
            );
            // What comes through is beside it.
            for compliance in [0.0, 0.35, 0.9] {
                let found = fundamental(&[active(&KIND, &[b, compliance])], a);
                let n = n * (1.0 - compliance) + compliance;
                assert!((found - n).norm() < 1e-5, "{b}, {compliance}: {found} for {n}");
            }
        }
    }
}
