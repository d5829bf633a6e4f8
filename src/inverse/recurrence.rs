//! The tick.

use super::fixed_point::{product, saturated, shift_rounded};
use super::limits::to_output_step;
use super::{COEFFICIENT_BITS, Coefficients, GAIN_BITS, Limits};
use crate::throttle::Command;

/// The conditioned inverse of one motor: 24 bytes. See the [module](super).
///
/// - **Start and switching.** [`Self::reset`] puts it at rest at a command. As long as the input is that command, so is
///   every output, to the step of the output: nothing jumps when the inverse takes over from a bypass.
/// - **Limits.** Every output is within the range of its [`Limits`], and differs from the last by at most their slew. The
///   state is that of a rotor that got this output, so the output leaves a limit as soon as the reference model asks for
///   less.
///
/// # Examples
///
/// A step of the command by 0.1, answered by the inverse of a rotor that is slower at low commands:
///
/// ```
/// use rotorlead::design::{CurvePoint, InverseDesign, ReferenceModel};
/// use rotorlead::inverse::ConditionedInverse;
/// use rotorlead::throttle::Command;
///
/// let curve = [CurvePoint { command: 0.40, tau_s: 0.159 }, CurvePoint { command: 0.65, tau_s: 0.071 }];
/// let reference = ReferenceModel { omega_f_rad_s: 94.2, damping: 0.7071 };
/// let design = InverseDesign::new(reference, 5000.0, &curve)?;
/// let limits = design.limits(Command::ZERO, Command::ONE, 160.0)?; // 16 % per millisecond
///
/// let mut inverse = ConditionedInverse::at_rest(limits, Command::saturating_from_f64(0.5));
/// let mut tick = |command| inverse.update(design.coefficients(), Command::saturating_from_f64(command)).to_f64();
/// assert_eq!(tick(0.5), 0.5);
///
/// let peak = (0..5000).map(|_| tick(0.625)).fold(0.0, f64::max);
/// assert!(peak > 0.99, "{peak}");
/// assert_eq!(tick(0.625), 0.625);
/// # Ok::<(), rotorlead::design::InverseError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConditionedInverse {
    limits: Limits,
    /// The rotor's state, within the limits.
    v: Command,
    /// Last increment of `v` over `A`, Q2.29.
    x: i32,
    /// Last output.
    u: Command,
}

impl ConditionedInverse {
    /// An inverse of a rotor at rest at `level`, rounded to the step of the output and confined to `limits`.
    #[must_use]
    pub const fn at_rest(limits: Limits, level: Command) -> Self {
        let level = limits.nearest_output(level);
        Self { limits, v: level, x: 0, u: level }
    }

    /// Puts the state at rest at `level`, as [`Self::at_rest`]. To switch the inverse in, reset it to the command that the
    /// ESC got last.
    pub const fn reset(&mut self, level: Command) {
        *self = Self::at_rest(self.limits, level);
    }

    /// One control tick: takes the command of the flight controller, returns the command for the ESC, a multiple of 2^-16
    /// within the limits.
    #[inline]
    pub fn update(&mut self, coefficients: &Coefficients, input: Command) -> Command {
        let (a, b) = (coefficients.a(), coefficients.b());
        let v = self.v.to_bits();
        let reference = self.limits.nearest_output(input).to_bits();
        let place = coefficients.at(v);

        // Both products under one rounding: of two, the steady output would not bear the error at 8 kHz.
        let change = shift_rounded::<COEFFICIENT_BITS>(product(a, reference - v) - product(b, self.x));
        let mut x = saturated(i64::from(self.x) + change);
        // Not narrowed: a step of the input may ask for far more than the 4 that an i32 holds.
        let wanted = i64::from(v) + shift_rounded::<GAIN_BITS>(product(place.g(), x));

        let rounded = saturated(to_output_step(wanted));
        self.u = self.limits.reachable(rounded, self.u);
        if self.u.to_bits() != rounded {
            let shortfall = i64::from(self.u.to_bits()) - wanted;
            // Fits in 64 bits: the factor g in `wanted` and the factor h here are nearly inverse.
            x = saturated(i64::from(x) + shift_rounded::<COEFFICIENT_BITS>(shortfall * i64::from(place.h())));
        }
        self.v = self.limits.confined(saturated(i64::from(v) + shift_rounded::<COEFFICIENT_BITS>(product(a, x))));
        self.x = x;
        self.u
    }

    /// The last output. Before the first tick, the level at rest.
    #[must_use]
    pub const fn output(&self) -> Command {
        self.u
    }

    /// The rotor's state `v` that the inverse reckons with: the command whose steady thrust the rotor has now.
    #[must_use]
    pub const fn rotor_state(&self) -> Command {
        self.v
    }

    /// The limits of the output.
    #[must_use]
    pub const fn limits(&self) -> &Limits {
        &self.limits
    }
}
