//! Small changes of the command are ignored.

use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site, two_digits};
use crate::stage::{Levels, Memory};

/// What it is called in files.
pub const ID: &str = "dead_band";

/// Keeps the last command until the new one differs from it by the width.
pub static KIND: Kind = Kind {
    id: ID,
    title: "dead band of command changes",
    site: Site::Command,
    equation: "v_k = u_k where |u_k - v_(k-1)| >= width (1 + width_growth_per_duty d), else v_(k-1), with d the deviation of u_k from \
               the nominal command (from the model's range, for a model that spans one); never below a tenth of width",
    parameters: &[
        Parameter::fitted("width", "duty", "the smallest change of the command that is taken over")
            .possible(0.0, 0.5)
            .log(0.0005, 0.04, &[0.001, 0.003, 0.01])
            // The command of a period of slow sinusoids travels some ten widths: in 1 % steps they add up to a tenth of one.
            .jumping(440),
        // A width that is a part of the command grows by 1 / u_nom, 1.5 to 2.5 1/duty; three times that is more than is to be
        // expected, in either direction.
        Parameter::fitted("width_growth_per_duty", "1/duty", "growth of the width with the command, over the width")
            .possible(-50.0, 50.0)
            .linear(-6.0, 6.0, &[-2.0, 2.0])
            // 6 changes the width by 30 % at a deviation of 0.05: 60 steps of 1 %, as above.
            .jumping(60)
            .shape(0.0, |growth| {
                let verb = if growth < 0.0 { "shrinks" } else { "grows" };
                format!("its width {verb} by {} % with each 0.1 duty of command", two_digits(10.0 * growth.abs()))
            }),
    ],
    signature: "Small amplitudes lose gain, and below the width there is no response at all. Stairs on a slow ramp, that begin \
                where the command turned; half a width of lag on average, independent of speed.",
    confusions: &[
        Confusion {
            with: super::command_quantization::ID,
            recipe: &Recipe::SLOW_TURNS,
            experiment: "A slow triangle with another turning point each time: the stairs of a dead band move with it.",
        },
        Confusion {
            with: super::backlash::ID,
            recipe: &Recipe::SLOW_TURNS,
            experiment: "A slow triangle: play follows smoothly once it is taken up, a dead band jumps by its width.",
        },
    ],
    remedy: "switch off the filter at the ESC's input, or send a digital command (DShot), which has no jitter to ignore",
    sources: &[
        "Gelb & Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968, sec. 2.3",
        "input filters of ESCs ignore jitter of some microseconds of pulse width: 0.002 to 0.01",
    ],
    linearity: Linearity::Absent,
    shows: Shows::BetweenLevels,
    search: Search::Values,
    check: Kind::any,
    part: |values, base| match (values[0], values[1]) {
        (0.0, _) => Part::Nothing,
        (width, 0.0) => ignore_below(move |_| width),
        (width, growth_per_duty) => {
            let base = base.clone();
            ignore_below(move |command| {
                width * (1.0 + growth_per_duty * (command - base.anchor(command))).max(LEAST_PART)
            })
        }
    },
    response: Kind::unity,
};

/// The width where it has shrunk most, over that at the nominal command. Chosen: it keeps a width above zero however far a search goes.
const LEAST_PART: f64 = 0.1;

/// Takes over what is at least a width away, which may be that of the command.
fn ignore_below(width: impl Fn(f64) -> f64 + Send + 'static) -> Part {
    let next = move |held: f64, input: f64| if (input - held).abs() >= width(input) { input } else { held };
    // Each stair begins where the last one ended.
    Part::command(Levels::new(Memory::Lasting, next))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operating::OperatingCurve;
    use crate::rotor::RotorBase;
    use crate::stage::Segment;
    use crate::testing::{active, after_command_stages, fundamental, model};

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
    fn stairs_grow_with_the_command_but_never_below_a_tenth_of_the_width() {
        // On a fine ramp from the nominal command on stairs follow u_(k+1) = (u_k + w (1 - g n)) / (1 - g w), with n = 0.5.
        let (width, growth) = (0.01, 4.0);
        let ramp: Vec<f64> = (0..40_000).map(|k| 0.5 + 1e-5 * f64::from(k)).collect();
        let mut stairs = after_command_stages(&[active(&KIND, &[width, growth])], &ramp);
        stairs.dedup();
        assert!(stairs.len() > 15, "{stairs:?}");
        for pair in stairs.windows(2) {
            let next = (pair[0] + width * (1.0 - growth * 0.5)) / (1.0 - growth * width);
            assert!((pair[1] - next).abs() < 1.1e-5, "{pair:?} for {next}");
        }
        // From 0.25 above the nominal command on -4 leaves nothing, and a tenth of the width is left.
        let mut stairs = after_command_stages(&[active(&KIND, &[width, -4.0])], &ramp);
        stairs.dedup();
        let last = stairs.windows(2).filter(|pair| pair[0] > 0.75);
        assert!(last.map(|pair| pair[1] - pair[0]).all(|step| (step - 0.1 * width).abs() < 1.1e-5));
    }

    #[test]
    fn within_the_range_of_a_model_that_spans_one_the_width_stays() {
        let curve = OperatingCurve::new(&model(&[(0.3, 10.0, 0.2, 0.0), (0.6, 10.0, 0.1, 0.0)])).unwrap();
        let taken = |growth: f64, from: f64, to: f64| {
            let Part::Command(mut stage) = active(&KIND, &[0.01, growth]).part(&RotorBase::Level(curve.clone())) else {
                panic!("it is between command and rotor")
            };
            stage.settle(from);
            stage.advance(0.0, Segment::constant(to, 1.0)).level == to
        };
        assert!(taken(5.0, 0.589, 0.6) && !taken(5.0, 0.591, 0.6));
        // Beyond it the width grows from its end on.
        assert!(taken(5.0, 0.779, 0.8) && !taken(5.0, 0.781, 0.8) && taken(0.0, 0.781, 0.8));
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
