//! Frames of an ESC that nothing ties to the rows: how often they come, and where they lie in each record.
//!
//! A change `du_n` of the command at `t_n` waits for the next frame, by `d_n` of up to one frame `T`. The mean over where the
//! frames may lie is a wait of `T / 2`, and what the true frames do beyond is, to first order in the wait,
//!
//! ```text
//! dy(t) = -sum_n du_n h(t - t_n) (d_n - T/2),    d_n - T/2 = -(T/pi) sum_k sin(2 pi k (phi - f t_n)) / k
//! ```
//!
//! with `h` the impulse response of the lag behind a delay of `T / 2`, `f = 1 / T` and `phi` the part of a frame from the first
//! command to the first frame. The inner product of a residual with the first term of the sawtooth is the Fourier transform of
//! `du_n g_n` at `f`, `g` being the residual run backward through `h`; so one transform per record shows all rates at once,
//! and its angle the phase. Records with many changes are summed up by how much each would gain; all of
//! them, with all of the sawtooth, decide around the best.

use std::f64::consts::{PI, TAU};

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use rayon::prelude::*;
use rotorlead_fourier as fourier;
use rotorlead_numerics::extremum::Parabola;
use rotorlead_numerics::statistics::t_quantile;

use crate::data::dataset::{Record, Split};
use crate::estimate::fit::Fit;
use crate::likelihood::Likelihood;
use crate::likelihood::adjoint::Adjoint;
use crate::likelihood::isolated_steps::{IsolatedStep, changes, isolated_steps};
use crate::model::hypothesis::Hypothesis;

/// The rate is looked for within this factor of the one that half a frame of delay tells.
const NEAR: f64 = 1.5;
/// Offsets at which a phase is tried once more.
const PHASE_OFFSETS: [f64; 9] = [0.0, -0.05, 0.05, -0.12, 0.12, -0.22, 0.22, -0.37, 0.37];
/// How far around the best of these a parabola is laid, each time nearer.
const PHASE_WIDTHS: [f64; 3] = [0.025, 0.01, 0.004];
/// How often a known rate is polished, with half the width each time.
const POLISHES: usize = 3;
/// Before that it is looked for to either side, in parts of a frame over the length of a record and so many steps: what else was wrong
/// with the chain may have pulled it away.
const PULLED: f64 = 0.04;
const PULLED_STEPS: i32 = 5;
/// Where all of the sawtooth is tried, in standard deviations of the rate by its first term.
const WIDTHS: [f64; 4] = [-2.0, -1.0, 1.0, 2.0];
/// Peaks that are tried so.
const PEAKS: usize = 5;
/// Phases at which frames are tried where changes are few.
const STEP_PHASES: u32 = 24;
/// A profile over rates goes to where the chi-square has grown by this much, in so many doublings of its width, and has so many pieces.
const WIDE_ENOUGH: f64 = 60.0;
const MOST_WIDENINGS: usize = 10;
const RATES: u32 = 14;
/// Rates per line of a record's transform.
const FINER: usize = 4;
/// The sum of squares that a rate has to gain beyond two per record: chance gains that once in thousands of experiments.
const LEAST_GAIN: f64 = 30.0;

/// Frames that would take more than this from the chi-square are seen where they are, and those that were found are other ones, or none,
/// where they take less than this part of it.
const SEEN: f64 = 300.0;
const MISSED: f64 = 0.25;
/// The golden ratio, less one.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// What the rows of a record say of frames of every rate.
struct Spectrum {
    place: usize,
    is_fitted: bool,
    /// Changes of the command, where they are few and far between; else empty.
    isolated_steps: Vec<IsolatedStep>,
    rate_hz: f64,
    /// Transform of `du_n g_n`, from rate 0 on, in steps of `rate_hz / product.len()`.
    product: Vec<Complex64>,
    /// Sum of squares of the white `h * (du e^(-2 pi j f t))`, in the same steps.
    power: Vec<f64>,
    /// Seconds from the first command to the first row of the transform.
    begin_s: f64,
}

/// The hypothesis of `fit` with the rate and the phases of the frames of its `effect`. `None` where the records do not show
/// them, or where all that they may gain is less than what the hypothesis is `behind` another, in log likelihood.
pub(crate) fn find(likelihood: &Likelihood, fit: &Fit, effect: usize, behind: f64) -> Option<Hypothesis> {
    let about_hz = fit.hypothesis.effects[effect].values[0];
    if !about_hz.is_finite() {
        return None;
    }
    let spectra: Vec<Spectrum> = likelihood
        .data
        .records
        .iter()
        .filter_map(|record| Spectrum::of(likelihood, record, &fit.hypothesis, 0.5 / about_hz))
        .collect();
    // The few changes of a square wave fit frames of many rates, a multisine's many fit one: together they tell.
    let fitted = || spectra.iter().filter(|spectrum| spectrum.is_fitted);
    let records = fitted().count();
    let step_hz =
        fitted().map(|spectrum| spectrum.rate_hz / spectrum.product.len() as f64).fold(f64::INFINITY, f64::min);
    let nyquist_hz = fitted().map(|spectrum| 0.5 * spectrum.rate_hz).fold(f64::INFINITY, f64::min);
    let gain = |hz: f64| fitted().map(|spectrum| spectrum.gain(hz)).sum::<f64>();
    let (low, high) = (about_hz / NEAR, (about_hz * NEAR).min(nyquist_hz));
    let steps = ((high - low) / step_hz).max(0.0) as u32;
    let at = |step: u32| low + f64::from(step) * step_hz;
    let gains: Vec<f64> = (0..steps).into_par_iter().map(|step| gain(at(step))).collect();
    let is_peak = |step: &usize| {
        let beside = |other: Option<&f64>| other.is_none_or(|other| *other <= gains[*step]);
        beside(step.checked_sub(1).and_then(|below| gains.get(below))) && beside(gains.get(step + 1))
    };
    let mut peaks: Vec<usize> = (0..gains.len()).filter(is_peak).collect();
    peaks.sort_by(|a, b| gains[*b].total_cmp(&gains[*a]));
    peaks.truncate(PEAKS);
    // What is held out may gain as much again.
    let most = gains[*peaks.first()?];
    if most - 2.0 * (records as f64) < LEAST_GAIN || most < behind {
        return None;
    }
    // Now with all of the sawtooth and the whole chain: the peaks, and then a few of the best one's widths.
    let weighed = |hz: f64, hypothesis: Hypothesis| {
        likelihood.chi_square(&hypothesis, Split::Train).map(|left| (left, hz, hypothesis))
    };
    let peaks = peaks.into_iter().map(|peak| at(peak as u32));
    let peaks = peaks.filter_map(|hz| weighed(hz, placed(likelihood, fit, effect, &spectra, hz, &[0.0])));
    let (_, peak_hz, _) = peaks.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let peak = weighed(peak_hz, placed(likelihood, fit, effect, &spectra, peak_hz, &PHASE_OFFSETS))?;
    let known = peak.2.clone();
    let evaluate = |hz: f64| weighed(hz, at_rate(likelihood, &known, effect, hz));
    let near_hz = peak.1;
    let curvature = (gain(near_hz - step_hz) - 2.0 * gain(near_hz) + gain(near_hz + step_hz)) / (step_hz * step_hz);
    let width_hz = if curvature < 0.0 { (2.0 / -curvature).sqrt().min(step_hz) } else { step_hz };
    let mut evaluated: Vec<_> = WIDTHS.iter().filter_map(|widths| evaluate(near_hz + widths * width_hz)).collect();
    evaluated.push(peak);
    evaluated.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (best, best_hz) = evaluated.first().map(|best| (best.0, best.1))?;
    let beside_hz = 0.5 * width_hz;
    let (below, above) = (evaluate(best_hz - beside_hz)?, evaluate(best_hz + beside_hz)?);
    let bend = (below.0 - 2.0 * best + above.0) / (beside_hz * beside_hz);
    let std_hz = if bend > 0.0 { (2.0 / bend).sqrt() } else { width_hz };
    let top_hz = best_hz - if bend > 0.0 { 0.5 * (above.0 - below.0) / beside_hz / bend } else { 0.0 };
    evaluated.extend([below, above]);
    evaluated.extend(evaluate(top_hz.clamp(best_hz - width_hz, best_hz + width_hz)));
    let (_, hz, mut hypothesis) = evaluated.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    hypothesis.effects[effect].profiled_std = std_hz / hz;
    Some(hypothesis)
}

/// Whether frames of the rate of `effect`, which lie anywhere in `fit`, would be seen if they were there: the sum of squares by which
/// the responses to frames differ from the response to their mean is what the chi-square would fall by. `found` is the chi-square with the
/// frames that were found.
pub(crate) fn are_missed(likelihood: &Likelihood, fit: &Fit, effect: usize, found: Option<f64>) -> bool {
    let with = anywhere(likelihood, &fit.hypothesis, effect);
    let difference = |record: &Record| {
        let white = |hypothesis| likelihood.residual(record, hypothesis, Split::Train);
        let (mean, framed) = (white(&fit.hypothesis)?, white(&with)?);
        Some(mean.iter().zip(&framed).map(|(mean, framed)| (mean - framed).norm_sqr()).sum::<f64>())
    };
    let shown: f64 =
        likelihood.data.records.par_iter().filter(|record| record.log.is_none()).filter_map(difference).sum();
    let gained = found.map_or(0.0, |found| fit.chi_square - found);
    shown > SEEN && gained < MISSED * shown
}

/// With frames that begin somewhere else in each record.
fn anywhere(likelihood: &Likelihood, known: &Hypothesis, effect: usize) -> Hypothesis {
    let mut hypothesis = known.clone();
    // Multiples of the golden ratio are spread most evenly.
    hypothesis.effects[effect].phases =
        (0..likelihood.data.records.len()).map(|record| (record as f64 * GOLDEN).fract()).collect();
    hypothesis
}

/// The rate and the phases once more, beside what `fit` has found with them.
pub(crate) fn polish(likelihood: &Likelihood, fit: &Fit, effect: usize) -> Option<Hypothesis> {
    let known = &fit.hypothesis.effects[effect];
    let (near_hz, mut width_hz) = (known.values[0], 2.0 * known.profiled_std * known.values[0]);
    let evaluate = |hz: f64| {
        let hypothesis = at_rate(likelihood, &fit.hypothesis, effect, hz);
        likelihood.chi_square(&hypothesis, Split::Train).map(|left| (left, hz, hypothesis))
    };
    let lengths_s = likelihood
        .data
        .records
        .iter()
        .flat_map(|record| record.segments.first().map(|segment| segment.rows.len() as f64 / record.rate_hz));
    let step_hz = PULLED / lengths_s.fold(0.0, f64::max);
    let pulled = |step: i32| {
        let hypothesis = moved(likelihood, &fit.hypothesis, effect, near_hz + f64::from(step) * step_hz);
        likelihood.chi_square(&hypothesis, Split::Train).map(|left| (left, step))
    };
    let pulled = (-PULLED_STEPS..=PULLED_STEPS).filter_map(pulled).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let mut best = evaluate(near_hz + f64::from(pulled.1) * step_hz)?;
    for _ in 0..POLISHES {
        let (below, above) = (evaluate(best.1 - width_hz)?, evaluate(best.1 + width_hz)?);
        // In widths.
        let parabola = Parabola::through([(-1.0, below.0), (0.0, best.0), (1.0, above.0)]);
        let lowest = parabola.lowest();
        let top = lowest.unwrap_or(0.0).clamp(-1.0, 1.0);
        let rate_std = lowest.map_or(known.profiled_std, |_| parabola.curvature().sqrt().recip() * width_hz / best.1);
        let top = evaluate(best.1 + width_hz * top)?;
        let candidates = [best, below, above, top];
        best = candidates.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
        best.2.effects[effect].profiled_std = rate_std;
        width_hz *= 0.5;
    }
    Some(best.2)
}

/// `known` with the rate that the records agree on, and how well they do.
///
/// Command by command changes from one frame to the next as the rate moves, so the chi-square is jagged. But over a range in which it
/// grows by much more than that, each record's is a parabola `b_r x + c_r x^2` of the rate's offset `x`, and all of them together are
/// least at `x = -sum b / (2 sum c)`. By noise alone `1 / sum c` is the variance of that. A controller whose commands come early
/// and late adds to it, differently in each record: the variance is not less than that by what the records, which have their
/// phases to themselves, differ by (`sum g_r^2 / (2 sum c)^2`, `g_r` the slope of each at `x`; White 1982). Of few records that is itself
/// known badly: as wide as Student's t is, so that 1.96 of it are the interval of 95 %.
pub(crate) fn settle_rate(likelihood: &Likelihood, known: &Hypothesis, effect: usize) -> Option<Hypothesis> {
    let near = &known.effects[effect];
    let hz = near.values[0];
    let evaluate = |offset_hz: f64| -> Option<Vec<f64>> {
        let hypothesis = at_rate(likelihood, known, effect, hz + offset_hz);
        let fitted = likelihood.data.records.par_iter().filter(|record| likelihood.has(record, Split::Train));
        let left = |record: &Record| likelihood.residual(record, &hypothesis, Split::Train);
        fitted.map(|record| Some(left(record)?.iter().map(Complex64::norm_sqr).sum::<f64>())).collect()
    };
    let here: f64 = evaluate(0.0)?.iter().sum();
    let mut width_hz = near.profiled_std.min(1e-4) * hz;
    for _ in 0..MOST_WIDENINGS {
        let sides = [-width_hz, width_hz].map(|offset_hz| evaluate(offset_hz).map(|left| left.iter().sum::<f64>()));
        if sides.iter().all(|left| left.is_none_or(|left| left > here + WIDE_ENOUGH)) {
            break;
        }
        width_hz *= 2.0;
    }
    let half = f64::from(RATES / 2);
    // Offsets in widths.
    let offsets: Vec<f64> = (0..=RATES).map(|place| (f64::from(place) - half) / half).collect();
    let left: Vec<Vec<f64>> = offsets.iter().map(|offset| evaluate(offset * width_hz)).collect::<Option<_>>()?;
    let design = DMatrix::from_fn(offsets.len(), 3, |row, power| offsets[row].powi(power as i32));
    let inverse = (design.transpose() * &design).try_inverse()? * design.transpose();
    let records = left.first()?.len();
    let parabolas: Vec<DVector<f64>> =
        (0..records).map(|record| &inverse * DVector::from_fn(offsets.len(), |row, _| left[row][record])).collect();
    let sum = |power: usize| parabolas.iter().map(|parabola| parabola[power]).sum::<f64>();
    let bend = sum(2);
    if bend <= 0.0 {
        return Some(known.clone());
    }
    let best = (-0.5 * sum(1) / bend).clamp(-1.0, 1.0);
    let slopes: f64 = parabolas.iter().map(|parabola| (parabola[1] + 2.0 * parabola[2] * best).powi(2)).sum();
    let free = (records as f64 - 1.0).max(1.0);
    let wide = t_quantile(0.975, free) / t_quantile(0.975, f64::INFINITY);
    let variance = bend.recip().max(wide * wide * records as f64 / free * slopes / (2.0 * bend).powi(2));
    let mut settled = at_rate(likelihood, known, effect, hz + best * width_hz);
    settled.effects[effect].profiled_std = variance.sqrt() * width_hz / hz;
    Some(settled)
}

/// `known` with frames of a rate near its own, in the middle of each record where they are.
fn moved(likelihood: &Likelihood, known: &Hypothesis, effect: usize, hz: f64) -> Hypothesis {
    let mut hypothesis = known.clone();
    let frames = &mut hypothesis.effects[effect];
    let near_hz = std::mem::replace(&mut frames.values[0], hz);
    for (record, phase) in likelihood.data.records.iter().zip(&mut frames.phases) {
        let rows = record.segments.first().map_or(0.0, |segment| 0.5 * (segment.rows.start + segment.rows.end) as f64);
        *phase += (hz - near_hz) * rows / record.rate_hz;
    }
    hypothesis
}

/// `known` with frames of a rate near its own, where the rows of each record leave least.
pub(crate) fn at_rate(likelihood: &Likelihood, known: &Hypothesis, effect: usize, hz: f64) -> Hypothesis {
    let mut hypothesis = moved(likelihood, known, effect, hz);
    let phases = likelihood
        .data
        .records
        .par_iter()
        .map(|record| refined(likelihood, record, hypothesis.clone(), effect, &[0.0]));
    let phases = phases.collect();
    hypothesis.effects[effect].phases = phases;
    hypothesis
}

/// With frames of this rate, in each record where its rows leave least, at these offsets from where its spectrum says.
fn placed(
    likelihood: &Likelihood,
    fit: &Fit,
    effect: usize,
    spectra: &[Spectrum],
    hz: f64,
    offsets: &[f64],
) -> Hypothesis {
    let mut hypothesis = fit.hypothesis.clone();
    hypothesis.effects[effect].values[0] = hz;
    hypothesis.effects[effect].phases = vec![0.0; likelihood.data.records.len()];
    for spectrum in spectra {
        hypothesis.effects[effect].phases[spectrum.place] = spectrum.phase(hz);
    }
    let phase = |record: &Record| refined(likelihood, record, hypothesis.clone(), effect, offsets);
    let phases: Vec<f64> = likelihood.data.records.par_iter().map(phase).collect();
    hypothesis.effects[effect].phases = phases;
    hypothesis
}

/// The phase of one record near that of `hypothesis` where its rows leave least: the first term of the sawtooth is not all
/// of it.
fn refined(
    likelihood: &Likelihood,
    record: &Record,
    mut hypothesis: Hypothesis,
    effect: usize,
    offsets: &[f64],
) -> f64 {
    let begin = hypothesis.effects[effect].phases[record.place];
    let Some(split) = record.segments.first().map(|segment| segment.split) else { return begin };
    let mut left_at = |phase: f64| {
        hypothesis.effects[effect].phases[record.place] = phase.rem_euclid(1.0);
        let white = likelihood.residual(record, &hypothesis, split);
        white.map_or(f64::INFINITY, |white| white.iter().map(Complex64::norm_sqr).sum::<f64>())
    };
    let least =
        |at: Vec<(f64, f64)>| at.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, begin));
    let (mut left, mut phase) = least(offsets.iter().map(|offset| (left_at(begin + offset), begin + offset)).collect());
    for width in PHASE_WIDTHS {
        let (below, above) = (left_at(phase - width), left_at(phase + width));
        let bend = below - 2.0 * left + above;
        let top = if bend > 0.0 { (0.5 * (below - above) / bend).clamp(-1.0, 1.0) } else { 0.0 };
        let top = phase + width * top;
        (left, phase) = least(vec![(left, phase), (below, phase - width), (above, phase + width), (left_at(top), top)]);
    }
    phase.rem_euclid(1.0)
}

impl Spectrum {
    /// Of a record's fitted rows, or else of those held out: where the frames lie is a matter of the record.
    fn of(likelihood: &Likelihood, record: &Record, hypothesis: &Hypothesis, delay_s: f64) -> Option<Self> {
        let adjoint = Adjoint::of(likelihood, record, hypothesis, delay_s)?;
        let segment = adjoint.segment;
        let rows = segment.rows.len();
        let changes = changes(record, segment);
        let mut product = vec![Complex64::ZERO; FINER * rows];
        for ((product, change), g) in product.iter_mut().zip(&changes).zip(&adjoint.g) {
            *product = Complex64::from(change * g);
        }
        fourier::forward(product.len()).process(&mut product);
        // Power at a rate: transform over the lags of the changes' and the filter's autocorrelations.
        let mut spectrum: Vec<Complex64> = changes.iter().map(|change| Complex64::from(*change)).collect();
        let forward = fourier::forward(rows);
        forward.process(&mut spectrum);
        spectrum.iter_mut().for_each(|line| *line = Complex64::from(line.norm_sqr() / rows as f64));
        fourier::inverse(rows).process(&mut spectrum);
        spectrum.iter_mut().zip(&adjoint.lags).for_each(|(lags, filter)| *lags *= *filter);
        forward.process(&mut spectrum);
        Some(Self {
            place: record.place,
            is_fitted: adjoint.is_fitted(),
            rate_hz: record.rate_hz,
            product,
            power: spectrum.iter().map(|line| line.re.max(0.0)).collect(),
            begin_s: segment.rows.start as f64 / record.rate_hz,
            isolated_steps: isolated_steps(record, &adjoint, &changes),
        })
    }

    fn product_at(&self, hz: f64) -> Complex64 {
        let place = hz / self.rate_hz * self.product.len() as f64;
        // Between lines of the padded transform it is nearly straight, once the turn of the rows' middle is taken out.
        let middle = 0.5 * (self.product.len() / FINER) as f64 / self.rate_hz;
        let turned = |index: usize| {
            let line_hz = index as f64 * self.rate_hz / self.product.len() as f64;
            self.product[index.min(self.product.len() - 1)] * Complex64::cis(TAU * line_hz * middle)
        };
        let (below, part) = (place.floor() as usize, place.fract());
        (turned(below) * (1.0 - part) + turned(below + 1) * part) * Complex64::cis(-TAU * hz * middle)
    }

    fn power_at(&self, hz: f64) -> f64 {
        let place = (hz / self.rate_hz * self.power.len() as f64).round() as usize;
        self.power[place.min(self.power.len() - 1)]
    }

    /// By how much frames of this rate would lower the sum of squares, wherever they lie.
    fn gain(&self, hz: f64) -> f64 {
        if !self.isolated_steps.is_empty() {
            return (0..STEP_PHASES).map(|phase| self.edge_gain(hz, phase)).fold(f64::NEG_INFINITY, f64::max);
        }
        let size = 1.0 / (PI * hz);
        2.0 * size * self.product_at(hz).norm() - 0.5 * size * size * self.power_at(hz)
    }

    /// The same by all of the sawtooth, with the first frame at one of so many phases.
    fn edge_gain(&self, hz: f64, phase: u32) -> f64 {
        let of = |edge: &IsolatedStep| {
            // The wait for the next frame beyond the mean one.
            let frames = f64::from(phase) / f64::from(STEP_PHASES) - hz * edge.at_s;
            let beyond_s = (frames - frames.floor() - 0.5) / hz;
            -2.0 * beyond_s * edge.product - beyond_s * beyond_s * edge.power
        };
        self.isolated_steps.iter().map(of).sum()
    }

    /// The part of a frame from the first command to the first frame.
    fn phase(&self, hz: f64) -> f64 {
        let gain = |phase: &u32| self.edge_gain(hz, *phase);
        let of_edges = (0..STEP_PHASES).max_by(|a, b| gain(a).total_cmp(&gain(b)));
        let turns = match of_edges.filter(|_| !self.isolated_steps.is_empty()) {
            Some(phase) => f64::from(phase) / f64::from(STEP_PHASES),
            // Im(e^(2 pi j phi) C) is largest where the angle is a quarter turn.
            None => 0.25 - self.product_at(hz).arg() / TAU,
        };
        // The transform begins later than the record.
        (turns + hz * self.begin_s).rem_euclid(1.0)
    }
}
