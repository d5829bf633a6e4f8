//! White residuals of a hypothesis, and their sum of squares.

use num_complex::Complex64;
use rayon::prelude::*;

use super::dataset::{Dataset, InitialCondition, Record, Segment, Split};
use super::hypothesis::Hypothesis;

pub(super) fn dot(a: &[Complex64], b: &[Complex64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.re * b.re + a.im * b.im).sum()
}

/// The white residual of one record over its segments of a split. The state from which the record starts is compared only where
/// that is asked for ([`Dataset::initial_condition`]): else its decay is projected out.
pub(super) fn residual(
    data: &Dataset,
    record: &Record,
    hypothesis: &Hypothesis,
    split: Split,
) -> Option<Vec<Complex64>> {
    if let Some(log) = &record.log {
        let tau_s = hypothesis.base[record.point].time_constant_s;
        let (difference, trace) = hypothesis.seen(data, record)?;
        let white = log.white(split, &difference, &record.time_s, tau_s);
        let beside = record.channels.iter().flat_map(|channel| channel.white(record, split, &trace));
        return Some(white.into_iter().chain(beside).map(Complex64::from).collect());
    }
    let rows = record.end_of(Some(split));
    let simulated = hypothesis.simulate(data, record, rows).ok()?;
    let difference: Vec<f64> = record.measured.iter().zip(&simulated).map(|(y, model)| y - model).collect();
    Some(whiten(record, hypothesis, (split, data.initial_condition), &difference))
}

/// Derivative of [`residual`], which is `at` with `hypothesis`, by the logarithm of the lag's gain. The simulated response is the
/// mean of the measured one plus the gain times what all else makes of the command; so it is the residual less what the
/// measurement itself comes to. `None` where the gain has another part in it.
pub(super) fn by_gain(
    data: &Dataset,
    record: &Record,
    hypothesis: &Hypothesis,
    split: Split,
    at: &[Complex64],
) -> Option<Vec<Complex64>> {
    if record.log.is_some() || hypothesis.drifts() {
        return None;
    }
    let measured = whiten(record, hypothesis, (split, data.initial_condition), &record.measured);
    Some(at.iter().zip(measured).map(|(at, measured)| at - measured).collect())
}

fn whiten(
    record: &Record,
    hypothesis: &Hypothesis,
    (split, starts): (Split, InitialCondition),
    difference: &[f64],
) -> Vec<Complex64> {
    let mut all = Vec::new();
    for segment in record.segments.iter().filter(|segment| segment.split == split) {
        let mut white = segment.whitening.apply(&difference[segment.rows.clone()]);
        if segment.rows.start == 0 && starts == InitialCondition::Free {
            let decay = decay(record, hypothesis, segment);
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
fn decay(record: &Record, hypothesis: &Hypothesis, segment: &Segment) -> Vec<Complex64> {
    let tau_s = hypothesis.base[record.point].time_constant_s;
    segment.whitening.apply_to_decay((-1.0 / (record.rate_hz * tau_s)).exp())
}

/// By how much the response of a record that repeats is off at its begin, and the variance of that by noise.
pub(super) fn off_at_start(data: &Dataset, record: &Record, hypothesis: &Hypothesis) -> Option<(f64, f64)> {
    let segment = record.segments.iter().find(|segment| segment.rows.start == 0)?;
    let simulated = hypothesis.simulate(data, record, segment.rows.end).ok()?;
    let difference: Vec<f64> = record.measured.iter().zip(&simulated).map(|(y, model)| y - model).collect();
    let white = segment.whitening.apply(&difference[segment.rows.clone()]);
    let decay = decay(record, hypothesis, segment);
    let power = dot(&decay, &decay);
    (power > 0.0).then(|| (dot(&decay, &white) / power, power.recip()))
}

/// Part of a row by which the stamps of a record may be off in the mean.
const STAMPS_OFF: f64 = 0.005;

/// How far the rows of the records leave the alignment open. A command takes effect at its row and the response is that of
/// its row's moment, so what is left is a logger's own jitter, whose mean over a record is small. Of a log nobody knows where
/// in its interval a row was taken: a uniform error of one row has this standard deviation.
pub(super) fn time_offset_std(data: &Dataset) -> f64 {
    let longest = |part: f64, are_logs: bool| {
        let there = data.records.iter().filter(|record| record.log.is_some() == are_logs);
        there.map(|record| part / record.rate_hz).reduce(f64::max)
    };
    longest(STAMPS_OFF, false).or_else(|| longest(12_f64.sqrt().recip(), true)).unwrap_or(f64::INFINITY)
}

/// Sum of squares over what is in `split`. `None` where the hypothesis is impossible.
pub(super) fn chi_square(data: &Dataset, hypothesis: &Hypothesis, split: Split) -> Option<f64> {
    let parts: Option<Vec<f64>> = data
        .records
        .par_iter()
        .filter(|record| record.end_of(Some(split)) > 0)
        .map(|record| residual(data, record, hypothesis, split).map(|white| dot(&white, &white)))
        .collect();
    let sum = parts?.iter().sum::<f64>() + (hypothesis.time_offset_s / time_offset_std(data)).powi(2);
    sum.is_finite().then_some(sum)
}

/// Minus twice the log likelihood of what is in `split`, but for a constant: [`chi-square`], and of records that do not repeat that
/// with the errors that they are left with.
pub(super) fn deviance(data: &Dataset, hypothesis: &Hypothesis, split: Split) -> Option<f64> {
    let of_trial = |record: &Record| {
        let Some(log) = &record.log else {
            return residual(data, record, hypothesis, split).map(|white| dot(&white, &white));
        };
        let (difference, trace) = hypothesis.seen(data, record)?;
        let tau_s = hypothesis.base[record.point].time_constant_s;
        let channels: f64 = record.channels.iter().map(|channel| channel.deviance(record, split, &trace)).sum();
        Some(log.deviance(split, &difference, &record.time_s, tau_s) + channels)
    };
    let compared = data.records.par_iter().filter(|record| record.end_of(Some(split)) > 0);
    let parts: Option<Vec<f64>> = compared.map(of_trial).collect();
    let sum = parts?.iter().sum::<f64>() + (hypothesis.time_offset_s / time_offset_std(data)).powi(2);
    sum.is_finite().then_some(sum)
}
