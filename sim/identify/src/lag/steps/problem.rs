//! The steps of a record as a least-squares problem: how a set of parameters misses them.
//!
//! All steps share a delay and a curvature; levels, onset and time constant are each step's own. So `J'J` is an arrow, put together
//! from the small Jacobians of the steps.

use nalgebra::{DMatrix, DVector};
use rotorlead_numerics::least_squares::NormalEquations;
use rotorlead_plant::Lagged;

use super::response::{Segment, mean_value};

/// Delays beyond this are not searched, seconds. Chosen: a motor's is some milliseconds and a log's some tens; longer ones are several time
/// constants, and reach beyond the shortest plateau.
const MAX_DELAY_S: f64 = 0.3;

/// The rows of a step.
#[derive(Clone, Debug)]
pub(super) struct Window {
    /// When the row with the new command is stamped, seconds.
    pub(super) change_s: f64,
    /// Rough levels, the units of those that are fitted.
    pub(super) before: f64,
    pub(super) after: f64,
    /// Times of its rows.
    pub(super) time_s: Vec<f64>,
    /// Response of its rows.
    pub(super) y: Vec<f64>,
    /// One over the standard deviation of each row by the sensor's noise, zero for one that says nothing.
    pub(super) weight: Vec<f64>,
    /// Standard deviation of what the readings of a level have in common, of the rows that stand on one.
    pub(super) common_std: Vec<f64>,
    /// Over how long each reading is the mean, seconds; 0 for a momentary value.
    pub(super) mean_s: f64,
    /// Variance of each row by the noise of its time stamp, in units of that of the sensor's noise.
    pub(super) stamp_variance: Vec<f64>,
    /// By how much the variance is taken for larger than the sensor's, as a first fit leaves more.
    pub(super) excess: f64,
}

/// Indices of the shared parameters.
pub(super) const DELAY: usize = 0;
pub(super) const CURVATURE: usize = 1;
const SHARED: usize = 2;
/// Of each step: the levels after and before in units of their rough values, the onset, and the logarithm of the time
/// constant.
pub(super) const PER_STEP: usize = 4;
/// What a step depends on.
const LOCAL: usize = SHARED + PER_STEP;

/// The residuals of some steps as a function of the parameters.
pub(super) struct StepProblem<'a> {
    pub(super) steps: &'a [Window],
    /// Standard deviation by which onsets are tied to zero, seconds.
    pub(super) onset_std_s: f64,
    /// What is known of the curvature beforehand: mean and standard deviation.
    pub(super) curvature: (f64, f64),
    pub(super) law: StepLaw,
}

/// What lags, and the units of its curvature.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepLaw {
    pub(super) lagged: Lagged,
    /// The highest level, in units of what lags.
    pub(super) reference: f64,
    /// The usual time to 63 % of a step, seconds.
    pub(super) usual_s: f64,
}

impl StepLaw {
    /// A curvature per unit of what lags and second of time constant: the bend over the time constant.
    pub(super) fn bend_per_s(&self, curvature: f64) -> f64 {
        curvature / self.reference / self.usual_s
    }
}

/// The parameters and what they leave.
pub(super) struct Evaluation {
    pub(super) parameters: Vec<f64>,
    /// Of each step, in units of its noise.
    pub(super) residuals: Vec<Vec<f64>>,
    sum: f64,
}

/// The derivatives of each step by what it depends on, and the normal matrix of all.
pub(super) struct Linearization {
    pub(super) blocks: Vec<DMatrix<f64>>,
    pub(super) matrix: DMatrix<f64>,
}

impl StepProblem<'_> {
    pub(super) fn level_index(step: usize) -> usize {
        SHARED + PER_STEP * step
    }

    pub(super) fn level_before_index(step: usize) -> usize {
        Self::level_index(step) + 1
    }

    pub(super) fn onset_index(step: usize) -> usize {
        Self::level_index(step) + 2
    }

    pub(super) fn time_constant_index(step: usize) -> usize {
        Self::level_index(step) + 3
    }

    /// Where the local parameters of a step are among all.
    pub(super) fn global_index(step: usize, local: usize) -> usize {
        if local < SHARED { local } else { Self::level_index(step) + local - SHARED }
    }

    fn count(&self) -> usize {
        SHARED + PER_STEP * self.steps.len()
    }

    /// The response of a step at its rows; `false` where it has none.
    pub(super) fn response(&self, step: usize, p: &[f64], out: &mut [f64]) -> bool {
        self.moved(step, p, 0.0, out)
    }

    /// The same, so many seconds later than the rows.
    fn moved(&self, k: usize, p: &[f64], later_s: f64, out: &mut [f64]) -> bool {
        let step = &self.steps[k];
        let time_constant_s = p[Self::time_constant_index(k)].exp();
        let segment = Segment {
            from_s: step.change_s,
            level: step.after * p[Self::level_index(k)],
            time_constant_s,
            delay_s: p[DELAY] + p[Self::onset_index(k)],
            bend: self.law.bend_per_s(p[CURVATURE]) * time_constant_s,
            lagged: self.law.lagged,
        };
        let excess = step.before * p[Self::level_before_index(k)] - segment.level;
        let mut ok = segment.delay_s.abs() < MAX_DELAY_S;
        for (&t, out) in step.time_s.iter().zip(out) {
            *out = mean_value(&segment, excess, t + later_s, step.mean_s, &mut ok);
        }
        ok
    }

    /// How fast the response moves at each row, response units per second, over an interval.
    pub(super) fn slope(&self, step: usize, p: &[f64], interval_s: f64) -> Vec<f64> {
        let rows = self.steps[step].time_s.len();
        let (mut early, mut late) = (vec![0.0; rows], vec![0.0; rows]);
        // The fit has a response there; should rounding say otherwise, the slope is that of where it ends.
        let _ = self.moved(step, p, -0.5 * interval_s, &mut early);
        let _ = self.moved(step, p, 0.5 * interval_s, &mut late);
        early.iter().zip(late).map(|(early, late)| (late - early) / interval_s).collect()
    }

    fn residuals(&self, step: usize, p: &[f64], out: &mut [f64]) -> bool {
        let ok = self.response(step, p, out);
        let Window { y, weight, .. } = &self.steps[step];
        for ((out, y), weight) in out.iter_mut().zip(y).zip(weight) {
            *out = (*out - y) * weight;
        }
        ok
    }

    /// The point of these parameters; `None` where they have no response.
    pub(super) fn at(&self, parameters: Vec<f64>) -> Option<Evaluation> {
        let mut residuals: Vec<Vec<f64>> = self.steps.iter().map(|step| vec![0.0; step.y.len()]).collect();
        let mut ok = true;
        for (step, out) in residuals.iter_mut().enumerate() {
            ok &= self.residuals(step, &parameters, out);
        }
        let of_rows = residuals.iter().flatten().map(|r| r * r).sum::<f64>();
        let gaussian_priors =
            self.gaussian_priors().map(|(at, mean, std)| ((parameters[at] - mean) / std).powi(2)).sum::<f64>();
        ok.then_some(Evaluation { parameters, residuals, sum: of_rows + gaussian_priors })
    }

    /// The parameters of which something is known beforehand: each with mean and standard deviation.
    fn gaussian_priors(&self) -> impl Iterator<Item = (usize, f64, f64)> {
        let onsets = (0..self.steps.len()).map(|step| (Self::onset_index(step), 0.0, self.onset_std_s));
        std::iter::once((CURVATURE, self.curvature.0, self.curvature.1)).chain(onsets)
    }

    /// A magnitude that a parameter has or may have, which sizes its difference step: 10 ms for times, 1 for ratios and logarithms. Chosen:
    /// central differences lose no digit that matters by a factor of ten either way.
    fn typical(local: usize) -> f64 {
        let onset = SHARED + 2;
        if local == DELAY || local == onset { 0.01 } else { 1.0 }
    }

    /// Sums local matrices of the steps into one of all parameters.
    pub(super) fn assemble_normal_matrix(&self, locals: impl Iterator<Item = DMatrix<f64>>) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(self.count(), self.count());
        for (step, local) in locals.enumerate() {
            for i in 0..LOCAL {
                for j in 0..LOCAL {
                    all[(Self::global_index(step, i), Self::global_index(step, j))] += local[(i, j)];
                }
            }
        }
        for (at, _, std) in self.gaussian_priors() {
            all[(at, at)] += (std * std).recip();
        }
        all
    }
}

impl NormalEquations for StepProblem<'_> {
    type Point = Evaluation;
    type Linearization = Linearization;

    /// Central differences of each step by what it depends on.
    fn linearize(&self, at: &mut Evaluation) -> Option<Linearization> {
        let mut p = at.parameters.clone();
        let mut blocks = Vec::with_capacity(self.steps.len());
        for (k, step) in self.steps.iter().enumerate() {
            let rows = step.y.len();
            let (mut ahead, mut behind) = (vec![0.0; rows], vec![0.0; rows]);
            let mut block = DMatrix::zeros(rows, LOCAL);
            for local in 0..LOCAL {
                let place = Self::global_index(k, local);
                let from = p[place];
                let h = f64::EPSILON.cbrt() * from.abs().max(Self::typical(local));
                p[place] = from + h;
                let ok = self.residuals(k, &p, &mut ahead);
                p[place] = from - h;
                if !(ok && self.residuals(k, &p, &mut behind)) {
                    return None;
                }
                p[place] = from;
                for ((d, ahead), behind) in block.column_mut(local).iter_mut().zip(&ahead).zip(&behind) {
                    *d = (ahead - behind) / (2.0 * h);
                }
            }
            blocks.push(block);
        }
        let matrix = self.assemble_normal_matrix(blocks.iter().map(|block| block.tr_mul(block)));
        Some(Linearization { blocks, matrix })
    }

    fn matrix<'a>(&self, linearization: &'a Linearization) -> &'a DMatrix<f64> {
        &linearization.matrix
    }

    fn moved(&self, from: &Evaluation, step: &DVector<f64>, _: &Linearization) -> Option<Evaluation> {
        self.at(from.parameters.iter().zip(step.iter()).map(|(at, step)| at + step).collect())
    }

    fn sum_of_squares(&self, at: &Evaluation) -> f64 {
        at.sum
    }

    fn gradient(&self, at: &Evaluation, linearization: &Linearization) -> DVector<f64> {
        let mut gradient = DVector::zeros(self.count());
        for (step, (block, residuals)) in linearization.blocks.iter().zip(&at.residuals).enumerate() {
            let local = block.tr_mul(&DVector::from_column_slice(residuals));
            for (i, value) in local.iter().enumerate() {
                gradient[Self::global_index(step, i)] += value;
            }
        }
        for (place, mean, std) in self.gaussian_priors() {
            gradient[place] += (at.parameters[place] - mean) / (std * std);
        }
        gradient
    }
}
