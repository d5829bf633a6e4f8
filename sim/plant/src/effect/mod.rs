//! What an actuator does beyond a first-order lag: one file per kind of effect.
//!
//! A file has everything that is known of its kind: the equation with its source, the parameters with their units, null
//! values and plausible ranges, how it shows, what it is mistaken for and which experiment tells them apart; what to do about
//! it; and how it is simulated and linearized. A new kind is a file with a `pub static KIND` and a line in the list below, at its place in the
//! chain.

mod active;
mod catalog;
mod kind;
mod part;
mod recipe;

pub use active::{ActiveEffect, LinearChain};
pub use catalog::Catalog;
use kind::two_digits;
pub use kind::{Checked, Confusion, Kind, Linearity, Parameter, Scale, Search, Shows, Site, Use};
pub use part::Part;
pub use recipe::{Recipe, SQUARE_PERIODS};

/// The modules of the kinds, and all of them in the order of the chain.
macro_rules! kinds {
    ($($module:ident)*) => {
        $(pub mod $module;)*
        static STANDARD: &[&Kind] = &[$(&$module::KIND),*];
    };
}

// rustfmt does not see modules behind a macro: format a new file by its name.
kinds! {
    parameter_error
    saturation
    command_quantization
    dead_band
    backlash
    slew_limit
    esc_frame_hold
    transport_delay
    supply_sag
    winding_heating
    quadratic_thrust
    asymmetric_lag
    operating_point_lag
    gain_drift
    inflow_lead
    stand_resonance
    moving_average
    second_pole
    clock_skew
}

#[cfg(test)]
mod tests;
