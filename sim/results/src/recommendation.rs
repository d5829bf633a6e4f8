//! What to fly on a motor, for people and for programs.

use rotorlead_answer::{Cell, Column, Table};
use rotorlead_plant::Judgement;
use rotorlead_vehicle::{ActuatorKind, Candidate, Purpose, Recommendation};
use serde::Serialize;

/// Whether a compensator may be built on a model, and which one is worth it.
#[derive(Serialize)]
pub struct JudgementValues<'a> {
    #[serde(flatten)]
    judgement: &'a Judgement,
    /// Null where nothing can be compared.
    recommend: Option<&'a Recommendation>,
}

impl<'a> JudgementValues<'a> {
    /// Both in one.
    #[must_use]
    pub fn new(judgement: &'a Judgement, recommend: Option<&'a Recommendation>) -> Self {
        Self { judgement, recommend }
    }
}

/// What to fly, a sentence for each purpose; one for both where nothing is worth it for the same reason.
#[must_use]
pub fn to_fly(recommendation: &Recommendation) -> Vec<String> {
    let Recommendation { force, rate_loop, .. } = recommendation;
    if force == rate_loop && force.actuator == ActuatorKind::None {
        return vec![format!("to fly: nothing, as {}", force.why)];
    }
    let of = |purpose: Purpose| {
        let choice = recommendation.of(purpose);
        format!("to fly for {}: {}, as {}", purpose.words(), choice.actuator.name(), choice.why)
    };
    [Purpose::Force, Purpose::RateLoop].map(of).into()
}

/// Everything that was compared, with what it gains and what it costs.
#[must_use]
pub fn recommendation_table(found: &Recommendation) -> Table {
    let bare = found.candidates.first();
    let row = |one: &Candidate| {
        let ratios = bare.and_then(|bare| one.rate_loop.ratios(&bare.rate_loop));
        let for_purposes = [Purpose::Force, Purpose::RateLoop].into_iter();
        let chosen: Vec<&str> = for_purposes
            .filter(|purpose| found.of(*purpose).actuator == one.actuator)
            .map(|purpose| match purpose {
                Purpose::RateLoop => "rate loop",
                Purpose::Force => "force",
            })
            .collect();
        let rise = match one.rise_s {
            Some(rise_s) => {
                let limited = if one.is_limited { ", limited" } else { "" };
                Cell::shown(1e3 * rise_s, format!("{:.0}{limited}", 1e3 * rise_s))
            }
            None => Cell::unknown("-"),
        };
        vec![
            Cell::text(one.actuator.name()),
            Cell::optional(one.bandwidth_rad_s, 1),
            Cell::optional(one.minus_90_rad_s, 1),
            rise,
            Cell::optional(ratios.map(|ratios| ratios.bandwidth), 2),
            Cell::optional(ratios.map(|ratios| ratios.disturbance_peak), 2),
            Cell::number(one.noise_gain, 1),
            Cell::number(one.step_peak, 1),
            Cell::text(chosen.join(", ")),
        ]
    };
    Table {
        name: "recommendation".to_owned(),
        caption: "What may stand before the ESC, the slowest operating point of each: what it gains over none, and what it costs"
            .to_owned(),
        columns: vec![
            Column::new("actuator", "actuator", ""),
            Column::new("bandwidth_rad_s", "bandwidth", "rad/s"),
            Column::new("minus_90_rad_s", "-90 deg", "rad/s"),
            Column::new("rise_ms", "5 % step rises", "ms"),
            Column::new("rate_loop_bandwidth_over_none", "loop over none", ""),
            Column::new("gust_over_none", "gust over none", ""),
            Column::new("noise_gain", "noise gain", ""),
            Column::new("step_peak", "largest step", ""),
            Column::new("recommended_for", "for", ""),
        ],
        rows: found.candidates.iter().map(row).collect(), ..Table::default() }
}

/// What was not compared, a sentence each.
#[must_use]
pub fn refused(found: &Recommendation) -> Vec<String> {
    found.refused.iter().map(|one| format!("There is no {}: {}.", one.actuator.name(), one.reason)).collect()
}
