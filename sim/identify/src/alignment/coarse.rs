//! Where to begin: the delays and skews at which the two logs resemble each other.
//!
//! The correlation coefficient of command and response over the rows that they share, at every shift and at skews that
//! are close enough together for the shift not to blur. Gaps take no part: both logs have a mask, and mean and variance
//! are those of the part in common (masked normalized correlation: Padfield 2012).

use std::sync::Arc;

use num_complex::Complex64;
use rotorlead_fourier::{self as fourier, ComplexToReal, RealToComplex};

use super::logs::CommandSignal;
use super::{AlignmentOptions, CommandLog, ResponseLog};

/// A place to begin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Candidate {
    /// Delay at the middle of the response log, the lag included, seconds.
    pub(super) delay_s: f64,
    pub(super) skew: f64,
    /// Correlation coefficient.
    pub(super) correlation: f64,
}

/// Most cells of a grid. Chosen: two logs of ten minutes then have cells of 18 ms, still below a rotor's lag; twice as many cells take
/// twice the time.
const MOST_CELLS: f64 = 65_536.0;
/// How far the ends of a log move from one skew that is tried to the next, seconds. Chosen: less than a rotor's lag, over which a
/// correlation falls; half of it takes twice the time.
const BLUR_S: f64 = 0.02;
/// Least share of the shorter log that both have in common. Chosen: short overlaps correlate by chance; a larger share refuses logs that
/// were started apart.
const LEAST_SHARE: f64 = 0.5;
/// Delays closer than this are in the same basin, seconds. Chosen: about a rotor's lag; a smaller bound fits one basin twice, a larger one
/// hides a rival.
const APART_S: f64 = 0.1;
/// Least correlation of a candidate, as a share of the best one. Chosen: a fit decides between candidates; nearer to 1 the right one may
/// be lost, lower only costs fits.
const WORTH: f64 = 0.8;
/// Most candidates kept. Chosen: each costs a fit; fewer may lose the right one where a command nearly repeats.
const MOST: usize = 4;

/// A log on the grid: sums of what falls into each cell are means; empty cells are masked.
struct Masked {
    mask: Vec<f64>,
    value: Vec<f64>,
}

impl Masked {
    fn zeros(cells: usize) -> Self {
        Self { mask: vec![0.0; cells], value: vec![0.0; cells] }
    }

    fn add(&mut self, cell: usize, value: f64) {
        if let (Some(mask), Some(sum)) = (self.mask.get_mut(cell), self.value.get_mut(cell)) {
            *mask += 1.0;
            *sum += value;
        }
    }

    /// Sums become means.
    fn finish(mut self) -> Self {
        for (mask, value) in self.mask.iter_mut().zip(&mut self.value) {
            if *mask > 0.0 {
                *value /= *mask;
                *mask = 1.0;
            }
        }
        self
    }
}

/// The best shifts, best first.
pub(super) fn candidates(
    command: &CommandLog<'_>,
    drive: &CommandSignal,
    response: &ResponseLog<'_>,
    options: &AlignmentOptions,
    max_skew: f64,
) -> Vec<Candidate> {
    let ((from_s, to_s), (start_s, end_s)) = (command.span_s(), response.span_s());
    let span_s = (to_s - from_s) + (end_s - start_s);
    // Chosen: with two rows to a cell, rows that jitter leave none empty.
    let cell_s = (2.0 * response.interval_s()).max(span_s / MOST_CELLS);
    let cells = |length_s: f64| (length_s / cell_s) as usize + 2;
    let commands = cells(to_s - from_s);
    let length = (commands + cells((end_s - start_s) / (1.0 - max_skew))).next_power_of_two();

    let (offset, scale) = moved_and_scaled(response.response);
    let u = on_grid(command, &drive.values, from_s, cell_s, commands);
    let transform = Correlator::new(length);
    let u = MaskedSpectra::transform(&transform, &u);
    let middle_s = 0.5 * (start_s + end_s);

    let mut found: Vec<Candidate> = Vec::new();
    for skew in skews(end_s - start_s, max_skew) {
        let scaled = |t: f64| middle_s + (t - middle_s) / (1.0 + skew);
        let first_s = scaled(start_s);
        let mut y = Masked::zeros(length);
        for (&t, value) in response.time_s.iter().zip(response.response) {
            y.add(((scaled(t) - first_s) / cell_s) as usize, (value - offset) / scale);
        }
        let y = y.finish();
        let least = LEAST_SHARE * y.mask.iter().sum::<f64>().min(commands as f64);
        let y = MaskedSpectra::transform(&transform, &y);
        let correlation = transform.coefficients(&u, &y, least);
        // Shifts run from minus the command's length to the response's, around the end of the transform.
        let delay_at = |shift: usize| {
            let shift = if shift < length - commands { shift as f64 } else { shift as f64 - length as f64 };
            first_s - from_s + shift * cell_s
        };
        for shift in 0..length {
            let here = correlation[shift];
            let (before, after) = (correlation[(shift + length - 1) % length], correlation[(shift + 1) % length]);
            let delay_s = delay_at(shift);
            let allowed =
                options.within_s.is_none_or(|within_s| (delay_s - options.near_s).abs() <= within_s + cell_s + APART_S);
            if here > 0.0 && here >= before && here > after && allowed {
                found.push(Candidate { delay_s, skew, correlation: here });
            }
        }
        let best = found.iter().map(|c| c.correlation).fold(0.0, f64::max);
        found.retain(|c| c.correlation >= WORTH * best);
    }
    found.sort_by(|a, b| b.correlation.total_cmp(&a.correlation));
    let mut kept: Vec<Candidate> = Vec::new();
    for candidate in found {
        // Chosen: the top of a correlation is a few cells wide.
        let apart = |k: &Candidate| (k.delay_s - candidate.delay_s).abs() > APART_S.max(3.0 * cell_s);
        if kept.len() < MOST && kept.iter().all(apart) {
            kept.push(candidate);
        }
    }
    kept
}

/// Skews to try, zero among them.
fn skews(span_s: f64, most: f64) -> Vec<f64> {
    let step = 2.0 * BLUR_S / span_s;
    let count = (most / step).ceil() as i32;
    (-count..=count).map(|k| f64::from(k) * most / f64::from(count.max(1))).collect()
}

/// The mean over each cell of what the command log has.
fn on_grid(command: &CommandLog<'_>, values: &[f64], from_s: f64, cell_s: f64, cells: usize) -> Masked {
    let mut grid = Masked::zeros(cells);
    let (_, to_s) = command.span_s();
    let mut row = 0;
    for cell in 0..cells {
        let (begin_s, end_s) = (from_s + cell as f64 * cell_s, from_s + (cell + 1) as f64 * cell_s);
        if end_s > to_s {
            break;
        }
        let (mut at_s, mut sum) = (begin_s, 0.0);
        while at_s < end_s {
            while command.time_s.get(row + 1).is_some_and(|&t| t <= at_s) {
                row += 1;
            }
            let until_s = command.time_s.get(row + 1).map_or(end_s, |&t| t.min(end_s));
            sum += values[row] * (until_s - at_s);
            at_s = until_s;
        }
        grid.add(cell, sum / cell_s);
    }
    grid.finish()
}

/// Mean and half range, so that sums of squares keep their digits.
fn moved_and_scaled(values: &[f64]) -> (f64, f64) {
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
    (0.5 * (low + high), (0.5 * (high - low)).max(f64::MIN_POSITIVE))
}

/// Transforms of a masked signal: mask, value, square.
struct MaskedSpectra {
    mask: Vec<Complex64>,
    value: Vec<Complex64>,
    square: Vec<Complex64>,
}

impl MaskedSpectra {
    fn transform(transform: &Correlator, signal: &Masked) -> Self {
        let square: Vec<f64> = signal.value.iter().map(|v| v * v).collect();
        Self {
            mask: transform.forward(&signal.mask),
            value: transform.forward(&signal.value),
            square: transform.forward(&square),
        }
    }
}

struct Correlator {
    length: usize,
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
}

impl Correlator {
    fn new(length: usize) -> Self {
        Self { length, forward: fourier::real_forward(length), inverse: fourier::real_inverse(length) }
    }

    fn forward(&self, values: &[f64]) -> Vec<Complex64> {
        let fft = &self.forward;
        let (mut input, mut output) = (fft.make_input_vec(), fft.make_output_vec());
        for (to, from) in input.iter_mut().zip(values) {
            *to = *from;
        }
        fft.process(&mut input, &mut output).expect("buffers are made by the plan itself");
        output
    }

    /// `sum_i a_i b_(i + shift)` for all shifts, those below zero from the end.
    fn correlate(&self, a: &[Complex64], b: &[Complex64]) -> Vec<f64> {
        let fft = &self.inverse;
        let (mut input, mut output) = (fft.make_input_vec(), fft.make_output_vec());
        for ((to, a), b) in input.iter_mut().zip(a).zip(b) {
            *to = a.conj() * b / self.length as f64;
        }
        // Real by symmetry; rounding may leave a residue that the inverse refuses.
        for end in [0, self.length / 2] {
            input[end].im = 0.0;
        }
        fft.process(&mut input, &mut output).expect("buffers are made by the plan itself");
        output
    }

    /// Correlation coefficients at all shifts; zero where fewer than `least` cells are in common or one of them is
    /// constant.
    fn coefficients(&self, u: &MaskedSpectra, y: &MaskedSpectra, least: f64) -> Vec<f64> {
        let n = self.correlate(&u.mask, &y.mask);
        let (su, sy) = (self.correlate(&u.value, &y.mask), self.correlate(&u.mask, &y.value));
        let (suu, syy) = (self.correlate(&u.square, &y.mask), self.correlate(&u.mask, &y.square));
        let suy = self.correlate(&u.value, &y.value);
        (0..self.length)
            .map(|k| {
                if n[k] < least.max(2.0) {
                    return 0.0;
                }
                let covariance = suy[k] - su[k] * sy[k] / n[k];
                let (vu, vy) = (suu[k] - su[k] * su[k] / n[k], syy[k] - sy[k] * sy[k] / n[k]);
                // Below this share of the sums it is rounding: 1e-16 for each of some 1e5 terms, and a margin.
                if vu > 1e-9 * suu[k] && vy > 1e-9 * syy[k] { covariance / (vu * vy).sqrt() } else { 0.0 }
            })
            .collect()
    }
}
