//! Simulated actuators, and the model file that describes one.

mod model;

pub use model::{Effect, Model, Point, Provenance, StaticMap};
