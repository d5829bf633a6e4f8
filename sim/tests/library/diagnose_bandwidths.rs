//! The diagnosis from a table of bandwidths: the paper's, and tables made of a model with something hidden in it.

use rotorlead::design::LeadParameters;
use rotorlead_diagnose::Verdict;
use rotorlead_diagnose::bandwidth_table::{
    BandwidthDiagnosis, BandwidthOptions, BandwidthRow, BandwidthTable, Column, Explanation, Scope, Standing,
    diagnose_bandwidths,
};
use rotorlead_identify::design::{Chain, DesignOptions, bandwidths_with, design};
use rotorlead_plant::{ActiveEffect, Catalog, Effect, Lag, Model, Point};

/// Table 1 of Charla, Yao & Voyles: nominal command, gain, pole in rad/s; and Table 3, measured: bandwidth in rad/s without and
/// with compensator.
const PAPER: [(f64, f64, f64, f64, f64); 6] = [
    (0.40, 9.9955, 6.2758, 7.6139, 10.5564),
    (0.45, 10.4556, 7.3524, 9.0941, 33.5233),
    (0.50, 10.1718, 9.2889, 11.7689, 68.9652),
    (0.55, 10.9196, 9.9130, 14.4992, 72.9550),
    (0.60, 13.4519, 11.7439, 15.1641, 85.8608),
    (0.65, 16.1063, 14.1275, 14.7953, 97.1847),
];

fn model() -> Model {
    let point = |&(nominal, gain, pole_rad_s, _, _): &(f64, f64, f64, f64, f64)| {
        Point::new(nominal, Lag { gain, time_constant_s: 1.0 / pole_rad_s, delay_s: 0.0 })
    };
    Model {
        time_constant_curve: None,
        format: 1,
        points: PAPER.iter().map(point).collect(),
        static_map: None,
        effects: vec![],
        provenance: None,
    }
}

fn lead() -> LeadParameters {
    *design(&model(), &DesignOptions::default()).unwrap().lead()
}

fn paper_table() -> BandwidthTable {
    let row = |&(nominal, _, _, without, with): &(f64, f64, f64, f64, f64)| BandwidthRow {
        nominal,
        measured_rad_s: [Some(without), Some(with)],
    };
    BandwidthTable { rows: PAPER.iter().map(row).collect() }
}

/// The bandwidths of another actuator with the same compensator, to four digits behind the point.
fn table_of(truth: &Model) -> BandwidthTable {
    let effects = ActiveEffect::of_model(truth).unwrap();
    let points = bandwidths_with(truth, &effects, Chain::Continuous(&lead()));
    let printed = |value: f64| Some((1e4 * value).round() / 1e4);
    let row = |point: &rotorlead_identify::design::BandwidthPoint| BandwidthRow {
        nominal: point.nominal,
        measured_rad_s: [point.uncompensated, point.compensated].map(|one| printed(one.rad_s().unwrap())),
    };
    BandwidthTable { rows: points.iter().map(row).collect() }
}

fn diagnosed_with(table: &BandwidthTable, fitted: Column, accuracy: Option<f64>) -> BandwidthDiagnosis {
    let (lead, catalog) = (lead(), Catalog::standard());
    let options = BandwidthOptions { lead: &lead, fitted, accuracy, take: None, catalog: &catalog };
    diagnose_bandwidths(table, &model(), &options).unwrap()
}

fn diagnosed(table: &BandwidthTable) -> BandwidthDiagnosis {
    diagnosed_with(table, Column::Uncompensated, None)
}

#[track_caller]
fn explanation<'a>(found: &'a BandwidthDiagnosis, name: &str) -> &'a Explanation {
    found.explanations.iter().find(|one| one.name() == name).unwrap_or_else(|| panic!("no {name}"))
}

#[test]
fn the_papers_uncompensated_column_predicts_its_compensated_one() {
    let found = diagnosed(&paper_table());
    assert_eq!(found.verdict, Verdict::PartlyNamed);
    assert!((found.gap.before - 0.679).abs() < 5e-4 && found.gap.after <= 0.31, "{:?}", found.gap);
    let named = found.named().unwrap();
    assert_eq!((named.name().as_str(), named.numbers), ("parameter_error", 1));
    // What a number at each nominal command gives, computed apart.
    for (name, predicts) in [("parameter_error_at_each", 0.226), ("low_frequency_gain_at_each", 0.308)] {
        let one = explanation(&found, name);
        assert!((one.held_out_rms.unwrap() - predicts).abs() < 5e-4, "{name}: {:?}", one.held_out_rms);
        assert!(one.fitted_rms < 1e-6 && one.standing == Standing::Alternative && one.score.is_none());
    }
    // One ratio of the static gain moves every bandwidth of a lag by one factor, as one time constant does.
    let (gain, pole) = (explanation(&found, "low_frequency_gain"), explanation(&found, "parameter_error"));
    assert!((gain.fitted_rms - pole.fitted_rms).abs() < 1e-4 && gain.standing == Standing::Alternative);
    let alternatives: Vec<&str> = found.alternatives().iter().map(|kind| kind.id).collect();
    assert!(alternatives.contains(&"low_frequency_gain") && alternatives.contains(&"supply_sag"), "{alternatives:?}");
    let reason = |id: &str| &found.ruled_out.iter().find(|one| one.kind.id == id).unwrap().reason;
    assert!(reason("transport_delay").contains("magnitude"));
    assert!(reason("backlash").contains("no frequency response"));
    assert!(reason("second_pole").contains("no value"));
    let next = found.next_experiment.unwrap();
    for part in ["multisines", "0.45, 0.50, 0.55", "four periods", "voltage"] {
        assert!(next.contains(part), "{next}");
    }
    let share: f64 = found.parts.iter().flatten().map(|part| part.share).sum();
    assert!((share - 1.0).abs() < 1e-12);
}

#[test]
fn the_held_out_column_has_no_say_in_the_choice() {
    let mut shuffled = paper_table();
    for (row, other) in shuffled.rows.iter_mut().zip([80.0, 8.0, 14.0, 120.0, 9.0, 30.0]) {
        row.measured_rad_s[1] = Some(other);
    }
    let (found, shuffled) = (diagnosed(&paper_table()), diagnosed(&shuffled));
    assert_eq!(found.chosen, shuffled.chosen);
    for (one, other) in found.explanations.iter().zip(&shuffled.explanations) {
        assert_eq!((one.name(), one.standing), (other.name(), other.standing));
        assert_eq!(one.values, other.values);
        assert_eq!(one.predicted_rad_s, other.predicted_rad_s);
    }
    // It only judges: this one it speaks against, so nothing is named.
    assert_eq!(shuffled.verdict, Verdict::Unknown);
    assert!(shuffled.named().is_none() && shuffled.model().unwrap() == model());
}

#[test]
fn known_errors_ask_for_a_number_at_each() {
    let found = diagnosed_with(&paper_table(), Column::Uncompensated, Some(0.02));
    assert_eq!(found.named().unwrap().name(), "parameter_error_at_each");
    assert!((found.gap.after - 0.226).abs() < 5e-4, "{:?}", found.gap);
    // Errors of a tenth leave one number enough.
    let found = diagnosed_with(&paper_table(), Column::Uncompensated, Some(0.1));
    assert_eq!(found.named().unwrap().name(), "parameter_error");
}

#[test]
fn the_models_own_bandwidths_agree() {
    for accuracy in [None, Some(0.001)] {
        let found = diagnosed_with(&table_of(&model()), Column::Uncompensated, accuracy);
        assert_eq!(found.verdict, Verdict::Agrees);
        assert!(found.explanations.is_empty() && found.next_experiment.is_none() && found.gap.after < 1e-4);
    }
}

#[test]
fn one_wrong_time_constant_is_named_with_its_value_from_either_column() {
    let mut truth = model();
    truth.points.iter_mut().for_each(|point| point.time_constant_s *= 0.8);
    for fitted in Column::ALL {
        let found = diagnosed_with(&table_of(&truth), fitted, None);
        assert_eq!(found.verdict, Verdict::Named, "{fitted:?}");
        let named = found.named().unwrap();
        assert_eq!(named.name(), "parameter_error");
        assert!((named.parameters[0].1.value + 0.2).abs() < 1e-3, "{:?}", named.parameters);
        assert!(found.gap.after < 1e-2 && found.held_out, "{:?}", found.gap);
        for (improved, truth) in found.model().unwrap().points.iter().zip(&truth.points) {
            assert!((improved.time_constant_s / truth.time_constant_s - 1.0).abs() < 1e-3);
        }
    }
}

#[test]
fn wrong_time_constants_without_a_common_part_are_found_at_each_nominal_command() {
    let mut truth = model();
    for (point, factor) in truth.points.iter_mut().zip([0.8, 1.25, 0.9, 1.1, 0.85, 1.2]) {
        point.time_constant_s *= factor;
    }
    let found = diagnosed(&table_of(&truth));
    assert_eq!(found.verdict, Verdict::Named);
    assert_eq!(found.named().map(|one| (one.kind.id, one.scope)), Some(("parameter_error", Scope::Each)));
    for (improved, truth) in found.model().unwrap().points.iter().zip(&truth.points) {
        assert!((improved.time_constant_s / truth.time_constant_s - 1.0).abs() < 1e-4);
    }
    // With nothing to confirm them such numbers mean nothing.
    let mut alone = table_of(&truth);
    alone.rows.iter_mut().for_each(|row| row.measured_rad_s[1] = None);
    let found = diagnosed(&alone);
    assert_eq!((found.verdict, found.held_out, found.named().is_none()), (Verdict::Unknown, false, true));
    assert!(found.next_experiment.unwrap().contains("multisines"));
}

#[test]
fn a_sag_of_the_supply_is_told_from_a_faster_pole_by_its_course_over_the_nominal_command() {
    let parameters = [("polarization_drop".to_owned(), 0.08), ("polarization_s".to_owned(), 1.0)];
    let sag = Effect { kind: "supply_sag".to_owned(), parameters: parameters.into(), std: [].into() };
    let truth = Model { effects: vec![sag], ..model() };
    let found = diagnosed(&table_of(&truth));
    assert_eq!(found.verdict, Verdict::Named, "{:?}", found.gap);
    let named = found.named().unwrap();
    assert_eq!(named.name(), "supply_sag");
    assert!((named.parameters[0].1.value - 0.08).abs() < 2e-3, "{:?}", named.parameters);
    let improved = found.model().unwrap();
    assert_eq!(improved.effects.len(), 1);
    assert_eq!(improved.points, model().points);
    assert!(found.gap.after < 0.01, "{:?}", found.gap);
}

#[test]
fn a_nominal_command_between_points_becomes_a_point() {
    let table = BandwidthTable {
        rows: [(0.42, 8.0), (0.58, 14.0)]
            .map(|(nominal, without)| BandwidthRow { nominal, measured_rad_s: [Some(without), None] })
            .to_vec(),
    };
    let (lead, catalog) = (lead(), Catalog::standard());
    let options = BandwidthOptions {
        lead: &lead,
        fitted: Column::Uncompensated,
        accuracy: None,
        take: Some("parameter_error_at_each"),
        catalog: &catalog,
    };
    let found = diagnose_bandwidths(&table, &model(), &options).unwrap();
    let improved = found.model().unwrap();
    improved.check().unwrap();
    let nominals: Vec<f64> = improved.points.iter().map(|point| point.nominal).collect();
    assert_eq!(nominals, [0.40, 0.42, 0.45, 0.50, 0.55, 0.58, 0.60, 0.65]);
    let effects: [ActiveEffect; 0] = [];
    let points = bandwidths_with(&improved, &effects, Chain::Continuous(&lead));
    for (place, measured) in [(1, 8.0), (5, 14.0)] {
        assert!((points[place].uncompensated.rad_s().unwrap() / measured - 1.0).abs() < 1e-6);
    }
    // Beyond the table the factor of its end holds.
    let factor = |place: usize, nominal: f64| {
        improved.points[place].time_constant_s / model().at(nominal).unwrap().time_constant_s
    };
    assert!((factor(0, 0.40) / factor(1, 0.42) - 1.0).abs() < 1e-12);
    assert!((factor(7, 0.65) / factor(5, 0.58) - 1.0).abs() < 1e-12);
}
