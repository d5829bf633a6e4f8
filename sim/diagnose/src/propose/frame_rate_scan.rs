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

use num_complex::Complex64;
use rayon::prelude::*;
use rotorlead_fourier as fourier;

use crate::data::dataset::PreparedRecord;
use crate::data::split::Split;
use crate::estimate::fit::Fit;
use crate::estimate::frame_rate::{at_rate, refined};
use crate::likelihood::adjoint::Adjoint;
use crate::likelihood::isolated_steps::{IsolatedStep, changes, isolated_steps};
use crate::likelihood::{Likelihood, RecordLikelihood as _};
use crate::model::hypothesis::Hypothesis;

/// The rate is looked for within this factor of the one that half a frame of delay tells. Derived: a delay half as long as the mean wait
/// may lie beside the frames. Farther costs time, and more rates match by chance.
const NEAR: f64 = 1.5;
/// Offsets at which a phase is tried once more, in parts of a frame. Chosen: all around, denser near where the first term of the sawtooth
/// has it. More cost only time.
const PHASE_OFFSETS: [f64; 9] = [0.0, -0.05, 0.05, -0.12, 0.12, -0.22, 0.22, -0.37, 0.37];
/// Where all of the sawtooth is tried, in standard deviations of the rate by its first term. Chosen: within two, 95 % of a normal
/// distribution; a parabola finds what is between.
const WIDTHS: [f64; 4] = [-2.0, -1.0, 1.0, 2.0];
/// Peaks that are tried with the whole chain. Chosen: the true one may not be the highest by the first term alone. Fewer claim a rate
/// whose rivals were not tried; more cost only time.
const PEAKS: usize = 12;
/// Of so many peaks the top is looked for between two rates. Chosen: a top between rates loses little, so that twelve of these are the
/// highest. More cost only time.
const COARSE_PEAKS: usize = 150;
/// At so many places to either side. Derived: a sixteenth of a line of the transform apart, where a peak is level.
const BETWEEN: i32 = 4;
/// Phases at which frames are tried where changes are few. Derived: the first parabola around the best reaches half of the way to the
/// next, 0.021 of a frame.
const STEP_PHASES: u32 = 24;
/// Rates per line of a record's transform. Derived: a rate is off by an eighth of a line at most, which loses `1 - sinc(1/8)`, 2.6 %, of a
/// peak.
const FINER: usize = 4;
/// The sum of squares that a rate has to gain beyond two per record. Derived: of one record, chance gains that at a rate with `e^-16`,
/// once in thousands of experiments over some thousand rates. Of twelve it does more often (4e-4 at a rate), and [`unique_peak`] decides.
const LEAST_GAIN: f64 = 30.0;

/// Frames that would lower the chi-square by more than this are visible if they exist. Chosen: 17 standard errors, ten times what a rate
/// has to gain. Lower drops frames that are there; higher keeps frames where there is a delay.
const VISIBLE_CHI_SQUARE: f64 = 300.0;
/// Those that were found are other ones, or none, where they take less than this part of it. Chosen: jitter, and a rate that is a little
/// off, lose much of it. Lower keeps frames that are not there; higher drops some that are.
const LEAST_REALIZED_SHARE: f64 = 0.25;
/// The golden ratio, less one. Standard: its multiples are spread most evenly over a circle.
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
/// them, or where another rate does as well as the best by chance.
pub(crate) fn find_frame_rate(likelihood: &Likelihood, fit: &Fit, effect: usize) -> Option<Hypothesis> {
    let about_hz = fit.hypothesis.effects[effect].values[0];
    if !about_hz.is_finite() {
        return None;
    }
    let spectra: Vec<Spectrum> = likelihood
        .data
        .records
        .iter()
        .filter_map(|record| Spectrum::from_record(likelihood, record, &fit.hypothesis))
        .collect();
    // The few changes of a square wave fit frames of many rates, a multisine's many fit one: together they tell.
    let fitted = || spectra.iter().filter(|spectrum| spectrum.is_fitted);
    let records = fitted().count();
    let step_hz =
        fitted().map(|spectrum| spectrum.rate_hz / spectrum.product.len() as f64).fold(f64::INFINITY, f64::min);
    let nyquist_hz = fitted().map(|spectrum| 0.5 * spectrum.rate_hz).fold(f64::INFINITY, f64::min);
    let gain = |hz: f64| fitted().map(|spectrum| spectrum.gain(hz)).sum::<f64>();
    let (low, high) = (about_hz / NEAR, (about_hz * NEAR).min(nyquist_hz));
    let peaks = peaks(gain, (low, high), step_hz);
    // What is held out may gain as much again.
    let most = peaks.first()?.0;
    if most - 2.0 * (records as f64) < LEAST_GAIN {
        return None;
    }
    // Now with all of the sawtooth and the whole chain.
    let weighed = |hz: f64, hypothesis: Hypothesis| {
        likelihood.chi_square(&hypothesis, Split::Train).map(|left| (left, hz, hypothesis))
    };
    let peaks =
        peaks.into_iter().filter_map(|(_, hz)| weighed(hz, with_rate(likelihood, fit, effect, &spectra, hz, &[0.0])));
    let peaks: Vec<(f64, f64)> = peaks.map(|(left, hz, _)| (left, hz)).collect();
    let peak_hz = unique_peak(&peaks, high - low, FINER as f64 * step_hz)?;
    // A few of its widths.
    let peak = weighed(peak_hz, with_rate(likelihood, fit, effect, &spectra, peak_hz, &PHASE_OFFSETS))?;
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

/// The rate of the least chi-square among `peaks`, pairs of chi-square and rate. `None` if the chi-square of another one is larger by no
/// more than the best of all rates of the range, `line_hz` apart, gains by chance.
fn unique_peak(peaks: &[(f64, f64)], range_hz: f64, line_hz: f64) -> Option<f64> {
    let (least, best_hz) = peaks.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let by_chance = 2.0 * (range_hz / line_hz).ln();
    let is_rival = |(left, hz): &(f64, f64)| *left < least + by_chance && (hz - best_hz).abs() > line_hz;
    (!peaks.iter().any(is_rival)).then_some(best_hz)
}

/// The highest peaks of `gain` over a range, the best first: what is gained, and where.
fn peaks(gain: impl Fn(f64) -> f64 + Sync, (low, high): (f64, f64), step_hz: f64) -> Vec<(f64, f64)> {
    let at = |step: usize| low + step as f64 * step_hz;
    let gains: Vec<f64> =
        (0..((high - low) / step_hz).max(0.0) as usize).into_par_iter().map(|step| gain(at(step))).collect();
    let is_peak = |step: &usize| {
        let beside = |other: Option<&f64>| other.is_none_or(|other| *other <= gains[*step]);
        beside(step.checked_sub(1).and_then(|below| gains.get(below))) && beside(gains.get(step + 1))
    };
    let mut coarse: Vec<usize> = (0..gains.len()).filter(is_peak).collect();
    coarse.sort_by(|a, b| gains[*b].total_cmp(&gains[*a]));
    coarse.truncate(COARSE_PEAKS);
    let finer = |step: usize| {
        let between = (-BETWEEN..=BETWEEN).map(|part| at(step) + f64::from(part) / f64::from(BETWEEN) * step_hz);
        between.map(|hz| (gain(hz), hz)).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((gains[step], at(step)))
    };
    let mut peaks: Vec<(f64, f64)> = coarse.into_par_iter().map(finer).collect();
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0));
    peaks.truncate(PEAKS);
    peaks
}

/// Whether frames of the rate of `effect`, whose phases are free in `fit`, would be visible, but those that were found gain too little. If
/// frames were there, the chi-square would fall by the sum of squares by which the responses to them differ from the response to their
/// mean. `found` is the chi-square with the frames that were found.
pub(crate) fn is_predicted_gain_unrealized(
    likelihood: &Likelihood,
    fit: &Fit,
    effect: usize,
    found: Option<f64>,
) -> bool {
    let with = with_spread_phases(likelihood, &fit.hypothesis, effect);
    let difference = |record: &PreparedRecord| {
        let periodic = likelihood.periodic(record)?;
        let white = |hypothesis| periodic.residual(hypothesis, Split::Train);
        let (mean, framed) = (white(&fit.hypothesis)?, white(&with)?);
        Some(mean.iter().zip(&framed).map(|(mean, framed)| (mean - framed).norm_sqr()).sum::<f64>())
    };
    let shown: f64 = likelihood.data.records.par_iter().filter_map(difference).sum();
    let gained = found.map_or(0.0, |found| fit.chi_square - found);
    shown > VISIBLE_CHI_SQUARE && gained < LEAST_REALIZED_SHARE * shown
}

/// With frames that begin somewhere else in each record.
fn with_spread_phases(likelihood: &Likelihood, known: &Hypothesis, effect: usize) -> Hypothesis {
    let mut hypothesis = known.clone();
    // Multiples of the golden ratio are spread most evenly.
    hypothesis.effects[effect].phases =
        (0..likelihood.data.records.len()).map(|record| (record as f64 * GOLDEN).fract()).collect();
    hypothesis
}

/// With frames of this rate, in each record where its rows leave least, at these offsets from where its spectrum says.
fn with_rate(
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
    let phase = |record: &PreparedRecord| refined(likelihood, record, hypothesis.clone(), effect, offsets);
    let phases: Vec<f64> = likelihood.data.records.par_iter().map(phase).collect();
    hypothesis.effects[effect].phases = phases;
    hypothesis
}

impl Spectrum {
    /// Of a record's fitted rows, or else of those held out: where the frames lie is a matter of the record.
    fn from_record(likelihood: &Likelihood, record: &PreparedRecord, hypothesis: &Hypothesis) -> Option<Self> {
        let adjoint = Adjoint::new(likelihood, record, hypothesis)?;
        let segment = adjoint.segment;
        let rows = segment.rows.len();
        let changes = changes(record, segment, hypothesis);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_top_of_a_peak_is_found_between_two_rates() {
        // The higher one lies beside the rates.
        let gain = |hz: f64| {
            let peak = |top: f64, at_hz: f64| top / (1.0 + ((hz - at_hz) / 0.3).powi(2));
            peak(100.0, 120.25).max(peak(90.0, 150.0))
        };
        let found = peaks(gain, (100.0, 200.0), 1.0);
        assert_eq!(found[0], (100.0, 120.25));
        assert_eq!(found[1], (90.0, 150.0));
        assert!(found.len() <= PEAKS);
    }

    #[test]
    fn a_rate_is_known_where_no_other_does_as_well_by_chance() {
        // 10 000 independent rates: 18.4 by chance.
        let other = |left: f64, hz: f64| unique_peak(&[(500.0, 120.0), (left, hz)], 100.0, 0.01);
        assert_eq!(other(519.0, 90.0), Some(120.0));
        assert_eq!(other(518.0, 90.0), None);
        // A neighbor of the same peak is no rival.
        assert_eq!(other(501.0, 120.005), Some(120.0));
        assert_eq!(unique_peak(&[], 100.0, 0.01), None);
    }
}
