//! What is in the data stays data: no order to a terminal, no markup in a page, no formula in a table.

use std::fs;
use std::path::Path;

use crate::stand::Stand;

/// The library for figures, which has controls of its own.
const LIBRARY: &str = include_str!("../../../sim/report/vendor/plotly/plotly-cartesian.min.js");

/// What erases a terminal, by either form of the escape, and what turns the direction of text.
const ORDERS: [&str; 4] = ["\u{1b}[2J", "\u{9b}2J", "\u{7}", "\u{202e}"];

fn assert_shown(text: &str, place: &str) {
    let order = text.chars().find(|&sign| sign.is_control() && !"\n\t".contains(sign) || sign == '\u{202e}');
    assert_eq!(order, None, "{place}");
}

/// Runs the program on what is in the stand, and asserts that nothing of what it prints is an order; gives what it prints.
fn shown(stand: &Stand, arguments: &[&str]) -> String {
    let output = stand.command("").args(arguments).output().unwrap();
    let printed = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    printed.iter().for_each(|text| assert_shown(text, &format!("{arguments:?}")));
    printed.concat()
}

/// Whatever is below a folder: pages are UTF-8 without orders, tables without formulas.
fn assert_files_shown(folder: &Path) {
    for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let end = entry.extension().unwrap_or_default().to_string_lossy().into_owned();
        let name = entry.display().to_string();
        match end.as_str() {
            "svg" | "csv" => assert_shown(&fs::read_to_string(&entry).unwrap(), &name),
            // The library for figures has some of its own.
            "html" => assert_shown(&fs::read_to_string(&entry).unwrap().replace(LIBRARY, ""), &name),
            _ => {}
        }
        if end == "csv" {
            let mut rows = csv_fields(&fs::read_to_string(&entry).unwrap());
            let formula = rows.find(|cell| cell.starts_with(['=', '@', '+']));
            assert_eq!(formula, None, "{name}");
        }
    }
}

/// Cells; none of them has a comma where this is asked.
fn csv_fields(text: &str) -> impl Iterator<Item = String> + use<> {
    let fields = text.lines().flat_map(|line| line.split(',')).map(|cell| cell.trim_matches('"').to_owned());
    fields.collect::<Vec<_>>().into_iter()
}

#[test]
fn no_place_gives_a_terminal_orders() {
    for order in ORDERS {
        let stand = Stand::new();
        let toml_order = format!(
            "\\u{:04x}{}",
            u32::from(order.chars().next().unwrap()),
            &order[order.chars().next().unwrap().len_utf8()..]
        );
        // Column names, cells, and file names that cannot be read.
        stand.write(
            "odd.csv",
            format!("time_s,command,thrust_n,x{order}\n0,0.1,1,2\n0.1,0.1,1,2\n0.2,0.2,z{order},2\n"),
        );
        shown(&stand, &["import", "odd.csv", "--excitation", "step", "--out", "odd"]);
        stand.write("odd.csv", format!("x{order},y{order}\n0,0.1\n0.1,0.1\n"));
        shown(&stand, &["import", "odd.csv", "--excitation", "step", "--out", "odd"]);
        shown(&stand, &["check", &format!("no{order}where")]);
        shown(&stand, &["identify", &format!("no{order}where"), "--out", "m.toml"]);
        // Wrong use, by the parser of the command line and beyond it.
        shown(&stand, &["check", "stand", &format!("--{order}")]);
        shown(&stand, &["bandwidth", "--model", "model.toml", "--steps", &format!("1{order}")]);
        shown(&stand, &["check", "stand", "--json", &format!("stand/../stand/{order}/x")]);
        // Text and excerpts of TOML: escaped in the file, and raw.
        let experiment = stand.read("stand/experiment.toml");
        for wrong in [
            experiment.replace("name = \"step\"", &format!("name = \"{toml_order}\"")),
            experiment.replace("output = \"thrust_n\"", &format!("output = \"{toml_order}\"")),
            experiment.replace("output = \"thrust_n\"", &format!("# {order}\noutput = \"{order}\"")),
            experiment.replace("step.csv", &format!("{toml_order}.csv")),
            format!("{experiment}\"{toml_order}\" = 1\n"),
        ] {
            stand.write("stand/experiment.toml", wrong);
            for arguments in
                [&["check", "stand"][..], &["identify", "stand", "--out", "m.toml"], &["check", "stand", "--json", "-"]]
            {
                shown(&stand, arguments);
            }
        }
        // The rows of a record.
        stand.write("stand/experiment.toml", &experiment);
        stand.write("stand/step.csv", format!("time_s,command,thrust_n\n0,0.4,1\n0.1,{order},1\n"));
        shown(&stand, &["check", "stand"]);
    }
}

#[test]
fn a_name_with_a_line_break_begins_no_line_of_what_is_said() {
    let stand = Stand::new();
    let forged = "x\nerror: forged";
    let says = |arguments: &[&str]| {
        let said = shown(&stand, arguments);
        let line = said.lines().find(|line| line.trim_start_matches([' ', '×']).starts_with("error: forged"));
        assert_eq!(line, None, "{arguments:?}\n{said}");
        said
    };
    // Of files, that are there or not.
    stand.write(forged, "");
    for path in [forged, "y\nerror: forged"] {
        for arguments in [&["check", path][..], &["identify", path, "--out", "m.toml"], &["import", path, "--out", "o"]]
        {
            assert!(says(arguments).contains("a line break in its name"));
        }
    }
    // Of a record, its columns and its experiment.
    let experiment = stand.read("stand/experiment.toml");
    let step = stand.read("stand/step.csv");
    stand.write("stand/step.csv", step.replacen("thrust_n", &format!("thrust_n,\"{forged}\""), 1));
    assert!(says(&["check", "stand"]).contains("x␊error: forged"));
    stand.write("stand/step.csv", step);
    for (from, to) in [("name = \"step\"", "name = \"x\\nerror: forged\""), ("step.csv", "x\\nerror: forged")] {
        stand.write("stand/experiment.toml", experiment.replacen(from, to, 1));
        for arguments in [&["check", "stand"][..], &["identify", "stand", "--out", "m.toml"]] {
            assert!(says(arguments).contains("a text with a line break"));
        }
    }
    // Of a motor.
    fs::create_dir_all(stand.path("fleet")).unwrap();
    stand.write("fleet/fleet.csv", format!("log,motor\na,\"{forged}\"\nb,M\nc,M\nd,M\n"));
    for log in ["a", "b", "c", "d"] {
        fs::create_dir(stand.path("fleet").join(log)).unwrap();
        stand.write(&format!("fleet/{log}/model.toml"), crate::stand::MODEL);
    }
    assert!(says(&["fleet", "fleet", "--verbose"]).contains("x␊error:"));
}

#[test]
fn a_name_with_orders_and_markup_and_formulas_is_a_name() {
    let stand = Stand::with_two_levels();
    stand.run("simulate --model actuators.toml --plan plan.toml --out sim");
    let evil = "=1+1\\u001b[2J<script>\\u009b\\u202e";
    let named = stand.read("sim/experiment.toml").replacen("name = \"", &format!("name = \"{evil}"), 1);
    // A record that is called like a formula, and obeyed by a terminal.
    let record = "=u050\u{1b}[2J_multisine.csv";
    fs::rename(stand.path("sim/u050_multisine.csv"), stand.path("sim").join(record)).unwrap();
    stand.write("sim/experiment.toml", named.replace("u050_multisine.csv", "=u050\\u001b[2J_multisine.csv"));
    fs::create_dir(stand.path("out")).unwrap();
    for arguments in [
        &["check", "sim"][..],
        &["identify", "sim", "--out", "m.toml", "--report", "out/i.html", "--figures", "out", "--verbose"],
        &["validate", "sim", "--model", "actuators.toml", "--report", "out/v.html", "--figures", "out"],
        &["diagnose", "sim", "--report", "out/d.html", "--figures", "out"],
    ] {
        shown(&stand, arguments);
    }
    assert_files_shown(&stand.path("out"));
    let page = fs::read_to_string(stand.path("out/i.html")).unwrap();
    assert!(page.contains("=1+1␛[2J&#60;script&#62;"), "the name is not in the page");
}

#[test]
fn a_fleet_of_odd_names_is_shown() {
    let stand = Stand::new();
    fs::create_dir_all(stand.path("fleet/a")).unwrap();
    fs::create_dir_all(stand.path("out")).unwrap();
    let logs: String = (0..4).map(|log| format!("\"log{log}\u{1b}[2J\",\"=M{}\u{1b}[31m\"\n", log % 2)).collect();
    stand.write("fleet/fleet.csv", format!("log,motor\n{logs}"));
    for log in 0..4 {
        let folder = stand.path("fleet").join(format!("log{log}\u{1b}[2J"));
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("model.toml"), crate::stand::MODEL).unwrap();
    }
    let said = shown(&stand, &["fleet", "fleet", "--report", "out/f.html", "--figures", "out", "--verbose"]);
    assert!(said.contains("=M0␛[31m"), "{said}");
    assert_files_shown(&stand.path("out"));
}
