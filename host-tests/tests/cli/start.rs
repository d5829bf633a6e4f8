//! The first contact: what the program says to who asks nothing, and reports that are opened in a browser.

use std::fs;

use crate::stand::{Stand, flowing};

#[test]
fn without_arguments_three_lines_say_how_to_begin() {
    let stand = Stand::empty();
    let text = stand.run("");
    assert_eq!(text.lines().count(), 3, "{text}");
    assert!(text.lines().all(|line| line.starts_with("rotorlead ")), "{text}");
    // Who asks for something without saying for what has made a slip.
    stand.refuses("--force", 2, &["Usage: rotorlead", "--help"]);
}

/// A folder with a browser for `PATH`, which writes down what it is given once that is a whole page.
#[cfg(target_os = "linux")]
fn browser(stand: &Stand) -> String {
    use std::os::unix::fs::PermissionsExt as _;
    let script = "#!/bin/sh\ngrep -q '</html>' \"$1\" && echo \"$1\" > opened.part && mv opened.part opened\n";
    fs::create_dir(stand.path("bin")).unwrap();
    stand.write("bin/xdg-open", script);
    fs::set_permissions(stand.path("bin/xdg-open"), fs::Permissions::from_mode(0o755)).unwrap();
    let others = std::env::var("PATH").unwrap_or_default();
    format!("{}:{others}", stand.path("bin").canonicalize().unwrap().display())
}

/// What that browser was given.
#[cfg(target_os = "linux")]
fn opened(stand: &Stand) -> String {
    use std::time::{Duration, Instant};
    let (file, start) = (stand.path("opened"), Instant::now());
    while !file.exists() {
        assert!(start.elapsed() < Duration::from_secs(20), "nothing was opened");
        std::thread::sleep(Duration::from_millis(20));
    }
    let opened = fs::read_to_string(&file).unwrap();
    fs::remove_file(file).unwrap();
    opened.trim_end().to_owned()
}

#[cfg(target_os = "linux")]
#[test]
fn the_lines_to_begin_with_are_commands_that_work_and_open_what_they_wrote() {
    let stand = Stand::empty();
    let path = browser(&stand);
    for (line, report) in stand.run("").lines().zip([None, Some("report.html"), Some("demo-out/report.html")]) {
        let command = line.split("  ").next().unwrap();
        stand.command(command.strip_prefix("rotorlead ").unwrap()).env("PATH", &path).assert().code(0);
        if let Some(report) = report {
            assert_eq!(opened(&stand), stand.path(report).canonicalize().unwrap().display().to_string());
        }
    }
    // A report of a part is opened where it is named.
    stand.command("identify staircase.csv --report part.html --open --json -").env("PATH", &path).assert().code(0);
    assert!(opened(&stand).ends_with("/part.html"));
    // What failed leaves nothing to be opened.
    stand.command("identify nowhere.csv --report part.html --open").env("PATH", &path).assert().code(1);
    assert!(!stand.path("opened").exists());
}

#[cfg(target_os = "linux")]
#[test]
fn that_no_browser_can_be_opened_is_said_with_the_file_and_is_no_failure() {
    let stand = Stand::new();
    fs::create_dir(stand.path("empty")).unwrap();
    let mut command = stand.command("design model.toml --kind lead --out lead.toml --report design.html --open");
    let assert = command.env("PATH", stand.path("empty")).assert().code(0);
    let said = String::from_utf8(assert.get_output().stderr.clone()).unwrap();
    let expected = format!("open {} by hand", stand.path("design.html").canonicalize().unwrap().display());
    assert!(flowing(&said).contains(&expected), "no `{expected}` in {said}");
}

#[test]
fn a_report_that_is_opened_has_a_name_and_replaces_no_other_page() {
    let stand = Stand::new();
    let parts = ["--open opens the report, and --report names none", "--report report.html --open"];
    stand.refuses("design model.toml --out lead.toml --open", 2, &parts);
    fs::create_dir(stand.path("demo-out")).unwrap();
    stand.write("demo-out/report.html", "<!doctype html>\n<title>A page of mine</title>\n");
    stand.refuses("demo --open", 1, &["demo-out/report.html", "a report would replace it", "--force"]);
}

#[test]
fn a_report_whose_name_was_not_typed_asks_for_one_where_another_page_has_it() {
    let stand = Stand::new();
    stand.write("report.html", "<!doctype html>\n<title>A page of mine</title>\n");
    let parts = ["`report.html` exists and is of an unknown kind", "name another file with --out, or give --force"];
    stand.refuses("report stand", 1, &parts);
    stand.refuses("report stand --out report.html", 1, &["`report.html` of --out exists", "name another file, or"]);
}

#[test]
fn a_report_that_speaks_of_a_warning_prints_it() {
    let stand = Stand::empty();
    stand.run("sample staircase");
    let said = flowing(&stand.run("report staircase.csv --no-diagnosis"));
    let (_, warnings) = said.split_once("There is a warning: read it before the model is used").expect(&said);
    assert!(warnings.contains("warning: ") && warnings.contains(" help: "), "{said}");
}
