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

#[cfg(test)]
mod tests {
    use super::super::{SlewLimit, TABLE_POINTS};
    use super::*;
    use std::vec::Vec;

    const ONE: i32 = Command::ONE.to_bits();

    /// Coefficients at the ends of their ranges: the lowest and highest `A`, `B` and `g`, and the steepest tables.
    fn extreme_coefficients() -> Vec<Coefficients> {
        let (lowest, highest) = ((1_i64 << (GAIN_BITS - 1)) + 1, i64::from(i32::MAX));
        let zigzag = |low: i64| core::array::from_fn(|i| if i % 2 == 0 { low } else { low * 5 / 4 });
        let tables: [[i64; TABLE_POINTS]; 4] =
            [[lowest; TABLE_POINTS], [highest; TABLE_POINTS], zigzag(lowest), zigzag(highest / 5 * 4)];
        let one = 1 << COEFFICIENT_BITS;
        let mut all = Vec::new();
        for a in [1, one / 2 - 1] {
            for b in [1, one] {
                all.extend(tables.iter().map(|table| Coefficients::new(a, b, *table).unwrap()));
            }
        }
        all
    }

    fn extreme_limits() -> Vec<Limits> {
        let ranges = [(Command::ZERO, Command::ONE), (Command::ZERO, Command::ZERO), (Command::ONE, Command::ONE)];
        let slews = [SlewLimit::from_steps(1).unwrap(), SlewLimit::NONE];
        slews.iter().flat_map(|&slew| ranges.map(|(min, max)| Limits::new(min, max, slew))).collect()
    }

    /// Tests run with overflow checks: a sum that overflows panics.
    #[test]
    fn nothing_overflows_from_any_state() {
        let commands = [0, 1, (1 << 24) - 1, 1 << 24, ONE / 2 + 4095, ONE - 1, ONE].map(Command::saturating_from_bits);
        let pairs = commands.iter().flat_map(|v| commands.map(|u| (*v, u)));
        let states: Vec<_> = pairs.flat_map(|(v, u)| commands.map(|input| [v, u, input])).collect();
        for coefficients in extreme_coefficients() {
            for limits in extreme_limits() {
                for x in [i32::MIN, i32::MIN + 1, -ONE, -1, 0, 1, ONE, i32::MAX] {
                    for [v, u, input] in &states {
                        let (v, u) = (limits.confined(v.to_bits()), limits.nearest_output(*u));
                        let mut inverse = ConditionedInverse { limits, v, x, u };
                        for _ in 0..4 {
                            let output = inverse.update(&coefficients, *input);
                            assert!((limits.min()..=limits.max()).contains(&output));
                            assert!((limits.min()..=limits.max()).contains(&inverse.rotor_state()));
                        }
                    }
                }
            }
        }
    }

    /// The bound of `docs/inverse.md`: from rest `x` stays under 2.05, and so 4 is never reached.
    #[test]
    fn the_increment_stays_within_its_format() {
        let mut random = 1_u64;
        for coefficients in extreme_coefficients() {
            for limits in extreme_limits() {
                let mut inverse = ConditionedInverse::at_rest(limits, Command::ZERO);
                for tick in 0..2000 {
                    random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                    let input = [0, ONE, (random >> 34) as i32 & (ONE - 1)][(random >> 32) as usize % 3];
                    // First held until it saturates, then at random.
                    let input = if tick < 1000 { ONE * ((tick / 250) % 2) } else { input };
                    inverse.update(&coefficients, Command::saturating_from_bits(input));
                    assert!(f64::from(inverse.x).abs() <= 2.05 * f64::from(ONE), "{}", inverse.x);
                }
            }
        }
    }

    #[test]
    fn at_rest_it_passes_the_command_rounded_and_confined() {
        let [coefficients, ..] = extreme_coefficients()[..] else { panic!("no coefficients") };
        let command = Command::saturating_from_f64;
        let limits = Limits::new(command(0.25), command(0.75), SlewLimit::from_steps(1).unwrap());
        for (level, output) in [(0.0, 0.25), (0.5 + 3e-6, 0.5), (0.5 + 1e-5, 0.5 + 1.0 / 65_536.0), (1.0, 0.75)] {
            let mut inverse = ConditionedInverse::at_rest(limits, Command::ONE);
            inverse.reset(command(level));
            for _ in 0..10 {
                assert_eq!(inverse.update(&coefficients, command(level)), command(output));
                assert_eq!((inverse.rotor_state(), inverse.x), (command(output), 0));
            }
        }
    }
}
