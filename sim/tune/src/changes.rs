//! What is to be set of what was found, and that in words.

use rotorlead::settings::{Key, MOTORS, Settings};
use rotorlead_device::{DeviceError, compensator_settings, curve_text};
use rotorlead_plant::CompensatorDesign;
use rotorlead_results::DesignResult;

use super::{COMPENSATOR_FILE, MeasuredMotor};

/// What is to be set: of a lead that of the fastest motor, and that these motors have it in their path.
pub(super) fn changes(
    settings: &Settings,
    motors: &[MeasuredMotor],
    designs: &[DesignResult],
) -> Result<Vec<(String, String)>, DeviceError> {
    let lead_of = |design: &CompensatorDesign| design.as_lead().map(|lead| lead.lead().omega_z_rad_s);
    let fastest = designs
        .iter()
        .map(|design| &design.compensator)
        .filter(|design| lead_of(design).is_some())
        .max_by(|a, b| lead_of(a).unwrap_or(0.0).total_cmp(&lead_of(b).unwrap_or(0.0)));
    let mut changes: Vec<(String, String)> = Vec::new();
    for (one, design) in motors.iter().zip(designs) {
        let own = fastest.unwrap_or(&design.compensator);
        let of_motor = compensator_settings(own, COMPENSATOR_FILE, Some(one.motor))?;
        let path = (format!("motor.{}.{}", one.motor, Key::Compensate.name()), "true".to_owned());
        for change in of_motor.into_iter().chain([path]) {
            if !changes.contains(&change) {
                changes.push(change);
            }
        }
    }
    // An inverse asks for the time constants of every motor, also of one in whose path it is not.
    let is_unknown = |motor: &usize| {
        settings.motors[*motor].curve.is_none() && motors.iter().all(|one| usize::from(one.motor) != *motor)
    };
    if let Some(inverse) = designs.first().and_then(|design| design.compensator.as_inverse()) {
        let curve = curve_text(inverse.curve());
        let others = (0..MOTORS).filter(is_unknown);
        changes.extend(others.map(|motor| (format!("motor.{motor}.{}", Key::TimeConstantS.name()), curve.clone())));
    }
    Ok(changes)
}

/// What was found of each motor, and what is to be set.
pub(super) fn summary(motors: &[MeasuredMotor], designs: &[DesignResult], changes: &[(String, String)]) -> String {
    let mut text = String::new();
    for (one, design) in motors.iter().zip(designs) {
        let taus = one
            .model
            .points
            .iter()
            .map(|point| format!("{:.1} ms at {:.3}", 1e3 * point.time_constant_s, point.nominal));
        let taus = taus.collect::<Vec<_>>().join(", ");
        text += &format!(
            "motor {}: {}; {taus}; {}\n",
            one.motor,
            one.judgement.state,
            rotorlead_results::in_short(&design.compensator)
        );
        text.extend(one.judgement.limits.iter().map(|limit| format!("  - {limit}\n")));
    }
    let mut rest = changes;
    while let Some((_, value)) = rest.first() {
        // Of motors that were not tuned one after the other has the same time constants.
        let alike = rest.iter().take_while(|(_, other)| other == value).count();
        let (these, others) = rest.split_at(alike);
        let keys: Vec<&str> = these.iter().map(|(key, _)| key.as_str()).collect();
        text += &format!("  {} = {}\n", keys.join(", "), in_short(value));
        rest = others;
    }
    text
}

/// A curve by its ends: all of it is in the compensator's file.
fn in_short(value: &str) -> String {
    let points: Vec<&str> = value.split(',').collect();
    match points[..] {
        [first, _, _, .., last] => format!("{first} to {last}, {} points", points.len()),
        _ => value.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_is_shown_by_its_ends() {
        assert_eq!(in_short("0:0.07,0.3:0.06,0.5:0.05,1:0.03"), "0:0.07 to 1:0.03, 4 points");
        assert_eq!(in_short("0.3:52000,0.4:65000,0.5:77000"), "0.3:52000,0.4:65000,0.5:77000");
        assert_eq!(in_short("rpm"), "rpm");
    }
}
