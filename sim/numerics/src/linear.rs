//! Linear least squares by the singular value decomposition.

use nalgebra::{DMatrix, DVector};

/// Entries from here on are refused. Derived: 1e8 squares of 1e150 add up to 1e308, near the largest double.
const LARGEST: f64 = 1e150;

/// The shortest `x` that brings `matrix x` nearest to `right`, without the directions whose singular value is below `min_singular_value`.
/// `None` where an entry is not finite, or too large to be squared: the decomposition of such a matrix does not exist, and
/// looking for it may not end.
#[must_use]
pub fn linear_least_squares(
    matrix: DMatrix<f64>,
    right: &DVector<f64>,
    min_singular_value: f64,
) -> Option<DVector<f64>> {
    let is_number = |value: &f64| value.abs() < LARGEST;
    if !(matrix.iter().all(is_number) && right.iter().all(is_number)) {
        return None;
    }
    matrix.svd(true, true).solve(right, min_singular_value).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_through_points_is_found() {
        let matrix = DMatrix::from_row_slice(3, 2, &[1.0, 0.0, 1.0, 1.0, 1.0, 2.0]);
        let found = linear_least_squares(matrix, &DVector::from_vec(vec![1.0, 3.0, 5.0]), 1e-12).unwrap();
        assert!((found[0] - 1.0).abs() < 1e-12 && (found[1] - 2.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_number_has_no_solution() {
        for value in [f64::NAN, f64::INFINITY, 1e200] {
            let good = DVector::from_vec(vec![1.0, 2.0]);
            let matrix = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, value, 1.0]);
            assert_eq!(linear_least_squares(matrix, &good, 1e-12), None);
            assert_eq!(
                linear_least_squares(DMatrix::identity(2, 2), &DVector::from_vec(vec![1.0, value]), 1e-12),
                None
            );
        }
    }
}
