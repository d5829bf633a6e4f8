//! What is asked of records and models, and the answer: as programs read it, one file per question, and as tables, figures
//! and sections for people. The command line and the Python package both ask here, so that `--json FILE` and a Python
//! dictionary hold the same numbers.

mod bandwidth;
mod catalog;
mod caveats;
mod check;
mod comparison;
mod design;
mod diagnosis;
mod distortion;
mod esc_ramp;
mod experiment;
mod figures;
mod fleet;
mod identify;
mod json_object;
mod latency;
mod logs;
mod number;
mod overview;
mod pages;
pub mod paper;
mod recommendation;
mod redesign;
mod request;
mod simulate;
mod stand;
mod unit;
mod validation;
mod vehicle;

pub use bandwidth::{
    BandwidthResult, DeviatingActuator, MeasuredRecords, RESAMPLES, bandwidth_cell, bandwidth_range, deviations,
};
pub use catalog::{catalog_markdown, with_catalog};
pub use caveats::{export_warnings, warn_of_another_model};
pub use check::check_answer;
pub use comparison::{Subject, comparison_answer};
pub use design::{DesignResult, Designed, design_section, in_short};
use diagnosis::effect_notes;
pub use diagnosis::{diagnosed_model, diagnosis_answer};
pub use distortion::DistortionValues;
pub use esc_ramp::{EscRampValues, RampValues};
pub use experiment::{excitation_section, experiment_facts, simulation_section};
pub use figures::bode::{Band, Curve, bode};
pub use figures::excitation::{crest_factor, excitation};
pub use fleet::{FleetRow, fleet_answer};
pub use identify::{IdentifyResult, points_table, transform};
pub use logs::{Logs, called_alike};
pub use number::parameter_with_std;
pub use overview::{Asked, Overview, Watch, lags};
pub use pages::{answer_page, file_fact, records_facts, version_fact};
pub use recommendation::{
    JudgementValues, flight_section, judged_verdict, recommendation_table, to_fly_in_short, tone,
};
pub use redesign::{redesign_answer, redesign_notes, redesign_refusals};
pub use request::{Chosen, DesignRequest, Kind, RequestError};
pub use simulate::{read_plan, simulation_json};
pub use stand::stand_answer;
pub use unit::{quantity, unit};
pub use validation::{validation_answer, validation_in_words};
pub use vehicle::vehicle_answer;
