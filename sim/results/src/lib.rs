//! What is asked of records and models, and the answer as programs read it: one file per question. The command line and the
//! Python package both ask here, so that `--json FILE` and a Python dictionary hold the same numbers.

mod design;
mod diagnose;
mod headline;
mod identify;
mod intervals;
mod latency;
mod lost_gain;
mod other_output;
mod points;
mod simulate;

pub use design::{DesignResult, DesignValues, Designed, judged, setting_name};
pub use diagnose::diagnosis_json;
pub use identify::{IdentifyResult, IdentifyValues, transform};
pub use latency::{latency_json, protocol_name};
pub use lost_gain::lost_gain;
pub use points::PointValues;
pub use simulate::{read_plan, simulation_json};
