//! The command is clipped.

use num_complex::Complex64;

use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site, two_digits};
use crate::stage::{Levels, Memory};

/// What it is called in files.
pub const ID: &str = "saturation";

/// Clips the command, as a limit of current or power does.
pub static KIND: Kind = Kind {
    id: ID,
    title: "saturation of the command",
    site: Site::Command,
    equation: "v = min(max(u, min), max); less than knee away from max v = u - (u - max + knee)^2 / (4 knee), which touches both \
               straight lines",
    parameters: &[
        Parameter::fitted("max", "duty", "the largest command that has an effect").null(1.0).possible(0.0, 1.0).linear(
            0.4,
            1.0,
            &[0.6, 0.8, 0.95],
        ),
        Parameter::fitted("min", "duty", "the smallest command that has an effect")
            .possible(0.0, 1.0)
            .linear(0.0, 0.6, &[0.2])
            .optional(0.0),
        // Limits of current give way over some percent of the throttle; wider it is the curvature of the whole map.
        Parameter::fitted("knee", "duty", "on either side of `max`, the range of commands over which the clip bends")
            .possible(0.0, 0.5)
            .linear(0.0, 0.03, &[0.005, 0.015])
            .shape(0.0, |knee| format!("its knee reaches {} duty to either side of `max`", two_digits(knee))),
    ],
    signature: "Flat tops of the response. Gain falls and harmonics grow with amplitude, but only where the command passes the \
                limit: at high nominal commands for a max, at low ones for a min. Below the limit nothing shows.",
    confusions: &[
        Confusion {
            with: super::slew_limit::ID,
            recipe: &Recipe::AMPLITUDES,
            experiment: "Sweep the amplitude at one frequency, then the frequency at one amplitude: clipping does not depend on \
                         the frequency.",
        },
        Confusion {
            with: super::quadratic_thrust::ID,
            recipe: &Recipe::LOWERED,
            experiment: "Lower the nominal command by the amplitude: curvature stays, clipping goes.",
        },
    ],
    remedy: "beyond the limit nothing is left to gain: fly below it, raise the ESC's limit of current, or take a stronger motor. Declare it \
             to an inverse (`--output-range` of `rotorlead design`), whose state then stays with the rotor",
    sources: &[
        "Gelb & Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968, sec. 2.3",
        "current limits of hobby ESCs: 60 to 100 % of full throttle",
    ],
    linearity: Linearity::SmallSignal,
    shows: Shows::Anywhere,
    search: Search::Limit,
    check: |values| if values[1] < values[0] { Ok(()) } else { Err((1, "is not below `max`")) },
    part: |values, _| {
        let (max, min, knee) = (values[0], values[1], values[2]);
        match (max, min, knee) {
            (1.0, 0.0, 0.0) => Part::Nothing,
            (_, _, 0.0) => clip(move |input| input.clamp(min, max)),
            _ => clip(move |input| bent(input, max, knee).0.clamp(min, max)),
        }
    },
    response: |values, point, _| {
        let (level, slope) = bent(point.nominal, values[0], values[2]);
        Complex64::from(if values[1] <= level { slope } else { 0.0 })
    },
};

fn clip(law: impl Fn(f64) -> f64 + Send + 'static) -> Part {
    Part::command(Levels::new(Memory::Seconds(0.0), move |_, input| law(input)))
}

/// The level that a command comes to below a bent `max`, and the slope there.
fn bent(command: f64, max: f64, knee: f64) -> (f64, f64) {
    let into = command - max + knee;
    if into <= 0.0 {
        (command, 1.0)
    } else if into >= 2.0 * knee {
        (max, 0.0)
    } else {
        (command - into * into / (4.0 * knee), 1.0 - into / (2.0 * knee))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{active, after_command_stages, fundamental, point};

    #[test]
    fn a_knee_takes_its_parabola_off_what_it_clips_and_touches_both_lines() {
        let (max, knee) = (0.6, 0.02);
        let effect = [active(&KIND, &[max, 0.1, knee])];
        let command: Vec<f64> = (0..1000_u32).map(|k| f64::from(k) * 1e-3).collect();
        let out = after_command_stages(&effect, &command);
        let clipped = after_command_stages(&[active(&KIND, &[max, 0.1])], &command);
        for (k, (bent, clip)) in out.iter().zip(&clipped).enumerate() {
            let is_within = (580..620).contains(&k);
            assert!(if is_within { bent <= clip } else { (bent - clip).abs() < 1e-15 }, "{k}: {bent} {clip}");
        }
        // At the corner a quarter of the knee is off, and an area of knee^2 / 6 in all.
        assert!((out[600] - (max - 0.25 * knee)).abs() < 1e-12);
        let area = clipped.iter().zip(&out).map(|(clip, bent)| 1e-3 * (clip - bent)).sum::<f64>();
        assert!((area / (knee * knee / 6.0) - 1.0).abs() < 5e-3, "{area}");
        // No step of the slope: it changes by 1 over two knees.
        let bends = out[200..].windows(3).map(|three| (three[2] - 2.0 * three[1] + three[0]).abs() / 1e-6);
        let most = bends.fold(0.0, f64::max);
        assert!((most * 2.0 * knee - 1.0).abs() < 1e-6, "{most}");
        // Small deviations see the slope: a half at the corner, and all of it ahead of the knee.
        for (max, slope) in [(0.5, 0.5), (0.51, 0.75), (0.53, 1.0), (0.47, 0.0)] {
            let effect = active(&KIND, &[max, 0.0, knee]);
            assert!((effect.response(&point(), 1.0) - slope).norm() < 1e-12, "{max}");
            assert!((fundamental(&[effect], 1e-4) - slope).norm() < 1e-4, "{max}");
        }
    }

    #[test]
    fn a_clipped_sine_has_its_describing_function() {
        // Symmetric around 0.5 with the limits at 0.5 +- l: N = 2/pi (asin r + r sqrt(1 - r^2)), r = l / a.
        for r in [0.2_f64, 0.5, 0.9] {
            let a = 0.2;
            let n = std::f64::consts::FRAC_2_PI * (r.asin() + r * (1.0 - r * r).sqrt());
            let found = fundamental(&[active(&KIND, &[0.5 + r * a, 0.5 - r * a])], a);
            assert!((found - Complex64::from(n)).norm() < 2e-6, "{found} for {n}");
        }
        let untouched = fundamental(&[active(&KIND, &[0.75, 0.0])], 0.2);
        assert!((untouched - Complex64::ONE).norm() < 1e-9);
    }
}
