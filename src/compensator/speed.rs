//! The correction of an inverse by the speed that the ESC says: its reference times a gain that settles where the rotor turns as it did
//! when it was identified.
//!
//! An inverse is blind: battery, temperature and a worn propeller change the speed that a command gives, and it does not notice. Replies
//! of bidirectional DShot have the time of an electrical turn. With `v` for the state of the inverse, the command whose steady speed the
//! rotor has now, `n` for the speed over the command that was identified, `T_e` for the measured turn and `k` for the gain:
//!
//! ```text
//! 1.  r' = k r                                    in place of r, before the inverse: its limits stay what they are
//! 2.  w  = c v            c = 1 / k               the command of the flight controller that belongs to v
//! 3.  e  = T_e n(w) - 1                           how much too slow the rotor is
//! 4.  k' = k + omega_i T_u e                      within [0.8, 1.25]
//! 5.  c' = c (2 - k' c)                           a Newton step of 1 / k'
//! ```
//!
//! `T_u` is the time from one update of a motor to the next, [`TICKS_PER_UPDATE`] ticks.
//!
//! # Why it settles
//!
//! Let the rotor turn with `m(v)`, as fast as it once did at `v / K`: `m(v) = n(v / K)`. Then `e = n(v / k) / n(v / K) - 1`. It is positive
//! while `k` is below `K` and negative above, whatever `v` does, for `n` rises. So `k` goes to `K` and to nothing else, with the rate
//! `omega_i` times the elasticity `d ln n / d ln v`, which is at most 1 for a rotor with a propeller. The rotor, its lag and the limits
//! of the output are not in this loop: `k` estimates, and what the output does with it changes `v` in `n` and in `m` alike. A delay `D` of the
//! replies leaves `v` of now over `v` of then, which differ by `omega_i D e` from the loop itself: it would take a `D` of a second
//! to matter, and replies are held for some milliseconds.
//!
//! # Formats
//!
//! | symbol | what it is | format |
//! |---|---|---|
//! | `k`, `c` | gain and its inverse, within [0.8, 1.25] | Q1.30 |
//! | `e` | relative error of the speed | Q1.30 |
//! | `n` | turns per microsecond, at most 1/60 | 36 bits after the point |
//! | `omega_i T_u` | at most 0.002 | 38 bits after the point |
//!
//! `n(w) = n_0 + t (n_1 + t n_2)` with `t = w - from`. A rising quadratic has slopes of at most twice its mean one: with the shortest range
//! of commands, 1/20, a slope is at most `2 / 60 * 20 = 2/3`, 31 bits after the point, and half the change of the slope at most
//! `2/3 * 20 / 2 < 7`, 28 bits after the point. Each fits in 32 bits. So do `k r` before its limit, 1.25 in Q2.29, and `2 - k c`, since
//! both are confined to their range. Products are of 64 bits. There is no division.

use crate::design::SpeedCurve;
use crate::multiply::signed;
use crate::throttle::Command;

/// Control ticks from one update of a motor to the next: one motor per tick, of four.
pub const TICKS_PER_UPDATE: u32 = 4;
/// How fast the gain follows, rad/s. Chosen: a battery sags within seconds of a change of the load, and a rate controller's crossover
/// lies 20 times above this or more, so that the two do not answer each other.
pub const OMEGA_I_RAD_S: f64 = 0.5;
/// How long replies may be missing before the gain returns to one, seconds. Chosen: a disturbance of the line is shorter, and the gain
/// moves by less than `omega_i` in it.
const PATIENCE_S: u32 = 1;

const GAIN_BITS: u32 = 30;
const ONE: i32 = 1 << GAIN_BITS;
/// Least and most gain. Chosen: the speed of a motor at the end of its battery, or with a propeller a size off. What is further off
/// is a fault, which is not to be made up for.
const GAIN_RANGE: (i32, i32) = (ONE / 5 * 4, ONE / 4 * 5);
/// An error beyond this says nothing. Chosen: twice what the gain can make up for. The rotor starts or stands, or the reply is wrong.
const LARGEST_ERROR: i64 = ONE as i64 / 2;

const SPEED_BITS: u32 = 36;
const SLOPE_BITS: u32 = 31;
const BEND_BITS: u32 = 28;
const STEP_BITS: u32 = 38;
const COMMAND_BITS: u32 = crate::throttle::FRACTION_BITS;
/// A revolution per minute in turns per microsecond, so many bits after the point: of a difference over half of the range in Q2.29 it is a
/// slope, `2^31 / (2 * 2^-29)` each. Four times the highest speed, 2^22, is 2^56 of it.
const TURNS_BITS: u32 = SLOPE_BITS + COMMAND_BITS - 1;
const TURNS_PER_US: i64 = ((1_u64 << TURNS_BITS) as f64 / 60e6) as i64;
/// `omega_i` times the ticks of an update: over the ticks in a second it is `omega_i T_u`.
const UPDATES_PER_TICK: u64 = (OMEGA_I_RAD_S * TICKS_PER_UPDATE as f64 * (1_u64 << STEP_BITS) as f64) as u64;

/// The correction of one motor with its state. Without a curve it does nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SpeedCorrection {
    /// `k`.
    gain: i32,
    /// `c`.
    inverse_gain: i32,
    /// `omega_i T_u`; 0 where nothing is corrected.
    rate: i32,
    /// Updates without a reply after which the gain returns to one.
    patience: u32,
    /// Updates that are left until then.
    left: u32,
    /// The lowest command of the curve.
    from: i32,
    /// From there to the highest.
    span: i32,
    /// `n_0`, `n_1` and `n_2`.
    speed: i32,
    slope: i32,
    bend: i32,
}

impl SpeedCorrection {
    /// None: the gain is one.
    pub const NONE: Self = Self {
        gain: ONE,
        inverse_gain: ONE,
        rate: 0,
        patience: 0,
        left: 0,
        from: 0,
        span: 0,
        speed: 0,
        slope: 0,
        bend: 0,
    };

    /// By a curve of validated settings, in a loop of so many ticks per second.
    // Once for all motors: in line it would take several times the flash.
    #[must_use]
    #[inline(never)]
    pub fn new(curve: &SpeedCurve, loop_rate_hz: u32) -> Self {
        let [from, to] = curve.range();
        let [low, middle, high] = curve.erpm().map(i64::from);
        // The settings have them a twentieth of the range apart.
        let half = i64::from(to - from).max(2) / 2;
        let per_half = |erpm: i64| erpm * TURNS_PER_US / half;
        Self {
            rate: (UPDATES_PER_TICK / u64::from(loop_rate_hz.max(1))) as i32,
            patience: PATIENCE_S * loop_rate_hz / TICKS_PER_UPDATE,
            from,
            span: to - from,
            speed: ((low * TURNS_PER_US) >> (TURNS_BITS - SPEED_BITS)) as i32,
            slope: per_half(4 * middle - 3 * low - high) as i32,
            bend: ((per_half(low - 2 * middle + high) << (BEND_BITS + 2 * COMMAND_BITS - 1 - TURNS_BITS)) / half)
                as i32,
            ..Self::NONE
        }
    }

    /// Begins anew, with a gain of one.
    pub const fn reset(&mut self) {
        (self.gain, self.inverse_gain, self.left) = (ONE, ONE, 0);
    }

    /// The gain, which is 1 where nothing is corrected.
    #[must_use]
    pub fn gain(&self) -> f64 {
        f64::from(self.gain) / f64::from(ONE)
    }

    /// Step 1: the reference of the inverse.
    #[inline]
    pub(super) const fn corrected(&self, command: Command) -> Command {
        if self.gain == ONE {
            return command;
        }
        // Also where another wrote into memory of a caller's.
        Command::saturating_from_bits((signed(self.gain, command.to_bits()) >> GAIN_BITS) as i32)
    }

    /// Steps 2 to 5, where the rotor's state is `v` and its last turn took `turn_us` microseconds; negative where no reply has said it of
    /// late.
    ///
    /// The gain is held where the curve does not reach, and for [`PATIENCE_S`] without a reply. Then it returns to one with the same rate.
    // Apart from the tick of the motors, whose registers it would take.
    #[inline(never)]
    pub(super) fn update(&mut self, v: Command, turn_us: i32) {
        if self.rate == 0 {
            return;
        }
        let mut error = None;
        if turn_us >= 0 {
            let t = (signed(self.inverse_gain, v.to_bits()) >> GAIN_BITS) as i32 - self.from;
            if t < 0 || t > self.span {
                return;
            }
            let found = (signed(turn_us, self.speed_at(t)) >> (SPEED_BITS - GAIN_BITS)) - i64::from(ONE);
            error = (found.abs() <= LARGEST_ERROR).then_some(found as i32);
        }
        let error = match error {
            Some(error) => {
                self.left = self.patience;
                error
            }
            None if self.left > 0 => {
                self.left -= 1;
                return;
            }
            None => ONE - self.gain,
        };
        // Rounded away from zero, so that the return to one ends.
        let step = (signed(self.rate, error) >> STEP_BITS) as i32 + i32::from(error > 0);
        self.gain = confined(self.gain + step);
        let rest = 2 * i64::from(ONE) - (signed(self.gain, self.inverse_gain) >> GAIN_BITS);
        self.inverse_gain = confined((signed(self.inverse_gain, rest as i32) >> GAIN_BITS) as i32);
    }

    /// `n`, `t` above the lowest command.
    const fn speed_at(&self, t: i32) -> i32 {
        let slope = self.slope + (signed(self.bend, t) >> (BEND_BITS + COMMAND_BITS - SLOPE_BITS)) as i32;
        self.speed + (signed(slope, t) >> (SLOPE_BITS + COMMAND_BITS - SPEED_BITS)) as i32
    }
}

fn confined(gain: i32) -> i32 {
    gain.clamp(GAIN_RANGE.0, GAIN_RANGE.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{ERPM_RANGE, SHORTEST_SPEED_RANGE};
    use std::vec::Vec;

    fn command(value: f64) -> Command {
        Command::saturating_from_f64(value)
    }

    /// Curves at the ends of their ranges: slow and fast, straight and bent as much as they may be, over little and over everything.
    fn extreme_curves() -> Vec<SpeedCurve> {
        let (low, high) = (f64::from(ERPM_RANGE.0), f64::from(ERPM_RANGE.1));
        let shortest = SHORTEST_SPEED_RANGE.to_f64();
        let mut curves = Vec::new();
        for (from, to) in [(0.0, 1.0), (0.0, shortest), (1.0 - shortest, 1.0), (0.3, 0.5)] {
            for (low, high) in [(low, high), (low, 1.1 * low), (0.9 * high, high)] {
                // A slope of 0 at one end, and a straight line.
                for middle in [(3.0 * low + high) / 4.0 + 0.01 * low, (low + high) / 2.0, (low + 3.0 * high) / 4.0] {
                    let curve =
                        SpeedCurve::new(command(from), command(to), [low, middle, high].map(|erpm| erpm as u32));
                    curves.push(curve);
                }
            }
        }
        curves
    }

    /// Tests run with overflow checks: a sum that overflows panics.
    #[test]
    fn nothing_overflows_and_the_gain_stays_in_its_range() {
        for curve in extreme_curves() {
            for rate in [1000, 5000, 10_000] {
                let mut correction = SpeedCorrection::new(&curve, rate);
                for turn_us in [-1, 0, 1, 60, 857, 65_408, i32::MAX] {
                    for v in [0, 1, 1 << 20, 1 << 25, 1 << 28, (1 << 29) - 1, 1 << 29] {
                        let v = Command::saturating_from_bits(v);
                        for gain in [GAIN_RANGE.0, ONE, GAIN_RANGE.1] {
                            for inverse_gain in [GAIN_RANGE.0, ONE, GAIN_RANGE.1] {
                                correction = SpeedCorrection { gain, inverse_gain, ..correction };
                                for _ in 0..4 {
                                    correction.update(v, turn_us);
                                    assert!((0.8 - 1e-8..=1.25).contains(&correction.gain()));
                                    assert!(correction.corrected(v) <= Command::ONE);
                                }
                            }
                        }
                    }
                }
            }
        }
    }

    /// The last places of the coefficients, 2^-28 and 2^-31, are so much of the lowest speed, 1000/60 per second.
    #[test]
    fn the_speed_is_the_quadratic_to_a_part_in_four_thousand() {
        for curve in extreme_curves() {
            let correction = SpeedCorrection::new(&curve, 5000);
            let [low, middle, high] = curve.erpm().map(f64::from);
            for part in 0..=100 {
                let x = f64::from(part) / 50.0;
                let lagrange = low * (x - 1.0) * (x - 2.0) / 2.0 - middle * x * (x - 2.0) + high * x * (x - 1.0) / 2.0;
                let t = (f64::from(correction.span) * x / 2.0) as i32;
                let erpm = f64::from(correction.speed_at(t)) / libm::ldexp(1.0, SPEED_BITS as i32) * 60e6;
                assert!((erpm / lagrange - 1.0).abs() < 2.5e-4, "{erpm} {lagrange} of {curve:?} at {x}");
            }
        }
    }

    #[test]
    fn the_inverse_gain_follows_and_a_return_to_one_ends() {
        let curve = SpeedCurve::new(command(0.2), command(0.8), [40_000, 70_000, 95_000]);
        // Too far off to say anything.
        for turn_us in [2000, 400] {
            let mut correction = SpeedCorrection::new(&curve, 5000);
            (0..20_000).for_each(|_| correction.update(command(0.5), turn_us));
            assert_eq!(correction.gain(), 1.0);
        }
        for (turn_us, ends_at) in [(1200, 1.25), (600, 0.8)] {
            let mut correction = SpeedCorrection::new(&curve, 5000);
            let v = command(0.5);
            for _ in 0..20_000 {
                correction.update(v, turn_us);
                let product = signed(correction.gain, correction.inverse_gain) as f64 / libm::ldexp(1.0, 60);
                assert!((product - 1.0).abs() < 1e-7, "{product}");
            }
            assert!((correction.gain() - ends_at).abs() < 1e-8, "{}", correction.gain());
            let held = correction.gain;
            for _ in 0..correction.patience {
                correction.update(v, -1);
                assert_eq!(correction.gain, held);
            }
            // 22 time constants of 2 s.
            for _ in 0..44 * 1250 {
                correction.update(v, -1);
            }
            assert!(correction.gain == ONE && (correction.inverse_gain - ONE).abs() <= 1);
        }
    }
}
