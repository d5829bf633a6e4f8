//! From a plan or a log to bandwidths, and what is said on the way.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::gallery;
use crate::stand::{Stand, report, table_1};

const LOGS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/records/tests/data");

/// A stand on which the plan was simulated, as `sim`.
fn simulated() -> Stand {
    let stand = Stand::new();
    stand.run("simulate --model model.toml --plan plan.toml --out sim");
    stand
}

fn keys(value: &Value) -> BTreeSet<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

#[track_caller]
fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("`{key}` is no number in {value:#}"))
}

#[track_caller]
fn near(value: f64, expected: f64, relative: f64) {
    assert!((value / expected - 1.0).abs() < relative, "{value} is not {expected} within {relative}");
}

#[test]
fn a_simulated_stand_is_identified_compensated_and_predicted() {
    let stand = simulated();
    let found = stand.json("identify sim --out found.toml");
    let point = &found["points"][0];
    // The plan's noise leaves a standard error of 0.4 % of the time constant: three of them.
    near(number(point, "time_constant_s"), 0.06, 0.015);
    near(number(point, "gain"), 7.1, 0.015);
    let compensator = stand.json("design --kind lead --model found.toml --out c.toml");
    near(number(&compensator, "zero_rad_s") * number(point, "time_constant_s"), 1.0, 1e-12);
    let with_file = stand.json("bandwidth --model found.toml --compensator c.toml");
    let without = stand.json("bandwidth --model found.toml");
    assert_eq!(with_file, without, "a compensator is designed as `design` does where none is given");
    assert_eq!(with_file["points"], compensator["points"]);
    let bandwidth = &with_file["points"][0];
    // 3 dB exactly: sqrt(10^0.3 - 1) / tau.
    let uncompensated = (10f64.powf(0.3) - 1.0).sqrt() / number(point, "time_constant_s");
    near(number(bandwidth, "uncompensated_rad_s"), uncompensated, 1e-6);
    assert!(number(bandwidth, "compensated_rad_s") > 4.0 * uncompensated);
    // Compensated, the stand can be run again, and carries its compensator.
    stand.run("simulate --model model.toml --plan plan.toml --compensator c.toml --out led");
    assert_eq!(stand.read("led/compensator.toml"), stand.read("c.toml"));
    assert!(stand.read("led/experiment.toml").contains("compensated = true"));
    stand.run("validate led --model found.toml");
}

#[test]
fn a_log_is_imported_identified_compensated_and_predicted() {
    for (log, time_constant_s, nominal) in [("rcbenchmark.csv", 0.040, 0.3), ("esc32.csv", 0.035, 0.2)] {
        let stand = Stand::new();
        let found = stand.json(&format!("import {LOGS}/{log} --out imported"));
        assert!(number(&found["logs"][0], "rows_taken") > 100.0);
        let found = stand.json("identify imported --out found.toml");
        let point = &found["points"][0];
        assert_eq!(number(point, "nominal"), nominal);
        // How the samples were made; the rows are 7 and 10 ms apart.
        near(number(point, "time_constant_s"), time_constant_s, 0.02);
        stand.run("design --kind lead --model found.toml --out c.toml");
        let bandwidth = stand.json("bandwidth --model found.toml --compensator c.toml");
        let bandwidth = &bandwidth["points"][0];
        assert!(number(bandwidth, "compensated_rad_s") > 4.0 * number(bandwidth, "uncompensated_rad_s"));
        let validated = stand.json("validate imported --model found.toml");
        assert!(number(&validated["records"][0], "fit_percent") > 90.0);
    }
}

#[test]
fn the_json_of_identify_has_the_keys_that_programs_rely_on() {
    let found = simulated().json("identify sim --out found.toml");
    let points = found["points"].as_array().unwrap();
    assert_eq!(points.len(), 1);
    for key in [
        "nominal",
        "gain",
        "gain_std",
        "time_constant_s",
        "time_constant_s_std",
        "delay_s",
        "fit_frequency_percent",
        "fit_square_percent",
    ] {
        assert!(number(&points[0], key).is_finite());
    }
    let (point, intervals) = (&points[0], &found["intervals"][0]);
    for key in ["gain", "time_constant_s"] {
        let (low, high) = (number(&intervals[key], "low"), number(&intervals[key], "high"));
        let reach = 0.5 * (high - low) / number(point, &format!("{key}_std"));
        // Student's t: 1.96 and more.
        assert!((low..high).contains(&number(point, key)) && (1.959..2.3).contains(&reach), "{key}: {intervals}");
        assert!(number(&intervals[key], "degrees_of_freedom") >= 11.0, "{key}: {intervals}");
    }
    // What a step record does not show is null, not absent.
    let found = Stand::new();
    found.run(&format!("import {LOGS}/esc32.csv --out imported"));
    let point = &found.json("identify imported --out found.toml")["points"][0];
    assert_eq!((&point["fit_frequency_percent"], &point["fit_square_percent"]), (&Value::Null, &Value::Null));
    assert!(keys(point).contains("fit_frequency_percent"));
    assert!(number(point, "fit_step_percent") > 90.0);
}

#[test]
fn a_dead_time_is_fitted_always_never_or_where_the_records_show_one() {
    let stand = Stand::new();
    stand.edit("model.toml", "time_constant_s = 0.06", "time_constant_s = 0.06\ndelay_s = 0.01");
    stand.run("simulate --model model.toml --plan plan.toml --out late");
    let delay_s = |arguments: &str| {
        number(&stand.json(&format!("identify {arguments} --out found.toml"))["points"][0], "delay_s")
    };
    assert_eq!(delay_s("late --delay none"), 0.0);
    near(delay_s("late --delay fit"), 0.01, 0.1);
    near(delay_s("late"), 0.01, 0.1);
    stand.edit("model.toml", "delay_s = 0.01", "delay_s = 0.0");
    stand.run("simulate --model model.toml --plan plan.toml --out prompt");
    assert_eq!(delay_s("prompt"), 0.0);
    // The noise alone: a standard error is 0.3 ms.
    assert!(delay_s("prompt --delay fit") < 0.001);
}

#[test]
fn the_json_of_bandwidth_has_the_keys_that_programs_rely_on() {
    let stand = Stand::new();
    let json = stand.json("bandwidth --model model.toml");
    let points = json["points"].as_array().unwrap();
    assert_eq!(points.len(), 2);
    for point in points {
        let with_both = ["rad_s", "phase_deg", "minus_90_rad_s"]
            .into_iter()
            .flat_map(|key| ["uncompensated", "compensated"].map(|which| format!("{which}_{key}")));
        let expected: Vec<String> = with_both.chain(["nominal", "dead_time_s"].map(str::to_owned)).collect();
        assert_eq!(keys(point), expected.iter().map(String::as_str).collect());
        assert!(number(point, "nominal") > 0.0);
        assert!(number(point, "compensated_rad_s") > number(point, "uncompensated_rad_s"));
    }
}

#[test]
fn text_and_json_give_the_same_numbers() {
    let stand = simulated();
    let text = stand.run("bandwidth --model model.toml --json b.json");
    let json: Value = serde_json::from_str(&stand.read("b.json")).unwrap();
    for point in json["points"].as_array().unwrap() {
        let row = format!("{:.3}", number(point, "nominal"));
        let cells: Vec<&str> = text.lines().find(|line| line.contains(&row)).unwrap().split_whitespace().collect();
        for (cells, which) in cells[1..].chunks(3).zip(["uncompensated", "compensated"]) {
            assert_eq!(cells[0], format!("{:.4}", number(point, &format!("{which}_rad_s"))));
            assert_eq!(cells[1], format!("{:.1}", number(point, &format!("{which}_phase_deg"))));
            assert_eq!(cells[2], format!("{:.2}", number(point, &format!("{which}_minus_90_rad_s"))));
        }
    }
    let text = stand.run("identify sim --out found.toml --json i.json");
    let json: Value = serde_json::from_str(&stand.read("i.json")).unwrap();
    let point = &json["points"][0];
    for part in [
        format!("{:.3} +- {:.3}", number(point, "gain"), number(point, "gain_std")),
        format!("{:.2} +- {:.2}", 1e3 * number(point, "time_constant_s"), 1e3 * number(point, "time_constant_s_std")),
        format!("{:.2}", number(point, "fit_frequency_percent")),
        format!("{:.2}", number(point, "fit_square_percent")),
    ] {
        assert!(text.contains(&part), "no `{part}` in:\n{text}");
    }
    let text = stand.run("validate sim --model found.toml --json v.json --verbose");
    let json: Value = serde_json::from_str(&stand.read("v.json")).unwrap();
    for record in json["records"].as_array().unwrap() {
        let file = record["file"].as_str().unwrap();
        let row = text.lines().find(|line| line.contains(file)).unwrap();
        assert!(row.contains(&format!("{:.2}", number(record, "fit_percent"))), "{row}");
    }
    let text = stand.run("design --kind lead --model found.toml --out c.toml --json d.json");
    let json: Value = serde_json::from_str(&stand.read("d.json")).unwrap();
    assert!(text.contains(&format!("{:.4}", number(&json, "zero_rad_s"))));
    assert!(text.contains(&format!("{:.4}", number(&json, "pole_rad_s"))));
}

#[test]
fn verbose_adds_the_detail_alone_and_json_has_it_in_any_case() {
    let stand = simulated();
    stand.run("identify sim --out found.toml");
    for (command, detail) in [
        ("identify sim --out found.toml", "Noise and distortion"),
        ("validate sim --model found.toml", "Fit of each record"),
        ("design --kind lead --model found.toml --out c.toml", "pole radius"),
    ] {
        // From here on it replaces what it has written.
        stand.run(command);
        let (short, json) = (stand.run(&format!("{command} --json a.json")), stand.read("a.json"));
        let long = stand.run(&format!("{command} --json b.json --verbose"));
        assert!(!short.contains(detail) && long.contains(detail), "{command}:\n{long}");
        // Below the text, and above what is printed last.
        let common = short.bytes().zip(long.bytes()).take_while(|(short, long)| short == long).count();
        assert!(long.as_bytes().ends_with(&short.as_bytes()[common..]), "{command}:\n{long}");
        assert_eq!(stand.read("b.json"), json, "{command}");
    }
}

#[test]
fn a_seed_decides_the_noise_and_nothing_else() {
    let stand = Stand::new();
    let simulate = |seed: &str, out: &str| {
        stand.run(&format!("simulate --model model.toml --plan plan.toml {seed} --out {out}"));
        ["experiment.toml", "u050_multisine.csv", "u050_square.csv"].map(|file| stand.read(&format!("{out}/{file}")))
    };
    let plans_own = simulate("", "a");
    assert_eq!(plans_own, simulate("--seed 1", "b"));
    let other = simulate("--seed 2", "c");
    assert_eq!(plans_own[0], other[0]);
    let columns = |text: &str, kept: &[usize]| -> Vec<String> {
        let cells = |line: &str| kept.iter().map(|&column| line.split(',').nth(column).unwrap().to_owned()).collect();
        text.lines().flat_map(|line| -> Vec<String> { cells(line) }).collect()
    };
    for file in [1, 2] {
        assert_eq!(columns(&plans_own[file], &[0, 1]), columns(&other[file], &[0, 1]), "time and command");
        let (thrust, other) = (columns(&plans_own[file], &[2]), columns(&other[file], &[2]));
        let same = thrust.iter().zip(&other).skip(1).filter(|(a, b)| a == b).count();
        assert_eq!(same, 0, "of {} rows", thrust.len());
    }
}

#[test]
fn the_same_arguments_give_the_same_excitation() {
    let stand = Stand::new();
    let excite = |arguments: &str| {
        let json = stand.json(&format!("excite --band 0.1..2 --rate 100 --starts 1 --out e.csv {arguments}"));
        (json, stand.read("e.csv"))
    };
    let (json, csv) = excite("");
    assert_eq!((json.clone(), csv.clone()), excite("--seed 1"));
    let commands: Vec<f64> = csv.lines().skip(1).map(|row| row.split(',').nth(1).unwrap().parse().unwrap()).collect();
    assert_eq!(commands.len(), 1000);
    let peak = commands.iter().map(|command| (command - 0.5).abs()).fold(0.0, f64::max);
    assert!(peak <= 0.05 + 1e-12 && peak > 0.045, "{peak}");
    assert_eq!(json["lines"], 10);
    assert!(number(&json, "crest_factor") < 2.0);
}

#[test]
fn detection_multisines_are_written_by_realization_and_identify_prints_what_they_show() {
    let stand = Stand::new();
    let json = stand.json("excite --detection --band 0.1..2 --rate 100 --realizations 2 --out d.csv");
    assert_eq!(json["lines"], 8);
    assert_eq!(json["skipped_hz"].as_array().unwrap().len(), 2);
    assert_eq!(json["realizations"].as_array().unwrap().len(), 2);
    assert_ne!(stand.read("d_1.csv"), stand.read("d_2.csv"));
    assert!(!stand.path("d.csv").exists());

    stand.edit("plan.toml", "lines = 150", "lines = 150\nrealization = 2");
    stand.run("simulate --model model.toml --plan plan.toml --out run");
    let text = stand.run("identify run --out found.toml --json found.json --verbose");
    assert!(text.contains("noise (dB)") && !text.contains("skips some"), "{text}");
    let json: Value = serde_json::from_str(&stand.read("found.json")).unwrap();
    let level = &json["distortion"][0];
    assert_eq!((level["even"]["lines"].clone(), level["odd"]["lines"].clone()), (149.into(), 37.into()));
    assert_eq!((level["even"]["seen"].clone(), level["odd"]["seen"].clone()), (false.into(), false.into()));
    assert!(number(level, "noise_db") < -20.0);
}

#[test]
fn the_demo_prints_the_papers_tables_and_leaves_its_files() {
    let demo = gallery::case("demo");
    let text = &demo.text;
    for part in ["Table 1", "Table 2", "Table 3", "0.1 dB moves the bandwidth", "demo-out"] {
        assert!(text.contains(part), "no `{part}` in:\n{text}");
    }
    // What came out comes last, before the list of what was drawn.
    let place = |part: &str| text.find(part).unwrap_or_else(|| panic!("no `{part}` in:\n{text}"));
    assert!(place("92.5 to 95.1 with the inverse") > place("Model and compensators"));
    let json = demo.json();
    let contradictions = json["contradictions"].to_string();
    assert!(contradictions.contains("133.24") && contradictions.contains("16.6811"), "{contradictions}");
    for (point, (_, gain, pole)) in json["points"].as_array().unwrap().iter().zip(host_tests::TABLE_1) {
        near(number(point, "gain"), gain, 0.02);
        near(number(point, "time_constant_s"), 1.0 / pole, 0.02);
    }
    let bandwidths = json["bandwidth"].as_array().unwrap();
    assert_eq!(bandwidths.len(), 6);
    for row in bandwidths {
        for column in 0..2 {
            let simulated = row["simulated_rad_s"][column].as_f64().unwrap();
            let paper = row["paper"]["simulated_rad_s"][column].as_f64().unwrap();
            assert!((simulated - paper).abs() < 1e-3, "{row:#}");
        }
        // Where the response is level near -3 dB the noise leaves intervals of +- 4 %.
        near(row["measured_rad_s"][1].as_f64().unwrap(), number(row, "predicted_compensated_rad_s"), 0.1);
    }
    let stand = Stand::new();
    for file in ["model.toml", "compensator.toml", "bode.svg"] {
        let content = std::fs::read(demo.wrote("demo-out").join(file)).unwrap();
        assert!(!content.is_empty(), "{file}");
        stand.write(file, content);
    }
    stand.run("bandwidth --model model.toml --compensator compensator.toml");
}

#[test]
fn bandwidth_gives_both_simulated_columns_of_the_papers_table_3() {
    let stand = Stand::new();
    stand.write("paper.toml", table_1());
    let printed = [
        (6.2609, 8.0404),
        (7.3349, 10.8166),
        (9.2668, 24.5323),
        (9.8895, 41.4026),
        (11.7161, 74.6290),
        (14.0940, 94.1039),
    ];
    let found = stand.json("bandwidth --model paper.toml");
    for (point, (uncompensated, compensated)) in found["points"].as_array().unwrap().iter().zip(printed) {
        assert!((number(point, "uncompensated_rad_s") - uncompensated).abs() < 1e-3, "{point}");
        assert!((number(point, "compensated_rad_s") - compensated).abs() < 1e-3, "{point}");
    }
    // What runs differs by the lag of its holds: by at most 0.2 %.
    let sampled = stand.json("bandwidth --model paper.toml --sampled --esc-frame 600");
    for (point, (_, compensated)) in sampled["points"].as_array().unwrap().iter().zip(printed) {
        near(number(point, "compensated_rad_s"), compensated, 0.002);
    }
}

/// Equation (10) prints 66.62 s where (3) with (4) needs 133.24: zero 8876.60 / 628.46, poles sqrt(8876.60), damping
/// 66.62 / (2 sqrt(8876.60)). The bandwidth at 0.50 would be 111.8 rad/s, where Table 3 has 24.53.
#[test]
fn equation_10_as_printed_contradicts_table_3() {
    let stand = Stand::new();
    stand.write("paper.toml", table_1());
    let found = stand.json("bandwidth --model paper.toml --lead 14.12437,94.21571,0.353550");
    near(number(&found["points"][2], "compensated_rad_s"), 111.8, 0.0005);
}

#[test]
fn a_motor_too_slow_for_the_papers_lead_gets_the_most_that_it_allows_and_for_more_none() {
    let stand = Stand::new();
    stand.write("slow.toml", "format = 1\n[[point]]\nnominal = 0.5\ngain = 10.0\ntime_constant_s = 0.11\n");
    let design = |options: &str| stand.command(&format!("design --model slow.toml --out c.toml {options}")).assert();
    let message = report(&design("--omega-g 628.3").code(1));
    assert_eq!(message.matches("the L1 gain is").count(), 1, "said once:\n{message}");
    let allowed = message.split("allows is ").nth(1).and_then(|rest| rest.split(' ').next()).expect("a remedy");
    design(&format!("--omega-g {allowed}")).success();
    let omega_g: f64 = allowed.parse().unwrap();
    design(&format!("--omega-g {:.1}", omega_g + 0.2)).code(1);
    // Where none is asked for it is this one, and that is said.
    let found = stand.json("design --kind lead --model slow.toml --out c.toml");
    near(number(&found, "pole_rad_s"), (omega_g / 0.11).sqrt(), 1e-9);
    let said = format!("amplifies up to {allowed} rad/s (omega_g), lower than the paper's 628.3");
    for found in [&found, &stand.json("bandwidth --model slow.toml")] {
        let warnings = found["warnings"].to_string();
        assert!(warnings.contains(&said), "{warnings}");
    }
}

#[test]
fn a_design_on_a_badly_known_pole_says_so_and_where() {
    let stand = Stand::new();
    let point = "[[point]]\nnominal = 0.6\ngain = 7.5\ntime_constant_s = 0.05\ntime_constant_s_std = ";
    for (std, warnings) in [("0.004", 0), ("0.006", 1)] {
        stand.write("model.toml", format!("{}{point}{std}\n", crate::stand::MODEL));
        let json = stand.json("design --kind lead --model model.toml --out c.toml");
        let found: Vec<&str> = json["warnings"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
        assert_eq!(found.len(), warnings, "{json:#}");
        assert!(
            found.iter().all(|warning| warning.starts_with("the zero stands on the pole at u_nom 0.600")),
            "{found:?}"
        );
        let text = stand.run("design --kind lead --model model.toml --out c.toml");
        assert!(text.contains("u_nom 0.600 +- "), "{text}");
        assert_eq!(text.contains("warning: the zero stands on the pole at u_nom 0.600"), warnings == 1, "{text}");
    }
}

#[test]
fn the_bandwidth_rises_on_compensated_records_as_predicted() {
    let stand = Stand::new();
    stand.run("design --kind lead --model model.toml --out compensator.toml");
    stand.run("simulate --model model.toml --plan plan.toml --out before");
    stand.run("simulate --model model.toml --plan plan.toml --compensator compensator.toml --out after");
    let command = "bandwidth --model model.toml --compensator compensator.toml --records before --records after";
    let found = stand.json(command);
    let predicted = &found["points"][1];
    let measured = found["measured"].as_array().unwrap();
    assert_eq!(measured.len(), 2, "the squares have no response to measure");
    assert_eq!((&measured[0]["compensated"], &measured[1]["compensated"]), (&Value::Bool(false), &Value::Bool(true)));
    near(number(&measured[0], "bandwidth_rad_s"), number(predicted, "uncompensated_rad_s"), 0.02);
    near(number(&measured[1], "bandwidth_rad_s"), number(predicted, "compensated_rad_s"), 0.02);
    let text = stand.run(command);
    assert!(text.contains("0.1 dB moves its bandwidth by a tenth"), "{text}");
}

/// The staircase sample, cut into a command log and a response log whose clock is 0.8 s behind and 300 ppm fast.
fn recorded_apart() -> Stand {
    let stand = Stand::new();
    stand.run(&format!("import {LOGS}/rcbenchmark.csv --out imported"));
    let table = stand.read("imported/rcbenchmark.csv");
    let header: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let column = |name: &str| header.iter().position(|cell| *cell == name).unwrap();
    let (time, command, rpm) = (column("time_s"), column("command"), column("rpm"));
    let (mut commands, mut responses) = (String::from("time_s,command\n"), String::from("time_s,rpm\n"));
    for line in table.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let t: f64 = cells[time].parse().unwrap();
        commands.push_str(&format!("{t},{}\n", cells[command]));
        responses.push_str(&format!("{},{}\n", t * 1.0003 + 0.8, cells[rpm]));
    }
    stand.write("command.csv", commands);
    stand.write("imported/rcbenchmark.csv", responses);
    stand
}

#[test]
fn logs_that_were_recorded_apart_are_merged() {
    let whole = Stand::new();
    whole.run(&format!("import {LOGS}/rcbenchmark.csv --out imported"));
    let expected = whole.json("identify imported --out found.toml");
    let stand = recorded_apart();
    let found = stand.json("identify imported --align command.csv --align-within 2 --merged merged --out found.toml");
    let alignment = &found["alignment"][0];
    let delay_s = number(alignment, "delay_s");
    assert!((0.75..0.9).contains(&delay_s), "{alignment:#}");
    assert_eq!(alignment["delay_s_interval"].as_array().unwrap().len(), 2);
    let (point, before) = (&found["points"][0], &expected["points"][0]);
    near(number(point, "time_constant_s"), number(before, "time_constant_s"), 0.05);
    // What was merged is an experiment like any other.
    let again = stand.json("identify merged --out again.toml");
    near(number(&again["points"][0], "time_constant_s"), number(point, "time_constant_s"), 1e-6);
    let text = stand.run("identify imported --align command.csv --align-within 2 --out found.toml");
    for part in ["delay", "95 %", "merged rows", "taken for latency"] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

#[test]
fn a_response_log_without_commands_is_refused_unless_it_is_aligned() {
    let stand = recorded_apart();
    stand.refuses("identify imported --out found.toml", 1, &["column `command` is missing", "rcbenchmark.csv"]);
    let twice = "identify imported --align command.csv --align command.csv --out found.toml";
    stand.refuses(twice, 2, &["--align is given 2 times", "one command log per record"]);
    stand.refuses("identify imported --align nowhere.csv --out found.toml", 1, &["nowhere.csv"]);
    stand.refuses("identify imported --align-within 1 --out found.toml", 2, &["--align"]);
    stand.write("command.csv", "time_s,command\n0,0.3\n1,0.3\n9,0.3\n");
    stand.refuses("identify imported --align command.csv --out found.toml", 1, &["command never changes"]);
}

#[test]
fn the_numbers_behind_the_figures_are_those_of_the_table() {
    let stand = simulated();
    stand.run("identify sim --out found.toml");
    let text = stand.run("validate sim --model found.toml --figures figures --json v.json");
    assert!(text.contains("As good as can be") && text.contains("1 of 2 records were held out"), "{text}");
    let json: Value = serde_json::from_str(&stand.read("v.json")).unwrap();
    let (multisine, square) = (&json["records"][0], &json["records"][1]);
    assert_eq!((&multisine["held_out"], &square["held_out"]), (&Value::Bool(false), &Value::Bool(true)));

    let rows = |file: &str| -> Vec<Vec<f64>> {
        let numbers = |line: &str| line.split(',').map(|cell| cell.parse().unwrap()).collect();
        stand.read(file).lines().skip(1).map(numbers).collect()
    };
    let table = rows("figures/fit_by_nominal.csv");
    let cells = [
        (multisine, "fit_percent"),
        (multisine, "ceiling_percent"),
        (square, "fit_percent"),
        (square, "ceiling_percent"),
    ];
    for (cell, (record, key)) in table[0][1..].iter().zip(cells) {
        near(*cell, number(record, key), 1e-12);
    }
    // Fig. 7 gives the % fit of the square wave.
    let validation_in_time = rows("figures/validation_in_time_u050_square.csv");
    assert_eq!(validation_in_time.len(), 4000);
    let mean = validation_in_time.iter().map(|row| row[1]).sum::<f64>() / 4000.0;
    let spread: f64 = validation_in_time.iter().map(|row| (row[1] - mean).powi(2)).sum();
    let left: f64 = validation_in_time.iter().map(|row| row[3].powi(2)).sum();
    assert!((100.0 * (1.0 - (left / spread).sqrt()) - number(square, "fit_percent")).abs() < 1e-9);
    assert!(validation_in_time.iter().all(|row| (row[1] - row[2] - row[3]).abs() < 1e-12));
    // Fig. 6: the model is the lag itself, and the band of 95 % holds it at most of the 150 lines.
    let validation_in_frequency = rows("figures/validation_in_frequency_u050_multisine.csv");
    assert_eq!(validation_in_frequency.len(), 150);
    let model: toml::Value = toml::from_str(&stand.read("found.toml")).unwrap();
    let point = |key: &str| model["point"][0][key].as_float().unwrap();
    for row in &validation_in_frequency {
        let x = std::f64::consts::TAU * row[0] * point("time_constant_s");
        near(row[9], point("gain") / (1.0 + x * x).sqrt(), 1e-9);
        assert!(row[4] < row[3] && row[3] < row[5] && row[7] < row[6] && row[6] < row[8], "{row:?}");
    }
    let held = validation_in_frequency.iter().filter(|row| (row[4]..=row[5]).contains(&row[9])).count();
    // Smoothed errors hang together over nine lines: some 30 of them are independent.
    assert!((110..=150).contains(&held), "{held}");

    // A second run replaces the files; a file in the folder's place is refused before the work.
    stand.run("validate sim --model found.toml --figures figures");
    stand.refuses("validate sim --model found.toml --figures plan.toml", 1, &["plan.toml"]);
}

#[test]
fn a_wrong_model_is_called_wrong_and_by_how_much() {
    let stand = simulated();
    stand.run("identify sim --out found.toml");
    stand.edit("model.toml", "time_constant_s = 0.06", "time_constant_s = 0.07");
    let text = stand.run("validate sim --model model.toml");
    for part in ["The model does not say what it was fitted to", "leaves more than noise on 2 records", "is off by"] {
        assert!(text.contains(part), "no `{part}` in:\n{text}");
    }
    // A row of the table is as long as the name of its file.
    let mut sentences = text.lines().filter(|line| !line.ends_with(".csv"));
    assert!(sentences.all(|line| line.chars().count() <= 80), "{text}");
}

#[test]
fn repeating_logs_of_far_clocks_are_aligned_where_it_is_said_that_they_start_together() {
    let stand = Stand::new();
    stand.edit("plan.toml", "periods = 2", "periods = 3");
    stand.run("simulate --model model.toml --plan plan.toml --out apart");
    let table = stand.read("apart/u050_multisine.csv");
    let (mut commands, mut responses) = (String::from("time_s,command\n"), String::from("time_s,thrust_n\n"));
    for line in table.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let t: f64 = cells[0].parse().unwrap();
        commands.push_str(&format!("{},{}\n", t + 7000.0, cells[1]));
        responses.push_str(&format!("{},{}\n", t + 0.012, cells[2]));
    }
    let manifest = stand.read("apart/experiment.toml");
    let second = manifest.rfind("[[record]]").unwrap();
    stand.write("apart/experiment.toml", manifest[..second].replace("sample_rate_hz", "# sample_rate_hz"));
    stand.write("apart/u050_multisine.csv", responses);
    stand.write("command.csv", commands);
    let identify = "identify apart --align command.csv --out found.toml";
    stand.refuses(identify, 1, &["explain the logs equally well", "--align-near start"]);
    stand.refuses(&format!("{identify} --align-near start"), 2, &["--align-within"]);
    stand.refuses(&format!("{identify} --align-near soon --align-within 2"), 2, &["`start`"]);
    for near in ["start", "-7000"] {
        let found = stand.json(&format!("{identify} --align-near {near} --align-within 2"));
        // 12 ms, and half a row and half a frame of the ESC.
        let delay_s = number(&found["alignment"][0], "delay_s");
        assert!((delay_s + 6999.988).abs() < 0.003, "{delay_s}");
        near_point(&found);
    }
}

#[track_caller]
fn near_point(found: &Value) {
    near(number(&found["points"][0], "time_constant_s"), 0.06, 0.03);
}
