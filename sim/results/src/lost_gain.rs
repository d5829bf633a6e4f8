//! The warning that dead time takes the use from what a compensator gains.

use rotorlead_identify::design::{BandwidthPoint, ChainPhase};

use super::bandwidths::bandwidth_text;

/// Said where dead time takes the use from what the compensator gains ([`ChainPhase::is_gain_lost`]), with the numbers of
/// the point that it takes most from.
#[must_use]
pub fn lost_gain(points: &[BandwidthPoint], phases: &[ChainPhase]) -> Option<String> {
    let lost: Vec<_> = points.iter().zip(phases).filter(|(point, phase)| phase.is_gain_lost(point)).collect();
    let lag_deg = |(point, phase): &(&BandwidthPoint, &ChainPhase)| {
        (point.compensated.reached_rad_s() * phase.dead_time_s()).to_degrees()
    };
    let worst = lost.iter().max_by(|a, b| lag_deg(a).total_cmp(&lag_deg(b)))?;
    let (point, phase) = worst;
    let whole = phase.compensated.phase_deg.map(|deg| format!(", and the phase of the whole chain is {deg:.0}"));
    let cell = |bandwidth| bandwidth_text(bandwidth, 1);
    Some(format!(
        "warning: for a loop around the motor dead time makes the gained bandwidth worthless at {} of {} points. At u_nom {:.3} the compensator promises {} \
         rad/s instead of {}, but the dead time of {:.1} ms (model {:.1}, pulse in to pulse out {:.1}) alone lags {:.0} degrees \
         there{}. A controller can use the chain up to {} rad/s, where it lags 90 degrees ({} without the compensator). {}",
        lost.len(),
        points.len(),
        point.nominal,
        cell(point.compensated),
        cell(point.uncompensated),
        1e3 * phase.dead_time_s(),
        1e3 * phase.model_dead_time_s,
        1e3 * phase.compensated.late_s,
        lag_deg(worst),
        whole.unwrap_or_default(),
        cell(phase.compensated.minus_90),
        cell(phase.uncompensated.minus_90),
        remedy(phase),
    ))
}

/// What to do, by the larger part of the dead time.
fn remedy(phase: &ChainPhase) -> &'static str {
    if phase.model_dead_time_s > phase.compensated.late_s {
        "Find out whether the logger or the stand's command makes the dead time: then record again without it, as with \
         `rotorlead device record`, and identify again. Where ESC and motor make it, use another ESC or protocol. A lower \
         bandwidth does not shorten it, but amplifies less noise above what can be used"
    } else {
        "Use shorter and faster pulses: --input-protocol and --output-protocol oneshot125, or a higher --input-frame with an \
         --output-frame some percent above it"
    }
}
