//! Where the excess chi-square lies.
//!
//! The excess of the residual's chi-square over that of the noise is split into the parts of each axis.

use rotorlead_records::Excitation;
use serde::Serialize;

use crate::data::split::Split;
use crate::likelihood::Likelihood;
use crate::likelihood::excess::{Excess, Line, Term};
use crate::model::hypothesis::Hypothesis;

/// Bands of a decade in the report. Chosen: a factor of 2.2 each, for a table that is read at a glance.
const BANDS_PER_DECADE: f64 = 3.0;
/// Records whose amplitudes differ by less than this factor count as one amplitude. Chosen: peaks of multisines with other phases differ
/// by some percent; amplitudes that are meant to differ do by more.
const SAME_AMPLITUDE: f64 = 1.1;

/// Ranges whose ends are no farther apart than this part of their width are one. Chosen: stamps put the end of a period off by 1e-6 of it,
/// and no two ranges that differ are so near.
const SAME_RANGE: f64 = 1e-3;

/// A quantity over which the excess chi-square is split.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// Hertz.
    Frequency,
    /// Nominal command; the level of the moment in records that do not repeat.
    Nominal,
    /// Largest deviation of the command; the size of the last step in records that do not repeat.
    Amplitude,
    /// -1 while the response falls, 1 while it rises; after steps down and up in records that do not repeat.
    Direction,
    /// Seconds from the begin of a record.
    Time,
    /// 1 for excited lines, 2 for even ones, 3 for odd ones that are not excited.
    Harmonics,
    /// 1 for multisine records, 2 for square waves, 3 for triangles, 4 for steps, 5 for staircases, 6 for chirps, 7 for others.
    Excitation,
}

impl Axis {
    /// Its name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Frequency => "frequency",
            Self::Nominal => "nominal",
            Self::Amplitude => "amplitude",
            Self::Direction => "direction",
            Self::Time => "time",
            Self::Harmonics => "harmonics",
            Self::Excitation => "excitation",
        }
    }
}

/// A part of an axis with its share of the excess chi-square.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Location {
    /// The axis.
    pub axis: Axis,
    /// From and to, in the axis' unit.
    pub range: (f64, f64),
    /// Share of the excess chi-square, 0..1. The shares of an axis sum up to 1.
    pub share: f64,
    /// Excess of the chi-square over its expected value by noise alone, in standard deviations.
    pub significance: f64,
}

/// What is left in a band of frequencies at a nominal command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapCell {
    /// The nominal command.
    pub nominal: f64,
    /// From and to, hertz.
    pub band_hz: (f64, f64),
    /// By the first model.
    pub before: Excess,
    /// By the improved one.
    pub after: Excess,
}

/// What is left of what is fitted over frequency and nominal command, by increasing nominal command and frequency.
pub(crate) fn map(likelihood: &Likelihood, before: &Hypothesis, after: &Hypothesis) -> Vec<MapCell> {
    let mut cells: Vec<MapCell> = Vec::new();
    for record in &likelihood.data.records {
        let residual = [before, after].map(|hypothesis| likelihood.for_record(record).terms(hypothesis, Split::Train));
        for (term, improved) in residual[0].iter().zip(&residual[1]) {
            let Some(line) = term.line else { continue };
            let (nominal, band_hz) = (record.nominal, band(line.hz));
            let place = cells.iter().position(|cell| (cell.nominal, cell.band_hz) == (nominal, band_hz));
            let place = place.unwrap_or_else(|| {
                let nothing = Excess::default();
                cells.push(MapCell { nominal, band_hz, before: nothing, after: nothing });
                cells.len() - 1
            });
            cells[place].before.add(term.excess);
            cells[place].after.add(improved.excess);
        }
    }
    cells.sort_by(|a, b| a.nominal.total_cmp(&b.nominal).then(a.band_hz.0.total_cmp(&b.band_hz.0)));
    cells
}

/// Parts of one axis.
#[derive(Default)]
struct Parts(Vec<((f64, f64), Excess)>);

impl Parts {
    fn add(&mut self, range: (f64, f64), excess: Excess) {
        match self.0.iter_mut().find(|(other, _)| are_same(*other, range)) {
            Some((_, part)) => part.add(excess),
            None => self.0.push((range, excess)),
        }
    }

    fn locations(mut self, axis: Axis) -> Vec<Location> {
        self.0.sort_by(|a, b| a.0.0.total_cmp(&b.0.0));
        let total: f64 = self.0.iter().map(|(_, part)| part.over().max(0.0)).sum();
        let share = |part: &Excess| if total > 0.0 { part.over().max(0.0) / total } else { 0.0 };
        let located = self.0.iter().map(|(range, part)| Location {
            axis,
            range: *range,
            share: share(part),
            significance: part.significance(),
        });
        if total > 0.0 { located.collect() } else { Vec::new() }
    }
}

/// Whether two ranges are one: periods are as long as the stamps of their record say, which differ by some microseconds.
fn are_same(one: (f64, f64), other: (f64, f64)) -> bool {
    let apart = (one.0 - other.0).abs().max((one.1 - other.1).abs());
    apart <= SAME_RANGE * (one.1 - one.0)
}

/// The band of a frequency. What lies on an edge but for rounding, 1e-9, is above it.
fn band(hz: f64) -> (f64, f64) {
    let index = (hz.log10() * BANDS_PER_DECADE + 1e-9).floor();
    let edge = |index: f64| 10_f64.powf(index / BANDS_PER_DECADE);
    (edge(index), edge(index + 1.0))
}

fn amplitude_group(amplitudes: &[f64], amplitude: f64) -> (f64, f64) {
    let alike = amplitudes.iter().filter(|other| (*other / amplitude).ln().abs() < SAME_AMPLITUDE.ln());
    alike.fold((amplitude, amplitude), |(low, high), other| (low.min(*other), high.max(*other)))
}

/// Place of a line on its axis.
fn harmonics_number(line: Line) -> f64 {
    match (line.is_excited, line.is_even) {
        (true, _) => 1.0,
        (false, true) => 2.0,
        (false, false) => 3.0,
    }
}

/// Place of an excitation on its axis.
fn excitation_number(excitation: Excitation) -> f64 {
    match excitation {
        Excitation::Multisine => 1.0,
        Excitation::Square => 2.0,
        Excitation::Triangle => 3.0,
        Excitation::Step => 4.0,
        Excitation::Staircase => 5.0,
        Excitation::Chirp => 6.0,
        Excitation::Free => 7.0,
        Excitation::Steady => 8.0,
        Excitation::Flight => 9.0,
        Excitation::Random => 10.0,
    }
}

/// Splits the excess chi-square of the fitted rows over every axis.
pub(crate) fn locate(likelihood: &Likelihood, hypothesis: &Hypothesis) -> Vec<Location> {
    let [mut frequency, mut nominal, mut amplitude, mut direction, mut time, mut harmonics, mut excitation] =
        [(); 7].map(|()| Parts::default());
    let amplitudes: Vec<f64> = likelihood.data.records.iter().map(|record| record.amplitude).collect();
    let at = |value: f64| (value, value);
    for record in &likelihood.data.records {
        let of = likelihood.for_record(record);
        for Term { excess, line, nominal: commands, step, direction: way, time_s, .. } in
            of.terms(hypothesis, Split::Train)
        {
            if let Some(line) = line {
                frequency.add(band(line.hz), excess);
                harmonics.add(at(harmonics_number(line)), excess);
                amplitude.add(amplitude_group(&amplitudes, record.amplitude), excess);
            }
            commands.into_iter().for_each(|range| nominal.add(range, excess));
            step.into_iter().for_each(|size| amplitude.add(at(size), excess));
            way.into_iter().for_each(|way| direction.add(at(way), excess));
            time_s.into_iter().for_each(|range| time.add(range, excess));
            excitation.add(at(excitation_number(record.excitation)), excess);
        }
        for Term { excess, direction: way, time_s, .. } in of.terms_in_time(hypothesis, Split::Train) {
            way.into_iter().for_each(|way| direction.add(at(way), excess));
            time_s.into_iter().for_each(|range| time.add(range, excess));
        }
    }
    let all = [
        (Axis::Frequency, frequency),
        (Axis::Nominal, nominal),
        (Axis::Amplitude, amplitude),
        (Axis::Direction, direction),
        (Axis::Time, time),
        (Axis::Harmonics, harmonics),
        (Axis::Excitation, excitation),
    ];
    all.into_iter().flat_map(|(axis, parts)| parts.locations(axis)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn periods_whose_lengths_differ_by_microseconds_are_one_part() {
        let excess = Excess { sum: 3.0, expected: 1.0 };
        let mut parts = Parts::default();
        for range in [(0.0, 10.0), (10.0, 20.0), (0.0, 10.000_002), (9.999_998, 20.000_004), (0.0, 5.0)] {
            parts.add(range, excess);
        }
        let located = parts.locations(Axis::Time);
        assert_eq!(located.len(), 3, "{located:?}");
        // What has no width is itself alone.
        assert!(are_same((1.0, 1.0), (1.0, 1.0)) && !are_same((1.0, 1.0), (1.0 + 1e-9, 1.0)));
    }
}
