//! Records that do not repeat: steps, staircases, chirps and anything else, with rows as they came.
//!
//! They have no lines to compare on, and what models miss of them is mostly the models' error, not noise: a static map is off by
//! the same all over a plateau. So
//!
//! - start-up, standstill, spikes and what follows a gap of the logger are cut out (`cut`);
//! - levels and what happens between them are compared separately, each level as one number (`noise::plateau_errors`);
//! - what is held out is whole steps, by splits that are written down beforehand (`split`);
//! - whether anything is left to explain is evaluated by the scatter of settled rows about their own mean, which no model of the
//!   command can explain, and not by the error that the models leave.

pub(crate) mod cut;
pub(crate) mod groups;
pub(crate) mod rows;
pub(crate) mod split;
