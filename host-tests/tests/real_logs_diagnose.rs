//! The diagnosis on logs of real motors, from one first-order lag to named effects.
//!
//! Where the logs are looked for, and what happens without them, is said at [`real_log`].

use host_tests::real_log;
use rotorlead_sim::diagnose::{Diagnosis, Options, Verdict, diagnose};
use rotorlead_sim::identify::steps::{LawComparison, compare_laws};
use rotorlead_sim::plant::Catalog;
use rotorlead_sim::plant::effect::ActiveEffect;
use rotorlead_sim::record::import::{ImportOptions, import};

fn diagnosed(name: &str) -> Option<Diagnosis> {
    let log = import(&real_log(name)?, &ImportOptions::default()).unwrap().experiment;
    let catalog = Catalog::standard();
    let found = diagnose(&log, &Options { model: None, catalog: &catalog, progress: &|| {} }).unwrap();
    print(name, &found, &compare_laws(&log.records[0], log.output).unwrap());
    Some(found)
}

fn print(name: &str, found: &Diagnosis, laws: &LawComparison) {
    let percent = |gap: f64| 100.0 * (1.0 - gap);
    println!(
        "{name}: {}, fit {:.2} % before, {:.2} % after, {:.2} % at most; {}",
        found.verdict.name(),
        percent(found.fitted.before),
        percent(found.fitted.after),
        percent(found.fitted.noise_floor),
        found.cut[0]
    );
    for effect in &found.effects {
        print!("  {} {:+.0}", effect.kind.id, effect.evidence);
        for (parameter, estimate) in &effect.parameters {
            print!(", {} {:.4} +- {:.4}", parameter.name, estimate.value, estimate.std);
        }
        println!("; or {:?}", effect.alternatives);
    }
    for (split, law) in found.splits.iter().zip(&laws.held_out) {
        println!(
            "  {}: {:.2} % before, {:.2} % after, {:.2} % at most; one lag with a map {:.2} %, speed-dependent {:.2} %",
            split.split,
            percent(split.gap.before),
            percent(split.gap.after),
            percent(split.gap.noise_floor),
            law.one_lag_percent,
            law.speed_dependent_percent
        );
    }
}

/// What holds of every log that something is named of. `least_percent` is the fit on all steps.
fn check(found: &Diagnosis, least_percent: f64) {
    assert!(matches!(found.verdict, Verdict::Named | Verdict::PartlyNamed), "{:?}", found.verdict);
    assert!(100.0 * (1.0 - found.fitted.after) > least_percent, "{:?}", found.fitted);
    // More than noise is left: up and down settle 1 to 3 % apart, which no map of the command alone has.
    assert!(found.excess.1.significance() > 5.0 && found.fitted.after > found.fitted.noise_floor, "{:?}", found.excess);
    assert_eq!(found.splits.len(), 4);
    for split in &found.splits {
        assert!(split.gap.after < split.gap.before, "{split:?}");
    }
    // The improved model can be simulated.
    found.model.check().unwrap();
    assert!(ActiveEffect::of_model(&found.model).unwrap().len() <= found.effects.len());
}

/// A static map, a lag and a delay fitted by hand reach 89 %.
#[test]
fn rcbenchmark_log() {
    let Some(found) = diagnosed("Log_2019-11-09_181347.csv") else { return };
    check(&found, 94.0);
    // The erratic start, the stop, and the probe's spikes.
    assert_eq!((found.cut[0].start, found.cut[0].end, found.cut[0].spikes), (2018, 1108, 26));
    let delay = found.effects.iter().find(|effect| effect.kind.id == "transport_delay").unwrap();
    assert!((0.020..0.040).contains(&delay.parameters[0].1.value), "{delay:?}");
    assert!(found.effects.iter().any(|effect| effect.kind.id == "quadratic_thrust"), "{:?}", found.effects);
}

#[test]
fn esc32_log_f60() {
    let Some(found) = diagnosed("esc32v3_f60-1.csv") else { return };
    check(&found, 94.0);
    assert!(found.effects.iter().all(|effect| effect.kind.id != "transport_delay"), "it has none");
    assert!(found.effects.iter().any(|effect| effect.kind.id == "quadratic_thrust"), "{:?}", found.effects);
}

#[test]
#[ignore = "the verdict is `unknown` so far: what is found on the upward steps does not hold on the others"]
fn esc32_log_f40() {
    let Some(found) = diagnosed("f40_steps_5-2.csv") else { return };
    check(&found, 94.0);
    assert!(found.effects.iter().all(|effect| effect.kind.id != "transport_delay"), "it has none");
}
