//! What a call ends with.

use core::ffi::{CStr, c_char};

use rotorlead::design::{DesignError, InverseError};

/// What a call ends with: 0 where it did what was asked. `rotorlead_status_text` has the words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum Status {
    /// Done.
    Ok = 0,
    /// A pointer is NULL, or is not aligned for its type.
    BadPointer = 1,
    /// The compensator has no design, or others have written to it.
    NotDesigned = 2,
    /// The command is infinite or NaN. It was taken for 0.
    CommandNotFinite = 3,
    /// No pole or point was given.
    NoPoints = 4,
    /// More than 33 poles or points were given.
    TooManyPoints = 5,
    /// A pole is not within 0.001 to 1e6 rad/s.
    PoleOutOfRange = 6,
    /// `omega_g_rad_s` is not within 0.001 to 1e6 rad/s.
    OmegaGOutOfRange = 7,
    /// `omega_z_rad_s` is not within 0.001 to 1e6 rad/s.
    OmegaZOutOfRange = 8,
    /// `omega_f_rad_s` is not within 0.001 to 1e6 rad/s.
    OmegaFOutOfRange = 9,
    /// `damping` is not within 0.3 to 2.
    DampingOutOfRange = 10,
    /// `loop_rate_hz` is not within 50 to 100000 Hz.
    LoopRateOutOfRange = 11,
    /// `min` or `max` is not within 0 to 1, or `min` is above `max`.
    LimitsOutOfRange = 12,
    /// The zero is not below the poles.
    ZeroNotBelowPoles = 13,
    /// `omega_f_rad_s` is too fast for the loop rate.
    TooCloseToNyquist = 14,
    /// A coefficient of the section does not fit its format.
    CoefficientOutOfRange = 15,
    /// The output of the section could leave its headroom.
    L1GainTooHigh = 16,
    /// The command of a point is not within 0 to 1.
    PointCommandOutOfRange = 17,
    /// The time constant of a point is not within 1e-6 to 1000 s.
    PointTauOutOfRange = 18,
    /// The commands of the points do not increase.
    PointsNotIncreasing = 19,
    /// The rotor is too fast for the reference model.
    RotorTooFast = 20,
    /// The rotor is too slow for the reference model.
    RotorTooSlow = 21,
    /// The time constant changes too fast over the command.
    CurveTooSteep = 22,
    /// The reference model settles in too many ticks.
    ResponseTooLong = 23,
    /// Rounding could move the steady output.
    RoundingTooLarge = 24,
    /// `slew_per_s` is not within 0 to 1e6.
    SlewOutOfRange = 25,
    /// `slew_per_s` is less than a step of the output per tick.
    SlewTooSlow = 26,
    /// `compensate_from` or `compensate_to` is not within 0 to 1, or the first is above the second.
    CompensateRangeOutOfRange = 27,
}

impl Status {
    /// Every status, in the order of their numbers.
    const ALL: [Self; 28] = [
        Self::Ok,
        Self::BadPointer,
        Self::NotDesigned,
        Self::CommandNotFinite,
        Self::NoPoints,
        Self::TooManyPoints,
        Self::PoleOutOfRange,
        Self::OmegaGOutOfRange,
        Self::OmegaZOutOfRange,
        Self::OmegaFOutOfRange,
        Self::DampingOutOfRange,
        Self::LoopRateOutOfRange,
        Self::LimitsOutOfRange,
        Self::ZeroNotBelowPoles,
        Self::TooCloseToNyquist,
        Self::CoefficientOutOfRange,
        Self::L1GainTooHigh,
        Self::PointCommandOutOfRange,
        Self::PointTauOutOfRange,
        Self::PointsNotIncreasing,
        Self::RotorTooFast,
        Self::RotorTooSlow,
        Self::CurveTooSteep,
        Self::ResponseTooLong,
        Self::RoundingTooLarge,
        Self::SlewOutOfRange,
        Self::SlewTooSlow,
        Self::CompensateRangeOutOfRange,
    ];

    /// What is wrong, and what to do. Values are the caller's, so only their limits are named: printing a number of double
    /// precision would take more flash than everything else here.
    const fn text(self) -> &'static CStr {
        match self {
            Self::Ok => c"ok",
            Self::BadPointer => c"a pointer is NULL, or is not aligned for its type: give the address of a variable",
            Self::NotDesigned => {
                c"the compensator has no design, or others have written to its memory: call rotorlead_design_lead or rotorlead_design_inverse first, and look at what it returns"
            }
            Self::CommandNotFinite => {
                c"the command is infinite or not a number, and was taken for 0: look where the mixer divides by 0"
            }
            Self::NoPoints => c"no pole or point was given: a design needs at least one identified point",
            Self::TooManyPoints => c"more than 33 poles or points were given: leave some out",
            Self::PoleOutOfRange => c"a pole is outside its range, 0.001 to 1e6 rad/s: it is 1 / tau",
            Self::OmegaGOutOfRange => c"omega_g_rad_s is outside its range, 0.001 to 1e6 rad/s",
            Self::OmegaZOutOfRange => c"omega_z_rad_s is outside its range, 0.001 to 1e6 rad/s",
            Self::OmegaFOutOfRange => c"omega_f_rad_s is outside its range, 0.001 to 1e6 rad/s",
            Self::DampingOutOfRange => c"damping is outside its range, 0.3 to 2",
            Self::LoopRateOutOfRange => c"loop_rate_hz is outside its range, 50 to 100000 Hz",
            Self::LimitsOutOfRange => c"min and max are to be within 0 to 1, and min not above max",
            Self::ZeroNotBelowPoles => {
                c"omega_z_rad_s is not below omega_f_rad_s: raise omega_g_rad_s above the motor's fastest pole"
            }
            Self::TooCloseToNyquist => {
                c"omega_f_rad_s is more than 0.4 rad per tick: lower it, or raise loop_rate_hz above 2.5 times omega_f_rad_s"
            }
            Self::CoefficientOutOfRange => {
                c"a coefficient does not fit its format, 2^-20 to 0.5: change omega_f_rad_s, omega_z_rad_s, damping or loop_rate_hz"
            }
            Self::L1GainTooHigh => {
                c"the L1 gain is more than the headroom holds, 6.9922: lower omega_f_rad_s, or raise the damping"
            }
            Self::PointCommandOutOfRange => c"the command of a point is outside its range, 0 to 1",
            Self::PointTauOutOfRange => c"tau_s of a point is outside its range, 1e-6 to 1000 s",
            Self::PointsNotIncreasing => {
                c"the command of a point is not above that of the point before: sort the points, and merge those at one command"
            }
            Self::RotorTooFast => {
                c"tau_s is too short: the rotor is faster than the inverse can slow down; raise omega_f_rad_s above 0.5 / tau_s"
            }
            Self::RotorTooSlow => {
                c"tau_s is too long: the gain of the inverse does not fit its format; lower omega_f_rad_s below 512 / tau_s"
            }
            Self::CurveTooSteep => {
                c"tau_s changes by more than a factor of 1.25 over 1/32 of the command: check the points"
            }
            Self::ResponseTooLong => {
                c"the reference model takes too many ticks to settle: raise omega_f_rad_s, lower damping, or lower loop_rate_hz"
            }
            Self::RoundingTooLarge => {
                c"rounding could move the steady output by half a step where the rotor is slowest: lower loop_rate_hz"
            }
            Self::SlewOutOfRange => c"slew_per_s is outside its range, 0 for no limit, to 1e6 per second",
            Self::SlewTooSlow => {
                c"slew_per_s is less than a step of the output, 2^-16, per tick: raise it, or set 0 for no limit"
            }
            Self::CompensateRangeOutOfRange => {
                c"compensate_from and compensate_to are to be within 0 to 1, and the first not above the second"
            }
        }
    }

    /// Of a parameter that is not finite or outside its range.
    fn of_parameter(name: &str) -> Self {
        match name {
            "pole_rad_s" => Self::PoleOutOfRange,
            "omega_g_rad_s" => Self::OmegaGOutOfRange,
            "omega_z_rad_s" => Self::OmegaZOutOfRange,
            "damping" => Self::DampingOutOfRange,
            "loop_rate_hz" => Self::LoopRateOutOfRange,
            "slew_per_s" => Self::SlewOutOfRange,
            "command" => Self::PointCommandOutOfRange,
            "tau_s" => Self::PointTauOutOfRange,
            _ => Self::OmegaFOutOfRange,
        }
    }
}

impl From<DesignError> for Status {
    fn from(error: DesignError) -> Self {
        match error {
            DesignError::NoPoles => Self::NoPoints,
            DesignError::NotFinite { parameter } | DesignError::OutOfRange { parameter, .. } => {
                Self::of_parameter(parameter)
            }
            DesignError::ZeroNotBelowPoles { .. } => Self::ZeroNotBelowPoles,
            DesignError::TooCloseToNyquist { .. } => Self::TooCloseToNyquist,
            // The last two are ruled out by the limits of the parameters.
            DesignError::CoefficientOutOfRange { .. }
            | DesignError::DampingTooLow { .. }
            | DesignError::DeviationTooLarge { .. } => Self::CoefficientOutOfRange,
            DesignError::L1GainTooHigh { .. } => Self::L1GainTooHigh,
            DesignError::SlewTooSlow { .. } => Self::SlewTooSlow,
        }
    }
}

impl From<InverseError> for Status {
    fn from(error: InverseError) -> Self {
        match error {
            InverseError::Parameter(error) | InverseError::Point { error, .. } => error.into(),
            InverseError::NoPoints => Self::NoPoints,
            InverseError::TooManyPoints { .. } => Self::TooManyPoints,
            InverseError::NotIncreasing { .. } => Self::PointsNotIncreasing,
            InverseError::RotorTooFast { .. } => Self::RotorTooFast,
            InverseError::RotorTooSlow { .. } => Self::RotorTooSlow,
            InverseError::CurveTooSteep { .. } => Self::CurveTooSteep,
            InverseError::ResponseTooLong => Self::ResponseTooLong,
            InverseError::RoundingTooLarge { .. } => Self::RoundingTooLarge,
            InverseError::LimitsCrossed { .. } => Self::LimitsOutOfRange,
        }
    }
}

impl From<Result<(), Self>> for Status {
    fn from(result: Result<(), Self>) -> Self {
        result.err().unwrap_or(Self::Ok)
    }
}

/// What a status means and what to do, in English; never NULL, and never to be freed.
#[unsafe(no_mangle)]
pub extern "C" fn rotorlead_status_text(status: i32) -> *const c_char {
    // Any number may come from C.
    let known = Status::ALL.into_iter().find(|known| *known as i32 == status);
    known.map_or(c"no such status", Status::text).as_ptr()
}

#[cfg(test)]
mod tests {
    use super::Status;
    use rotorlead::design::{
        DAMPING_RANGE, FASTEST_POLE_RAD, FREQUENCY_RANGE_RAD_S, LARGEST_L1_GAIN, LOOP_RATE_RANGE_HZ, SLEW_RANGE_PER_S,
        SMALLEST_COEFFICIENT, TIME_CONSTANT_RANGE_S,
    };
    use rotorlead::inverse::{OUTPUT_BITS, TABLE_POINTS};

    #[test]
    fn numbers_are_counted_from_0() {
        for (number, status) in Status::ALL.into_iter().enumerate() {
            assert_eq!(status as usize, number, "{status:?}");
        }
    }

    #[test]
    fn texts_name_the_limits_that_hold() {
        let says = |status: Status, what: &str| {
            let text = status.text().to_str().unwrap();
            assert!(text.contains(what), "{status:?}: {text}");
        };
        assert_eq!(FREQUENCY_RANGE_RAD_S, (0.001, 1e6));
        for status in
            [Status::PoleOutOfRange, Status::OmegaGOutOfRange, Status::OmegaZOutOfRange, Status::OmegaFOutOfRange]
        {
            says(status, "0.001 to 1e6 rad/s");
        }
        let (least, most) = DAMPING_RANGE;
        says(Status::DampingOutOfRange, &format!("{least} to {most}"));
        let (least, most) = LOOP_RATE_RANGE_HZ;
        says(Status::LoopRateOutOfRange, &format!("{least} to {most} Hz"));
        let (least, most) = TIME_CONSTANT_RANGE_S;
        says(Status::PointTauOutOfRange, &format!("{least:e} to {} s", most.round()));
        assert_eq!(SLEW_RANGE_PER_S, (0.0, 1e6));
        says(Status::SlewOutOfRange, "0 for no limit, to 1e6");
        says(Status::TooManyPoints, &TABLE_POINTS.to_string());
        says(Status::SlewTooSlow, &format!("2^-{OUTPUT_BITS}"));
        says(Status::TooCloseToNyquist, &format!("more than {FASTEST_POLE_RAD} rad per tick"));
        says(Status::TooCloseToNyquist, &format!("{} times omega_f_rad_s", 1.0 / FASTEST_POLE_RAD));
        assert_eq!(SMALLEST_COEFFICIENT / 2_f64.powi(32), 2_f64.powi(-20));
        says(Status::CoefficientOutOfRange, "2^-20 to 0.5");
        says(Status::L1GainTooHigh, &format!("{LARGEST_L1_GAIN:.4}"));
    }
}
