//! Modes of the stand: what a residual says of every frequency and damping at once.
//!
//! A link behind the motor that is linear and whose size is `a` answers with `1 + a h(f)`. It leaves `a h_k w_k y_k` in the white
//! residual `z_k` of a model without it, with `y` the response of that model and `w` the weights. The best size and what it gains
//! in squares are
//!
//! ```text
//! a = sum Re(conj(h_k w_k y_k) z_k) / sum |h_k w_k y_k|^2,    gain = a sum Re(conj(h_k w_k y_k) z_k).
//! ```
//!
//! Both sums are gathered over all records in bands that are narrow beside any peak, so a place costs a sum over the bands and a
//! fine grid of frequencies and dampings is no matter. A peak is a few percent wide: a coarse grid steps over it.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use num_complex::Complex64;
use rayon::prelude::*;

use super::fit::Fit;
use super::hypothesis::Candidate;
use super::residual::residual;
use super::trial::{Purpose, Trial, Trials};
use crate::plant::effect::{Kind, Linearity, Scale, Site};
use crate::plant::{Lag, OperatingPoint};

/// Bands of a factor e in frequency: a fifth of the narrowest peak's width.
const BANDS: f64 = 400.0;
/// Pieces from one start of a value to the next.
const PIECES_PER_START: usize = 24;
/// Places that are looked at more closely.
const PLACES: usize = 6;

/// Whether a kind is a mode behind the motor.
pub(super) fn is_mode(kind: &Kind) -> bool {
    kind.site == Site::Stand && kind.linearity == Linearity::Exact
}

/// Products of a response with a residual, and its power, in one band.
#[derive(Clone, Copy, Debug, Default)]
struct Band {
    product: Complex64,
    power: f64,
}

/// The modes that the residual of `fit` speaks of most, the loudest first. Empty where no record repeats.
pub(super) fn modes(trials: &Trials, fit: &Fit, kind: &'static Kind) -> Vec<Candidate> {
    let Some(bands) = gather(trials, fit) else { return Vec::new() };
    let searched: Vec<_> = Candidate::searched(kind).collect();
    let Some((size, _)) = searched.iter().find(|(_, parameter)| parameter.null.is_finite()) else { return Vec::new() };
    let mut grid = vec![kind.null()];
    let mut fine = 0;
    for (place, parameter) in searched.iter().filter(|(place, _)| place != size) {
        let pieces = PIECES_PER_START * parameter.starts.len();
        let (low, high) = parameter.plausible;
        let at = |piece: usize| {
            let part = piece as f64 / pieces as f64;
            match parameter.scale {
                Scale::Log => low * (high / low).powf(part),
                Scale::Linear => low + (high - low) * part,
            }
        };
        fine = fine.max(pieces);
        let with = |values: &Vec<f64>, piece: usize| {
            let mut values = values.clone();
            values[*place] = at(piece);
            values
        };
        // The finest value moves slowest, so that the others at one place of it are neighbors.
        grid = (0..=pieces).flat_map(|piece| grid.iter().map(move |values| with(values, piece))).collect();
    }
    let judged: Vec<(f64, Candidate)> = grid.into_par_iter().filter_map(|values| judge(&bands, kind, *size, values)).collect();
    loudest(judged, &searched, *size)
}

/// The loudest that lie apart in the value that has most starts.
fn loudest(
    mut judged: Vec<(f64, Candidate)>,
    searched: &[(usize, &'static crate::plant::effect::Parameter)],
    size: usize,
) -> Vec<Candidate> {
    let finest = searched.iter().filter(|(place, _)| *place != size).max_by_key(|(_, parameter)| parameter.starts.len());
    let Some((place, parameter)) = finest else { return Vec::new() };
    let apart = (parameter.plausible.1 / parameter.plausible.0).ln() / parameter.starts.len() as f64 / 4.0;
    judged.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut found: Vec<Candidate> = Vec::new();
    for (_, candidate) in judged {
        let is_near = |other: &Candidate| (candidate.values[*place] / other.values[*place]).ln().abs() < apart;
        if !found.iter().any(is_near) {
            found.push(candidate);
        }
        if found.len() == PLACES {
            break;
        }
    }
    found
}

/// What a place gains with its best size.
fn judge(bands: &[(f64, Band)], kind: &'static Kind, size: usize, mut values: Vec<f64>) -> Option<(f64, Candidate)> {
    let parameter = &kind.parameters[size];
    values[size] = parameter.null + 1.0;
    (kind.check)(&values).ok()?;
    // A link behind the motor does not depend on where the motor runs.
    let anywhere = OperatingPoint { nominal: 0.5, lag: Lag { gain: 1.0, time_constant_s: 1.0, delay_s: 0.0 }, response: 1.0 };
    let (mut product, mut power) = (0.0, 0.0);
    for (hz, band) in bands {
        let change = (kind.response)(&values, &anywhere, TAU * hz) - 1.0;
        product += (change.conj() * band.product).re;
        power += change.norm_sqr() * band.power;
    }
    let best = product / power;
    let gain = best * product;
    values[size] = (parameter.null + best).clamp(parameter.possible.0, parameter.possible.1);
    gain.is_finite().then(|| (gain, Candidate::new(kind, values)))
}

/// The bands of all records, by frequency.
fn gather(trials: &Trials, fit: &Fit) -> Option<Vec<(f64, Band)>> {
    let of_trial = |trial: &Trial| {
        let white = residual(trials, trial, &fit.hypothesis, Purpose::Fit)?;
        let simulated = fit.hypothesis.simulate(trials, trial, trial.end_of(Some(Purpose::Fit))).ok()?;
        let mut bands: BTreeMap<i64, Band> = BTreeMap::new();
        let mut white = &white[..];
        for stretch in trial.stretches.iter().filter(|stretch| stretch.purpose == Purpose::Fit) {
            let response = stretch.whitening.apply(&simulated[stretch.rows.clone()]);
            let (own, rest) = white.split_at(response.len());
            white = rest;
            for (line, (response, left)) in response.iter().zip(own).enumerate() {
                let hz = (line + 1) as f64 * trial.rate_hz / stretch.rows.len() as f64;
                let band = bands.entry((BANDS * hz.ln()).round() as i64).or_default();
                band.product += response.conj() * left;
                band.power += response.norm_sqr();
            }
        }
        Some(bands)
    };
    let compared = |trial: &&Trial| trial.log.is_none() && trial.end_of(Some(Purpose::Fit)) > 0;
    let those: Vec<&Trial> = trials.trials.iter().filter(compared).collect();
    let parts: Vec<BTreeMap<i64, Band>> = those.into_par_iter().map(of_trial).collect::<Option<_>>()?;
    let mut all: BTreeMap<i64, Band> = BTreeMap::new();
    for (place, part) in parts.into_iter().flatten() {
        let band = all.entry(place).or_default();
        band.product += part.product;
        band.power += part.power;
    }
    (!all.is_empty()).then(|| all.into_iter().map(|(place, band)| ((place as f64 / BANDS).exp(), band)).collect())
}
