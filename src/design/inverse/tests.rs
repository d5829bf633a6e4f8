//! The discrete model, the curve, the bound on rounding, and every refusal.

use super::*;
use crate::design::DesignError;
use num_complex::Complex64;
use std::format;

/// The paper's omega_f and damping.
const REFERENCE: ReferenceModel = ReferenceModel { omega_f_rad_s: 94.2156, damping: core::f64::consts::FRAC_1_SQRT_2 };

/// One time constant at every command.
fn flat(tau_s: f64) -> [CurvePoint; 1] {
    [CurvePoint { command: 0.5, tau_s }]
}

fn design(curve: &[CurvePoint]) -> Result<InverseDesign, InverseError> {
    InverseDesign::new(REFERENCE, 5000.0, curve)
}

#[test]
fn the_discrete_model_has_the_poles_of_the_continuous_one() {
    let Discrete { a, b } = REFERENCE.discrete(5000.0).unwrap();
    assert!((a - 0.018_718).abs() < 5e-7 && (b - 0.026_296).abs() < 5e-7, "{a} {b}");
    for damping in [0.3, 0.7, 1.0, 1.2, 2.0] {
        for angle in [1e-3, 0.05, 0.4] {
            let Discrete { a, b } = ReferenceModel { omega_f_rad_s: 1e3 * angle, damping }.discrete(1e3).unwrap();
            // Both poles, exp(s T): complex below a damping of 1, else real.
            let (root, decay) = ((damping * damping - 1.0).abs().sqrt() * angle, (-damping * angle).exp());
            for sign in [1.0, -1.0] {
                let z = if damping < 1.0 {
                    Complex64::new(decay * root.cos(), decay * sign * root.sin())
                } else {
                    Complex64::new(decay * (sign * root).exp(), 0.0)
                };
                let polynomial = z * z - z * (2.0 - b - a * a) + 1.0 - b;
                assert!(polynomial.norm_sqr().sqrt() < 1e-15 + 1e-9 * a * a, "{polynomial} at {damping}, {angle}");
            }
        }
    }
}

#[test]
fn the_pole_is_linear_between_points_and_constant_beyond() {
    let curve = [CurvePoint { command: 0.25, tau_s: 0.2 }, CurvePoint { command: 0.75, tau_s: 0.1 }];
    let poles = RotorCurve::through(&curve).unwrap().poles_rad_s().unwrap();
    for (index, want) in [(0, 5.0), (7, 5.0), (8, 5.0), (12, 6.25), (16, 7.5), (24, 10.0), (25, 10.0), (32, 10.0)] {
        assert!((poles[index] - want).abs() < 1e-6, "{} at point {index}", poles[index]);
    }
    let gains = design(&curve).unwrap().coefficients().gains();
    let gain = 0.018_718 / (1.0 - f64::exp(-7.5 / 5000.0));
    assert!((f64::from(gains[16]) / FORMAT_G - gain).abs() < 1e-3, "{gain}");
    assert_eq!(RotorCurve::through(&flat(0.1)).unwrap().time_constants_s(), [0.1; TABLE_POINTS]);
}

/// 2.6 rad/s, the slowest rotor for which the sum was computed independently; the bound on it is up to 0.1 % above.
#[test]
fn the_bound_on_rounding_grows_with_the_loop_rate_until_it_is_refused() {
    let slowest = flat(1.0 / 2.6);
    for (loop_rate_hz, steps) in [(1000.0, 390.0), (5000.0, 1922.0), (8000.0, 3071.0), (10_000.0, 3837.0)] {
        let error = InverseDesign::new(REFERENCE, loop_rate_hz, &slowest).unwrap().rounding_error();
        assert!(error > steps - 1.0 && error < 1.001 * steps + 1.0, "{error} steps at {loop_rate_hz} Hz");
    }
    let refused = InverseDesign::new(REFERENCE, 11_000.0, &slowest).unwrap_err();
    assert!(matches!(refused, InverseError::RoundingTooLarge { .. }), "{refused}");
}

/// The bound is over the whole table, whose ends are here neither the lowest nor the highest gain.
#[test]
fn the_bound_on_rounding_is_that_of_the_slowest_point() {
    let point = |command, tau_s| CurvePoint { command, tau_s };
    let hill = [point(0.0, 0.1), point(0.5, 1.0 / 2.6), point(1.0, 0.1)];
    let error = design(&hill).unwrap().rounding_error();
    assert!((error - design(&flat(1.0 / 2.6)).unwrap().rounding_error()).abs() < 1.0, "{error}");
}

#[test]
fn every_refusal_names_the_parameter_its_place_and_the_remedy() {
    let point = |command, tau_s| CurvePoint { command, tau_s };
    let with = |omega_f_rad_s, damping, loop_rate_hz| {
        InverseDesign::new(ReferenceModel { omega_f_rad_s, damping }, loop_rate_hz, &flat(0.1)).unwrap_err()
    };
    let points = |points: &[CurvePoint]| design(points).unwrap_err();
    let many: [_; 34] = core::array::from_fn(|i| point(i as f64 / 40.0, 0.1));
    for (error, words) in [
        (with(f64::NAN, 0.7, 5e3), "omega_f_rad_s is not a finite number"),
        (with(0.0, 0.7, 5e3), "omega_f_rad_s is 0, outside its range"),
        (with(94.0, 0.1, 5e3), "damping is 0.1, outside its range"),
        (with(94.0, 0.7, f64::NAN), "loop_rate_hz is not a finite number"),
        (with(94.0, 0.7, 200.0), "omega_f_rad_s is 94.00 rad/s, too close to Nyquist"),
        (points(&[]), "the curve has no points"),
        (points(&many), "the curve has 34 points, more than 33"),
        (points(&[point(0.1, 0.1), point(0.2, f64::NAN)]), "point 1 of the curve: tau_s is not a finite number"),
        (points(&[point(1.1, 0.1)]), "point 0 of the curve: command is 1.1, outside its range 0 to 1"),
        (points(&[point(0.5, 0.1), point(0.5, 0.2)]), "point 1 of the curve: command is 0.5, not above"),
        (points(&flat(0.005)), "tau_s is 0.0050 at command 0.0000: the rotor is faster"),
        (points(&flat(6.0)), "lower the natural frequency below 85.33 rad/s"),
        (
            points(&[point(0.5, 0.1), point(0.53, 0.2)]),
            "tau_s changes from 0.1000 at command 0.5000 to 0.2000 at 0.5312",
        ),
        (points(&flat(1.0)), "lower loop_rate_hz"),
        (with(6.0, 0.7, 5e3), "takes more than 8192 ticks"),
    ] {
        let text = format!("{error}");
        assert!(text.contains(words), "{text:?} does not contain {words:?}");
    }
}

#[test]
fn the_slew_is_rounded_down_to_whole_steps_per_tick() {
    let design = design(&flat(0.1)).unwrap();
    let steps = |slew_per_s| Ok(design.limits(Command::ZERO, Command::ONE, slew_per_s)?.slew().per_tick() >> 13);
    assert_eq!(steps(20.0), Ok(262)); // of 262.14
    assert_eq!(steps(0.0), Ok(65_536));
    assert_eq!(steps(1e6), Ok(65_536));
    let min_per_s = 5000.0 / 65_536.0;
    assert_eq!(steps(min_per_s), Ok(1));
    assert_eq!(steps(0.07), Err(InverseError::Parameter(DesignError::SlewTooSlow { slew_per_s: 0.07, min_per_s })));
    for slew_per_s in [f64::NAN, f64::INFINITY, -1.0] {
        assert!(matches!(steps(slew_per_s), Err(InverseError::Parameter(_))), "{slew_per_s}");
    }
    let crossed = design.limits(Command::ONE, Command::ZERO, 0.0);
    assert_eq!(crossed, Err(InverseError::LimitsCrossed { min: Command::ONE, max: Command::ZERO }));
}
