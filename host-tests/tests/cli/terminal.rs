//! What a terminal shows: help, suggestions, colors, progress, widths; and what completes a command.

use std::process::Command as Process;

use clap::CommandFactory as _;
use rotorlead_cli::Arguments;

use crate::gallery::{self, Shown};
use crate::stand::Stand;

/// Every command as it is called, those of `device` too.
fn commands() -> Vec<String> {
    let mut names = Vec::new();
    for command in Arguments::command().get_subcommands() {
        names.push(command.get_name().to_owned());
        names.extend(
            command.get_subcommands().map(|below| format!("{} --port x {}", command.get_name(), below.get_name())),
        );
    }
    names
}

#[test]
fn every_command_has_help_with_its_exit_status() {
    let stand = Stand::new();
    assert!(commands().len() > 20);
    for command in commands() {
        let help = stand.run(&format!("{command} --help"));
        for part in [
            "Usage:",
            "--quiet",
            "Exit status:\n  0    done",
            "  1    failed",
            "  2    wrong use",
            "  130  interrupted",
            "  143  ended by SIGTERM",
        ] {
            assert!(help.contains(part), "no `{part}` in the help of {command}:\n{help}");
        }
        // The line of usage is not broken.
        let mut lines = help.lines().filter(|line| !line.starts_with("Usage:"));
        assert!(lines.all(|line| line.chars().count() <= 80), "too wide:\n{help}");
        let short = stand.run(&format!("{command} -h"));
        assert!(!short.contains("Exit status:"), "{command}");
    }
}

#[test]
fn every_command_refuses_an_option_that_it_has_not() {
    for command in commands() {
        Stand::new().refuses(&format!("{command} --no-such-option"), 2, &["--no-such-option", "--help"]);
    }
}

#[test]
fn what_was_meant_is_offered() {
    let stand = Stand::new();
    for (arguments, meant) in [
        ("identify stand --ouut m.toml", "'--out'"),
        ("validate stand --modle model.toml", "'--model'"),
        ("bandwidth --model model.toml --jsn -", "'--json'"),
        ("chek stand", "'check'"),
        ("idnetify stand", "'identify'"),
        ("device --port x recrd", "'record'"),
        ("identify stand --out m.toml --delay atuo", "'auto'"),
        ("completions bsh", "'bash'"),
    ] {
        stand.refuses(arguments, 2, &[meant, "similar"]);
    }
}

#[test]
fn what_kind_was_meant_is_offered() {
    let stand = Stand::new();
    let good = stand.read("model.toml");
    for (kind, meant) in [("backlsh", "backlash"), ("transport-delay", "transport_delay"), ("slew_limt", "slew_limit")]
    {
        stand.write("model.toml", format!("{good}[[effect]]\nkind = \"{kind}\"\nparameters = {{}}\n"));
        let arguments = "simulate --model model.toml --plan plan.toml --out sim";
        stand.refuses(arguments, 1, &["model.toml:11:8", &format!("did you mean `{meant}`?")]);
    }
    stand.write("model.toml", good);
    stand.edit("plan.toml", "\"multisine\"", "\"multsine\"");
    let arguments = "simulate --model model.toml --plan plan.toml --out sim";
    stand.refuses(arguments, 1, &["plan.toml:9:14", "`multsine`", "did you mean `multisine`?"]);
}

#[test]
fn quiet_leaves_the_words_out_and_the_errors_and_the_json_in() {
    let stand = Stand::new();
    assert_eq!(stand.run("--quiet simulate --model model.toml --plan plan.toml --out sim"), "");
    assert_eq!(stand.run("identify sim --out found.toml -q"), "");
    assert!(stand.path("found.toml").exists());
    assert_eq!(stand.run("check sim --quiet --json c.json"), "");
    assert!(stand.read("c.json").contains("findings"));
    assert!(stand.json("bandwidth --model model.toml --quiet").is_object());
    stand.refuses("bandwidth --model nowhere.toml --quiet", 1, &["`nowhere.toml` does not exist"]);
}

#[test]
fn one_file_for_two_outputs_is_refused() {
    let stand = Stand::new();
    stand.run("simulate --model model.toml --plan plan.toml --out sim");
    for arguments in [
        "validate sim --model model.toml",
        "identify sim --out m.toml",
        "bandwidth --model model.toml",
        "design --kind lead --model model.toml --out c.toml",
        "diagnose sim",
        "excite --band 0.1..2 --rate 100 --starts 1",
    ] {
        let both = format!("{arguments} --json both --report both");
        stand.refuses(&both, 2, &["--json and --report are both `both`", "different files"]);
    }
    stand.refuses("report sim --out both --json both", 2, &["--json and --out are both `both`"]);
}

#[test]
fn what_is_read_is_not_written_over() {
    let stand = Stand::new();
    stand.run("simulate --model model.toml --plan plan.toml --out sim");
    let before = stand.everything();
    for arguments in [
        "report sim --out sim/u050_square.csv",
        "check sim --json sim/u050_square.csv",
        "identify sim --out sim/experiment.toml",
        "diagnose sim --out-model ./sim/../sim/u050_multisine.csv",
        "validate sim --model model.toml --report model.toml",
        "design --kind lead --model model.toml --out model.toml",
        "simulate --model model.toml --plan plan.toml --out other --json plan.toml",
    ] {
        stand.refuses(arguments, 2, &["written over", "name another file"]);
    }
    assert_eq!(stand.everything(), before);
    // A model beside the records is none of them, and may be made again.
    stand.run("identify sim --out sim/model.toml");
    stand.run("identify sim --out sim/model.toml");
}

#[test]
fn one_wrong_input_of_each_command_that_has_no_test_of_its_own_is_named() {
    let stand = Stand::new();
    stand.run("simulate --model model.toml --plan plan.toml --out sim");
    let model = stand.read("model.toml");
    stand.write("high.toml", model.replace("nominal = 0.4", "nominal = 0.7").replace("nominal = 0.5", "nominal = 0.8"));
    stand.refuses("diagnose sim --model high.toml", 1, &["0.5", "0.7"]);
    stand.refuses("validate sim --model high.toml", 1, &["u050_multisine.csv", "0.5", "0.7"]);
    stand.refuses("report nowhere --out r.html", 1, &["`nowhere` does not exist", "check the path"]);
    stand.refuses("report sim --out sim", 1, &["`sim` is a folder"]);
    stand.refuses("diagnose nowhere", 1, &["`nowhere` does not exist", "check the path"]);
    stand.refuses("device --port tcp:127.0.0.1:9 info", 1, &["tcp:127.0.0.1:9"]);
    stand.refuses("completions", 2, &["<SHELL>"]);
    stand.refuses("man --out model.toml", 1, &["`model.toml` is not a folder"]);
    let stand = Stand::new();
    stand.edit("stand/step.csv", "time_s,command,thrust_n", "time_s,command,voltage_v");
    for arguments in ["diagnose stand", "report stand --out r.html", "identify stand --out m.toml"] {
        stand.refuses(arguments, 1, &["step.csv:1:1", "column `thrust_n` is missing", "add it"]);
    }
}

#[test]
fn completions_are_scripts_that_name_the_commands() {
    let stand = Stand::new();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = stand.run(&format!("completions {shell}"));
        for command in Arguments::command().get_subcommands() {
            assert!(script.contains(command.get_name()), "{shell}: {}", command.get_name());
        }
    }
    stand.write("complete.bash", stand.run("completions bash"));
    // The script as bash takes it, and what it then offers after `rotorlead iden`.
    let offered = "source complete.bash; COMP_WORDS=(rotorlead iden); COMP_CWORD=1; \
                   _rotorlead rotorlead iden rotorlead; echo \"${COMPREPLY[@]}\"";
    let output = Process::new("bash").args(["--norc", "-c", offered]).current_dir(stand.path(".")).output();
    match output {
        Ok(output) => assert_eq!(String::from_utf8(output.stdout).unwrap().trim(), "identify"),
        Err(error) => eprintln!("skipped: no bash: {error}"),
    }
}

#[test]
fn the_manual_has_a_page_for_every_command() {
    let stand = Stand::new();
    let page = stand.run("man");
    for part in [".TH rotorlead 1", "SYNOPSIS", "Exit status"] {
        assert!(page.contains(part), "no `{part}` in\n{page}");
    }
    stand.run("man --out pages");
    for command in commands() {
        let name = command.replace(" --port x ", "-");
        let page = stand.read(&format!("pages/rotorlead-{name}.1"));
        assert!(page.contains(".SH SYNOPSIS") && page.contains("interrupted by Ctrl"), "{name}: {page}");
    }
    stand.run("man --out pages");
}

/// No line that is printed is wider than a terminal of 80 columns, the names of files aside.
#[test]
fn what_is_printed_fits_80_columns() {
    let mut too_wide = Vec::new();
    for Shown { arguments, text, .. } in gallery::shown() {
        assert!(!text.contains('\u{1b}'), "`{arguments}` is colored although it is no terminal");
        let is_file = |word: &&str| word.contains('/') || word.ends_with(".csv");
        for line in text.lines() {
            let names: usize = line.split(' ').filter(is_file).map(|name| name.chars().count()).sum();
            if line.chars().count() - names > 80 {
                too_wide.push(format!("{arguments}:\n{line}"));
            }
        }
    }
    assert!(too_wide.is_empty(), "wider than 80 columns:\n{}", too_wide.join("\n"));
}

#[cfg(target_os = "linux")]
mod pseudo {
    //! The program on a terminal.

    use std::fs::File;
    use std::io::Read as _;
    use std::process::{Command as Process, Stdio};

    use nix::pty::{Winsize, openpty};

    use crate::stand::Stand;

    /// What the program shows on a terminal of its own, and its exit status.
    fn shown(stand: &Stand, arguments: &str, environment: &[(&str, &str)]) -> (String, Option<i32>) {
        shown_in(80, stand, arguments, environment)
    }

    /// The same on a terminal of so many columns.
    fn shown_in(columns: u16, stand: &Stand, arguments: &str, environment: &[(&str, &str)]) -> (String, Option<i32>) {
        let terminal = openpty(&Winsize { ws_row: 24, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 }, None).unwrap();
        let mut process = Process::new(stand.command("").get_program());
        process.current_dir(stand.path(".")).args(arguments.split_whitespace());
        process.env("TERM", "xterm-256color").env_remove("NO_COLOR").envs(environment.iter().copied());
        let end = File::from(terminal.slave);
        process.stdin(Stdio::null()).stdout(end.try_clone().unwrap()).stderr(end);
        let mut child = process.spawn().unwrap();
        // The child holds the only end that writes: reading ends, by an error, when it does.
        drop(process);
        let mut bytes = Vec::new();
        let _ = File::from(terminal.master).read_to_end(&mut bytes);
        (String::from_utf8_lossy(&bytes).into_owned(), child.wait().unwrap().code())
    }

    /// The beginning of an escape sequence that sets a color or a weight.
    fn is_colored(text: &str) -> bool {
        text.split("\u{1b}[")
            .skip(1)
            .any(|rest| rest.trim_start_matches(|c: char| c.is_ascii_digit() || c == ';').starts_with('m'))
    }

    #[test]
    fn text_is_as_wide_as_the_terminal_within_what_can_be_read() {
        let stand = Stand::new();
        let widest = |columns| {
            let (text, _) = shown_in(columns, &stand, "bandwidth --model model.toml", &[("NO_COLOR", "1")]);
            text.lines().map(|line| line.trim_end().chars().count()).max().unwrap()
        };
        let [narrow, usual, wide, widest] = [50, 80, 100, 400].map(widest);
        assert!(narrow <= 50 && (60..=80).contains(&usual), "{narrow} {usual}");
        assert!((81..=100).contains(&wide) && (100..=110).contains(&widest), "{wide} {widest}");
    }

    #[test]
    fn colors_are_on_a_terminal_and_no_color_takes_them_off() {
        let stand = Stand::new();
        for (arguments, status) in
            [("identify --help", 0), ("bandwidth --model nowhere.toml", 1), ("identify --ouut", 2), ("check stand", 1)]
        {
            let (text, found) = shown(&stand, arguments, &[]);
            assert_eq!(found, Some(status), "{text}");
            assert!(is_colored(&text), "`{arguments}` has no color: {text:?}");
            let (text, _) = shown(&stand, arguments, &[("NO_COLOR", "1")]);
            assert!(!is_colored(&text), "`{arguments}` is colored in spite of NO_COLOR: {text:?}");
        }
    }

    #[test]
    fn long_work_shows_its_progress_with_the_time_left_unless_quiet() {
        let stand = Stand::new();
        stand.edit("plan.toml", "periods = 2", "periods = 390");
        stand.edit("plan.toml", "seed = 1\n", "seed = 1\nsample_rate_hz = 2500\n");
        let simulate = "simulate --model model.toml --plan plan.toml --out";
        let (text, status) = shown(&stand, &format!("{simulate} a"), &[]);
        assert_eq!(status, Some(0), "{text}");
        assert!(text.contains("simulating") && text.contains("left"), "no progress in {text:?}");
        for arguments in ["identify a --out found.toml", "check a", "validate a --model model.toml"] {
            let (text, status) = shown(&stand, arguments, &[]);
            assert_eq!(status, Some(0), "{text}");
            assert!(text.contains("left"), "no time left in what `{arguments}` shows: {text:?}");
        }
        let (text, status) = shown(&stand, &format!("{simulate} b --quiet"), &[]);
        assert_eq!((text.as_str(), status), ("", Some(0)));
    }
}
