//! Dead time.

use num_complex::Complex64;

use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site};
use crate::delay::TransportDelay;

/// What it is called in files.
pub const ID: &str = "transport_delay";

/// A delay beyond that of the model's points.
pub static KIND: Kind = Kind {
    id: ID,
    title: "transport delay",
    site: Site::Line,
    equation: "v(t) = u(t - delay_s); e^(-s delay_s)",
    parameters: &[Parameter::fitted("delay_s", "s", "how much later the command arrives")
        .possible(0.0, 2.0)
        .log(2e-5, 0.15, &[3e-4, 1e-3, 3e-3, 0.01, 0.025, 0.08])
        .smooth()],
    signature: "The magnitude is untouched at every frequency; the phase lags in proportion to the frequency, the same at every \
                nominal command and amplitude. Steps begin late.",
    confusions: &[
        Confusion {
            with: super::esc_frame_hold::ID,
            recipe: &Recipe::OTHER_FRAMES,
            experiment: "Change the frame rate: half a frame of delay goes with it. Excite near half the frame rate: only a \
                         hold droops and has images.",
        },
        Confusion {
            with: super::second_pole::ID,
            recipe: &Recipe::HIGH_FREQUENCIES,
            experiment: "Excite up to the corner of the suspected pole: it loses 3 dB there, a delay nothing.",
        },
        Confusion {
            with: super::clock_skew::ID,
            recipe: &Recipe::LONG,
            experiment: "Compare early and late periods of a long record: the phase of a delay stays.",
        },
    ],
    remedy: "find out whether the logger or the stand's command makes the dead time: then record again without it, as with \
             `rotorlead device record`, and identify again. Where ESC and motor make it, use another ESC or protocol",
    sources: &[
        "Franklin, Powell & Emami-Naeini, Feedback Control of Dynamic Systems, sec. 5.6: pure time delay",
        "a digital command takes 0.03 ms; loggers that stamp on arrival add 5 to 25 ms, and one that stalls at each command 90 ms",
    ],
    linearity: Linearity::Exact,
    shows: Shows::Anywhere,
    search: Search::Values,
    check: Kind::any,
    part: |values, _| match TransportDelay::new(values[0]) {
        Ok(delay) if values[0] > 0.0 => Part::command(delay),
        _ => Part::Nothing,
    },
    response: |values, _, omega_rad_s| Complex64::cis(-omega_rad_s * values[0]),
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{active, step};

    #[test]
    fn a_step_begins_later_by_any_part_of_a_row_and_after_a_ramp_too() {
        for delay_s in [3e-5, 0.001, 0.012_34] {
            let late = active(&KIND, &[delay_s]);
            for (row, y) in step(0.1, 0.3, std::slice::from_ref(&late)).iter().enumerate() {
                let t = (row as f64 * 1e-3 - delay_s).max(0.0);
                assert!((y - (1.0 - (-t / 0.1).exp())).abs() < 1e-12);
            }
            let slow = active(&super::super::slew_limit::KIND, &[0.7]);
            for (row, y) in step(0.1, 0.3, &[slow, late]).iter().enumerate() {
                let lagged = |t: f64| if t > 0.0 { t - 0.1 * (1.0 - (-t / 0.1).exp()) } else { 0.0 };
                let t = row as f64 * 1e-3 - delay_s;
                let exact = 7.0 * (lagged(t) - lagged(t - 0.1 / 0.7));
                assert!((y - exact).abs() < 1e-12, "row {row}: {y} for {exact}");
            }
        }
    }
}
