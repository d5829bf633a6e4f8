//! Identification and design with the code of the controller, the judge of the blind cases, what docs claim, and real logs.

mod blind;
mod blind_inverse;
mod docs;
mod identification;
mod paper;
mod real_logs;
