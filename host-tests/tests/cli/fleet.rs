//! `rotorlead fleet`: 200 logs that each was identified by itself, by an engine that is not ours, and what is no fleet.

use std::fmt::Write as _;
use std::fs;
use std::process::Command;

use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};
use serde_json::Value;

use crate::stand::{Stand, program};

const MOTORS: usize = 20;
const MONTHS: usize = 10;
const PLAN: &str = r#"format = 1
name = "a month"
seed = 5
sample_rate_hz = 200
loop_rate_hz = 200
[noise]
sigma_n = 0.02
[[record]]
nominal = 0.4
excitation = "multisine"
amplitude = 0.05
lines = 150
periods = 3
[[record]]
nominal = 0.6
excitation = "multisine"
amplitude = 0.05
lines = 150
periods = 3
"#;

/// Motors that differ by 2 %, logs that differ by 1 %. The fifth motor is slower by a quarter, the twelfth becomes slower by 1.5 % a month,
/// and one log of the eighth has four fifths of the gain.
fn write_fleet(stand: &Stand) {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let [of_motors, of_logs] = [0.02, 0.01].map(|std| Normal::new(0.0, std).unwrap());
    let (mut list, mut jobs) = ("log,motor,date\n".to_owned(), String::new());
    fs::create_dir(stand.path("fleet")).unwrap();
    for motor in 1..=MOTORS {
        let own = of_motors.sample(&mut random) + if motor == 5 { 0.25 } else { 0.0 };
        for month in 0..MONTHS {
            let drift = if motor == 12 { 0.015 * month as f64 } else { 0.0 };
            let tau = f64::exp(own + drift + of_logs.sample(&mut random));
            let gain = f64::exp(of_logs.sample(&mut random)) * if (motor, month) == (8, 6) { 0.8 } else { 1.0 };
            let log = format!("m{motor:02}_{month}");
            writeln!(list, "{log},M{motor:02},2026-{:02}-15", month + 1).unwrap();
            writeln!(jobs, "{log} {}", 100 * motor + month).unwrap();
            let point = |nominal: f64, usual_gain: f64, usual_tau_s: f64| {
                let (gain, tau_s) = (usual_gain * gain, usual_tau_s * tau);
                format!("[[point]]\nnominal = {nominal}\ngain = {gain}\ntime_constant_s = {tau_s}\n")
            };
            let model = format!("format = 1\n{}{}", point(0.4, 10.5, 0.15), point(0.6, 13.5, 0.08));
            stand.write(&format!("{log}.toml"), model);
        }
    }
    stand.write("fleet/fleet.csv", list);
    stand.write("jobs.txt", jobs);
    stand.write("plan.toml", PLAN);
}

/// Runs a command line for each line of a file, two at a time.
fn each(stand: &Stand, file: &str, line: &str) {
    let program = program().get_program().to_owned();
    let status = Command::new("xargs")
        .args(["-P2", "-L1", "sh", "-c", line])
        .stdin(fs::File::open(stand.path(file)).unwrap())
        .env("ROTORLEAD", program)
        .current_dir(stand.path("."))
        .status()
        .expect("xargs is missing: it is part of findutils");
    assert!(status.success(), "{line}: {status}");
}

fn names(values: &Value, key: &str, wanted: impl Fn(&Value) -> bool) -> Vec<String> {
    let wanted = values[key].as_array().unwrap().iter().filter(|value| wanted(value));
    wanted.map(|value| value[key.trim_end_matches('s')].as_str().unwrap().to_owned()).collect()
}

#[test]
fn of_200_logs_those_stand_out_that_were_made_so() {
    let stand = Stand::new();
    write_fleet(&stand);
    each(&stand, "jobs.txt", r#""$ROTORLEAD" simulate -q --model $0.toml --plan plan.toml --seed $1 --out fleet/$0"#);
    let begin = std::time::Instant::now();
    each(&stand, "jobs.txt", r#""$ROTORLEAD" identify -q fleet/$0 --out fleet/$0/model.toml"#);
    let logs = MOTORS * MONTHS;
    println!(
        "{logs} logs identified, two at a time: {:.0} ms for each",
        1e3 * begin.elapsed().as_secs_f64() / logs as f64
    );
    let found = stand.json("fleet fleet");
    assert_eq!(names(&found, "logs", |log| log["stands_out"] == true), ["m08_6"]);
    let of_tau = |key: &'static str| names(&found, "motors", |motor| motor["time_constant"][key] == true);
    // The one that drifts is far from the others by then.
    assert_eq!(of_tau("stands_out"), ["M05", "M12"]);
    assert_eq!(of_tau("drifts"), ["M12"]);
    let drift = &found["motors"][11]["time_constant"];
    let [low, high] = [0, 1].map(|end| drift["drift_interval"][end].as_f64().unwrap());
    // Months of 30.4 days, and logs 30.3 apart. The interval is 2.31 standard errors to either side: 8 degrees of freedom.
    let (truth, found_drift) = (0.01517, drift["drift_share_per_month"].as_f64().unwrap());
    assert!((found_drift - truth).abs() < 3.0 * (high - low) / 2.0 / 2.31, "1.5 % a month, and {low} to {high}");
    let text = stand.run("fleet fleet");
    let verdict = found["headline"].as_str().unwrap();
    assert!(verdict.contains("200 logs of 20 motors") && verdict.contains("1 drifts; 1 log stands out."), "{verdict}");
    assert!(text.split_whitespace().collect::<Vec<_>>().join(" ").ends_with(verdict), "it comes last: {text}");

    // One that was not identified, and one whose diagnosis says something.
    fs::remove_file(stand.path("fleet/m01_0/model.toml")).unwrap();
    stand.write("fleet/m02_0/diagnose.json", r#"{"verdict": "named", "effects": [{"kind": "backlash"}]}"#);
    // And two whose files are no model and no diagnosis.
    stand.write("fleet/m03_0/model.toml", "format = 1\nno = ");
    stand.write("fleet/m04_0/diagnose.json", "{}");
    // One line: a cell breaks where it likes.
    let text = stand.run("fleet fleet").split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(text.contains("not identified: no model.toml") && text.contains("2 logs were not compared"), "{text}");
    assert!(
        text.contains("model.toml is no model: ") && text.contains("not what `rotorlead diagnose --json`"),
        "{text}"
    );
    assert!(text.contains("diagnosis: named backlash"), "{text}");
}

#[test]
fn what_is_no_fleet_is_refused_with_its_place_and_a_remedy() {
    let stand = Stand::new();
    fs::create_dir_all(stand.path("fleet/a")).unwrap();
    stand.refuses(
        "fleet fleet",
        1,
        &["`fleet` is no folder of a fleet", "no fleet.csv", "rotorlead import LOG... --fleet"],
    );
    stand.refuses("fleet model.toml", 1, &["`model.toml` is no folder of a fleet"]);
    stand.write("fleet/fleet.csv", "log,motor\na,M1\n");
    stand.refuses("fleet fleet", 1, &["no command is shared by 3 logs", "0 of its 1 logs", "rotorlead identify"]);
    stand.write("fleet/fleet.csv", "log,motor,date\na,M1,last week\n");
    stand.refuses("fleet fleet", 1, &["fleet.csv:2:6", "`last week` is not a date", "2026-03-02"]);
    stand.refuses("fleet", 2, &["<DIR>"]);
}

#[test]
fn one_bench_log_of_four_motors_says_which_esc_ramps() {
    let stand = Stand::new();
    // Time constants of 50 ms, 12 000 rpm at full command; the second ESC goes by 0.15 %/ms up and 0.3 down.
    let levels = [0.3, 0.5, 0.35, 0.7, 0.4, 0.6, 0.3, 0.65, 0.5, 0.55, 0.35, 0.4, 0.3];
    let ramps = [None, Some((1.5, 3.0)), None, None];
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let noise = Normal::new(0.0, 25.0).unwrap();
    let mut table = "time_s,command.m1,rpm.m1,command.m2,rpm.m2,command.m3,rpm.m3,command.m4,rpm.m4\n".to_owned();
    let (mut followed, mut speed) = ([0.3_f64; 4], [0.3_f64; 4]);
    const STEP_S: f64 = 5e-4;
    for step in 0..13 * 3000_usize {
        let command = levels[step / 3000];
        if step.is_multiple_of(10) {
            write!(table, "{:.4}", step as f64 * STEP_S).unwrap();
            for speed in speed {
                write!(table, ",{command},{:.0}", 12_000.0 * speed + noise.sample(&mut random)).unwrap();
            }
            table.push('\n');
        }
        for (motor, ramp) in ramps.iter().enumerate() {
            let (up, down) = ramp.unwrap_or((f64::INFINITY, f64::INFINITY));
            followed[motor] += (command - followed[motor]).clamp(-down * STEP_S, up * STEP_S);
            speed[motor] += STEP_S / 0.05 * (followed[motor] - speed[motor]);
        }
    }
    stand.write("bench.csv", table);
    stand.run("import bench.csv --excitation staircase --fleet --out bench");
    for motor in 1..=4 {
        let log = format!("bench/bench_motor{motor}");
        stand.run(&format!("identify -q {log} --out {log}/model.toml"));
        stand.run(&format!("diagnose -q {log} --json {log}/diagnose.json"));
    }
    let found = stand.json("fleet bench");
    let odd = found["esc_ramps"].as_array().unwrap().iter().map(|ramp| ramp["is_odd"] == true);
    assert_eq!(odd.collect::<Vec<_>>(), [false, true, false, false], "{found:#}");
    for (motor, truth) in ramps.iter().enumerate() {
        let ramp = &found["esc_ramps"][motor];
        let of = |direction: &str, end: &str| ramp[direction][format!("{end}_percent_per_ms")].as_f64();
        for (direction, truth) in [("up", truth.map(|(up, _)| up)), ("down", truth.map(|(_, down)| down))] {
            let (low, rate, high) = (of(direction, "low"), of(direction, "rate"), of(direction, "high"));
            match truth {
                // In % of the range in a millisecond.
                Some(truth) => assert!(low.unwrap() <= 0.1 * truth && 0.1 * truth <= high.unwrap(), "{ramp:#}"),
                // One as slow as that of the second would have been seen.
                None => assert!(rate.is_none() && high.is_none() && low.is_some_and(|low| low > 0.6), "{ramp:#}"),
            }
        }
    }
    let said = stand.run("fleet bench");
    assert!(
        said.contains("ESC ramps: the odd one is bench_motor2: 0.1") && said.contains("none slower than"),
        "{said}"
    );
    let alone = stand.run("diagnose bench/bench_motor2");
    assert!(alone.contains("ESC ramp: 0.1"), "{alone}");
}
