//! What an output replaces, and what it refuses to: a file of another kind, such as a log.

use crate::stand::{MODEL, PLAN, Stand};

const LOG: &str = "time_s,command,thrust_n\n0,0.4,1\n1,0.5,2\n";
const NOTES: &str = "The bearing was changed before run 3.\n";

/// A stand with records, and files of every kind that is written.
fn written() -> Stand {
    let stand = Stand::new();
    stand.run("simulate --model model.toml --plan plan.toml --out sim");
    stand.run("design --kind lead --model model.toml --out lead.toml --json values.json");
    stand.run("design --kind inverse --model model.toml --out inverse.toml");
    stand.run("validate sim --model model.toml --report page.html");
    stand.run("excite --band 0.1..2 --rate 100 --out commands.csv");
    stand.write("log.csv", LOG);
    stand.write("notes.txt", NOTES);
    stand.write("package.json", "{\"name\": \"stand\", \"generator\": \"another\", \"warnings\": []}\n");
    stand.write("list.json", "[1, 2]\n");
    stand
}

/// Commands that write one kind of file to `@`.
const IDENTIFY: &str = "identify sim --out @";
const DESIGN: &str = "design --kind lead --model model.toml --out @";
const REPORT: &str = "validate sim --model model.toml --report @";
const JSON: &str = "validate sim --model model.toml --json @";
const EXCITE: &str = "excite --band 0.1..2 --rate 100 --out @";

#[test]
fn what_this_kind_of_output_did_not_write_is_not_replaced() {
    let stand = written();
    let unknown = "of an unknown kind";
    for (command, file, found, kind) in [
        (IDENTIFY, "log.csv", unknown, "a model"),
        (IDENTIFY, "notes.txt", unknown, "a model"),
        (IDENTIFY, "lead.toml", "a compensator", "a model"),
        (DESIGN, "plan.toml", "a plan", "a compensator"),
        (DESIGN, "sim/experiment.toml", "the description of an experiment", "a compensator"),
        (REPORT, "log.csv", unknown, "a report"),
        (REPORT, "values.json", "JSON of this program", "a report"),
        (JSON, "notes.txt", unknown, "JSON of this program"),
        (JSON, "page.html", "a report", "JSON of this program"),
        (JSON, "package.json", unknown, "JSON of this program"),
        (JSON, "list.json", unknown, "JSON of this program"),
        (EXCITE, "log.csv", unknown, "a table of commands"),
    ] {
        let arguments = command.replace('@', file);
        let refused =
            [file, &format!("exists and is {found}; {kind} would replace it"), "name another file", "--force"];
        stand.refuses(&arguments, 1, &refused);
    }
}

#[test]
fn a_page_that_is_none_of_ours_and_a_text_that_only_begins_as_json_are_not_replaced() {
    let stand = written();
    stand.write("other.html", "<!doctype html>\n<title>A thrust stand</title>\n");
    stand.write("cut.json", "{\"points\": [");
    stand.refuses(&REPORT.replace('@', "other.html"), 1, &["other.html", "--force"]);
    stand.refuses(&JSON.replace('@', "cut.json"), 1, &["cut.json", "--force"]);
}

#[test]
fn a_file_of_the_same_kind_is_replaced_and_that_is_said() {
    let stand = written();
    stand.write("map.toml", format!("# by hand\n{MODEL}"));
    for (command, file, is_said) in [
        (IDENTIFY, "map.toml", true),
        (DESIGN, "lead.toml", true),
        (DESIGN, "inverse.toml", true),
        (REPORT, "page.html", false),
        (JSON, "values.json", false),
        (EXCITE, "commands.csv", false),
    ] {
        let said = stand.run(&command.replace('@', file));
        assert_eq!(said.contains(&format!("Replaced {file}")), is_said, "{said}");
        assert!(!said.contains("Written to"), "{said}");
    }
    assert!(stand.run(&REPORT.replace('@', "page.html")).contains("Report, replaced: page.html"));
    stand.run("diagnose sim --redesign --out-model map.toml --out-plan plan.toml --out-compensator lead.toml");
    let said = stand.run(&IDENTIFY.replace('@', "new.toml"));
    assert!(said.contains("Written to new.toml"), "{said}");
    // In an empty file nothing is lost.
    stand.write("empty.toml", "");
    stand.run(&IDENTIFY.replace('@', "empty.toml"));
}

#[test]
fn figures_and_tables_take_the_place_of_their_own_kind_alone() {
    let stand = written();
    let draw = "validate sim --model model.toml --figures drawn";
    stand.run(draw);
    stand.run(draw);
    // What has another name stays where it is.
    stand.write("drawn/notes.csv", LOG);
    for (file, content, kind) in [
        ("drawn/validation_in_time_u050_square.svg", "<svg xmlns=\"http://www.w3.org/2000/svg\"/>\n", "a figure"),
        ("drawn/validation_in_time_u050_square.png", "\u{89}PNG of a camera", "a figure"),
        ("drawn/validation_in_time_u050_square.csv", LOG, "a table"),
        ("drawn/validation.csv", LOG, "a table"),
    ] {
        let own = std::fs::read(stand.path(file)).unwrap();
        stand.write(file, content);
        let said = [file, "of --figures exists", &format!("{kind} would replace it"), "another folder", "--force"];
        stand.refuses(draw, 1, &said);
        stand.run(&format!("{draw} --force"));
        assert!(std::fs::read(stand.path(file)).unwrap() == own, "{file}");
    }
    assert_eq!(stand.read("drawn/notes.csv"), LOG);
}

#[test]
fn a_dash_is_standard_output_for_json_alone() {
    let stand = written();
    for command in [IDENTIFY, DESIGN, REPORT, EXCITE] {
        stand.refuses(&command.replace('@', "-"), 2, &["only --json goes to standard output"]);
    }
    assert!(stand.run(&JSON.replace('@', "-")).starts_with('{'));
}

#[test]
fn force_replaces_what_is_there() {
    let stand = written();
    stand.run(&format!("--force {}", IDENTIFY.replace('@', "notes.txt")));
    stand.run(&format!("{} --force", DESIGN.replace('@', "plan.toml")));
    assert!(stand.read("notes.txt").contains("[[point]]") && !stand.read("plan.toml").contains(&PLAN[..20]));
    // What is read is never written over.
    stand.refuses("validate sim --model model.toml --json model.toml --force", 2, &["written over"]);
}

#[test]
fn a_folder_that_is_called_as_no_number_is_one_all_the_same() {
    let stand = written();
    std::fs::rename(stand.path("sim"), stand.path("inf")).unwrap();
    assert!(stand.run("identify inf").contains("rotorlead identify inf --out"));
    assert!(stand.run("validate inf --model model.toml --figures NaN").contains("Figures in NaN:"));
}
