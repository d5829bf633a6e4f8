//! What a person looks at: what tables, figures and sections say, and figures and reports drawn.

mod bandwidth_diagnosis;
mod bandwidths;
mod bode;
mod catalog;
mod compensation;
mod diagnosis;
mod distortion;
mod etfe;
mod excitation;
mod figure;
mod html;
mod markup;
mod number;
pub mod paper;
mod predicted_steps;
mod sections;
mod stand;
mod static_map;
mod steps;
mod time_response;
mod unit;
mod validation;
mod vehicle;

pub use bandwidths::{
    BandwidthValues, bandwidth_cell, bandwidth_table, bandwidth_text, bandwidth_values, measured_table,
};
pub use bode::{Band, Curve, bode};
pub use catalog::{catalog_markdown, with_catalog};
pub use compensation::{measured as measured_response, simulated as simulated_response, simulation_and_experiment};
pub use distortion::DistortionValues;
pub use excitation::{crest_factor, excitation};
pub use figure::{FigureError, png, svg};
pub use html::html;
pub use number::{parameter_with_std, with_std};
pub use predicted_steps::{robustness_table, steps_table};
pub use sections::{
    FleetRow, bandwidth_diagnosis_section, bandwidth_section, curve_table, design_section, design_table,
    diagnosis_section, diagnosis_tone, discrete_table, effect_table, excess_table, excitation_section,
    experiment_facts, explanations_table, fastest_point, fleet_section, gap_table, identification_section,
    identification_tables, in_short, inverse_equation, inverse_table, laws_table, logs_table, motors_table,
    parameter_table, predicted_table, ratios_table, redesign_sections, redesign_table, simulation_section,
    stand_section, stand_table, transfer_function, usual_table, validation_section, vehicle_force_table,
    vehicle_gains_table, vehicle_other_table, vehicle_section, vehicle_table,
};
pub use unit::{quantity, unit};
pub use validation::{validation_by_nominal, validation_scores, verdict};
