//! From identified motors to the compensator: C(s), its discrete image, and the checks that a design must pass.
//!
//! Equation numbers are those of the paper. Everything here is `f64` with `libm`, in a fixed order of operations, so
//! that a controller that computes its coefficients at start-up gets those of the host, bit for bit.

use core::f64::consts::{FRAC_1_SQRT_2, PI};
use core::fmt;

use libm::{cos, fabs, log10, pow, rint, sin, sqrt, tan};
use num_complex::Complex64;

use crate::biquad::{COEFFICIENT_BITS, Coefficients};
use crate::throttle::Throttle;

/// Rate of the control loop unless something else is asked for: the paper's 5 kHz.
pub const DEFAULT_LOOP_RATE_HZ: f64 = 5000.0;
/// Damping of the compensator's poles without overshoot of the command, eq. (4).
pub const DEFAULT_DAMPING: f64 = FRAC_1_SQRT_2;
/// Range of damping ratios. Under 0.3 the compensator rings; over 2 its slower pole is below 0.27 omega_f, and most of
/// what the lead gains is lost again.
pub const DAMPING_RANGE: (f64, f64) = (0.3, 2.0);
/// Range of frequencies in rad/s: far wider than that of motors, and of what the other limits leave.
pub const FREQUENCY_RANGE_RAD_S: (f64, f64) = (1e-3, 1e6);
/// Range of loop rates in hertz: from a slow servo output to the fastest ESC protocol.
pub const LOOP_RATE_RANGE_HZ: (f64, f64) = (50.0, 100_000.0);
/// `omega_f` (or a prewarp frequency) is too close to Nyquist above this many rad/s per hertz of the loop rate, which
/// is 13 % of Nyquist. Up to it `4 c <= 3 |k|` holds at every damping, which the exactness of the steady output needs
/// (see [`crate::biquad`]).
pub const FASTEST_POLE_RAD: f64 = 0.4;
/// Smallest coefficient in steps of 2^-32: rounding one this size moves it by up to 1.2e-4 of itself, 0.001 dB.
pub const SMALLEST_COEFFICIENT: f64 = 4096.0;
/// Largest L1 gain: 2 * [`Throttle::HEADROOM`] - 1, for which commands in [0, 1] reach both ends of the headroom, less a
/// margin of 1/128 for the rounding errors of the section.
pub const LARGEST_L1_GAIN: f64 = 2.0 * Throttle::HEADROOM - 1.0 - 1.0 / 128.0;
/// Largest deviation that rounding the coefficients may cause, in decibels.
pub const LARGEST_DEVIATION_DB: f64 = 0.01;
/// Attenuation that defines a bandwidth, in decibels: exactly 3, as the paper has it, and not half the power.
pub const BANDWIDTH_DROP_DB: f64 = 3.0;

/// 1.0 in the coefficients' format.
const FORMAT_ONE: f64 = (1_u64 << COEFFICIENT_BITS) as f64;
/// Ticks after which the impulse response of a design must have died out; every accepted pole is faster.
const LONGEST_RESPONSE_TICKS: u32 = 1 << 18;
/// The impulse response is summed until it is this small, relative to the pole's distance from 1: about the sum of what
/// remains.
const RESPONSE_END: f64 = 1e-9;
/// Frequencies at which the response is checked after rounding, evenly spaced in the logarithm.
const CHECKED_FREQUENCIES: u32 = 128;

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
    /// The damping is too low for the rate: `4 c > 3 |k|`. [`FASTEST_POLE_RAD`] and [`DAMPING_RANGE`] rule it out.
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
    /// The rounded coefficients miss the response by more than they may. [`SMALLEST_COEFFICIENT`] rules it out.
    DeviationTooLarge {
        /// The worst deviation, decibels.
        deviation_db: f64,
        /// Highest value allowed.
        max_db: f64,
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
                "omega_z_rad_s is {omega_z_rad_s}, not below omega_f_rad_s, {omega_f_rad_s}: raise omega_g above the motor's \
                 fastest pole"
            ),
            Self::TooCloseToNyquist { parameter, value_rad_s, max_rad_s } => write!(
                f,
                "{parameter} is {value_rad_s} rad/s, too close to Nyquist: at this loop rate it may be at most {max_rad_s} \
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
                write!(f, "damping is {damping}: at this loop rate it must be at least about {min}")
            }
            Self::L1GainTooHigh { l1_gain, max } => {
                write!(f, "the L1 gain is {l1_gain}, the headroom holds {max}: lower omega_g, or raise the damping")
            }
            Self::DeviationTooLarge { deviation_db, max_db } => write!(
                f,
                "rounded coefficients change the response by {deviation_db} dB, more than {max_db} dB: lower loop_rate_hz"
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
fn finite(parameter: &'static str, value: f64) -> Result<f64, DesignError> {
    if value.is_finite() { Ok(value) } else { Err(DesignError::NotFinite { parameter }) }
}

/// `value`, or the error that it is outside `min..=max`.
fn within(parameter: &'static str, value: f64, (min, max): (f64, f64)) -> Result<f64, DesignError> {
    finite(parameter, value)?;
    if value < min || value > max {
        return Err(DesignError::OutOfRange { parameter, value, min, max });
    }
    Ok(value)
}

/// The continuous compensator
/// `C(s) = omega_f^2 (s / omega_z + 1) / (s^2 + 2 damping omega_f s + omega_f^2)`, eq. (3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeadParameters {
    /// Frequency of the zero, which stands on the pole of the fastest motor, rad/s.
    pub omega_z_rad_s: f64,
    /// Frequency of the pair of poles, rad/s.
    pub omega_f_rad_s: f64,
    /// Damping ratio of the poles.
    pub damping: f64,
}

impl LeadParameters {
    /// The paper's design from identified poles `1 / tau_s` and `omega_g_rad_s`, the highest frequency that is to be
    /// amplified: the zero on the fastest pole (2), the damping of (4), the poles at their geometric mean (5).
    ///
    /// # Errors
    /// When there are no poles, one is not finite or outside [`FREQUENCY_RANGE_RAD_S`], or `omega_g_rad_s` is or is not
    /// above all of them.
    pub fn from_poles(poles_rad_s: &[f64], omega_g_rad_s: f64) -> Result<Self, DesignError> {
        let mut omega_z_rad_s = 0.0;
        for &pole in poles_rad_s {
            let pole = within("pole_rad_s", pole, FREQUENCY_RANGE_RAD_S)?;
            if pole > omega_z_rad_s {
                omega_z_rad_s = pole;
            }
        }
        if omega_z_rad_s == 0.0 {
            return Err(DesignError::NoPoles);
        }
        let omega_g_rad_s = within("omega_g_rad_s", omega_g_rad_s, FREQUENCY_RANGE_RAD_S)?;
        Self { omega_z_rad_s, omega_f_rad_s: sqrt(omega_z_rad_s * omega_g_rad_s), damping: DEFAULT_DAMPING }.checked()
    }

    /// Itself, when the parameters make sense at some loop rate.
    ///
    /// # Errors
    /// When a parameter is not finite or out of range, or the zero is not below the poles.
    pub fn checked(self) -> Result<Self, DesignError> {
        within("omega_z_rad_s", self.omega_z_rad_s, FREQUENCY_RANGE_RAD_S)?;
        within("omega_f_rad_s", self.omega_f_rad_s, FREQUENCY_RANGE_RAD_S)?;
        within("damping", self.damping, DAMPING_RANGE)?;
        if self.omega_z_rad_s >= self.omega_f_rad_s {
            return Err(DesignError::ZeroNotBelowPoles {
                omega_z_rad_s: self.omega_z_rad_s,
                omega_f_rad_s: self.omega_f_rad_s,
            });
        }
        Ok(self)
    }

    /// Highest frequency that is amplified, by the asymptotes: `omega_f^2 / omega_z`, eq. (5) solved for it.
    #[must_use]
    pub fn omega_g_rad_s(&self) -> f64 {
        self.omega_f_rad_s * self.omega_f_rad_s / self.omega_z_rad_s
    }

    /// Peak gain by the asymptotes, `eta_f = 10 log10(omega_g / omega_z)` in dB, eq. (5). The true peak is lower.
    #[must_use]
    pub fn asymptotic_peak_db(&self) -> f64 {
        10.0 * log10(self.omega_g_rad_s() / self.omega_z_rad_s)
    }

    /// `omega_s_min = omega_z / 10^(3/20)` (below eq. 2): actuators with a slower pole gain little.
    #[must_use]
    pub fn slowest_helped_rad_s(&self) -> f64 {
        self.omega_z_rad_s / pow(10.0, BANDWIDTH_DROP_DB / 20.0)
    }

    /// `C(j omega)`, eq. (3).
    #[must_use]
    pub fn response(&self, omega_rad_s: f64) -> Complex64 {
        let (w, wf) = (omega_rad_s, self.omega_f_rad_s);
        Complex64::new(wf * wf, wf * wf * w / self.omega_z_rad_s)
            / Complex64::new(wf * wf - w * w, 2.0 * self.damping * wf * w)
    }
}

/// A checked design: the Tustin image of a [`LeadParameters`] at a loop rate, rounded to the section's format.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeadDesign {
    lead: LeadParameters,
    loop_rate_hz: f64,
    prewarp_rad_s: Option<f64>,
    coefficients: Coefficients,
    check: DesignCheck,
}

/// What is found when the response is computed again from the rounded coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DesignCheck {
    /// Largest `20 log10(1 + |H_rounded / H - 1|)` in decibels, at 128 frequencies from a thousandth of the zero up to
    /// about nine tenths of Nyquist (at Nyquist `H` is 0).
    pub worst_deviation_db: f64,
    /// Where it is, rad/s.
    pub worst_deviation_rad_s: f64,
    /// Distances of the two poles of the rounded section from the origin; under 1.
    pub pole_radii: [f64; 2],
    /// Sum of the magnitudes of the impulse response, to 1e-9: for inputs in [0, 1] the output stays within
    /// (1 +- l1_gain) / 2.
    pub l1_gain: f64,
    /// Largest output for a step from 0 to 1.
    pub step_peak: f64,
}

/// Unrounded coefficients of the section's recurrence; see [`crate::biquad`].
#[derive(Clone, Copy)]
struct Recurrence {
    k: f64,
    c: f64,
    g0: f64,
    g1: f64,
}

impl LeadDesign {
    /// Designs the section for `lead` at `loop_rate_hz` by Tustin's substitution
    /// `s -> a (1 - z^-1) / (1 + z^-1)`, with `a = 2 loop_rate` or, so that both responses agree at `prewarp_rad_s`,
    /// `a = prewarp / tan(prewarp / (2 loop_rate))`.
    ///
    /// # Errors
    /// See [`DesignError`]. Nothing saturates in silence: a design that the format cannot hold is refused.
    pub fn new(lead: LeadParameters, loop_rate_hz: f64, prewarp_rad_s: Option<f64>) -> Result<Self, DesignError> {
        let lead = lead.checked()?;
        within("loop_rate_hz", loop_rate_hz, LOOP_RATE_RANGE_HZ)?;
        let max_rad_s = FASTEST_POLE_RAD * loop_rate_hz;
        let below_nyquist = |parameter, value_rad_s: f64| {
            if value_rad_s > max_rad_s {
                return Err(DesignError::TooCloseToNyquist { parameter, value_rad_s, max_rad_s });
            }
            Ok(())
        };
        below_nyquist("omega_f_rad_s", lead.omega_f_rad_s)?;
        let substitution_rad_s = match prewarp_rad_s {
            None => 2.0 * loop_rate_hz,
            Some(prewarp) => {
                within("prewarp_rad_s", prewarp, FREQUENCY_RANGE_RAD_S)?;
                below_nyquist("prewarp_rad_s", prewarp)?;
                prewarp / tan(prewarp / (2.0 * loop_rate_hz))
            }
        };

        let ideal = Recurrence::tustin(&lead, substitution_rad_s);
        let c = rounded("c", ideal.c)?;
        let k = rounded("k", ideal.k)?;
        let g0 = rounded("g0", ideal.g0)?;
        let g1 = rounded("g1", ideal.g1)?;
        let coefficients = Coefficients::new(k, c, g0, g1).ok_or(DesignError::DampingTooLow {
            damping: lead.damping,
            // 4 c <= 3 |k| is q <= 3/4 damping with q = omega_f / a.
            min: 4.0 / 3.0 * lead.omega_f_rad_s / substitution_rad_s,
        })?;
        let check = check(&ideal, &coefficients, &lead, loop_rate_hz)?;
        Ok(Self { lead, loop_rate_hz, prewarp_rad_s, coefficients, check })
    }

    /// The continuous compensator.
    #[must_use]
    pub const fn lead(&self) -> &LeadParameters {
        &self.lead
    }

    /// Ticks per second.
    #[must_use]
    pub const fn loop_rate_hz(&self) -> f64 {
        self.loop_rate_hz
    }

    /// The frequency at which the discrete response equals the continuous one, where one was asked for.
    #[must_use]
    pub const fn prewarp_rad_s(&self) -> Option<f64> {
        self.prewarp_rad_s
    }

    /// The section's coefficients.
    #[must_use]
    pub const fn coefficients(&self) -> &Coefficients {
        &self.coefficients
    }

    /// What the rounded coefficients do to the response.
    #[must_use]
    pub const fn check(&self) -> &DesignCheck {
        &self.check
    }

    /// Response of the section with its rounded coefficients, `H(e^(j omega T))`.
    #[must_use]
    pub fn response(&self, omega_rad_s: f64) -> Complex64 {
        Recurrence::from(&self.coefficients).response(omega_rad_s / self.loop_rate_hz)
    }
}

impl Recurrence {
    /// The image of C(s) under `s -> a (1 - z^-1) / (1 + z^-1)`.
    ///
    /// With `q = omega_f / a`, `m = a / omega_z` and `D = 1 + 2 zeta q + q^2` the usual coefficients are
    /// `b0 = q^2 (1 + m) / D`, `b1 = 2 q^2 / D`, `b2 = q^2 (1 - m) / D`, `a1 = 2 (q^2 - 1) / D` and
    /// `a2 = (1 - 2 zeta q + q^2) / D`. The section's are differences of these, formed before any rounding.
    fn tustin(lead: &LeadParameters, a_rad_s: f64) -> Self {
        let q = lead.omega_f_rad_s / a_rad_s;
        let m = a_rad_s / lead.omega_z_rad_s;
        let d = 1.0 + 2.0 * lead.damping * q + q * q;
        Self {
            k: -4.0 * lead.damping * q / d,
            c: 4.0 * q * q / d,
            g0: q * q * (m - 3.0) / d,
            g1: q * q * (m - 1.0) / d,
        }
    }

    /// `H` at `theta` radians per tick.
    fn response(&self, theta: f64) -> Complex64 {
        let (difference, delay) = difference_and_delay(theta);
        self.numerator(difference, delay) / self.denominator(difference, delay)
    }

    fn numerator(&self, difference: Complex64, delay: Complex64) -> Complex64 {
        difference * (delay * self.g1 + self.g0) + self.c
    }

    fn denominator(&self, difference: Complex64, delay: Complex64) -> Complex64 {
        difference * (difference - delay * self.k) + delay * self.c
    }
}

/// `1 - z^-1` and `z^-1` at `theta` radians per tick. The first is formed as `2 sin^2(theta / 2) + j sin(theta)`, which
/// keeps its digits where `theta` is small.
fn difference_and_delay(theta: f64) -> (Complex64, Complex64) {
    let half = sin(theta / 2.0);
    (Complex64::new(2.0 * half * half, sin(theta)), Complex64::new(cos(theta), -sin(theta)))
}

impl From<&Coefficients> for Recurrence {
    fn from(coefficients: &Coefficients) -> Self {
        let value = |bits: i32| f64::from(bits) / FORMAT_ONE;
        Self {
            k: value(coefficients.k()),
            c: value(coefficients.c()),
            g0: value(coefficients.g0()),
            g1: value(coefficients.g1()),
        }
    }
}

/// The coefficient in its format, to the nearest step.
fn rounded(coefficient: &'static str, value: f64) -> Result<i32, DesignError> {
    let steps = rint(value * FORMAT_ONE);
    if !(SMALLEST_COEFFICIENT..0.5 * FORMAT_ONE).contains(&fabs(steps)) {
        let min = SMALLEST_COEFFICIENT / FORMAT_ONE;
        return Err(DesignError::CoefficientOutOfRange { coefficient, value, min, max: 0.5 });
    }
    Ok(steps as i32)
}

/// Computes the response again from the rounded coefficients, and refuses what does not hold.
fn check(
    ideal: &Recurrence,
    coefficients: &Coefficients,
    lead: &LeadParameters,
    loop_rate_hz: f64,
) -> Result<DesignCheck, DesignError> {
    let actual = Recurrence::from(coefficients);
    let pole_radii = pole_radii(&actual);
    let (l1_gain, step_peak) = gains(&actual, pole_radii);
    if l1_gain.is_nan() || l1_gain > LARGEST_L1_GAIN {
        return Err(DesignError::L1GainTooHigh { l1_gain, max: LARGEST_L1_GAIN });
    }

    let (mut worst, mut worst_rad_s) = (0.0, 0.0);
    let lowest = lead.omega_z_rad_s / 1000.0;
    let ratio = PI * loop_rate_hz / lowest;
    for i in 0..CHECKED_FREQUENCIES {
        // The last frequency is a step of the grid below Nyquist, where the response is 0.
        let omega_rad_s = lowest * pow(ratio, f64::from(i) / f64::from(CHECKED_FREQUENCIES));
        let theta = omega_rad_s / loop_rate_hz;
        let deviation = (actual.response(theta) / ideal.response(theta) - 1.0).norm_sqr();
        if deviation > worst {
            (worst, worst_rad_s) = (deviation, omega_rad_s);
        }
    }
    let deviation_db = 20.0 * log10(1.0 + sqrt(worst));
    if deviation_db > LARGEST_DEVIATION_DB {
        return Err(DesignError::DeviationTooLarge { deviation_db, max_db: LARGEST_DEVIATION_DB });
    }
    Ok(DesignCheck {
        worst_deviation_db: deviation_db,
        worst_deviation_rad_s: worst_rad_s,
        pole_radii,
        l1_gain,
        step_peak,
    })
}

/// Magnitudes of the roots of `z^2 - (2 + k - c) z + 1 + k`, larger first. The discriminant is formed from the small
/// numbers themselves: `(1 + (k - c)/2)^2 - (1 + k) = (k - c)^2 / 4 - c`.
fn pole_radii(section: &Recurrence) -> [f64; 2] {
    let half_shift = (section.k - section.c) / 2.0;
    let discriminant = half_shift * half_shift - section.c;
    if discriminant < 0.0 {
        [sqrt(1.0 + section.k); 2]
    } else {
        let root = sqrt(discriminant);
        [fabs(1.0 + half_shift + root), fabs(1.0 + half_shift - root)]
    }
}

/// L1 gain and largest value of the step response, by summing the impulse response until it has died out. Infinite
/// when it has not after [`LONGEST_RESPONSE_TICKS`].
fn gains(section: &Recurrence, pole_radii: [f64; 2]) -> (f64, f64) {
    let end = RESPONSE_END * (1.0 - pole_radii[0]);
    // A step of the output of size sqrt(c) weighs as much as a deviation of 1 (see the energy in `biquad`).
    let weight = 1.0 / sqrt(section.c);
    let (mut y, mut u) = (0.0, 0.0);
    let (mut l1_gain, mut step, mut step_peak) = (0.0, 0.0, 0.0);
    for tick in 0..LONGEST_RESPONSE_TICKS {
        // The impulse is at tick 0: its step in at that tick and out at the next, each met by g0 and a tick later by g1.
        let input = match tick {
            0 => section.c + section.g0,
            1 => section.g1 - section.g0,
            2 => -section.g1,
            _ => 0.0,
        };
        u += section.k * u - section.c * y + input;
        y += u;
        l1_gain += fabs(y);
        step += y;
        if step > step_peak {
            step_peak = step;
        }
        if tick > 2 && fabs(y) + weight * fabs(u) < end {
            return (l1_gain, step_peak);
        }
    }
    (f64::INFINITY, f64::INFINITY)
}
