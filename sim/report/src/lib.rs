//! What a person looks at: tables, figures, and the report that holds them.

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
mod number;
pub mod paper;
mod sections;
mod stand;
mod static_map;
mod time_response;
mod unit;
mod validation;

pub use bandwidths::{bandwidth_cell, bandwidth_json, bandwidth_table, measured_json, measured_table, rad_s};
pub use bode::{Band, Curve, bode};
pub use catalog::{catalog_markdown, with_catalog};
pub use compensation::{measured as measured_response, simulated as simulated_response, simulation_and_experiment};
pub use distortion::{distortion_json, distortion_table};
pub use excitation::{crest_factor, excitation};
pub use figure::{Axis, Beside, Color, Figure, FigureError, FigureKind, HeatMap, Mark, Panel, Scale, Series};
pub use html::{Cell, Column, Fact, Report, Section, Table, Tone, Verdict};
pub use number::{parameter_with_std, with_std};
pub use sections::{
    bandwidth_diagnosis_section, bandwidth_section, design_section, diagnosis_section, diagnosis_tone,
    excitation_section, experiment_facts, identification_section, redesign_sections, simulation_section, stand_section,
    validation_section,
};
pub use unit::{quantity, unit};
pub use validation::{cells, is_wrong, validation_by_nominal, validation_table, verdict};
