//! The frequency response of a chirp.

use std::f64::consts::TAU;

use rotorlead_identify::frequency_response::ResponseLine;
use rotorlead_identify::lag::chirp::ChirpResponse;
use serde::Serialize;

/// The frequency response of a chirp, for programs.
#[derive(Serialize)]
pub struct ChirpValues<'a> {
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
    /// Of one chirp.
    pub fn new(chirp: &'a ChirpResponse) -> Self {
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
