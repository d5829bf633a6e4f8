//! Tustin discretization of a lead compensator as one biquad section.

use libm::{fabs, rint, tan};
use num_complex::Complex64;

use super::check::check;
use super::error::within;
use super::recurrence::{FORMAT_ONE, Recurrence};
use super::{
    DesignCheck, DesignError, FASTEST_POLE_RAD, FREQUENCY_RANGE_RAD_S, LOOP_RATE_RANGE_HZ, LeadParameters,
    SMALLEST_COEFFICIENT, slew_limit,
};
use crate::biquad::Coefficients;
use crate::compensator::LeadFilter;
use crate::inverse::SlewLimit;

/// A checked design: the Tustin image of a [`LeadParameters`] at a loop rate, rounded to the section's format, with the slew limit of
/// its output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeadDesign {
    lead: LeadParameters,
    loop_rate_hz: f64,
    prewarp_rad_s: Option<f64>,
    coefficients: Coefficients,
    check: DesignCheck,
    slew_per_s: Option<f64>,
    slew: SlewLimit,
}

impl LeadDesign {
    /// Designs the section for `lead` at `loop_rate_hz` by Tustin's substitution
    /// `s -> a (1 - z^-1) / (1 + z^-1)`, with `a = 2 loop_rate` or, so that both responses agree at `prewarp_rad_s`,
    /// `a = prewarp / tan(prewarp / (2 loop_rate))`. It has no slew limit ([`Self::with_slew`]).
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
        let (slew_per_s, slew) = (None, SlewLimit::NONE);
        Ok(Self { lead, loop_rate_hz, prewarp_rad_s, coefficients, check, slew_per_s, slew })
    }

    /// The same with a slew limit of the output in units of the command per second, as of [`slew_limit`]; 0 for none.
    ///
    /// # Errors
    /// When the slew limit is refused.
    pub fn with_slew(self, slew_per_s: f64) -> Result<Self, DesignError> {
        let slew = slew_limit(slew_per_s, self.loop_rate_hz)?;
        Ok(Self { slew_per_s: (slew_per_s > 0.0).then_some(slew_per_s), slew, ..self })
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

    /// The slew limit of the output, units of the command per second, where there is one.
    #[must_use]
    pub const fn slew_per_s(&self) -> Option<f64> {
        self.slew_per_s
    }

    /// The filter of a [`Compensator`](crate::compensator::Compensator).
    #[must_use]
    pub const fn filter(&self) -> LeadFilter {
        LeadFilter { coefficients: self.coefficients, slew: self.slew }
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

/// The coefficient in its format, to the nearest step.
fn rounded(coefficient: &'static str, value: f64) -> Result<i32, DesignError> {
    let steps = rint(value * FORMAT_ONE);
    if !(SMALLEST_COEFFICIENT..0.5 * FORMAT_ONE).contains(&fabs(steps)) {
        let min = SMALLEST_COEFFICIENT / FORMAT_ONE;
        return Err(DesignError::CoefficientOutOfRange { coefficient, value, min, max: 0.5 });
    }
    Ok(steps as i32)
}
