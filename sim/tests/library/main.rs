//! The library on data whose truth is known. One program, since each takes seconds to link.

mod alignment;
mod auxiliary_channels;
mod chirps;
mod diagnose;
mod diagnose_logs;
mod holds;
mod hum;
mod import;
mod import_blackbox;
mod import_dataflash;
mod import_mat;
mod import_odd;
mod import_plain;
mod import_ulog;
mod importing;
mod invariance;
mod next_experiment;
mod plausibility;
mod redesign;
mod static_map;
mod steps;
mod two_levels;
mod validate;
