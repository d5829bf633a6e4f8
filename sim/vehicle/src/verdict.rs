//! What the comparison says in words, bad news too.

use crate::benefit::Benefit;
use crate::study::{AtLatency, ForceRow, Row, Study};

/// Beyond this angle, degrees, a vehicle is turned over, and no axis is on its own. Chosen: 29 % of the lift is gone, `1 - cos`; lower
/// warns of what recovers, higher lets peaks pass that mean nothing.
const TURNED_OVER_DEG: f64 = 45.0;
/// A gain set is limited by noise from this part of the limit on. Chosen: the search ends within 1e-6 of the limit that stops it; a wider
/// part takes in gains that the margins stop.
const AT_LIMIT: f64 = 0.99;

impl AtLatency {
    /// The verdict on `rows`, which are this latency's, in one sentence that begins with `tuned`, the bad news first.
    fn verdict(&self, rows: &[Row], tuned: &str) -> Option<String> {
        let (bare, others) = rows.split_first()?;
        if rows.iter().all(|row| row.performance.is_none()) {
            let latency_ms = 1e3 * self.latency_s;
            return Some(format!(
                "{tuned}, latency {latency_ms:.1} ms. No actuator has gains that keep the margins: shorten the latency, or check noise, \
                 inertia and arm of the airframe."
            ));
        }
        let clause = |worth: Benefit| {
            let named: Vec<String> =
                others.iter().filter(|row| row.benefit(bare) == Some(worth)).map(|row| said(row, bare)).collect();
            (!named.is_empty()).then(|| format!("{}: {}", comparison(worth), named.join(", ")))
        };
        let clauses: Vec<String> =
            [Benefit::Worse, Benefit::Mixed, Benefit::Same, Benefit::Better].into_iter().filter_map(clause).collect();
        let latency_ms = 1e3 * self.latency_s;
        (!clauses.is_empty()).then(|| format!("{tuned}, latency {latency_ms:.1} ms. {}.", clauses.join(". ")))
    }
}

fn comparison(worth: Benefit) -> &'static str {
    match worth {
        Benefit::Better => "Better than none",
        Benefit::Same => "No different from none",
        Benefit::Mixed => "Better in one of the two and worse in the other",
        Benefit::Worse => "Worse than none",
    }
}

fn said(row: &Row, bare: &Row) -> String {
    let name = row.actuator.name();
    row.ratios(bare).map_or_else(
        || name.clone(),
        |ratios| format!("{name} (bandwidth x{:.2}, peak x{:.2})", ratios.bandwidth, ratios.disturbance_peak),
    )
}

/// What the study says, a paragraph each: what compensation is worth at one operating point and over the range, for each latency;
/// what it does to lateral force; and what a latency does to gains that were tuned for another.
#[must_use]
pub fn findings(study: &Study, hover: f64, range: [f64; 2]) -> Vec<String> {
    let mut found = Vec::new();
    for at in &study.latencies {
        found.extend(at.verdict(&at.hover, &format!("Tuned for {hover:.2} alone")));
        found.extend(at.verdict(&at.range, &format!("One gain set for {:.2} to {:.2}", range[0], range[1])));
        found.extend(noise(at, hover, study.rule.actuator_noise));
    }
    found.extend(turned_over(study));
    found.extend(lateral(study));
    if let [first, .., last] = &study.latencies[..] {
        found.extend(kept_gains(first, last, study.rule.max_sensitivity));
    }
    found
}

/// Said where the noise and not the margins limits the bare actuator at hover: there the comparison rests on the noise.
fn noise(at: &AtLatency, hover: f64, limit: f64) -> Option<String> {
    let bare = at.hover.first()?.performance.as_ref()?;
    let is_limited = bare.margins.actuator_noise > AT_LIMIT * limit;
    let latency_ms = 1e3 * at.latency_s;
    is_limited.then(|| {
        format!(
            "At {hover:.2}, latency {latency_ms:.1} ms, the gyro's noise limits the bare motor. With a \
             quieter gyro it gains on the others, with a noisier one it loses: give the noise that the gyro has in flight."
        )
    })
}

fn turned_over(study: &Study) -> Option<String> {
    let all = study.latencies.iter().flat_map(|at| at.hover.iter().chain(&at.range));
    let peaks = all.filter_map(|row| Some((row.actuator.name(), row.performance.as_ref()?.disturbance_peak_deg)));
    let mut names: Vec<String> = peaks.filter(|(_, peak)| *peak > TURNED_OVER_DEG).map(|(name, _)| name).collect();
    names.sort();
    names.dedup();
    (!names.is_empty()).then(|| {
        format!(
            "The disturbance turns the vehicle over with {}: by more than {TURNED_OVER_DEG} degrees, where peaks mean nothing. Lower \
             `disturbance_n_m` of [roll], or check its inertia.",
            names.join(", ")
        )
    })
}

fn lateral(study: &Study) -> Option<String> {
    let (bare, others) = study.lateral.split_first()?;
    let rise_s = bare.performance.rise_s?;
    let one = |row: &ForceRow| {
        let rise = row.performance.rise_s.map_or("never".to_owned(), |own| format!("x{:.2}", own / rise_s));
        format!("{} {rise}", row.actuator.name())
    };
    let named: Vec<String> = others.iter().map(one).collect();
    let rise_ms = 1e3 * rise_s;
    (!named.is_empty()).then(|| {
        format!(
            "Lateral force, around which no loop is closed, rises in {rise_ms:.0} ms with none. Over that: {}.",
            named.join(", ")
        )
    })
}

fn kept_gains(first: &AtLatency, last: &AtLatency, limit: f64) -> Option<String> {
    let stable: Vec<f64> = last.kept_gains.iter().filter_map(|kept| kept.max_sensitivity).collect();
    let unstable = last.kept_gains.len() - stable.len();
    let [least, most] = [f64::min, f64::max].map(|end| stable.iter().copied().reduce(end));
    let (from_ms, to_ms) = (1e3 * first.latency_s, 1e3 * last.latency_s);
    let has_grown = unstable > 0 || most.is_some_and(|most| most > limit);
    let ranges = least.zip(most).map(|(least, most)| format!("a largest sensitivity of {least:.1} to {most:.1}"));
    let unstable = (unstable > 0).then(|| format!("{unstable} loops that are not stable"));
    let both: Vec<String> = ranges.into_iter().chain(unstable).collect();
    (has_grown && !both.is_empty()).then(|| {
        format!(
            "Gains for {from_ms:.1} ms give at {to_ms:.1} ms {}, where {limit} is allowed: tune for the latency of the vehicle.",
            both.join(" and ")
        )
    })
}

/// The whole in one sentence: where the compensator does not pay, that comes first.
#[must_use]
pub fn headline(study: &Study) -> String {
    let Some(first) = study.latencies.first() else { return "Nothing was compared.".to_owned() };
    let is_any = [&first.hover, &first.range].into_iter().flatten().any(|row| row.performance.is_some());
    if !is_any {
        return "No actuator has gains that keep the margins in this vehicle.".to_owned();
    }
    let worths = |rows: &[Row]| -> Vec<Option<Benefit>> {
        let Some((bare, others)) = rows.split_first() else { return Vec::new() };
        let compensators = others.iter().filter(|row| !row.actuator.needs_a_sensor());
        compensators.map(|row| row.benefit(bare)).collect()
    };
    let [hover, range] = [worths(&first.hover), worths(&first.range)];
    let count = |all: &[Option<Benefit>], worth: Benefit| all.iter().filter(|one| **one == Some(worth)).count();
    let of = |all: &[Option<Benefit>]| {
        format!(
            "{} of {} compensators make the vehicle worse and {} make it better",
            count(all, Benefit::Worse),
            all.len(),
            count(all, Benefit::Better)
        )
    };
    let at_one = "At one hover point, where a D term can cancel the rotor's pole,";
    format!("{at_one} {}; with one gain set for the range {}.", of(&hover), of(&range))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motor_control::MotorControlKind;
    use crate::response::Margins;
    use crate::study::{KeptGains, Performance};
    use crate::tuning::{Gains, TuningRule};

    fn row(actuator: MotorControlKind, bandwidth_rad_s: f64, disturbance_peak_deg: f64) -> Row {
        let gains = Gains { rate_p_1_s: 1.0, integral_time_s: 1.0, derivative_time_s: 0.0, attitude_p_1_s: 1.0 };
        let margins = Margins { max_sensitivity: 1.6, phase_margin_deg: 50.0, actuator_noise: 0.01, bandwidth_rad_s };
        let performance = Performance {
            gains,
            margins,
            disturbance_peak_deg,
            settling_s: Some(0.1),
            disturbed: Vec::new(),
            open: None,
        };
        Row { actuator, performance: Some(performance) }
    }

    const INVERSE: MotorControlKind = MotorControlKind::Inverse { omega_f_rad_s: 150.0 };

    #[test]
    fn a_comparison_that_rests_on_the_noise_says_so() {
        let mut bare = row(MotorControlKind::None, 80.0, 1.0);
        let at = |bare: &Row| AtLatency {
            latency_s: 0.002,
            hover: vec![bare.clone()],
            range: Vec::new(),
            without_d: Vec::new(),
            kept_gains: Vec::new(),
        };
        assert_eq!(noise(&at(&bare), 0.5, 0.02), None);
        bare.performance.as_mut().unwrap().margins.actuator_noise = 0.0199;
        let said = noise(&at(&bare), 0.5, 0.02).unwrap();
        assert!(said.contains("limits the bare motor"), "{said}");
    }

    #[test]
    fn a_vehicle_without_gains_or_turned_over_is_no_comparison() {
        let at = |rows: Vec<Row>| AtLatency {
            latency_s: 0.1,
            hover: rows.clone(),
            range: rows,
            without_d: Vec::new(),
            kept_gains: Vec::new(),
        };
        let study = |rows: Vec<Row>| Study {
            rule: TuningRule::default(),
            latencies: vec![at(rows)],
            lateral: Vec::new(),
            refused: Vec::new(),
        };
        let none = Row { actuator: MotorControlKind::None, performance: None };
        let without = study(vec![none.clone(), Row { actuator: INVERSE, performance: None }]);
        assert!(headline(&without).starts_with("No actuator has gains"));
        assert!(findings(&without, 0.5, [0.4, 0.6])[0].contains("shorten the latency"));
        let over = study(vec![none, row(INVERSE, 10.0, 60.0)]);
        let found = findings(&over, 0.5, [0.4, 0.6]);
        assert!(found.iter().any(|one| one.contains("turns the vehicle over with inverse 150")), "{found:?}");
    }

    #[test]
    fn bad_news_come_first_and_by_name() {
        let rows = |bandwidth: f64| {
            vec![
                row(MotorControlKind::None, 80.0, 1.0),
                row(INVERSE, 100.0, 0.5),
                row(MotorControlKind::Lead, bandwidth, 2.0),
            ]
        };
        let at = |latency_s: f64, sensitivity: Option<f64>| AtLatency {
            latency_s,
            hover: rows(60.0),
            range: rows(80.0),
            without_d: Vec::new(),
            kept_gains: vec![KeptGains { actuator: INVERSE, max_sensitivity: sensitivity }],
        };
        let study = Study {
            rule: TuningRule::default(),
            latencies: vec![at(0.002, Some(1.6)), at(0.012, Some(4.8))],
            lateral: Vec::new(),
            refused: Vec::new(),
        };
        let found = findings(&study, 0.5, [0.4, 0.65]);
        assert_eq!(
            found[0],
            "Tuned for 0.50 alone, latency 2.0 ms. Worse than none: lead (bandwidth x0.75, peak x2.00). Better than none: \
             inverse 150 (bandwidth x1.25, peak x0.50)."
        );
        assert!(
            found[1].starts_with("One gain set for 0.40 to 0.65, latency 2.0 ms. Worse than none:"),
            "{}",
            found[1]
        );
        assert!(!found.iter().any(|one| one.contains("quieter gyro")), "{found:?}");
        let last = found.last().unwrap();
        assert!(
            last.contains("at 12.0 ms a largest sensitivity of 4.8") && last.contains("tune for the latency"),
            "{last}"
        );
        assert!(
            headline(&study).contains("1 of 2 compensators make the vehicle worse and 1 make it better"),
            "{}",
            headline(&study)
        );
    }
}
