//! The rate of frames of an ESC that the records agree on, and where the frames lie in each.

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use rayon::prelude::*;
use rotorlead_numerics::extremum::Parabola;
use rotorlead_numerics::statistics::t_quantile;

use super::fit::Fit;
use super::stair;
use crate::data::dataset::PreparedRecord;
use crate::data::split::Split;
use crate::likelihood::Likelihood;
use crate::model::hypothesis::Hypothesis;

/// How far around the best phase a parabola is laid, in parts of a frame, each time nearer. Derived: the first covers half of the 1/24
/// between two phases that are tried at isolated steps, and each next one less than half of the one before.
const PHASE_WIDTHS: [f64; 3] = [0.025, 0.01, 0.004];
/// How often a known rate is polished, with half the width each time. Chosen: from two standard errors to half of one, below which a place
/// is as good as another. More cost only time.
const POLISHES: usize = 3;
/// A rate is looked for to either side before it is polished, in steps of this part of a frame over the length of a record: what else was
/// wrong with the chain may have pulled it away. Derived: frames at the ends of a record then move by half of it, less than the first
/// parabola of their phase reaches.
const PULLED: f64 = 0.04;
/// In so many steps to either side. Chosen: a fifth of a frame in all. More cost only time; fewer leave a rate that was pulled farther.
const PULLED_STEPS: i32 = 5;
/// A profile over rates goes to where the chi-square has grown by this much. Chosen: 2.5 times what the stair below it is seen over.
/// Lower, jags bend the parabola; higher, it is none any more.
const WIDE_ENOUGH: f64 = 60.0;
/// In so many doublings of its width. Derived: a factor of 1024 from the rate's own standard error, or from 1e-4; it bounds a profile that
/// does not rise.
const MOST_WIDENINGS: usize = 10;
/// It has so many pieces. Chosen: five points for each of the parabola's three numbers, whose jags average out. More cost only time.
const RATES: u32 = 14;

/// The rate and the phases once more, beside what `fit` has found with them.
pub(crate) fn polish(likelihood: &Likelihood, fit: &Fit, effect: usize) -> Option<Hypothesis> {
    let known = &fit.hypothesis.effects[effect];
    let (near_hz, mut width_hz) = (known.values[0], 2.0 * known.profiled_std * known.values[0]);
    let evaluate = |hz: f64| {
        let hypothesis = at_rate(likelihood, &fit.hypothesis, effect, hz);
        likelihood.chi_square(&hypothesis, Split::Train).map(|chi_square| (chi_square, hz, hypothesis))
    };
    let lengths_s = likelihood
        .data
        .records
        .iter()
        .flat_map(|record| record.segments.first().map(|segment| segment.rows.len() as f64 / record.rate_hz));
    let step_hz = PULLED / lengths_s.fold(0.0, f64::max);
    let pulled = |step: i32| {
        let hypothesis = moved(likelihood, &fit.hypothesis, effect, near_hz + f64::from(step) * step_hz);
        likelihood.chi_square(&hypothesis, Split::Train).map(|chi_square| (chi_square, step))
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
/// known badly: as wide as Student's t is, so that 1.96 of it are the interval of 95 %. And the stair under the parabola has long tails
/// ([`stair`]).
pub(crate) fn settle_rate(likelihood: &Likelihood, known: &Hypothesis, effect: usize) -> Option<Hypothesis> {
    let near = &known.effects[effect];
    let hz = near.values[0];
    let evaluate = |offset_hz: f64| -> Option<Vec<f64>> {
        let hypothesis = at_rate(likelihood, known, effect, hz + offset_hz);
        let fitted = likelihood.data.records.par_iter().filter(|record| likelihood.has(record, Split::Train));
        let residual = |record: &PreparedRecord| likelihood.residual(record, &hypothesis, Split::Train);
        fitted.map(|record| Some(residual(record)?.iter().map(Complex64::norm_sqr).sum::<f64>())).collect()
    };
    let here: f64 = evaluate(0.0)?.iter().sum();
    // What is known worse begins at a ten-thousandth, a tenth of a frame in a thousand: it only gets wider.
    let mut width_hz = near.profiled_std.min(1e-4) * hz;
    for _ in 0..MOST_WIDENINGS {
        let sides =
            [-width_hz, width_hz].map(|offset_hz| evaluate(offset_hz).map(|chi_square| chi_square.iter().sum::<f64>()));
        if sides.iter().all(|chi_square| chi_square.is_none_or(|chi_square| chi_square > here + WIDE_ENOUGH)) {
            break;
        }
        width_hz *= 2.0;
    }
    let half = f64::from(RATES / 2);
    // Offsets in widths.
    let offsets: Vec<f64> = (0..=RATES).map(|place| (f64::from(place) - half) / half).collect();
    let chi_square: Vec<Vec<f64>> = offsets.iter().map(|offset| evaluate(offset * width_hz)).collect::<Option<_>>()?;
    let design = DMatrix::from_fn(offsets.len(), 3, |row, power| offsets[row].powi(power as i32));
    let inverse = (design.transpose() * &design).try_inverse()? * design.transpose();
    let records = chi_square.first()?.len();
    let parabolas: Vec<DVector<f64>> = (0..records)
        .map(|record| &inverse * DVector::from_fn(offsets.len(), |row, _| chi_square[row][record]))
        .collect();
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
    settled.effects[effect].profiled_std = stair::std_of_parabola(variance.sqrt()) * width_hz / hz;
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

/// The phase of one record near that of `hypothesis` where its rows leave least: the first term of the sawtooth is not all
/// of it.
pub(crate) fn refined(
    likelihood: &Likelihood,
    record: &PreparedRecord,
    mut hypothesis: Hypothesis,
    effect: usize,
    offsets: &[f64],
) -> f64 {
    let begin = hypothesis.effects[effect].phases[record.place];
    let Some(split) = record.segments.first().map(|segment| segment.split) else { return begin };
    let mut chi_square_at = |phase: f64| {
        hypothesis.effects[effect].phases[record.place] = phase.rem_euclid(1.0);
        let white = likelihood.residual(record, &hypothesis, split);
        white.map_or(f64::INFINITY, |white| white.iter().map(Complex64::norm_sqr).sum::<f64>())
    };
    let least =
        |at: Vec<(f64, f64)>| at.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, begin));
    let (mut chi_square, mut phase) =
        least(offsets.iter().map(|offset| (chi_square_at(begin + offset), begin + offset)).collect());
    for width in PHASE_WIDTHS {
        let (below, above) = (chi_square_at(phase - width), chi_square_at(phase + width));
        let bend = below - 2.0 * chi_square + above;
        let top = if bend > 0.0 { (0.5 * (below - above) / bend).clamp(-1.0, 1.0) } else { 0.0 };
        let top = phase + width * top;
        (chi_square, phase) =
            least(vec![(chi_square, phase), (below, phase - width), (above, phase + width), (chi_square_at(top), top)]);
    }
    phase.rem_euclid(1.0)
}
