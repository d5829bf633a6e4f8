//! `rotorlead identify`: its tables, for people and as JSON.

use rotorlead_identify::PeriodicIdentification;
use rotorlead_identify::steps::StaircaseFit;
use rotorlead_plant::Point;
use rotorlead_records::{Excitation, Experiment, Role};
use serde::Serialize;

use super::outcome::paragraph;

/// Which records each fit is of.
pub(super) fn held_out(experiment: &Experiment, found: &PeriodicIdentification) -> String {
    let judged = |excitation: Excitation, role: Option<Role>| {
        let records = experiment.records.iter();
        records.filter(|record| record.excitation == excitation && (role.is_none() || record.role == role)).count()
    };
    let squares = judged(Excitation::Square, None);
    let multisines = judged(Excitation::Multisine, Some(Role::Validate));
    let (fitted, all) = (found.fitted_files().count(), experiment.records.len());
    let by_frequency =
        if multisines > 0 { "multisines with role = \"validate\"" } else { "the fitted records themselves" };
    let mut text = format!("  Fitted: {fitted} of {all} records. The fit in frequency is of {by_frequency}");
    if squares > 0 {
        text.push_str("; that on squares is of records that are always held out");
    }
    paragraph(&(text + "."), "  ")
}

/// What lags from chirps are fitted to.
pub(super) fn fitted_chirps(files: &[String]) -> String {
    format!("  Fitted by the local polynomial method: {}. The fit is of these records.\n", files.join(", "))
}

/// Which record the steps are of, and how many of them the lags rest on.
pub(super) fn staircase(fit: &StaircaseFit) -> String {
    let known = fit.steps.iter().filter(|step| step.time_constant_s().is_some()).count();
    paragraph(&format!("{}: {known} of {} steps carry a lag. tau in ms:", fit.record, fit.steps.len()), "  ")
}

/// One point with every key of the contract: what is not known is null, not absent as in a model's file.
#[derive(Serialize)]
pub(super) struct PointValues(#[serde(with = "EveryKey")] pub Point);

#[derive(Serialize)]
#[serde(remote = "Point")]
struct EveryKey {
    nominal: f64,
    gain: f64,
    gain_std: Option<f64>,
    time_constant_s: f64,
    time_constant_s_std: Option<f64>,
    delay_s: f64,
    delay_s_std: Option<f64>,
    time_constant_up_s: Option<f64>,
    time_constant_down_s: Option<f64>,
    fit_frequency_percent: Option<f64>,
    fit_square_percent: Option<f64>,
    fit_step_percent: Option<f64>,
}
