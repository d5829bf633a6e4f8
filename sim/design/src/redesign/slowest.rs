//! Model with every time constant at the upper end of its 95 % interval.
//!
//! Where a table of an inverse is shorter than the time constant of a rotor, the response falls early to their ratio and goes on level
//! from there. Near 3 dB a percent of the ratio moves the bandwidth by many, so that the likeliest bandwidth is not one to rely on.

use rotorlead_plant::Model;
use rotorlead_plant::effect::{asymmetric_lag, parameter_error};

use rotorlead_numerics::statistics::STANDARD_ERRORS_OF_95_PERCENT;

/// `model` with each time constant at the upper end of its 95 % interval, and each direction of an unequal lag as far from the other as
/// the records allow; `None` where nothing is known of that.
pub(super) fn slowest_within_interval(model: &Model) -> Option<Model> {
    let mut slowest = model.clone();
    let mut is_known = false;
    for point in &mut slowest.points {
        if let Some(std) = point.time_constant_s_std {
            point.time_constant_s = longer(point.time_constant_s, std);
            is_known = true;
        }
    }
    for effect in &mut slowest.effects {
        let (name, offset) = match effect.kind.as_str() {
            // One more than the factor that it is.
            parameter_error::ID => ("time_constant_error", 1.0),
            asymmetric_lag::ID => ("ratio", 0.0),
            _ => continue,
        };
        let (Some(value), Some(&std)) = (effect.parameters.get_mut(name), effect.std.get(name)) else { continue };
        let factor = *value + offset;
        let farther = longer(factor, std);
        let is_slower_up = name == "ratio" && factor < 1.0;
        *value = if is_slower_up { factor * factor / farther } else { farther } - offset;
        is_known = true;
    }
    is_known.then_some(slowest)
}

/// The upper end of the interval of what is known as a ratio.
fn longer(value: f64, std: f64) -> f64 {
    value * (STANDARD_ERRORS_OF_95_PERCENT * std / value).exp()
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::Effect;
    use rotorlead_plant::testing::table_1;

    use super::*;

    #[test]
    fn the_slowest_is_two_standard_errors_away() {
        assert_eq!(slowest_within_interval(&table_1()), None);
        let mut model = table_1();
        model.points[1].time_constant_s_std = Some(0.01 * model.points[1].time_constant_s);
        let found = slowest_within_interval(&model).unwrap();
        assert!((found.points[1].time_constant_s / model.points[1].time_constant_s - 1.0198).abs() < 1e-4);
        assert_eq!(found.points[0], model.points[0]);
    }

    #[test]
    fn unequal_directions_go_apart() {
        let with = |kind: &str, name: &str, value: f64| {
            let of = |value: f64| [(name.to_owned(), value)].into();
            let effect = Effect { kind: kind.to_owned(), parameters: of(value), std: of(0.01 * value.abs()) };
            let found = slowest_within_interval(&Model { effects: vec![effect], ..table_1() }).unwrap();
            found.effects[0].parameters[name]
        };
        assert!((with("asymmetric_lag", "ratio", 1.5) / 1.5 - 1.0198).abs() < 1e-4);
        assert!((with("asymmetric_lag", "ratio", 0.6) / 0.6 - 1.0 / 1.0198).abs() < 1e-4);
        assert!(
            (with("parameter_error", "time_constant_error", 0.2) - (1.2 * (0.00392_f64 / 1.2).exp() - 1.0)).abs()
                < 1e-12
        );
    }
}
