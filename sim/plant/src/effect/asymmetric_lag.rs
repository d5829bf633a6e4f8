//! Speeding up and slowing down take different times.

use super::{Confusion, Kind, Linearity, Parameter, Part, Search, Shows, Site};
use crate::{Motion, RotorTerm};

/// Two time constants, one for each direction.
pub static KIND: Kind = Kind {
    id: "asymmetric_lag",
    title: "unequal lags up and down",
    site: Site::Rotor,
    equation: "tau = tau_nominal / sqrt(ratio) while the drive is above the speed, tau_nominal sqrt(ratio) while it is below",
    parameters: &[Parameter::fitted("ratio", "", "time constant downward over that upward")
        .null(1.0)
        .possible(0.02, 50.0)
        .log(0.4, 3.0, &[0.7, 1.3, 1.8])
        .smooth()],
    signature: "Rising and falling steps have different time constants, the same ones at every amplitude. Even lines in \
                proportion to the amplitude, and a shift of the mean.",
    confusions: &[
        Confusion {
            with: "operating_point_lag",
            experiment: "Halve the amplitude: unequal lags stay unequal, a pole that moves with the speed becomes one.",
        },
        Confusion {
            with: "quadratic_thrust",
            experiment: "A slow staircase shows the static map alone; unequal lags go when it is slow.",
        },
    ],
    sources: &[
        "ESCs drive a rotor actively upward and let air slow it down: 1.3 to 2 without active braking",
        "Pintelon & Schoukens, System Identification, 2nd ed., ch. 4: even nonlinearities at even lines",
    ],
    linearity: Linearity::Absent,
    shows: Shows::Anywhere,
    search: Search::Values,
    check: Kind::any,
    part: |values, _| match values[0] {
        1.0 => Part::Nothing,
        ratio => Part::rotor(Asymmetry { faster: ratio.sqrt() }),
    },
    response: Kind::unity,
};

struct Asymmetry {
    faster: f64,
}

impl RotorTerm for Asymmetry {
    fn pace(&self, motion: &mut Motion) {
        motion.rate_per_s *= if motion.drive >= motion.speed { self.faster } else { 1.0 / self.faster };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{active, step};

    #[test]
    fn steps_up_and_down_have_their_own_time_constants() {
        for d in [0.2, -0.01] {
            let tau = if d > 0.0 { 0.1 / 1.69_f64.sqrt() } else { 0.1 * 1.69_f64.sqrt() };
            for (row, y) in step(d, 0.5, &[active(&KIND, &[1.69])]).iter().enumerate() {
                let exact = 10.0 * d * (1.0 - (-(row as f64) * 1e-3 / tau).exp());
                assert!((y - exact).abs() < 1e-8, "row {row}: {y} for {exact}");
            }
        }
    }
}
