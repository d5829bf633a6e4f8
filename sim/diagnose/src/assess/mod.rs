//! What a model leaves: where, whether it is noise, and how large the gap is.

pub(crate) mod conditions;
pub(crate) mod esc_ramp;
pub(crate) mod gap;
pub(crate) mod gaps;
pub(crate) mod lateness;
pub(crate) mod locate;
pub(crate) mod minor;
pub(crate) mod plateau_gap;
pub(crate) mod steadiness;
pub(crate) mod timing;
pub(crate) mod verdict;
