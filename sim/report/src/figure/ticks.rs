//! The values that are named along an axis.

use rotorlead_answer::Scale;

/// Values and their names, of which there are about as many as `count`.
pub(super) fn ticks(scale: &Scale, (low, high): (f64, f64), count: usize) -> Vec<(f64, String)> {
    match scale {
        Scale::Linear => linear(low, high, count),
        Scale::Degrees => degrees(low, high, count),
        Scale::Log => log(low, high, count),
        Scale::Names(names) => names.iter().enumerate().map(|(row, name)| (row as f64, name.clone())).collect(),
    }
}

fn linear(low: f64, high: f64, count: usize) -> Vec<(f64, String)> {
    let rough = (high - low) / count.max(2) as f64;
    if !(rough > 0.0 && rough.is_finite()) {
        return Vec::new();
    }
    let power = rough.log10().floor();
    let unit = 10.0_f64.powf(power);
    let steps = [0.2, 0.5, 1.0, 2.0, 5.0, 10.0].map(|factor| factor * unit);
    let named = |step: f64| (high / step).floor() - (low / step).ceil() + 1.0;
    let wide_enough = steps.iter().position(|step| *step >= rough).unwrap_or(steps.len() - 1);
    // One value alone says nothing of the scale.
    let step =
        steps[..=wide_enough].iter().copied().rev().find(|step| named(*step) >= 3.0).unwrap_or(steps[wide_enough]);
    let digits = usize::try_from(-(step.log10() + 1e-9).floor() as i64).unwrap_or(0).min(12);
    let (first, last) = ((low / step).ceil() as i64, (high / step).floor() as i64);
    // Plus zero turns a zero's minus into none.
    (first..=last).map(|k| k as f64 * step + 0.0).map(|value| (value, format!("{value:.digits$}"))).collect()
}

/// Steps of parts of a turn while there are some in the span; less is read like any other quantity.
fn degrees(low: f64, high: f64, count: usize) -> Vec<(f64, String)> {
    let rough = (high - low) / count.max(2) as f64;
    match [15.0, 30.0, 45.0, 90.0, 180.0, 360.0].into_iter().find(|step| *step >= rough) {
        Some(step) if high - low >= 3.0 * step => {
            let (first, last) = ((low / step).ceil() as i64, (high / step).floor() as i64);
            (first..=last).map(|k| k as f64 * step + 0.0).map(|value| (value, format!("{value:.0}"))).collect()
        }
        _ => linear(low, high, count),
    }
}

fn log(low: f64, high: f64, count: usize) -> Vec<(f64, String)> {
    let decades = (high / low).log10();
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let every = (decades / count.max(2) as f64).ceil().max(1.0) as i32;
    let named = |steps: &[f64]| -> Vec<(f64, String)> {
        (first..=last)
            .filter(|decade| decade.rem_euclid(every) == 0)
            .flat_map(|decade| steps.iter().map(move |step| step * 10.0_f64.powi(decade)))
            .filter(|value| (low..=high).contains(value))
            .map(|value| (value, short(value)))
            .collect()
    };
    let fine = named(&[1.0, 2.0, 3.0, 5.0, 7.0]);
    let named = if fine.len() <= count {
        fine
    } else if 3.0 * decades <= 1.5 * count as f64 {
        named(&[1.0, 2.0, 5.0])
    } else {
        named(&[1.0])
    };
    // Within a part of a decade values are as good as evenly spaced.
    if named.len() < 3 { linear(low, high, count) } else { named }
}

/// A number in few characters.
fn short(value: f64) -> String {
    if (1e-4..1e6).contains(&value) { format!("{}", (1e6 * value).round() / 1e6) } else { format!("{value:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(ticks: &[(f64, String)]) -> Vec<&str> {
        ticks.iter().map(|(_, name)| name.as_str()).collect()
    }

    #[test]
    fn even_steps_have_round_values_and_the_digits_that_they_need() {
        assert_eq!(names(&linear(0.38, 0.67, 6)), ["0.40", "0.45", "0.50", "0.55", "0.60", "0.65"]);
        assert_eq!(names(&linear(-42.0, 3.0, 6)), ["-40", "-30", "-20", "-10", "0"]);
        assert!(linear(1.0, 1.0, 6).is_empty());
        // Steps of 0.05 would name zero alone.
        assert_eq!(names(&linear(-0.048, 0.046, 2)), ["-0.04", "-0.02", "0.00", "0.02", "0.04"]);
    }

    #[test]
    fn degrees_go_by_parts_of_a_turn_while_there_are_some() {
        assert_eq!(names(&degrees(-100.0, 5.0, 5)), ["-90", "-60", "-30", "0"]);
        assert_eq!(names(&degrees(-460.0, 5.0, 6)), ["-450", "-360", "-270", "-180", "-90", "0"]);
        assert_eq!(names(&degrees(-2.0, 1.0, 5)), ["-2", "-1", "0", "1"]);
    }

    #[test]
    fn decades_are_parted_as_finely_as_there_is_room() {
        assert_eq!(names(&log(0.6, 30.0, 8)), ["1", "2", "5", "10", "20"]);
        assert_eq!(names(&log(6.2, 94.0, 6)), ["7", "10", "20", "30", "50", "70"]);
        assert_eq!(names(&log(0.9, 2e6, 6)), ["1", "100", "10000", "1e6"]);
        assert_eq!(names(&log(6.0, 16.0, 6)), ["6", "8", "10", "12", "14", "16"]);
    }
}
