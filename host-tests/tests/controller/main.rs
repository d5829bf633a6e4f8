//! The controller without its hardware, and the filter that it runs.

mod capture;
mod channel;
mod compensator;
mod design;
mod device;
mod dshot;
mod esc_output;
mod excitation;
mod filter;
mod fuzz;
mod inverse;
mod latency;
mod link;
mod load;
mod other_protocol;
mod plan;
mod resume;
mod safety;
mod settings;
mod slew;
mod speed_correction;
mod spikes;
mod tune;
mod whole;
