//! Excitation for identification: a sum of sinusoids around a nominal command, in integers.
//!
//! One period of [`Lines`] is played tick by tick: the nominal command plus the lines' sum, scaled
//! so that its peak is the wanted amplitude. It starts from the nominal command without a step (the
//! phases of [`ODD_LINES_30_HZ`] and [`ODD_LINES_45_HZ`] make their sum 0 there; other lines must see
//! to it themselves), repeats bit for bit after one period, and ends at the nominal command without a step:
//! after a number of periods, or on request at the next crossing of the nominal command
//! ([`Multisine::stop`]) or at the end of the period ([`Multisine::finish`]).
//!
//! ```
//! use rotorlead::excitation::{Multisine, ODD_LINES_30_HZ};
//! let mut multisine = Multisine::new(ODD_LINES_30_HZ, 0.5, 0.05, 5000.0)?;
//! multisine.start(None);
//! let first = multisine.update();
//! assert_eq!(first, multisine.nominal());
//! # Ok::<(), rotorlead::excitation::ExcitationError>(())
//! ```
//!
//! Setting up takes floating point; a sample takes none, and no division, and cannot panic.

mod error;
mod interpolation;
mod lines;
mod phases;
mod sine;

use core::num::NonZeroU32;

use crate::throttle::Command;
use interpolation::{Grid, POINTS};

pub use error::ExcitationError;
pub use lines::{Lines, SUM_FRACTION_BITS};
pub use phases::{ODD_LINES_30_HZ, ODD_LINES_45_HZ};

/// Periods are at most this long, in ticks: the rounding of one tick's turn, 2^-64, then adds up
/// to less than 2^-30 turn at the highest line that [`Lines`] can have (2^24 * 2^10 * 2^-64).
const MAX_PERIOD_TICKS: f64 = (1_u32 << 24) as f64;

/// Ticks in one period may miss a whole number by this fraction of themselves: far less than an
/// oscillator is off, and more than `f64` loses in the product of rate and period.
const WHOLE_TICKS_TOLERANCE: f64 = 1e-9;

/// Fraction bits of a sum when it meets the gain: the high word of [`SUM_FRACTION_BITS`].
const HIGH_SUM_FRACTION_BITS: u32 = SUM_FRACTION_BITS - 32;

/// Fraction bits of the gain from line amplitudes to command. A sum within the peak times the gain is
/// at most 1/2, which has 62 fraction bits.
const GAIN_FRACTION_BITS: u32 = 62 - HIGH_SUM_FRACTION_BITS;

/// Fraction bits of a command (Q2.29).
const COMMAND_FRACTION_BITS: u32 = Command::ONE.to_bits().trailing_zeros();

/// From the product of sum and gain to a command.
const DEVIATION_SHIFT: u32 = HIGH_SUM_FRACTION_BITS + GAIN_FRACTION_BITS - COMMAND_FRACTION_BITS;

/// What a [`Multisine`] does at the next tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    /// It holds the nominal command.
    Idle,
    /// It plays until another request, or for this many further periods, the current one included.
    Running(Option<NonZeroU32>),
    /// It plays on to the next crossing of the nominal command.
    Stopping,
}

/// The lines' sums at the points of the grid around a tick, and what there is of the next one.
#[derive(Clone, Debug)]
struct Sums {
    /// [`HIGH_SUM_FRACTION_BITS`], rounded down.
    points: [i32; POINTS],
    /// The tick of the next point.
    ahead: u32,
    /// How many lines are summed there, and their sum.
    lines: usize,
    partial: i64,
}

impl Sums {
    /// Around the start of a period.
    fn new(lines: &Lines<'_>, grid: Grid, turn_per_tick: u64) -> Self {
        let mut ahead = grid.first();
        let points = core::array::from_fn(|_| {
            let sum = lines.sum(turn(ahead, turn_per_tick));
            ahead = grid.next(ahead);
            (sum >> 32) as i32
        });
        Self { points, ahead, lines: 0, partial: 0 }
    }
}

const fn turn(tick: u32, turn_per_tick: u64) -> u64 {
    (tick as u64).wrapping_mul(turn_per_tick)
}

/// Plays [`Lines`] around a nominal command.
#[derive(Clone, Debug)]
pub struct Multisine<'a> {
    lines: Lines<'a>,
    /// Command bits.
    nominal: i32,
    /// Of the sum, line amplitudes, [`HIGH_SUM_FRACTION_BITS`], rounded down.
    peak: i32,
    /// Command per line amplitude, [`GAIN_FRACTION_BITS`], rounded down.
    gain: i64,
    grid: Grid,
    /// (2^64 - 1) over the ticks in a period, rounded down.
    turn_per_tick: u64,
    /// Of the lines that are summed in a tick.
    lines_per_tick: usize,
    sums: Sums,
    activity: Activity,
    /// Ticks since the start of the period.
    tick: u32,
    /// Of the last sample from `nominal`, command bits.
    deviation: i32,
}

impl<'a> Multisine<'a> {
    /// `lines` around the command `nominal` with the peak `amplitude` (both 0 to 1), one sample per
    /// tick of a loop at `loop_rate_hz`. It is idle until [`Self::start`].
    ///
    /// Over one period the peak is never above `amplitude` (rounded to a command). It is below by what the grid of ticks
    /// misses of the peak between them (0.1 % at most where the loop rate is 100 times the highest
    /// line or more) and by at most 2 units of 2^-29.
    ///
    /// # Errors
    /// [`ExcitationError`] names the parameter and its limit: a number that is not finite,
    /// `nominal` or `nominal` plus or minus `amplitude` outside 0 to 1, `amplitude` below one unit
    /// of the command, a period that is no whole number of ticks or too many, lines at or above
    /// half the loop rate.
    pub fn new(lines: Lines<'a>, nominal: f64, amplitude: f64, loop_rate_hz: f64) -> Result<Self, ExcitationError> {
        for (parameter, value) in [("nominal", nominal), ("amplitude", amplitude), ("loop_rate_hz", loop_rate_hz)] {
            if !value.is_finite() {
                return Err(ExcitationError::NotFinite { parameter });
            }
        }
        in_range("nominal", nominal, 0.0, 1.0)?;
        let nominal = Command::saturating_from_f64(nominal).to_bits();
        let one = Command::ONE.to_bits();
        let scale = f64::from(one);
        // What is left between the nominal command and the nearer end, after its rounding.
        let room = nominal.min(one - nominal);
        // The caller's decimal 0.05 may round either way, as the nominal command's 0.95 does:
        // one unit over the room is the same number.
        let amplitude_bits = amplitude * scale;
        if !(amplitude_bits >= 1.0 && amplitude_bits < f64::from(room) + 1.0) {
            return Err(ExcitationError::OutOfRange {
                parameter: "amplitude",
                value: amplitude,
                min: 1.0 / scale,
                max: f64::from(room) / scale,
            });
        }
        let amplitude_bits = amplitude_bits.min(f64::from(room));

        let period_s = f64::from(lines.period_s());
        let ticks = loop_rate_hz * period_s;
        let top = f64::from(lines.top_harmonic());
        if ticks <= 2.0 * top {
            return Err(ExcitationError::AboveNyquist { top_hz: top / period_s, limit_hz: loop_rate_hz / 2.0 });
        }
        in_range("loop_rate_hz", loop_rate_hz, 0.0, MAX_PERIOD_TICKS / period_s)?;
        // In range, so the cast only rounds.
        let ticks_per_period = (ticks + 0.5) as u32;
        let miss = ticks - f64::from(ticks_per_period);
        if miss.abs() > WHOLE_TICKS_TOLERANCE * ticks {
            return Err(ExcitationError::PeriodNotWhole { ticks });
        }

        // At most 1/2 over a peak of at least 1.
        let per_line = amplitude_bits / scale / lines.peak();
        let turn_per_tick = u64::MAX / u64::from(ticks_per_period);
        let grid = Grid::new(&lines, ticks_per_period);
        Ok(Self {
            lines,
            nominal,
            // Below PEAK_LIMIT, which is 2^31 in these bits.
            peak: (lines.peak() * (1_u64 << HIGH_SUM_FRACTION_BITS) as f64) as i32,
            gain: (per_line * (1_u64 << GAIN_FRACTION_BITS) as f64) as i64,
            grid,
            turn_per_tick,
            lines_per_tick: lines.per_tick(ticks_per_period),
            sums: Sums::new(&lines, grid, turn_per_tick),
            activity: Activity::Idle,
            tick: 0,
            deviation: 0,
        })
    }

    /// The command around which it plays, and at which it rests.
    #[must_use]
    pub fn nominal(&self) -> Command {
        Command::saturating_from_bits(self.nominal)
    }

    /// Ticks in one period.
    #[must_use]
    pub fn ticks_per_period(&self) -> u32 {
        self.grid.ticks_per_period()
    }

    /// Ticks since the start of the period, of the sample that comes next. Behind a stop: where it stopped.
    #[must_use]
    pub fn tick(&self) -> u32 {
        self.tick
    }

    /// What it does at the next tick.
    #[must_use]
    pub fn activity(&self) -> Activity {
        self.activity
    }

    /// Plays from the start of a period: `periods` of them, or without end. Without effect unless
    /// idle, since a jump to the start would be a step. After a stop within a period it sums all lines at twelve points.
    pub fn start(&mut self, periods: Option<NonZeroU32>) {
        if self.activity != Activity::Idle {
            return;
        }
        if self.tick != 0 {
            self.tick = 0;
            self.sums = Sums::new(&self.lines, self.grid, self.turn_per_tick);
        }
        self.activity = Activity::Running(periods);
    }

    /// Plays on to the end of the period, then rests.
    pub fn finish(&mut self) {
        if let Activity::Running(_) = self.activity {
            self.activity = Activity::Running(Some(NonZeroU32::MIN));
        }
    }

    /// Plays on until it crosses the nominal command, then rests there. The last change is no
    /// larger than the one that the signal itself would have made.
    ///
    /// With the lines of this module that takes some tens of milliseconds, and with any odd lines
    /// half a period at most, because `x(t + period/2) = -x(t)`.
    pub fn stop(&mut self) {
        if self.activity != Activity::Idle {
            self.activity = Activity::Stopping;
        }
    }

    /// The command of this tick.
    pub fn update(&mut self) -> Command {
        if self.activity == Activity::Idle {
            return self.nominal();
        }
        let sum = self.grid.sample(self.tick, &self.sums.points);
        // Bounds the output, and the product, also for lines whose peak is understated.
        let sum = sum.max(-i64::from(self.peak)).min(i64::from(self.peak));
        // Peak times gain is the amplitude at most, so this stays within 2^61.
        let scaled = sum.wrapping_mul(self.gain);
        let rounding = 1_i64 << (DEVIATION_SHIFT - 1);
        let deviation = (scaled.wrapping_add(rounding) >> DEVIATION_SHIFT) as i32;

        let at_nominal = self.deviation == 0 || deviation == 0;
        let crossed = (self.deviation < 0) != (deviation < 0);
        if self.activity == Activity::Stopping && (at_nominal || crossed) {
            self.rest();
            return self.nominal();
        }
        self.deviation = deviation;
        self.advance();
        Command::saturating_from_bits(self.nominal.wrapping_add(deviation))
    }

    fn advance(&mut self) {
        self.sum_ahead();
        self.tick = self.tick.wrapping_add(1);
        if self.grid.has(self.tick) {
            self.next_point();
        }
        if self.tick < self.grid.ticks_per_period() {
            return;
        }
        // From here on every bit is as it was one period ago.
        self.tick = 0;
        if let Activity::Running(Some(periods)) = self.activity {
            match NonZeroU32::new(periods.get() - 1) {
                Some(left) => self.activity = Activity::Running(Some(left)),
                None => self.rest(),
            }
        }
    }

    /// Sums a tick's share of the lines at the point ahead.
    fn sum_ahead(&mut self) {
        let Sums { ahead, lines, partial, .. } = &mut self.sums;
        let turn = turn(*ahead, self.turn_per_tick);
        *partial = partial.wrapping_add(self.lines.partial_sum(turn, *lines, self.lines_per_tick));
        *lines = lines.wrapping_add(self.lines_per_tick);
    }

    /// The point ahead, of which all lines are summed, is one of those around the tick from now on.
    fn next_point(&mut self) {
        let Sums { points, ahead, lines, partial } = &mut self.sums;
        points.rotate_left(1);
        points[POINTS - 1] = (*partial >> 32) as i32;
        *ahead = self.grid.next(*ahead);
        (*lines, *partial) = (0, 0);
    }

    fn rest(&mut self) {
        self.activity = Activity::Idle;
        self.deviation = 0;
    }
}

fn in_range(parameter: &'static str, value: f64, min: f64, max: f64) -> Result<(), ExcitationError> {
    if value < min || value > max {
        return Err(ExcitationError::OutOfRange { parameter, value, min, max });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
