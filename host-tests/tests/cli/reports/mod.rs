//! Reports as a browser shows them: nothing is asked of the network, nothing is cut or overlaps at the width of a desk and
//! of a pocket, by day and by night, and what looks as if it could be used can be.
//!
//! With `ROTORLEAD_SCREENSHOTS=DIR` in the environment every page is also written there as PNG.

mod browser;
mod devtools;

use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use rotorlead_answer::FigureKind;
use serde::Deserialize;

use crate::gallery::{self, Shown};
use crate::stand::Stand;
use browser::{Chromium, OpenPage, SHEET};

const CHECKS: &str = include_str!("checks.js");
/// Widths of a window, pixels.
const WIDE: u32 = 1280;
const NARROW: u32 = 390;

#[test]
fn every_report_is_whole_in_a_wide_window_by_day_and_by_night_and_can_be_used() {
    are_whole(WIDE, &["dark", "light"]);
}

#[test]
fn every_report_is_whole_in_a_narrow_window_and_can_be_used() {
    are_whole(NARROW, &["light"]);
}

/// Loads every report in a window of this width: all in it is there, and can be read, in each color scheme. What can be done with a
/// figure is done with the first of its kind.
fn are_whole(width: u32, schemes: &[&str]) {
    let Some(chromium) = Chromium::start() else { return };
    let screenshots = screenshots();
    let (mut used, mut faults) = (BTreeSet::new(), Vec::new());
    for shown in gallery::shown().iter().filter(|shown| shown.is_opened) {
        is_small(shown);
        let page = chromium.open(&shown.report, width, schemes[0]);
        page.run(CHECKS);
        let place = format!("`{}` at {width} pixels", shown.arguments);
        for scheme in schemes {
            page.show("", scheme);
            if let Some(folder) = &screenshots {
                let name = shown.arguments.replace([' ', '.'], "-");
                page.screenshot(&folder.join(format!("{name}-{width}-{scheme}.png")));
            }
            let found: Vec<String> = page.evaluate("faults()");
            faults.extend(found.iter().map(|fault| format!("{place}, {scheme}: {fault}")));
            if *scheme == "dark" {
                is_dark(&page, &place);
            }
        }
        for (index, kind) in kinds(&page).into_iter().enumerate() {
            if used.insert(kind.id()) {
                can_be_used(&page, index, &place);
            }
        }
        assert!(page.complaints().is_empty(), "{place}: {:#?}", page.complaints());
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    for kind in FigureKind::ALL {
        assert!(used.contains(kind.id()), "no report shows {kind:?}");
    }
}

/// Where pictures of the pages are wanted.
fn screenshots() -> Option<PathBuf> {
    std::env::var_os("ROTORLEAD_SCREENSHOTS").map(PathBuf::from)
}

/// The kinds of a page's figures, in its order.
fn kinds(page: &OpenPage) -> Vec<FigureKind> {
    let ids: Vec<String> = page.evaluate("[...document.querySelectorAll('figure')].map((figure) => figure.id)");
    let kind = |id: &String| {
        let is_of = |kind: &FigureKind| id == kind.id() || id.starts_with(&format!("{}_", kind.id()));
        FigureKind::ALL.into_iter().find(is_of).unwrap_or_else(|| panic!("{id} is of no kind"))
    };
    assert!(!ids.is_empty(), "a report without a figure");
    ids.iter().map(kind).collect()
}

#[derive(Deserialize)]
struct Spot {
    x: f64,
    y: f64,
    name: String,
    values: Vec<Option<f64>>,
}

/// Whether a sentence has one of the numbers in it, to a tenth, since a mouse is no finer; any number where there are none.
fn says_one_of(said: &str, values: &[Option<f64>]) -> bool {
    let said = said.replace('\u{2212}', "-");
    let is_part = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | 'e');
    let numbers: Vec<f64> = said.split(|c| !is_part(c)).filter_map(|word| word.parse().ok()).collect();
    let is_near = |number: f64, value: f64| (number - value).abs() <= 0.1 * value.abs().max(1e-6);
    let is_any = values.is_empty() && !numbers.is_empty();
    is_any || values.iter().flatten().any(|value| numbers.iter().any(|number| is_near(*number, *value)))
}

/// Series of a figure can be switched off and on, values read where the mouse is and at cursors, and axes zoomed and reset.
fn can_be_used(page: &OpenPage, index: usize, place: &str) {
    let toggled: Vec<String> = page.evaluate(&format!("toggleFaults({index})"));
    assert!(toggled.is_empty(), "{place}:\n{}", toggled.join("\n"));
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
    let is_read = says_one_of(&said, &spot.values);
    assert!(is_read, "{place}: {}: hovering says \"{said}\", where there is {:?}", spot.name, spot.values);
    let zoomed: Vec<String> = page.evaluate(&format!("zoomFaults({index})"));
    assert!(zoomed.is_empty(), "{place}:\n{}", zoomed.join("\n"));
    let cursors: Vec<String> = page.evaluate(&format!("cursorFaults({index})"));
    assert!(cursors.is_empty(), "{place}:\n{}", cursors.join("\n"));
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

/// Small enough for a mail: six levels with all that can be drawn, and those with less.
fn is_small(shown: &Shown) {
    let most = if shown.arguments == "demo" { 2_500_000 } else { 2_000_000 };
    let size = fs::metadata(&shown.report).unwrap().len();
    assert!(size < most, "the report of `{}` has {size} bytes", shown.arguments);
}

/// What a page is on paper: its pictures instead of what a pointer would use, and no sheet more than it takes.
#[test]
fn a_report_can_be_printed() {
    let Some(chromium) = Chromium::start() else { return };
    let screenshots = screenshots();
    let report = &gallery::case("report sim --out report.html").report;
    // What a dark screen shows is printed on white paper.
    for scheme in ["light", "dark"] {
        let page = chromium.open(report, WIDE, scheme);
        page.run(CHECKS);
        let pictures: usize = page.evaluate("document.querySelectorAll('figure').length");
        let pdf = page.print();
        if let Some(folder) = &screenshots {
            fs::write(folder.join(format!("report-{scheme}.pdf")), &pdf.bytes).unwrap();
        }
        // Two or three pictures go on a sheet; words and tables take some more.
        assert!((2..=pictures + 6).contains(&pdf.sheets), "{} sheets for {pictures} figures", pdf.sheets);
        assert!(pictures >= 6, "{pictures} figures");

        page.as_printed(scheme);
        let faults: Vec<String> = page.evaluate(&format!("printFaults({})", SHEET.0));
        assert!(faults.is_empty(), "{scheme}:\n{}", faults.join("\n"));
        if let Some(folder) = &screenshots {
            page.screenshot(&folder.join(format!("report-printed-{scheme}.png")));
        }
        let paper: String = page.evaluate("getComputedStyle(document.body).backgroundColor");
        assert_eq!(paper, "rgb(255, 255, 255)", "{scheme}");
    }
}

#[test]
fn a_report_is_one_file_that_says_what_was_done_and_the_same_every_time() {
    let stand = Stand::new();
    let before = stand.everything().len();
    let mut files = Vec::new();
    for _ in 0..2 {
        stand.run("design --kind lead --model model.toml --out compensator.toml --report design.html");
        files.push(stand.read("design.html"));
    }
    assert_eq!(files[0], files[1]);
    let html = &files[0];
    // Options are kept in one piece.
    let words = html.replace("<span class=\"option\">", "").replace("</span>", "");
    for part in [
        "Predicted bandwidth: 12.5 to 16.6 rad/s without",
        "rotorlead design --kind lead --model model.toml --out compensator.toml --report design.html",
        concat!("Rotorlead ", env!("CARGO_PKG_VERSION")),
        "Permission is hereby granted, free of charge",
        "plotly.js (cartesian - minified) v",
    ] {
        assert!(words.contains(part), "no \"{part}\"");
    }
    // Nothing is loaded: the library is the only script beside our own, and no element has an address.
    let markup = html.split("plotly.js (cartesian").next().unwrap();
    for loads in ["src=", "<link rel=\"stylesheet\"", "url(", "@import"] {
        assert!(!markup.contains(loads), "{loads}");
    }
    // The compensator and the report.
    assert_eq!(stand.everything().len(), before + 2);
}
