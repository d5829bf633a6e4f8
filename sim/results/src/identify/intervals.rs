//! The intervals behind the standard errors.

use rotorlead_identify::estimate::Estimate;
use rotorlead_identify::lag::multisine::PeriodicIdentification;
use serde::Serialize;

/// The 95 % intervals at a nominal command. The time constant's is that of its logarithm.
#[derive(Serialize)]
pub struct Intervals {
    nominal: f64,
    gain: Interval,
    time_constant_s: Interval,
    delay_s: Option<Interval>,
}

/// With the degrees of freedom of the standard error, of which a program makes intervals of other levels by Student's t; infinite
/// ones, of a noise that is known, are null.
#[derive(Serialize)]
struct Interval {
    low: f64,
    high: f64,
    degrees_of_freedom: f64,
}

/// Per nominal command.
pub fn intervals(found: &PeriodicIdentification) -> Vec<Intervals> {
    let interval = |estimate: &Estimate, (low, high)| Interval { low, high, degrees_of_freedom: estimate.dof };
    let of_nominal = found.nominals.iter().map(|nominal| {
        let fit = &nominal.fit;
        Intervals {
            nominal: nominal.nominal,
            gain: interval(&fit.gain, fit.gain.interval(0.95)),
            time_constant_s: interval(&fit.time_constant_s, fit.time_constant_s.interval_of_logarithm(0.95)),
            delay_s: fit.delay_s.as_ref().map(|delay| interval(delay, delay.interval(0.95))),
        }
    });
    of_nominal.collect()
}
