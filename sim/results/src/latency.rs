//! The latency of a controller.

use rotorlead::settings::Pulse;
use rotorlead_design::{Chain, ChainPhase, Latency};
use serde_json::{Value, json};

/// The latency with its steps, what they are computed from, and what of it the holds of a sampled chain stand for, in seconds.
#[must_use]
pub fn latency_json(latency: &Latency, chain: Chain, phases: &[ChainPhase]) -> Value {
    let pulse = |pulse: Pulse| json!({ "protocol": pulse.protocol.name(), "frame_hz": pulse.frame_hz });
    let total = latency.total();
    let mut json = json!({
        "mean_s": total.mean_s,
        "worst_s": total.worst_s,
        "input": pulse(latency.input),
        "output": pulse(latency.output),
        "output_start": latency.frame_start,
        "loop_rate_hz": latency.loop_rate_hz,
        "steps": {
            "input_pulse": latency.input_pulse,
            "input_filter": latency.input_filter,
            "tick": latency.tick,
            "output_frame": latency.output_frame,
        },
    });
    if let (Chain::Sampled { .. }, Some(phase)) = (chain, phases.first()) {
        json["counted"] = json!({
            "input_pulse_s": latency.input_pulse.mean_s,
            "input_filter_s": latency.input_filter.mean_s,
            "tick_and_frame_uncompensated_s": phase.uncompensated.waits_s,
            "tick_and_frame_compensated_s": phase.compensated.waits_s,
        });
    }
    json
}
