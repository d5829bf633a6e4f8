//! How far the actuator is from linear, seen on lines that are not excited.
//!
//! A multisine of odd lines has no even ones, so what repeats at even lines is the even part of a
//! nonlinearity: `u^2` makes sums and differences of two odd numbers. The odd part falls on odd lines; it is
//! seen where some of them are skipped (Pintelon & Schoukens, 2012, section 4.3; Vanhoenacker,
//! Dobrowiecki & Schoukens, IEEE Trans. Instrum. Meas. 50, 2001). What differs from period to period
//! is noise. So one record tells three things apart:
//!
//! ```text
//! noise        mean of s^2                  over the unexcited lines
//! even level   mean of |Y|^2 - s^2          over the even lines
//! odd level    mean of |Y|^2 - s^2          over the skipped odd lines
//! ```
//!
//! with `Y` the mean over periods and `s^2` its noise variance, all per line and relative to the mean
//! of `|Y|^2 - s^2` over the excited lines, the linear response (in the least-squares sense; the
//! nonlinearity shifts it too). All lines are in the band of the excited ones.
//!
//! [`RobustResponse`] finds the same from several records with other phases.

mod robust;
#[cfg(test)]
mod tests;

pub use robust::RobustResponse;

use serde::ser::SerializeStruct as _;
use serde::{Serialize, Serializer};

use crate::spectra::{NoiseSource, Spectrum, UnexcitedLine};
use rotorlead_numerics::statistics::f_upper_tail;

/// A linear model hides a strong nonlinearity when the even or odd distortion is at least this, relative to the linear
/// response: a tenth in amplitude. Chosen: the gain then changes by about as much with the amplitude, more than the errors of a good fit.
pub const STRONG_DISTORTION_DB: f64 = -20.0;

/// Tail probability below which a distortion counts as seen. Chosen: one linear motor in a thousand is called distorted.
const SEEN_LEVEL: f64 = 1e-3;

/// The noise and the distortion of one or several records.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distortion {
    /// Mean of `|Y|^2` over the excited lines, response units squared, without noise.
    pub linear_power: f64,
    /// Mean noise variance of the unexcited lines, for the mean over the periods used.
    pub noise_power: f64,
    /// On even lines; `None` when there are none.
    pub even: Option<DistortionLevel>,
    /// On skipped odd lines; `None` when none is skipped.
    pub odd: Option<DistortionLevel>,
}

/// The distortion on the lines of one kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistortionLevel {
    /// How many lines.
    pub lines: usize,
    /// Mean of `|Y|^2` less its noise, response units squared; below zero by chance where there is no distortion.
    pub power: f64,
    /// `power` relative to the linear response, dB; minus infinity when it is not above zero.
    pub relative_db: f64,
    /// Tail probability of `|Y|^2` if it were noise alone.
    pub p_value: f64,
}

impl Serialize for DistortionLevel {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut values = serializer.serialize_struct("DistortionLevel", 5)?;
        values.serialize_field("lines", &self.lines)?;
        values.serialize_field("level_db", &self.relative_db)?;
        values.serialize_field("p_value", &self.p_value)?;
        values.serialize_field("seen", &self.is_seen())?;
        values.serialize_field("strong", &self.is_strong())?;
        values.end()
    }
}

impl DistortionLevel {
    /// Whether the lines show more than noise (at a level of 0.1 %).
    #[must_use]
    pub fn is_seen(&self) -> bool {
        self.p_value < SEEN_LEVEL
    }

    /// Whether it is seen and at least [`STRONG_DISTORTION_DB`].
    #[must_use]
    pub fn is_strong(&self) -> bool {
        self.is_seen() && self.relative_db >= STRONG_DISTORTION_DB
    }
}

impl Distortion {
    /// From the unexcited lines of records at one nominal command and amplitude.
    ///
    /// `None` when a record excites even lines, when none has unexcited ones within its band, or when a single
    /// period is left, which does not tell noise and distortion apart.
    #[must_use]
    pub fn from_spectra(spectra: &[&Spectrum]) -> Option<Self> {
        let tells = |spectrum: &&Spectrum| {
            spectrum.noise == NoiseSource::BetweenPeriods
                && spectrum.lines.iter().all(|line| line.harmonic % 2 == 1)
                && spectrum.disturbed.iter().all(|line| line.harmonic % 2 == 1)
        };
        if spectra.is_empty() || !spectra.iter().all(tells) {
            return None;
        }
        let excited = spectra.iter().flat_map(|s| &s.lines);
        let linear_power = mean(excited.map(|line| line.response.norm_sqr() - line.variance))?;
        let noise_power = mean(spectra.iter().flat_map(|s| &s.unexcited).map(|line| line.variance))?;
        let level = |parity| level(spectra, parity, linear_power);
        Some(Self { linear_power, noise_power, even: level(0), odd: level(1) })
    }

    /// The noise of a line relative to the linear response, dB.
    #[must_use]
    pub fn noise_db(&self) -> f64 {
        decibels(self.noise_power / self.linear_power)
    }

    /// Whether a linear model hides a strong nonlinearity: the stronger of the levels that are.
    #[must_use]
    pub fn strong(&self) -> Option<DistortionLevel> {
        let strong = [self.even, self.odd].into_iter().flatten().filter(DistortionLevel::is_strong);
        strong.max_by(|a, b| a.relative_db.total_cmp(&b.relative_db))
    }
}

/// The level on unexcited lines whose number leaves `parity` when halved.
fn level(spectra: &[&Spectrum], parity: u32, linear_power: f64) -> Option<DistortionLevel> {
    let of_kind = |line: &&UnexcitedLine| line.harmonic % 2 == parity;
    let lines = || spectra.iter().flat_map(|s| &s.unexcited).filter(of_kind);
    let power = mean(lines().map(|line| line.response.norm_sqr() - line.variance))?;
    // Against the noise line by line, so that drift at the lowest ones does not hide the others. An inverse variance
    // of v degrees of freedom is v / (v - 2) too large in the mean; fewer than 4, where that is two, are taken for 4.
    let ratio = mean(
        lines()
            .filter(|line| line.variance > 0.0)
            .map(|line| line.response.norm_sqr() / line.variance * (1.0 - 2.0 / line.dof.max(4.0))),
    );
    let count = |spectrum: &&Spectrum| spectrum.unexcited.iter().filter(of_kind).count();
    let noise_dof: usize = spectra.iter().map(|s| 2 * count(s) * (s.periods_used - 1)).sum();
    let lines = lines().count();
    Some(DistortionLevel {
        lines,
        power,
        relative_db: decibels(power / linear_power),
        // Without any noise all that is there is seen.
        p_value: ratio.map_or(if power > 0.0 { 0.0 } else { 1.0 }, |ratio| {
            f_upper_tail(ratio, 2.0 * lines as f64, noise_dof as f64)
        }),
    })
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0usize), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / count as f64)
}

fn decibels(power_ratio: f64) -> f64 {
    if power_ratio > 0.0 { 10.0 * power_ratio.log10() } else { f64::NEG_INFINITY }
}
