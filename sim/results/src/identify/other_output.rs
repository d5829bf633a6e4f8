//! Records that have thrust and speed: the lag of the one that is not the response.

use rotorlead_identify::steps::{StaircaseFit, fit_staircase};
use rotorlead_records::{Experiment, Output};
use serde::Serialize;

/// The steps of a record as its other column shows them.
#[derive(Serialize)]
pub struct OtherOutput {
    output: Output,
    /// Median over the operating points, seconds.
    time_constant_s: f64,
    delay_s: f64,
    /// By how much its dead time and time constant together are longer than those of the response, seconds.
    behind_s: f64,
    fit_percent: f64,
}

impl OtherOutput {
    /// `None` where the fitted record has no other column, or its steps carry no lag.
    pub fn of(experiment: &Experiment, fit: &StaircaseFit) -> Option<Self> {
        let record = experiment.records.iter().find(|record| record.file == fit.record)?;
        let output = match experiment.output {
            Output::ThrustN => Output::Rpm,
            Output::Rpm => Output::ThrustN,
        };
        record.response(output)?;
        let other = fit_staircase(record, output, experiment.esc_frame_hz).ok()?;
        let (tau_s, response_tau_s) = (usual(&other)?, usual(fit)?);
        Some(Self {
            output,
            time_constant_s: tau_s,
            delay_s: other.delay_s.value,
            behind_s: tau_s + other.delay_s.value - response_tau_s - fit.delay_s.value,
            fit_percent: other.fit_percent,
        })
    }

    /// What it says of the response.
    pub fn sentence(&self, response: Output) -> String {
        let (behind_ms, which) = (1e3 * self.behind_s, if self.behind_s < 0.0 { "ahead of" } else { "behind" });
        format!(
            "The response is {}; {} has a time constant of {:.0} ms and a dead time of {:.0} ms, together {:.0} ms {which} it (fit \
             {:.1} %). --output chooses.",
            response.column(),
            self.output.column(),
            1e3 * self.time_constant_s,
            1e3 * self.delay_s,
            behind_ms.abs(),
            self.fit_percent
        )
    }
}

/// The time constant in the middle of the curve, seconds.
fn usual(fit: &StaircaseFit) -> Option<f64> {
    let curve = fit.curve.as_ref()?;
    Some(curve.at(0.5 * (curve.range.0 + curve.range.1)).value)
}
