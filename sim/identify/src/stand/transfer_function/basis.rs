//! Polynomials that are orthonormal on the lines, and the roots of their sums.
//!
//! Powers of `s` over three decades are numerically dependent beyond order four. The polynomials of Forsythe (1957)
//! for the measure `sum mu_k |p(j w_k)|^2` are not. The measure counts each line at `+w` and `-w` alike, so the operator
//! "times s" is skew and the recursion has one real coefficient per degree:
//!
//! ```text
//! s p_i = h_(i+1) p_(i+1) - h_i p_(i-1)
//! ```
//!
//! The roots of `sum c_i p_i` are the eigenvalues of this recursion's matrix with `p_n` eliminated (the comrade
//! matrix): they are found without ever forming a coefficient of `s^n`.

use nalgebra::{DMatrix, Schur};
use num_complex::Complex64;

/// Orthonormal polynomials up to some degree.
pub(super) struct Basis {
    /// Value of each polynomial at each line.
    pub(super) values: Vec<Vec<Complex64>>,
    /// `h_1, h_2, ..`: one per degree above zero.
    recursion: Vec<f64>,
}

impl Basis {
    /// Polynomials up to `degree` for weights `measure` (above zero) at frequencies `omega`. `None` when there are
    /// fewer distinct lines than the degree needs.
    pub(super) fn new(omega: &[f64], measure: &[f64], degree: usize) -> Option<Self> {
        let norm = |p: &[Complex64]| measure.iter().zip(p).map(|(m, p)| m * p.norm_sqr()).sum::<f64>().sqrt();
        let ones = vec![Complex64::ONE; omega.len()];
        let scale = norm(&ones).recip();
        let mut values = vec![ones.into_iter().map(|p| p * scale).collect::<Vec<_>>()];
        let mut recursion = Vec::with_capacity(degree);
        for i in 0..degree {
            let mut next: Vec<_> = omega.iter().zip(&values[i]).map(|(w, p)| Complex64::new(0.0, *w) * p).collect();
            if i > 0 {
                let h = recursion[i - 1];
                for (n, p) in next.iter_mut().zip(&values[i - 1]) {
                    *n += p * h;
                }
            }
            let h = norm(&next);
            if !(h.is_finite() && h > 0.0) {
                return None;
            }
            for n in &mut next {
                *n /= h;
            }
            recursion.push(h);
            values.push(next);
        }
        Some(Self { values, recursion })
    }

    /// Value of `sum coefficients_i p_i` at each line.
    pub(super) fn sum(&self, coefficients: &[f64]) -> Vec<Complex64> {
        let mut sum = vec![Complex64::ZERO; self.values[0].len()];
        for (c, p) in coefficients.iter().zip(&self.values) {
            for (s, p) in sum.iter_mut().zip(p) {
                *s += p * c;
            }
        }
        sum
    }

    /// Roots of `sum coefficients_i p_i`, in the unit of the frequencies. A leading coefficient of zero puts a root
    /// at a very large value.
    pub(super) fn roots(&self, coefficients: &[f64]) -> Option<Vec<Complex64>> {
        let n = coefficients.len() - 1;
        if n == 0 {
            return Some(Vec::new());
        }
        let largest = coefficients.iter().fold(0.0, |a: f64, c| a.max(c.abs()));
        let leading = coefficients[n];
        // Chosen: above the rounding of a sum, and it puts the root far beyond all lines.
        let leading = if leading.abs() > 1e-12 * largest { leading } else { (1e-12 * largest).copysign(leading) };
        let mut matrix = DMatrix::zeros(n, n);
        for i in 0..n {
            if i > 0 {
                matrix[(i, i - 1)] = -self.recursion[i - 1];
            }
            if i + 1 < n {
                matrix[(i, i + 1)] = self.recursion[i];
            }
        }
        for (i, c) in coefficients[..n].iter().enumerate() {
            matrix[(n - 1, i)] -= self.recursion[n - 1] * c / leading;
        }
        if !matrix.iter().all(|value: &f64| value.is_finite()) {
            return None;
        }
        // Chosen: the QR algorithm takes a few iterations for each of at most 16 roots; the bound ends one that does not converge.
        let roots = Schur::try_new(matrix, f64::EPSILON, 1000)?.complex_eigenvalues();
        Some(roots.iter().copied().collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines() -> Vec<f64> {
        (0..300).map(|k| 1e-3 * 10f64.powf(f64::from(k) / 100.0)).collect()
    }

    #[test]
    fn the_polynomials_are_orthonormal_at_order_twelve() {
        let omega = lines();
        let measure: Vec<f64> = omega.iter().map(|w| 1.0 / (0.01 + w * w)).collect();
        let basis = Basis::new(&omega, &measure, 12).unwrap();
        for i in 0..=12 {
            for j in 0..=12 {
                let product: f64 =
                    (0..300).map(|k| measure[k] * (basis.values[i][k] * basis.values[j][k].conj()).re).sum();
                assert!((product - f64::from(u8::from(i == j))).abs() < 1e-9, "{i} {j} {product}");
            }
        }
    }

    #[test]
    fn roots_over_two_decades_come_back() {
        let omega = lines();
        let basis = Basis::new(&omega, &vec![1.0; 300], 8).unwrap();
        let mut expected: Vec<Complex64> = [(0.01, 0.02), (0.05, 0.01), (0.2, 0.03), (0.9, 0.02)]
            .iter()
            .flat_map(|&(w, d): &(f64, f64)| {
                let root = Complex64::new(-d * w, w * (1.0 - d * d).sqrt());
                [root, root.conj()]
            })
            .collect();
        let polynomial: Vec<Complex64> =
            omega.iter().map(|w| expected.iter().map(|r| Complex64::new(0.0, *w) - r).product::<Complex64>()).collect();
        // Projections on the basis are its coefficients.
        let coefficients: Vec<f64> = basis
            .values
            .iter()
            .map(|p| p.iter().zip(&polynomial).map(|(p, f)| (f * p.conj()).re).sum::<f64>())
            .collect();
        let mut found = basis.roots(&coefficients).unwrap();
        let key = |r: &Complex64| (r.im, r.re);
        found.sort_by(|a, b| key(a).partial_cmp(&key(b)).unwrap());
        expected.sort_by(|a, b| key(a).partial_cmp(&key(b)).unwrap());
        for (f, e) in found.iter().zip(&expected) {
            assert!((f - e).norm() < 1e-6 * e.norm(), "{f} {e}");
        }
    }
}
