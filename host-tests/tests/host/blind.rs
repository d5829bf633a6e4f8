//! Blind cases: their folders are what the commands take, and a small fixed part of them is judged.

use assert_cmd::Command;
use blind_cases::case::{Case, Class, Columns, Set};
use blind_cases::ceiling::Rivals;
use blind_cases::folder::write;
use blind_cases::kind::Kind;
use blind_cases::run::{Plan, run};
use blind_cases::score::Scored;

fn columns(case: &Case) -> Vec<Columns> {
    (0..case.runs.len()).map(|index| case.record(index)).collect()
}

#[test]
fn identify_finds_the_motor_of_a_case_with_nothing_hidden() {
    let case = Case::draw(Set::Tune, Class::Empty, 0);
    let root = tempfile::tempdir().unwrap();
    let paths = write(&case, &columns(&case), root.path()).unwrap();
    let output = Command::cargo_bin("rotorlead")
        .unwrap()
        .arg("identify")
        .arg(&paths.experiment)
        .args(["--json", "-", "--out"])
        .arg(root.path().join("model.toml"))
        .assert()
        .success();
    let json: serde_json::Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    let points = json["points"].as_array().unwrap();
    assert_eq!(points.len(), 6);
    for (point, truth) in points.iter().zip(&case.motor.points) {
        let off = |key: &str, truth: f64| point[key].as_f64().unwrap() / truth - 1.0;
        assert!(off("gain", truth.gain_n).abs() < 0.03, "{point}");
        assert!(off("time_constant_s", truth.time_constant_s).abs() < 0.05, "{point}");
    }
}

#[test]
fn every_kind_and_sort_makes_a_folder_and_a_model_that_are_taken() {
    let singles = [Kind::ParameterError, Kind::Saturation, Kind::ClockSkew].map(Class::Single);
    for class in singles.into_iter().chain([Class::Pair, Class::Triple, Class::Outside, Class::SingleInNuisance]) {
        let case = Case::draw(Set::Tune, class, 1);
        let root = tempfile::tempdir().unwrap();
        let paths = write(&case, &columns(&case), root.path()).unwrap();
        let mut command = Command::cargo_bin("rotorlead").unwrap();
        match &paths.model {
            Some(model) => command.arg("validate").arg(&paths.experiment).arg("--model").arg(model),
            None => command.arg("identify").arg(&paths.experiment).arg("--out").arg(root.path().join("model.toml")),
        };
        command.assert().success();
    }
}

/// The part that is fixed: one case of most kinds, all of which can be distinguished from the thrust alone, and empty ones.
#[test]
fn a_fixed_part_of_the_cases_is_named_right() {
    let kinds = [
        Kind::ParameterError,
        Kind::EscFrameHold,
        Kind::DeadBand,
        Kind::Backlash,
        Kind::CommandQuantization,
        Kind::AsymmetricLag,
        Kind::OperatingPointLag,
        Kind::SecondPole,
    ];
    let folder = tempfile::tempdir().unwrap();
    let mut cases: Vec<(Class, u64)> = kinds.into_iter().map(|kind| (Class::Single(kind), 0)).collect();
    cases.extend([(Class::Empty, 0), (Class::Empty, 1), (Class::Outside, 0), (Class::Outside, 3)]);
    let plan = Plan {
        set: Set::Tune,
        cases,
        jobs: 2,
        rivals: Rivals::None,
        tool: Some(assert_cmd::cargo::cargo_bin("rotorlead")),
        folder: folder.path().to_owned(),
        keep: false,
        cache: folder.path().join("cache"),
    };
    for case in run(&plan, &|_, _| {}).unwrap() {
        assert!(case.answer.is_ok(), "{case:?}");
        match case.truth.class.as_str() {
            "nothing" => assert!(Scored::names_nothing(&case), "{case:?}"),
            "outside" => assert!(case.admits(), "{case:?}"),
            _ => assert!(case.first_is_right() && !case.has_wrong_name(), "{case:?}"),
        }
    }
}

/// The page must have the parts and rows that `cargo xtask blind` writes today. Its digits are those of the day it was made.
#[test]
fn the_page_is_current_in_shape() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/confusion.md");
    let text = std::fs::read_to_string(&path).unwrap();
    let shape = |text: &str| {
        let first_cells = text.lines().filter(|line| line.starts_with("##") || line.starts_with('|'));
        let cells: Vec<String> = first_cells
            .take_while(|line| *line != "## Parameters")
            .map(|line| line.trim_start_matches('|').split('|').next().unwrap_or_default().trim().to_owned())
            .collect();
        cells
    };
    assert_eq!(shape(&text), shape(&blind_cases::report::page(&[], Set::Report, "a test")));
    for part in blind_cases::report::PARTS {
        assert!(text.contains(part), "{part}");
    }
}
