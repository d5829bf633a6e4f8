//! Of steps: one lag beside a lag that depends on the speed, on steps that they have not seen.

use rotorlead_answer::{Table, Typed, Unit, Weight, table_of};
use rotorlead_identify::lag::steps::{HeldOut, LawComparison, LawFit};

/// A split of the steps, and the fits in percent.
struct Split {
    words: String,
    one_lag: f64,
    speed_dependent: f64,
    ceiling: f64,
    /// Of the levels that were measured alone.
    on_measured: Option<(f64, f64)>,
}

impl Split {
    fn of(split: &HeldOut) -> Self {
        Self {
            words: split.split.words().to_owned(),
            one_lag: split.one_lag_percent,
            speed_dependent: split.speed_dependent_percent,
            ceiling: split.ceiling_percent,
            on_measured: Some((
                split.one_lag_on_measured_levels_percent,
                split.speed_dependent_on_measured_levels_percent,
            )),
        }
    }
}

/// Both laws, on those steps that they were fitted to and on those that they have not seen.
pub(super) fn table(found: &LawComparison) -> Table {
    let all = Split {
        words: "all -> all".to_owned(),
        one_lag: found.one_lag.fit_percent,
        speed_dependent: found.speed_dependent.fit_percent,
        ceiling: found.ceiling_percent,
        on_measured: None,
    };
    let rows: Vec<Split> = std::iter::once(all).chain(found.held_out.iter().map(Split::of)).collect();
    let percent = |key, heading: &str, get: fn(&Split) -> Option<f64>| Typed::new(key, heading, Unit::PERCENT, 2, get);
    let columns = [
        Typed::words("split", "fitted on -> judged on", |split: &Split| split.words.clone()),
        percent("one_lag_percent", "one lag", |split| Some(split.one_lag)),
        percent("speed_dependent_percent", "speed-dep.", |split| Some(split.speed_dependent)),
        percent("ceiling_percent", "ceiling", |split| Some(split.ceiling)),
        percent("one_lag_on_measured_levels_percent", "one lag, measured levels", |split| Some(split.on_measured?.0)),
        percent("speed_dependent_on_measured_levels_percent", "speed-dep., measured levels", |split| {
            Some(split.on_measured?.1)
        }),
    ];
    let caption = "Fit of the whole run, one quadratic static map, no step adjusted by itself";
    Table { notes: notes(found), weight: Weight::Detail, ..table_of("laws", caption, &columns, &rows) }
}

fn notes(found: &LawComparison) -> Vec<String> {
    let (one_lag, speed_dependent) = (&found.one_lag, &found.speed_dependent);
    let drag = speed_dependent.drag_share;
    let (low, high) = drag.interval(0.95);
    let of_drag = if speed_dependent.has_intervals() { format!(" ({low:.2} to {high:.2})") } else { String::new() };
    let mut notes = vec![
        format!("one lag: {}", law(one_lag)),
        format!(
            "speed-dependent: {} at the highest level, {:.1} ms at a quarter of it; drag's share of the rate {:.2}{of_drag}",
            law(speed_dependent),
            1e3 * speed_dependent.time_constant_at(0.25 * speed_dependent.reference),
            drag.value,
        ),
    ];
    if !one_lag.has_intervals() || !speed_dependent.has_intervals() {
        notes.push(format!(
            "{} levels are too few for intervals: one lag takes {}, the other {}",
            one_lag.plateaus,
            one_lag.fewest_plateaus(),
            speed_dependent.fewest_plateaus()
        ));
    }
    if let Some(share) = found.up_down_difference {
        notes.push(format!(
            "the same command settles {:.1} % apart when reached from above: no map of the command alone has both",
            100.0 * share
        ));
    }
    notes
}

fn law(fit: &LawFit) -> String {
    let (delay_ms, time_constant_ms) = (1e3 * fit.delay_s.value, 1e3 * fit.time_constant_s.value);
    if !fit.has_intervals() {
        return format!("delay {delay_ms:.1} ms, time constant {time_constant_ms:.1} ms");
    }
    let (low, high) = fit.time_constant_s.interval_of_logarithm(0.95);
    let (soonest, latest) = fit.delay_s.interval(0.95);
    format!(
        "delay {delay_ms:.1} ms ({:.1} to {:.1}), time constant {time_constant_ms:.1} ms ({:.1} to {:.1})",
        1e3 * soonest,
        1e3 * latest,
        1e3 * low,
        1e3 * high
    )
}
