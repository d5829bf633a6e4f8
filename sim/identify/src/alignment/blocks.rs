//! Delay and skew where both logs have the response: one delay for each second, and a robust line through them.
//!
//! Two meters of one speed disagree by more than noise: stamps come in bursts, and each meter has its own spikes. Rows of a change
//! are then wrong together, by a delay of their own, and least squares over all rows would follow the worst second with an interval
//! that knows nothing of it. So the delay of each second is estimated by itself,
//!
//! `d_b = sum z (y - x) / sum z j`, `j = dx / dD`, `z = (x(D + h) - x(D - h)) / 2 h`,
//!
//! all with their mean over the second taken off, with the variance `s_b^2 sum z^2 / (sum z j)^2` of its residuals `s_b`. The wider
//! slope `z` is an instrument (Ljung, section 7.6): with `j` in its place the noise of the one meter, which is not in the other, would
//! pull every estimate to zero. Then `d = D + sigma (t - t_ref)` goes through the seconds as an M-estimate with Tukey's
//! biweight (Maronna, Martin, Yohai, *Robust Statistics*, chapter 4), whose covariance is that of how far the seconds scatter.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use rotorlead_numerics::least_squares::Residuals as _;
use rotorlead_numerics::sample::{STD_PER_MEDIAN_DEVIATION, mean, median};

use super::problem::{AlignmentProblem, DELAY, GAIN};

/// Length of a block, seconds: a change of speed takes as long, and stamps wait for each other for less. Chosen: shorter blocks split a
/// change, longer ones leave fewer of them to measure the scatter by.
const BLOCK_S: f64 = 1.0;
/// Fewest rows of a block. Chosen: ten leave 8 degrees of freedom to the variance of its delay; with fewer rows in a second a change of
/// speed is not resolved.
const LEAST_ROWS: usize = 10;
/// Half the width of the wider slope, in rows. Derived: from 2 on its rows are others than those of the slope, where rows are even; the
/// third is for stamps that jitter.
const WIDER: f64 = 3.0;
/// Least correlation coefficient of slope and wider slope; below it, the block is noise. Chosen: the standard error of a delay goes with
/// one over the correlation and is three times that of a clean slope here; a weaker instrument has no reliable variance.
const AGREE: f64 = 0.3;
/// Largest standard error of a block's delay, seconds. Chosen: about the shortest lag of a rotor; a block at the bound has little weight
/// beside one that is known to some milliseconds, so that twice the bound changes the line little.
const VAGUE_S: f64 = 0.02;
/// Fewest blocks for the robust line; with fewer, least squares over all rows gives it. Chosen: six leave the line 4 degrees of freedom,
/// and their median withstands two bad ones.
const LEAST_BLOCKS: usize = 6;
/// Tuning constant of Tukey's biweight, standard deviations. Standard (Maronna, Martin, Yohai): 95 % of the efficiency of least squares
/// where all errors are normal.
const TUKEY: f64 = 4.685;
/// Passes: each brings the line nearer to where the delays of the blocks are zero. Chosen: the delays are linear in the line near its end,
/// so that a few passes settle it and more cost only time.
const ROUNDS: usize = 12;
/// Reweightings in each pass. Chosen: they converge by a constant factor each, and the next pass goes on where one ends; more cost only
/// time.
const REWEIGHTINGS: usize = 20;

/// Delay and skew with their standard errors.
pub(super) struct DelayLine {
    /// All parameters of the problem at them.
    pub(super) parameters: Vec<f64>,
    pub(super) delay_std_s: f64,
    /// Zero where it is not fitted.
    pub(super) skew_std: f64,
    pub(super) dof: f64,
}

/// The estimate of one second.
struct Block {
    /// From the reference on, in seconds of the skew's factor.
    lever_s: f64,
    /// Delay beyond that of the parameters, seconds.
    delay_s: f64,
    variance: f64,
}

/// The line, from parameters that are near it; `None` where too few seconds have an estimate.
pub(super) fn line(problem: &AlignmentProblem<'_>, start: &[f64]) -> Option<DelayLine> {
    let mut p = start.to_vec();
    for round in 0..ROUNDS {
        let linear = linear_parameters(problem, &p)?;
        p[GAIN - 1..GAIN + problem.powers].copy_from_slice(linear.as_slice());
        let blocks = blocks(problem, &p)?;
        if blocks.len() < LEAST_BLOCKS {
            return None;
        }
        let found = WeightedLine::fit(&blocks, problem.skew, round == 0)?;
        p[DELAY] += found.at.x;
        if problem.skew {
            let skew = problem.skew_index();
            p[skew] += found.at.y;
        }
        if round + 1 == ROUNDS {
            let dof = (found.weight - 1.0 - f64::from(u8::from(problem.skew))).max(1.0);
            return Some(DelayLine {
                parameters: p,
                delay_std_s: found.covariance[(0, 0)].sqrt(),
                skew_std: found.covariance[(1, 1)].sqrt(),
                dof,
            });
        }
    }
    None
}

/// Offset and gain at the delay and skew of `p`.
fn linear_parameters(problem: &AlignmentProblem<'_>, p: &[f64]) -> Option<DVector<f64>> {
    let columns = problem.regressors(p)?;
    let right = columns.tr_mul(&DVector::from_column_slice(problem.response));
    columns.tr_mul(&columns).cholesky().map(|normal| normal.solve(&right))
}

fn blocks(problem: &AlignmentProblem<'_>, p: &[f64]) -> Option<Vec<Block>> {
    let plain = AlignmentProblem { color: Vec::new(), ..problem.clone() };
    let interval_s = median(problem.command_time_s.windows(2).map(|pair| pair[1] - pair[0]))?;
    let modeled_at = |delay_s: f64| {
        let mut at = p.to_vec();
        at[DELAY] += delay_s;
        let mut residuals = vec![0.0; plain.count()];
        plain.evaluate(&at, &mut residuals).then_some(residuals)
    };
    let half_s = WIDER * interval_s;
    let (residuals, early, late) = (modeled_at(0.0)?, modeled_at(-half_s)?, modeled_at(half_s)?);
    let wider: Vec<f64> = early.iter().zip(&late).map(|(early, late)| (late - early) / (2.0 * half_s)).collect();
    let mut jacobian = DMatrix::zeros(plain.count(), plain.parameters());
    plain.jacobian(p, &mut jacobian).then_some(())?;
    let slopes = jacobian.column(DELAY);
    let rate = 1.0 + problem.skew(p);
    let mut found = Vec::new();
    let mut first = 0;
    while first < problem.time_s.len() {
        let end = first + problem.time_s[first..].partition_point(|t| *t < problem.time_s[first] + BLOCK_S);
        let rows = first..end;
        if let Some((delay_s, variance)) =
            fit_delay(&residuals[rows.clone()], &slopes.as_slice()[rows.clone()], &wider[rows.clone()])
        {
            let power = |row: usize| wider[row] * wider[row];
            let moment: f64 = rows.clone().map(|row| power(row) * problem.time_s[row]).sum();
            let lever_s = (moment / rows.map(power).sum::<f64>() - problem.reference_s) / (rate * rate);
            found.push(Block { lever_s, delay_s, variance });
        }
        first = end;
    }
    Some(found)
}

/// By how much rows are late beyond the model, and the variance of that; `None` where it is not identifiable.
fn fit_delay(residuals: &[f64], slopes: &[f64], wider: &[f64]) -> Option<(f64, f64)> {
    let rows = residuals.len();
    if rows < LEAST_ROWS {
        return None;
    }
    let product = |a: &[f64], b: &[f64]| {
        let (a0, b0) = (mean(a), mean(b));
        a.iter().zip(b).map(|(a, b)| (a - a0) * (b - b0)).sum::<f64>()
    };
    let (moved, power) = (product(wider, slopes), product(wider, wider));
    if moved < AGREE * (power * product(slopes, slopes)).sqrt() {
        return None;
    }
    let delay_s = -product(wider, residuals) / moved;
    let left: Vec<f64> = residuals.iter().zip(slopes).map(|(r, j)| r + j * delay_s).collect();
    let variance = product(&left, &left) / (rows - 2) as f64 * power / (moved * moved);
    (variance < VAGUE_S * VAGUE_S).then_some((delay_s, variance))
}

/// The line through the seconds: delay at the reference, and skew.
struct WeightedLine {
    at: Vector2<f64>,
    covariance: Matrix2<f64>,
    /// Sum of the weights, one for a second that nothing is wrong with.
    weight: f64,
}

impl WeightedLine {
    fn fit(blocks: &[Block], with_skew: bool, is_first: bool) -> Option<Self> {
        let lever = |block: &Block| Vector2::new(1.0, if with_skew { block.lever_s } else { 0.0 });
        let pinned = if with_skew { Matrix2::zeros() } else { Matrix2::new(0.0, 0.0, 0.0, 1.0) };
        let mut at = if is_first { median_line(blocks, with_skew)? } else { Vector2::zeros() };
        let mut inverse = Matrix2::zeros();
        let mut weighed = Vec::new();
        for _ in 0..REWEIGHTINGS {
            let off = |block: &Block| block.delay_s - lever(block).dot(&at);
            let scale_s = STD_PER_MEDIAN_DEVIATION * median(blocks.iter().map(|block| off(block).abs()))?;
            weighed = blocks.iter().map(|block| Weighed::new(off(block), block.variance + scale_s * scale_s)).collect();
            let pairs = || blocks.iter().zip(&weighed).map(|(block, of)| (lever(block), of.weight(), block.delay_s));
            let normal = pairs().map(|(x, w, _)| w * x * x.transpose()).sum::<Matrix2<f64>>() + pinned;
            inverse = normal.try_inverse()?;
            at = inverse * pairs().map(|(x, w, delay_s)| w * delay_s * x).sum::<Vector2<f64>>();
        }
        let (mut bread, mut meat) = (pinned, Matrix2::zeros());
        for (block, of) in blocks.iter().zip(&weighed) {
            let x = lever(block);
            let square = x * x.transpose();
            // A second pulls the line to itself, and lies the nearer for it (MacKinnon and White 1985, HC3).
            let leverage = of.weight() * x.dot(&(inverse * x));
            bread += of.sensitivity() * square;
            meat += (of.weight() * of.off_s / (1.0 - leverage)).powi(2) * square;
        }
        let bread = bread.cholesky()?.inverse();
        Some(Self { at, covariance: bread * meat * bread, weight: weighed.iter().map(Weighed::biweight).sum() })
    }
}

/// How far a second lies from the line, beside the variance that it may have.
struct Weighed {
    off_s: f64,
    variance: f64,
    /// Square of the distance over that from which on a second does not count.
    share: f64,
}

impl Weighed {
    fn new(off_s: f64, variance: f64) -> Self {
        Self { off_s, variance, share: (off_s / TUKEY).powi(2) / variance }
    }

    /// One for a second on the line, zero for one that does not count.
    fn biweight(&self) -> f64 {
        (1.0 - self.share).max(0.0).powi(2)
    }

    fn weight(&self) -> f64 {
        self.biweight() / self.variance
    }

    /// By how much more it pulls as it lies further away.
    fn sensitivity(&self) -> f64 {
        (1.0 - self.share).max(0.0) * (1.0 - 5.0 * self.share) / self.variance
    }
}

/// The median of all slopes between two seconds, and of what they leave (Theil, Sen).
fn median_line(blocks: &[Block], with_skew: bool) -> Option<Vector2<f64>> {
    let slopes = || {
        blocks.iter().enumerate().flat_map(|(k, one)| {
            let apart = |other: &&Block| (other.lever_s - one.lever_s).abs() > BLOCK_S;
            let slope = |other: &Block| (other.delay_s - one.delay_s) / (other.lever_s - one.lever_s);
            blocks[k + 1..].iter().filter(apart).map(slope)
        })
    };
    let skew = median(slopes()).filter(|_| with_skew).unwrap_or(0.0);
    median(blocks.iter().map(|block| block.delay_s - skew * block.lever_s)).map(|delay_s| Vector2::new(delay_s, skew))
}
