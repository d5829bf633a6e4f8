//! Reports as a browser shows them: nothing is asked of the network, nothing is cut or overlaps at the width of a desk and
//! of a pocket, by day and by night, and what looks as if it could be used can be.
//!
//! With `ROTORLEAD_SCREENSHOTS=DIR` in the environment every page is also written there as PNG.

mod browser;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use serde::Deserialize;

use browser::{Chromium, OpenPage};

const CHECKS: &str = include_str!("checks.js");
/// Widths of a window, pixels.
const WIDTHS: [u32; 2] = [1280, 390];

/// An actuator with a slew limit that its first model does not have, so that a diagnosis has something to find.
const MODEL: &str = "format = 1\n[[point]]\nnominal = 0.5\ngain = 10.1718\ntime_constant_s = 0.1076554\n\
                     [[point]]\nnominal = 0.65\ngain = 16.1063\ntime_constant_s = 0.0707839\n";
const EFFECT: &str = "[[effect]]\nkind = \"slew_limit\"\n[effect.parameters]\nrate_per_s = 0.6\n";

/// The paper's measured bandwidths at three levels.
const BANDWIDTHS: &str = "u_nom,uncompensated_rad_s,compensated_rad_s\n0.4,7.6139,10.5564\n0.5,11.7689,68.9652\n\
                          0.65,14.7953,97.1847\n";

fn run(folder: &Path, arguments: &str) {
    let output = Command::new(assert_cmd::cargo::cargo_bin("rotorlead"))
        .current_dir(folder)
        .args(arguments.split(' '))
        .output()
        .unwrap();
    assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
}

/// Reports of every kind in `folder`.
fn reports(folder: &Path) -> Vec<PathBuf> {
    fs::write(folder.join("plan.toml"), host_tests::stand_plan()).unwrap();
    fs::write(folder.join("model.toml"), MODEL).unwrap();
    fs::write(folder.join("limited.toml"), format!("{MODEL}{EFFECT}")).unwrap();
    fs::write(folder.join("bandwidths.csv"), BANDWIDTHS).unwrap();
    let low = "[[point]]\nnominal = 0.4\ngain = 9.9955\ntime_constant_s = 0.15934\n";
    fs::write(folder.join("three.toml"), MODEL.replacen("[[point]]", &format!("{low}[[point]]"), 1)).unwrap();
    run(folder, "simulate --model limited.toml --plan plan.toml --out stand --report simulate.html");
    run(folder, "report stand --out report.html");
    run(folder, "design --model model.toml --loop-rate 200 --omega-g 100 --out compensator.toml --report design.html");
    run(folder, "simulate --model model.toml --plan plan.toml --compensator compensator.toml --out faster");
    run(
        folder,
        "bandwidth --model model.toml --compensator compensator.toml --records stand --records faster --report bandwidth.html",
    );
    run(folder, "diagnose --bandwidths bandwidths.csv --model three.toml --report bandwidths.html");
    ["report", "simulate", "design", "bandwidth", "bandwidths"].map(|name| folder.join(format!("{name}.html"))).to_vec()
}

#[test]
fn a_report_is_whole_in_a_browser_at_every_width_by_day_and_by_night() {
    let Some(chromium) = Chromium::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    let screenshots = std::env::var_os("ROTORLEAD_SCREENSHOTS").map(PathBuf::from);
    for file in reports(folder.path()) {
        for (width, scheme) in WIDTHS.into_iter().flat_map(|width| ["light", "dark"].map(|scheme| (width, scheme))) {
            let page = chromium.open(&file, width, scheme);
            page.run(CHECKS);
            let stem = file.file_stem().unwrap().to_string_lossy().into_owned();
            if let Some(folder) = &screenshots {
                page.screenshot(&folder.join(format!("{stem}-{width}-{scheme}.png")));
            }
            let place = format!("{stem} at {width} pixels, {scheme}");
            let faults: Vec<String> = page.evaluate("faults()");
            assert!(faults.is_empty(), "{place}:\n{}", faults.join("\n"));
            // What can be done with it is the same by day and by night.
            if scheme == "light" {
                can_be_used(&page, &place);
            } else {
                is_dark(&page, &place);
            }
            assert!(page.complaints().is_empty(), "{place}: {:#?}", page.complaints());
        }
    }
}

#[derive(Deserialize)]
struct Toggled {
    found: Vec<String>,
    buttons: usize,
}

#[derive(Deserialize)]
struct Spot {
    x: f64,
    y: f64,
    name: String,
}

/// Series can be switched off and on, values read where the mouse is, and axes zoomed and reset.
fn can_be_used(page: &OpenPage, place: &str) {
    let toggled: Toggled = page.evaluate("toggleFaults()");
    assert!(toggled.found.is_empty(), "{place}:\n{}", toggled.found.join("\n"));
    let figures: usize = page.evaluate("document.querySelectorAll('figure').length");
    assert!(figures >= 1 && toggled.buttons >= 2, "{place}: {figures} figures, {} buttons", toggled.buttons);
    for index in 0..figures {
        let spot: Spot = page.evaluate(&format!("pointOf({index})"));
        page.point_at(spot.x, spot.y);
        let start = Instant::now();
        let said = loop {
            let said: String = page.evaluate(&format!("said({index})"));
            if !said.is_empty() || start.elapsed() > Duration::from_secs(5) {
                break said;
            }
            std::thread::sleep(Duration::from_millis(50));
        };
        assert!(
            said.chars().any(|c| c.is_ascii_digit()),
            "{place}: {}: \"{said}\" is all that hovering says",
            spot.name
        );
    }
    let zoomed: Vec<String> = page.evaluate("zoomFaults()");
    assert!(zoomed.is_empty(), "{place}:\n{}", zoomed.join("\n"));
}

/// Paper is dark and words are light, also those in figures.
fn is_dark(page: &OpenPage, place: &str) {
    let colors: Vec<String> = page.evaluate(
        "[getComputedStyle(document.body).backgroundColor, getComputedStyle(document.querySelector('.plot text')).fill]",
    );
    let lightness = |color: &str| -> f64 {
        let numbers: Vec<f64> = color
            .trim_matches(|c: char| !c.is_ascii_digit())
            .split(", ")
            .filter_map(|part| part.parse().ok())
            .collect();
        numbers.iter().take(3).sum::<f64>() / 765.0
    };
    assert!(lightness(&colors[0]) < 0.2 && lightness(&colors[1]) > 0.7, "{place}: {colors:?}");
}

#[test]
fn a_report_is_one_file_that_says_what_was_done_and_the_same_every_time() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("model.toml"), MODEL).unwrap();
    let mut files = Vec::new();
    for _ in 0..2 {
        run(folder.path(), "design --model model.toml --out compensator.toml --report design.html");
        files.push(fs::read_to_string(folder.path().join("design.html")).unwrap());
    }
    assert_eq!(files[0], files[1]);
    let html = &files[0];
    for part in [
        "Predicted bandwidth: 9.3 to 14.1 rad/s without",
        "rotorlead design --model model.toml --out compensator.toml --report design.html",
        concat!("Rotorlead ", env!("CARGO_PKG_VERSION")),
        "Permission is hereby granted, free of charge",
        "plotly.js v",
    ] {
        assert!(html.contains(part), "no \"{part}\"");
    }
    // Nothing is loaded: the library is the only script beside our own, and no element has an address.
    let markup = html.split("plotly.js v").next().unwrap();
    for loads in ["src=", "<link rel=\"stylesheet\"", "url(", "@import"] {
        assert!(!markup.contains(loads), "{loads}");
    }
    let names: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(names.len(), 3, "{names:?}");
}
