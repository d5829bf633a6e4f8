//! The command line as a user meets it: the real program, its exit status, its words and its files.

mod bad_input;
mod check;
mod compare;
mod device;
mod diagnose;
mod docs;
mod escapes;
mod export;
mod fleet;
mod flight;
mod gallery;
mod garbage;
mod good_paths;
mod identify_stand;
mod import;
mod interrupted;
mod inverse;
mod judgement;
mod latency;
mod log_for_a_file;
#[cfg(unix)]
mod mutated;
mod naming;
mod new;
mod one_command;
mod output;
mod outputs;
#[cfg(unix)]
mod promise;
mod provenance;
mod redact;
mod replacement;
mod report_of_steps;
mod reports;
#[cfg(unix)]
mod robust;
mod sample;
mod slew;
mod stand;
mod start;
mod terminal;
mod two_logs;
mod vehicle;
mod what_to_fly;
