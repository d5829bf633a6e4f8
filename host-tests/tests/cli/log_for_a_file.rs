//! A log in the place of a file or a folder that is made of one: what it is, and what makes the other of it.

use crate::stand::Stand;

#[test]
fn a_log_in_the_place_of_a_model_leads_to_the_command_that_makes_one() {
    let stand = Stand::new();
    stand.write("log.csv", include_str!("../../../sim/records/tests/data/rcbenchmark.csv"));
    stand.write("log.bin", include_bytes!("../../../sim/records/tests/data/bench.bin"));
    let commands = [
        "design @ --out c.toml",
        "bandwidth @",
        "export @ --for px4",
        "simulate @ --out sim",
        "validate stand --model @",
    ];
    for command in commands {
        for log in ["log.csv", "log.bin"] {
            let identify = format!("`rotorlead identify {log} --out model.toml`");
            let what = format!("`{log}` is a log or other data, and not a model");
            stand.refuses(&command.replace('@', log), 1, &[&what, &identify]);
        }
    }
    let parts = ["`log.csv` is a log", "not a compensator", "`rotorlead design` writes a compensator"];
    stand.refuses("bandwidth model.toml --compensator log.csv", 1, &parts);
}

#[test]
fn a_slip_in_a_model_is_shown_in_its_place_whatever_the_file_is_called() {
    let stand = Stand::new();
    for name in ["model.toml", "motor.txt"] {
        stand.write(name, "format = 1\n[[point\nnominal = 0.4\n");
        stand.refuses(&format!("bandwidth {name}"), 1, &[&format!("{name}:2:8"), "TOML is `key = value`"]);
    }
}

#[test]
fn a_log_in_the_place_of_an_experiment_leads_to_the_command_that_judges_it() {
    let stand = Stand::new();
    stand.write("log.csv", include_str!("../../../sim/records/tests/data/rcbenchmark.csv"));
    let judges = "`rotorlead identify log.csv` judges it";
    stand.refuses("validate log.csv --model model.toml", 1, &["`log.csv` is not a folder", judges]);
    let refused = stand.command("check log.csv --quiet").assert().code(1);
    let said = crate::stand::flowing(&crate::stand::report(&refused));
    assert!(said.contains("`rotorlead import log.csv --out DIR`") && said.contains(judges), "{said}");
}
