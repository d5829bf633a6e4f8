//! Steps and covariances from the normal matrix `J'J`, in a scaling that does not depend on the parameters' units.

use nalgebra::{Cholesky, DMatrix, DVector};

/// Least value of the scale of damping, as a share of its largest one: below there is the rounding of inexact derivatives. Derived: it is a
/// derivative of a millionth of the largest one, squared.
const LEAST_SHARE: f64 = 1e-12;

/// Diagonal of the normal matrix without values below its rounding: a scale by which [`damped_step`] may damp.
#[must_use]
pub fn floored_diagonal(matrix: &DMatrix<f64>) -> DVector<f64> {
    let diagonal = matrix.diagonal();
    let least = LEAST_SHARE * diagonal.max();
    diagonal.map(|d| d.max(least))
}

/// Solves `(J'J + damping diag(scale)) step = -gradient`, with `gradient` `J'r`. `None` where the matrix is not positive
/// definite.
#[must_use]
pub fn damped_step(
    matrix: &DMatrix<f64>,
    gradient: &DVector<f64>,
    scale: &DVector<f64>,
    damping: f64,
) -> Option<DVector<f64>> {
    let mut damped = matrix.clone();
    for (j, s) in scale.iter().enumerate() {
        // A parameter without any effect stays where it is.
        damped[(j, j)] += damping * if *s > 0.0 { *s } else { 1.0 };
    }
    Some(-Cholesky::new(damped)?.solve(gradient))
}

/// Inverse of a positive definite matrix whose rows and columns are scaled to a unit diagonal first, so that the parameters'
/// units do not decide whether it exists.
///
/// `ridge` is added to the unit diagonal: with a positive one, combinations of parameters that the data leave undetermined get
/// a variance of some `1 / ridge` instead of `None`, also parameters without any effect.
#[must_use]
pub fn scaled_inverse(matrix: &DMatrix<f64>, ridge: f64) -> Option<DMatrix<f64>> {
    let has_no_effect = |d: f64| d <= 0.0 && ridge > 0.0;
    let scale = matrix.diagonal().map(|d| if has_no_effect(d) { 1.0 } else { d.sqrt().recip() });
    if !scale.iter().all(|s| s.is_finite()) {
        return None;
    }
    let mut scaled = DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    for j in 0..scaled.nrows() {
        scaled[(j, j)] = scaled[(j, j)].max(ridge) * (1.0 + ridge);
    }
    let inverse = Cholesky::new(scaled)?.inverse();
    Some(DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns of the 3 x 3 Hilbert matrix, whose inverse has whole numbers, in units that differ by 1e16.
    fn hilbert_in_units(units: [f64; 3]) -> DMatrix<f64> {
        DMatrix::from_fn(3, 3, |i, j| units[i] * units[j] / (i + j + 1) as f64)
    }

    #[test]
    fn units_do_not_matter() {
        let known = [[9.0, -36.0, 30.0], [-36.0, 192.0, -180.0], [30.0, -180.0, 180.0]];
        let units = [1e-8, 1.0, 1e8];
        let matrix = hilbert_in_units(units);
        let inverse = scaled_inverse(&matrix, 0.0).unwrap();
        let step = damped_step(&matrix, &DVector::from_fn(3, |i, _| units[i]), &matrix.diagonal(), 0.0).unwrap();
        for (i, row) in known.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                assert!((inverse[(i, j)] * units[i] * units[j] / value - 1.0).abs() < 1e-12, "{i} {j}");
            }
            assert!((step[i] * units[i] + row.iter().sum::<f64>()).abs() < 1e-10, "{i}");
        }
    }

    #[test]
    fn what_is_undetermined_has_no_covariance_or_a_large_one() {
        let matrix = DMatrix::from_row_slice(3, 3, &[2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 8.0]);
        assert_eq!(scaled_inverse(&matrix, 0.0), None);
        let inverse = scaled_inverse(&matrix, 1e-10).unwrap();
        assert!((inverse[(0, 0)] - 0.5).abs() < 1e-9 && (inverse[(2, 2)] - 0.125).abs() < 1e-9);
        assert!((inverse[(1, 1)] / 1e10 - 1.0).abs() < 1e-9);
        let twice = DMatrix::from_element(2, 2, 3.0);
        assert_eq!(scaled_inverse(&twice, 0.0), None);
        assert!(scaled_inverse(&twice, 1e-10).unwrap()[(0, 0)] > 1e9 / 3.0);
    }

    #[test]
    fn a_parameter_without_effect_stays() {
        let matrix = DMatrix::from_row_slice(2, 2, &[4.0, 0.0, 0.0, 0.0]);
        let step = damped_step(&matrix, &DVector::from_vec(vec![2.0, 0.0]), &matrix.diagonal(), 3.0).unwrap();
        assert_eq!(step.as_slice(), [-0.125, 0.0]);
        assert_eq!(floored_diagonal(&matrix).as_slice(), [4.0, 4e-12]);
    }
}
