//! What the questions of a page may be answered with.

use rotorlead_export::Target;
use rotorlead_records::files::AcceptedRange;
use rotorlead_records::import::{FORMATS, Quantity};
use rotorlead_records::{Excitation, Output};
use serde_json::{Value, json};

/// Natural frequencies that a slider goes over, rad/s. Chosen: from the slowest of the paper's motors to above the fastest inverse that is
/// recommended, 250 rad/s.
const NATURALS_RAD_S: (f64, f64) = (10.0, 400.0);

/// All of them.
pub fn choices() -> Value {
    let excitations: Vec<Value> = Excitation::ALL
        .iter()
        .map(|excitation| json!({ "name": excitation.name(), "has_period": excitation.is_periodic() }))
        .collect();
    let quantities: Vec<Value> = Quantity::ALL
        .iter()
        .map(|quantity| json!({ "name": quantity.name(), "units": quantity.unit_names().collect::<Vec<_>>() }))
        .collect();
    let targets: Vec<Value> = Target::all()
        .map(|target| json!({ "name": target.name(), "about": target.about(), "is_text": target.is_text() }))
        .collect();
    let responses = [Output::ThrustN, Output::Rpm].map(Output::option);
    let formats = FORMATS.map(|format| format.title);
    let (low, high) = NATURALS_RAD_S;
    let allowed =
        |omega: f64| omega.clamp(AcceptedRange::FREQUENCY_RAD_S.least, AcceptedRange::FREQUENCY_RAD_S.greatest);
    json!({
        "excitations": excitations,
        "quantities": quantities,
        "responses": responses,
        "formats": formats,
        "targets": targets,
        "naturals_rad_s": [allowed(low), allowed(high)],
    })
}
