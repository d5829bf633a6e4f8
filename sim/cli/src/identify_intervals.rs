//! `rotorlead identify` for programs: the intervals behind the standard errors.

use rotorlead_identify::{Estimate, PeriodicIdentification};
use serde_json::{Value, json};

/// Per nominal command the 95 % intervals of gain, time constant and dead time, and the degrees of freedom of their standard
/// errors, of which a program makes intervals of other levels by Student's t. The time constant's is that of its logarithm.
pub fn intervals_json(found: &PeriodicIdentification) -> Value {
    let entry = |estimate: &Estimate, (low, high): (f64, f64)| {
        // Infinite ones, of a noise that is known, are null.
        json!({ "low": low, "high": high, "degrees_of_freedom": estimate.dof })
    };
    let of_nominal = found.nominals.iter().map(|nominal| {
        let fit = &nominal.fit;
        json!({
            "nominal": nominal.nominal,
            "gain": entry(&fit.gain, fit.gain.interval(0.95)),
            "time_constant_s": entry(&fit.time_constant_s, fit.time_constant_s.interval_of_logarithm(0.95)),
            "delay_s": fit.delay_s.as_ref().map(|delay| entry(delay, delay.interval(0.95))),
        })
    });
    of_nominal.collect()
}
