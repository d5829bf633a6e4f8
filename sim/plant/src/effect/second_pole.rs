//! One more lag.

use num_complex::Complex64;

use super::{Confusion, Kind, Linearity, Parameter, Part, Search, Shows, Site};
use crate::filter::{FORGOTTEN, Mode};
use crate::{Interval, Memory, ResponseStage};

/// The motor's electrical lag, or a filter of the sensor.
pub static KIND: Kind = Kind {
    id: "second_pole",
    title: "second pole",
    site: Site::Logger,
    equation: "1 / (time_constant_s s + 1)",
    parameters: &[Parameter::fitted("time_constant_s", "s", "time constant of the second lag")
        .possible(0.0, 10.0)
        .log(1e-4, 0.04, &[3e-4, 1e-3, 3e-3, 0.01, 0.03])
        .smooth()],
    signature: "Above 1 / (2 pi time_constant_s) the response rolls off by 20 dB per decade more and lags by up to 90 degrees \
                more, the same at every nominal command and amplitude. Steps begin with a curve instead of a corner.",
    confusions: &[
        Confusion {
            with: "transport_delay",
            experiment: "Excite up to 1 / (2 pi time_constant_s): the magnitude is 3 dB down there, which a delay does not do.",
        },
        Confusion { with: "slew_limit", experiment: "Halve the amplitude: a pole stays where it is." },
        Confusion {
            with: "parameter_error",
            experiment: "Excite up to ten times the pole: one lag ends at 90 degrees, two go on to 180.",
        },
    ],
    sources: &[
        "L/R of the windings 0.1 to 1 ms; thrust sensors and anti-alias filters 1 to 30 ms",
        "Franklin, Powell & Emami-Naeini, Feedback Control of Dynamic Systems, ch. 3",
    ],
    linearity: Linearity::Exact,
    shows: Shows::Anywhere,
    search: Search::Values,
    check: Kind::any,
    part: |values, _| match values[0] {
        0.0 => Part::Nothing,
        time_constant_s => {
            let rate_per_s = 1.0 / time_constant_s;
            Part::response(Lowpass { rate_per_s, mode: Mode::new(-rate_per_s) })
        }
    },
    response: |values, _, omega_rad_s| Complex64::new(1.0, omega_rad_s * values[0]).inv(),
};

struct Lowpass {
    rate_per_s: f64,
    mode: Mode<f64>,
}

impl Lowpass {
    fn output(&self) -> f64 {
        self.mode.state() * self.rate_per_s
    }
}

impl ResponseStage for Lowpass {
    fn settle(&mut self, level: f64) -> f64 {
        self.mode.settle(level);
        level
    }

    fn advance(&mut self, signal: &mut Interval) {
        let start = self.output();
        self.mode.advance(signal);
        let end = self.output();
        signal.start_slope = (signal.start - start) * self.rate_per_s;
        signal.end_slope = (signal.end - end) * self.rate_per_s;
        (signal.start, signal.end) = (start, end);
    }

    fn memory(&self) -> Memory {
        Memory::Seconds(FORGOTTEN / self.rate_per_s)
    }

    fn time_scale_s(&self) -> f64 {
        1.0 / self.rate_per_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{active, step};

    #[test]
    fn a_step_is_that_of_two_lags_in_series() {
        for t2 in [1e-4, 0.003, 0.099, 0.4] {
            for (row, y) in step(0.1, 0.4, &[active(&KIND, &[t2])]).iter().enumerate() {
                let (t, t1) = (row as f64 * 1e-3, 0.1);
                let exact = 1.0 - (t1 * (-t / t1).exp() - t2 * (-t / t2).exp()) / (t1 - t2);
                assert!((y - exact).abs() < 1e-9, "{t2}, row {row}: {y} for {exact}");
            }
        }
    }
}
