//! A set of spectral lines of equal amplitude, and their sum.

use super::ExcitationError;
use super::interpolation::Grid;
use super::sine::{COSINE_FRACTION_BITS, QuarterWave};

/// Fraction bits of [`Lines::sum`].
pub const SUM_FRACTION_BITS: u32 = COSINE_FRACTION_BITS;

/// Cosines of unit amplitude at the harmonics 1, 3, 5, ... of a base frequency:
///
/// `x(t) = sum_k cos(2 pi ((2 k + 1) t / period + (phase_k + 1/2) / 2^32))`, `k = 0..count`.
///
/// Only odd harmonics are excited, so that the even ones measure a motor's even nonlinearity
/// (Pintelon & Schoukens, System Identification, 2nd ed., section 4.3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lines<'a> {
    period_s: u32,
    peak: f64,
    phases: &'a [u32],
}

impl<'a> Lines<'a> {
    /// The most lines that a set may have: bounds the time that one sample takes.
    pub const MAX_COUNT: usize = 512;

    /// What a sum must stay below: an `i64` with [`SUM_FRACTION_BITS`] holds no more.
    pub const PEAK_LIMIT: f64 = (1_u64 << (63 - SUM_FRACTION_BITS)) as f64;

    /// Odd harmonics of `1 / period_s` hertz, by the phases of harmonics 1, 3, 5, ... in units of
    /// 2^-32 turn. `peak` is the largest `|x(t)|` over all `t` (not only on some grid), in
    /// amplitudes of one line; it must not be understated, since the amplitude follows from it.
    ///
    /// # Errors
    /// When a parameter is out of range: `period_s` 1 to 1000, `phases` 1 to [`Self::MAX_COUNT`],
    /// `peak` 1 (no sum of cosines has less) to just below [`Self::PEAK_LIMIT`].
    pub const fn odd(period_s: u32, phases: &'a [u32], peak: f64) -> Result<Self, ExcitationError> {
        if period_s < 1 || period_s > 1000 {
            return Err(ExcitationError::OutOfRange {
                parameter: "period_s",
                value: period_s as f64,
                min: 1.0,
                max: 1000.0,
            });
        }
        if phases.is_empty() || phases.len() > Self::MAX_COUNT {
            return Err(ExcitationError::OutOfRange {
                parameter: "phases",
                value: phases.len() as f64,
                min: 1.0,
                max: Self::MAX_COUNT as f64,
            });
        }
        // Not `<`, so that NaN is refused too.
        if !(peak >= 1.0 && peak < Self::PEAK_LIMIT) {
            return Err(ExcitationError::OutOfRange {
                parameter: "peak",
                value: peak,
                min: 1.0,
                max: Self::PEAK_LIMIT,
            });
        }
        Ok(Self { period_s, peak, phases })
    }

    /// The period in seconds: one over the frequency of the first line.
    #[must_use]
    pub const fn period_s(&self) -> u32 {
        self.period_s
    }

    /// How many lines there are.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.phases.len()
    }

    /// The phases of harmonics 1, 3, 5, ... in units of 2^-32 turn.
    #[must_use]
    pub const fn phases(&self) -> &'a [u32] {
        self.phases
    }

    /// The number of the highest harmonic.
    #[must_use]
    pub const fn top_harmonic(&self) -> u32 {
        // At most MAX_COUNT phases, so the cast is exact; at least one, so nothing underflows.
        (self.phases.len() as u32) * 2 - 1
    }

    /// The largest `|x(t)|`, in amplitudes of one line.
    #[must_use]
    pub const fn peak(&self) -> f64 {
        self.peak
    }

    /// `x` at `turn / 2^64` of the period, in amplitudes of one line, with [`SUM_FRACTION_BITS`].
    ///
    /// No table, no division, and no branch but the loop's: in code compiled for a Cortex-M4, counted by hand, 22
    /// instructions a line.
    #[must_use]
    #[inline]
    pub fn sum(&self, turn: u64) -> i64 {
        self.partial_sum(turn, 0, self.count())
    }

    /// What `count` lines from the line `first` on, or as many as there are, add to [`Self::sum`]. It may wrap: additions
    /// modulo 2^64 end at the same value in any order, and the whole sum is below [`Self::PEAK_LIMIT`].
    // In line it would find too few registers left for its loop.
    #[inline(never)]
    pub(super) fn partial_sum(&self, turn: u64, first: usize, count: usize) -> i64 {
        // Harmonic m is m turns ahead: from one odd harmonic to the next, twice the first's turn.
        let step = turn.wrapping_mul(2);
        let mut harmonic_turn = turn.wrapping_add(step.wrapping_mul(first as u64));
        let mut sum = 0_i64;
        let wave = QuarterWave::new();
        let end = first.saturating_add(count).min(self.phases.len());
        for &phase in self.phases.get(first..end).unwrap_or_default() {
            let high = (harmonic_turn >> 32) as u32;
            sum = sum.wrapping_add(wave.cosine(high.wrapping_add(phase)));
            harmonic_turn = harmonic_turn.wrapping_add(step);
        }
        sum
    }

    /// How many lines at most are summed in a tick, at so many ticks in a period: what one takes of the core.
    #[must_use]
    pub const fn per_tick(&self, ticks_per_period: u32) -> usize {
        self.count().div_ceil(Grid::new(self, ticks_per_period).step() as usize)
    }
}
