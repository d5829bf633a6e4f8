//! A model with effects as numbers that can be fitted, and its response.

pub(crate) mod candidate;
pub(crate) mod frame_hold;
pub(crate) mod hypothesis;
