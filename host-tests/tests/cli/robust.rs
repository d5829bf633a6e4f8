//! Odd input ends well: the program says what is wrong within seconds and in little memory, or its result is true. It does not
//! panic, and no number that it prints is none.
//!
//! The stored cases are found by mutation; those made here are others of the same kinds.

use std::fs;
use std::path::Path;

use rotorlead_records::files::AcceptedRange;

use crate::promise::{Trouble, hold};
use crate::stand::Stand;

#[track_caller]
fn ends_well(stand: &Stand, arguments: &str) {
    let words: Vec<String> = arguments.split_whitespace().map(str::to_owned).collect();
    if let Err(broken) = hold(&stand.path(""), &words, Trouble::None) {
        panic!("`{arguments}` {broken}");
    }
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let there = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy(&path, &there);
        } else {
            // Content alone: what is copied may be read-only.
            fs::write(there, fs::read(&path).unwrap()).unwrap();
        }
    }
}

#[test]
fn every_stored_case_ends_well() {
    let Some(cases) = host_tests::data("cases/robust") else { return };
    let mut broken = String::new();
    let mut count = 0;
    for entry in fs::read_dir(cases).unwrap() {
        let case = entry.unwrap().path();
        let Ok(command) = fs::read_to_string(case.join("COMMAND")) else { continue };
        let folder = tempfile::tempdir().unwrap();
        copy(&case, folder.path());
        let words: Vec<String> = command.split_whitespace().skip(1).map(str::to_owned).collect();
        count += 1;
        if let Err(found) = hold(folder.path(), &words, Trouble::None) {
            broken += &format!("{}: {found}\n", case.display());
        }
    }
    assert!(broken.is_empty() && count > 20, "of {count} cases:\n{broken}");
}

/// A table of steady points with these responses.
fn steady(responses: &[f64]) -> Stand {
    let stand = Stand::new();
    stand.edit("stand/experiment.toml", "excitation = \"step\"\namplitude = 0.1", "excitation = \"steady\"");
    let count = responses.len() as f64;
    let rows = responses.iter().enumerate().map(|(row, response)| format!("{row},{},{response}\n", row as f64 / count));
    stand.write("stand/step.csv", format!("time_s,command,thrust_n\n{}", rows.collect::<String>()));
    stand
}

#[test]
fn a_dead_sensor_and_a_map_that_falls_are_told() {
    for responses in [[0.0; 12], [5.0; 12]] {
        let stand = steady(&responses);
        stand.command("check stand").assert().code(1);
        stand.refuses("identify stand --out found.toml", 1, &["step"]);
    }
    let falling: Vec<f64> = (0..8).map(|row| 9.0 - f64::from(row) + 0.3 * f64::from(row % 2)).collect();
    let stand = steady(&falling);
    ends_well(&stand, "check stand");
    ends_well(&stand, "identify stand --out found.toml");
}

/// The rows of the stand's step with other times.
fn with_times(of: impl Fn(usize, f64) -> f64) -> Stand {
    let stand = Stand::new();
    let text = stand.read("stand/step.csv");
    let mut changed = String::from("time_s,command,thrust_n\n");
    for (row, line) in text.lines().skip(1).enumerate() {
        let (time_s, rest) = line.split_once(',').unwrap();
        changed += &format!("{},{rest}\n", of(row, time_s.parse().unwrap()));
    }
    stand.write("stand/step.csv", changed);
    stand
}

#[test]
fn a_clock_that_no_logger_has_is_told_by_every_command() {
    type Clock = fn(usize, f64) -> f64;
    let clocks: [(Clock, &str); 7] = [
        (|_, time_s| 1e3 * time_s, "rows come every 10"),
        (|_, time_s| 1e6 * time_s, "rows come every 10000"),
        (|_, time_s| 1e-300 * time_s, "faster than any logger"),
        (|row, time_s| if row < 150 { time_s } else { time_s + 3600.0 }, "jumps by 3600"),
        (|row, time_s| if row < 150 { time_s } else { time_s + 86_400.0 }, "jumps by 86400"),
        (|row, time_s| if row < 150 { time_s } else { time_s + 3.2e7 }, "jumps by 32000000"),
        (|row, time_s| if row < 150 { time_s } else { time_s + 1e13 }, "is not from -1e12 to 1e12"),
    ];
    for (clock, part) in clocks {
        let stand = with_times(clock);
        for command in [
            "identify stand --out found.toml",
            "validate stand --model model.toml",
            "diagnose stand",
            "report stand --out page.html",
            "bandwidth --model model.toml --records stand",
        ] {
            stand.refuses(command, 1, &["stand/step.csv:", part]);
        }
        stand.command("check stand").assert().code(1);
    }
}

#[test]
fn numbers_out_of_their_range_are_refused_where_they_stand() {
    for (file, from, to, command, parts) in [
        (
            "model.toml",
            "time_constant_s = 0.08",
            "time_constant_s = 1000",
            "bandwidth --model model.toml --steps 0.05",
            ["model.toml:5:", "0.00001 to 100"],
        ),
        (
            "model.toml",
            "time_constant_s = 0.08",
            "time_constant_s = 9e18",
            "bandwidth --model model.toml",
            ["model.toml:5:", "9e18"],
        ),
        (
            "model.toml",
            "time_constant_s = 0.08",
            "time_constant_s = 0.08\ndelay_s = 1e308",
            "design --kind lead --model model.toml --out c.toml",
            ["model.toml:6:", "0 to 100"],
        ),
        (
            "model.toml",
            "gain = 6.2",
            "gain = 1e300",
            "design --kind lead --model model.toml --out c.toml",
            ["model.toml:4:", "1e300"],
        ),
        (
            "plan.toml",
            "esc_frame_hz = 600",
            "esc_frame_hz = 1e9",
            "simulate --model model.toml --plan plan.toml --out sim",
            ["plan.toml:4:", "1 to 40000"],
        ),
        (
            "plan.toml",
            "sigma_n = 0.02",
            "sigma_n = 1e200",
            "simulate --model model.toml --plan plan.toml --out sim",
            ["plan.toml:6:", "1e200"],
        ),
        (
            "stand/experiment.toml",
            "output = \"thrust_n\"",
            "output = \"thrust_n\"\nesc_frame_hz = 6e14",
            "identify stand --out found.toml",
            ["experiment.toml:5:", "6e14"],
        ),
        (
            "stand/experiment.toml",
            "output = \"thrust_n\"",
            "output = \"thrust_n\"\ncommand_rate_hz = 1e9",
            "diagnose stand",
            ["experiment.toml:5:", "1e9"],
        ),
        (
            "stand/experiment.toml",
            "amplitude = 0.1",
            "amplitude = 1e-300",
            "identify stand --out found.toml",
            ["experiment.toml:9:", "1e-300"],
        ),
        (
            "airframe.toml",
            "arm_m = 0.159",
            "arm_m = 1e12",
            "vehicle --airframe airframe.toml --model model.toml",
            ["airframe.toml:4:", "1e12"],
        ),
    ] {
        let stand = Stand::new();
        stand.edit(file, from, to);
        stand.refuses(command, 1, &parts);
    }
}

#[test]
fn a_staircase_of_equal_levels_is_refused_before_it_is_run() {
    let stand = Stand::new();
    let record = "[[record]]\nnominal = 0.5\nexcitation = \"staircase\"\nlevels = [0.45, 0.45]\nhold_s = 1\n";
    stand.write("plan.toml", format!("format = 1\nname = \"s\"\nseed = 1\n{record}"));
    stand.refuses("simulate --model model.toml --plan plan.toml --out sim", 1, &["plan.toml:7:", "stand still"]);
}

#[test]
fn a_model_is_not_praised_where_the_noise_does_not_show() {
    let stand = Stand::new();
    // The sensor has steps of 0.2 N: plateaus without any scatter.
    let fine = stand.read("stand/step.csv");
    let coarse = fine.lines().map(|line| match line.rsplit_once(',') {
        Some((head, thrust)) if !head.starts_with("time") => {
            format!("{head},{}\n", (thrust.parse::<f64>().unwrap() / 0.2).round() * 0.2)
        }
        _ => format!("{line}\n"),
    });
    let coarse: String = coarse.collect();
    stand.write("stand/step.csv", coarse);
    let said = stand.run("validate stand --model model.toml");
    assert!(said.contains("No record shows its noise") && !said.contains("As good as can be"), "{said}");
}

#[test]
fn a_static_map_alone_has_no_time_constants() {
    let rising: Vec<f64> = (0..12).map(|row| 0.08 * f64::from(row).powi(2)).collect();
    let stand = steady(&rising);
    ends_well(&stand, "report stand --out page.html --json page.json");
    let [page, json] = ["page.html", "page.json"].map(|name| stand.read(name));
    assert!(!page.contains("from inf") && !json.contains("inf to"), "{json}");
    assert!(json.contains("static map alone"), "{json}");
}

#[test]
fn what_is_as_long_as_a_file_is_quoted_in_part() {
    let long = "x".repeat(3_000_000);
    let stand = Stand::new();
    for (file, text, command) in [
        ("model.toml", format!("format = 1\n{long} = 1\n"), "design --kind lead --model model.toml --out c.toml"),
        ("model.toml", format!("format = 1\n# {long}{long}\n"), "design --kind lead --model model.toml --out c.toml"),
        ("stand/step.csv", format!("time_s,command,{long}\n0,0,0\n1,0,0\n"), "identify stand --out found.toml"),
        ("stand/step.csv", format!("time_s,command,thrust_n\n0,0,{long}\n"), "identify stand --out found.toml"),
        (
            "stand/step.csv",
            format!("time_s,command,thrust_n\n{}\n", "1,".repeat(2_000_000)),
            "identify stand --out found.toml",
        ),
        ("log.csv", format!("time_s,command,{long}\n0,0,0\n1,0,0\n"), "import log.csv --out imported"),
    ] {
        stand.write(file, text);
        ends_well(&stand, command);
        stand.command(command).assert().code(1);
    }
}

#[test]
fn a_device_without_an_end_is_read_no_further_than_a_file_may_be_long() {
    let stand = Stand::new();
    ends_well(&stand, "design --kind lead --model /dev/zero --out c.toml");
}

#[test]
fn long_periods_of_an_excitation_take_no_longer_than_others() {
    let stand = Stand::new();
    ends_well(&stand, "excite --period 50");
    ends_well(&stand, "excite --period 1000 --starts 1");
}

/// With `ROTORLEAD_UPDATE_PAGES=1` in the environment the table is written into the page.
#[test]
fn the_page_of_ranges_has_the_table_of_the_code() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join("docs/ranges.md");
    let text = fs::read_to_string(&page).unwrap();
    let (head, rest) = text.split_at(text.find("| key").expect("the page has a table"));
    let end = rest.find("\n\n").map_or(rest.len(), |end| end + 1);
    if std::env::var_os("ROTORLEAD_UPDATE_PAGES").is_some() {
        fs::write(&page, format!("{head}{}{}", AcceptedRange::table(), &rest[end..])).unwrap();
        return;
    }
    assert_eq!(&rest[..end], AcceptedRange::table(), "ROTORLEAD_UPDATE_PAGES=1 writes it");
}
