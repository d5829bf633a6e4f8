//! Two motors beside each other, or one before and after.

use crate::stand::{ACTUATORS, Stand};

/// Stands of two motors whose records differ in their noise: `one` and `two` are alike, and `other` is slower by a tenth.
fn stands() -> Stand {
    let stand = Stand::new();
    stand.write("plan.toml", host_tests::stand_plan());
    stand.write("actuators.toml", ACTUATORS);
    let slower = |line: &str| match line.strip_prefix("time_constant_s = ") {
        Some(tau) => format!("time_constant_s = {}\n", 1.1 * tau.parse::<f64>().unwrap()),
        None => format!("{line}\n"),
    };
    stand.write("slower.toml", ACTUATORS.lines().map(slower).collect::<String>());
    for (name, model, seed) in [("one", "actuators", 1), ("two", "actuators", 2), ("other", "slower", 3)] {
        stand.run(&format!("simulate --model {model}.toml --plan plan.toml --seed {seed} --out {name}"));
    }
    stand
}

#[test]
fn a_slower_motor_is_told_with_how_much_slower_it_is_and_an_equal_one_is_not() {
    let stand = stands();
    let found = stand.json("compare one other");
    for point in found["time_constants"].as_array().unwrap() {
        let number = |key: &str| point[key].as_f64().unwrap();
        assert_eq!(point["differs"], "yes", "{point}");
        assert!(number("change_low") < 0.1 && 0.1 < number("change_high"), "{point}");
    }
    assert!(found["headline"].as_str().unwrap().contains("differs from that of A at"), "{found}");
    let alike = stand.json("compare one two");
    let points = alike["time_constants"].as_array().unwrap();
    assert!(points.len() > 1 && points.iter().all(|point| point["differs"] == "not shown"), "{alike}");
    assert_eq!(alike["a"]["judgement"]["state"], stand.json("identify one")["judgement"]["state"]);
    // The verdict is what is seen last.
    let text = stand.run("compare one two --report page.html");
    assert!(text.contains("\nNo difference in the time constant is shown at any of"), "{text}");
    assert!(stand.read("page.html").contains("No difference in the time constant"), "the page says it too");
}

#[test]
fn a_model_its_records_and_its_folder_are_the_same() {
    let stand = stands();
    stand.run("identify one --out one.toml");
    let found = stand.json("compare one.toml one");
    for point in ["time_constants", "gains"].iter().flat_map(|key| found[*key].as_array().unwrap()) {
        assert_eq!((&point["change"], &point["differs"]), (&0.0.into(), &"not shown".into()), "{point}");
    }
}

#[test]
fn what_cannot_be_compared_says_why() {
    let stand = stands();
    stand.write("high.toml", "format = 1\n[[point]]\nnominal = 0.95\ngain = 10\ntime_constant_s = 0.1\n");
    for (arguments, said) in [
        ("compare actuators.toml high.toml", "the models share no command"),
        ("compare actuators.toml nothing.csv", "`nothing.csv` does not exist"),
        ("compare one one --excitation staircase", "--excitation says what is in a log"),
    ] {
        let output = stand.command(arguments).output().unwrap();
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success() && error.contains(said), "`{arguments}`: {error}");
    }
    let unknown = stand.run("compare actuators.toml slower.toml");
    assert!(unknown.contains("Whether the time constant differs is not known"), "{unknown}");
}
