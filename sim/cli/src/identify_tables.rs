//! `rotorlead identify`: its tables, for people.

use std::f64::consts::TAU;

use rotorlead_identify::steps::StaircaseFit;
use rotorlead_identify::{ChirpIdentification, ChirpResponse, PeriodicIdentification, ResponseLine};
use rotorlead_numerics::sample::median;
use rotorlead_records::{Excitation, Experiment, Role};

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

/// What lags from chirps are fitted to, and how far the response follows the command in each.
pub(super) fn fitted_chirps(found: &ChirpIdentification) -> String {
    let mut text = String::from("  Fitted by the local polynomial method: ");
    text += &format!("{}. The fit is of these records.\n", found.files.join(", "));
    let coherences = found.responses.iter().filter_map(coherence);
    text.extend(coherences.map(|sentence| paragraph(&sentence, "  ")));
    text
}

/// The coherence of a chirp over its band, and where it is lowest.
fn coherence(chirp: &ChirpResponse) -> Option<String> {
    let lines = chirp.response.lines.iter().map(|line| line.omega_rad_s / TAU).zip(chirp.coherence.iter().copied());
    let (lowest_hz, lowest) = lines.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let usual = median(chirp.coherence.iter().copied())?;
    let hz = |line: Option<&ResponseLine>| line.map_or(0.0, |line| line.omega_rad_s / TAU);
    let (from_hz, to_hz) = (hz(chirp.response.lines.first()), hz(chirp.response.lines.last()));
    Some(format!(
        "  {}: coherence {usual:.3} (median) from {from_hz:.2} to {to_hz:.2} Hz, lowest {lowest:.3} at {lowest_hz:.2} Hz.",
        chirp.file
    ))
}

/// Which record the steps are of, and how many of them the lags rest on.
pub(super) fn staircase(fit: &StaircaseFit) -> String {
    let known = fit.steps.iter().filter(|step| step.time_constant_s().is_some()).count();
    paragraph(&format!("{}: {known} of {} steps carry a lag. tau in ms:", fit.record, fit.steps.len()), "  ")
}
