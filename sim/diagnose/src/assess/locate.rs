//! Locate: where the chi-square lies, and whether it is more than noise.
//!
//! On the lines that a period has there is signal, chi-square and noise; `sum |z|^2` of the white residual over `n` lines is a
//! chi-square of `2 n` where only noise is left. What is more than `2 n` is the chi-square, and is shared out along each axis.

use rotorlead_numerics::sample::mean;
use rotorlead_records::Excitation;
use serde::Serialize;

use super::plateau_excess;
use crate::data::dataset::{Record, Segment, Split};
use crate::likelihood::Likelihood;
use crate::model::hypothesis::Hypothesis;
use crate::noise::whitening::Whitening;

/// Lines are compared up to this multiple of the highest excited frequency: what a nonlinearity adds lies there too.
pub(crate) const BEYOND_EXCITED: f64 = 2.0;
/// Bands of a decade in the report.
const BANDS_PER_DECADE: f64 = 3.0;
/// Records whose amplitudes differ by less than this factor count as one amplitude.
const SAME_AMPLITUDE: f64 = 1.1;
/// The noise density is a mean over this many lines, so its own error adds to that of a sum over many.
const DENSITY_LINES: f64 = 48.0;

/// Along what a chi-square is shared out.
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

/// A part of an axis with its share of the chi-square.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Location {
    /// Along what.
    pub axis: Axis,
    /// From and to, in the axis' unit.
    pub range: (f64, f64),
    /// Share of the chi-square over the noise, 0..1. They sum up to 1 over an axis.
    pub share: f64,
    /// By how many standard deviations of the noise's own chi-square the chi-square exceeds it.
    pub significance: f64,
}

/// A chi-square of fewer standard deviations than this is no chi-square.
const SIGNIFICANT: f64 = 5.0;
/// The same for a story that many others look like.
const SUSPICIOUS: f64 = 3.5;
/// What is left is the noise, its density being an estimate, where it is no more than this times it in power.
const NOISE: f64 = 1.05;

/// How much is left, and how much noise would leave.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Excess {
    /// Sum of squares of the white residual.
    pub sum: f64,
    /// What noise leaves on average: two per line.
    pub expected: f64,
}

impl Excess {
    pub(crate) fn add(&mut self, other: Self) {
        self.sum += other.sum;
        self.expected += other.expected;
    }

    /// What is more than noise.
    #[must_use]
    pub fn over(&self) -> f64 {
        self.sum - self.expected
    }

    /// Whether it is no more than noise leaves, whose density is an estimate.
    #[must_use]
    pub fn is_noise(&self) -> bool {
        self.significance() < SIGNIFICANT || self.sum < NOISE * self.expected
    }

    /// Whether it is so little more that a story which many others look like may be believed.
    #[must_use]
    pub fn is_surely_noise(&self) -> bool {
        self.significance() < SUSPICIOUS || self.sum < NOISE * self.expected
    }

    /// The same in standard deviations.
    #[must_use]
    pub fn significance(&self) -> f64 {
        if self.expected == 0.0 {
            return 0.0;
        }
        // 2 n for the chi-square of n degrees of freedom, as much again for the density's own error where it rests on few.
        let variance = 2.0 * self.expected * (1.0 + self.expected / (self.expected + DENSITY_LINES));
        self.over() / variance.sqrt()
    }
}

/// What is left on one line.
struct Line {
    hz: f64,
    excited: bool,
    even: bool,
    excess: Excess,
}

/// The lines of a period with what a hypothesis leaves on them.
fn lines(likelihood: &Likelihood, record: &Record, hypothesis: &Hypothesis, split: Split) -> Vec<Line> {
    if !likelihood.has(record, split) {
        return Vec::new();
    }
    let Some(white) = likelihood.residual(record, hypothesis, split) else { return Vec::new() };
    let applied: Vec<f64> =
        record.command.iter().step_by(record.commands_per_row).take(record.period_rows).copied().collect();
    let command = Whitening::unit(record.period_rows).spectrum(&applied);
    let strongest = command.iter().skip(1).map(|line| line.norm()).fold(0.0, f64::max);
    let period_hz = record.rate_hz / record.period_rows as f64;
    let mut from = 0;
    let mut all = Vec::new();
    let Some(periodic) = likelihood.periodic(record) else { return Vec::new() };
    for (segment, whitening) in periodic.segments(split) {
        let count = whitening.lines();
        for (index, z) in white[from..from + count].iter().enumerate() {
            let line = index + 1;
            let harmonic = line / segment.periods;
            let hz = harmonic as f64 * period_hz;
            if line % segment.periods == 0 && hz <= BEYOND_EXCITED * record.highest_hz {
                let excited = command.get(harmonic).is_some_and(|command| command.norm() > 1e-3 * strongest);
                let excess = Excess { sum: z.norm_sqr(), expected: 2.0 };
                all.push(Line { hz, excited, even: harmonic % 2 == 0, excess });
            }
        }
        from += count;
    }
    all
}

/// What a hypothesis leaves on the lines of all records.
pub(crate) fn excess(likelihood: &Likelihood, hypothesis: &Hypothesis, split: Split) -> Excess {
    let mut total = Excess::default();
    for record in &likelihood.data.records {
        if record.log.is_some() {
            total.add(plateau_excess::excess(likelihood, record, hypothesis, split).unwrap_or_default());
            continue;
        }
        lines(likelihood, record, hypothesis, split).into_iter().for_each(|line| total.add(line.excess));
    }
    total
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
        let left = [before, after].map(|hypothesis| lines(likelihood, record, hypothesis, Split::Train));
        for (line, improved) in left[0].iter().zip(&left[1]) {
            let (nominal, band_hz) = (record.nominal, band(line.hz));
            let place = cells.iter().position(|cell| (cell.nominal, cell.band_hz) == (nominal, band_hz));
            let cell = match place {
                Some(place) => &mut cells[place],
                None => {
                    let nothing = Excess::default();
                    cells.push(MapCell { nominal, band_hz, before: nothing, after: nothing });
                    let last = cells.len() - 1;
                    &mut cells[last]
                }
            };
            cell.before.add(line.excess);
            cell.after.add(improved.excess);
        }
    }
    cells.sort_by(|a, b| a.nominal.total_cmp(&b.nominal).then(a.band_hz.0.total_cmp(&b.band_hz.0)));
    cells
}

/// Parts of one axis.
#[derive(Default)]
pub(crate) struct Parts(Vec<((f64, f64), Excess)>);

/// The axes on which a record that does not repeat lies.
#[derive(Default)]
pub(crate) struct LogParts {
    pub nominal: Parts,
    pub amplitude: Parts,
    pub direction: Parts,
    pub time: Parts,
    pub excitation: Parts,
}

impl Parts {
    pub(crate) fn add(&mut self, range: (f64, f64), excess: Excess) {
        match self.0.iter_mut().find(|(other, _)| *other == range) {
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

fn band(hz: f64) -> (f64, f64) {
    let index = (hz.log10() * BANDS_PER_DECADE + 1e-9).floor();
    let edge = |index: f64| 10_f64.powf(index / BANDS_PER_DECADE);
    (edge(index), edge(index + 1.0))
}

fn amplitude_group(amplitudes: &[f64], amplitude: f64) -> (f64, f64) {
    let alike = amplitudes.iter().filter(|other| (*other / amplitude).ln().abs() < SAME_AMPLITUDE.ln());
    alike.fold((amplitude, amplitude), |(low, high), other| (low.min(*other), high.max(*other)))
}

/// Place of an excitation on its axis.
pub(crate) fn excitation_number(excitation: Excitation) -> f64 {
    match excitation {
        Excitation::Multisine => 1.0,
        Excitation::Square => 2.0,
        Excitation::Triangle => 3.0,
        Excitation::Step => 4.0,
        Excitation::Staircase => 5.0,
        Excitation::Chirp => 6.0,
        Excitation::Free => 7.0,
        Excitation::Steady => 8.0,
    }
}

/// Shares the chi-square of what is fitted out along every axis.
pub(crate) fn locate(likelihood: &Likelihood, hypothesis: &Hypothesis) -> Vec<Location> {
    let (mut frequency, mut harmonics) = (Parts::default(), Parts::default());
    let mut of_logs = LogParts::default();
    likelihood.data.records.iter().for_each(|record| plateau_excess::add(likelihood, record, hypothesis, &mut of_logs));
    let LogParts { mut nominal, mut amplitude, mut direction, mut time, mut excitation } = of_logs;
    let amplitudes: Vec<f64> = likelihood.data.records.iter().map(|record| record.amplitude).collect();
    for record in likelihood.data.records.iter().filter(|record| record.log.is_none()) {
        let kind = excitation_number(record.excitation);
        for line in lines(likelihood, record, hypothesis, Split::Train) {
            let sort = match (line.excited, line.even) {
                (true, _) => 1.0,
                (false, true) => 2.0,
                (false, false) => 3.0,
            };
            harmonics.add((sort, sort), line.excess);
            frequency.add(band(line.hz), line.excess);
            nominal.add((record.nominal, record.nominal), line.excess);
            amplitude.add(amplitude_group(&amplitudes, record.amplitude), line.excess);
            excitation.add((kind, kind), line.excess);
        }
        for part in likelihood.periodic(record).iter().flat_map(|periodic| periodic.segments(Split::Train)) {
            in_time(likelihood, record, part, hypothesis, &mut time, &mut direction);
        }
    }
    let mut all = Vec::new();
    for (axis, parts) in [
        (Axis::Frequency, frequency),
        (Axis::Nominal, nominal),
        (Axis::Amplitude, amplitude),
        (Axis::Direction, direction),
        (Axis::Time, time),
        (Axis::Harmonics, harmonics),
        (Axis::Excitation, excitation),
    ] {
        all.extend(parts.locations(axis));
    }
    all
}

/// Period by period, and while the response rises or falls.
fn in_time(
    likelihood: &Likelihood,
    record: &Record,
    (segment, whitening): (&Segment, &Whitening),
    hypothesis: &Hypothesis,
    time: &mut Parts,
    direction: &mut Parts,
) {
    let Ok(simulated) = hypothesis.simulate(&likelihood.data, record, segment.rows.end) else { return };
    let rows = segment.rows.clone();
    let mut left: Vec<f64> =
        record.measured[rows.clone()].iter().zip(&simulated[rows.clone()]).map(|(y, model)| y - model).collect();
    let mean = mean(&left);
    left.iter_mut().for_each(|left| *left -= mean);
    let variance = whitening.row_variance();
    if variance <= 0.0 {
        return;
    }
    for (index, left) in left.iter().enumerate() {
        let row = rows.start + index;
        let period = row / record.period_rows;
        let excess = Excess { sum: left * left / variance, expected: 1.0 };
        let period_s = record.period_rows as f64 / record.rate_hz;
        time.add((period as f64 * period_s, (period + 1) as f64 * period_s), excess);
        if row > 0 {
            let sign = (simulated[row] - simulated[row - 1]).signum();
            direction.add((sign, sign), excess);
        }
    }
}
