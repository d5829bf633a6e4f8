//! One thing has one name on every command, and the name that it had before is still taken.

use crate::one_command::without_tags;
use crate::stand::Stand;

#[test]
fn a_model_is_named_by_its_place_or_by_the_option_that_was_before() {
    let commands = [
        "design --kind lead --out c.toml",
        "bandwidth",
        "export --for paparazzi",
        "vehicle --airframe airframe.toml",
        "simulate --plan plan.toml --out sim",
    ];
    let stand = Stand::new();
    for command in commands {
        let (name, options) = command.split_once(' ').unwrap_or((command, ""));
        let printed = |model: &str| {
            let stand = Stand::new();
            stand.run(&format!("{name} {model} {options}"))
        };
        assert_eq!(printed("model.toml"), printed("--model model.toml"), "{name}");
        stand.refuses(
            &format!("{name} model.toml --model model.toml {options}"),
            2,
            &["MODEL", "--model", "cannot be"],
        );
        let help = stand.run(&format!("{name} --help"));
        assert!(help.contains("MODEL") && !help.contains("--model"), "{help}");
        // Without a model a vehicle has that of the paper.
        if name != "vehicle" {
            stand.refuses(command, 2, &["not provided", "<MODEL>"]);
        }
    }
}

#[test]
fn which_column_is_the_response_is_not_called_as_where_a_file_goes() {
    let stand = Stand::empty();
    let row = |row: i32| {
        let time_s = f64::from(row) / 100.0;
        // What never moves at rest is taken for the end of a sensor's range.
        let noise = 0.001 * f64::from(row * row).sin();
        let rise = noise + if row < 100 { 0.0 } else { 1.0 - (-(time_s - 1.0) / 0.1).exp() };
        let command = if row < 100 { 0.4 } else { 0.5 };
        format!("{time_s},{command},{},{}\n", 2.0 + 0.7 * rise, 5000.0 + 900.0 * rise)
    };
    stand.write("log.csv", format!("time_s,command,thrust_n,rpm\n{}", (0..300).map(row).collect::<String>()));
    for (option, response) in [
        ("--response thrust", "thrust_n"),
        ("--response rpm", "rpm"),
        ("--output thrust", "thrust_n"),
        ("--output=rpm", "rpm"),
    ] {
        stand.run(&format!("import log.csv --excitation step {option} --out {response}"));
        assert!(stand.read(&format!("{response}/experiment.toml")).contains(&format!("output = \"{response}\"")));
        std::fs::remove_dir_all(stand.path(response)).unwrap();
    }
    let wrong = stand.command("identify log.csv --excitation step --output model.toml").output().unwrap();
    assert_eq!(wrong.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("where a file goes is said by '--out'"), "{wrong:?}");
    // Where a command for the folder of a log is proposed, it has what was typed.
    stand.run("report log.csv --excitation step --output rpm --no-diagnosis --out report.html");
    let import = "rotorlead import log.csv --excitation step --output rpm --out stand";
    assert!(without_tags(&stand.read("report.html")).contains(import));
    stand.refuses("identify log.csv --output model.toml", 2, &["--response", "thrust, rpm"]);
    for command in ["identify", "import", "compare", "report"] {
        let help = stand.run(&format!("{command} --help"));
        assert!(help.contains("--response <RESPONSE>") && !help.contains("--output "), "{help}");
    }
    let stand = Stand::new();
    for command in ["design model.toml --output c.toml", "simulate model.toml --output sim"] {
        stand.refuses(command, 2, &["'--output <FILE>'", "similar argument exists: '--out'"]);
    }
}

#[test]
fn a_period_is_called_the_same_wherever_one_is_given() {
    let stand = Stand::new();
    for command in ["excite", "import", "identify", "device record"] {
        let help = stand.run(&format!("{command} --help"));
        assert!(help.contains("--period <") && !help.contains("--period-s"), "{help}");
    }
    for option in ["--period 2", "--period-s 2"] {
        let import = format!("import stand/step.csv --excitation step {option} --out bench");
        stand.refuses(&import, 2, &["--period goes with --excitation multisine"]);
    }
}
