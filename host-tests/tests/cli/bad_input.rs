//! What is wrong is said with the file, the place and the remedy, and nothing is left behind.

use std::fs;

use crate::stand::{MODEL, PLAN, Stand};

const LOGS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/records/tests/data");

/// Commands that read an experiment.
const READ_EXPERIMENT: [&str; 2] = ["identify stand --out found.toml", "validate stand --model model.toml"];

/// Commands that read a model.
const READ_MODEL: [&str; 6] = [
    "design --kind lead --model model.toml --out c.toml",
    "bandwidth --model model.toml",
    "simulate --model model.toml --out sim",
    "validate stand --model model.toml",
    "vehicle --airframe airframe.toml --model model.toml",
    "export --for paparazzi --model model.toml",
];

/// A stand that also has a compensator, `c.toml`.
fn with_compensator() -> Stand {
    let stand = Stand::new();
    stand.run("design --kind lead --model model.toml --out c.toml");
    stand
}

#[test]
fn a_missing_file_is_named() {
    let stand = Stand::new();
    for (arguments, name) in [
        ("identify nowhere --out found.toml", "`nowhere` does not exist"),
        ("identify . --out found.toml", "experiment.toml` does not exist"),
        ("validate nowhere --model model.toml", "`nowhere` does not exist"),
        ("validate stand --model nowhere.toml", "`nowhere.toml` does not exist"),
        ("design --kind lead --model nowhere.toml --out c.toml", "`nowhere.toml` does not exist"),
        ("bandwidth --model nowhere.toml", "`nowhere.toml` does not exist"),
        ("bandwidth --model model.toml --compensator nowhere.toml", "`nowhere.toml` does not exist"),
        ("simulate --model nowhere.toml --out sim", "`nowhere.toml` does not exist"),
        ("simulate --model model.toml --plan nowhere.toml --out sim", "`nowhere.toml` does not exist"),
        ("simulate --model model.toml --compensator nowhere.toml --out sim", "`nowhere.toml` does not exist"),
        ("export --for px4 --model nowhere.toml", "`nowhere.toml` does not exist"),
        ("vehicle --airframe nowhere.toml", "`nowhere.toml` does not exist"),
        ("vehicle --model nowhere.toml", "`nowhere.toml` does not exist"),
        ("import nowhere.csv --out imported", "nowhere.csv"),
    ] {
        let remedy = if arguments.starts_with("identify .") { "rotorlead import" } else { "check the path" };
        stand.refuses(arguments, 1, &[name, remedy]);
    }
    stand.edit("stand/experiment.toml", "step.csv", "stop.csv");
    for arguments in READ_EXPERIMENT {
        stand.refuses(arguments, 1, &["stand/experiment.toml:6:8", "stop.csv"]);
    }
}

#[test]
fn another_kind_of_file_is_named_and_no_key_of_it_is_to_be_removed() {
    let stand = with_compensator();
    stand.write("plan.toml", PLAN);
    let model = ["and a model is needed", "`rotorlead identify` writes a model"];
    let compensator = ["and a compensator is needed", "`rotorlead design` writes a compensator"];
    let airframe = ["and an airframe is needed", "`docs/vehicle.md` has one"];
    let plan = ["and a plan is needed", "`rotorlead new` writes a plan"];
    for (arguments, is, needed) in [
        ("design --kind lead --model c.toml --out x.toml", "this is a compensator", model),
        ("bandwidth --model plan.toml", "this is a plan", model),
        ("vehicle --airframe model.toml", "this is a model", airframe),
        ("vehicle --model airframe.toml", "this is an airframe", model),
        ("validate stand --model stand/experiment.toml", "this is the description of an experiment", model),
        ("simulate --model model.toml --plan model.toml --out sim", "this is a model", plan),
        ("bandwidth --model model.toml --compensator model.toml", "this is a model", compensator),
    ] {
        stand.refuses(arguments, 1, &[is, needed[0], needed[1]]);
    }
}

#[test]
fn gains_of_both_signs_are_not_designed_from() {
    let stand = Stand::new();
    let last = MODEL.rfind("gain = ").unwrap() + "gain = ".len();
    stand.write("model.toml", format!("{}-{}", &MODEL[..last], &MODEL[last..]));
    stand.refuses(
        "design --kind lead --model model.toml --out c.toml",
        1,
        &["wrong sign", "turn the sign", "rotorlead check"],
    );
}

#[test]
fn a_folder_is_not_taken_for_a_file_nor_a_file_for_a_folder() {
    let stand = Stand::new();
    stand.refuses("bandwidth --model stand", 1, &["`stand` is a folder, not a file", "name of a file"]);
    stand.refuses("import stand --out imported", 1, &["stand: it is a folder", "give the logs in it"]);
    stand.refuses("identify model.toml --out m.toml", 1, &["`model.toml` is not a folder", "holds experiment.toml"]);
    stand.refuses("demo --out model.toml", 1, &["`model.toml` is not a folder"]);
}

#[test]
fn a_fault_in_a_record_is_shown_at_its_line_and_column() {
    // Line 12 of the file is the row of 0.1 s: `0.1,0.4,2`.
    for (from, to, parts) in [
        (
            "time_s,command,thrust_n",
            "time_s,thrust_n,rpm",
            &["step.csv:1:1", "column `command` is missing", "add it"][..],
        ),
        ("time_s,command,thrust_n", "time_s,command,thrust", &["step.csv:1:16", "`thrust` is not known", "thrust_n"]),
        ("\n0.1,0.4,2\n", "\n0.1,fast,2\n", &["step.csv:12:5", "line 12, column `command`: `fast`", "plain number"]),
        ("\n0.1,0.4,2\n", "\n0.1,0.4,2 N\n", &["step.csv:12:9", "column `thrust_n`: `2 N`", "without its unit"]),
        ("\n0.1,0.4,2\n", "\n0.1,0.4,\n", &["step.csv:12:9", "the cell is empty", "fill the cell"]),
        ("\n0.1,0.4,2\n", "\n0.1,0.4,NaN\n", &["step.csv:12:9", "line 12, column `thrust_n`", "NaN"]),
        ("\n0.1,0.4,2\n", "\n0.1,0.4,inf\n", &["step.csv:12:9", "line 12, column `thrust_n`", "inf"]),
        ("\n0.1,0.4,2\n", "\n0.1,1.4,2\n", &["step.csv:12:5", "line 12, column `command`", "1.4"]),
        ("\n0.1,0.4,2\n", "\n0.08,0.4,2\n", &["step.csv:12:1", "line 12, column `time_s`", "0.08"]),
        ("\n0.1,0.4,2\n", "\n0.09,0.4,2\n", &["step.csv:12:1", "line 12, column `time_s`", "0.09"]),
        ("\n0.1,0.4,2\n", "\n0.1,0.4\n", &["step.csv:12:1", "line 12: 2 cells", "one cell per column"]),
    ] {
        let stand = Stand::new();
        stand.edit("stand/step.csv", from, to);
        for arguments in READ_EXPERIMENT {
            stand.refuses(arguments, 1, parts);
        }
    }
}

#[test]
fn too_short_a_record_is_refused() {
    for (content, parts) in [
        ("", &["step.csv` is empty", "right file"][..]),
        ("\n\n", &["step.csv` is empty"]),
        ("time_s,command,thrust_n\n", &["step.csv:1:1", "too few rows of numbers: 0"]),
        ("time_s,command,thrust_n\n0,0.4,2\n", &["step.csv:2:1", "too few rows of numbers: 1"]),
    ] {
        let stand = Stand::new();
        stand.write("stand/step.csv", content);
        for arguments in READ_EXPERIMENT {
            stand.refuses(arguments, 1, parts);
        }
    }
}

#[test]
fn a_constant_command_is_refused_whatever_it_is_called() {
    let stand = Stand::new();
    let rows = (0..400).map(|row| format!("{},0.5,{}\n", f64::from(row) / 100.0, 3 + row % 2)).collect::<String>();
    stand.write("stand/step.csv", format!("time_s,command,thrust_n\n{rows}"));
    for excitation in ["step", "staircase", "multisine"] {
        if excitation == "multisine" {
            stand.edit("stand/experiment.toml", "\"staircase\"", "\"multisine\"\nperiod_s = 2.0");
        } else if excitation == "staircase" {
            stand.edit("stand/experiment.toml", "\"step\"\namplitude", "\"staircase\"\namplitude");
        }
        for arguments in READ_EXPERIMENT {
            stand.refuses(arguments, 1, &["`stand`", "step.csv", "command"]);
        }
    }
}

#[test]
fn a_period_that_is_not_whole_is_refused() {
    let stand = Stand::new();
    stand.edit("stand/experiment.toml", "\"step\"\namplitude", "\"multisine\"\nperiod_s = 0.333\namplitude");
    for arguments in READ_EXPERIMENT {
        stand.refuses(arguments, 1, &["`stand`", "step.csv", "0.333 s", "33.3", "not a whole number", "period_s"]);
    }
}

#[test]
fn a_wrong_key_of_an_experiment_is_shown() {
    for (from, to, parts) in [
        ("output", "outptu", &["experiment.toml:4:1", "unknown field `outptu`", "did you mean `output`?"][..]),
        (
            "nominal = 0.4",
            "nominal = \"0.4\"",
            &["experiment.toml:7:11", "`nominal`: a text in quotes where a number", "without quotes"],
        ),
        ("nominal = 0.4", "nominal = nan", &["experiment.toml:7:11", "`nominal`"]),
        ("nominal = 0.4", "nominal = 1.4", &["experiment.toml:7:11", "`nominal`", "0 to 1"]),
        ("name = \"step\"\n", "", &["experiment.toml", "missing field `name`", "add `name`"]),
        ("output = \"thrust_n\"", "output = \"thrust\"", &["experiment.toml:4:10", "thrust_n"]),
        ("\"step\"\namp", "\"multisine\"\namp", &["experiment.toml", "period_s"]),
        ("format = 1", "format = 1\nsample_rate_hz = 50", &["step.csv", "100", "sample_rate_hz"]),
        ("format = 1", "format = 1\nsample_rate_hz = -50", &["experiment.toml:2:18", "above 0"]),
        ("step.csv", "../step.csv", &["experiment.toml:6:8", "without `..`"]),
    ] {
        let stand = Stand::new();
        stand.edit("stand/experiment.toml", from, to);
        for arguments in READ_EXPERIMENT {
            stand.refuses(arguments, 1, parts);
        }
    }
}

#[test]
fn a_wrong_key_of_a_model_is_shown_by_every_command_that_reads_one() {
    for (from, to, parts) in [
        ("gain = 6.2", "gian = 6.2", &["model.toml:4:1", "unknown field `gian`", "did you mean `gain`?"][..]),
        (
            "gain = 6.2",
            "gain = \"6.2\"",
            &["model.toml:4:8", "`gain`: a text in quotes where a number", "without quotes"],
        ),
        ("gain = 6.2", "gain = inf", &["model.toml:4:8", "`point` 1, `gain`", "finite"]),
        ("gain = 6.2\n", "", &["model.toml", "missing field `gain`", "add `gain`"]),
        ("= 0.08", "= 0", &["model.toml:5:19", "`point` 1, `time_constant_s`", "above 0"]),
        ("= 0.08", "= -0.08", &["model.toml:5:19", "`point` 1, `time_constant_s`", "above 0"]),
        ("= 0.08", "= nan", &["model.toml:5:19", "`point` 1, `time_constant_s`", "above 0"]),
        ("nominal = 0.4", "nominal = 0.6", &["model.toml:7:11", "`point` 2, `nominal`"]),
        (MODEL, "format = 1\n", &["model.toml", "the model has no point", "rotorlead identify"]),
        (MODEL, "format = 1\npoint = 3\n", &["model.toml:2:9", "`point`: a whole number where a list"]),
        (MODEL, " \n", &["`model.toml` is empty"]),
        ("format = 1", "format = 7", &["model.toml:1:10", "layout 7"]),
        ("gain = 6.2", "gain = = 6.2", &["model.toml:4:8", "TOML is `key = value`"]),
    ] {
        let stand = Stand::new();
        stand.edit("model.toml", from, to);
        for arguments in READ_MODEL {
            stand.refuses(arguments, 1, parts);
        }
    }
}

#[test]
fn a_wrong_plan_is_shown() {
    for (from, to, parts) in [
        ("seed = 1", "sede = 1", &["plan.toml:3:1", "unknown field `sede`", "did you mean `seed`?"][..]),
        ("seed = 1", "seed = \"one\"", &["plan.toml:3:8", "`seed`: a text in quotes where a whole number"]),
        ("seed = 1", "seed = 1\nsample_rate_hz = 999", &["plan.toml:4:18", "does not divide loop_rate_hz", "divisor"]),
        ("nominal = 0.5", "nominal = 0.9", &["plan.toml:8:11", "`record` 1, `nominal`", "from 0.4 to 0.5", "identify"]),
        ("nominal = 0.5", "nominal = nan", &["plan.toml:8:11", "`record` 1, `nominal`"]),
        ("periods = 2", "periods = 2000000", &["plan.toml", "`record` 1, `periods`"]),
        ("esc_frame_hz = 600", "esc_frame_hz = -600", &["plan.toml:4:16", "above 0"]),
        ("sigma_n = 0.02", "sigma_n = -1", &["plan.toml:6:11", "sigma_n"]),
        ("seed = 1", "seed = 1\ncompensator = \"c.toml\"", &["`c.toml` does not exist"]),
        (PLAN, "", &["`plan.toml` is empty"]),
        (PLAN, "format = 1\nname = \"\"\nseed = 1\n", &["plan.toml", "no records to run", "add a [[record]]"]),
    ] {
        let stand = Stand::new();
        stand.edit("plan.toml", from, to);
        stand.refuses("simulate --model model.toml --plan plan.toml --out sim", 1, parts);
    }
}

#[test]
fn a_plan_at_another_rate_than_its_compensator_is_refused() {
    let stand = with_compensator();
    stand.edit("plan.toml", "seed = 1", "seed = 1\nloop_rate_hz = 4000");
    let arguments = "simulate --model model.toml --plan plan.toml --compensator c.toml --out sim";
    stand.refuses(arguments, 1, &["`plan.toml`", "5000 Hz", "4000", "design the compensator for the plan's loop rate"]);
}

#[test]
fn a_wrong_compensator_is_shown() {
    for (key, value, parts) in [
        ("k", "1", &["1 is stored, but the parameters give", "run `rotorlead design` again"][..]),
        ("zero_rad_s", "16.0", &["is stored, but the parameters give", "changed by hand"]),
        ("loop_rate_hz", "4000.0", &["is stored, but the parameters give"]),
        ("zero_rad_s", "1e5", &["`zero_rad_s`", "zero below its poles"]),
        ("damping", "nan", &["`damping`", "above 0"]),
        ("damping", "\"1\"", &["a text in quotes where a number"]),
        ("damping", "9.0", &["no filter can be made of these parameters", "damping", "rotorlead design"]),
        ("k", "1.5", &["`k`: a number with decimals where a whole number"]),
        ("k", "1\nq = 2", &["unknown field `q`", "remove `q`"]),
        ("signal_format", "\"f32\"", &["`f32`", "`q2.29`"]),
    ] {
        let stand = with_compensator();
        let text = stand.read("c.toml");
        let lines = text.lines().map(|line| match line.split_once(" = ") {
            Some((found, _)) if found == key => format!("{key} = {value}\n"),
            _ => format!("{line}\n"),
        });
        let edited: String = lines.collect();
        assert_ne!(edited, text, "{key} is no key of:\n{text}");
        stand.write("c.toml", edited);
        for arguments in [
            "bandwidth --model model.toml --compensator c.toml",
            "simulate --model model.toml --plan plan.toml --compensator c.toml --out sim",
        ] {
            stand.refuses(arguments, 1, parts);
            stand.refuses(arguments, 1, &["c.toml:"]);
        }
    }
}

#[test]
fn a_damaged_log_is_refused_at_its_line_and_column() {
    for (log, line, from, to, parts) in [
        ("esc32.csv", 12, ",15,4", ",fast,4", &["line 12, column `Duty`: `fast`", "correct the value"][..]),
        ("esc32.csv", 12, ",15,4", ",NaN,4", &["line 12, column `Duty`: `NaN`", "delete the row"]),
        ("esc32.csv", 12, ",15,4", ",150,4", &["line 12, column `Duty`", "150"]),
        ("esc32.csv", 1, "RPM", "Speed", &["line 1", "column `RPM` is missing", "record the log again"]),
        ("esc32.csv", 9, "2019-11-07 ", "yesterday ", &["line 9, column `Timestamp`", "YYYY-MM-DD"]),
        ("esc32.csv", 100, "23:45:59", "23:45:58", &["line 100", "backwards", "two logs"]),
        ("rcbenchmark.csv", 30, ",5000,", ",fast,", &["line 30, column `Motor Electrical Speed (RPM)`: `fast`"]),
        ("rcbenchmark.csv", 60, ",1200,", ",,", &["line 60, column `ESC signal (µs)`: empty", "delete the row"]),
        (
            "rcbenchmark.csv",
            1,
            "ESC signal",
            "Signal",
            &["line 1: no column is known to be the command", "command=HEADER:UNIT"],
        ),
    ] {
        let stand = Stand::new();
        let text = fs::read_to_string(format!("{LOGS}/{log}")).unwrap();
        let mut lines: Vec<String> = text.lines().map(String::from).collect();
        assert!(lines[line - 1].contains(from), "{}", lines[line - 1]);
        lines[line - 1] = lines[line - 1].replacen(from, to, 1);
        stand.write("log.csv", lines.join("\n"));
        stand.refuses("import log.csv --out imported", 1, parts);
        stand.refuses("import log.csv --out imported", 1, &["log.csv"]);
    }
}

#[test]
fn what_is_no_log_is_refused() {
    let header = fs::read_to_string(format!("{LOGS}/esc32.csv")).unwrap();
    let header = header.lines().next().unwrap();
    for (content, parts) in [
        (&b""[..], &["the file is empty", "export the log again"][..]),
        (
            b"a,b,c\n1,2,3\n",
            &["line 1: no column is known to be the time", "`a`, `b`, `c`", "--column time=HEADER:UNIT"],
        ),
        (b"nothing\nbut words\n", &["no line of it has two numbers", "nothing", "RCbenchmark", "ESC32"]),
        (header.as_bytes(), &["0 usable row(s)", "recording"]),
        (
            b"\x7fELF\x02\x01\x00\xff\xfe\x80garbage",
            &["line 1: the byte 0x00 belongs in no text", "export it as one of these"],
        ),
    ] {
        let stand = Stand::new();
        stand.write("log.csv", content);
        stand.refuses("import log.csv --out imported", 1, parts);
        stand.refuses("import log.csv --out imported", 1, &["log.csv"]);
    }
}

#[test]
fn a_destination_that_is_in_the_way_or_nowhere_is_refused() {
    let log = format!("{LOGS}/esc32.csv");
    let stand = Stand::new();
    for arguments in [format!("import {log}"), "simulate --model model.toml".into()] {
        let into = |out: &str| format!("{arguments} --out {out}");
        stand.refuses(&into("stand"), 1, &["`stand` exists and is not empty", "give another folder"]);
        stand.refuses(&into("no/where"), 1, &["`no/where`", "there is no folder `no`", "create that folder first"]);
        stand.refuses(&into("plan.toml"), 1, &["`plan.toml` is not a folder"]);
        stand.refuses(&into("."), 1, &["`.`", "name of a new folder"]);
    }
    for arguments in ["identify stand", "design --kind lead --model model.toml", "excite --band 0.1..2 --rate 100"] {
        let into = |out: &str| format!("{arguments} --out {out}");
        stand.refuses(&into("no/where.toml"), 1, &["`no/where.toml`", "there is no folder `no`"]);
        stand.refuses(&into("stand"), 1, &["`stand` is a folder, not a file", "name of a file"]);
    }
    stand.refuses("demo --out no/where", 1, &["`no/where`", "there is no folder `no`"]);
}

#[test]
fn json_that_cannot_be_written_is_said_before_anything_else_is() {
    let log = format!("{LOGS}/esc32.csv");
    let stand = Stand::new();
    for arguments in [
        "identify stand --out found.toml",
        "validate stand --model model.toml",
        "design --kind lead --model model.toml --out c.toml",
        "bandwidth --model model.toml",
        "vehicle",
        "simulate --model model.toml --out sim",
        "excite --out e.csv",
        "demo --out demo",
        &format!("import {log} --out imported"),
    ] {
        let json = |file: &str| format!("{arguments} --json {file}");
        stand.refuses(&json("no/where.json"), 1, &["`no/where.json`", "there is no folder `no`"]);
        stand.refuses(&json("stand"), 1, &["`stand` is a folder, not a file"]);
    }
    stand.refuses(
        "design --kind lead --model model.toml --out c.toml --json c.toml",
        2,
        &["--json and --out", "`c.toml`"],
    );
}

#[test]
fn options_that_make_no_sense_are_wrong_use() {
    let stand = Stand::new();
    for (arguments, part) in [
        ("excite --band 30..0.1", "LOW below HIGH"),
        ("excite --band -3..10", "--band"),
        ("excite --band 0.1", "--band"),
        ("excite --band nan..3", "--band"),
        ("excite --band 0.01..0.02", "odd multiple"),
        ("excite --rate -3", "above 0"),
        ("excite --rate 0", "above 0"),
        ("excite --rate 40", "raise --rate"),
        ("excite --period inf", "above 0"),
        ("excite --period 0.33333", "whole number"),
        ("excite --period 1e200", "from 0.0001 to 100000"),
        ("excite --period 1e5 --rate 1e6", "shorten --period"),
        ("excite --amplitude 0.6", "--nominal 0.5"),
        ("excite --nominal 1.5", "0 to 1"),
        ("excite --starts 0", "--starts"),
        ("excite --seed -1", "--seed"),
        ("demo --seed -1", "--seed"),
        ("demo --seed 9223372036854775808", "--seed"),
        ("simulate --model model.toml --out sim --seed one", "--seed"),
        ("import log.csv --out imported --pulse-us 2000..1000", "LOW below HIGH"),
        ("import log.csv --out imported --pulse-us -5..1000", "of 0 or more"),
        ("identify stand --out found.toml --delay maybe", "auto"),
        ("import log.csv", "--out"),
        ("validate stand", "--model"),
        ("design --model model.toml --out c.toml --omega-g -5", "above 0"),
        ("design --kind lead --model model.toml --out c.toml --loop-rate 0", "above 0"),
        ("design --kind lead --model model.toml --out c.toml --damping nan", "above 0"),
        ("design --model model.toml --out c.toml --prewarp inf", "above 0"),
        ("bandwidth --model model.toml --lead 1,2", "three numbers"),
        ("bandwidth --model model.toml --lead -1,20,0.7", "above 0"),
        ("bandwidth --model model.toml --lead 20,10,0.7", "omega_z_rad_s"),
        ("bandwidth --model model.toml --lead 1,nan,0.7", "above 0"),
        ("bandwidth --model model.toml --sampled --esc-frame -600", "above 0"),
        ("bandwidth --model model.toml --esc-frame 600", "--sampled"),
        ("bandwidth --model model.toml --compensator c.toml --omega-g 9", "cannot be used with"),
        ("bandwidth --model model.toml --compensator c.toml --kind inverse", "cannot be used with"),
        ("bandwidth --model model.toml --lead 1,20,0.7 --slew 20", "cannot be used with"),
        ("bandwidth --model model.toml --steps 0", "above 0"),
        ("bandwidth --model model.toml --steps 0.05,1.5", "from 0.000001 to 1"),
        ("bandwidth --model model.toml --lead 1,20,0.7 --robustness", "cannot be used with"),
        ("design --model model.toml --out c.toml --kind pid", "[possible values: lead, inverse]"),
        ("design --model model.toml --out c.toml --kind inverse --omega-g 9", "change --kind"),
        ("design --model model.toml --out c.toml --kind inverse --prewarp 9", "change --kind"),
        ("design --model model.toml --out c.toml --kind lead --natural 100", "change --kind"),
        ("design --model model.toml --out c.toml --omega-g 300 --setting robust", "change --kind"),
        ("design --model model.toml --out c.toml --kind inverse --slew 0", "above 0"),
        ("design --model model.toml --out c.toml --kind inverse --output-range 0.5..0.2", "LOW below HIGH"),
        ("design --model model.toml --out c.toml --kind inverse --compensate-range 0.2..1.5", "from 0 to 1"),
    ] {
        stand.refuses(arguments, 2, &[part]);
    }
}

#[test]
fn a_design_that_the_controller_refuses_names_model_and_option() {
    let stand = Stand::new();
    for (arguments, part) in [
        ("--omega-g 5", "raise --omega-g"),
        ("--omega-g 1e5", "--omega-g"),
        ("--kind lead --loop-rate 60", "--loop-rate"),
        ("--kind inverse --natural 4000", "too close to Nyquist"),
        ("--kind inverse --natural 1", "raise --natural"),
        ("--kind inverse --loop-rate 100000", "--loop-rate"),
        ("--kind inverse --slew 0.01", "raise --slew"),
        ("--kind lead --slew 0.01", "raise --slew"),
    ] {
        stand.refuses(&format!("design --model model.toml --out c.toml {arguments}"), 1, &["`model.toml`", part]);
        stand.refuses(&format!("bandwidth --model model.toml {arguments}"), 1, &["`model.toml`", part]);
    }
}

#[test]
fn pulse_widths_are_refused_for_a_log_whose_command_is_a_duty() {
    let import = format!("import {LOGS}/esc32.csv --out imported --pulse-us 1000..2000");
    Stand::new().refuses(&import, 2, &["--pulse-us does not go with", "esc32.csv", "duty", "leave --pulse-us out"]);
}
