//! From a log to a model with one command, and from many logs to a fleet.

use std::fs;
use std::path::Path;

use rotorlead_records::Experiment;

use crate::stand::{Stand, report};

/// Logs of three kinds: a stand with pulse widths, an ESC's own log, and a stand with DShot, whose unit is guessed.
const REAL: [&str; 3] =
    ["Log_2019-11-09_181347.csv", "f40_steps_5-2.csv", "../sar_simulation/micro_2023-12-17_162234.csv"];

/// Steps of a motor with a lag of 100 ms, between three levels, with a little noise, as a table without units.
fn steps(header: &str) -> String {
    let mut thrust_g = 300.0;
    let row = |row: u32| {
        let percent = [40, 50, 60, 50][(row / 200) as usize % 4];
        thrust_g += 0.1 * (7.5 * f64::from(percent) - thrust_g);
        let noise = f64::from((row * 7919) % 101) / 100.0 - 0.5;
        format!("{},{percent},{:.3}\n", 10 * row, thrust_g + 0.5 * noise)
    };
    format!("{header}\n{}", (0..1600).map(row).collect::<String>())
}

/// The last line of `text` that is a command.
#[track_caller]
fn proposed(text: &str) -> String {
    let begin = text.rfind("rotorlead ").unwrap_or_else(|| panic!("no command in:\n{text}"));
    text[begin..].lines().next().unwrap().to_owned()
}

/// The text of a page.
pub fn without_tags(html: &str) -> String {
    html.split('<').map(|part| part.split_once('>').map_or(part, |(_, text)| text)).collect()
}

/// Runs a command as it stands there, without the program's name.
#[track_caller]
fn run_as_typed(stand: &Stand, command: &str) -> String {
    let words = shlex::split(command).unwrap_or_else(|| panic!("no command of a shell: {command}"));
    let output = stand.command("").args(&words[1..]).assert().code(0).get_output().stdout.clone();
    String::from_utf8(output).unwrap()
}

#[test]
fn a_log_gives_the_model_that_its_folder_gives() {
    for name in REAL {
        let Some(log) = host_tests::real_log(name) else { return };
        let stand = Stand::new();
        let log = log.display();
        let imported = stand.run(&format!("import {log} --out folder"));
        stand.run("identify folder --out of_folder.toml --json of_folder.json");
        let text = stand.run(&format!("identify {log} --out of_log.toml --verbose --json of_log.json"));
        assert_eq!(stand.model("of_log.toml"), stand.model("of_folder.toml"), "{name}");
        // What import says of the log is said.
        let (said, _) = imported.split_once("\nnote: ").unwrap_or((&imported, ""));
        assert!(said.contains("rows taken") && text.contains(said.trim()), "{name}: no\n{said}\nin\n{text}");
        // Who does not ask is told the notes.
        let short = stand.run(&format!("identify {log}"));
        assert_eq!(short.matches("\nnote: ").count(), imported.matches("\nnote: ").count(), "{short}");
        assert!(!short.contains("taken as"), "{short}");
        let [of_log, of_folder] = ["of_log.json", "of_folder.json"]
            .map(|file| serde_json::from_str::<serde_json::Value>(&stand.read(file)).unwrap());
        assert_eq!(of_log["points"], of_folder["points"]);
        assert!(of_log["logs"][0]["rows_taken"].as_u64() > Some(1000) && of_folder.get("logs").is_none());
    }
}

#[test]
fn without_out_nothing_is_written_and_the_last_line_keeps_the_model() {
    let stand = Stand::new();
    stand.write("a log.csv", steps("time_ms,throttle_percent,thrust_g"));
    let log = "identify --excitation staircase";
    let before = stand.everything();
    let found = stand.command(log).arg("a log.csv").assert().code(0).get_output().stdout.clone();
    let text = String::from_utf8(found).unwrap();
    assert!(stand.everything() == before, "something was written");
    let command = text.lines().last().unwrap().strip_prefix("To keep the model: ").unwrap().to_owned();
    assert_eq!(command, "rotorlead identify --excitation staircase 'a log.csv' --out model.toml");
    let kept = run_as_typed(&stand, &command);
    assert!(kept.ends_with("\nReplaced model.toml\n"), "{kept}");
    let shown = |text: &str| text.rsplit_once("\n\n").unwrap().0.to_owned();
    assert_eq!(shown(&text), shown(&kept), "nothing else changes");
    assert!(stand.read("model.toml").contains("time_constant_s"));
    // Of a folder too.
    stand.command("import --excitation staircase --out folder").arg("a log.csv").assert().code(0);
    assert!(stand.run("identify folder").ends_with("To keep the model: rotorlead identify folder --out model.toml\n"));
}

#[test]
fn all_that_a_log_does_not_say_is_asked_at_once_with_the_command_that_says_it() {
    let stand = Stand::new();
    stand.write("log.csv", steps("t,throttle,load cell"));
    let ask = |arguments: &str, status: i32, parts: &[&str]| {
        stand.refuses(arguments, status, parts);
        proposed(&report(&stand.command(arguments).assert()))
    };
    let expected = "rotorlead identify log.csv --column time=t:UNIT --column thrust=HEADER:UNIT --excitation KIND";
    let command = ask("identify log.csv", 1, &["`t` is the time without a unit", "no column is known", "what drove"]);
    assert_eq!(command, expected);
    // A column that is stated without its unit is stated once more with it.
    let half = "identify log.csv --column=time=t --column thrust=HEADER:UNIT";
    let half = half.replace("thrust=HEADER:UNIT", "command=throttle");
    let command = ask(&half, 1, &["without a unit"]);
    assert_eq!(
        command,
        "rotorlead identify log.csv --column command=throttle --column time=t:UNIT --column thrust=HEADER:UNIT --excitation KIND"
    );
    let filled = expected.replace("t:UNIT", "t:ms").replace("KIND", "staircase");
    let filled = filled.replace("thrust=HEADER:UNIT", "'thrust=load cell:gf'");
    let text = run_as_typed(&stand, &filled);
    assert!(text.contains("guessed to be percent") && text.contains("tau"), "{text}");
    // What is left to say after the columns have their units.
    stand.write("named.csv", steps("time_ms,throttle_percent,thrust_g"));
    let command = ask("identify named.csv", 2, &["what drove the command", "`staircase`"]);
    assert_eq!(command, "rotorlead identify named.csv --excitation KIND");
    run_as_typed(&stand, &command.replace("KIND", "staircase"));
    // And where what was said does not do.
    let command = ask("identify named.csv --excitation free", 1, &["`free`", "say what was played"]);
    assert_eq!(command, "rotorlead identify named.csv --excitation KIND");
    let import = "rotorlead import named.csv --out made --excitation KIND";
    assert_eq!(ask("import named.csv --out made", 2, &["what drove the command"]), import);
}

#[test]
fn a_log_without_any_excitation_leads_to_one() {
    let stand = Stand::new();
    let constant = steps("time_ms,throttle_percent,thrust_g").replace(",40,", ",50,").replace(",60,", ",50,");
    stand.write("log.csv", constant);
    let found = "identify log.csv --excitation staircase";
    stand.refuses(found, 1, &["the command is 0.5 in all of the 1600 rows", "`rotorlead excite --out excitation.csv`"]);
    stand.run("excite --out excitation.csv");
}

#[test]
fn a_log_gives_the_report_that_its_folder_gives() {
    let stand = Stand::new();
    stand.write("log.csv", steps("time_ms,throttle_percent,thrust_g"));
    let options = "--excitation staircase --nominal 0.5";
    stand.run(&format!("import log.csv {options} --out folder"));
    let of = |source: &str, out: &str| stand.json(&format!("report {source} --no-diagnosis --out {out}"));
    let (of_log, of_folder) = (of(&format!("log.csv {options}"), "log.html"), of("folder", "folder.html"));
    assert_eq!((&of_log["points"], &of_log["verdict"]), (&of_folder["points"], &of_folder["verdict"]));
    assert_eq!(of_log["logs"][0]["rows_taken"], 1600);
    // The commands of each part begin with the folder that they need.
    let html = without_tags(&stand.read("log.html"));
    let import = format!("rotorlead import log.csv {options} --out stand");
    assert!(html.contains(&import) && html.contains("rotorlead validate stand --model model.toml"), "{import}");
    assert!(!without_tags(&stand.read("folder.html")).contains("rotorlead import log.csv"));
}

#[test]
fn a_log_without_its_command_is_merged_at_once() {
    let (Some(esc), Some(log)) =
        (host_tests::real_log("f40_steps_5-2.csv"), host_tests::real_log("Log_2019-11-05_171350.csv"))
    else {
        return;
    };
    let stand = Stand::new();
    stand.run(&format!("import {} --out esc", esc.display()));
    stand.run(&format!("import {} --no-command --out apart", log.display()));
    let align = "--align esc/f40_steps_5-2.csv";
    stand.run(&format!("identify apart {align} --out of_folder.toml"));
    stand.run(&format!("identify {} {align} --out of_log.toml", log.display()));
    assert_eq!(stand.model("of_log.toml"), stand.model("of_folder.toml"));
}

#[test]
fn what_is_no_log_takes_no_option_of_one() {
    let stand = Stand::new();
    stand.write("log.csv", steps("time_ms,throttle_percent,thrust_g"));
    for (option, name) in [
        ("--column time=t:s", "--column"),
        ("--tare", "--tare"),
        ("--excitation step", "--excitation"),
        ("--nominal 0.5", "--nominal"),
        ("--amplitude 0.1", "--amplitude"),
        ("--seconds 0..1", "--seconds"),
        ("--pulse-us 1000..2000", "--pulse-us"),
        ("--motor 1", "--motor"),
        ("--log 1", "--log"),
    ] {
        for command in ["identify", "identify --stand", "report"] {
            let said = format!("{name} says what is in a log, and `stand` is taken as an experiment's folder");
            stand.refuses(&format!("{command} stand {option}"), 2, &[&said, &format!("leave {name} out")]);
        }
    }
    // What a log is asked for and has not, and what goes with no log.
    stand.refuses("identify log.csv --excitation square", 2, &["--excitation square needs --period"]);
    stand.refuses(
        "identify log.csv --excitation step --motor 1",
        2,
        &["it has one motor, and no column that says which"],
    );
    stand.refuses("identify log.csv --excitation step --response rpm", 1, &["no column was taken as rpm"]);
    stand.refuses("identify log.csv --excitation step --out log.csv", 2, &["would be read and then written over"]);
    stand.refuses("identify nowhere.csv --excitation step", 1, &["`nowhere.csv` does not exist"]);
    stand.refuses("identify stand/experiment.toml", 1, &["is not a folder", "the folder that holds experiment.toml"]);
}

#[test]
fn many_logs_become_a_fleet_and_none_where_one_is_no_log() {
    let stand = Stand::new();
    fs::create_dir(stand.path("logs")).unwrap();
    for log in ["a", "b", "c"] {
        stand.write(&format!("logs/{log}.csv"), steps("time_ms,throttle_percent,thrust_g"));
    }
    let import = "import logs/a.csv logs/b.csv logs/c.csv --excitation staircase --fleet --out fleet";
    let found = stand.run(import);
    assert!(found.contains("Written to fleet: 3 logs, and fleet.csv"), "{found}");
    assert_eq!(stand.read("fleet/fleet.csv"), "log,motor,date\na,a,\nb,b,\nc,c,\n");
    // Each is what import makes of it alone.
    stand.run("import logs/b.csv --excitation staircase --out alone");
    let experiment = |folder: &str| Experiment::read(&stand.path(folder)).unwrap();
    assert_eq!(experiment("fleet/b"), experiment("alone"));
    stand.refuses("fleet fleet", 1, &["0 of its 3 logs have a model.toml", "identify each log first"]);
    for log in ["a", "b", "c"] {
        stand.run(&format!("identify fleet/{log} --out fleet/{log}/model.toml"));
    }
    let compared = stand.json("fleet fleet");
    assert_eq!(compared["logs"].as_array().unwrap().len(), 3);
    assert!(compared["logs"].as_array().unwrap().iter().all(|log| log["time_constant_share"] == 0.0), "{compared:#}");

    // One of several is damaged: it is named, and nothing stays.
    stand.edit("logs/c.csv", "1000,40,", "1000,off,");
    let other = import.replace("--out fleet", "--out other");
    stand.refuses(&other, 1, &["logs/c.csv, line 102, column `throttle_percent`: `off` is not a finite number"]);
    stand.refuses(import, 1, &["`fleet` exists and is not empty"]);
    fs::create_dir(stand.path("more")).unwrap();
    fs::copy(stand.path("logs/a.csv"), stand.path("more/a.csv")).unwrap();
    let alike = "import logs/a.csv more/a.csv --excitation staircase --fleet --out other";
    stand.refuses(alike, 1, &["two records would be called `a.csv`"]);
    stand.refuses(&format!("{other} --append"), 2, &["--fleet", "--append"]);
    assert!(Path::new(&stand.path("fleet/a/a.csv")).is_file());
}
