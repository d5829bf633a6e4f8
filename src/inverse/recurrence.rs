//! The tick.

use super::fixed_point::{add_high_product, cold_path, product, shift_rounded, shifted_30_saturated};
use super::output_limits::{HALF_STEP, STEP_SHIFT, command_from_steps, nearest_steps};
use super::{COEFFICIENT_BITS, Coefficients, GAIN_BITS, Limits};
use crate::throttle::Command;

/// The conditioned inverse of one motor: 24 bytes. See the [module](super).
///
/// - **Start and switching.** [`Self::reset`] puts it at rest at a command. As long as the input is that command, so is
///   every output, to the step of the output. [`Self::follow`] keeps its state while it is bypassed.
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
    /// The rotor's state, Q2.29, within the limits.
    v: i32,
    /// Last increment of `v` over `A`, Q2.29.
    x: i32,
    /// Last output in steps of 2^-16, within the limits.
    u: i32,
}

/// Half of the last place of `g x`, which has 51 bits after the point.
const HALF_OF_PRODUCT: i64 = 1 << (GAIN_BITS - 1);

impl ConditionedInverse {
    /// An inverse of a rotor at rest at `level`, rounded to the step of the output and confined to `limits`.
    #[must_use]
    pub const fn at_rest(limits: Limits, level: Command) -> Self {
        let u = limits.steps().confined(nearest_steps(level));
        Self { limits, v: u << STEP_SHIFT, x: 0, u }
    }

    /// Puts the state at rest at `level`, as [`Self::at_rest`].
    pub const fn reset(&mut self, level: Command) {
        *self = Self::at_rest(self.limits, level);
    }

    /// One control tick: takes the command of the flight controller, returns the command for the ESC, a multiple of 2^-16
    /// within the limits.
    // The wrappers around it would each cost a call.
    #[inline(always)]
    pub fn update(&mut self, coefficients: &Coefficients, input: Command) -> Command {
        let (v, range, slew) = (self.v, self.limits.steps(), self.limits.slew().steps());
        let reference = range.confined(nearest_steps(input)) << STEP_SHIFT;

        // Step 1. All of it under one rounding: of two, the steady output would not bear the error at 8 kHz.
        let sum = product(coefficients.a(), reference - v) + product(coefficients.one_less_b(), self.x);
        let x = shifted_30_saturated(sum + (1 << (COEFFICIENT_BITS - 1)));

        // Step 2. `u*` and half a step, and `g x` with half of its last place: rounded down at that place it is `u*` and half a
        // step, and at the place of the step the nearest step.
        let place = coefficients.at(v);
        let base = i64::from((v + HALF_STEP).cast_unsigned()) << GAIN_BITS;
        let sum = product(place.g(), x) + base + HALF_OF_PRODUCT;
        let wanted = (sum >> (GAIN_BITS + STEP_SHIFT)) as i32;

        // Step 3. Both comparisons of unsigned numbers, and the limited ticks apart: most are not.
        let change = wanted - self.u;
        let u = if (change + slew).cast_unsigned() > 2 * slew.cast_unsigned() {
            cold_path();
            range.confined(if change < 0 { self.u - slew } else { self.u + slew })
        } else if !range.contains(wanted) {
            range.nearer_end(wanted)
        } else {
            return self.advance(coefficients, x, wanted);
        };

        // Step 4. `u*` is not narrowed: a step of the input may ask for far more than the 4 that an i32 holds. The product fits in
        // 64 bits, and `x` in 32, since the factor g in `u*` and the factor h here are nearly inverse.
        let shortfall = i64::from(((u << STEP_SHIFT) + HALF_STEP).cast_unsigned()) - (sum >> GAIN_BITS);
        let correction = shift_rounded::<COEFFICIENT_BITS>(shortfall * i64::from(place.h().cast_unsigned()));
        self.advance(coefficients, (i64::from(x) + correction) as i32, u)
    }

    /// One control tick in which the ESC gets `output` from elsewhere: steps 4 and 5, so that the state is that of a rotor that got
    /// it. Whenever the inverse is switched in it goes on from there.
    pub fn follow(&mut self, coefficients: &Coefficients, output: Command) {
        let u = self.limits.steps().confined(nearest_steps(output));
        let h = coefficients.at(self.v).h();
        // `|u - v|` is at most 1 and `h` under 2, which fits.
        let x = shift_rounded::<COEFFICIENT_BITS>(i64::from((u << STEP_SHIFT) - self.v) * i64::from(h.cast_unsigned()));
        self.advance(coefficients, x as i32, u);
    }

    /// Step 5: the rotor moves by `A x`. `u` is in steps of the output.
    // In line in both of its places: a call of its own costs a limited tick 7 instructions.
    #[inline(always)]
    fn advance(&mut self, coefficients: &Coefficients, x: i32, u: i32) -> Command {
        self.x = x;
        self.u = u;
        // Four times `A` is under 2^31.
        self.v = self.limits.bits().confined(add_high_product(self.v, coefficients.a() << 2, x));
        command_from_steps(u)
    }

    /// The last output. Before the first tick, the level at rest.
    #[must_use]
    pub const fn output(&self) -> Command {
        command_from_steps(self.u)
    }

    /// The rotor's state `v` that the inverse reckons with: the command whose steady thrust the rotor has now.
    #[must_use]
    pub const fn rotor_state(&self) -> Command {
        Command::from_bits_in_range(self.v)
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

    /// The recurrence as the module's documentation has it, each step with a rounding of its own, in 128 bits.
    fn by_the_equations(inverse: &mut ConditionedInverse, coefficients: &Coefficients, input: Command) -> Command {
        let rounded = |value: i128, bits: u32| (value + (1 << (bits - 1))) >> bits;
        let (min, max) = (i128::from(inverse.limits.min().to_bits()), i128::from(inverse.limits.max().to_bits()));
        let slew = i128::from(inverse.limits.slew().per_tick());
        let (v, x, last) = (i128::from(inverse.v), i128::from(inverse.x), i128::from(inverse.u) << STEP_SHIFT);
        let (a, b) = (i128::from(coefficients.a()), i128::from(coefficients.b()));
        let index = (v >> 24).min(31);
        let point = |index| {
            let g = i128::from(coefficients.gains()[index as usize]);
            [g, ((1 << 52) + g / 2) / g]
        };
        let [low, high] = [point(index), point(index + 1)];
        let [g, h] = [0, 1].map(|i| low[i] + rounded((high[i] - low[i]) * (v - (index << 24)), 24));
        let to_step = |value: i128| rounded(value, STEP_SHIFT) << STEP_SHIFT;

        let reference = to_step(i128::from(input.to_bits())).clamp(min, max);
        let mut x = x + rounded(a * (reference - v) - b * x, COEFFICIENT_BITS);
        let wanted = v + rounded(g * x, GAIN_BITS);
        let u = to_step(wanted).clamp(min.max(last - slew), max.min(last + slew));
        if u != to_step(wanted) {
            x += rounded((u - wanted) * h, COEFFICIENT_BITS);
        }
        inverse.v = (v + rounded(a * x, COEFFICIENT_BITS)).clamp(min, max) as i32;
        inverse.x = i32::try_from(x).unwrap();
        inverse.u = (u >> STEP_SHIFT) as i32;
        inverse.output()
    }

    #[test]
    fn the_tick_is_the_equations_bit_for_bit() {
        let mut random = 1_u64;
        let mut next = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (random >> 33) as i32
        };
        // Beside the extreme ones tables about those of a motor: g of 5 to 60.
        let mut all = extreme_coefficients();
        for _ in 0..40 {
            let mut gain = i64::from(5 << GAIN_BITS) + i64::from(next() & 0x0fff_ffff);
            let gains = core::array::from_fn(|_| {
                gain = gain * i64::from(900 + next() % 200) / 1000;
                gain.max(1 << GAIN_BITS)
            });
            let (a, b) = (1 + next() % (1 << 29), 1 + next() % (1 << 30));
            let slow = next() % 12;
            all.extend(Coefficients::new((a >> slow).max(1), (b >> slow).max(1), gains));
        }
        let command = Command::saturating_from_bits;
        let slews = [1, 20, 262, 3000, 1 << 16].map(|steps| SlewLimit::from_steps(steps).unwrap());
        let mut limits = extreme_limits();
        limits.extend(slews.map(|slew| Limits::new(command(0), command(ONE), slew)));
        limits.extend(slews.map(|slew| Limits::new(command(26_843_546), command(ONE - 54_321), slew)));
        let (mut ticks, mut limited) = (0, 0);
        for coefficients in &all {
            for limits in &limits {
                let mut inverse = ConditionedInverse::at_rest(*limits, command(next() & (ONE - 1)));
                let mut expected = inverse;
                let mut input = 0;
                for tick in 0..600 {
                    // Held, small steps, and any step.
                    if tick % 40 == 0 {
                        input = [0, ONE, next() & (ONE - 1), input + (next() % (1 << 24))][next() as usize % 4];
                    }
                    let output = inverse.update(coefficients, command(input));
                    assert_eq!(output, by_the_equations(&mut expected, coefficients, command(input)));
                    assert_eq!(inverse, expected, "tick {tick}");
                    ticks += 1;
                    limited += u32::from(inverse.v != inverse.u << STEP_SHIFT);
                }
            }
        }
        assert!(ticks > 400_000 && limited > 100_000, "{ticks} {limited}");
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
                        let v = limits.bits().confined(v.to_bits());
                        let u = limits.steps().confined(nearest_steps(*u));
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
