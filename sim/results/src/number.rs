//! Numbers with their standard errors.

use rotorlead_answer::{Cell, with_std};
use rotorlead_identify::estimate::Estimate;
use rotorlead_plant::effect::{Parameter, Scale};

/// The interval that a parameter is looked at in where its bounds may say as much. Standard: 95 %, as of every interval that is printed.
const LEVEL: f64 = 0.95;

/// `u_nom 0.4`: a nominal command to a thousandth, which is a microsecond of its pulse.
#[must_use]
pub fn at_nominal(nominal: f64) -> String {
    format!("u_nom {}", (1e3 * nominal).round() / 1e3)
}

/// A value with its standard error, both times `scale`.
pub(crate) fn estimate_cell(value: f64, std: Option<f64>, scale: f64, digits: usize) -> Cell {
    Cell::shown(scale * value, with_std(value, std, scale, digits).replace("+-", "±"))
}

/// A parameter of an effect with its standard error and unit; where the data say no more than its bounds do, these. One that is positive and
/// may as well be nothing has no value: only what it is at most.
#[must_use]
pub fn parameter_with_std(parameter: &Parameter, estimate: &Estimate) -> String {
    let ((least, most), (low, high)) = (parameter.possible, estimate.interval(LEVEL));
    if most.is_finite() && low <= least && high >= most {
        return format!("not known, {least} to {most} {}", parameter.unit).trim_end().to_owned();
    }
    let shown = match parameter.scale {
        Scale::Log if !is_known(parameter, estimate) && high >= parameter.plausible.1 => "not known".to_owned(),
        Scale::Log if !is_known(parameter, estimate) => format!("at most {} {}", significant(high), parameter.unit),
        _ => format!("{} {}", with_std(estimate.value, Some(estimate.std), 1.0, 4), parameter.unit),
    };
    shown.trim_end().to_owned()
}

/// Whether the data tell more than how large a positive parameter is at most.
pub(crate) fn is_known(parameter: &Parameter, estimate: &Estimate) -> bool {
    parameter.scale == Scale::Linear || estimate.interval(LEVEL).0 > 0.0
}

/// Two significant digits, three of a number that starts with a one.
pub(crate) fn significant(value: f64) -> String {
    let leading = value / 10_f64.powf(value.log10().floor());
    let significant = if leading < 2.0 { 3 } else { 2 };
    let decimals = (significant - 1 - value.log10().floor() as i32).clamp(0, 6);
    format!("{value:.*}", decimals as usize)
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::Catalog;

    use super::{Estimate, parameter_with_std};

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
        let kind = catalog.find("slew_limit").expect("it is in the catalog");
        let shown =
            |index: usize, value, std| parameter_with_std(&kind.parameters[index], &Estimate::normal(value, std));
        assert_eq!(shown(0, 489.0, 1991.0), "not known");
        assert_eq!(shown(0, 1.0, 0.01), "1.000 +- 0.010 duty/s");
        assert_eq!(shown(1, 0.002, 0.0083), "at most 0.0183");
    }
}
