//! Ctrl-C, a full disk, a reader that is gone: no part of a file stays, and the exit status says what happened.

use std::fs;
use std::io::Read as _;
use std::process::{Child, Command as Process, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::stand::Stand;

/// The program with these arguments in the stand's folder, for what `assert_cmd` has no means for.
fn process(stand: &Stand, arguments: &str) -> Process {
    let mut process = Process::new(stand.command("").get_program());
    process.current_dir(stand.path(".")).args(arguments.split_whitespace());
    process.stdout(Stdio::null()).stderr(Stdio::piped());
    process
}

/// A stand whose plan takes long to run.
fn long_plan() -> Stand {
    let stand = Stand::new();
    let mut plan = String::from("format = 1\nname = \"long\"\nseed = 1\n");
    for _ in 0..2 {
        plan += "[[record]]\nnominal = 0.5\nexcitation = \"multisine\"\namplitude = 0.05\nlines = 150\nperiods = 200\n";
    }
    stand.write("plan.toml", plan);
    stand
}

/// The unfinished folder beside the destination, as soon as there is one and `is_so` of it.
fn unfinished(stand: &Stand, child: &mut Child, is_so: impl Fn(&std::path::Path) -> bool) {
    let since = Instant::now();
    loop {
        let mut names = fs::read_dir(stand.path(".")).unwrap().map(|entry| entry.unwrap().path());
        if names.any(|path| path.to_string_lossy().ends_with(".part") && is_so(&path)) {
            return;
        }
        assert!(child.try_wait().unwrap().is_none(), "it ended before it could be interrupted");
        assert!(since.elapsed() < Duration::from_secs(100), "there is no unfinished folder");
        sleep(Duration::from_millis(5));
    }
}

/// What ends the program: a closed terminal, Ctrl-C, Ctrl-\, and what `kill` sends; with the exit status that says so.
#[cfg(unix)]
const SIGNALS: [(&str, i32); 4] = [("-HUP", 129), ("-INT", 130), ("-QUIT", 131), ("-TERM", 143)];

#[cfg(unix)]
fn send(signal: &str, child: &Child) {
    // One that has ended takes no signal.
    let _ = Process::new("kill").args([signal, &child.id().to_string()]).stderr(Stdio::null()).status().unwrap();
}

#[cfg(unix)]
#[test]
fn a_signal_in_the_middle_leaves_nothing() {
    // While it simulates, and while it writes what it simulated.
    for (is_writing, (signal, code)) in [false, true].into_iter().flat_map(|is| SIGNALS.map(|signal| (is, signal))) {
        let stand = long_plan();
        let before = stand.everything();
        let arguments = "simulate --model model.toml --plan plan.toml --out sim";
        let mut child = process(&stand, arguments).spawn().unwrap();
        unfinished(&stand, &mut child, |path| !is_writing || path.join("experiment.toml").exists());
        if is_writing {
            sleep(Duration::from_millis(200));
        }
        send(signal, &child);
        let status = child.wait().unwrap();
        assert_eq!(status.code(), Some(code), "{status}");
        let left: Vec<_> = stand.everything().into_iter().map(|(path, _)| path).collect();
        assert_eq!(left, before.iter().map(|(path, _)| path.clone()).collect::<Vec<_>>());
    }
}

/// Commands that write, each with how often a signal of each kind ends it. The first three write a folder of records, a model with
/// a report and figures, and what a long search finds.
#[cfg(unix)]
const THAT_WRITE: [(&str, u32); 16] = [
    ("import long.csv --out imported", 3),
    ("identify sim --out found.toml --report found.html --figures found", 3),
    ("diagnose sim --redesign --out-model better.toml --out-plan next.toml --report better.html", 2),
    ("redact long.csv --out copy.csv", 3),
    ("validate sim --model model.toml --report judged.html --json judged.json", 4),
    ("report sim --out report.html", 4),
    ("simulate --model model.toml --plan plan.toml --out again --report again.html --figures again-figures", 3),
    ("check sim --json checked.json", 3),
    ("bandwidth --model model.toml --records sim --report wide.html --figures wide --json wide.json", 4),
    ("design --kind lead --model model.toml --out compensator.toml --report design.html", 4),
    ("excite --band 0.1..30 --rate 1000 --starts 4 --out period.csv --report period.html", 4),
    ("vehicle --airframe airframe.toml --model model.toml --report flight.html --figures flight", 3),
    ("new first", 4),
    ("sample staircase.csv", 4),
    ("man --out pages", 3),
    ("demo --out demo --report demo.html", 3),
];

#[cfg(unix)]
#[test]
fn a_signal_at_any_time_leaves_whole_files_and_no_others() {
    are_whole_after_signals(&THAT_WRITE[..3]);
}

#[cfg(unix)]
#[test]
#[ignore = "half a minute: `cargo xtask statistics`"]
fn a_signal_at_any_time_of_any_command_leaves_whole_files_and_no_others() {
    are_whole_after_signals(&THAT_WRITE);
}

/// Each command is ended at many times of its run. What it leaves is, byte for byte, what a whole run writes, or nothing.
#[cfg(unix)]
fn are_whole_after_signals(commands: &[(&str, u32)]) {
    let stand = Stand::new();
    stand.run("simulate --model model.toml --plan plan.toml --out sim");
    stand.write("long.csv", long_log());
    for &(arguments, times) in commands {
        let before = stand.everything();
        let start = Instant::now();
        stand.run(arguments);
        let (took, whole) = (start.elapsed(), stand.everything());
        assert!(whole.len() > before.len(), "`{arguments}` writes nothing");
        clear(&before, &whole);
        let mut ended_early = 0;
        for (time, (signal, code)) in (0..times).flat_map(|time| SIGNALS.map(|signal| (time, signal))) {
            let mut child = process(&stand, arguments).spawn().unwrap();
            sleep(took * (2 * time + 1) / (2 * times));
            send(signal, &child);
            let status = child.wait().unwrap();
            // At the very start nothing is watched over yet, and there is nothing to leave.
            assert!(matches!(status.code(), None | Some(0)) || status.code() == Some(code), "`{arguments}`: {status}");
            ended_early += usize::from(status.code() == Some(code));
            let left = stand.everything();
            for (path, content) in &left {
                let is_whole = whole.iter().any(|(known, whole)| known == path && whole == content);
                assert!(is_whole, "`{arguments}` with {signal} leaves {}", path.display());
            }
            clear(&before, &left);
        }
        assert!(ended_early > 0 || took < Duration::from_secs(1), "`{arguments}` was never ended early");
    }
}

/// Removes what was not there before.
#[cfg(unix)]
fn clear(before: &[(std::path::PathBuf, Option<Vec<u8>>)], after: &[(std::path::PathBuf, Option<Vec<u8>>)]) {
    for (path, content) in after.iter().filter(|(path, _)| before.iter().all(|(known, _)| known != path)) {
        // What is in a folder goes with it.
        let _ = if content.is_none() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
    }
}

/// A log of another tool that takes a while to import.
#[cfg(unix)]
fn long_log() -> String {
    let short =
        fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/records/tests/data/rcbenchmark.csv")).unwrap();
    let mut log = short.lines().next().unwrap().to_owned() + "\n";
    for row in 0..200_000 {
        let (time_s, pulse_us) = (f64::from(row) / 1000.0, 1200 + 200 * (row / 2000 % 2));
        log += &format!("{time_s:.6},{pulse_us},,500.000,15.5000,1.000,5000,,0.05,,\n");
    }
    log
}

/// Runs the program where no file may be longer than so many blocks of 512 bytes, which ends a write as a full disk does.
#[cfg(unix)]
pub fn with_little_room(stand: &Stand, blocks: u32, arguments: &str) -> (Option<i32>, String) {
    let program = stand.command("").get_program().to_owned();
    let output = Process::new("sh")
        .args(["-c", &format!("ulimit -f {blocks}; exec \"$0\" {arguments}")])
        .arg(program)
        .current_dir(stand.path("."))
        .output()
        .unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[cfg(unix)]
#[test]
fn a_file_for_which_there_is_no_room_is_named_and_no_part_of_it_stays() {
    let stand = Stand::new();
    stand.run("simulate --model model.toml --plan plan.toml --out sim");
    let log = concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/records/tests/data/esc32.csv");
    for (arguments, name) in [
        ("simulate --model model.toml --plan plan.toml --out full", "full/u050_multisine.csv"),
        (&format!("import {log} --out full")[..], "full/"),
        ("new full", "full/"),
        ("sample staircase.csv", "staircase.csv"),
        ("excite --band 0.1..2 --rate 1000 --starts 1 --out full.csv", "full.csv"),
        ("identify sim --out found.toml --report full.html", "full.html"),
        ("validate sim --model model.toml --report full.html", "full.html"),
        ("design --kind lead --model model.toml --out c.toml --report full.html", "full.html"),
        ("bandwidth --model model.toml --report full.html", "full.html"),
        ("bandwidth --model model.toml --figures full", "full/"),
        ("diagnose sim --report full.html", "full.html"),
        ("report sim --out full.html", "full.html"),
        ("demo --out full", "full/bode.svg"),
        ("man --out full", "full/rotorlead"),
    ] {
        let before: Vec<_> = stand.everything();
        let (status, report) = with_little_room(&stand, 4, arguments);
        assert_eq!(status, Some(1), "`{arguments}`: {report}");
        for part in ["cannot write", name, "free space"] {
            assert!(report.contains(part), "no `{part}` in what `{arguments}` says: {report}");
        }
        // What was complete before the room ran out stays; no part of a file does.
        for (path, content) in stand.everything() {
            let name = path.to_string_lossy();
            let is_whole = content.is_none_or(|content| content.len() < 2048) && !name.ends_with(".part");
            assert!(is_whole || before.iter().any(|(known, _)| *known == path), "`{arguments}` leaves {name}");
        }
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_device_is_named() {
    let stand = Stand::new();
    stand.run("simulate --model model.toml --plan plan.toml --out sim");
    for arguments in [
        "bandwidth --model model.toml --json /dev/full",
        "check sim --json /dev/full",
        "validate sim --model model.toml --report /dev/full",
        "design --kind lead --model model.toml --out /dev/full",
        "excite --band 0.1..2 --rate 100 --starts 1 --out /dev/full",
    ] {
        stand.refuses(arguments, 1, &["cannot write `/dev/full`", "No space left", "free space"]);
    }
    stand.refuses("new first --json /dev/full", 1, &["cannot write `/dev/full`", "No space left", "free space"]);
    for arguments in [
        "check sim",
        "",
        "new second",
        "sample",
        "completions bash",
        "man",
        "excite --band 0.1..2 --rate 100 --starts 1",
        "--help",
        "identify --help",
        "new -h",
        "--version",
    ] {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = process(&stand, arguments).stdout(full).output().unwrap();
        let report = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{arguments}: {report}");
        assert!(report.contains("cannot write to standard output"), "{arguments}: {report}");
    }
}

#[test]
fn a_closed_pipe_is_no_failure_of_any_command() {
    let stand = Stand::new();
    stand.run("simulate --model model.toml --plan plan.toml --out sim");
    let log = concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/records/tests/data/esc32.csv");
    for arguments in [
        "excite --band 0.1..2 --rate 100 --starts 1",
        "check sim",
        "check sim --json -",
        &format!("import {log} --out imported"),
        "simulate --model model.toml --plan plan.toml --out again",
        "identify sim --out found.toml",
        "validate sim --model model.toml",
        "design --kind lead --model model.toml --out c.toml",
        "bandwidth --model model.toml",
        "demo --out demo",
        "vehicle --airframe airframe.toml --model model.toml",
        "diagnose sim",
        "report sim --out r.html",
        "",
        "new first",
        "sample",
        "sample staircase.csv",
        "completions zsh",
        "man",
        "identify --help",
    ] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let mut child = process(&stand, arguments).stdout(writer).spawn().unwrap();
        let mut report = String::new();
        child.stderr.take().unwrap().read_to_string(&mut report).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(0), "{arguments}: {report}");
        assert!(!report.contains("panicked"), "{arguments}: {report}");
    }
}
