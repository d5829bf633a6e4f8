//! Why a design is refused.

use core::fmt;

use libm::fabs;

use crate::inverse::OUTPUT_BITS;

/// Why there is no such design. Every variant names the parameter and its limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DesignError {
    /// No poles to design from.
    NoPoles,
    /// The parameter is NaN or infinite.
    NotFinite {
        /// Name of the parameter.
        parameter: &'static str,
    },
    /// The parameter is outside its range.
    OutOfRange {
        /// Name of the parameter.
        parameter: &'static str,
        /// Its value.
        value: f64,
        /// Lowest value allowed.
        min: f64,
        /// Highest value allowed.
        max: f64,
    },
    /// The zero is not slower than the poles: there is nothing to speed up.
    ZeroNotBelowPoles {
        /// Frequency of the zero.
        omega_z_rad_s: f64,
        /// Frequency of the poles.
        omega_f_rad_s: f64,
    },
    /// The parameter is too close to the Nyquist frequency of the loop.
    TooCloseToNyquist {
        /// Name of the parameter.
        parameter: &'static str,
        /// Its value in rad/s.
        value_rad_s: f64,
        /// Highest value allowed at this loop rate.
        max_rad_s: f64,
    },
    /// A coefficient does not fit its format.
    CoefficientOutOfRange {
        /// Name of the coefficient.
        coefficient: &'static str,
        /// Its value.
        value: f64,
        /// Smallest magnitude that the format resolves well enough.
        min: f64,
        /// The format ends under this magnitude.
        max: f64,
    },
    /// The damping is too low for the rate: `4 c > 3 |k|`. [`FASTEST_POLE_RAD`](super::FASTEST_POLE_RAD) and
    /// [`DAMPING_RANGE`](super::DAMPING_RANGE) rule it out.
    DampingTooLow {
        /// The damping asked for.
        damping: f64,
        /// About the lowest damping that these frequencies and this loop rate allow.
        min: f64,
    },
    /// The filter's output could leave its headroom for inputs in [0, 1].
    L1GainTooHigh {
        /// Sum of the magnitudes of the impulse response.
        l1_gain: f64,
        /// Highest value allowed.
        max: f64,
    },
    /// The rounded coefficients miss the response by more than they may. [`SMALLEST_COEFFICIENT`](super::SMALLEST_COEFFICIENT)
    /// rules it out.
    DeviationTooLarge {
        /// The worst deviation, decibels.
        deviation_db: f64,
        /// Highest value allowed.
        max_db: f64,
    },
    /// The slew limit is less than a step of the output per tick.
    SlewTooSlow {
        /// The slew limit, units of the command per second.
        slew_per_s: f64,
        /// A step per tick.
        min_per_s: f64,
    },
}

impl fmt::Display for DesignError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NoPoles => write!(f, "no poles were given: a design needs at least one identified point"),
            Self::NotFinite { parameter } => write!(f, "{parameter} is not a finite number"),
            Self::OutOfRange { parameter, value, min, max } => {
                write!(f, "{parameter} is {}, outside its range {min} to {max}", Readable(value))
            }
            Self::ZeroNotBelowPoles { omega_z_rad_s, omega_f_rad_s } => write!(
                f,
                "omega_z_rad_s is {omega_z_rad_s:.4}, not below omega_f_rad_s, {omega_f_rad_s:.4}: raise omega_g above the motor's \
                 fastest pole"
            ),
            Self::TooCloseToNyquist { parameter, value_rad_s, max_rad_s } => write!(
                f,
                "{parameter} is {value_rad_s:.2} rad/s, too close to Nyquist: at this loop rate it may be at most {max_rad_s} \
                 rad/s"
            ),
            Self::CoefficientOutOfRange { coefficient, value, min, max } => write!(
                f,
                "coefficient {coefficient} is {}: its format holds magnitudes from {} to under {max}; change omega_f_rad_s, \
                 damping or loop_rate_hz",
                Readable(value),
                Readable(min)
            ),
            Self::DampingTooLow { damping, min } => {
                write!(f, "damping is {damping}: at this loop rate it must be at least about {min:.4}")
            }
            Self::L1GainTooHigh { l1_gain, max } => {
                write!(
                    f,
                    "the L1 gain is {l1_gain:.4}, the headroom holds {max:.4}: lower omega_g, or raise the damping"
                )
            }
            Self::DeviationTooLarge { deviation_db, max_db } => write!(
                f,
                "rounded coefficients change the response by {deviation_db:.4} dB, more than {max_db} dB: lower loop_rate_hz"
            ),
            Self::SlewTooSlow { slew_per_s, min_per_s } => write!(
                f,
                "slew_per_s is {slew_per_s}, less than one step of the output, 2^-{OUTPUT_BITS}, per tick: at this loop rate it \
                 must be at least {min_per_s:.4}, or 0 for no limit"
            ),
        }
    }
}

impl core::error::Error for DesignError {}

/// A number for people: with an exponent where it would otherwise be written with hundreds of zeros.
struct Readable(f64);

impl fmt::Display for Readable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(value) = *self;
        if value == 0.0 || (1e-4..1e9).contains(&fabs(value)) { write!(f, "{value}") } else { write!(f, "{value:e}") }
    }
}

/// `value`, or the error that it is not finite.
pub(super) fn finite(parameter: &'static str, value: f64) -> Result<f64, DesignError> {
    if value.is_finite() { Ok(value) } else { Err(DesignError::NotFinite { parameter }) }
}

/// `value`, or the error that it is outside `min..=max`.
pub(super) fn within(parameter: &'static str, value: f64, (min, max): (f64, f64)) -> Result<f64, DesignError> {
    finite(parameter, value)?;
    if value < min || value > max {
        return Err(DesignError::OutOfRange { parameter, value, min, max });
    }
    Ok(value)
}
