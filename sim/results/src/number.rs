//! Numbers with their standard errors.

use rotorlead_identify::Estimate;
use rotorlead_plant::effect::Parameter;

/// The interval that a parameter is looked at in where its bounds may say as much.
const LEVEL: f64 = 0.95;

/// A value and its standard error, both times `scale`, to the second significant digit of the error; with `digits` decimals
/// where there is no error to go by.
#[must_use]
pub fn with_std(value: f64, std: Option<f64>, scale: f64, digits: usize) -> String {
    let value = scale * value;
    match std.map(|std| scale.abs() * std) {
        // An error of this size leaves no digit of the value in its place.
        Some(std) if std >= 1e6 => format!("{value:.1e} +- {std:.1e}"),
        Some(std) if std.is_finite() && std > 0.0 => {
            // From 1e-9 to 1e6 this is -9 to 5.
            let magnitude = std.max(1e-9).log10().floor() as i32;
            let digits = usize::try_from(1 - magnitude).unwrap_or(0);
            format!("{value:.digits$} +- {std:.digits$}")
        }
        Some(std) => format!("{value:.digits$} +- {std:.0}"),
        None => format!("{value:.digits$}"),
    }
}

/// `u_nom 0.4`: a nominal command to a thousandth, which is a microsecond of its pulse.
#[must_use]
pub fn at_nominal(nominal: f64) -> String {
    format!("u_nom {}", (1e3 * nominal).round() / 1e3)
}

/// A parameter of an effect with its standard error and unit; where the data say no more than its bounds do, these.
#[must_use]
pub fn parameter_with_std(parameter: &Parameter, estimate: &Estimate) -> String {
    let ((least, most), (low, high)) = (parameter.possible, estimate.interval(LEVEL));
    if most.is_finite() && low <= least && high >= most {
        return format!("not known, {least} to {most} {}", parameter.unit).trim_end().to_owned();
    }
    format!("{} {}", with_std(estimate.value, Some(estimate.std), 1.0, 4), parameter.unit).trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::Catalog;

    use super::{Estimate, parameter_with_std, with_std};

    #[test]
    fn a_parameter_of_which_the_data_say_no_more_than_its_bounds_is_not_known() {
        let catalog = Catalog::standard();
        let kind = catalog.find("quadratic_thrust").expect("it is in the catalog");
        let shown =
            |index: usize, value, std| parameter_with_std(&kind.parameters[index], &Estimate::normal(value, std));
        assert_eq!(shown(1, 1.0, 3.1), "not known, 0 to 1");
        assert_eq!(shown(1, 1.0, 0.31), "1.00 +- 0.31");
        assert_eq!(shown(0, 1.0, 3.1), "1.0 +- 3.1 1/duty");
        assert_eq!(shown(0, 1.0, 31.0), "not known, -50 to 50 1/duty");
    }

    #[test]
    fn the_error_has_two_digits_and_the_value_as_many_decimals() {
        assert_eq!(with_std(7.07204, Some(0.01092), 1.0, 4), "7.072 +- 0.011");
        assert_eq!(with_std(0.059_741, Some(0.000_126), 1e3, 2), "59.74 +- 0.13");
        assert_eq!(with_std(28_832.4, Some(153.7), 1.0, 4), "28832 +- 154");
        assert_eq!(with_std(60.005_554, Some(0.000_072_7), 1.0, 3), "60.005554 +- 0.000073");
        assert_eq!(with_std(3.28e10, Some(9.47e18), 1.0, 3), "3.3e10 +- 9.5e18");
        assert_eq!(with_std(1.5, Some(0.0), 1.0, 3), "1.500 +- 0");
        assert_eq!(with_std(1.5, Some(f64::NAN), 1.0, 3), "1.500 +- NaN");
        assert_eq!(with_std(1.5, None, 1.0, 3), "1.500");
    }
}
