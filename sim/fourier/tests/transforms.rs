//! Known transforms, and inverses that give the samples back.

use num_complex::Complex64;

use rotorlead_fourier::{forward, inverse, real_forward, real_inverse};

#[test]
fn a_sinusoid_is_one_line_and_comes_back() {
    // Lengths that are a power of two, even, odd and prime.
    for length in [64_usize, 60, 45, 37] {
        let turn = std::f64::consts::TAU * 3.0 / length as f64;
        let samples: Vec<f64> = (0..length).map(|n| 0.5 + (turn * n as f64 + 0.4).cos()).collect();
        let expected = |k: usize| match k {
            0 => Complex64::from(0.5 * length as f64),
            3 => Complex64::from_polar(0.5 * length as f64, 0.4),
            _ => Complex64::ZERO,
        };

        let (mut input, mut lines) = (samples.clone(), vec![Complex64::ZERO; length / 2 + 1]);
        real_forward(length).process(&mut input, &mut lines).unwrap();
        assert!(lines.iter().enumerate().all(|(k, line)| (line - expected(k)).norm() < 1e-12 * length as f64));
        let mut again = vec![0.0; length];
        real_inverse(length).process(&mut lines, &mut again).unwrap();
        assert!(again.iter().zip(&samples).all(|(y, x)| (y / length as f64 - x).abs() < 1e-14));

        let mut complex: Vec<Complex64> = samples.iter().map(|x| Complex64::from(*x)).collect();
        forward(length).process(&mut complex);
        assert!((0..=length / 2).all(|k| (complex[k] - expected(k)).norm() < 1e-12 * length as f64));
        inverse(length).process(&mut complex);
        assert!(complex.iter().zip(&samples).all(|(y, x)| (y / length as f64 - x).norm() < 1e-14));
    }
}
