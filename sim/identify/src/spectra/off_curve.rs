//! Lines that are off the smooth curve through their neighbors.
//!
//! A disturbance whose frequency is a multiple of the record's repeats from period to period, as the
//! response does, and no spread tells it apart. It sits on one line, though, and the response of an
//! actuator is smooth over a few lines. So a parabola is fitted to the ten nearest neighbors of each
//! line, and the line's distance from it is compared with what the neighbors themselves scatter
//! around it or with their noise, whichever is more: an F test, its level divided by the number of
//! lines. Where the response bends between lines all neighbors miss the parabola, and nothing stands
//! out.

use nalgebra::{Matrix3, Vector3};
use num_complex::Complex64;
use rotorlead_numerics::statistics::f_upper_tail;

/// Probability that a record without disturbance loses a line. Chosen: of 150 lines, one is then found from 6.3 of its standard deviations
/// on (F(2, 14) with the error of the parabola); 0.01 would find it from 5.1 on.
const LEVEL: f64 = 1e-3;
/// Neighbors to either side. Chosen: a parabola through ten leaves 7 complex degrees of freedom; fewer find less, more lines bend beyond
/// a parabola.
const REACH: usize = 5;

/// Which of `response` are off the curve, given their variances.
pub(crate) fn off_the_curve(response: &[Complex64], variance: &[f64]) -> Vec<bool> {
    let count = response.len();
    let mut off = vec![false; count];
    if count <= 2 * REACH {
        return off;
    }
    // The ends have neighbors on one side only: extrapolation would flag the curve, not the line.
    for k in REACH..count - REACH {
        let places = (1..=REACH).flat_map(|d| [-(d as f64), d as f64]);
        let row = |x: f64| Vector3::new(1.0, x, x * x);
        let at = |x: f64| response[(k as f64 + x) as usize];
        let mut normal = Matrix3::zeros();
        let (mut real, mut imaginary) = (Vector3::zeros(), Vector3::zeros());
        for x in places.clone() {
            normal += row(x) * row(x).transpose();
            real += row(x) * at(x).re;
            imaginary += row(x) * at(x).im;
        }
        let Some(inverse) = normal.try_inverse() else { continue };
        let (real, imaginary) = (inverse * real, inverse * imaginary);
        let curve = |x: f64| Complex64::new(real.dot(&row(x)), imaginary.dot(&row(x)));
        let dof = (2 * REACH - 3) as f64;
        let scatter = places.clone().map(|x| (at(x) - curve(x)).norm_sqr()).sum::<f64>() / dof;
        let noise = places.map(|x| variance[(k as f64 + x) as usize]).sum::<f64>() / (2 * REACH) as f64;
        let expected = (1.0 + inverse[(0, 0)]) * scatter.max(noise);
        let tail = f_upper_tail((response[k] - curve(0.0)).norm_sqr() / expected, 2.0, 2.0 * dof);
        off[k] = tail * (count as f64) < LEVEL;
    }
    off
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_off_the_curve_is_found_and_a_steep_curve_is_not() {
        // A lag with its pole at 1 Hz, lines from 0.1 Hz at every 0.2 Hz, hardly any noise.
        let mut response: Vec<_> = (0..150).map(|k| 10.0 / Complex64::new(1.0, 0.1 + 0.2 * f64::from(k))).collect();
        let variance = vec![1e-10; 150];
        assert!(!off_the_curve(&response, &variance).contains(&true));
        response[80] += Complex64::new(0.0, 0.01);
        let off = off_the_curve(&response, &variance);
        assert!(off[80] && off.iter().filter(|o| **o).count() == 1);
    }
}
