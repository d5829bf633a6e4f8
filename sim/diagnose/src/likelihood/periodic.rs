//! The likelihood of records that repeat: white lines of a spectrum, one sum of squares over all of them.

use num_complex::Complex64;
use rotorlead_identify::simulation::align;
use rotorlead_numerics::sample::mean;
use rotorlead_plant::Trace;

use super::excess::{Excess, Line, Term};
use super::{AuxiliaryResidual, InitialCondition, Power, RecordLikelihood, RecordWeights};
use crate::data::auxiliary::AuxiliaryChannel;
use crate::data::dataset::{Dataset, PreparedRecord, Segment};
use crate::data::split::Split;
use crate::model::hypothesis::Hypothesis;
use crate::noise::whitening::{NoiseDensity, Whitening, dot};

/// Lines are compared up to this multiple of the highest excited frequency: what a nonlinearity adds lies there too. Derived: a square
/// doubles the highest frequency. Higher adds lines of noise alone.
pub(crate) const BEYOND_EXCITED: f64 = 2.0;
/// A line is excited where the command has this part of its strongest line there. Chosen: far above rounding and below the harmonics of a
/// square wave that count. It decides only how a line is listed.
const EXCITED: f64 = 1e-3;

/// Weights of a record that repeats, one for each segment.
#[derive(Clone, Debug)]
pub(crate) struct PeriodicWeights(Vec<Whitening>);

impl PeriodicWeights {
    /// For noise that is not known yet.
    pub fn unit(record: &PreparedRecord) -> Self {
        Self(record.segments.iter().map(|segment| Whitening::unit(segment.rows.len())).collect())
    }

    /// Those of the record's segments that are fitted, each for its first period alone.
    pub fn first_period(&self, record: &PreparedRecord) -> Self {
        Self(
            record.segments_in(Split::Train).map(|(place, segment)| self.0[place].shortened(segment.periods)).collect(),
        )
    }
}

/// A record that repeats, with what it is weighed by.
pub(crate) struct Periodic<'a> {
    data: &'a Dataset,
    record: &'a PreparedRecord,
    weights: &'a PeriodicWeights,
    initial_condition: InitialCondition,
}

impl<'a> Periodic<'a> {
    pub fn new(
        data: &'a Dataset,
        record: &'a PreparedRecord,
        weights: &'a PeriodicWeights,
        initial_condition: InitialCondition,
    ) -> Self {
        Self { data, record, weights, initial_condition }
    }

    /// Its segments of a split, each with what makes its residual white.
    pub fn segments(&self, split: Split) -> impl Iterator<Item = (&'a Segment, &'a Whitening)> {
        let weights = self.weights;
        self.record.segments_in(split).map(|(place, segment)| (segment, &weights.0[place]))
    }

    fn whiten(&self, hypothesis: &Hypothesis, split: Split, difference: &[f64]) -> Vec<Complex64> {
        let mut all = Vec::new();
        for (segment, whitening) in self.segments(split) {
            let mut white = whitening.apply(&difference[segment.rows.clone()]);
            if segment.rows.start == 0 && self.initial_condition == InitialCondition::Free {
                let decay = self.decay(hypothesis, whitening);
                let share = dot(&decay, &white) / dot(&decay, &decay);
                if share.is_finite() {
                    white.iter_mut().zip(&decay).for_each(|(white, decay)| *white -= decay * share);
                }
            }
            all.append(&mut white);
        }
        all
    }

    /// A white decay of the lag from 1 on, in response units, at the begin of a segment.
    fn decay(&self, hypothesis: &Hypothesis, whitening: &Whitening) -> Vec<Complex64> {
        let tau_s = hypothesis.base[self.record.point].time_constant_s;
        whitening.apply_to_decay((-1.0 / (self.record.rate_hz * tau_s)).exp())
    }

    fn difference(&self, hypothesis: &Hypothesis, rows: usize) -> Option<Vec<f64>> {
        let simulated = hypothesis.simulate(self.data, self.record, rows).ok()?;
        Some(self.record.measured.iter().zip(&simulated).map(|(y, model)| y - model).collect())
    }

    /// Sum of squares of the hum that was taken out of a segment: it is noise all the same.
    fn hum(&self, segment: &Segment) -> f64 {
        let hum = self.record.hum.get(segment.rows.clone()).unwrap_or_default();
        hum.iter().map(|hum| hum * hum).sum()
    }

    /// By how much the response is off at its begin, and the variance of that by noise.
    pub fn off_at_start(&self, hypothesis: &Hypothesis) -> Option<(f64, f64)> {
        let mut segments = self.record.segments.iter().zip(&self.weights.0);
        let (segment, whitening) = segments.find(|(segment, _)| segment.rows.start == 0)?;
        let difference = self.difference(hypothesis, segment.rows.end)?;
        let white = whitening.apply(&difference[segment.rows.clone()]);
        let decay = self.decay(hypothesis, whitening);
        let power = dot(&decay, &decay);
        (power > 0.0).then(|| (dot(&decay, &white) / power, power.recip()))
    }
}

impl RecordLikelihood for Periodic<'_> {
    fn end(&self, split: Split) -> usize {
        self.record.segments_in(split).map(|(_, segment)| segment.rows.end).max().unwrap_or(0)
    }

    /// The state from which the record starts is compared only where that is asked for: else its decay is projected out.
    fn residual(&self, hypothesis: &Hypothesis, split: Split) -> Option<Vec<Complex64>> {
        Some(self.whiten(hypothesis, split, &self.difference(hypothesis, self.end(split))?))
    }

    fn by_gain(&self, hypothesis: &Hypothesis, split: Split, at: &[Complex64]) -> Option<Vec<Complex64>> {
        // The simulated response is the mean of the measured one plus the gain times what all else makes of the command; so the
        // derivative is the residual less what the measurement itself comes to.
        (!hypothesis.drifts()).then(|| {
            let measured = self.whiten(hypothesis, split, &self.record.measured);
            at.iter().zip(measured).map(|(at, measured)| at - measured).collect()
        })
    }

    fn auxiliary_residuals(&self, trace: &Trace) -> Option<Vec<AuxiliaryResidual>> {
        let of_channel = |channel: &AuxiliaryChannel| {
            let white = channel.residual(trace)?;
            Some(AuxiliaryResidual { numbers: 2.0 * white.len() as f64, white })
        };
        self.record.auxiliary_channels.iter().map(of_channel).collect()
    }

    fn weighed(&self, hypothesis: &Hypothesis) -> Option<RecordWeights> {
        let (_, residual) = hypothesis.aligned(self.data, self.record)?;
        let periods = self.record.periods();
        let rows = 0..periods * self.record.period_rows;
        let mut weights = self.weights.clone();
        if let Some(density) = NoiseDensity::between_harmonics(&residual[rows], periods, self.record.rate_hz) {
            weights.0.iter_mut().for_each(|whitening| whitening.set_noise(&density, self.record.rate_hz));
        }
        Some(RecordWeights::Periodic(weights))
    }

    fn terms(&self, hypothesis: &Hypothesis, split: Split) -> Vec<Term> {
        let record = self.record;
        if self.end(split) == 0 {
            return Vec::new();
        }
        let Some(white) = self.residual(hypothesis, split) else { return Vec::new() };
        let applied: Vec<f64> =
            record.command.iter().step_by(record.commands_per_row).take(record.period_rows).copied().collect();
        let command = Whitening::unit(record.period_rows).spectrum(&applied);
        let strongest = command.iter().skip(1).map(|line| line.norm()).fold(0.0, f64::max);
        let period_hz = record.rate_hz / record.period_rows as f64;
        let mut white = &white[..];
        let mut all = Vec::new();
        for (segment, whitening) in self.segments(split) {
            let (own, rest) = white.split_at(whitening.lines());
            white = rest;
            // What repeats lies on every so many lines.
            let per_row = 2.0 / segment.rows.len() as f64;
            for (place, z) in own.iter().skip(segment.periods - 1).step_by(segment.periods).enumerate() {
                let harmonic = place + 1;
                let hz = harmonic as f64 * period_hz;
                if hz <= BEYOND_EXCITED * record.highest_hz {
                    let is_excited = command.get(harmonic).is_some_and(|line| line.norm() > EXCITED * strongest);
                    all.push(Term {
                        excess: Excess { sum: z.norm_sqr(), expected: 2.0 },
                        // Parseval's theorem: a line and its mirror image.
                        scale: per_row * whitening.weights()[harmonic * segment.periods].powi(-2),
                        line: Some(Line { hz, is_excited, is_even: harmonic.is_multiple_of(2) }),
                        nominal: Some((record.nominal, record.nominal)),
                        ..Term::default()
                    });
                }
            }
        }
        all
    }

    /// Period by period, and while the response rises or falls.
    fn terms_in_time(&self, hypothesis: &Hypothesis, split: Split) -> Vec<Term> {
        let record = self.record;
        let period_s = record.period_rows as f64 / record.rate_hz;
        let mut all = Vec::new();
        for (segment, whitening) in self.segments(split) {
            let Ok(simulated) = hypothesis.simulate(self.data, record, segment.rows.end) else { continue };
            let variance = whitening.row_variance();
            if variance <= 0.0 {
                continue;
            }
            let residual: Vec<f64> = segment.rows.clone().map(|row| record.measured[row] - simulated[row]).collect();
            let mean = mean(&residual);
            all.extend(segment.rows.clone().zip(residual).map(|(row, residual)| {
                let period = (row / record.period_rows) as f64;
                Term {
                    excess: Excess { sum: (residual - mean).powi(2) / variance, expected: 1.0 },
                    time_s: Some((period * period_s, (period + 1.0) * period_s)),
                    direction: row.checked_sub(1).map(|before| (simulated[row] - simulated[before]).signum()),
                    ..Term::default()
                }
            }));
        }
        all
    }

    fn squares(&self, hypothesis: &Hypothesis, tau_s: f64, split: Split) -> Option<f64> {
        let simulated = hypothesis.simulate(self.data, self.record, self.end(split)).ok()?;
        let of_segment = |segment: &Segment| {
            let rows = segment.rows.clone();
            let (time_s, measured) = (&self.record.time_s[rows.clone()], &self.record.measured[rows.clone()]);
            let aligned = align(time_s, measured, &simulated[rows.clone()], tau_s);
            let squares: f64 = aligned.iter().zip(measured).map(|(model, y)| (y - model).powi(2)).sum();
            squares + self.hum(segment)
        };
        Some(self.segments(split).map(|(segment, _)| of_segment(segment)).sum())
    }

    fn change(&self, one: &Hypothesis, other: &Hypothesis, tau_s: f64, split: Split) -> Option<f64> {
        let end = self.end(split);
        let one = one.simulate(self.data, self.record, end).ok()?;
        let other = other.simulate(self.data, self.record, end).ok()?;
        let of_segment = |segment: &Segment| {
            let rows = segment.rows.clone();
            let (time_s, one) = (&self.record.time_s[rows.clone()], &one[rows.clone()]);
            let other = &other[rows];
            let aligned = match self.initial_condition {
                InitialCondition::Free => align(time_s, one, other, tau_s),
                // The state at the begin is a part of what is predicted.
                InitialCondition::Steady => {
                    let offset = mean(one) - mean(other);
                    other.iter().map(|other| other + offset).collect()
                }
            };
            aligned.iter().zip(one).map(|(other, one)| (one - other).powi(2)).sum::<f64>()
        };
        Some(self.segments(split).map(|(segment, _)| of_segment(segment)).sum())
    }

    fn power(&self, split: Split) -> Power {
        let mut power = Power::default();
        for (segment, whitening) in self.segments(split) {
            let measured = &self.record.measured[segment.rows.clone()];
            let mean = mean(measured);
            power.response += measured.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
            power.noise += whitening.row_variance() * measured.len() as f64 + self.hum(segment);
        }
        power
    }

    fn noise_std(&self) -> f64 {
        self.weights.0.iter().map(|whitening| whitening.row_variance().sqrt()).fold(0.0, f64::max)
    }
}
