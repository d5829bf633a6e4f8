//! What predicted bandwidths and phases count.

use rotorlead::settings::Pulse;
use rotorlead_design::{Chain, FrameStart};
use rotorlead_numerics::sample::extent;
use rotorlead_plant::ActiveEffect;
use rotorlead_plant::effect::Linearity;

use super::BandwidthResult;

/// The pure delays, the holds of a sampled chain, and the effects, a sentence each.
pub(super) fn counted(found: &BandwidthResult, chain: Chain) -> Vec<String> {
    std::iter::once(delays(found)).chain(holds(found, chain)).chain(effects(&found.effects)).collect()
}

fn delays(found: &BandwidthResult) -> String {
    let latency = &found.latency;
    let total = latency.total();
    let pulse = |pulse: Pulse| format!("{} at {} Hz", pulse.protocol.name(), pulse.frame_hz);
    let start = match latency.frame_start {
        FrameStart::FollowsInput => "frames follow the input",
        FrameStart::FreeRunning => "frames run freely",
    };
    format!(
        "Phases are of the whole chain, with its pure delays: {:.2} ms on average from pulse in to pulse out ({:.2} at most; {} in, {} \
         out, {start}), and {} in the model. A rate controller's crossover has to lie below -90 degrees.",
        1e3 * total.mean_s,
        1e3 * total.worst_s,
        pulse(latency.input),
        pulse(latency.output),
        dead_times(found),
    )
}

/// What of the latency the holds of a sampled chain stand for; nothing of a continuous one.
fn holds(found: &BandwidthResult, chain: Chain) -> Option<String> {
    let latency = &found.latency;
    let (Chain::Sampled { esc_frame_hz, .. }, Some(phase)) = (chain, found.phases.first()) else { return None };
    let ms = |delay_s: f64| format!("{:.2} ms", 1e3 * delay_s);
    let [passed_on, filtered] = [phase.uncompensated.waits_s, phase.compensated.waits_s].map(ms);
    let waits = match (latency.frame_start, esc_frame_hz) {
        (_, None) => format!("{filtered} for tick and output frame: no --esc-frame is held"),
        (FrameStart::FreeRunning, Some(hz)) => format!(
            "{filtered} for the holds of tick and ESC frame at {hz} Hz, in place of {} of waits",
            ms(latency.tick.mean_s + latency.output_frame.mean_s)
        ),
        (FrameStart::FollowsInput, Some(hz)) => format!(
            "{passed_on} for the tick without the compensator, and {filtered} with it: what the filter comes to between \
             two pulses waits for the next frame, half an ESC frame at {hz} Hz"
        ),
    };
    let known = ms(latency.input_pulse.mean_s + latency.input_filter.mean_s);
    Some(format!("With --sampled that is {known} for the pulse in and its filter, and {waits}."))
}

/// The dead time of the model, in milliseconds.
fn dead_times(found: &BandwidthResult) -> String {
    let (low, high) = extent(&found.phases.iter().map(|phase| 1e3 * phase.model_dead_time_s).collect::<Vec<_>>());
    match (format!("{low:.2}"), format!("{high:.2}")) {
        (_, high) if found.phases.is_empty() || high == "0.00" => "no dead time".to_owned(),
        (low, high) if low == high => format!("{high} ms of dead time"),
        (low, high) => format!("{low} to {high} ms of dead time"),
    }
}

/// What of the model's effects is in the bandwidths; nothing of a model without any.
fn effects(effects: &[ActiveEffect]) -> impl Iterator<Item = String> {
    let said = |(linearities, said): (&[Linearity], &str)| {
        let kinds = effects.iter().map(ActiveEffect::kind).filter(|kind| linearities.contains(&kind.linearity));
        let ids: Vec<&str> = kinds.map(|kind| kind.id).collect();
        (!ids.is_empty()).then(|| format!("{said}: {}.", ids.join(", ")))
    };
    [
        (&[Linearity::Exact, Linearity::Mean][..], "Counted"),
        (&[Linearity::SmallSignal], "Counted for small deviations from u_nom only"),
        (&[Linearity::Absent], "Left out, since it has no frequency response"),
    ]
    .into_iter()
    .filter_map(said)
    .collect::<Vec<_>>()
    .into_iter()
}
