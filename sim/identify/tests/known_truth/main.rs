//! Identification of records whose truth is known. One program, since each takes seconds to link.

mod alignment;
mod chirps;
mod counts;
mod coverage;
mod flight_records;
mod flights;
mod frequency_response;
mod holds;
mod hum;
mod levels;
mod own_stamps;
mod plausibility;
mod random_commands;
mod slow_readings;
mod squares;
mod stalls;
mod stand;
mod static_map;
mod steps;
mod steps_in_bad_logs;
mod validate;
