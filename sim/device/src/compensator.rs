//! A compensator as settings of a controller, and back.

use rotorlead::controller::{FilterError, filters};
use rotorlead::design::{CurvePoint, InverseError, LeadDesign};
use rotorlead::settings::{CompensatorKind, Key, Settings, Validated};
use rotorlead::throttle::Throttle;
use rotorlead_plant::{CompensatorDesign, FilterDesign, InverseCompensator, InverseRange};

use super::{DeviceError, change, curve_text};

/// Names and values of the settings that make a controller run `design`, whose file is `called` so: with the time constants of an inverse
/// for one motor, or for every one.
///
/// # Errors
/// [`DeviceError::Setting`]: a prewarped lead.
pub fn compensator_settings(
    design: &CompensatorDesign,
    called: &str,
    motor: Option<u8>,
) -> Result<Vec<(String, String)>, DeviceError> {
    let mut changes = vec![(Key::LoopRateHz, design.loop_rate_hz().to_string())];
    match &design.kind {
        FilterDesign::Lead(design) => {
            if let Some(prewarp_rad_s) = design.prewarp_rad_s() {
                return Err(DeviceError::Setting {
                    message: format!(
                        "`{called}` is prewarped at {prewarp_rad_s} rad/s, and a controller computes the plain transform"
                    ),
                    help: "design it again without --prewarp".to_owned(),
                });
            }
            let lead = design.lead();
            changes.extend([
                (Key::Compensator, "lead".to_owned()),
                (Key::OmegaZRadS, lead.omega_z_rad_s.to_string()),
                (Key::OmegaFRadS, lead.omega_f_rad_s.to_string()),
                (Key::Damping, lead.damping.to_string()),
            ]);
            // A file without one, as the paper has it, leaves that of the ESCs as it is.
            changes.extend(design.slew_per_s().map(|slew_per_s| (Key::OutputSlewPerS, slew_per_s.to_string())));
        }
        FilterDesign::Inverse(inverse) => {
            let (reference, range) = (inverse.design().reference(), inverse.range());
            changes.extend([
                (Key::Compensator, "inverse".to_owned()),
                (Key::InverseNaturalRadS, reference.omega_f_rad_s.to_string()),
                (Key::InverseDamping, reference.damping.to_string()),
                (Key::OutputSlewPerS, range.slew_per_s.unwrap_or(0.0).to_string()),
                (Key::InverseCompensateFrom, range.compensated.0.to_string()),
                (Key::InverseCompensateTo, range.compensated.1.to_string()),
                (Key::TimeConstantS, curve_text(inverse.curve())),
            ]);
        }
    }
    let motor = motor.map_or_else(|| "*".to_owned(), |motor| motor.to_string());
    let name =
        |key: Key| if key.is_of_a_motor() { format!("motor.{motor}.{}", key.name()) } else { key.name().to_owned() };
    Ok(changes.into_iter().map(|(key, value)| (name(key), value)).collect())
}

/// The compensator of a motor by these settings, as the controller makes it.
///
/// # Errors
/// [`DeviceError::Setting`], where it can make none.
pub fn compensator(settings: &Settings, motor: u8) -> Result<CompensatorDesign, DeviceError> {
    let loop_rate_hz = f64::from(settings.loop_rate_hz);
    if settings.compensator == CompensatorKind::Lead {
        let design = LeadDesign::new(settings.lead.into(), loop_rate_hz, None);
        return design
            .and_then(|design| design.with_slew(settings.slew_per_s))
            .map(CompensatorDesign::from)
            .map_err(FilterError::Lead)
            .map_err(|error| no_filter(&error));
    }
    let of_motor = settings.motors.get(usize::from(motor)).copied().unwrap_or_default();
    let level = |bits: i32| Throttle::from_bits(bits).to_f64();
    let of_curve = || {
        let tau_s = of_motor.curve.ok_or(InverseError::NoPoints)?.time_constants_s();
        let command = |index: usize| index as f64 / (tau_s.len() - 1) as f64;
        let points = tau_s.iter().enumerate();
        let points = points.map(|(index, &tau_s)| CurvePoint { command: command(index), tau_s: f64::from(tau_s) });
        let inverse = &settings.inverse;
        let range = InverseRange {
            min: level(settings.levels(&of_motor).idle),
            max: level(of_motor.max),
            slew_per_s: (settings.slew_per_s > 0.0).then_some(settings.slew_per_s),
            compensated: (level(inverse.compensate_from), level(inverse.compensate_to)),
        };
        InverseCompensator::new(inverse.reference(), loop_rate_hz, points.collect(), &range)
    };
    of_curve()
        .map(CompensatorDesign::from)
        .map_err(|error| FilterError::Inverse { motor: usize::from(motor), error })
        .map_err(|error| no_filter(&error))
}

/// Whether the compensator is in a motor's path.
#[must_use]
pub fn is_compensated(settings: &Settings, motor: u8) -> bool {
    settings.motors.get(usize::from(motor)).is_some_and(|motor| motor.compensate)
}

/// That a filter cannot be designed, with what to do.
fn no_filter(error: &FilterError) -> DeviceError {
    let help = match error {
        FilterError::Lead(_) => "change omega_z_rad_s, omega_f_rad_s, damping or output.slew_per_s".to_owned(),
        FilterError::Inverse { motor, .. } => format!(
            "change inverse.natural_rad_s, inverse.damping, output.slew_per_s, loop_rate_hz or motor.{motor}.time_constant_s"
        ),
    };
    DeviceError::Setting { message: error.to_string(), help }
}

/// [`change`](fn@change), of settings with which a controller can make its filters: more is said here of those that it would refuse.
///
/// # Errors
/// [`DeviceError::Setting`].
pub fn change_with_filters(settings: &Settings, changes: &[(String, String)]) -> Result<Validated, DeviceError> {
    let changed = change(settings, changes)?;
    filters(&changed).map_err(|error| no_filter(&error))?;
    Ok(changed)
}
