//! Diagnosis of records in which effects are hidden. One program, since each takes seconds to link.

mod auxiliary_channels;
mod hidden_effects;
mod invariance;
mod logs;
mod next_experiment;
mod other_systems;
mod real_logs;
mod redesign;
mod two_levels;
