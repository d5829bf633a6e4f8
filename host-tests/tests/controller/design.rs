//! The paper's design equations, and what is refused.

use host_tests::{OMEGA_G_RAD_S, TABLE_1, any_parameters, cases, paper_design};
use proptest::prelude::*;
use rotorlead::design::{DesignError, FASTEST_POLE_RAD, LeadDesign, LeadParameters};

const LEAD: LeadParameters = LeadParameters { omega_z_rad_s: 14.0, omega_f_rad_s: 94.0, damping: 0.7 };

fn refused(lead: LeadParameters, loop_rate_hz: f64, prewarp_rad_s: Option<f64>) -> DesignError {
    LeadDesign::new(lead, loop_rate_hz, prewarp_rad_s).expect_err("the design is to be refused")
}

/// Equations (2) to (9) with the paper's numbers. Its (9) prints 16.6811 dB where (5) gives 16.4811.
#[test]
fn the_papers_numbers_come_out() {
    let lead = LeadParameters::from_poles(&TABLE_1.map(|(_, _, pole)| pole), OMEGA_G_RAD_S).unwrap();
    assert_eq!(lead.omega_z_rad_s, 14.1275);
    assert!((lead.omega_f_rad_s - 94.21555).abs() < 5e-6);
    assert!((lead.damping - 0.5_f64.sqrt()).abs() < 1e-15);
    assert!((lead.slowest_helped_rad_s() - 10.0015).abs() < 5e-5);
    assert!((lead.omega_g_rad_s() - OMEGA_G_RAD_S).abs() < 1e-9);
    assert!((lead.asymptotic_peak_db() - 16.4811).abs() < 5e-5);
    let peak = (1..100_000).map(|i| lead.response(f64::from(i) * 0.01).norm()).fold(0.0, f64::max);
    assert!((20.0 * peak.log10() - 13.57).abs() < 0.005, "true peak {}", 20.0 * peak.log10());
    // Equation (10) prints 66.62 s in the denominator; (3) with (4) needs 133.24.
    assert!((2.0 * lead.damping * lead.omega_f_rad_s - 133.24).abs() < 0.005);
}

#[test]
fn the_papers_compensator_fits_its_headroom_with_the_known_gains() {
    let check = *paper_design().check();
    assert!((check.l1_gain - 6.08).abs() < 0.005, "{check:?}");
    assert!((check.step_peak - 3.43).abs() < 0.005, "{check:?}");
    assert!(check.worst_deviation_db < 1e-5, "{check:?}");
    // A pair of poles at omega_f: radius exp(-zeta omega_f T), to the warp of Tustin's substitution.
    assert!((check.pole_radii[0] - (-0.5_f64.sqrt() * 94.21555 / 5000.0).exp()).abs() < 1e-6, "{check:?}");
}

#[test]
fn what_is_not_finite_is_named() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let zero = LeadParameters { omega_z_rad_s: bad, ..LEAD };
        let pole = LeadParameters { omega_f_rad_s: bad, ..LEAD };
        let damping = LeadParameters { damping: bad, ..LEAD };
        assert_eq!(refused(zero, 5000.0, None), DesignError::NotFinite { parameter: "omega_z_rad_s" });
        assert_eq!(refused(pole, 5000.0, None), DesignError::NotFinite { parameter: "omega_f_rad_s" });
        assert_eq!(refused(damping, 5000.0, None), DesignError::NotFinite { parameter: "damping" });
        assert_eq!(refused(LEAD, bad, None), DesignError::NotFinite { parameter: "loop_rate_hz" });
        assert_eq!(refused(LEAD, 5000.0, Some(bad)), DesignError::NotFinite { parameter: "prewarp_rad_s" });
        assert!(LeadParameters::from_poles(&[1.0, bad], 600.0).is_err());
        assert!(LeadParameters::from_poles(&[1.0], bad).is_err());
    }
}

#[test]
fn what_is_out_of_range_is_named_with_its_limit() {
    let says = |error: DesignError, words: &[&str]| {
        let text = error.to_string();
        assert!(words.iter().all(|word| text.contains(word)), "{text}");
    };
    says(
        refused(LeadParameters { omega_z_rad_s: 94.0, ..LEAD }, 5000.0, None),
        &["omega_z_rad_s is 94", "omega_f_rad_s, 94"],
    );
    says(
        refused(LeadParameters { omega_z_rad_s: -1.0, ..LEAD }, 5000.0, None),
        &["omega_z_rad_s is -1", "0.001 to 1000000"],
    );
    says(refused(LEAD, 5000.0, Some(0.0)), &["prewarp_rad_s is 0", "0.001 to 1000000"]);
    says(refused(LeadParameters { damping: 0.29, ..LEAD }, 5000.0, None), &["damping is 0.29", "0.3 to 2"]);
    says(refused(LeadParameters { damping: 2.1, ..LEAD }, 5000.0, None), &["damping is 2.1", "0.3 to 2"]);
    says(refused(LEAD, 200.0, None), &["omega_f_rad_s is 94", "Nyquist", "80 rad/s"]);
    says(refused(LEAD, 5000.0, Some(2001.0)), &["prewarp_rad_s is 2001", "Nyquist", "2000 rad/s"]);
    says(refused(LEAD, 0.0, None), &["loop_rate_hz is 0", "50 to 100000"]);
    // c = (omega_f T)^2 is under 2^-20.
    says(refused(LEAD, 100_000.0, None), &["coefficient c", "loop_rate_hz"]);
    // k = -4 zeta q / (1 + 2 zeta q + q^2) is over a half.
    says(refused(LeadParameters { damping: 2.0, ..LEAD }, 300.0, None), &["coefficient k", "under 0.5"]);
    says(refused(LeadParameters { omega_z_rad_s: 9.0, ..LEAD }, 5000.0, None), &["L1 gain", "lower omega_g"]);
    assert_eq!(LeadParameters::from_poles(&[], 600.0), Err(DesignError::NoPoles));
    assert!(matches!(
        LeadParameters::from_poles(&[0.0], 600.0),
        Err(DesignError::OutOfRange { parameter: "pole_rad_s", .. })
    ));
    assert!(matches!(LeadParameters::from_poles(&[14.0], 13.0), Err(DesignError::ZeroNotBelowPoles { .. })));
}

#[test]
fn a_design_is_the_same_bits_every_time_and_known_ones_stay_as_they_are() {
    // The controller computes these at start-up; another value on any machine is a filter that was not tested.
    let design = paper_design();
    let coefficients = design.coefficients();
    assert_eq!(
        [coefficients.k(), coefficients.c(), coefficients.g0(), coefficients.g1()],
        [-112_938_246, 1_504_799, 265_160_458, 265_912_857]
    );
    assert_eq!(paper_design(), design);
}

proptest! {
    #![proptest_config(cases(512))]

    /// With prewarping, the discrete response is the continuous one at that frequency, up to the rounding of the
    /// coefficients.
    #[test]
    fn a_prewarped_design_agrees_with_the_continuous_one_at_its_frequency(
        rate in 2000.0..20_000.0_f64, pole in 0.01..0.3_f64, part in 0.1..1.0_f64, damping in 0.5..1.0_f64,
    ) {
        let lead = LeadParameters { omega_z_rad_s: pole * rate / 4.0, omega_f_rad_s: pole * rate, damping };
        let prewarp = part * lead.omega_f_rad_s;
        if let Ok(design) = LeadDesign::new(lead, rate, Some(prewarp)) {
            let deviation = (design.response(prewarp) / lead.response(prewarp) - 1.0).norm();
            prop_assert!(20.0 * (1.0 + deviation).log10() <= design.check().worst_deviation_db + 1e-9);
        }
    }

    /// No parameters, however odd, make the design panic or loop. One of them at a time is odd, so that what is behind
    /// the check of the others is reached.
    #[test]
    fn any_numbers_are_accepted_or_refused(odd in any::<f64>(), near in 0.0..3.0_f64, place in 0..5_usize, lead in any_parameters()) {
        let (lead, rate, prewarp) = lead;
        for value in [odd, 0.0, f64::MIN_POSITIVE, f64::MAX, near, near * 1e3] {
            let mut numbers = [lead.omega_z_rad_s, lead.omega_f_rad_s, lead.damping, rate, prewarp.unwrap_or(1.0)];
            numbers[place] = value;
            let [omega_z_rad_s, omega_f_rad_s, damping, rate, prewarp] = numbers;
            let lead = LeadParameters { omega_z_rad_s, omega_f_rad_s, damping };
            match LeadDesign::new(lead, rate, Some(prewarp)) {
                // The sum ends at 1e-9 of itself.
                Ok(design) => prop_assert!(design.check().l1_gain > 1.0 - 1e-8 && design.check().pole_radii[0] < 1.0),
                Err(error) => prop_assert!(error.to_string().len() < 200, "{error}"),
            }
        }
    }
}

/// Up to the limits of pole and damping, neither the steady output nor the response stands in the way: the guards
/// against that are never met.
#[test]
fn no_design_within_the_limits_needs_more_damping_or_rounds_too_far() {
    let mut accepted = 0;
    for i in 0..=60 {
        // From the slowest poles that the smallest coefficient allows to the fastest ones.
        let pole = 0.0009 * (FASTEST_POLE_RAD / 0.0009).powf(f64::from(i) / 60.0);
        for (damping, ratio) in
            [0.3, 0.5, 0.7, 1.0, 2.0].into_iter().flat_map(|d| [1.001, 2.0, 6.0, 15.0].map(|r| (d, r)))
        {
            for prewarp in [None, Some(FASTEST_POLE_RAD * 5000.0)] {
                let omega_f_rad_s = pole * 5000.0;
                let lead = LeadParameters { omega_z_rad_s: omega_f_rad_s / ratio, omega_f_rad_s, damping };
                match LeadDesign::new(lead, 5000.0, prewarp) {
                    Ok(_) => accepted += 1,
                    Err(error) => assert!(
                        matches!(error, DesignError::CoefficientOutOfRange { .. } | DesignError::L1GainTooHigh { .. }),
                        "{lead:?} {prewarp:?}: {error}"
                    ),
                }
            }
        }
    }
    assert!(accepted > 1000, "{accepted}");
}
