//! Where searches of an effect begin.

pub(crate) mod clips;
pub(crate) mod collapsed;
pub(crate) mod frames;
pub(crate) mod quantizer_step;
pub(crate) mod resonance;
pub(crate) mod scan;
