//! `rotorlead diagnose` with what follows from it: the compensator anew, the next experiment, figures.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::stand::{Stand, program};

const POINTS: &str = "format = 1\n[[point]]\nnominal = 0.5\ngain = 10.1718\ntime_constant_s = 0.1076554\n\
                      [[point]]\nnominal = 0.65\ngain = 16.1063\ntime_constant_s = 0.0707839\n";

/// Runs the program in `folder`; gives what it prints.
fn run(folder: &Path, arguments: &str) -> String {
    let output = program().current_dir(folder).args(arguments.split(' ')).output().unwrap();
    assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// An experiment on an actuator with this `[[effect]]`.
fn stand(folder: &Path, effect: &str) {
    fs::write(folder.join("plan.toml"), host_tests::stand_plan()).unwrap();
    fs::write(folder.join("model.toml"), format!("{POINTS}{effect}")).unwrap();
    run(folder, "simulate --model model.toml --plan plan.toml --out stand");
}

fn json(folder: &Path, file: &str) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.join(file)).unwrap()).unwrap()
}

#[test]
fn an_actuator_with_a_slew_limit_is_not_sped_up_and_it_is_said_why() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    stand(folder, "[[effect]]\nkind = \"slew_limit\"\n[effect.parameters]\nrate_per_s = 0.6\n");
    let said = run(
        folder,
        "diagnose stand --redesign --out-compensator c.toml --out-plan next.toml --figures figures --json out.json",
    );
    for part in [
        "Missing in the model: slew-rate limit.",
        "- The compensator is refused at an amplitude of 0.05 duty: it would ask for more than the actuator follows.",
        "change faster than the 0.5",
        "no filter can make it",
        "Nothing is written to c.toml",
    ] {
        // Wherever the lines end.
        let words: Vec<&str> = said.split_whitespace().collect();
        assert!(words.join(" ").contains(part), "no \"{part}\" in\n{said}");
    }
    assert!(!folder.join("c.toml").exists());
    let weaker = run(folder, "diagnose stand --redesign --at-amplitude 0.02");
    assert!(weaker.contains("The strongest lead that stays within the limits"), "{weaker}");
    for line in said.lines().chain(weaker.lines()) {
        assert!(line.chars().count() <= 80, "{} columns: {line}", line.chars().count());
    }
    let found = json(folder, "out.json");
    assert_eq!(found["redesign"]["verdict"], "refused");
    let point = &found["redesign"]["points"][1];
    let limit = &point["limits"][0];
    let number = |value: &Value| value.as_f64().unwrap_or_else(|| panic!("{value} in {found:#}"));
    assert_eq!(limit["kind"], "slew_limit");
    // Where 0.05 omega |C(j omega)| passes the rate that was hidden; before the lead does anything this is 0.6 / 0.05.
    assert!((8.0..12.0).contains(&number(&limit["passed_from_rad_s"])), "{limit}");
    assert!(number(&point["chain_rad_s"]) < 0.2 * number(&point["compensated_rad_s"]), "{point}");
    // The report's tables have the same numbers.
    let table = |name: &str| fs::read_to_string(folder.join("figures").join(name)).unwrap();
    for (name, value) in [
        ("limits.csv", &limit["passed_from_rad_s"]),
        ("limits.csv", &limit["reachable_rad_s"]),
        ("redesign.csv", &point["compensated_rad_s"]),
        ("redesign.csv", &point["chain_rad_s"]),
    ] {
        let row = table(name).lines().last().unwrap().to_owned();
        let is_same = |cell: &str| cell.parse::<f64>().is_ok_and(|cell| (cell / number(value) - 1.0).abs() < 1e-12);
        assert!(row.split(',').any(is_same), "{value} is not in {row} of {name}");
    }
    // A lead that is small enough for the limit is designed, and written.
    let said = run(folder, "diagnose stand --redesign --at-amplitude 0.001 --out-compensator c.toml");
    assert!(
        said.contains("The compensator for the improved model: zero 14.1") && said.contains("Written to c.toml"),
        "{said}"
    );
    assert!(folder.join("c.toml").is_file());
    // The figures have names, units and no empty picture.
    for (figure, words) in [
        ("where", &["frequency, Hz", "u_nom", "0.65"][..]),
        ("candidates", &["slew_limit (named)", "log likelihood"]),
        ("gap", &["u065_multisine.csv", "percent", "noise alone"]),
        ("residual", &["time in the record, s", "measured less simulated, N"]),
        ("bandwidth", &["bandwidth, rad/s", "bandwidth, Hz", "with compensator, sinusoids of 0.05 duty"]),
    ] {
        let svg = fs::read_to_string(folder.join("figures").join(format!("{figure}.svg"))).unwrap();
        for word in words {
            assert!(svg.contains(word), "{figure}: no {word}");
        }
        let csv = fs::read_to_string(folder.join("figures").join(format!("{figure}.csv"))).unwrap();
        // Commas within quotes part nothing.
        let cells = |line: &str| line.split('"').step_by(2).collect::<String>().split(',').count();
        let columns = cells(csv.lines().next().unwrap());
        assert!(csv.lines().count() > 1 && csv.lines().all(|line| cells(line) == columns), "{csv}");
    }
}

/// What `report` says of an actuator with this `[[effect]]`, as JSON, and its page.
fn reported(effect: &str) -> (Value, String) {
    let folder = tempfile::tempdir().unwrap();
    stand(folder.path(), effect);
    run(folder.path(), "report stand --kind lead --out r.html --json r.json");
    (json(folder.path(), "r.json"), fs::read_to_string(folder.path().join("r.html")).unwrap())
}

/// The commands that a report ends with, without markup.
fn commands(page: &str) -> String {
    let lines = page.split("<pre><code>").nth(1).unwrap().split("</code>").next().unwrap();
    lines.split('<').map(|part| part.split_once('>').map_or(part, |(_, words)| words)).collect()
}

#[test]
fn a_report_designs_for_the_model_that_the_diagnosis_has_extended() {
    let (limited, page) = reported("[[effect]]\nkind = \"slew_limit\"\n[effect.parameters]\nrate_per_s = 0.6\n");
    let sentences = limited["sentences"].to_string();
    assert_eq!(limited["verdict"], "Missing in the model: slew-rate limit.");
    // The lags with the limit are those that were hidden; those without it are twice as slow.
    assert!(sentences.contains("With that in the model: 2 lags, time constants from 70."), "{sentences}");
    let why = limited["left_out"]["compensator"].as_str().unwrap();
    assert!(why.contains("change faster than the 0.5"), "{why}");
    assert!(sentences.contains("switch that off in its settings"), "{sentences}");
    assert!(commands(&page).contains("--out-model improved.toml --redesign --out-compensator compensator.toml"));
    // That a lag does not suffice is no open question any more.
    assert!(!page.contains("a first-order lag leaves"), "{}", limited["warnings"]);

    let (second, page) = reported("[[effect]]\nkind = \"second_pole\"\n[effect.parameters]\ntime_constant_s = 0.01\n");
    let sentences = second["sentences"].to_string();
    assert!(second["left_out"]["compensator"].is_null(), "{second:#}");
    assert!(sentences.contains("Predicted bandwidth"), "{sentences}");
    // What a lead does about it is said once, beside the lead.
    assert_eq!(page.matches("A second lag of 10.").count(), 1);
    assert!(
        !sentences.contains("A second lag of 10.") && page.contains("For the model that the diagnosis has extended.")
    );
}

#[test]
fn a_report_on_a_motor_too_slow_for_the_papers_lead_has_the_most_that_it_allows_and_commands_that_work() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("plan.toml"), host_tests::stand_plan()).unwrap();
    let slow = POINTS.replace("0.1076554", "0.1593422").replace("0.0707839", "0.12");
    fs::write(folder.join("slow.toml"), slow).unwrap();
    run(folder, "simulate --model slow.toml --plan plan.toml --out stand");
    let said = run(folder, "report stand --kind lead --no-diagnosis --out report.html --json report.json");
    assert!(said.contains("Predicted bandwidth") && !said.contains("No compensator"), "{said}");
    let page = fs::read_to_string(folder.join("report.html")).unwrap();
    assert!(page.contains("lower than the paper's 628.3"));
    let commands = commands(&page);
    let design = commands.lines().find(|line| line.contains(" design ")).unwrap_or_else(|| panic!("{commands}"));
    assert!(design.contains("--omega-g "), "{design}");
    for command in commands.lines().skip(1).filter(|line| !line.contains(" diagnose ")) {
        run(folder, command.strip_prefix("rotorlead ").unwrap());
    }
}

#[test]
fn a_redesign_for_a_slow_motor_has_the_most_that_it_allows_as_a_design_has() {
    let stand = Stand::new();
    stand.write("slow.toml", "format = 1\n[[point]]\nnominal = 0.5\ngain = 7.1\ntime_constant_s = 0.25\n");
    stand.run("simulate slow.toml --plan plan.toml --out sim");
    let found = stand.json("diagnose sim --redesign --kind lead --out-compensator again.toml --out-model found.toml");
    let warning = found["warnings"][0].as_str().unwrap();
    assert!(warning.contains("lower than the paper's 628.3"), "{warning}");
    assert_eq!(found["redesign"]["verdict"], "designed");
    let designed = stand.json("design found.toml --kind lead --out c.toml");
    assert!(designed["warnings"].as_array().unwrap().contains(&found["warnings"][0]), "{designed}");
    assert_eq!(stand.read("again.toml"), stand.read("c.toml"));
    // What is asked for is not lowered.
    let asked = stand.json("diagnose sim --redesign --omega-g 628.3");
    assert_eq!(asked["redesign"]["verdict"], "none");
}

/// A curve that only the square waves are large enough for shows in how they begin, if the motor had settled before.
#[test]
fn an_effect_found_in_transients_comes_with_the_condition_of_a_steady_start() {
    const CONDITION: &str = "Valid only if each record starts in steady state at u_nom.";
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut plan =
        "format = 1\nname = \"stand\"\nseed = 3\nloop_rate_hz = 200\nsample_rate_hz = 200\n[noise]\nsigma_n = 0.01\n"
            .to_owned();
    for nominal in [0.5, 0.65] {
        let square = format!(
            "[[record]]\nnominal = {nominal}\nexcitation = \"square\"\namplitude = 0.05\nhalf_period_s = 5\nperiods = 3\n\
             warm_up_periods = 0\n"
        );
        plan += &format!(
            "[[record]]\nnominal = {nominal}\nexcitation = \"multisine\"\namplitude = 0.005\nlines = 150\nperiods = 3\n\
             warm_up_periods = 0\nrealization = 1\n{square}{square}"
        );
    }
    fs::write(folder.join("plan.toml"), plan).unwrap();
    let curved = "[[effect]]\nkind = \"quadratic_thrust\"\nparameters = { curvature_per_duty = 4.0 }\n";
    fs::write(folder.join("model.toml"), format!("{POINTS}{curved}")).unwrap();
    run(folder, "simulate --model model.toml --plan plan.toml --out stand");
    let said = run(folder, "diagnose stand --json out.json --report report.html");
    let found = json(folder, "out.json");
    assert_eq!(found["effects"][0]["kind"], "quadratic_thrust", "{said}");
    assert_eq!(found["needs_steady_start"], true);
    assert!(said.split_whitespace().collect::<Vec<_>>().join(" ").contains(CONDITION), "{said}");
    assert!(fs::read_to_string(folder.join("report.html")).unwrap().contains(CONDITION));
    // Multisines of large amplitude show the curvature by themselves, without that condition.
    let plan = fs::read_to_string(folder.join("plan.toml")).unwrap().replace("amplitude = 0.005", "amplitude = 0.05");
    fs::write(folder.join("plan.toml"), plan).unwrap();
    run(folder, "simulate --model model.toml --plan plan.toml --out loud");
    let said = run(folder, "diagnose loud --json out.json");
    let found = json(folder, "out.json");
    assert_eq!(found["effects"][0]["kind"], "quadratic_thrust", "{said}");
    assert_eq!(found["needs_steady_start"], false);
    assert!(!said.split_whitespace().collect::<Vec<_>>().join(" ").contains(CONDITION), "{said}");
}

#[test]
fn where_nothing_is_missing_the_redesign_is_what_design_and_bandwidth_give() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    stand(folder, "");
    let said = run(
        folder,
        "diagnose stand --redesign --out-model m.toml --out-compensator c.toml --out-plan next.toml --json out.json",
    );
    assert!(said.contains("No further experiment needed: no plan is written"), "{said}");
    run(folder, "design --kind lead --model m.toml --out d.toml");
    assert_eq!(fs::read(folder.join("c.toml")).unwrap(), fs::read(folder.join("d.toml")).unwrap());
    run(folder, "bandwidth --model m.toml --json bandwidth.json");
    let redesign = json(folder, "out.json")["redesign"].take();
    let points = json(folder, "bandwidth.json")["points"].take();
    for (ours, theirs) in redesign["points"].as_array().unwrap().iter().zip(points.as_array().unwrap()) {
        for key in ["nominal", "uncompensated_rad_s", "compensated_rad_s"] {
            let [a, b] = [ours, theirs].map(|point| point[key].as_f64().unwrap());
            assert!((a / b - 1.0).abs() < 1e-12, "{key}: {a} and {b}");
        }
    }
    assert_eq!(points.as_array().unwrap().len(), 2);
}

#[test]
fn options_that_lack_what_they_are_about_are_wrong_use() {
    for (arguments, words) in [
        ("diagnose", &["<DIR>"][..]),
        ("diagnose stand --omega-g 100", &["add --redesign"]),
        ("diagnose stand --out-compensator c.toml", &["--redesign"]),
    ] {
        let output = program().args(arguments.split(' ')).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments}: {said}");
        for word in words {
            assert!(said.contains(word), "{arguments}: no {word} in\n{said}");
        }
    }
}
