//! `rotorlead identify` on steps: one lag beside a lag that depends on the speed, on steps that they have not seen.

use std::fmt::Write as _;

use rotorlead_identify::steps::{LawComparison, LawFit};
use rotorlead_results::laws_table;

/// The comparison for people.
pub fn describe(found: &LawComparison) -> String {
    let mut text = laws_table(found).text();
    let mut say = |line: String| {
        text.push_str(&line);
        text.push('\n');
    };
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
