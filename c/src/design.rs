//! From what was identified to a compensator.

use rotorlead::compensator::{CommandRange, Compensator as Inner};
use rotorlead::design::{CurvePoint, DEFAULT_SLEW_PER_S, InverseDesign, LeadDesign, LeadParameters, ReferenceModel};
use rotorlead::inverse::TABLE_POINTS;
use rotorlead::throttle::Command;

use crate::pointer::{array, out, shared};
use crate::{Compensator, Status};

/// The lead compensator `omega_f^2 (s / omega_z + 1) / (s^2 + 2 damping omega_f s + omega_f^2)`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Lead {
    /// Frequency of the zero, which stands on the pole of the fastest motor, rad/s: 0.001 to 1e6, and below `omega_f_rad_s`.
    pub omega_z_rad_s: f64,
    /// Frequency of the pair of poles, rad/s; at most 0.4 per tick.
    pub omega_f_rad_s: f64,
    /// Damping ratio of the poles, 0.3 to 2. 0.7071 does not overshoot.
    pub damping: f64,
    /// Largest change of the output, units of the command per second; 0 for no limit. The slowest that the ESC may have.
    pub slew_per_s: f64,
}

/// The conditioned inverse along the reference model `omega_f^2 / (s^2 + 2 damping omega_f s + omega_f^2)`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Inverse {
    /// Natural frequency, rad/s; at most 0.4 per tick.
    pub omega_f_rad_s: f64,
    /// Damping ratio, 0.3 to 2.
    pub damping: f64,
    /// Largest change of the output, units of the command per second; 0 for no limit. The slowest that the ESC may have.
    pub slew_per_s: f64,
    /// The inverse is left out for commands below this, 0 to 1: where the time constant was not measured.
    pub compensate_from: f64,
    /// The inverse is left out for commands above this, 0 to 1.
    pub compensate_to: f64,
}

/// A rotor's time constant at an operating point.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Point {
    /// The command at which the rotor rests, 0 to 1.
    pub command: f64,
    /// Its time constant there, seconds, 1e-6 to 1000.
    pub tau_s: f64,
}

/// The paper's lead from 1 to 33 identified poles `1 / tau` and the highest frequency that is to be amplified, all rad/s: the
/// zero on the fastest pole, the poles at the geometric mean, and no overshoot.
///
/// `slew_per_s` becomes 20, 2 % per millisecond: the slowest of the ESCs whose slew is known, and what Rotorlead's own controller
/// begins with. Set it to your ESC's, or to 0 for the paper's lead, which has no limit.
///
/// # Safety
/// `poles_rad_s` is NULL or points to `count` doubles, and `lead` is NULL or points to a `rotorlead_lead`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rotorlead_lead_from_poles(
    poles_rad_s: *const f64,
    count: usize,
    omega_g_rad_s: f64,
    lead: *mut Lead,
) -> Status {
    // SAFETY: as of this function.
    let pointers = unsafe { array(poles_rad_s, count, TABLE_POINTS).and_then(|poles| Ok((poles, out(lead)?))) };
    let made = pointers.and_then(|(poles_rad_s, lead)| {
        let made = LeadParameters::from_poles(poles_rad_s, omega_g_rad_s)?;
        let LeadParameters { omega_z_rad_s, omega_f_rad_s, damping } = made;
        lead.write(Lead { omega_z_rad_s, omega_f_rad_s, damping, slew_per_s: DEFAULT_SLEW_PER_S });
        Ok(())
    });
    made.into()
}

/// Designs a lead for a loop rate, 50 to 100000 Hz, with outputs within `min` to `max`, 0 to 1. It is at rest at `min`.
///
/// Where it fails the compensator is what it was before.
///
/// # Safety
/// Each pointer is NULL or points to one of its type; nobody else uses the compensator meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rotorlead_design_lead(
    compensator: *mut Compensator,
    lead: *const Lead,
    loop_rate_hz: f64,
    min: f64,
    max: f64,
) -> Status {
    // SAFETY: as of this function.
    let made = unsafe { shared(lead) }.and_then(|lead| {
        let Lead { omega_z_rad_s, omega_f_rad_s, damping, slew_per_s } = *lead;
        let design = LeadDesign::new(LeadParameters { omega_z_rad_s, omega_f_rad_s, damping }, loop_rate_hz, None)?;
        let CommandRange { lowest, highest } = range(min, max).ok_or(Status::LimitsOutOfRange)?;
        Ok(Inner::new(design.with_slew(slew_per_s)?.filter(), lowest, highest))
    });
    // SAFETY: as of this function.
    made.and_then(|inner| unsafe { Compensator::write(compensator, inner) }).into()
}

/// Designs an inverse of the rotor with the curve through 1 to 33 points, in increasing order of the command, for a loop rate, 50
/// to 100000 Hz, with outputs within `min` to `max`, 0 to 1. It is at rest at `min`.
///
/// Where it fails the compensator is what it was before.
///
/// # Safety
/// Each pointer is NULL or points to one of its type, and `points` to `count` of them; nobody else uses the compensator
/// meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rotorlead_design_inverse(
    compensator: *mut Compensator,
    inverse: *const Inverse,
    points: *const Point,
    count: usize,
    loop_rate_hz: f64,
    min: f64,
    max: f64,
) -> Status {
    // SAFETY: as of this function.
    let pointers = unsafe { array(points, count, TABLE_POINTS).and_then(|points| Ok((points, shared(inverse)?))) };
    let made = pointers.and_then(|(points, inverse)| {
        let mut curve = [CurvePoint { command: 0.0, tau_s: 0.0 }; TABLE_POINTS];
        for (to, point) in curve.iter_mut().zip(points) {
            *to = CurvePoint { command: point.command, tau_s: point.tau_s };
        }
        let curve = curve.get(..points.len()).unwrap_or_default();
        let reference = ReferenceModel { omega_f_rad_s: inverse.omega_f_rad_s, damping: inverse.damping };
        let design = InverseDesign::new(reference, loop_rate_hz, curve)?;
        let compensated =
            range(inverse.compensate_from, inverse.compensate_to).ok_or(Status::CompensateRangeOutOfRange)?;
        let CommandRange { lowest, highest } = range(min, max).ok_or(Status::LimitsOutOfRange)?;
        Ok(Inner::new(design.filter(inverse.slew_per_s, compensated)?, lowest, highest))
    });
    // SAFETY: as of this function.
    made.and_then(|inner| unsafe { Compensator::write(compensator, inner) }).into()
}

/// Commands within 0 to 1, the first not above the second.
fn range(lowest: f64, highest: f64) -> Option<CommandRange> {
    let command = |value| (0.0..=1.0).contains(&value).then(|| Command::saturating_from_f64(value));
    (lowest <= highest).then_some(CommandRange { lowest: command(lowest)?, highest: command(highest)? })
}
