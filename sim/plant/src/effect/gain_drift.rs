//! Thrust changes slowly with time.

use super::{Confusion, Kind, Linearity, Parameter, Part, Recipe, Search, Shows, Site};
use crate::filter::{Interval, MEMORY_TIME_CONSTANTS, Mode, ResponseStage};
use crate::rotor::RotorBase;
use crate::stage::Memory;

/// What it is called in files.
pub const ID: &str = "gain_drift";

/// Heating, or the state of charge.
pub static KIND: Kind = Kind {
    id: ID,
    title: "slow drift of the gain",
    site: Site::Air,
    equation: "tau dT/dt = g T_0(u) - T, T_0(u) the thrust that the command has in the end, \
               g = 1 + drift (1 - e^(-t / time_s)) / (1 - 1/e), t from the record's first row; 1 before it",
    parameters: &[
        Parameter::fitted("drift", "", "the part by which thrust and gain change in the first time_s of a record")
            .possible(-0.95, 5.0)
            .linear(-0.2, 0.2, &[-0.05, 0.05]),
        Parameter::fitted("time_s", "s", "time constant of the drift; long beside the record it is a straight line")
            .null(f64::NAN)
            .possible(0.1, 1e6)
            .log(5.0, 200.0, &[10.0, 40.0]),
    ],
    signature: "Gain and mean thrust differ from period to period, by the same part at every frequency. It begins anew with \
                each record, or goes on with the clock.",
    confusions: &[
        Confusion {
            with: super::supply_sag::ID,
            recipe: &Recipe::LONG_LOADS,
            experiment: "Record twice as many periods: sag repeats from period to period. Reverse the order of the nominal \
                         commands: drift keeps to the clock, sag to the command.",
        },
        Confusion {
            with: super::winding_heating::ID,
            recipe: &Recipe::LONG_LOADS,
            experiment: "Hold a low level for long before and after a high one: drift keeps to the clock, heat comes with the load \
                         and goes with it.",
        },
        Confusion {
            with: super::parameter_error::ID,
            recipe: &Recipe::LONG_LOADS,
            experiment: "Compare the first and the last period: a wrong gain is wrong in both alike.",
        },
    ],
    remedy: "warm up motor and load cell before each record, and record again; where it stays, the loops around the motor have to make up \
             for it",
    sources: &["magnets and windings lose 3 to 15 % while they heat over 10 to 60 s; strain gauges drift alike"],
    linearity: Linearity::Absent,
    shows: Shows::Anywhere,
    search: Search::Values,
    check: Kind::any,
    part: |values, base| match values[0] {
        0.0 => Part::Nothing,
        drift => Part::response(GainDrift::new(drift, values[1], base)),
    },
    response: Kind::unity,
};

/// Drift ahead of the lag, as a link behind it.
///
/// With `tau dz/dt = x - z`, what the lag makes of `x`, and `tau dy/dt = g x - y`, what it makes of `g x`, the difference
/// `e = g z - y` follows `tau de/dt = tau g' z - e`. So `y` is `g z` less a lag of the small `tau g' z`: exact where the lag has
/// one time constant, and else off by the part of `e` by which it has not.
struct GainDrift {
    /// The drift in the end.
    reach: f64,
    rate_per_s: f64,
    start_s: f64,
    gain: f64,
    lag_s: f64,
    /// `e / tau`.
    behind: Mode<f64>,
}

/// The gain, how fast it moves, and how fast that changes.
struct Gain {
    value: f64,
    slope: f64,
    bend: f64,
}

impl GainDrift {
    fn new(drift: f64, time_s: f64, base: &RotorBase) -> Self {
        // Of a model that spans a range, that of its middle.
        let lag_s = base.at(base.anchor(0.5)).lag.time_constant_s;
        Self {
            reach: drift / -(-1.0_f64).exp_m1(),
            rate_per_s: 1.0 / time_s,
            start_s: f64::INFINITY,
            gain: 1.0,
            lag_s,
            behind: Mode::new(-1.0 / lag_s),
        }
    }

    fn gain(&self, time_s: f64) -> Gain {
        let since_s = time_s - self.start_s;
        if since_s < 0.0 {
            return Gain { value: 1.0, slope: 0.0, bend: 0.0 };
        }
        let left = (-since_s * self.rate_per_s).exp();
        let slope = self.reach * self.rate_per_s * left;
        Gain { value: 1.0 + self.reach * (1.0 - left), slope, bend: -slope * self.rate_per_s }
    }
}

impl ResponseStage for GainDrift {
    fn settle(&mut self, level: f64) -> f64 {
        // The gain stands still for ever.
        self.behind.settle(0.0);
        level * self.gain
    }

    fn advance(&mut self, signal: &mut Interval) {
        let (start, end) = (self.gain(signal.from_s), self.gain(signal.from_s + signal.duration_s));
        // e / tau follows d(e / tau)/dt = -(e / tau) / tau + g' z / tau.
        let fed = Interval {
            start: start.slope * signal.start / self.lag_s,
            start_slope: (start.slope * signal.start_slope + start.bend * signal.start) / self.lag_s,
            end: end.slope * signal.end / self.lag_s,
            end_slope: (end.slope * signal.end_slope + end.bend * signal.end) / self.lag_s,
            ..*signal
        };
        let before = self.behind.state();
        self.behind.advance(&fed);
        let after = self.behind.state();
        self.gain = end.value;
        let output = |gain: &Gain, value: f64, behind: f64| gain.value * value - self.lag_s * behind;
        // y' = g' z + g z' - e', and e' = g' z - e / tau.
        let slope = |gain: &Gain, slope: f64, behind: f64| gain.value * slope + behind;
        signal.start = output(&start, signal.start, before);
        signal.start_slope = slope(&start, signal.start_slope, before);
        signal.end = output(&end, signal.end, after);
        signal.end_slope = slope(&end, signal.end_slope, after);
    }

    fn memory(&self) -> Memory {
        Memory::Seconds(MEMORY_TIME_CONSTANTS * self.lag_s)
    }

    fn changes(&self) -> bool {
        true
    }

    fn start_record(&mut self, at_s: f64) {
        self.start_s = at_s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{active, step};

    #[test]
    fn a_step_is_that_of_a_lag_that_follows_a_drifting_thrust() {
        // `step` has no thrust at rest, a gain of 10 and a time constant of 0.1 s.
        for (drift, time_s) in [(-0.1, 1.0), (0.15, 0.3), (-0.14, 20.0)] {
            let reach = drift / (1.0 - (-1.0_f64).exp());
            for (row, y) in step(0.1, 1.2, &[active(&KIND, &[drift, time_s])]).iter().enumerate() {
                let t = row as f64 * 1e-3;
                let (lag, slow) = ((-t / 0.1).exp(), (-t / time_s).exp());
                // The lag's response to 1 + reach (1 - e^(-t / time_s)).
                let exact = (1.0 + reach) * (1.0 - lag) - reach * (slow - lag) / (1.0 - 0.1 / time_s);
                assert!((y - exact).abs() < 1e-8, "{drift} {time_s}, row {row}: {y} for {exact}");
            }
        }
    }
}
