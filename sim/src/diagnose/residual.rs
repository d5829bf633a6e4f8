//! White residuals of a hypothesis, and their sum of squares.

use num_complex::Complex64;
use rayon::prelude::*;

use super::hypothesis::Hypothesis;
use super::trial::{Purpose, Starts, Stretch, Trial, Trials};

pub(super) fn dot(a: &[Complex64], b: &[Complex64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.re * b.re + a.im * b.im).sum()
}

/// The white residual of one record over its stretches of a purpose. The state from which the record starts is compared only where
/// that is asked for ([`Trials::starts`]): else its decay is projected out.
pub(super) fn residual(
    trials: &Trials,
    trial: &Trial,
    hypothesis: &Hypothesis,
    purpose: Purpose,
) -> Option<Vec<Complex64>> {
    if let Some(log) = &trial.log {
        let tau_s = hypothesis.base[trial.point].time_constant_s;
        let (difference, trace) = hypothesis.seen(trials, trial)?;
        let white = log.white(purpose, &difference, &trial.time_s, tau_s);
        let beside = trial.channels.iter().flat_map(|channel| channel.white(trial, purpose, &trace));
        return Some(white.into_iter().chain(beside).map(Complex64::from).collect());
    }
    let rows = trial.end_of(Some(purpose));
    let simulated = hypothesis.simulate(trials, trial, rows).ok()?;
    let difference: Vec<f64> = trial.measured.iter().zip(&simulated).map(|(y, model)| y - model).collect();
    Some(whiten(trial, hypothesis, (purpose, trials.starts), &difference))
}

/// Derivative of [`residual`], which is `at` with `hypothesis`, by the logarithm of the lag's gain. The simulated response is the
/// mean of the measured one plus the gain times what all else makes of the command; so it is the residual less what the
/// measurement itself comes to. `None` where the gain has another part in it.
pub(super) fn by_gain(
    trials: &Trials,
    trial: &Trial,
    hypothesis: &Hypothesis,
    purpose: Purpose,
    at: &[Complex64],
) -> Option<Vec<Complex64>> {
    if trial.log.is_some() || hypothesis.drifts() {
        return None;
    }
    let measured = whiten(trial, hypothesis, (purpose, trials.starts), &trial.measured);
    Some(at.iter().zip(measured).map(|(at, measured)| at - measured).collect())
}

fn whiten(
    trial: &Trial,
    hypothesis: &Hypothesis,
    (purpose, starts): (Purpose, Starts),
    difference: &[f64],
) -> Vec<Complex64> {
    let mut all = Vec::new();
    for stretch in trial.stretches.iter().filter(|stretch| stretch.purpose == purpose) {
        let mut white = stretch.whitening.apply(&difference[stretch.rows.clone()]);
        if stretch.rows.start == 0 && starts == Starts::Free {
            let decay = decay(trial, hypothesis, stretch);
            let share = dot(&decay, &white) / dot(&decay, &decay);
            if share.is_finite() {
                white.iter_mut().zip(&decay).for_each(|(white, decay)| *white -= decay * share);
            }
        }
        all.append(&mut white);
    }
    all
}

/// A white decay of the lag from 1 on, in response units, at the begin of a stretch.
fn decay(trial: &Trial, hypothesis: &Hypothesis, stretch: &Stretch) -> Vec<Complex64> {
    let tau_s = hypothesis.base[trial.point].time_constant_s;
    stretch.whitening.apply_to_decay((-1.0 / (trial.rate_hz * tau_s)).exp())
}

/// By how much the response of a record that repeats is off at its begin, and the variance of that by noise.
pub(super) fn off_at_start(trials: &Trials, trial: &Trial, hypothesis: &Hypothesis) -> Option<(f64, f64)> {
    let stretch = trial.stretches.iter().find(|stretch| stretch.rows.start == 0)?;
    let simulated = hypothesis.simulate(trials, trial, stretch.rows.end).ok()?;
    let difference: Vec<f64> = trial.measured.iter().zip(&simulated).map(|(y, model)| y - model).collect();
    let white = stretch.whitening.apply(&difference[stretch.rows.clone()]);
    let decay = decay(trial, hypothesis, stretch);
    let power = dot(&decay, &decay);
    (power > 0.0).then(|| (dot(&decay, &white) / power, power.recip()))
}

/// Part of a row by which the stamps of a record may be off in the mean.
const STAMPS_OFF: f64 = 0.005;

/// How far the rows of the records leave the alignment open. A command takes effect at its row and the response is that of
/// its row's moment, so what is left is a logger's own jitter, whose mean over a record is small. Of a log nobody knows where
/// in its interval a row was taken: a uniform error of one row has this standard deviation.
pub(super) fn late_std(trials: &Trials) -> f64 {
    let longest = |part: f64, are_logs: bool| {
        let there = trials.trials.iter().filter(|trial| trial.log.is_some() == are_logs);
        there.map(|trial| part / trial.rate_hz).reduce(f64::max)
    };
    longest(STAMPS_OFF, false).or_else(|| longest(12_f64.sqrt().recip(), true)).unwrap_or(f64::INFINITY)
}

/// Sum of squares over what is for `purpose`. `None` where the hypothesis is impossible.
pub(super) fn misfit(trials: &Trials, hypothesis: &Hypothesis, purpose: Purpose) -> Option<f64> {
    let parts: Option<Vec<f64>> = trials
        .trials
        .par_iter()
        .filter(|trial| trial.end_of(Some(purpose)) > 0)
        .map(|trial| residual(trials, trial, hypothesis, purpose).map(|white| dot(&white, &white)))
        .collect();
    let sum = parts?.iter().sum::<f64>() + (hypothesis.late_s / late_std(trials)).powi(2);
    sum.is_finite().then_some(sum)
}

/// Minus twice the log likelihood of what is for `purpose`, but for a constant: [`misfit`], and of records that do not repeat that
/// with the errors that they are left with.
pub(super) fn surprise(trials: &Trials, hypothesis: &Hypothesis, purpose: Purpose) -> Option<f64> {
    let of_trial = |trial: &Trial| {
        let Some(log) = &trial.log else {
            return residual(trials, trial, hypothesis, purpose).map(|white| dot(&white, &white));
        };
        let (difference, trace) = hypothesis.seen(trials, trial)?;
        let tau_s = hypothesis.base[trial.point].time_constant_s;
        let channels: f64 = trial.channels.iter().map(|channel| channel.surprise(trial, purpose, &trace)).sum();
        Some(log.surprise(purpose, &difference, &trial.time_s, tau_s) + channels)
    };
    let compared = trials.trials.par_iter().filter(|trial| trial.end_of(Some(purpose)) > 0);
    let parts: Option<Vec<f64>> = compared.map(of_trial).collect();
    let sum = parts?.iter().sum::<f64>() + (hypothesis.late_s / late_std(trials)).powi(2);
    sum.is_finite().then_some(sum)
}
