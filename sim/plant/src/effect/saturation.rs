//! The command is clipped.

use num_complex::Complex64;

use super::{Confusion, Kind, Linearity, Parameter, Part, Search, Shows, Site};
use crate::stage::{Levels, Memory};

/// Clips the command, as a limit of current or power does.
pub static KIND: Kind = Kind {
    id: "saturation",
    title: "saturation of the command",
    site: Site::Command,
    equation: "v = min(max(u, min), max)",
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
    ],
    signature: "Flat tops of the response. Gain falls and harmonics grow with amplitude, but only where the command passes the \
                limit: at high nominal commands for a max, at low ones for a min. Below the limit nothing shows.",
    confusions: &[
        Confusion {
            with: "slew_limit",
            experiment: "Sweep the amplitude at one frequency, then the frequency at one amplitude: clipping does not depend on \
                         the frequency.",
        },
        Confusion {
            with: "quadratic_thrust",
            experiment: "Lower the nominal command by the amplitude: curvature stays, clipping goes.",
        },
    ],
    sources: &[
        "Gelb & Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968, sec. 2.3",
        "current limits of hobby ESCs: 60 to 100 % of full throttle",
    ],
    linearity: Linearity::SmallSignal,
    shows: Shows::Anywhere,
    search: Search::Limit,
    check: |values| if values[1] < values[0] { Ok(()) } else { Err((1, "is not below `max`")) },
    part: |values, _| {
        let (max, min) = (values[0], values[1]);
        match (max, min) {
            (1.0, 0.0) => Part::Nothing,
            _ => Part::command(Levels::new(Memory::Seconds(0.0), move |_, input: f64| input.clamp(min, max))),
        }
    },
    response: |values, point, _| {
        let inside = values[1] <= point.nominal && point.nominal <= values[0];
        Complex64::from(f64::from(u8::from(inside)))
    },
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{active, fundamental};

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
