//! Thrust changes slowly with time.

use super::{Confusion, Kind, Linearity, Parameter, Part, Shows, Site};
use crate::plant::{Interval, ResponseStage};

/// Heating, or the state of charge.
pub static KIND: Kind = Kind {
    id: "gain_drift",
    title: "slow drift of the gain",
    site: Site::Air,
    equation: "T(t) = (1 + drift (1 - e^(-t / time_s)) / (1 - 1/e)) T_0(t), t from the record's first row; 1 before it",
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
            with: "supply_sag",
            experiment: "Record twice as many periods: sag repeats from period to period. Reverse the order of the nominal \
                         commands: drift keeps to the clock, sag to the command.",
        },
        Confusion {
            with: "winding_heating",
            experiment: "Hold a low level for long before and after a high one: drift keeps to the clock, heat comes with the load \
                         and goes with it.",
        },
        Confusion {
            with: "parameter_error",
            experiment: "Compare the first and the last period: a wrong gain is wrong in both alike.",
        },
    ],
    sources: &["magnets and windings lose 3 to 15 % while they heat over 10 to 60 s; strain gauges drift alike"],
    linearity: Linearity::Absent,
    shows: Shows::Anywhere,
    check: Kind::any,
    part: |values, _| match values[0] {
        0.0 => Part::Nothing,
        drift => Part::response(GainDrift {
            reach: drift / -(-1.0_f64).exp_m1(),
            rate_per_s: 1.0 / values[1],
            start_s: f64::INFINITY,
            gain: 1.0,
        }),
    },
    response: Kind::unity,
};

struct GainDrift {
    /// The drift in the end.
    reach: f64,
    rate_per_s: f64,
    start_s: f64,
    gain: f64,
}

impl GainDrift {
    /// The gain and how fast it moves.
    fn gain(&self, time_s: f64) -> (f64, f64) {
        let since_s = time_s - self.start_s;
        if since_s <= 0.0 {
            return (1.0, 0.0);
        }
        let left = (-since_s * self.rate_per_s).exp();
        (1.0 + self.reach * (1.0 - left), self.reach * self.rate_per_s * left)
    }
}

impl ResponseStage for GainDrift {
    fn settle(&mut self, level: f64) -> f64 {
        level * self.gain
    }

    fn advance(&mut self, input: &Interval) -> Interval {
        let (start, start_moves) = self.gain(input.from_s);
        let (end, end_moves) = self.gain(input.from_s + input.duration_s);
        self.gain = end;
        Interval {
            start: start * input.start,
            start_slope: start * input.start_slope + start_moves * input.start,
            end: end * input.end,
            end_slope: end * input.end_slope + end_moves * input.end,
            ..*input
        }
    }

    fn start_record(&mut self, at_s: f64) {
        self.start_s = at_s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::testing::{active, step};

    #[test]
    fn after_its_time_it_is_what_it_says_and_the_lag_is_the_same() {
        let (with, without) = (step(0.1, 1.2, &[active(&KIND, &[-0.1, 1.0])]), step(0.1, 1.2, &[]));
        // `step` has no thrust at rest.
        assert!((with[1000] / without[1000] - 0.9).abs() < 1e-12);
        assert_eq!(with[0], without[0]);
        for row in 1..1200 {
            let part = -0.1 * (1.0 - (-(row as f64) * 1e-3).exp()) / (1.0 - (-1.0_f64).exp());
            assert!((with[row] / without[row] - 1.0 - part).abs() < 1e-12);
        }
    }
}
