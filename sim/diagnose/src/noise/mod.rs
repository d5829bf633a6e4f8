//! What is not the motor: the spectrum of the noise, mains hum, and how far a model of plateaus is off.

pub(crate) mod hum;
pub(crate) mod plateau_errors;
pub(crate) mod whitening;
