//! A compensator for an actuator with effects.

use rotorlead_design::redesign::{KindOptions, Redesign, RedesignOptions, redesign};
use rotorlead_design::{Chain, DesignOptions, InverseOptions, bandwidths, design, steps};
use rotorlead_diagnose::{Options, Verdict, diagnose};
use rotorlead_identify::frequency_response::bandwidth::Bandwidth;
use rotorlead_plant::bench::{Plan, run};
use rotorlead_plant::{Catalog, Effect, Lag, Model, Noise, Point};

/// Two of the paper's points.
fn motor(effects: &[(&str, &[(&str, f64)])]) -> Model {
    let point = |nominal, gain, time_constant_s| Point::new(nominal, Lag { gain, time_constant_s, delay_s: 0.0 });
    let effect = |(kind, parameters): &(&str, &[(&str, f64)])| Effect {
        kind: (*kind).to_owned(),
        parameters: parameters.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect(),
        std: [].into(),
    };
    Model {
        time_constant_curve: None,
        format: 1,
        points: vec![point(0.5, 10.1718, 0.107_655_4), point(0.65, 16.1063, 0.070_783_9)],
        static_map: None,
        effects: effects.iter().map(effect).collect(),
        provenance: None,
    }
}

fn options_at(amplitude: f64) -> RedesignOptions {
    RedesignOptions { design: KindOptions::Lead(DesignOptions::default()), amplitude, esc_frame_hz: None }
}

fn redesigned(model: &Model, amplitude: f64) -> Redesign {
    redesign(model, &options_at(amplitude), &|| ()).unwrap()
}

fn at(bandwidth: Bandwidth) -> f64 {
    bandwidth.rad_s().unwrap_or_else(|| panic!("{bandwidth:?}"))
}

#[test]
fn without_effects_it_is_what_design_and_bandwidth_give() {
    let model = motor(&[]);
    let found = redesigned(&model, 0.05);
    let plain = design(&model, &DesignOptions::default()).unwrap();
    assert!(found.full.design.is_bit_identical_to(&plain.into()));
    let small: Vec<_> = found.full.points.iter().map(|point| point.small).collect();
    assert_eq!(small, bandwidths(&model, Chain::Continuous(plain.lead())));
    // And the whole chain, driven by sinusoids, has the bandwidth that the sampled one is computed to have.
    let sampled = bandwidths(&model, Chain::Sampled { design: &plain.into(), esc_frame_hz: None });
    for (point, sampled) in found.full.points.iter().zip(sampled) {
        let ratio = at(point.chain.magnitude) / at(sampled.compensated);
        assert!((ratio - 1.0).abs() < 3e-3, "{}: {ratio}", sampled.nominal);
        assert!(point.limits.is_empty());
    }
    assert!(!found.is_refused() && found.weaker.is_none() && found.remarks.is_empty());
}

#[test]
fn a_delay_lowers_the_frequency_of_ninety_degrees_by_what_it_costs_and_is_said() {
    let plain = redesigned(&motor(&[]), 0.05);
    let delayed = redesigned(&motor(&[("transport_delay", &[("delay_s", 0.01)])]), 0.05);
    let (before, after) = (plain.full.points[1].chain, delayed.full.points[1].chain);
    assert!((at(after.magnitude) / at(before.magnitude) - 1.0).abs() < 3e-3, "{after:?}");
    // The zero stands on this pole: poles alone are left, w_f^2 / (s^2 + 2 zeta w_f s + w_f^2), late by half a tick's hold.
    let lead = delayed.full.design.as_lead().unwrap().lead();
    let late = |omega: f64, delay_s: f64| {
        let x = omega / lead.omega_f_rad_s;
        (2.0 * lead.damping * x).atan2(1.0 - x * x) + omega * (delay_s + 1e-4)
    };
    for (found, delay_s) in [(before, 0.0), (after, 0.01)] {
        assert!((late(at(found.phase), delay_s) - std::f64::consts::FRAC_PI_2).abs() < 0.01, "{found:?}");
    }
    assert!(at(after.phase) < 0.75 * at(before.phase), "{after:?}");
    assert!(delayed.remarks.iter().any(|remark| remark.contains("10.00 ms")), "{:?}", delayed.remarks);
    assert!(!delayed.is_refused());
}

#[test]
fn a_limit_of_rate_or_level_that_the_lead_would_pass_refuses_it_and_the_bounds_that_are_said_hold() {
    for (kind, parameter, value) in [("slew_limit", "rate_per_s", 0.8), ("saturation", "max", 0.75)] {
        let model = motor(&[(kind, &[(parameter, value)])]);
        let found = redesigned(&model, 0.05);
        assert!(found.is_refused(), "{kind}");
        let point = &found.full.points[1];
        let limit = point.passed().unwrap();
        assert_eq!(limit.kind.id, kind);
        let from = limit.passed_from_rad_s.unwrap();
        let asked = 0.05
            * found.full.design.lead_at(0.5).unwrap().response(from).norm()
            * if kind == "slew_limit" { from } else { 1.0 };
        assert!((asked / limit.most - 1.0).abs() < 0.03, "{kind}: {asked} of {}", limit.most);
        // What is promised is reached by amplitudes up to the one that is said, and not by the one that was asked for.
        let promised = at(point.small.compensated);
        let small = redesigned(&model, 0.97 * limit.largest_amplitude);
        assert!((at(small.full.points[1].chain.magnitude) / promised - 1.0).abs() < 0.01, "{kind}: {:?}", small.full);
        assert!(!small.is_refused() || small.full.points[1].passed().is_none(), "{kind}");
        assert!(at(point.chain.magnitude) < 0.8 * promised, "{kind}: {:?}", point.chain);
        assert!(at(point.chain.magnitude) < 1.02 * limit.reachable_rad_s, "{kind}: {point:?}");
        if let Some(weaker) = &found.weaker {
            assert!(weaker.is_within_bounds());
            for point in &weaker.points {
                let ratio = at(point.chain.magnitude) / at(point.small.compensated);
                assert!((ratio - 1.0).abs() < 0.02, "{kind}: {point:?}");
            }
        }
    }
}

/// What refuses a lead is what an inverse reckons with.
#[test]
fn the_limits_of_the_actuator_are_those_of_an_inverse() {
    for (kind, parameter, value) in [("slew_limit", "rate_per_s", 5.0), ("saturation", "max", 0.75)] {
        let model = motor(&[(kind, &[(parameter, value)])]);
        let options = InverseOptions::default();
        let options = RedesignOptions { design: KindOptions::Inverse(options), ..options_at(0.005) };
        let found = redesign(&model, &options, &|| ()).unwrap();
        assert!(!found.is_refused() && found.weaker.is_none());
        let range = found.full.design.as_inverse().unwrap().range();
        match kind {
            "slew_limit" => assert_eq!((range.slew_per_s, range.max), (Some(value), 1.0)),
            _ => assert_eq!((range.slew_per_s, range.max), (None, value)),
        }
        for point in &found.full.points {
            let (promised, reached) = (at(point.small.compensated), at(point.chain.magnitude));
            assert!(
                (promised / 94.2 - 1.0).abs() < 0.02 && (reached / promised - 1.0).abs() < 0.03,
                "{kind}: {point:?}"
            );
        }
        // A large step, which a lead that is clipped would answer with its lag. Thrust overshoots by more than the speed, since its
        // gain rises with it: 12 % over the step up to 0.6.
        let stepped = steps(&model, &found.full.design, None, &[0.1]).unwrap();
        for point in stepped.iter().filter(|point| (0.45..0.7).contains(&(point.nominal + point.step))) {
            let (without, with) = (point.uncompensated, point.compensated);
            assert!(
                with.overshoot < 0.05 * 1.25 && with.rise_s.unwrap() < 0.6 * without.rise_s.unwrap(),
                "{kind}: {point:?}"
            );
        }
    }
}

#[test]
fn what_stays_on_the_ground_is_not_compensated_and_is_said() {
    let on_stand = motor(&[
        ("stand_resonance", &[("participation", 0.3), ("frequency_hz", 8.0), ("damping", 0.03)]),
        ("gain_drift", &[("drift", -0.05), ("time_s", 20.0)]),
        ("moving_average", &[("window_s", 0.05)]),
    ]);
    let (found, plain) = (redesigned(&on_stand, 0.05), redesigned(&motor(&[]), 0.05));
    assert_eq!(found.full.points, plain.full.points);
    for word in ["stand's", "drifts by -5.0 %", "moving average"] {
        assert!(found.remarks.iter().any(|remark| remark.contains(word)), "{:?}", found.remarks);
    }
}

#[test]
fn a_slew_limit_that_was_hidden_is_found_and_its_actuator_is_not_sped_up() {
    let hidden = motor(&[("slew_limit", &[("rate_per_s", 0.6)])]);
    let mut plan = Plan::paper(&hidden);
    (plan.loop_rate_hz, plan.sample_rate_hz, plan.esc_frame_hz) = (200, 200, None);
    plan.noise = Noise { sigma_n: 0.01, ..Noise::default() };
    plan.records.iter_mut().for_each(|record| {
        record.periods = Some(3);
        record.role = None;
    });
    let experiment = run(&plan, &hidden, None, &|_| {}).unwrap();
    let catalog = Catalog::standard();
    let found = diagnose(&experiment, &Options { model: None, catalog: &catalog, progress: &|| {} }).unwrap();
    assert_eq!(found.verdict, Verdict::Named);
    assert_eq!(found.effects[0].kind.id, "slew_limit");
    let refused = redesigned(&found.model, 0.05);
    assert!(refused.is_refused());
    assert!(refused.full.points.iter().all(|point| at(point.chain.magnitude) < 20.0), "{:?}", refused.full.points);
}
