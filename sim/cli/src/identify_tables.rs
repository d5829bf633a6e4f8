//! `rotorlead identify`: its tables, for people and as JSON.

use std::f64::consts::TAU;

use rotorlead_identify::steps::StaircaseFit;
use rotorlead_identify::{ChirpIdentification, ChirpResponse, PeriodicIdentification, ResponseLine};
use rotorlead_numerics::sample::median;
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

/// The frequency response of a chirp, for programs.
#[derive(Serialize)]
pub(super) struct ChirpValues<'a> {
    file: &'a str,
    lines: Vec<LineValues>,
}

/// One line, with the 95 % intervals of magnitude and phase.
#[derive(Serialize)]
struct LineValues {
    frequency_hz: f64,
    magnitude: f64,
    magnitude_interval: (f64, f64),
    phase_deg: f64,
    phase_interval_deg: (f64, f64),
    coherence: f64,
}

impl<'a> ChirpValues<'a> {
    pub(super) fn new(chirp: &'a ChirpResponse) -> Self {
        let values = |(line, &coherence): (&ResponseLine, &f64)| {
            let (low, high) = chirp.response.phase_interval_rad(line, 0.95);
            LineValues {
                frequency_hz: line.omega_rad_s / TAU,
                magnitude: line.response.norm(),
                magnitude_interval: chirp.response.magnitude_interval(line, 0.95),
                phase_deg: line.response.arg().to_degrees(),
                phase_interval_deg: (low.to_degrees(), high.to_degrees()),
                coherence,
            }
        };
        Self { file: &chirp.file, lines: chirp.response.lines.iter().zip(&chirp.coherence).map(values).collect() }
    }
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
