//! Blind cases for the diagnosis: data with a hidden effect, made by code that shares nothing with the simulator under
//! test, and the score of what the diagnosis says of them.

pub mod case;
pub mod ceiling;
pub mod chain;
pub mod diagnosis;
pub mod excitation;
pub mod fit;
pub mod folder;
pub mod kind;
pub mod lag;
pub mod motor;
pub mod noise;
pub mod outside;
pub mod path;
pub mod report;
pub mod run;
pub mod score;
pub mod setup;
pub mod solve;
pub mod tally;
pub mod whiten;
