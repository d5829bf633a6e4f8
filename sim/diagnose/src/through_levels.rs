//! What acts on the command, ahead of a curved static map.
//!
//! Where the map of a speed is measured level by level, a step goes from one level to the next in proportion to the simulated response of a
//! straight map. A lag does so whatever the map is. A command that ramps goes through the map on its way: on a map that bends down the
//! speed begins a step up faster than a step down, which looks like unequal rates or lags. So where a ramp is named, or a mean, which looks
//! alike, the records are diagnosed once more with the measured levels as the map that the command goes through.

use rotorlead_identify::lag::steps::fit_staircase;
use rotorlead_identify::static_map::{SteadyPoints, fit_static_map};
use rotorlead_numerics::sample::median;
use rotorlead_plant::effect::{moving_average, slew_limit};
use rotorlead_plant::{Lag, OperatingCurve, StaticMap};
use rotorlead_records::{Experiment, Output, Record};

use crate::outcome::Diagnosis;

/// What may be a ramp through the map.
const THROUGH_THE_MAP: [&str; 2] = [slew_limit::ID, moving_average::ID];

/// Places between two levels at which the map is given. Chosen: a parabola that bends as much as a square root from 0.2 to 0.35 is then off
/// by `1 / 64` of what a straight line is.
const BETWEEN: usize = 8;

/// The measured levels, and between them what the polynomial of the static map says, moved by a line to what it misses them by.
fn between_levels(levels: &StaticMap, record: &Record, output: Output) -> Option<StaticMap> {
    let fit = fit_static_map(&SteadyPoints::from_record(record, output, None).ok()?).ok()?;
    let (mut command, mut response) = (levels.command[..1].to_vec(), levels.response[..1].to_vec());
    for (u, y) in levels.command.windows(2).zip(levels.response.windows(2)) {
        let missed = [0, 1].map(|end| y[end] - fit.response(u[end]).value);
        for place in 1..=BETWEEN {
            let share = place as f64 / BETWEEN as f64;
            let at = u[0] + share * (u[1] - u[0]);
            command.push(at);
            response.push(fit.response(at).value + missed[0] + share * (missed[1] - missed[0]));
        }
    }
    Some(StaticMap { command, response, lagged: levels.lagged, polynomial: None })
}

/// The measured levels as a curve with one time constant, and its lag at each nominal command, where `found` names of steps with a measured
/// map what may be a ramp.
pub(crate) fn measured_curve(experiment: &Experiment, found: &Diagnosis) -> Option<(OperatingCurve, Vec<Lag>)> {
    if !found.has_free_map || !found.effects.iter().any(|effect| THROUGH_THE_MAP.contains(&effect.kind.id)) {
        return None;
    }
    // One curve is that of one record.
    let [record] = &experiment.records[..] else { return None };
    let mut levels = fit_staircase(record, experiment.output, experiment.esc_frame_hz).ok()?.to_model("").ok()?;
    let usual_s = median(found.model.points.iter().map(|point| point.time_constant_s))?;
    for point in &mut levels.points {
        (point.time_constant_s, point.delay_s) = (usual_s, 0.0);
    }
    levels.time_constant_curve = None;
    levels.static_map = Some(between_levels(&levels.static_map?, record, experiment.output)?);
    let curve = OperatingCurve::without_effects(&levels).ok()?;
    let given = found.conditions.nominals.iter().map(|nominal| levels.at(*nominal)).collect::<Result<_, _>>().ok()?;
    Some((curve, given))
}
