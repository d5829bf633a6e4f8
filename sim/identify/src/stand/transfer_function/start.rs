//! Initial values of the search: bootstrapped total least squares.
//!
//! With the denominator `D_i` of the last pass divided out (Sanathanan & Koerner, 1963), the equation error
//!
//! ```text
//! e_k = (N(s_k) - G_k D(s_k)) / (sigma_k |D_i(s_k)|)
//! ```
//!
//! is linear in the coefficients. Its least-squares solution is biased, because noisy `G_k` multiplies `D`. Under the
//! constraint `sum |D(s_k)|^2 / |D_i(s_k)|^2 = 1` the noise adds the same to the cost of every `D`, and the minimum is
//! consistent (bootstrapped total least squares; Pintelon & Schoukens, 2012, section 9.12). Both polynomials are
//! expanded in polynomials that are orthonormal for their own weights: the constraint then says that the coefficients
//! of `D` have unit length, and the solution is a singular vector.

use nalgebra::{DMatrix, DVector, SVD};
use num_complex::Complex64;

use super::basis::Basis;
use super::data::WeightedLines;
use super::structure::Structure;

/// Passes of the linear problem. It settles in three to eight. Chosen: half again as many; the best pass is taken in any case.
const PASSES: usize = 12;

/// A model to search from.
#[derive(Clone, Debug)]
pub(super) struct Start {
    pub(super) gain: f64,
    pub(super) poles: Vec<Complex64>,
    pub(super) zeros: Vec<Complex64>,
    /// Its chi-square, `sum |G_k - model|^2 / sigma_k^2`.
    pub(super) cost: f64,
}

/// The best of all passes.
pub(super) fn start(data: &WeightedLines, structure: Structure) -> Option<Start> {
    // Frequencies near one keep the matrices of the roots balanced.
    let unit = data.top_rad_s();
    let omega: Vec<f64> = data.omega_rad_s.iter().map(|w| w / unit).collect();
    let mut last = vec![1.0; data.len()];
    let mut best: Option<Start> = None;
    let mut since = 0;
    for _ in 0..PASSES {
        let Some(pass) = Pass::solve(data, &omega, &last, structure) else { break };
        if let Some(start) = pass.start(data, unit) {
            let previous = best.as_ref().map_or(f64::INFINITY, |best| best.cost);
            // Two passes that gain nothing: it has settled, or goes around. Chosen: the search gains the last thousandth by itself.
            since = if start.cost < previous * (1.0 - 1e-3) { 0 } else { since + 1 };
            if start.cost < previous {
                best = Some(start);
            }
        }
        if since > 1 {
            break;
        }
        last = pass.denominator_values.iter().map(|d| d.norm()).collect();
        let largest = last.iter().fold(0.0, |a: f64, b| a.max(*b));
        // Chosen: a pole on a line must not divide by zero.
        for d in &mut last {
            *d = d.max(1e-9 * largest);
        }
    }
    best
}

/// The solution of one linear problem.
struct Pass {
    denominator: Vec<f64>,
    denominator_basis: Basis,
    denominator_values: Vec<Complex64>,
    numerator: Vec<f64>,
    numerator_basis: Basis,
    numerator_values: Vec<Complex64>,
}

impl Pass {
    fn solve(data: &WeightedLines, omega: &[f64], last: &[f64], structure: Structure) -> Option<Self> {
        let lines = data.len();
        let scale: Vec<f64> = data.weight.iter().zip(last).map(|(w, d)| w / d).collect();
        let measure: Vec<f64> = scale.iter().map(|s| s * s).collect();
        let numerator_basis = Basis::new(omega, &measure, structure.zeros)?;
        let measure: Vec<f64> = last.iter().map(|d| 1.0 / (d * d)).collect();
        let denominator_basis = Basis::new(omega, &measure, structure.poles)?;

        let matrix = |basis: &Basis, factor: &dyn Fn(usize) -> Complex64| {
            DMatrix::from_fn(2 * lines, basis.values.len(), |row, column| {
                let k = row / 2;
                let value = basis.values[column][k] * factor(k);
                if row % 2 == 0 { value.re } else { value.im }
            })
        };
        let of_numerator = matrix(&numerator_basis, &|k| scale[k].into());
        let of_denominator = matrix(&denominator_basis, &|k| data.response[k] * scale[k]);
        // The numerator's columns are orthonormal, so the best numerator is a projection.
        let projection = of_numerator.tr_mul(&of_denominator);
        let rest = &of_denominator - &of_numerator * &projection;
        let triangle = rest.qr().r();
        // Chosen: a few iterations for each of at most 17 values; the bound ends one that does not converge.
        let svd = SVD::try_new(triangle, false, true, f64::EPSILON, 1000)?;
        let least = svd.singular_values.imin();
        let denominator: DVector<f64> = svd.v_t?.row(least).transpose();
        let numerator = projection * &denominator;
        let (denominator, numerator): (Vec<f64>, Vec<f64>) =
            (denominator.iter().copied().collect(), numerator.iter().copied().collect());
        Some(Self {
            denominator_values: denominator_basis.sum(&denominator),
            numerator_values: numerator_basis.sum(&numerator),
            denominator,
            denominator_basis,
            numerator,
            numerator_basis,
        })
    }

    /// The solution as roots, with its chi-square. Frequencies are in units of `unit`.
    fn start(&self, data: &WeightedLines, unit: f64) -> Option<Start> {
        let cost: f64 = (0..data.len())
            .map(|k| {
                let model = self.numerator_values[k] / self.denominator_values[k];
                (data.response[k] - model).norm_sqr() * data.weight[k].powi(2)
            })
            .sum();
        let roots = |basis: &Basis, c: &[f64]| -> Option<Vec<Complex64>> {
            Some(basis.roots(c)?.into_iter().map(|r| r * unit).collect())
        };
        let (poles, zeros) =
            (roots(&self.denominator_basis, &self.denominator)?, roots(&self.numerator_basis, &self.numerator)?);
        // The static gain, at the lines: the polynomials themselves are not known at zero.
        let k = data.len() / 2;
        let s = Complex64::new(0.0, data.omega_rad_s[k]);
        let shape = zeros.iter().map(|z| 1.0 - s / z).product::<Complex64>()
            / poles.iter().map(|p| 1.0 - s / p).product::<Complex64>();
        let gain = (self.numerator_values[k] / self.denominator_values[k] / shape).re;
        let sound = cost.is_finite() && gain.is_finite() && gain != 0.0;
        sound.then_some(Start { gain, poles, zeros, cost })
    }
}
