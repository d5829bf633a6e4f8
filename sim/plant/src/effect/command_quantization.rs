//! The command is rounded to a grid.

use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site};
use crate::stage::{Levels, Memory};

/// What it is called in files.
pub const ID: &str = "command_quantization";

/// Rounds the command to whole steps, as a protocol or a timer does.
pub static KIND: Kind = Kind {
    id: ID,
    title: "quantized command",
    site: Site::Command,
    equation: "v = step round(u / step)",
    parameters: &[Parameter::fitted("step", "duty", "the distance between commands that are distinguished")
        .possible(0.0, 0.5)
        .log(1.0 / 4096.0, 1.0 / 32.0, &[1.0 / 1024.0, 1.0 / 256.0, 1.0 / 128.0, 1.0 / 64.0])
        // The 60th step from 0 moves by a sixth of its height when all become larger by 0.3 %.
        .jumping(1600)],
    signature: "Stairs on a slow ramp, at the same commands upward and downward. The error is at most half a step at every \
                frequency and amplitude, spread over all lines; it is the same in every period of a periodic command.",
    confusions: &[
        Confusion {
            with: super::dead_band::ID,
            recipe: &Recipe::SLOW_TURNS,
            experiment: "A slow triangle: stairs of a grid are at the same commands up and down, those of a dead band begin \
                         where the command turns.",
        },
        Confusion {
            with: super::backlash::ID,
            recipe: &Recipe::SLOW_TURNS,
            experiment: "A slow triangle: a grid leaves the mean response the same up and down, play does not.",
        },
    ],
    remedy: "the ESC or the protocol resolves no more: send the command with a finer protocol (DShot has 2000 steps) before it is sped up",
    sources: &[
        "Widrow & Kollar, Quantization Noise, 2008, ch. 1",
        "PWM at 1 us of 1000 us is 1/1000; DShot has 1/2000; 8-bit links have 1/256 and fewer",
    ],
    linearity: Linearity::Absent,
    shows: Shows::BetweenLevels,
    search: Search::Steps,
    check: Kind::any,
    part: |values, _| match values[0] {
        0.0 => Part::Nothing,
        step => Part::command(Levels::new(Memory::Seconds(0.0), move |_, input: f64| step * (input / step).round())),
    },
    response: Kind::unity,
};

#[cfg(test)]
mod tests {
    use num_complex::Complex64;

    use super::*;
    use crate::testing::{active, fundamental};

    #[test]
    fn a_rounded_sine_has_its_describing_function() {
        // Around a multiple of the step: N = 4 q / (pi a) sum sqrt(1 - ((2 i - 1) q / (2 a))^2) over the steps inside.
        let a = 0.1;
        for q in [0.05, 0.025, 0.125] {
            let inside = (1..).map(|i| (2.0 * f64::from(i) - 1.0) * q / (2.0 * a)).take_while(|x| *x < 1.0);
            let n = 4.0 * q / (std::f64::consts::PI * a) * inside.map(|x| (1.0 - x * x).sqrt()).sum::<f64>();
            let found = fundamental(&[active(&KIND, &[q])], a);
            assert!((found - Complex64::from(n)).norm() < 2e-4, "step {q}: {found} for {n}");
        }
    }
}
