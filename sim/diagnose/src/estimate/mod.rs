//! The values of a model that fit best, how well they are known, and what they predict.

pub(crate) mod first_lag;
pub(crate) mod fit;
pub(crate) mod frame_rate;
pub(crate) mod linearization;
pub(crate) mod prediction;
pub(crate) mod prepare;
pub(crate) mod profile;
pub(crate) mod score_test;
pub(crate) mod settle;
pub(crate) mod stair;
