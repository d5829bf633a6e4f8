//! What is to be known of a design itself before it flies.

use rotorlead_design::{DesignedInverse, REACH};
use rotorlead_plant::Model;
use rotorlead_records::Finding;

use super::Designed;
use super::tables::fastest_point;
use crate::caveats::warning;

/// Standard error of the fastest time constant, as a part of it, above which a zero on its pole is doubtful. Derived: a tenth moves the
/// compensated response by up to 0.8 dB, `20 log10 1.1`, a quarter of what defines a bandwidth.
const DOUBTFUL_PART: f64 = 0.1;

/// What is to be known of the design itself.
pub(super) fn doubts(model: &Model, designed: &Designed) -> Vec<Finding> {
    match designed {
        Designed::Lead(_) => uncertain_zero(model).into_iter().collect(),
        Designed::Inverse(inverse) => {
            [beyond_measured(inverse), slower_down(model), no_slew(inverse)].into_iter().flatten().collect()
        }
    }
}

/// Said when the fastest pole is known badly: the fastest of many uncertain poles is likely to be so by chance.
fn uncertain_zero(model: &Model) -> Option<Finding> {
    let point = fastest_point(model)?;
    let part = point.time_constant_s_std.map(|std| std / point.time_constant_s).filter(|part| *part > DOUBTFUL_PART)?;
    let message = format!(
        "the zero stands on the pole at u_nom {:.3}, whose standard error is {:.0} %. It may be the fastest by chance, and then the other \
         levels get too little lead",
        point.nominal,
        100.0 * part
    );
    Some(warning(message, "measure there again, or remove its [[point]] from the model"))
}

fn beyond_measured(designed: &DesignedInverse) -> Option<Finding> {
    let ((from, to), (low, high)) = (designed.compensator.range().compensated, designed.measured);
    // To a millionth, as the default is. Chosen: above the rounding of decimals, below any step of a command.
    (from < low - REACH - 1e-6 || to > high + REACH + 1e-6).then(|| {
        let message = format!(
            "the inverse is in the path from {from:.3} to {to:.3}, and the time constant is measured from {low:.3} to {high:.3} only. A \
             table that is longer than the truth makes the rotor overshoot"
        );
        warning(message, "measure there, or narrow --compensate-range")
    })
}

fn slower_down(model: &Model) -> Option<Finding> {
    let ratio = model.time_constant_curve.as_ref()?.down_over_up?;
    let message = format!(
        "steps down take {ratio:.2} times as long as steps up. The table has the time constants of the faster direction, so that neither \
         overshoots; the other one stays slower than the bandwidth says"
    );
    Some(Finding::warning(message, None))
}

fn no_slew(designed: &DesignedInverse) -> Option<Finding> {
    designed.compensator.range().slew_per_s.is_none().then(|| {
        warning(
            "no --slew is declared. Where the ESC has a limit the motor falls behind what the inverse reckons with, and too fast a voltage \
             step can break an ESC's lock"
                .to_owned(),
            "without its settings at hand declare 20, 2 % per millisecond",
        )
    })
}
