//! The response of a run by its levels and its lag.

use super::TimeConstantCurve;
use super::fit::LagFit;
use super::plateaus::{Direction, Plateau};
use super::response::{Segment, simulate};
use super::run::Run;
use super::step::{Step, StepLag};

/// The level of a plateau and the delay to it, by what is known of the step that leads to it.
pub(super) type LevelAndDelay<'a> = dyn Fn(&Plateau, Option<&StepLag>) -> (f64, f64) + 'a;

/// The response of a run; `level_and_delay` gives both for each plateau and, where it was fitted, the step that leads to it.
pub(super) fn simulate_run(
    run: &Run,
    time_s: &[f64],
    steps: &[Step],
    lag: &LagFit,
    curve: Option<&TimeConstantCurve>,
    level_and_delay: &LevelAndDelay<'_>,
) -> Vec<f64> {
    let rows = run.rows();
    let segments: Vec<Segment> = run
        .plateaus
        .iter()
        .map(|plateau| {
            let step = steps.binary_search_by_key(&plateau.rows.start, |step| step.row).ok().and_then(|k| steps[k].lag);
            let (level, delay_s) = level_and_delay(plateau, step.as_ref());
            // Beyond the steps that it rests on, the curve is not to be trusted further than its ends.
            let of_curve = curve.map(|curve| {
                let at = plateau.command.clamp(curve.range.0, curve.range.1);
                curve.toward(at, plateau.direction.unwrap_or(Direction::Up)).value
            });
            let time_constant_s = of_curve.or(step.map(|step| step.time_constant_s.value)).unwrap_or(f64::NAN);
            let bend = lag.bend_per_s * time_constant_s;
            Segment { from_s: plateau.change_s, level, time_constant_s, delay_s, bend, lagged: lag.lagged }
        })
        .collect();
    let mut simulated = vec![0.0; rows.len()];
    // The fit went through the same steps, so they have a response; should rounding say otherwise, the
    // percentages say so too.
    let _ = simulate(&segments, &time_s[rows], &mut simulated);
    simulated
}
