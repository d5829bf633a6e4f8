//! `export`: the syntax of each stack, and what is refused.

use serde_json::Value;

use crate::stand::Stand;

/// Steps told time constants of both directions apart; the speed goes with the square root of the command, so that thrust is linear.
const STEPPED: &str = "\
format = 1
[[point]]
nominal = 0.25
gain = 10000
time_constant_s = 0.04
time_constant_up_s = 0.03
time_constant_down_s = 0.06
[[point]]
nominal = 0.81
gain = 8000
time_constant_s = 0.04
[static_map]
command = [0.04, 0.16, 0.25, 0.49, 0.81, 1.0]
response = [4000, 8000, 10000, 14000, 18000, 20000]
[time_constant_curve]
nominal = [0.25, 0.81]
time_constant_s = [0.04, 0.04]
low_s = [0.038, 0.038]
high_s = [0.042, 0.042]
down_over_up = 2
[provenance]
records = []
version = \"0\"
output = \"rpm\"
";

fn stepped() -> Stand {
    let stand = Stand::new();
    stand.write("stepped.toml", STEPPED);
    // 1e-6 N/(rad/s)^2: 10 000 rpm are 1047.1976 rad/s.
    std::fs::create_dir(stand.path("table")).unwrap();
    stand.write(
        "table/experiment.toml",
        "format = 1\nname = \"table\"\ncommand = \"duty\"\noutput = \"thrust_n\"\n[[record]]\nfile = \"steady.csv\"\n\
         nominal = 0.5\nexcitation = \"steady\"\n",
    );
    let row = |(row, (command, rpm)): (usize, (f64, f64))| {
        format!("{row},{command},{},{rpm}\n", 1e-6 * (rpm * std::f64::consts::PI / 30.0).powi(2))
    };
    let rows = [(0.1, 4000.0), (0.3, 9000.0), (0.5, 12_000.0), (0.7, 15_000.0), (0.9, 18_000.0), (1.0, 20_000.0)];
    let rows: String = rows.into_iter().enumerate().map(row).collect();
    stand.write("table/steady.csv", format!("time_s,command,thrust_n,rpm\n{rows}"));
    stand
}

/// What stands in a parameter's line, and its value of the JSON.
#[track_caller]
fn prints(stand: &Stand, arguments: &str, lines: &[&str]) -> Value {
    let text = stand.run(&format!("export --model stepped.toml {arguments}"));
    for line in lines {
        assert!(text.lines().any(|printed| printed == *line), "no `{line}` in:\n{text}");
    }
    stand.json(&format!("export --model stepped.toml {arguments}"))
}

#[test]
fn each_stack_gets_its_own_syntax() {
    let stand = stepped();
    prints(&stand, "--for betaflight --output-range 0.04..1", &["set thrust_linear = 0"]);
    prints(&stand, "--for ardupilot --output-range 0.04..1", &["MOT_THST_EXPO,0"]);
    prints(&stand, "--for px4", &["param set THR_MDL_FAC 0"]);
    prints(&stand, "--for paparazzi --motors 3", &["<define name=\"ACT_FREQ\" value=\"{25, 25, 25}\"/>"]);
    prints(
        &stand,
        "--for indiflight --records table --at 0.3",
        &["set indi_act_time_constant_ms = 40,40,40,40", "set indi_act_max_rpm = 20000,20000,20000,20000"],
    );
    let json = prints(
        &stand,
        "--for gazebo --records table",
        &[
            "<timeConstantUp>0.03000</timeConstantUp>",
            "<timeConstantDown>0.06000</timeConstantDown>",
            "<maxRotVelocity>2094</maxRotVelocity>",
            "<motorConstant>1.000e-6</motorConstant>",
        ],
    );
    assert_eq!(json["stack"], "gazebo");
    let up = &json["parameters"][0];
    assert_eq!((&up["name"], &up["unit"]), (&Value::from("timeConstantUp"), &Value::from("s")), "{json:#}");
    for (key, value) in [("value", 0.03), ("low", 0.0285), ("high", 0.0315), ("at", 0.53)] {
        assert!((up[key].as_f64().unwrap() - value).abs() < 1e-12, "{key}: {json:#}");
    }
    for key in ["definition", "source"] {
        assert!(up[key].as_str().is_some_and(|text| !text.is_empty()), "{key}: {json:#}");
    }
    assert_eq!(json["refused"], Value::Array(Vec::new()));
}

#[test]
fn each_simulator_gets_its_own_syntax() {
    let stand = stepped();
    let with_records = |stack: &str, lines: &[&str]| prints(&stand, &format!("--for {stack} --records table"), lines);
    let json = with_records(
        "isaac-lab",
        &[
            "THRUSTER = ThrusterCfg(",
            "    tau_inc_range=(0.02850, 0.03150),",
            "    tau_dec_range=(0.05700, 0.06300),",
            "    use_discrete_approximation=False,",
            ")",
        ],
    );
    assert_eq!((&json["stack"], &json["replays"]), (&Value::from("isaac_lab"), &Value::Array(Vec::new())), "{json:#}");
    with_records(
        "aerial-gym",
        &["class motor_model_config:", "    motor_time_constant_increasing_min = 0.02850", "    max_thrust = 4.386"],
    );
    with_records("crazyflow", &["rotor_dyn_coef = [33.33, 0.0,", "                  16.67, 0.0]"]);
    with_records("rotorpy", &["quad_params = {", "    \"tau_m\": 0.04000,", "    \"k_eta\": 1.000e-6,", "}"]);
    with_records("gym-pybullet-drones", &["<properties kf=\"1.097e-8\"/>"]);
    with_records("px4-sih", &["param set SIH_T_TAU 0.04000", "param set SIH_T_MAX 4.386"]);
    let general = "<general dyntype=\"filterexact\" gaintype=\"fixed\" biastype=\"none\" ctrlrange=\"0 1\" actrange=\"0 1\" \
                   actearly=\"true\" dynprm=\"0.04000\" gainprm=\"4.386\"/>";
    with_records("mujoco", &[general]);
    with_records("flightmare", &["quadrotor_dynamics:", "  motor_tau: 0.04000", "  thrust_map: [1.000e-6, 0.0, 0.0]"]);
}

#[test]
fn all_stacks_go_into_a_folder_which_is_whole_or_not_there() {
    let stand = stepped();
    let text = stand.run("export --for all --out stacks --model stepped.toml --output-range 0.04..1");
    for file in ["px4.txt", "ardupilot.param", "gazebo.xml", "isaac-lab.py", "crazyflow.toml", "flightmare.yaml"] {
        assert!(text.contains(file) && stand.path(&format!("stacks/{file}")).is_file(), "{file}: {text}");
    }
    assert!(text.contains("Nothing is known for gym-pybullet-drones: kf: "), "{text}");
    assert!(!stand.path("stacks/gym-pybullet-drones.xml").exists());
    stand.refuses("export --for all --out stacks --model stepped.toml", 1, &["stacks", "not empty"]);
    stand.refuses("export --for all --model stepped.toml", 2, &["--out"]);
    // A file of its own may be replaced.
    for _ in 0..2 {
        stand.run("export --for gazebo --out gazebo.xml --model stepped.toml");
    }
    assert_eq!(
        std::fs::read(stand.path("gazebo.xml")).unwrap(),
        std::fs::read(stand.path("stacks/gazebo.xml")).unwrap()
    );
}

#[test]
fn a_table_in_steps_of_a_tenth_is_enough_for_every_thrust_curve() {
    let stand = Stand::new();
    std::fs::create_dir(stand.path("tenths")).unwrap();
    stand.write(
        "tenths/experiment.toml",
        "format = 1\nname = \"tenths\"\ncommand = \"duty\"\noutput = \"thrust_n\"\n[[record]]\nfile = \"steady.csv\"\n\
         nominal = 0.5\nexcitation = \"steady\"\n",
    );
    // thrust = 12 (0.6 u^2 + 0.4 u): a quadratic counted from 0.15 to 0.95 has 0.6 0.8 / (0.4 + 0.6 (0.15 + 0.95)) = 0.4528.
    let row = |tenth: i32| (f64::from(tenth), f64::from(tenth) / 10.0);
    let rows = (0..=10).map(row).map(|(time, u)| format!("{time},{u},{}\n", 12.0 * (0.6 * u * u + 0.4 * u)));
    stand.write("tenths/steady.csv", format!("time_s,command,thrust_n\n{}", rows.collect::<String>()));
    stand.run("identify tenths --out tenths.toml");
    let known = |stack: &str| stand.json(&format!("export --for {stack} --model tenths.toml"))["parameters"].clone();
    assert!((known("px4")[0]["value"].as_f64().unwrap() - 0.6).abs() < 1e-6);
    assert!((known("ardupilot")[0]["value"].as_f64().unwrap() - 0.452_83).abs() < 1e-4);
    let both = known("betaflight");
    for (parameter, releases) in [(&both[0], "4.2 to 2025.12"), (&both[1], "2026.6 on")] {
        assert_eq!(parameter["releases"], releases, "{both:#}");
        let [low, value, high] = ["low", "value", "high"].map(|key| parameter[key].as_f64().unwrap());
        assert!(low < value && value < high && value.fract() == 0.0, "{both:#}");
    }
    // As in the laws' series, the newer value is near that of the quadratic between the same ends.
    assert!((both[1]["value"].as_f64().unwrap() / 100.0 - 0.6).abs() < 0.1, "{both:#}");
    let text = stand.run("export --for ardupilot --model tenths.toml");
    assert!(text.contains("at 0.15 and at 0.95 is interpolated") && text.contains("`--output-range`"), "{text}");
}

#[test]
fn a_value_of_thrust_linear_is_converted_to_the_other_law_without_a_model() {
    let stand = Stand::new();
    let text = stand.run("export --convert thrust_linear=120 --from 2025.12");
    assert!(text.ends_with("set thrust_linear = 64\n") && text.contains("does not convert"), "{text}");
    assert!(text.contains("1.5 % rms") && text.contains("60.0 has the same output at half thrust"), "{text}");
    let json = stand.json("export --convert thrust_linear=64 --from 2026.6.1");
    assert_eq!((&json["value"], &json["releases"]), (&Value::from(122.0), &Value::from("4.2 to 2025.12")), "{json:#}");
    stand.refuses("export --convert thrust_linear=90 --from 2026.6", 1, &["0 to 150", "178", "--for betaflight"]);
    for (arguments, parts) in [
        ("--convert thrust_linear=120", &["--from"][..]),
        ("--convert thrust_linear=1.5 --from 4.5", &["thrust_linear=VALUE"]),
        ("--convert thrust_linear=20 --from 4.1", &["4.1", "4.2 and later"]),
        ("--convert thrust_linear=20 --from new", &["2026.6"]),
        ("--convert thrust_linear=20 --from 4.5 --for px4", &["--for", "cannot be used with"]),
        ("--from 4.5 --for px4 --model model.toml", &["--convert"]),
    ] {
        stand.refuses(&format!("export {arguments}"), 2, parts);
    }
}

#[test]
fn frequency_responses_go_to_matlab_python_and_tables() {
    let stand = Stand::new();
    stand.run("simulate model.toml --plan plan.toml --out sim");
    stand.run("design model.toml --out lead.toml --kind lead");
    let csv = stand.run("export --model model.toml --for csv --records sim --compensator lead.toml");
    let rows: Vec<Vec<f64>> =
        csv.lines().skip(1).map(|line| line.split(',').map(|number| number.parse().unwrap()).collect()).collect();
    assert!(rows.len() > 100 && rows.iter().all(|row| row.len() == 14), "{csv}");
    // The motor is that of the model: at its lowest frequency the response is near its gain.
    assert!((rows[0][3] - 7.1).abs() < 0.2 && rows[0][9] > 0.9, "{:?}", rows[0]);
    let python = stand.run("export --model model.toml --for python-control --records sim --out motor.py");
    assert!(python.contains("Written to motor.py"), "{python}");
    stand.run("export --model model.toml --for matlab --records sim --out motor.mat");
    // An own file may be replaced, and a log may not.
    stand.run("export --model model.toml --for matlab --records sim --out motor.mat");
    stand.write("log.csv", "time_s,command\n0,0.1\n0.1,0.2,\n");
    stand.refuses(
        "export --model model.toml --for csv --records sim --out log.csv",
        1,
        &["a table of commands", "--force"],
    );
    // The reader of logs lists what the file has.
    stand.refuses(
        "import motor.mat --excitation multisine --period 10 --out imported",
        1,
        &["frequency", "coherence", "covariance"],
    );
    for (arguments, parts) in [
        ("--for matlab --records sim", &["--out FILE"][..]),
        ("--for csv", &["--records DIR"]),
        ("--for px4 --compensator lead.toml", &["--compensator", "px4 has none"]),
        ("--for csv --records sim --motors 4", &["--motors", "csv has none"]),
    ] {
        stand.refuses(&format!("export --model model.toml {arguments}"), 2, parts);
    }
    stand.refuses("export --model model.toml --for csv --records sim --at 0.4", 1, &["commands of 0.5", "`--at`"]);
    stand.refuses("export --model model.toml --for csv --records stand", 1, &["no multisine"]);
}

#[test]
fn a_comment_in_xml_has_no_double_hyphen() {
    let stand = stepped();
    for stack in ["paparazzi", "gazebo", "mujoco"] {
        let text = stand.run(&format!("export --for {stack} --model stepped.toml"));
        let inside = text.replace("<!--", "").replace("-->", "");
        assert!(!inside.contains("--"), "{text}");
    }
}

#[test]
fn a_static_map_without_a_lag_is_enough_for_a_thrust_curve() {
    let stand = stepped();
    stand.run("identify table --out map.toml");
    let json = stand.json("export --for px4 --model map.toml");
    let factor = json["parameters"][0]["value"].as_f64().unwrap();
    assert!((0.0..=1.0).contains(&factor), "{json:#}");
    stand.refuses("export --for paparazzi --model map.toml", 1, &["ACT_FREQ", "no time constant", "staircase"]);
}

#[test]
fn what_is_known_is_printed_beside_what_is_not() {
    let stand = stepped();
    let json = prints(&stand, "--for gazebo", &["<maxRotVelocity>2094</maxRotVelocity>"]);
    assert_eq!(json["refused"][0]["name"], "motorConstant", "{json:#}");
    assert!(json["refused"][0]["why"].as_str().unwrap().contains("on the same levels"), "{json:#}");
    let json = prints(&stand, "--for indiflight --at 0.9", &["set indi_act_max_rpm = 20000,20000,20000,20000"]);
    assert!(json["refused"][0]["why"].as_str().unwrap().contains("0.25 to 0.81, and not at 0.9"), "{json:#}");
}

#[test]
fn that_a_model_is_not_ready_is_said_in_a_comment_and_for_programs() {
    let stand = stepped();
    let judgement = "[provenance.judgement]\nstate = \"measure again\"\nlimits = [\"few steps: record more\"]\n";
    stand.edit("stepped.toml", "output = \"rpm\"\n", &format!("output = \"rpm\"\n{judgement}"));
    let warning = "the model was judged when it was identified, as measure again: few steps: record more";
    let json = prints(&stand, "--for px4", &[&format!("# warning: {warning}")]);
    assert_eq!(json["warnings"], Value::from(vec![warning]));
}

#[test]
fn nothing_known_is_a_failure_with_every_reason() {
    let stand = stepped();
    stand.refuses(
        "export --for gazebo --model model.toml",
        1,
        &["timeConstantUp", "timeConstantDown", "maxRotVelocity", "motorConstant", "docs/export.md"],
    );
    stand.edit("stepped.toml", "0.81, 1.0]", "0.81, 0.9]");
    stand.refuses("export --for px4 --model stepped.toml", 1, &["THR_MDL_FAC", "command of 1", "0.900"]);
}

#[test]
fn wrong_use_is_told() {
    let stand = stepped();
    for (arguments, parts) in [
        ("--for inav", &["inav", "betaflight"][..]),
        ("", &["--for"]),
        ("--for px4 --at 0.5", &["--at", "px4 has none"]),
        ("--for paparazzi --output-range 0..1", &["--output-range", "paparazzi has none"]),
        ("--for gazebo --motors 4", &["--motors", "gazebo has none"]),
        ("--for paparazzi --step-rate 500", &["--step-rate", "paparazzi has none"]),
        ("--for mujoco --step-rate 0", &["--step-rate", "0"]),
        ("--for paparazzi --motors 0", &["--motors", "0"]),
        ("--for paparazzi --at 1.5", &["--at", "1.5"]),
        ("--for paparazzi --at nan", &["--at", "nan"]),
        ("--for px4 --output-range 0.9..0.1", &["--output-range", "LOW..HIGH"]),
        ("--for px4 --output-range 0..1.2", &["--output-range", "from 0 to 1"]),
        ("--for px4 --json stepped.toml", &["stepped.toml", "written over"]),
    ] {
        stand.refuses(&format!("export --model stepped.toml {arguments}"), 2, parts);
    }
    stand.refuses("export --for px4 --model stepped.toml --records nowhere", 1, &["`nowhere` does not exist"]);
}
