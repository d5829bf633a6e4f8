//! Blind cases for the diagnosis: data with a hidden effect, made by code that shares nothing with the simulator under
//! test, and the score of what the diagnosis says of them.

pub mod chain;
pub mod excitation;
pub mod kind;
pub mod lag;
pub mod motor;
pub mod path;
pub mod setup;
