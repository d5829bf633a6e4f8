//! Modes of the stand: the gain that a residual promises at every frequency and damping.
//!
//! A link behind the motor that is linear and has the size `a` answers with `1 + a h(f)`. It leaves `a h_k y_k` in the white
//! residual `z_k` of a model without it, with `y` the white response of that model. Far below its peak that is much like
//! another gain or another lag, which the residual has already been fitted with: only what lies across those, `x = h y` less
//! its projection on them, counts. The best size and what it gains in squares are
//!
//! ```text
//! a = sum Re(conj(x_k) z_k) / sum |x_k|^2,    gain = a sum Re(conj(x_k) z_k).
//! ```
//!
//! All sums are gathered over the records in bands that are narrow beside any peak, so a place costs a sum over the bands and a
//! fine grid of frequencies and dampings is no matter. A peak is a few percent wide: a coarse grid steps over it.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use nalgebra::{Matrix3, Vector3};
use num_complex::Complex64;
use rayon::prelude::*;
use rotorlead_plant::effect::{Kind, Parameter, Scale};
use rotorlead_plant::{Lag, OperatingPoint};

use super::scan::Scan;
use super::{ByPlausibleRange, Proposal, Starts};
use crate::data::dataset::PreparedRecord;
use crate::data::split::Split;
use crate::estimate::fit::Fit;
use crate::likelihood::Likelihood;
use crate::model::candidate::Candidate;

/// Bands of a factor e in frequency. Derived: an eighth of the width of a peak with a damping of 0.02, which is twice that. More cost only
/// time.
const BANDS: f64 = 200.0;
/// Pieces of the range of the value with most starts from one start to the next. Derived: seven starts of a frequency over 8 to 120 Hz
/// make 1.6 % a piece, less than the 2 % of a peak with the least plausible damping.
const PIECES_PER_START: usize = 24;
/// And of the range of another one. Derived: six of a damping of 0.01 to 0.2 are a factor of 1.65 apart, and a peak of other width loses
/// little.
const PIECES: usize = 6;
/// Places that are looked at more closely. Chosen: one mode, its neighbors and other humps. Fewer may lose the right one; more cost only
/// time.
const PLACES: usize = 6;

/// The peak of a mode behind the motor.
pub(super) struct Peak;

impl Proposal for Peak {
    fn starts(&self, likelihood: &Likelihood, from: &Fit, scan: &Scan, kind: &'static Kind) -> Starts {
        let candidates = modes(likelihood, from, kind);
        if candidates.is_empty() {
            return ByPlausibleRange.starts(likelihood, from, scan, kind);
        }
        Starts { candidates, is_in_valley: false }
    }

    /// At how many frequencies modes are looked for.
    fn independent_trials(&self, kind: &'static Kind) -> f64 {
        let shape = Candidate::searched(kind).filter(|(_, parameter)| !parameter.null.is_finite());
        (PIECES_PER_START * shape.map(|(_, parameter)| parameter.starts.len()).max().unwrap_or(0) + 1) as f64
    }
}

/// The modes that promise the largest gain on the residual of `fit`, largest first. Empty where no record repeats.
fn modes(likelihood: &Likelihood, fit: &Fit, kind: &'static Kind) -> Vec<Candidate> {
    let searched: Vec<_> = Candidate::searched(kind).collect();
    let Some(size) = searched.iter().position(|(_, parameter)| parameter.null.is_finite()) else { return Vec::new() };
    let mut shape = searched;
    let (size, _) = shape.remove(size);
    // The value with most starts is the one in which peaks are narrow.
    shape.sort_by_key(|(_, parameter)| std::cmp::Reverse(parameter.starts.len()));
    let (Some(bands), Some(&(finest, parameter))) = (Bands::gather(likelihood, fit), shape.first()) else {
        return Vec::new();
    };
    let mut grid = vec![kind.null()];
    for &(place, parameter) in &shape {
        let pieces = if place == finest { PIECES_PER_START * parameter.starts.len() } else { PIECES };
        let with = |values: &Vec<f64>, piece: usize| {
            let mut values = values.clone();
            values[place] = at_part(parameter, piece as f64 / pieces as f64);
            values
        };
        grid = grid.iter().flat_map(|values| (0..=pieces).map(|piece| with(values, piece))).collect();
    }
    let mut evaluated: Vec<(f64, Candidate)> =
        grid.into_par_iter().filter_map(|values| bands.evaluate(kind, size, values)).collect();
    evaluated.sort_by(|a, b| b.0.total_cmp(&a.0));
    // The loudest that lie apart: a quarter of the way between two starts, 10 % of a frequency, is as wide as a peak with a damping of
    // 0.05.
    let apart = share_of_range(parameter, parameter.plausible.1) / (4 * parameter.starts.len()) as f64;
    let mut found: Vec<Candidate> = Vec::new();
    for (_, candidate) in evaluated {
        let part = |candidate: &Candidate| share_of_range(parameter, candidate.values[finest]);
        if found.len() < PLACES && !found.iter().any(|other| (part(other) - part(&candidate)).abs() < apart) {
            found.push(candidate);
        }
    }
    found
}

/// The value at a part of the plausible range, 0..1, in the steps of its scale.
fn at_part(parameter: &Parameter, part: f64) -> f64 {
    let (low, high) = parameter.plausible;
    match parameter.scale {
        Scale::Log => low * (high / low).powf(part),
        Scale::Linear => low + (high - low) * part,
    }
}

/// The part of the range at which a value lies.
fn share_of_range(parameter: &Parameter, value: f64) -> f64 {
    let (low, high) = parameter.plausible;
    match parameter.scale {
        Scale::Log => (value / low).ln() / (high / low).ln(),
        Scale::Linear => (value - low) / (high - low),
    }
}

/// What the records say, by bands of frequency.
struct Bands {
    hz: Vec<f64>,
    points: Vec<PointBands>,
}

/// Product of residual and response, and power of the response, of one record by the place of the band.
type RecordBands = BTreeMap<i64, (Complex64, f64)>;

/// What those at one nominal command say.
struct PointBands {
    /// Products of residual and response, `conj(y) z`, and powers of the response.
    product: Vec<Complex64>,
    power: Vec<f64>,
    /// By what a response is multiplied for a larger gain, a larger time constant, and a later clock.
    nuisance: Vec<[Complex64; 3]>,
    /// The inverse of the products of these with each other, and their products with the residual.
    inverse: Matrix3<f64>,
    slope: Vector3<f64>,
}

impl Bands {
    fn gather(likelihood: &Likelihood, fit: &Fit) -> Option<Self> {
        let compared = |record: &&PreparedRecord| record.segments_in(Split::Train).next().is_some();
        let those: Vec<&PreparedRecord> = likelihood.data.records.iter().filter(compared).collect();
        let parts: Vec<(usize, RecordBands)> = those
            .into_par_iter()
            .map(|record| Some((record.point, record_bands(likelihood, record, fit)?)))
            .collect::<Option<_>>()?;
        let mut places: Vec<i64> = parts.iter().flat_map(|(_, bands)| bands.keys().copied()).collect();
        places.sort_unstable();
        places.dedup();
        let hz: Vec<f64> = places.iter().map(|place| (*place as f64 / BANDS).exp()).collect();
        let mut points = Vec::new();
        for (point, base) in fit.hypothesis.base.iter().enumerate() {
            let mut product = vec![Complex64::ZERO; hz.len()];
            let mut power = vec![0.0; hz.len()];
            for (place, band) in parts.iter().filter(|(of, _)| *of == point).flat_map(|(_, bands)| bands) {
                let index = places.partition_point(|other| other < place);
                product[index] += band.0;
                power[index] += band.1;
            }
            points.extend(PointBands::new(&hz, product, power, base.time_constant_s));
        }
        (!points.is_empty()).then_some(Self { hz, points })
    }

    /// What a place gains with its best size.
    fn evaluate(&self, kind: &'static Kind, size: usize, mut values: Vec<f64>) -> Option<(f64, Candidate)> {
        let parameter = &kind.parameters[size];
        values[size] = parameter.null + 1.0;
        (kind.check)(&values).ok()?;
        // A link behind the motor does not depend on where the motor runs.
        let lag = Lag { gain: 1.0, time_constant_s: 1.0, delay_s: 0.0 };
        let anywhere = OperatingPoint { nominal: 0.5, lag, response: 1.0 };
        let change: Vec<Complex64> =
            self.hz.iter().map(|hz| (kind.response)(&values, &anywhere, TAU * hz) - 1.0).collect();
        let (product, power) = self
            .points
            .iter()
            .map(|point| point.across(&change))
            .fold((0.0, 0.0), |sum, (product, power)| (sum.0 + product, sum.1 + power));
        let best = product / power;
        values[size] = (parameter.null + best).clamp(parameter.possible.0, parameter.possible.1);
        let gain = best * product;
        gain.is_finite().then(|| (gain, Candidate::new(kind, values)))
    }
}

impl PointBands {
    /// `None` where there is nothing to tell the nuisance parameters apart by.
    fn new(hz: &[f64], product: Vec<Complex64>, power: Vec<f64>, time_constant_s: f64) -> Option<Self> {
        let of_band = |hz: &f64| {
            let s = Complex64::new(0.0, TAU * hz);
            [Complex64::ONE, -s * time_constant_s / (1.0 + s * time_constant_s), -s * time_constant_s]
        };
        let nuisance: Vec<[Complex64; 3]> = hz.iter().map(of_band).collect();
        let (mut matrix, mut slope) = (Matrix3::zeros(), Vector3::zeros());
        for ((nuisance, product), power) in nuisance.iter().zip(&product).zip(&power) {
            for i in 0..3 {
                slope[i] += (nuisance[i].conj() * product).re;
                for j in 0..3 {
                    matrix[(i, j)] += power * (nuisance[i].conj() * nuisance[j]).re;
                }
            }
        }
        Some(Self { product, power, nuisance, inverse: matrix.try_inverse()?, slope })
    }

    /// Product with the residual, and power, of what lies across the nuisance parameters in `change` times the response.
    fn across(&self, change: &[Complex64]) -> (f64, f64) {
        let (mut product, mut power, mut along) = (0.0, 0.0, Vector3::zeros());
        for (index, change) in change.iter().enumerate() {
            product += (change.conj() * self.product[index]).re;
            power += change.norm_sqr() * self.power[index];
            for (along, nuisance) in along.iter_mut().zip(&self.nuisance[index]) {
                *along += self.power[index] * (change.conj() * nuisance).re;
            }
        }
        let projected = self.inverse * along;
        (product - projected.dot(&self.slope), power - projected.dot(&along))
    }
}

/// Products and powers of one record by band.
fn record_bands(likelihood: &Likelihood, record: &PreparedRecord, fit: &Fit) -> Option<RecordBands> {
    let white = likelihood.residual(record, &fit.hypothesis, Split::Train)?;
    let simulated =
        fit.hypothesis.simulate(&likelihood.data, record, likelihood.for_record(record).end(Split::Train)).ok()?;
    let mut bands = RecordBands::new();
    let mut white = &white[..];
    for (segment, whitening) in likelihood.periodic(record)?.segments(Split::Train) {
        // The last period over and over: where a record begins in another state, the jump from its end to its begin would be
        // in all lines, and a filter does not multiply that.
        let last = segment.rows.end - record.period_rows..segment.rows.end;
        let settled: Vec<f64> = simulated[last].iter().copied().cycle().take(segment.rows.len()).collect();
        let response = whitening.apply(&settled);
        let (own, rest) = white.split_at(response.len());
        white = rest;
        for (line, (response, left)) in response.iter().zip(own).enumerate() {
            let hz = (line + 1) as f64 * record.rate_hz / segment.rows.len() as f64;
            let band = bands.entry((BANDS * hz.ln()).round() as i64).or_default();
            band.0 += response.conj() * left;
            band.1 += response.norm_sqr();
        }
    }
    Some(bands)
}
