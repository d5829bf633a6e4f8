//! What files say of where they come from, and what is said of two that do not belong together.

use crate::stand::Stand;

/// The plan simulated on a motor, identified and compensated: as `sim`, `found.toml` and `c.toml`.
fn identified() -> Stand {
    let stand = Stand::new();
    stand.run("simulate --model model.toml --plan plan.toml --out sim");
    stand.run("identify sim --out found.toml");
    stand.run("design --kind lead --model found.toml --out c.toml");
    stand
}

/// The first value of a key in a file.
fn value(text: &str, key: &str) -> String {
    let key = format!("{key} = ");
    let value = text.lines().find_map(|line| line.strip_prefix(&key));
    value.unwrap_or_else(|| panic!("no {key}in {text}")).replace('"', "")
}

/// What `bandwidth` warns of.
fn warnings(stand: &Stand, model: &str, compensator: &str) -> String {
    let found = stand.json(&format!("bandwidth --model {model} --compensator {compensator}"));
    found["warnings"].to_string()
}

const OF_ANOTHER: &str = "the compensator was designed for the model ";

#[test]
fn a_model_names_its_experiment_and_the_content_of_its_records() {
    let stand = identified();
    let name = value(&stand.read("sim/experiment.toml"), "name");
    let model = stand.read("found.toml");
    assert_eq!(value(&model, "experiment"), name);
    stand.run("identify sim --out again.toml --report page.html");
    assert_eq!(stand.read("again.toml"), model);
    // A report of the same records says the same.
    let checksum = value(&model, "records_crc32");
    assert!(stand.read("page.html").contains(&checksum), "{checksum}");
    let record = format!("sim/{}", value(&stand.read("sim/experiment.toml"), "file"));
    stand.write(&record, stand.read(&record) + "\n");
    stand.run("identify sim --out again.toml");
    assert_ne!(value(&stand.read("again.toml"), "records_crc32"), checksum);
}

#[test]
fn a_compensator_names_its_model_whatever_its_file_is_called() {
    let stand = identified();
    let compensator = stand.read("c.toml");
    assert_eq!(value(&compensator, "experiment"), value(&stand.read("found.toml"), "experiment"));
    assert_eq!(value(&compensator, "version"), value(&stand.read("found.toml"), "version"));
    stand.write("renamed.toml", format!("# the motor of the left arm\n{}", stand.read("found.toml")));
    assert!(!warnings(&stand, "renamed.toml", "c.toml").contains(OF_ANOTHER));
}

#[test]
fn a_compensator_for_another_model_is_told() {
    let stand = identified();
    let named = value(&stand.read("c.toml"), "model_crc32");
    let found = warnings(&stand, "model.toml", "c.toml");
    assert!(found.contains(OF_ANOTHER) && found.contains(" experiment `short`, "), "{found}");
    assert!(found.contains(&format!("CRC-32 {named}, and this is the model with CRC-32 ")), "{found}");
    // A file of a version that did not say so is of any model.
    stand.write("c.toml", stand.read("c.toml").split("[provenance]").next().unwrap());
    assert!(!warnings(&stand, "model.toml", "c.toml").contains(OF_ANOTHER));
}

#[test]
fn keys_of_a_compensators_provenance_are_those_of_the_layout() {
    let stand = identified();
    stand.edit("c.toml", "model_crc32", "model_crc");
    stand.refuses("bandwidth --model found.toml --compensator c.toml", 1, &["c.toml", "did you mean `model_crc32`"]);
}

#[test]
fn a_redesign_is_of_the_improved_model() {
    let stand = identified();
    stand.run("diagnose sim --redesign --out-model improved.toml --out-compensator r.toml");
    assert!(!warnings(&stand, "improved.toml", "r.toml").contains(OF_ANOTHER));
}
