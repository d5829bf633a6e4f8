//! What takes the worth from whatever a model and a compensator promise together.

use rotorlead_assess::dead_time_remedy;
use rotorlead_design::{BandwidthPoint, ChainPhase};
use rotorlead_plant::{CompensatorDesign, CompensatorProvenance, Model, Readiness};
use rotorlead_records::Finding;

use crate::bandwidth::tables::bandwidth_text;

/// Said of a model that is not ready: whatever is built on it rests on that.
#[must_use]
pub fn judged(model: &Model) -> Option<Finding> {
    let judgement = model.judgement().filter(|judgement| judgement.state != Readiness::Ready)?;
    Some(Finding::warning(format!("the model was judged when it was identified, as {judgement}"), None))
}

/// Said of a compensator whose file names another model: what is predicted with this one holds for another motor.
#[must_use]
pub fn warn_of_another_model(compensator: &CompensatorDesign, model: &Model) -> Option<Finding> {
    let (named, this) = (compensator.provenance.as_ref()?, CompensatorProvenance::new(model));
    (named.model_crc32 != this.model_crc32).then(|| {
        warning(
            format!("the compensator was designed for {named}, and this is {this}"),
            "design it for this one, or give the model that it was designed for",
        )
    })
}

/// What is to be known before numbers of a model, with a compensator in front of it, are used elsewhere.
#[must_use]
pub fn export_warnings(model: &Model, compensator: Option<&CompensatorDesign>) -> Vec<String> {
    let other = compensator.and_then(|design| warn_of_another_model(design, model));
    judged(model).into_iter().chain(other).map(|finding| finding.sentence()).collect()
}

/// What takes the worth from whatever is promised: that the model is no lag or not known to be one, and that dead time takes the gain.
/// `None` where neither is so.
pub(crate) fn doubts_in_short(model: &Model, points: &[BandwidthPoint], phases: &[ChainPhase]) -> Option<String> {
    let state = model.judgement().map(|judgement| judgement.state).filter(|state| *state >= Readiness::MeasureAgain);
    let lost = points.iter().zip(phases).filter(|(point, phase)| phase.is_dead_time_limited(point)).count();
    let of_dead_time = (lost > 0).then(|| {
        format!("For a loop around the motor dead time takes what is gained at {lost} of {} points.", points.len())
    });
    let said: Vec<String> =
        state.map(|state| format!("The model was judged: {state}.")).into_iter().chain(of_dead_time).collect();
    (!said.is_empty()).then(|| said.join(" "))
}

/// Said where dead time takes the use from what the compensator gains ([`ChainPhase::is_dead_time_limited`]), with the numbers of
/// the point that it takes most from.
pub(crate) fn lost_gain(points: &[BandwidthPoint], phases: &[ChainPhase]) -> Option<Finding> {
    let lost: Vec<_> = points.iter().zip(phases).filter(|(point, phase)| phase.is_dead_time_limited(point)).collect();
    let lag_deg = |(point, phase): &(&BandwidthPoint, &ChainPhase)| {
        (point.compensated.reached_rad_s() * phase.dead_time_s()).to_degrees()
    };
    let worst = lost.iter().max_by(|a, b| lag_deg(a).total_cmp(&lag_deg(b)))?;
    let (point, phase) = worst;
    let whole = phase.compensated.phase_deg.map(|deg| format!(", and the phase of the whole chain is {deg:.0}"));
    let cell = |bandwidth| bandwidth_text(bandwidth, 1);
    let message = format!(
        "for a loop around the motor dead time makes the gained bandwidth worthless at {} of {} points. At u_nom {:.3} the compensator \
         promises {} rad/s instead of {}, but the dead time of {:.1} ms (model {:.1}, pulse in to pulse out {:.1}) alone lags {:.0} \
         degrees there{}. A controller can use the chain up to {} rad/s, where it lags 90 degrees ({} without the compensator)",
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
    );
    Some(Finding::warning(message, Some(dead_time_remedy(phase))))
}

pub(crate) fn warning(message: String, remedy: &str) -> Finding {
    Finding::warning(message, Some(remedy.to_owned()))
}
