//! Quantizer steps of the command that a residual shows, all at once.
//!
//! Rounding to a grid of step `q` adds to the command `-(q/pi) sum_k (-1)^(k+1) sin(2 pi k u / q) / k`, a function of the command
//! alone. The inner product of a residual with the first term is `sum_n g_n sin(2 pi u_n / q)`, so with the products `g` gathered
//! by command one transform shows all steps.

use std::f64::consts::PI;
use std::ops::Range;

use num_complex::Complex64;
use rayon::prelude::*;
use rotorlead_fourier as fourier;
use rotorlead_plant::effect::{Kind, Parameter};

use super::scan::Scan;
use super::{Proposal, Starts};
use crate::estimate::fit::Fit;
use crate::likelihood::Likelihood;
use crate::likelihood::adjoint::{Adjoint, applied};
use crate::model::candidate::Candidate;

/// Commands that are distinguished, of the range 0..1 and as much again below and above. Derived: a tenth of the finest plausible step,
/// `1/4096`, so that a bin turns its sinusoid by no more; a power of two for the transform.
const BINS: usize = 1 << 17;
/// The commands of the bins begin here. Derived: commands that an effect ahead has moved lie within a range of 0..1 to either side.
const FROM: f64 = -1.0;
/// And are so wide. Derived: three such ranges.
const WIDTH: f64 = 3.0;
/// A command that changes less often than this does not go over a grid. Chosen: square waves change some ten times, multisines thousands
/// of times.
const FEWEST_CHANGES: usize = 100;
/// Steps that are looked at more closely. Chosen: lines beside the loudest, and multiples of a step, are loud too. Fewer may lose the
/// right one; more cost only time.
const STEPS: usize = 10;

/// The step of a grid.
pub(super) struct QuantizerStep;

impl Proposal for QuantizerStep {
    fn starts(&self, likelihood: &Likelihood, from: &Fit, _: &Scan, kind: &'static Kind) -> Starts {
        let candidates = steps(likelihood, from, kind);
        let is_in_valley = !candidates.is_empty();
        let general = || Candidate::starts(kind, likelihood.data.has_logs());
        Starts { candidates: if is_in_valley { candidates } else { general() }, is_in_valley }
    }

    fn independent_trials(&self, kind: &'static Kind) -> f64 {
        Candidate::searched(kind).map(|(_, parameter)| lines(parameter).len() as f64).product()
    }

    /// The grid of which a whole number of steps makes the range of the command, as of any counter.
    fn rounded(&self, candidate: &Candidate) -> Option<Candidate> {
        let (place, _) = Candidate::searched(candidate.kind).next()?;
        let mut whole = candidate.clone();
        whole.values[place] = candidate.values[place].recip().round().recip();
        (candidate.kind.check)(&whole.values).is_ok().then_some(whole)
    }
}

/// The lines of the transform that are looked at: line `l` has `l` steps over the width of the bins.
fn lines(parameter: &Parameter) -> Range<usize> {
    let (least, most) = parameter.plausible;
    (WIDTH / most) as usize..(WIDTH / least) as usize
}

/// Quantizer steps that promise the largest gain on the residual of `fit`, largest first.
fn steps(likelihood: &Likelihood, fit: &Fit, kind: &'static Kind) -> Vec<Candidate> {
    let Some((place, parameter)) = Candidate::searched(kind).next() else { return Vec::new() };
    let gathered: Vec<(Vec<f64>, f64)> = likelihood
        .data
        .records
        .par_iter()
        .filter_map(|record| {
            let adjoint = Adjoint::new(likelihood, record, &fit.hypothesis).filter(Adjoint::is_fitted)?;
            let applied = applied(record, adjoint.segment, &fit.hypothesis).1;
            // The few levels of a square wave suit every other grid.
            if applied.windows(2).filter(|pair| pair[0] != pair[1]).count() < FEWEST_CHANGES {
                return None;
            }
            let mut bins = vec![0.0; BINS];
            for (applied, g) in applied.iter().zip(&adjoint.g) {
                let bin = ((applied - FROM) / WIDTH * BINS as f64) as usize;
                // An impulse of a row's length.
                bins[bin.min(BINS - 1)] += g / record.rate_hz;
            }
            // Of a sinusoid in time whose power is spread evenly over the lines.
            let power = 0.5 * adjoint.lags[0] / record.rate_hz.powi(2) * adjoint.g.len() as f64;
            Some((bins, power))
        })
        .collect();
    let mut spectrum = vec![Complex64::ZERO; BINS];
    for (bins, _) in &gathered {
        spectrum.iter_mut().zip(bins).for_each(|(sum, bin)| *sum += bin);
    }
    let power: f64 = gathered.iter().map(|(_, power)| power).sum();
    fourier::forward(BINS).process(&mut spectrum);
    let gain = |line: usize| {
        let steps_per_unit = line as f64 / WIDTH;
        // The bins begin below 0, and a bin's commands are on average in its middle.
        let turned = spectrum[line] * Complex64::cis(-2.0 * PI * steps_per_unit * (FROM + 0.5 * WIDTH / BINS as f64));
        let size = 1.0 / (PI * steps_per_unit);
        // The transform has e^(-j x): its imaginary part is minus the product with the sine.
        2.0 * size * turned.im - size * size * power
    };
    let mut gains: Vec<(f64, usize)> = lines(parameter).map(|line| (gain(line), line)).collect();
    gains.sort_by(|a, b| b.0.total_cmp(&a.0));
    let candidate = |(_, line): &(f64, usize)| {
        let mut values = kind.null();
        values[place] = WIDTH / *line as f64;
        Candidate::new(kind, values)
    };
    gains.iter().take(STEPS).map(candidate).filter(|candidate| (kind.check)(&candidate.values).is_ok()).collect()
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::Catalog;

    use super::*;
    use crate::estimate::settle::settle;
    use crate::model::hypothesis::Hypothesis;
    use crate::testing::{likelihood, records};

    #[test]
    fn a_grid_near_that_of_a_counter_has_a_whole_number_of_steps() {
        let kind = Catalog::standard().find("command_quantization").unwrap();
        let mut candidate = Candidate::new(kind, kind.null());
        candidate.values[0] = 0.011_765;
        assert_eq!(QuantizerStep.rounded(&candidate).unwrap().values[0], 1.0 / 85.0);
    }

    #[test]
    fn a_grid_is_heard_beside_what_makes_the_response_late() {
        let late = "[[effect]]\nkind = \"transport_delay\"\nparameters = { delay_s = 0.015 }\n\
                    [[effect]]\nkind = \"clock_skew\"\nparameters = { skew_ppm = 1000.0 }\n";
        let grid = "[[effect]]\nkind = \"command_quantization\"\nparameters = { step = 0.0125 }\n";
        let (likelihood, base) = likelihood(&records(&format!("{late}{grid}"), 0.05, 0));
        let catalog = Catalog::standard();
        let of = |kind: &str, value: f64| {
            let kind = catalog.find(kind).unwrap();
            let mut values = kind.null();
            values[0] = value;
            Candidate::new(kind, values)
        };
        let lags = Hypothesis::from_lags(base);
        let start = lags.with(of("transport_delay", 0.015)).with(of("clock_skew", 1000.0));
        let (likelihood, beside) = settle(&likelihood, &start, true).unwrap();
        let loudest = steps(&likelihood, &beside, catalog.find("command_quantization").unwrap());
        assert!((loudest[0].values[0] / 0.0125 - 1.0).abs() < 0.005, "{loudest:?}");
    }
}
