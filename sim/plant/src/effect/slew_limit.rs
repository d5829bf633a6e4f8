//! The command can change only so fast.

use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site, two_digits};
use crate::stage::{CommandStage, Memory, Segment};

/// What it is called in files.
pub const ID: &str = "slew_limit";

/// Follows the command at no more than a rate.
pub static KIND: Kind = Kind {
    id: ID,
    title: "slew-rate limit",
    site: Site::Command,
    equation: "dv/dt = rate_per_s while u is above v, -down_ratio rate_per_s while it is below, until v = u",
    parameters: &[
        Parameter::fitted("rate_per_s", "duty/s", "the fastest change of the command upward that is followed")
            .null(f64::INFINITY)
            .possible(1e-6, f64::INFINITY)
            .log(0.1, 300.0, &[0.3, 1.0, 3.0, 10.0, 30.0, 100.0]),
        // ESCs have a ramp for each direction, or for one alone: at the ends of the range the other one is free.
        Parameter::fitted("down_ratio", "", "the fastest change downward over that upward")
            .possible(1e-3, 1e3)
            .log(1e-3, 1e3, &[0.1, 0.8, 1.25, 10.0])
            .smooth()
            .shape(1.0, |ratio| format!("it slews downward at {} times the rate upward", two_digits(ratio))),
    ],
    signature: "Gain falls and phase lags with amplitude times frequency; triangles where sinusoids are due, odd harmonics. \
                Steps become ramps whose length grows with the step. Small or slow commands pass untouched.",
    confusions: &[
        Confusion {
            with: super::saturation::ID,
            recipe: &Recipe::AMPLITUDES,
            experiment: "Sweep the frequency at one amplitude: a limit of the rate acts only above a frequency.",
        },
        Confusion {
            with: super::second_pole::ID,
            recipe: &Recipe::AMPLITUDES,
            experiment: "Halve the amplitude: a pole stays, a limit of the rate moves up by an octave or goes.",
        },
    ],
    remedy: "where it is a ramp or a soft start of the ESC, switch that off in its settings, or raise it, and record again; where it stays, \
             declare it (`--slew` of `rotorlead design`, `output.slew_per_s` of the controller)",
    sources: &[
        "Klyde, McRuer & Myers, Pilot-Induced Oscillation Analysis and Prediction with Actuator Rate Limiting, J. Guidance 1997",
        "ramp settings of ESCs: 0.025 to 16 % per millisecond",
    ],
    linearity: Linearity::SmallSignal,
    shows: Shows::Anywhere,
    search: Search::Values,
    check: Kind::any,
    part: |values, _| match values[0] {
        f64::INFINITY => Part::Nothing,
        up_per_s => Part::command(SlewLimit::new(up_per_s, up_per_s * values[1])),
    },
    response: Kind::unity,
};

/// The rate of the slower direction, by the values of the effect: no command moves faster both ways.
#[must_use]
pub fn slower_per_s(up_per_s: f64, down_ratio: f64) -> f64 {
    up_per_s * down_ratio.min(1.0)
}

/// Exact: the moment at which it catches up with the command ends a piece.
struct SlewLimit {
    up_per_s: f64,
    down_per_s: f64,
    /// From here on the output moves in a straight line.
    at_s: f64,
    level: f64,
    slope_per_s: f64,
}

impl SlewLimit {
    fn new(up_per_s: f64, down_per_s: f64) -> Self {
        Self { up_per_s, down_per_s, at_s: 0.0, level: 0.0, slope_per_s: 0.0 }
    }
}

impl CommandStage for SlewLimit {
    fn settle(&mut self, level: f64) -> f64 {
        (self.level, self.slope_per_s) = (level, 0.0);
        level
    }

    fn advance(&mut self, from_s: f64, input: Segment) -> Segment {
        if self.slope_per_s != 0.0 {
            self.level += self.slope_per_s * (from_s - self.at_s);
        }
        self.at_s = from_s;
        let mut behind = input.level - self.level;
        // The moment of meeting is rounded, and so is what is left of the way then.
        let fastest_per_s = self.up_per_s.max(self.down_per_s);
        let rounding = 4.0 * f64::EPSILON * (1.0 + from_s.abs() * (fastest_per_s + input.slope_per_s.abs()));
        if behind.abs() <= rounding {
            self.level = input.level;
            if (-self.down_per_s..=self.up_per_s).contains(&input.slope_per_s) {
                self.slope_per_s = input.slope_per_s;
                return Segment { level: self.level, ..input };
            }
            behind = 0.0;
        }
        let is_down = if behind == 0.0 { input.slope_per_s < 0.0 } else { behind < 0.0 };
        self.slope_per_s = if is_down { -self.down_per_s } else { self.up_per_s };
        let closing_per_s = (self.slope_per_s - input.slope_per_s) * behind.signum();
        let meets_s =
            if behind != 0.0 && closing_per_s > 0.0 { from_s + behind.abs() / closing_per_s } else { f64::INFINITY };
        // Later than `from_s`, since more is left than rounding.
        let until_s = input.until_s.min(meets_s);
        Segment { level: self.level, slope_per_s: self.slope_per_s, until_s }
    }

    fn memory(&self) -> Memory {
        // It has met the command somewhere in a period, or goes to and fro by the same way in each.
        Memory::TurningPoints(0.0)
    }

    fn kept(&self, now_s: f64) -> Option<f64> {
        let since_s = if self.slope_per_s == 0.0 { 0.0 } else { now_s - self.at_s };
        Some(self.level + self.slope_per_s * since_s)
    }

    fn makes_ramps(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use super::*;
    use crate::testing::{SINE_S, active, after_command_stages, fundamental, step};

    #[test]
    fn a_step_becomes_a_ramp_and_the_lag_follows_it_exactly() {
        // 0.1 at 0.8 per second: a ramp of 125 ms, whose end is between rows of 1 ms where the rate is odd.
        for rate in [0.8, 0.37, 13.0] {
            let ramp_s = 0.1 / rate;
            let tau = 0.1;
            for (row, &y) in step(0.1, 0.5, &[active(&KIND, &[rate])]).iter().enumerate() {
                let t = row as f64 * 1e-3;
                let lagged = |t: f64| if t > 0.0 { t - tau * (1.0 - (-t / tau).exp()) } else { 0.0 };
                let exact = 10.0 * rate * (lagged(t) - lagged(t - ramp_s));
                assert!((y - exact).abs() < 1e-12, "{rate}, row {row}: {y} for {exact}");
            }
        }
    }

    #[test]
    fn ramps_down_have_their_own_rate() {
        // Up 0.2 within 125 ms and down again within 250 ms, and a part of either.
        let effect = active(&KIND, &[1.6, 0.5]);
        let command: Vec<f64> = (0..1000).map(|row| if row < 500 { 0.7 } else { 0.5 }).collect();
        let out = after_command_stages(&[effect], &[vec![0.5], command].concat());
        for (row, &level) in out[1..].iter().enumerate() {
            let since_s = (row % 500) as f64 * 1e-3;
            let exact = if row < 500 { 0.7_f64.min(0.5 + 1.6 * since_s) } else { 0.5_f64.max(0.7 - 0.8 * since_s) };
            assert!((level - exact).abs() < 1e-12, "row {row}: {level} for {exact}");
        }
        // A triangle too fast for it downward, that it meets on the way up and then follows, within two steps of the command.
        let triangle: Vec<f64> = (0..400_u32).map(|row| 0.5 + 1e-3 * f64::from(100_u32.abs_diff(row))).collect();
        let out = after_command_stages(&[active(&KIND, &[2.0, 0.25])], &triangle);
        for (row, &level) in out.iter().enumerate() {
            let exact = triangle[row].max(0.6 - 0.5e-3 * row as f64);
            assert!((level - exact).abs() < 2.1e-3, "row {row}: {level} for {exact}");
        }
    }

    #[test]
    fn catching_up_with_a_slope_takes_a_number_of_pieces_that_rounding_does_not_multiply() {
        let mut slew = SlewLimit::new(0.5, 0.5);
        let (mut time_s, mut pieces) = (0.0_f64, 0);
        for row in 1..=1000 {
            let until_s = f64::from(row) * 1e-3;
            let level = 0.5 + 0.05 * f64::sin(40.0 * time_s);
            while time_s < until_s {
                time_s = slew.advance(time_s, Segment { level, slope_per_s: 0.0, until_s }).until_s;
                pieces += 1;
            }
        }
        assert!(pieces <= 2000, "{pieces} pieces for 1000 commands");
    }

    #[test]
    fn a_limited_sine_is_a_triangle_of_the_known_amplitude() {
        // Far beyond the limit the output is a triangle of peak r T / 4, with 8 / pi^2 of it at the fundamental.
        let (a, period_s) = (0.3, SINE_S as f64);
        let rate = 0.01;
        let triangle = rate * period_s / 4.0;
        let found = fundamental(&[active(&KIND, &[rate])], a).norm();
        assert!((found / (8.0 / (PI * PI) * triangle / a) - 1.0).abs() < 1e-3, "{found}");
        // A sine whose peak rate, 2 pi a / T, is below the limit passes.
        let free = fundamental(&[active(&KIND, &[1.01 * TAU * a / period_s])], a);
        assert!((free - 1.0).norm() < 4e-4, "{free}");
    }

    #[test]
    fn levels_that_it_can_reach_it_reaches_to_the_last_digit() {
        let command: Vec<f64> = (0..500).map(|k| if k / 100 % 2 == 0 { 0.3 } else { 0.7 }).collect();
        let out = after_command_stages(&[active(&KIND, &[7.3])], &command);
        assert!(out.chunks(100).zip(command.chunks(100)).all(|(out, u)| out[99] == u[99]));
    }
}
