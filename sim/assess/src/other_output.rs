//! Records that have thrust and speed: the lag of the one that is not the response.

use rotorlead_identify::identification::step_record;
use rotorlead_identify::lag::steps::fit_staircase;
use rotorlead_plant::Model;
use rotorlead_records::{Experiment, Output};
use serde::Serialize;

/// Of the response's dead time and time constant together, the part from which on what thrust lags behind its speed is worth a word.
/// Chosen: a propeller's thrust follows its speed within milliseconds, less than this of most lags.
const MIN_LAG_FRACTION: f64 = 0.1;

/// The steps of a record as its other column shows them, beside the model of its response.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OtherOutput {
    output: Output,
    /// At the operating point in the middle, seconds.
    time_constant_s: f64,
    delay_s: f64,
    /// By how much its dead time and time constant together are longer than those of the response, seconds.
    behind_s: f64,
    fit_percent: f64,
}

impl OtherOutput {
    /// `None` where no record of steps has another column, or its steps carry no lag.
    pub(crate) fn from_experiment(experiment: &Experiment, model: &Model) -> Option<Self> {
        let record = step_record(experiment).ok()?;
        let output = match experiment.output {
            Output::ThrustN => Output::Rpm,
            Output::Rpm => Output::ThrustN,
        };
        record.response(output)?;
        let other = fit_staircase(record, output, experiment.esc_frame_hz).ok()?;
        let point = model.points.get(model.points.len() / 2)?;
        let (tau_s, delay_s) = (other.curve.as_ref()?.at(point.nominal).value, other.delay_s.value);
        Some(Self {
            output,
            time_constant_s: tau_s,
            delay_s,
            behind_s: tau_s + delay_s - point.time_constant_s - point.delay_s,
            fit_percent: other.fit_percent,
        })
    }

    /// What it says of the response.
    #[must_use]
    pub fn sentence(&self, response: Output) -> String {
        let (behind_ms, which) = (1e3 * self.behind_s, if self.behind_s < 0.0 { "ahead of" } else { "behind" });
        format!(
            "The response is {}; {} has a time constant of {:.0} ms and a dead time of {:.0} ms, together {:.0} ms {which} it (fit \
             {:.1} %). --response chooses.",
            response.column(),
            self.output.column(),
            1e3 * self.time_constant_s,
            1e3 * self.delay_s,
            behind_ms.abs(),
            self.fit_percent
        )
    }

    /// Said where the response is a thrust that comes later than its speed: a propeller's thrust follows its speed within
    /// milliseconds, so that the rest is the load cell's, its filter's or the stand's, and no compensator for a motor.
    pub(crate) fn limit(&self) -> Option<String> {
        let late_s = -self.behind_s;
        let whole_s = self.time_constant_s + self.delay_s + late_s;
        (self.output == Output::Rpm && late_s > MIN_LAG_FRACTION * whole_s).then(|| {
            format!(
                "thrust comes {:.0} ms behind its speed, which is {:.0} % of its lag: the load cell, its filter or the stand makes that, and \
                 a compensator would be built for them too. Record thrust unfiltered, or identify the speed with --response rpm",
                1e3 * late_s,
                100.0 * late_s / whole_s
            )
        })
    }
}
