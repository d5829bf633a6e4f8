//! `rotorlead identify` on steps: one lag beside a lag that depends on the speed, on steps that they have not seen.

use std::fmt::Write as _;

use rotorlead_identify::steps::{LawComparison, LawFit};
use serde_json::{Value, json};

/// The comparison for people.
pub fn describe(found: &LawComparison) -> String {
    let mut text = String::from(
        "\n% fit of the whole run, one quadratic static map, no step adjusted by itself\n                                       \
         one static map     levels as measured\n  \
         fitted on -> judged on   one lag speed-dep.  ceiling    one lag speed-dep.\n",
    );
    let mut say = |line: String| {
        text.push_str(&line);
        text.push('\n');
    };
    say(format!(
        "  {:<22} {:>9.2} {:>10.2} {:>8.2}",
        "all -> all", found.one_lag.fit_percent, found.speed_dependent.fit_percent, found.ceiling_percent
    ));
    for split in &found.held_out {
        say(format!(
            "  {:<22} {:>9.2} {:>10.2} {:>8.2} {:>10.2} {:>10.2}",
            split.split.words(),
            split.one_lag_percent,
            split.speed_dependent_percent,
            split.ceiling_percent,
            split.one_lag_on_measured_levels_percent,
            split.speed_dependent_on_measured_levels_percent,
        ));
    }
    say(format!("  one lag: {}", law(&found.one_lag)));
    let drag = found.speed_dependent.drag_share;
    let (low, high) = drag.interval(0.95);
    let of_drag =
        if found.speed_dependent.has_intervals() { format!(" ({low:.2} to {high:.2})") } else { String::new() };
    say(format!(
        "  speed-dependent: {}\n    at the highest level, {:.1} ms at a quarter of it;\n    \
         drag's share of the rate {:.2}{of_drag}",
        law(&found.speed_dependent),
        1e3 * found.speed_dependent.time_constant_at(0.25 * found.speed_dependent.reference),
        drag.value,
    ));
    if !found.one_lag.has_intervals() || !found.speed_dependent.has_intervals() {
        say(format!(
            "  {} levels are too few for intervals: one lag takes {}, the other {}",
            found.one_lag.plateaus,
            found.one_lag.fewest_plateaus(),
            found.speed_dependent.fewest_plateaus()
        ));
    }
    if let Some(share) = found.up_down_difference {
        say(format!(
            "  the same command settles {:.1} % apart when reached from above:\n    \
             no map of the command alone has both",
            100.0 * share
        ));
    }
    text
}

fn law(fit: &LawFit) -> String {
    let mut text = String::new();
    if !fit.has_intervals() {
        let (delay_ms, time_constant_ms) = (1e3 * fit.delay_s.value, 1e3 * fit.time_constant_s.value);
        return format!("delay {delay_ms:.1} ms,\n    time constant {time_constant_ms:.1} ms");
    }
    let (low, high) = fit.time_constant_s.interval_of_logarithm(0.95);
    let (soonest, latest) = fit.delay_s.interval(0.95);
    write!(
        text,
        "delay {:.1} ms ({:.1} to {:.1}),\n    time constant {:.1} ms ({:.1} to {:.1})",
        1e3 * fit.delay_s.value,
        1e3 * soonest,
        1e3 * latest,
        1e3 * fit.time_constant_s.value,
        1e3 * low,
        1e3 * high
    )
    .expect("a string takes all");
    text
}

/// The same for programs.
pub fn to_json(found: &LawComparison) -> Value {
    let law = |fit: &LawFit| {
        json!({
            "map": fit.map,
            "plateaus": fit.plateaus,
            "degrees_of_freedom": fit.has_intervals().then_some(fit.time_constant_s.dof),
            "delay_s": fit.delay_s.value,
            "delay_s_std": fit.delay_s.std,
            "time_constant_s": fit.time_constant_s.value,
            "time_constant_s_std": fit.time_constant_s.std,
            "reference": fit.reference,
            "drag_share": fit.drag_share.value,
            "drag_share_std": fit.drag_share.std,
            "fit_percent": fit.fit_percent,
        })
    };
    json!({
        "one_lag": law(&found.one_lag),
        "speed_dependent": law(&found.speed_dependent),
        "ceiling_percent": found.ceiling_percent,
        "up_down_difference": found.up_down_difference,
        "held_out": found.held_out.iter().map(|split| json!({
            "split": split.split.words(),
            "one_lag_percent": split.one_lag_percent,
            "speed_dependent_percent": split.speed_dependent_percent,
            "ceiling_percent": split.ceiling_percent,
            "one_lag_on_measured_levels_percent": split.one_lag_on_measured_levels_percent,
            "speed_dependent_on_measured_levels_percent": split.speed_dependent_on_measured_levels_percent,
        })).collect::<Vec<_>>(),
    })
}
