//! Identification, design and diagnosis together with the controller's code, the blind cases and the real logs.

mod blind;
mod blind_inverse;
mod docs;
mod identification;
mod outside;
mod paper;
mod real_logs;
mod real_logs_diagnose;
