//! What holds for every kind.

use std::collections::HashSet;

use num_complex::Complex64;
use proptest::prelude::*;
use rotorlead_records::files::KeyPath;

use super::*;
use crate::testing::{active, actuator, model, point, seen_response, step};
use crate::{
    Actuator, CommandSignal, Effect, EscTiming, Law, OperatingPoint, Start, simulate, simulate_periodic_response,
    simulate_response,
};

/// Values between the ends of the plausible ranges, by shares 0..1.
fn between(kind: &'static Kind, shares: &[f64]) -> Option<ActiveEffect> {
    let value = |(parameter, share): (&Parameter, &f64)| {
        let (low, high) = parameter.plausible;
        match parameter.scale {
            Scale::Linear => low + share * (high - low),
            Scale::Log => low * (high / low).powf(*share),
        }
    };
    ActiveEffect::new(kind, kind.parameters.iter().zip(shares).map(value).collect()).ok()
}

/// Fitted parameters at their starts, the others at their defaults.
fn typical(kind: &'static Kind) -> ActiveEffect {
    let mut values = kind.null();
    for (index, parameter) in kind.fitted() {
        values[index] = parameter.starts[parameter.starts.len() / 2];
    }
    if kind.id == "parameter_error" {
        values = vec![0.1, -0.2];
    }
    ActiveEffect::new(kind, values).unwrap()
}

/// A kind's typical effect with its shape at a value; `None` where it has none.
fn shaped(kind: &'static Kind, value: impl Fn(&Parameter) -> f64) -> Option<ActiveEffect> {
    let (place, parameter) = kind.shape()?;
    let mut values = typical(kind).values().to_vec();
    values[place] = value(parameter);
    Some(ActiveEffect::new(kind, values).unwrap())
}

/// The typical effects of all kinds, and those that are bent.
fn typical_and_bent() -> impl Iterator<Item = ActiveEffect> {
    let bent = |kind| shaped(kind, |shape| shape.starts[0]);
    Catalog::standard()
        .kinds()
        .map(typical)
        .chain(Catalog::standard().kinds().filter_map(bent))
        .collect::<Vec<_>>()
        .into_iter()
}

/// Null values; where another parameter makes the effect vanish, the first start.
fn without(kind: &'static Kind) -> ActiveEffect {
    let null = kind.null();
    let values = null.iter().zip(kind.parameters).map(|(v, p)| if v.is_nan() { p.starts[0] } else { *v });
    ActiveEffect::new(kind, values.collect()).unwrap()
}

/// A restless command for 2 s and the response at its rows.
fn response_to_noise(effects: &[ActiveEffect], seed: u64) -> Vec<f64> {
    let mut state = seed.wrapping_mul(2).wrapping_add(1);
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut time_s = 0.0;
    let rows: Vec<f64> = (0..400)
        .map(|_| {
            time_s += 0.01 * next();
            time_s
        })
        .collect();
    let command: Vec<f64> = rows.iter().map(|_| next()).collect();
    let drive = CommandSignal { time_s: &rows, command: &command };
    simulate(&mut actuator(effects), drive, Start::Rest(0.5), &rows).unwrap().response
}

#[test]
fn what_is_not_a_number_passes_through_every_kind() {
    let command: Vec<f64> = (0..200_u32).map(|row| 0.5 + 0.1 * (f64::from(row) * 0.3).sin()).collect();
    let time_s: Vec<f64> = (0..200_u32).map(|row| f64::from(row) * 0.01).collect();
    let broken = OperatingPoint { response: f64::NAN, ..point() };
    for kind in Catalog::standard().kinds() {
        let mut actuator = Actuator::with_effects(broken, &[typical(kind)], EscTiming::default()).unwrap();
        let drive = CommandSignal { time_s: &time_s, command: &command };
        let passed = simulate_response(&mut actuator, drive, Start::Rest(0.5), &time_s);
        assert!(passed.is_ok_and(|response| response.iter().all(|y| y.is_nan())), "{kind:?}");
    }
}

#[test]
fn the_response_alone_is_that_of_the_whole_trace() {
    // Held for 80 ms at first, then another one each 10 ms; rows between the commands and at them.
    let told_s: Vec<f64> = (0..400_u32).map(|tick| f64::from(tick) * 0.01).collect();
    let level = |tick: usize| 0.5 + 0.15 * ((tick / if tick < 200 { 8 } else { 1 }) as f64 * 2.4).sin();
    let command: Vec<f64> = (0..told_s.len()).map(level).collect();
    let drive = CommandSignal { time_s: &told_s, command: &command };
    let catalog = Catalog::standard();
    let several = |ids: &[&str]| ids.iter().map(|id| typical(catalog.find(id).unwrap())).collect::<Vec<_>>();
    let mut chains: Vec<Vec<ActiveEffect>> = typical_and_bent().map(|effect| vec![effect]).collect();
    chains.push(Vec::new());
    chains.push(several(&["slew_limit", "transport_delay", "second_pole"]));
    chains.push(several(&["dead_band", "transport_delay", "asymmetric_lag", "inflow_lead"]));
    chains.push(several(&["esc_frame_hold", "supply_sag", "operating_point_lag", "stand_resonance", "clock_skew"]));
    for late_s in [0.0, 0.0003, -0.004] {
        let rows: Vec<f64> = (0..4100_u32).map(|row| f64::from(row) * 1e-3 - late_s).collect();
        for effects in &chains {
            let kinds: Vec<&str> = effects.iter().map(|effect| effect.kind().id).collect();
            let trace = simulate(&mut actuator(effects), drive, Start::Rest(0.5), &rows).unwrap();
            let alone = simulate_response(&mut actuator(effects), drive, Start::Rest(0.5), &rows).unwrap();
            assert_eq!(alone.len(), rows.len(), "{kinds:?}");
            let worst = trace.response.iter().zip(&alone).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            // The response swings by 3; what moves its pace within a step costs most.
            assert!(worst < 1e-5, "{kinds:?}, late by {late_s} s: {worst}");
        }
    }
}

#[test]
fn what_repeats_is_the_same_whether_run_again_or_not() {
    // Four periods of 8 s at 100 rows a second, after rest and after more of the same.
    let period = 800;
    let rows: Vec<f64> = (0..4 * period).map(|row| row as f64 * 0.01).collect();
    let level = |row: usize| 0.5 + 0.08 * ((row % period / 20) as f64 * 2.4).sin();
    let command: Vec<f64> = (0..rows.len()).map(level).collect();
    let drive = CommandSignal { time_s: &rows, command: &command };
    let alone = std::iter::once(Vec::new());
    for effects in alone.chain(typical_and_bent().map(|effect| vec![effect])) {
        for start in [Start::Rest(0.5), Start::PartOfPeriod { period_s: 8.0, lead_s: 1.0 }] {
            for late_s in [0.0, 0.003, -0.004] {
                let stamps: Vec<f64> = rows.iter().map(|time_s| time_s - late_s).collect();
                let run = simulate_response(&mut actuator(&effects), drive, start, &stamps).unwrap();
                let once = simulate_periodic_response(&mut actuator(&effects), drive, start, &stamps, period).unwrap();
                let worst = run.iter().zip(&once).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert_eq!(once.len(), run.len());
                assert!(
                    worst < 3e-6,
                    "{:?}, {start:?}, {late_s} s late: {worst}",
                    effects.first().map(ActiveEffect::kind)
                );
            }
        }
    }
}

/// Where the rotor has all but settled its steps are longer, and a step of the command finds it as it would have been.
#[test]
fn levels_that_are_held_for_long_are_left_as_exactly_as_short_ones() {
    let told_s = [0.0, 3.0, 6.5, 9.0];
    let command = [0.5, 0.75, 0.4, 0.6];
    let drive = CommandSignal { time_s: &told_s, command: &command };
    let rows: Vec<f64> = (0..1200_u32).map(|row| f64::from(row) * 0.01).collect();
    let apart = |effect: ActiveEffect| {
        let effects = [effect];
        let trace = simulate(&mut actuator(&effects), drive, Start::Rest(0.5), &rows).unwrap();
        let alone = simulate_response(&mut actuator(&effects), drive, Start::Rest(0.5), &rows).unwrap();
        trace.response.iter().zip(&alone).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    for effect in typical_and_bent() {
        let worst = apart(effect.clone());
        assert!(worst < 1e-5, "{effect:?}: {worst}");
    }
    // A supply five times as fast as the rotor: steps of half its time constant, and of two and a half where all is settled.
    let sag = Catalog::standard().find("supply_sag").unwrap();
    let index = sag.parameters.iter().position(|parameter| parameter.name == "polarization_s").unwrap();
    let mut values = typical(sag).values().to_vec();
    values[index] = 0.02;
    let worst = apart(ActiveEffect::new(sag, values).unwrap());
    assert!(worst < 1e-4, "fast supply: {worst}");
}

#[test]
fn what_runs_before_a_record_is_forgotten_after_some_time_constants() {
    // 2 s of noise on end; the time constant is 0.1 s.
    let told_s: Vec<f64> = (0..400_u32).map(|tick| f64::from(tick) * 0.01).collect();
    let command: Vec<f64> = (0..400_u32).map(|tick| 0.5 + 0.1 * (f64::from(tick % 200) * 1.7).sin()).collect();
    let drive = CommandSignal { time_s: &told_s, command: &command };
    let run = |start: Start| simulate_response(&mut actuator(&[]), drive, start, &told_s).unwrap();
    let for_long = run(Start::WholePeriods { period_s: 2.0, periods: 3 });
    let apart = |other: &[f64]| for_long.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let (short, whole) = (1.0, 2.0);
    // It began up to 1 from where it would have been, and forgets by e^-10 and e^-20.
    assert!(apart(&run(Start::PartOfPeriod { period_s: 2.0, lead_s: short })) < (-10.0_f64).exp());
    assert!(apart(&run(Start::PartOfPeriod { period_s: 2.0, lead_s: whole })) < (-20.0_f64).exp());
    assert!(apart(&run(Start::Rest(0.5))) > 0.01);
    let too_short =
        simulate_response(&mut actuator(&[]), drive, Start::PartOfPeriod { period_s: 0.0, lead_s: 1.0 }, &told_s);
    assert!(too_short.is_err());
}

#[test]
fn the_catalog_has_the_kinds_in_the_order_of_the_chain_and_every_kind_says_all() {
    let catalog = Catalog::standard();
    assert!(catalog.kinds().zip(catalog.kinds().skip(1)).all(|(a, b)| a.site <= b.site));
    let ids: HashSet<_> = catalog.kinds().map(|kind| kind.id).collect();
    assert_eq!(ids.len(), STANDARD.len());
    for kind in catalog.kinds() {
        for text in [kind.title, kind.equation, kind.signature] {
            assert!(!text.is_empty(), "{kind:?}");
        }
        assert!(!kind.sources.is_empty() && !kind.confusions.is_empty(), "{kind:?}");
        // A clause, that goes on after a colon.
        assert!(kind.remedy.starts_with(char::is_lowercase) && !kind.remedy.ends_with('.'), "{kind:?}");
        for confusion in kind.confusions {
            assert!(ids.contains(confusion.with) && confusion.with != kind.id, "{kind:?}: {}", confusion.with);
            assert!(!confusion.experiment.is_empty());
        }
        assert!(kind.fitted().count() > 0);
        for parameter in kind.parameters {
            let ((least, most), (low, high)) = (parameter.possible, parameter.plausible);
            let name = format!("{kind:?}: {}", parameter.name);
            assert!(least <= low && low < high && high <= most, "{name}");
            assert!(parameter.starts.iter().all(|start| (low..=high).contains(start)), "{name}");
            assert!(!parameter.starts.is_empty() && !parameter.meaning.is_empty(), "{name}");
            assert!(parameter.scale == Scale::Linear || low > 0.0, "{name}");
            if let Use::Shape { neutral, .. } = parameter.usage {
                assert!((low..=high).contains(&neutral) && !parameter.starts.contains(&neutral), "{name}");
            }
        }
        let shapes = kind.parameters.iter().filter(|parameter| matches!(parameter.usage, Use::Shape { .. })).count();
        assert!(shapes == usize::from(kind.shape().is_some()), "{kind:?} has {shapes} shapes");
    }
}

/// Digits of a number, but for zeros in front, and those at the end of one without decimals.
fn significant(number: &str) -> usize {
    let number = if number.contains('.') { number } else { number.trim_end_matches('0') };
    number.trim_start_matches(['0', '.']).bytes().filter(u8::is_ascii_digit).count()
}

#[test]
fn a_shape_says_how_it_bends_the_law_in_numbers_of_few_digits() {
    for kind in Catalog::standard().kinds() {
        let Some((_, shape)) = kind.shape() else { continue };
        let Use::Shape { says, .. } = shape.usage else { unreachable!("it is a shape") };
        let (low, high) = shape.plausible;
        let said: Vec<String> = (0..=7).map(|k| says(low + (high - low) * f64::from(k) / 7.0)).collect();
        for words in &said {
            assert!(words.starts_with(|first: char| !first.is_uppercase()) && !words.ends_with('.'), "{words}");
            let numbers = words.split(' ').map(|word| word.trim_end_matches(','));
            let numbers: Vec<&str> = numbers.filter(|word| word.parse::<f64>().is_ok()).collect();
            assert!(!numbers.is_empty() && numbers.iter().all(|number| significant(number) <= 3), "{words}");
            assert!(numbers.iter().all(|number| !number.contains(['N', 'i'])), "{words}");
        }
        let different: HashSet<&String> = said.iter().collect();
        assert_eq!(different.len(), said.len(), "{kind:?}: {said:?}");
    }
    let says = |id: &str, value: f64| match Catalog::standard().find(id).unwrap().shape().unwrap().1.usage {
        Use::Shape { says, .. } => says(value),
        other => unreachable!("{other:?}"),
    };
    assert_eq!(says("slew_limit", 0.7512), "it slews downward at 0.75 times the rate upward");
    assert_eq!(says("saturation", 0.010_04), "its knee reaches 0.010 duty to either side of `max`");
    assert_eq!(says("second_pole", 0.4), "a third pole has 0.40 of the time constant of the second");
    assert_eq!(says("dead_band", -2.0), "its width shrinks by 20 % with each 0.1 duty of command");
    // The map's slope is K (1 + 3 c d^2 + ..) at d, tau has the factor 1 - linear d / nominal, the current goes as s^(3 - part) at 0.5.
    assert_eq!(
        says("quadratic_thrust", 10.0),
        "0.05 duty to either side it is steeper than a parabola, by 7.5 % of its slope"
    );
    assert_eq!(says("operating_point_lag", -0.7), "beside its power, 10 % more speed adds 7.0 % of the time constant");
    assert_eq!(says("supply_sag", 0.7), "at a speed of 0.5 its current grows with the power 2.3 of the speed, not 3");
}

#[test]
fn the_plausible_ranges_hold_the_typical_numbers() {
    for (id, parameter, from, to) in [
        ("parameter_error", "gain_error", -0.25, 0.25),
        ("parameter_error", "time_constant_error", -0.4, 0.6),
        ("transport_delay", "delay_s", 3e-5, 0.025),
        ("esc_frame_hold", "frame_hz", 40.0, 600.0),
        ("dead_band", "width", 0.002, 0.01),
        ("backlash", "half_width", 0.003, 0.02),
        ("command_quantization", "step", 1.0 / 2048.0, 1.0 / 64.0),
        ("saturation", "max", 0.6, 1.0),
        ("slew_limit", "rate_per_s", 0.25, 160.0),
        ("asymmetric_lag", "ratio", 1.3, 2.0),
        ("operating_point_lag", "exponent", 0.5, 1.5),
        ("quadratic_thrust", "curvature_per_duty", 1.0, 6.0),
        ("second_pole", "time_constant_s", 1e-4, 0.03),
        ("moving_average", "window_s", 3e-3, 0.2),
        ("inflow_lead", "time_constant_s", 0.003, 0.015),
        ("inflow_lead", "lead_ratio", 1.3, 2.5),
        ("supply_sag", "polarization_drop", 0.05, 0.15),
        ("supply_sag", "polarization_s", 0.3, 3.0),
        ("winding_heating", "heat_drop", 0.003, 0.03),
        ("winding_heating", "heat_s", 2.0, 20.0),
        ("gain_drift", "drift", -0.15, 0.15),
        ("gain_drift", "time_s", 10.0, 60.0),
        ("stand_resonance", "frequency_hz", 12.0, 85.0),
        ("stand_resonance", "damping", 0.02, 0.1),
        ("clock_skew", "skew_ppm", -2000.0, 2000.0),
    ] {
        let kind = Catalog::standard().find(id).unwrap();
        let (low, high) = kind.parameters.iter().find(|p| p.name == parameter).unwrap().plausible;
        assert!(low <= from && to <= high, "{id}, {parameter}");
    }
}

#[test]
fn null_values_change_no_digit_and_others_do() {
    let plain = response_to_noise(&[], 5);
    for kind in Catalog::standard().kinds() {
        assert_eq!(plain, response_to_noise(&[without(kind)], 5), "{kind:?}");
        assert_ne!(plain, response_to_noise(&[typical(kind)], 5), "{kind:?}");
        for omega in [0.1, 10.0, 300.0] {
            assert_eq!(without(kind).response(&point(), omega), Complex64::ONE, "{kind:?}");
        }
    }
}

#[test]
fn a_neutral_shape_changes_no_digit_and_others_do() {
    let bits = |effect: &ActiveEffect| {
        let response = [3, 4].map(|seed| response_to_noise(std::slice::from_ref(effect), seed)).concat();
        let frequencies = [0.1, 10.0, 300.0].map(|omega| effect.response(&point(), omega));
        let all = response.into_iter().chain(frequencies.into_iter().flat_map(|at| [at.re, at.im]));
        all.map(f64::to_bits).collect::<Vec<_>>()
    };
    let mut bent = Vec::new();
    for kind in Catalog::standard().kinds().filter(|kind| kind.shape().is_some()) {
        // As a model file gives it, and as one that says nothing of it.
        let mut written = typical(kind).to_effect(&[]);
        let (name, neutral) = kind.shape().map(|(_, shape)| (shape.name, shape.default().unwrap())).unwrap();
        assert!(!written.parameters.contains_key(name), "{kind:?}");
        let resolved = |effect: &Effect| Catalog::standard().resolve(effect, &KeyPath::root()).unwrap();
        let without = resolved(&written);
        written.parameters.insert(name.to_owned(), neutral);
        assert_eq!(bits(&resolved(&written)), bits(&without), "{kind:?}");
        for &start in kind.shape().unwrap().1.starts {
            let effect = shaped(kind, |_| start).unwrap();
            assert_ne!(bits(&effect), bits(&without), "{kind:?}: {start}");
            assert_eq!(resolved(&effect.to_effect(&[])), effect);
        }
        bent.push(kind.id);
    }
    let of_families = [
        "saturation",
        "dead_band",
        "backlash",
        "slew_limit",
        "supply_sag",
        "quadratic_thrust",
        "asymmetric_lag",
        "operating_point_lag",
        "moving_average",
        "second_pole",
    ];
    assert_eq!(bent, of_families);
}

#[test]
fn next_to_the_neutral_shape_the_law_is_next_to_the_catalogs() {
    for kind in Catalog::standard().kinds() {
        let Some(catalogs) = shaped(kind, |shape| shape.default().unwrap()) else { continue };
        let apart = |part: f64| {
            let near = |shape: &Parameter| {
                let neutral = shape.default().unwrap();
                neutral + part * (shape.starts[0] - neutral)
            };
            let effects = [catalogs.clone(), shaped(kind, near).unwrap()];
            let [one, other] = effects.map(|effect| response_to_noise(&[effect], 7));
            one.iter().zip(&other).fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()))
        };
        let (far, near) = (apart(1.0), apart(1e-5));
        assert!(far > 1e-4 && near < 1e-3 * far, "{kind:?}: {far} {near}");
    }
}

#[test]
fn next_to_the_null_value_there_is_next_to_no_effect() {
    let plain = response_to_noise(&[], 7);
    // Of a response that goes from -5 to 5.
    let away = |effect: ActiveEffect| {
        let response = response_to_noise(std::slice::from_ref(&effect), 7);
        response.iter().zip(&plain).fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()))
    };
    for kind in Catalog::standard().kinds() {
        // Toward the null value by factors of ten the effect falls, to nearly nothing in the end.
        let near = |part: f64| {
            let (typical, null) = (typical(kind), kind.null());
            let values = typical.values().iter().zip(&null).zip(kind.parameters).map(|((t, n), p)| match p.usage {
                Use::Optional(_) | Use::Shape { .. } => *n,
                Use::Fitted if n.is_nan() => *t,
                Use::Fitted if n.is_infinite() => (t / (part * part)).min(p.possible.1),
                Use::Fitted => n + part * (t - n),
            });
            away(ActiveEffect::new(kind, values.collect()).unwrap())
        };
        let (far, nearer, nearest) = (near(0.1), near(0.01), near(1e-5));
        assert!(nearer <= far && nearest <= nearer, "{kind:?}: {far} {nearer} {nearest}");
        assert!(nearest < 2e-3, "{kind:?}: {nearest}");
    }
}

#[test]
fn linear_effects_have_the_frequency_response_of_their_simulation() {
    for (kind, values) in [
        (&parameter_error::KIND, vec![0.2, -0.3]),
        (&transport_delay::KIND, vec![0.004_37]),
        (&second_pole::KIND, vec![0.007]),
        (&second_pole::KIND, vec![0.007, 0.4]),
        (&moving_average::KIND, vec![0.013]),
        (&moving_average::KIND, vec![0.013, 0.6]),
        (&inflow_lead::KIND, vec![2.1, 0.006]),
        (&stand_resonance::KIND, vec![0.8, 23.0, 0.05]),
        (&stand_resonance::KIND, vec![-0.5, 14.0, 0.03]),
    ] {
        for omega in [3.0, 40.0, 144.0] {
            let effect = active(kind, &values);
            let seen = seen_response(std::slice::from_ref(&effect), omega);
            let expected = effect.response(&point(), omega);
            assert!((seen / expected - 1.0).norm() < 2e-5, "{kind:?} at {omega}: {seen} for {expected}");
            assert_eq!(kind.linearity, Linearity::Exact);
        }
    }
}

#[test]
fn small_signals_see_the_linearized_effect() {
    for (kind, values) in [
        (&supply_sag::KIND, vec![0.12, 0.8]),
        (&supply_sag::KIND, vec![0.05, 0.8, 0.1, 1.5]),
        (&winding_heating::KIND, vec![0.03, 0.8]),
        (&operating_point_lag::KIND, vec![1.0]),
        (&operating_point_lag::KIND, vec![1.0, 0.7]),
        (&quadratic_thrust::KIND, vec![4.0]),
        (&quadratic_thrust::KIND, vec![4.0, 1.0]),
        (&quadratic_thrust::KIND, vec![4.0, 0.5, 20.0]),
        (&slew_limit::KIND, vec![2.0]),
        (&slew_limit::KIND, vec![2.0, 0.5]),
        (&saturation::KIND, vec![0.7]),
    ] {
        let effect = active(kind, &values);
        for omega in [0.7, 3.0, 40.0] {
            let seen = seen_response(std::slice::from_ref(&effect), omega);
            let expected = effect.response(&point(), omega);
            assert!((seen / expected - 1.0).norm() < 2e-4, "{kind:?} at {omega}: {seen} for {expected}");
            assert_eq!(kind.linearity, Linearity::SmallSignal);
        }
    }
}

#[test]
fn a_sagging_supply_overshoots_and_creeps_to_its_steady_voltage() {
    let sag = active(&supply_sag::KIND, &[0.1, 1.0, 0.04, 1.0, 16.0, 10.0]);
    let mut plant = actuator(&[sag]);
    let supply = plant.supply_measurement().unwrap();
    // At a speed of 0.5 both drops are there in full, and the nominal response is that of the model.
    assert!((supply.voltage_v - 16.0 * 0.86).abs() < 1e-9 && (supply.current_a - 10.0).abs() < 1e-9);
    assert!(plant.response().abs() < 1e-9);
    let mut peak: f64 = 0.0;
    for tick in 1..=20_000_u32 {
        plant.advance(0.6, f64::from(tick) * 1e-3);
        peak = peak.max(plant.response());
    }
    let (speed, supply) = (plant.equivalent_command(), plant.supply_measurement().unwrap());
    let current = (speed / 0.5).powi(2);
    assert!((supply.voltage_v / 16.0 - (1.0 - 0.14 * current)).abs() < 1e-8);
    assert!((speed - 0.6 * supply.voltage_v / (16.0 * 0.86)).abs() < 1e-8);
    assert!((plant.response() - 10.0 * (speed - 0.5)).abs() < 1e-8 && peak > 1.02 * plant.response());
    // With the motor stopped at once the resistance lets go with the speed, the polarization by its time constant.
    plant.advance(0.0, 21.5);
    let slow_then = 1.0 - plant.supply_measurement().unwrap().voltage_v / 16.0;
    plant.advance(0.0, 22.5);
    let slow_later = 1.0 - plant.supply_measurement().unwrap().voltage_v / 16.0;
    assert!((slow_later / slow_then - (-1.0_f64).exp()).abs() < 1e-4, "{slow_then} {slow_later}");
}

#[test]
fn a_skewed_clock_turns_the_phase_in_proportion_to_time() {
    let omega = 60.0;
    let ticks: Vec<f64> = (0..100_000_u32).map(|tick| f64::from(tick) * 2e-4).collect();
    let command: Vec<f64> = ticks.iter().map(|t| 0.5 + 0.05 * (omega * t).sin()).collect();
    let drive = CommandSignal { time_s: &ticks, command: &command };
    let start = || Start::Rest(0.5);
    let rows: Vec<f64> = (0..19_000_u32).map(|row| f64::from(row) * 1e-3).collect();
    for ppm in [800.0, -800.0] {
        let skewed = simulate(&mut actuator(&[active(&clock_skew::KIND, &[ppm])]), drive, start(), &rows).unwrap();
        let moments: Vec<f64> = rows.iter().map(|t| t * (1.0 + 1e-6 * ppm)).collect();
        let plain = simulate(&mut actuator(&[]), drive, start(), &moments).unwrap();
        for (row, (a, b)) in skewed.response.iter().zip(&plain.response).enumerate() {
            assert!((a - b).abs() < 1e-12, "row {row}");
        }
        // The phase of the second at 18 s against that at 2 s.
        let phase = |from: usize| {
            let part = (from..from + 1000).map(|row| skewed.response[row] * Complex64::cis(-omega * rows[row]));
            part.sum::<Complex64>().arg()
        };
        let turned = phase(18_000) - phase(2000);
        let expected = omega * 1e-6 * ppm * 16.0;
        let off = (turned - expected + 9.0 * std::f64::consts::PI).rem_euclid(2.0 * std::f64::consts::PI)
            - std::f64::consts::PI;
        assert!(off.abs() < 0.05, "{turned} for {expected}");
    }
}

#[test]
fn the_order_of_the_chain_is_that_of_the_catalog_and_not_of_the_file() {
    let mut one = model(&[(0.5, 10.0, 0.1, 0.0)]);
    let effect = |id: &str| typical(Catalog::standard().find(id).unwrap()).to_effect(&[]);
    one.effects = ["clock_skew", "slew_limit", "transport_delay", "dead_band", "parameter_error"].map(effect).to_vec();
    let kinds = |effects: Vec<ActiveEffect>| effects.iter().map(|effect| effect.kind().id).collect::<Vec<_>>();
    let expected = ["parameter_error", "dead_band", "slew_limit", "transport_delay", "clock_skew"];
    assert_eq!(kinds(ActiveEffect::from_model(&one).unwrap()), expected);

    // A grid behind a clip may pass it; the clip is first, so it does.
    let (clip, grid) = (active(&saturation::KIND, &[0.66]), active(&command_quantization::KIND, &[0.1]));
    let last = *step(0.3, 3.0, &[clip, grid]).last().unwrap();
    assert!((last - 2.0).abs() < 1e-9, "{last}: 0.8 is clipped to 0.66, which is rounded to 0.7");
}

#[test]
fn known_frames_come_ahead_of_a_delay_and_behind_a_hold() {
    let timing = EscTiming { frame_hz: Some(100.0), frame_phase: 0.5 };
    let first = |effects: &[ActiveEffect]| {
        let mut plant = Actuator::with_effects(point(), effects, timing).unwrap();
        // A change at 1 ms.
        plant.advance(0.5, 0.001);
        (1..=100_u32).find(|k| {
            plant.advance(0.6, 0.001 + f64::from(*k) * 1e-3);
            plant.response() > 0.0
        })
    };
    assert_eq!(first(&[]), Some(5));
    assert_eq!(first(&[active(&transport_delay::KIND, &[0.003])]), Some(8));
    // Frames of 20 ms: taken over at 20 ms, and by the ESC at 25 ms.
    assert_eq!(first(&[active(&esc_frame_hold::KIND, &[50.0])]), Some(25));
}

#[test]
fn a_model_says_what_is_wrong_with_its_effects() {
    let resolve = |kind: &str, parameters: &[(&str, f64)]| {
        let parameters = parameters.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
        let effect = Effect { kind: kind.to_owned(), parameters, std: Default::default() };
        Catalog::standard().resolve(&effect, &KeyPath::root().key("effect").item(0))
    };
    for (kind, parameters, place, part, help) in [
        ("slew_limt", &[][..], "`effect` 1, `kind`", "no kind", "did you mean `slew_limit`"),
        ("slew", &[], "`effect` 1, `kind`", "no kind", "did you mean `slew_limit`"),
        ("gremlin", &[], "`effect` 1, `kind`", "no kind", "`parameter_error`, `saturation`"),
        ("slew_limit", &[], "`effect` 1", "needs `rate_per_s`", "add `rate_per_s`"),
        ("slew_limit", &[("rate_pers", 1.0)], "`rate_pers`", "no such parameter", "did you mean `rate_per_s`"),
        ("slew_limit", &[("b", 1.0)], "`b`", "no such parameter", "has `rate_per_s`"),
        ("slew_limit", &[("rate_per_s", -1.0)], "`rate_per_s`", "-1 is not", "0.1 to 300"),
        ("transport_delay", &[("delay_s", f64::INFINITY)], "`delay_s`", "inf is not", "plausible"),
        ("second_pole", &[("time_constant_s", f64::NAN)], "`time_constant_s`", "NaN is not", "plausible"),
        ("saturation", &[("max", 0.3), ("min", 0.4)], "`min`", "0.4 is not below `max`", "correct"),
        ("saturation", &[("max", 1.5)], "`max`", "from 0 to 1", "plausible"),
    ] {
        let fault = resolve(kind, parameters).unwrap_err();
        let said = fault.to_string();
        assert!(
            said.contains(place) && said.contains(part) && fault.help.contains(help),
            "{kind}: {said} / {}",
            fault.help
        );
    }
    let good = resolve("saturation", &[("max", 0.8)]).unwrap();
    assert_eq!((good.value("max"), good.value("min"), good.value("top")), (Some(0.8), Some(0.0), None));
    assert!(ActiveEffect::new(&saturation::KIND, vec![0.8]).is_err());
}

#[test]
fn an_effect_goes_into_a_file_and_comes_back() {
    for kind in Catalog::standard().kinds() {
        let effect = typical(kind);
        let written = effect.to_effect(&[0.01]);
        assert_eq!(Catalog::standard().resolve(&written, &KeyPath::root()).unwrap(), effect);
        assert_eq!(written.std.values().collect::<Vec<_>>(), [&0.01]);
    }
}

#[test]
fn too_many_effects_on_the_rotor_are_refused() {
    let many = vec![active(&asymmetric_lag::KIND, &[1.2]); 5];
    assert!(Actuator::with_effects(point(), &many, EscTiming::default()).is_err());
    assert!(Actuator::with_effects(point(), &many[..4], EscTiming::default()).is_ok());
}

#[test]
fn the_response_is_smooth_in_parameters_that_move_events() {
    // Central differences at two widths agree, so a fit's derivative is that of a smooth curve.
    let first = [
        (&transport_delay::KIND, vec![0.004_1]),
        (&slew_limit::KIND, vec![0.9]),
        (&second_pole::KIND, vec![0.006]),
        (&moving_average::KIND, vec![0.016_4]),
        (&inflow_lead::KIND, vec![1.7, 0.007]),
        (&supply_sag::KIND, vec![0.1, 0.7]),
        (&winding_heating::KIND, vec![0.02, 2.0]),
        (&operating_point_lag::KIND, vec![0.9]),
        (&asymmetric_lag::KIND, vec![1.5]),
        (&quadratic_thrust::KIND, vec![3.0]),
        (&stand_resonance::KIND, vec![0.7, 19.0, 0.05]),
        (&clock_skew::KIND, vec![700.0]),
    ];
    let bent = first.iter().filter_map(|(kind, values)| {
        let (place, shape) = kind.shape()?;
        let mut all = active(kind, values).values().to_vec();
        all[place] = shape.starts[0];
        Some((*kind, all, place))
    });
    let first = first.iter().map(|(kind, values)| (*kind, values.clone(), 0));
    for (kind, values, place) in first.chain(bent) {
        let derivative = |width: f64| -> Vec<f64> {
            let at = |value: f64| {
                let mut moved = values.clone();
                moved[place] = value;
                [-0.1, 0.1].map(|height| step(height, 0.4, &[active(kind, &moved)])).concat()
            };
            let (up, down) = (at(values[place] * (1.0 + width)), at(values[place] * (1.0 - width)));
            up.iter().zip(down).map(|(a, b)| (a - b) / (2.0 * width)).collect()
        };
        let (wide, narrow) = (derivative(1e-3), derivative(1e-5));
        let size = narrow.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
        // Where an event falls into a row the two differ in that row by up to the kink; no more than one row in a hundred.
        let apart = wide.iter().zip(&narrow).filter(|(a, b)| (*a - *b).abs() > 1e-3 * size).count();
        assert!(apart <= 8, "{kind:?}: {apart} of {}", wide.len());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// Every kind over its whole plausible range, and pairs of them.
    #[test]
    fn the_response_is_finite_whatever_the_command(
        shares in prop::collection::vec(0.0..=1.0, 12),
        others in prop::collection::vec(0.0..=1.0, 12),
        pick in 0..STANDARD.len(),
        seed in any::<u64>(),
    ) {
        let catalog = Catalog::standard();
        let other = catalog.kinds().nth(pick).and_then(|kind| between(kind, &others));
        for kind in catalog.kinds() {
            let mut effects: Vec<ActiveEffect> = between(kind, &shares).into_iter().chain(other.clone()).collect();
            catalog.sort(&mut effects);
            let response = response_to_noise(&effects, seed);
            let worst = response.iter().fold(0.0_f64, |worst, y| worst.max(y.abs()));
            prop_assert!(response.iter().all(|y| y.is_finite()) && worst < 1e3, "{effects:?}: {worst}");
        }
    }

    /// The same actuator in ticks and at once: rows, ticks and pieces do not matter. The cubic through a piece's ends is off
    /// by 3e-7 at most, which a lightly damped mode may make larger by its quality, 1 / (2 zeta).
    #[test]
    fn linear_chains_do_not_depend_on_how_time_is_cut(shares in prop::collection::vec(0.0..=1.0, 12), cuts in 2_u32..9) {
        for kind in Catalog::standard().kinds().filter(|kind| kind.linearity == Linearity::Exact) {
            let Some(effect) = between(kind, &shares) else { continue };
            let run = |cuts: u32| {
                let mut plant = actuator(std::slice::from_ref(&effect));
                for cut in 1..=cuts {
                    plant.advance(0.6, 0.2 * f64::from(cut) / f64::from(cuts));
                }
                plant.response()
            };
            let (once, cut) = (run(1), run(cuts));
            let zeta = kind.parameters.iter().position(|parameter| parameter.name == "damping");
            let quality = zeta.map_or(1.0, |place| (0.5 / effect.values()[place]).max(1.0));
            prop_assert!((once - cut).abs() < 1e-6 * quality, "{effect:?}: {once} {cut}");
        }
    }
}

#[test]
fn over_a_range_effects_count_from_the_points_and_the_supply_from_no_load() {
    let two = model(&[(0.3, 10.0, 0.2, 0.0), (0.6, 10.0, 0.1, 0.0)]);
    let run = |effects: Vec<ActiveEffect>, command: f64| {
        let mut with = two.clone();
        with.effects = effects.iter().map(|effect| effect.to_effect(&[])).collect();
        let mut plant = Actuator::new(&with, Law::FollowingLevel(0.4), EscTiming::default()).unwrap();
        let start = plant.response();
        plant.advance(command, 100.0);
        (start, plant.response())
    };
    // Inside the points there is no curvature beyond theirs; outside it counts from the last.
    let bend = || vec![active(&quadratic_thrust::KIND, &[2.0])];
    assert!((run(bend(), 0.5).1 - 2.0).abs() < 1e-9);
    assert!((run(bend(), 0.8).1 - (5.0 + 10.0 * 2.0 * 0.04)).abs() < 1e-9);
    // V = 1 - 0.1 (s / 0.5)^2 of the open circuit, s = u V.
    let (start, _) = run(vec![active(&supply_sag::KIND, &[0.1, 1.0])], 0.5);
    let speed = 0.3 + start / 10.0;
    assert!((speed - 0.4 * (1.0 - 0.1 * (speed / 0.5).powi(3))).abs() < 1e-9);
}

#[test]
fn a_gain_that_is_none_has_the_speed_of_its_command() {
    let flat = OperatingPoint { lag: crate::model::Lag { gain: 0.0, ..point().lag }, ..point() };
    let mut plant = Actuator::with_effects(flat, &[], EscTiming::default()).unwrap();
    plant.advance(0.7, 1.0);
    assert_eq!((plant.response(), plant.equivalent_command()), (0.0, 0.7));
}
