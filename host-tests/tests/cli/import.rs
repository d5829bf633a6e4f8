//! From the CSV of any logger to an experiment, as a newcomer would.

use std::fs;

use rotorlead_records::{Excitation, Experiment, Output};

use crate::stand::{Stand, flowing};

/// What a stand session leaves: the records of `simulate` in milliseconds, pulse widths and gram-force, in `logs`.
fn session() -> Stand {
    let stand = Stand::new();
    stand.run("simulate --model model.toml --plan plan.toml --out sim");
    fs::create_dir(stand.path("logs")).unwrap();
    let experiment = Experiment::read(&stand.path("sim")).unwrap();
    for record in &experiment.records {
        let thrust = record.thrust_n.as_ref().unwrap();
        let rows = record.time_s.iter().zip(&record.command).zip(thrust);
        let rows: String = rows
            .map(|((t, u), f)| format!("{:.3},{:.3},{:.2}\n", 1e3 * t, 1000.0 + 1000.0 * u, f / 0.009_806_65))
            .collect();
        stand.write(&format!("logs/{}", record.file), format!("Time (ms),ESC signal (us),Thrust [g]\n{rows}"));
    }
    stand
}

const MULTISINE: &str = "import logs/u050_multisine.csv --excitation multisine --period 10 --out bench";
const SQUARE: &str = "import logs/u050_square.csv --excitation square --period 2 --append --out bench";

#[test]
fn records_in_other_units_become_the_experiment_that_they_were() {
    let stand = session();
    let text = stand.run(MULTISINE);
    for part in ["Thrust [g]", "in gf, times 0.00980665", "nominal 0.500 (mean of 2 whole periods)", "Written to bench"]
    {
        assert!(text.contains(part), "no `{part}` in\n{text}");
    }
    let text = stand.run(SQUARE);
    assert!(text.ends_with("\nAdded to bench\n"), "{text}");
    let simulated = Experiment::read(&stand.path("sim")).unwrap();
    let imported = Experiment::read(&stand.path("bench")).unwrap();
    assert_eq!(imported.output, simulated.output);
    assert_eq!(imported.records.len(), 2);
    for (expected, found) in simulated.records.iter().zip(&imported.records) {
        assert_eq!(
            (&found.file, found.nominal, found.excitation),
            (&expected.file, expected.nominal, expected.excitation)
        );
        assert_eq!(found.period_s, expected.period_s);
        let amplitude = (found.amplitude.unwrap(), expected.amplitude.unwrap());
        assert!((amplitude.0 / amplitude.1 - 1.0).abs() < 0.1, "{amplitude:?}");
        let near = |found: &[f64], expected: &[f64], rounding: f64| {
            assert_eq!(found.len(), expected.len());
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() <= 1.001 * rounding, "{found} for {expected}");
            }
        };
        let start = expected.time_s[0];
        let since_start: Vec<f64> = expected.time_s.iter().map(|time| time - start).collect();
        near(&found.time_s, &since_start, 1e-6);
        near(&found.command, &expected.command, 5e-7);
        near(found.thrust_n.as_ref().unwrap(), expected.thrust_n.as_ref().unwrap(), 5e-3 * 0.009_806_65);
    }
    // And it leads to the same motor.
    let point = |folder: &str| {
        let found = stand.json(&format!("identify {folder} --out {folder}.toml"))["points"][0].clone();
        ["gain", "time_constant_s"]
            .map(|key| (found[key].as_f64().unwrap(), found[format!("{key}_std")].as_f64().unwrap()))
    };
    for ((expected, std), (found, _)) in point("sim").into_iter().zip(point("bench")) {
        assert!((found - expected).abs() < 0.5 * std, "{found} for {expected} +- {std}");
    }
    assert_eq!(stand.run("check bench"), stand.run("check sim").replace("sim:", "bench:"));
}

#[test]
fn several_logs_of_one_kind_are_taken_at_once() {
    let stand = session();
    fs::copy(stand.path("logs/u050_multisine.csv"), stand.path("logs/again.csv")).unwrap();
    let files = "logs/u050_multisine.csv logs/again.csv";
    let found = stand.json(&format!("import {files} --excitation multisine --period 10 --name two --out bench"));
    assert_eq!(found["logs"].as_array().unwrap().len(), 2);
    assert_eq!(found["logs"][1]["format"], "plain");
    let experiment = Experiment::read(&stand.path("bench")).unwrap();
    assert_eq!(experiment.name, "two");
    let files: Vec<&str> = experiment.records.iter().map(|record| record.file.as_str()).collect();
    assert_eq!(files, ["u050_multisine.csv", "again.csv"]);
    assert!(experiment.records.iter().all(|record| record.excitation == Excitation::Multisine));
    // Without a name it is the folder's.
    stand.run("import logs/u050_multisine.csv logs/again.csv --excitation multisine --period 10 --out other");
    assert_eq!(Experiment::read(&stand.path("other")).unwrap().name, "other");
}

#[test]
fn numbers_in_another_unit_than_they_are_taken_for_are_doubted_at_once() {
    let stand = session();
    let log = stand.read("logs/u050_multisine.csv");
    let header = log.lines().next().unwrap().to_owned();
    // The same rows with milliseconds that are called seconds.
    stand.write("logs/slow.csv", log.replacen(&header, &header.replace("ms", "s"), 1));
    let import = "import logs/slow.csv --excitation multisine --period 10 --out slow";
    stand.refuses(import, 1, &["rows come every 1 s", "no motor shows in them", "milliseconds by 1000"]);
    // As they should be nothing is doubted.
    assert_eq!(stand.json(MULTISINE)["findings"].as_array().unwrap().len(), 0);
}

#[test]
fn parts_of_one_log_become_records_of_one_experiment() {
    let stand = session();
    let rest = "--excitation square --period 2 --append --out bench";
    stand.run(&format!("import logs/u050_square.csv --seconds 0..2 {rest}"));
    stand.run(&format!("import logs/u050_square.csv --seconds 2..4 {rest}"));
    let experiment = Experiment::read(&stand.path("bench")).unwrap();
    let files: Vec<&str> = experiment.records.iter().map(|record| record.file.as_str()).collect();
    assert_eq!(files, ["u050_square_0s.csv", "u050_square_2s.csv"]);
    assert!(experiment.records.iter().all(|record| record.time_s.len() == 2000 && record.time_s[0] == 0.0));
}

#[test]
fn the_error_of_a_table_without_units_gives_the_line_that_works() {
    let stand = session();
    let header = "Time (ms),ESC signal (us),Thrust [g]";
    stand.edit("logs/u050_square.csv", header, "t,esc,load cell");
    let import = "import logs/u050_square.csv --excitation square --period 2 --out bench";
    stand.refuses(
        import,
        1,
        &[
            "logs/u050_square.csv, line 1: `t` is the time without a unit; no column",
            "the columns are `t`, `esc`, `load cell`",
            "--column time=t:UNIT --column thrust=HEADER:UNIT",
            "thrust in N, gf",
        ],
    );
    let mut command = stand.command(import);
    command.args(["--column", "time=t:ms", "--column", "thrust=load cell:gf"]);
    command.assert().code(0);
    assert_eq!(Experiment::read(&stand.path("bench")).unwrap().records[0].nominal, 0.5);
}

#[test]
fn a_reversed_sign_is_mentioned_and_turned_by_the_option_that_is_said() {
    let stand = session();
    let log = stand.read("logs/u050_square.csv");
    let turned: String = log.lines().map(|line| line.replacen(",-", ",", 1)).collect::<Vec<_>>().join("\n");
    let (header, rows) = turned.split_once('\n').unwrap();
    let rows: String = rows
        .lines()
        .map(|row| {
            let (front, thrust) = row.rsplit_once(',').unwrap();
            format!("{front},-{thrust}\n")
        })
        .collect();
    stand.write("turned.csv", format!("{}\n{rows}", header.replace("Thrust [g]", "thrust_g")));
    let import = "import turned.csv --excitation square --period 2";
    let text = stand.run(&format!("{import} --out wrong")).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(text.contains("turn its sign by `--column thrust=thrust_g:-gf`"), "{text}");
    let text = stand.run(&format!("{import} --column thrust=thrust_g:-gf --out right"));
    assert!(text.contains("sign turned") && !text.contains("below zero"), "{text}");
    let thrust = |folder: &str| Experiment::read(&stand.path(folder)).unwrap().records[0].thrust_n.clone().unwrap();
    assert!(thrust("wrong").iter().zip(thrust("right")).all(|(wrong, right)| *wrong == -right));
}

#[test]
fn what_import_cannot_know_or_do_is_refused() {
    let stand = session();
    let log = "logs/u050_square.csv";
    for (arguments, status, parts) in [
        (
            format!("{log} --out bench"),
            2,
            &["does not say what drove the command", "--excitation KIND", "`multisine`"][..],
        ),
        (format!("{log} --excitation square --out bench"), 2, &["--excitation square needs --period"]),
        (format!("{log} --excitation step --period 2 --out bench"), 2, &["--period goes with --excitation multisine"]),
        (
            format!("{log} --excitation sine --out bench"),
            2,
            &["multisine, square, triangle, step, staircase, chirp, random, steady, flight, free"],
        ),
        (format!("{log} --column time=t:gf --out bench"), 2, &["`gf` is no unit of time: s, ms, us, ns or clock"]),
        (format!("{log} --column time=a:s --column time=b:s --out bench"), 2, &["says twice which column is the time"]),
        (format!("{log} --column time=a:s --column rpm=a:rpm --out bench"), 2, &["`a` is both the time and the rpm"]),
        (format!("{log} --column rpm=speed:rpm --out bench"), 1, &["there is no column `speed`", "`Thrust [g]`"]),
        (format!("{log} --nominal 1.2 --out bench"), 2, &["0 to 1"]),
        (format!("{log} --amplitude 0 --out bench"), 2, &["above 0"]),
        (format!("{log} --seconds 4..2 --out bench"), 2, &["LOW below HIGH"]),
        (format!("{log} --seconds 100..200 --excitation free --out bench"), 1, &["0 row(s) from 100 to 200 s"]),
        (format!("{log} {log} --excitation free --out bench"), 1, &["two records would be called `u050_square.csv`"]),
        (format!("{log} --excitation free --out stand"), 1, &["`stand` exists and is not empty", "--append adds"]),
        (format!("{log} --excitation free --out logs"), 1, &["`logs` exists and is not empty", "give another folder"]),
        (format!("{log} --excitation free --append --out logs"), 1, &["`logs` exists and is not empty"]),
        (format!("{log} --excitation free --append --name x --out stand"), 2, &["--append", "--name"]),
    ] {
        stand.refuses(&format!("import {arguments}"), status, parts);
    }
    stand.run(SQUARE);
    stand.refuses(SQUARE, 1, &["u050_square.csv"]);
    let ulog = concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/records/tests/data/esc_status.ulg");
    let import = format!("import {ulog} --column time=t:s --out other");
    stand.refuses(&import, 2, &["--column does not go with", "esc_status.ulg", "leave --column out"]);
}

#[test]
fn a_log_that_is_given_for_a_folder_leads_to_import() {
    let stand = session();
    for command in ["validate --model model.toml", "diagnose"] {
        stand.refuses(
            &format!("{command} logs/u050_square.csv"),
            1,
            &["`logs/u050_square.csv` is not a folder", "`rotorlead import logs/u050_square.csv --out DIR`"],
        );
    }
    let assert = stand.command("check logs/u050_square.csv").assert().code(1);
    let said = String::from_utf8(assert.get_output().stdout.clone()).unwrap();
    let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(said.contains("`rotorlead import logs/u050_square.csv --out DIR` makes one from a log"), "{said}");
}

/// A log of the second folder of measured data.
fn small_motor(name: &str) -> Option<String> {
    host_tests::real_log(&format!("../sar_simulation/{name}")).map(|file| file.display().to_string())
}

/// What is printed, without line breaks.
fn summary(stand: &Stand, arguments: &str) -> String {
    stand.run(arguments).split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn a_stands_log_with_dshot_and_rad_per_second_is_taken_at_the_first_try() {
    let Some(log) = small_motor("micro_2023-12-17_162234.csv") else { return };
    let stand = Stand::new();
    let text = summary(&stand, &format!("import {log} --out motor"));
    for part in [
        "3706 of 3707 rows taken",
        "19 lines of remarks",
        "DShot: 48..2047 become 0..1, 0 is stop; guessed",
        "the response is the speed: the thrust is in 3313 of 3707 rows alone. `--response thrust` takes the other one",
    ] {
        assert!(text.contains(part), "no `{part}` in {text}");
    }
    let experiment = Experiment::read(&stand.path("motor")).unwrap();
    let record = &experiment.records[0];
    assert_eq!((experiment.output, record.excitation), (Output::Rpm, Excitation::Staircase));
    // Its fastest reading, 4777.2 rad/s.
    let fastest = record.rpm.as_ref().unwrap().iter().copied().fold(0.0, f64::max);
    assert!((fastest * std::f64::consts::PI / 30.0 - 4_777.210_508_8).abs() < 1e-3, "{fastest}");
    // The other response is taken when it is asked for, without the rows that do not have it.
    let text = summary(&stand, &format!("import {log} --response thrust --out thrust"));
    assert!(text.contains("394 rows left out: `Thrust (gf)` is blank"), "{text}");
    assert_eq!(Experiment::read(&stand.path("thrust")).unwrap().output, Output::ThrustN);
}

#[test]
fn an_untared_stand_is_mentioned_and_tared() {
    let Some(log) = small_motor("so_v5_2023-12-13_130935.csv") else { return };
    let stand = Stand::new();
    let import = format!("import {log} --response thrust");
    let at_rest = |folder: &str| {
        let record = Experiment::read(&stand.path(folder)).unwrap().records.remove(0);
        let rest = record.command.iter().take_while(|command| **command == 0.0).count();
        record.thrust_n.unwrap()[..rest].iter().sum::<f64>() / rest as f64
    };
    let text = summary(&stand, &format!("{import} --out raw"));
    assert!(text.contains("thrust at rest is -0.") && text.contains("`--tare` subtracts that"), "{text}");
    assert!(at_rest("raw") < -0.2, "{}", at_rest("raw"));
    let text = summary(&stand, &format!("{import} --tare --out tared"));
    assert!(text.contains("N subtracted from the thrust"), "{text}");
    assert!(at_rest("tared").abs() < 1e-9, "{}", at_rest("tared"));
}

#[test]
fn a_table_of_averages_is_a_static_map() {
    let Some(log) = small_motor("so_v5_steps_2024-02-06_103903.csv") else { return };
    let stand = Stand::new();
    let text = summary(&stand, &format!("import {log} --out map"));
    for part in [
        "51 of 51 rows taken",
        "51 steady points, which give a static map and no lag",
        "they are numbered",
        "differ by",
    ] {
        assert!(text.contains(part), "no `{part}` in {text}");
    }
    let record = Experiment::read(&stand.path("map")).unwrap().records.remove(0);
    assert_eq!((record.excitation, record.time_s.len(), record.time_s[50]), (Excitation::Steady, 51, 50.0));
    assert!(record.thrust_n.is_some() && record.rpm.is_some());
}

#[test]
fn a_log_without_its_command_leads_to_align() {
    let Some(log) = host_tests::real_log("Log_2019-11-05_171350.csv") else { return };
    let stand = Stand::new();
    let log = log.display();
    stand.refuses(
        &format!("import {log} --out motor"),
        1,
        &["empty in all 4814 rows", "`rotorlead import --no-command`", "`rotorlead identify --align LOG`"],
    );
}

const LOGS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/records/tests/data");

#[test]
fn the_chirp_of_an_autopilot_gives_a_model_and_its_frequency_response() {
    let stand = Stand::new();
    let found = stand.json(&format!("import {LOGS}/chirp.bin --out chirp"));
    assert_eq!(found["logs"][0]["format"], "dataflash");
    assert_eq!(found["findings"].as_array().unwrap().len(), 0, "{found:#}");
    let text = stand.run("identify chirp --out model.toml");
    assert!(text.contains("chirp.csv: coherence ") && text.contains("(median) from 0."), "{text}");
    let found = stand.json("identify chirp --out again.toml");
    let point = &found["points"][0];
    // Of the log: 14 rpm per microsecond of 1000, 80 ms, and telemetry that is 30 ms old.
    for (key, truth) in [("gain", 14_000.0), ("time_constant_s", 0.08), ("delay_s", 0.03)] {
        let value = point[key].as_f64().unwrap();
        assert!((value / truth - 1.0).abs() < 0.02, "{key}: {value}");
    }
    let lines = found["frequency_responses"][0]["lines"].as_array().unwrap();
    assert_eq!(found["frequency_responses"][0]["file"], "chirp.csv");
    assert!(lines.len() > 12);
    for line in lines {
        let number = |key: &str| line[key].as_f64().unwrap();
        let (frequency_hz, magnitude, coherence) = (number("frequency_hz"), number("magnitude"), number("coherence"));
        assert!((0.1..16.0).contains(&frequency_hz) && (0.5..=1.0).contains(&coherence), "{line}");
        let (low, high) =
            (line["magnitude_interval"][0].as_f64().unwrap(), line["magnitude_interval"][1].as_f64().unwrap());
        assert!(low < magnitude && magnitude < high, "{line}");
    }
    // Of another sweep, and no chirp of a motor that is asked for.
    stand.run(&format!("import {LOGS}/chirp.bin --log 1 --out first"));
    stand.refuses(&format!("import {LOGS}/chirp.bin --log 3 --out third"), 1, &["no log 3 in it, but 2"]);
    stand.refuses(&format!("import {LOGS}/chirp.bin --motor 1 --out motor"), 1, &["`command` of motor 1", "`RCOU`"]);
    stand.refuses(&format!("import {LOGS}/bench.bin --log 1 --out bench"), 1, &["no log 1 in it, but 0"]);
    stand.refuses(&format!("import {LOGS}/bench.bin --column time=t:s --out bench"), 2, &["it is no table of text"]);
    let bytes = fs::read(format!("{LOGS}/bench.bin")).unwrap();
    let cut = bytes.windows(11).position(|part| part == b"MOT_PWM_MAX").unwrap();
    fs::write(stand.path("open.bin"), [&bytes[..cut], b"x", &bytes[cut + 1..]].concat()).unwrap();
    stand.refuses("import open.bin --out open", 2, &["no parameter says which pulse widths", "--pulse-us LOW..HIGH"]);
    stand.run("import open.bin --pulse-us 1100..1900 --out open");
}

#[test]
fn a_flight_is_refused_and_taken_as_free_alone() {
    let stand = Stand::new();
    stand.refuses(
        &format!("import {LOGS}/blackbox.bbl --out flight"),
        1,
        &["a flight, and no bench run", "`--excitation flight` takes all motors"],
    );
    stand.run(&format!("import {LOGS}/blackbox.bbl --excitation free --out flight"));
    stand.refuses("identify flight --out model.toml", 1, &["free"]);
}

#[test]
fn a_header_that_states_a_wrong_unit_is_named_with_the_option_that_states_another() {
    let stand = session();
    let newtons = fs::read_to_string(stand.path("sim/u050_multisine.csv")).unwrap();
    stand.write("n.csv", newtons.replacen("thrust_n", "thrust_gf", 1).replacen("command", "duty (0..1)", 1));
    let text = flowing(&stand.run("import n.csv --excitation multisine --period 10 --out grams"));
    for part in ["seems to be in another unit than newtons", "it is `thrust_gf` of the log, in gf", "--column"] {
        assert!(text.contains(part), "no `{part}` in\n{text}");
    }
    let text = stand.run("import n.csv --excitation multisine --period 10 --column thrust=thrust_gf:N --out newtons");
    assert!(!text.contains("another unit"), "{text}");
}
