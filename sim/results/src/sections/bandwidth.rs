//! Bandwidths, predicted and measured.

use rotorlead_answer::Section;
use rotorlead_identify::MeasuredBandwidth;
use rotorlead_identify::design::{BandwidthPoint, ChainPhase};

use crate::bandwidths::{bandwidth_table, measured_table};
use crate::figures::compensation::bandwidths;

/// The bandwidth at each nominal command with the `phases` of the whole chain, where they are known, and those that records
/// show.
#[must_use]
pub fn bandwidth_section(points: &[BandwidthPoint], phases: &[ChainPhase], measured: &[MeasuredBandwidth]) -> Section {
    let mut text = vec![
        "The bandwidth is the smallest frequency at which the response is 3 dB under its static value.".to_owned(),
    ];
    if let Some(phase) = phases.first() {
        text.push(format!(
            "Phases are of the whole chain, with the model's dead time and {:.2} ms from pulse in to pulse out. The crossover \
             of a rate controller has to lie below -90 degrees.",
            1e3 * phase.latency_s
        ));
    }
    let mut tables = vec![bandwidth_table(points, phases)];
    if !measured.is_empty() {
        tables.push(measured_table(measured));
    }
    let figures = bandwidths(points, measured).into_iter().collect();
    Section { text, tables, figures, ..Section::new("bandwidth", "Bandwidth") }
}
