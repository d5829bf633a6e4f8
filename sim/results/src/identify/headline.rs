//! What identification finds, in one sentence.

use rotorlead_identify::estimate::Estimate;
use rotorlead_identify::identification::{Identification, Lags};
use rotorlead_identify::lag::steps::{Direction, StaircaseFit};
use rotorlead_numerics::sample::extent;
use rotorlead_plant::{Judgement, Point};

/// The time constants, the dead time, how well they explain the records, and whether a compensator may be built on them.
pub fn headline(identified: &Identification, judgement: &Judgement) -> String {
    let lag = match &identified.lags {
        Lags::Steps(fit) => steps_headline(fit),
        Lags::Multisines(_) | Lags::Chirps(_) | Lags::Flights(_) => points_headline(&identified.model.points),
        Lags::None => {
            let points = identified.static_map.as_ref().map_or(0, |(_, fit)| fit.points);
            format!("static map of {points} steady points, no lag")
        }
    };
    format!("{lag}: {}", judgement.state)
}

/// The lag of the steps, averaged over those in one direction.
fn steps_headline(fit: &StaircaseFit) -> String {
    let average = |(direction, way)| {
        let tau = fit.curve.as_ref()?.average(direction)?;
        let range = range_ms(tau.interval_of_logarithm(0.95));
        Some((format!("{:.0} ms {way}", 1e3 * tau.value), range))
    };
    let known: Vec<(String, String)> =
        [(Direction::Up, "up"), (Direction::Down, "down")].into_iter().filter_map(average).collect();
    let lag = match &known[..] {
        [] => "time constant unknown".to_owned(),
        _ => {
            let (lags, ranges): (Vec<String>, Vec<String>) = known.into_iter().unzip();
            format!("{} (95 %: {})", lags.join(", "), ranges.join(" and "))
        }
    };
    let (low, high) = fit.delay_s.interval(0.95);
    // Rounded, a little less than nothing is nothing, and has no sign.
    let most_ms = (1e3 * high).round() + 0.0;
    let delay = if fit.delay_s.value <= 0.0 && most_ms < 0.0 {
        format!("no dead time (the response is {:.0} ms ahead of its command)", -1e3 * fit.delay_s.value)
    } else if fit.delay_s.value <= 0.0 {
        format!("no dead time ({most_ms:.0} ms at most)")
    } else {
        format!("dead time {:.0} ms ({})", 1e3 * fit.delay_s.value, range_ms((low, high)))
    };
    format!("{lag}, {delay}, fit {:.1} % of a possible {:.1} %", fit.fit_percent, fit.ceiling_percent)
}

fn points_headline(points: &[Point]) -> String {
    let tau = |point: &Point| Estimate::normal(point.time_constant_s, point.time_constant_s_std.unwrap_or(f64::NAN));
    let (low, high) = extent(&points.iter().map(|point| point.nominal).collect::<Vec<f64>>());
    let delays: Vec<f64> = points.iter().map(|point| point.delay_s).collect();
    let in_ms = |delay_s: f64| format!("{:.1} ms", 1e3 * delay_s);
    let delay = match extent(&delays) {
        (shortest, longest) if longest > 0.0 => {
            let up_to = if in_ms(shortest) == in_ms(longest) { "" } else { "up to " };
            format!("dead time {up_to}{}", in_ms(longest))
        }
        _ => "no dead time".to_owned(),
    };
    let fits: Vec<f64> = points.iter().filter_map(|point| point.fit_frequency_percent).collect();
    let fit = match extent(&fits) {
        _ if fits.is_empty() => String::new(),
        (worst, _) => format!(", fit {worst:.1} % in frequency{}", if fits.len() > 1 { " or better" } else { "" }),
    };
    let at = if low < high { format!("at u_nom {low} to {high}") } else { format!("at u_nom {low}") };
    format!("{} {at}, {delay}{fit}", range_text("time constants", points.iter().map(tau)))
}

/// One number or two, as the estimates go.
fn range_text(what: &str, estimates: impl Iterator<Item = Estimate>) -> String {
    let values: Vec<f64> = estimates.map(|estimate| 1e3 * estimate.value).collect();
    match extent(&values) {
        _ if values.is_empty() => format!("{what} unknown"),
        (low, high) if format!("{low:.0}") == format!("{high:.0}") => format!("{what} of {low:.0} ms"),
        (low, high) => format!("{what} of {low:.0} to {high:.0} ms"),
    }
}

fn range_ms((low, high): (f64, f64)) -> String {
    format!("{:.0} to {:.0}", 1e3 * low, 1e3 * high)
}
