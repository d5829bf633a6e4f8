//! The diagnosis on records of systems that are no motors, whose physics is known: benchmarks of nonlinear identification.
//!
//! Where they are looked for, and what happens without them, is said at [`real_log`](rotorlead_records::shared_data::real_log).

use rotorlead_diagnose::{Diagnosis, Gap, Options, Verdict, diagnose};
use rotorlead_plant::Catalog;
use rotorlead_records::import::{ImportOptions, import};
use rotorlead_records::{Excitation, Experiment};

/// Logs as the records of one experiment, with times that are so many times as long.
fn experiment(names: &[&str], slower: f64) -> Option<Experiment> {
    let mut all: Option<Experiment> = None;
    for name in names {
        let options = ImportOptions { excitation: Some(Excitation::Free), ..ImportOptions::default() };
        let mut log = import(&rotorlead_records::shared_data::data(&format!("outside/{name}.csv"))?, &options)
            .unwrap()
            .experiment;
        log.records[0].time_s.iter_mut().for_each(|time_s| *time_s *= slower);
        log.sample_rate_hz = log.sample_rate_hz.map(|rate_hz| rate_hz / slower);
        match &mut all {
            Some(all) => all.records.append(&mut log.records),
            None => all = Some(log),
        }
    }
    all
}

fn diagnosed(names: &[&str], slower: f64) -> Option<Diagnosis> {
    let catalog = Catalog::standard();
    let options = Options { model: None, catalog: &catalog, progress: &|| {} };
    let found = diagnose(&experiment(names, slower)?, &options).unwrap();
    println!("{names:?} x {slower}: {}, {:?}, {:?}", found.verdict.name(), found.gap, found.excess);
    for effect in &found.effects {
        println!("  {} {:?}", effect.kind.id, effect.parameters);
    }
    Some(found)
}

const ESTIMATION: &str = "cascaded_tanks_estimation";
const VALIDATION: &str = "cascaded_tanks_validation";
/// Rows of 1 ms as they are in the file, and of 0.5 ms to 4 ms.
const SLOWER: [f64; 4] = [1.0, 0.5, 2.0, 4.0];

/// Two tanks in a row, of which the upper one overflows. That they empty by the root of their level is not found.
#[test]
fn two_tanks_are_a_second_pole_and_a_limit_however_fast_time_runs() {
    let mut first: Option<Diagnosis> = None;
    for slower in SLOWER {
        let Some(found) = diagnosed(&[ESTIMATION], slower) else { return };
        let kinds: Vec<&str> = found.effects.iter().map(|effect| effect.kind.id).collect();
        // Far more than noise is left.
        assert_eq!((found.verdict, &kinds[..]), (Verdict::PartlyNamed, &["second_pole", "saturation"][..]));
        assert!(found.gap.before > 0.4 && found.gap.after < 0.28, "{:?}", found.gap);
        let first = first.get_or_insert_with(|| found.clone());
        let [pole, limit] = [0, 1].map(|effect| [&*first, &found].map(|found| found.effects[effect].parameters[0].1));
        assert!((pole[1].value - slower * pole[0].value).abs() < 0.1 * slower * pole[0].std, "{slower}: {pole:?}");
        assert!((limit[1].value - limit[0].value).abs() < 0.1 * limit[0].std, "{slower}: {limit:?}");
    }
}

/// They explain less than half of the motion that is held out of the second record, and of both together.
#[test]
fn tanks_of_which_too_little_is_explained_have_no_name_however_fast_time_runs() {
    for names in [&[VALIDATION][..], &[ESTIMATION, VALIDATION]] {
        for slower in SLOWER {
            let Some(found) = diagnosed(names, slower) else { return };
            assert_eq!((found.verdict, found.effects.len()), (Verdict::Unknown, 0), "{:?}", found.effects);
            assert!((0.4..0.5).contains(&found.gap.after), "{:?}", found.gap);
        }
    }
}

/// A sensor that has no sign, and a force that is another on the way back.
#[test]
fn what_the_catalog_has_not_got_is_unknown_and_no_gap_is_beyond_reason() {
    for name in ["coupled_drives_1", "coupled_drives_2", "coupled_drives_3", "mr_damper"] {
        let Some(found) = diagnosed(&[name], 1.0) else { return };
        assert_eq!((found.verdict, found.effects.len()), (Verdict::Unknown, 0), "{:?}", found.effects);
        let splits = found.splits.iter().map(|split| split.gap);
        for Gap { before, after, .. } in splits.chain([found.gap, found.fitted]) {
            assert!((0.0..1.1).contains(&before) && (0.0..1.1).contains(&after), "{name}: {before} {after}");
        }
    }
}
