//! The catalog of effects as a page for people: everything is said by the kinds themselves.

use std::fmt::Write as _;

use rotorlead_plant::Catalog;
use rotorlead_plant::effect::{Kind, Linearity, Parameter, Scale, Shows, Site, Use};

/// Marks between which the catalog stands in a page.
const BEGIN: &str = "<!-- catalog: `cargo xtask docs` writes what follows -->\n";
const END: &str = "<!-- end of the catalog -->";

/// Every kind with its equation, parameters, signature, confusions, remedy and sources, as Markdown.
#[must_use]
pub fn catalog_markdown(catalog: &Catalog) -> String {
    let mut text = String::from("| kind | what | where in the chain | parameters |\n|---|---|---|---|\n");
    for kind in catalog.kinds() {
        let names: Vec<String> = kind.parameters.iter().map(|parameter| format!("`{}`", parameter.name)).collect();
        let _ = writeln!(text, "| `{}` | {} | {} | {} |", kind.id, kind.title, site(kind.site), names.join(", "));
    }
    for kind in catalog.kinds() {
        describe(&mut text, kind);
    }
    text
}

fn describe(text: &mut String, kind: &Kind) {
    let mut line = |line: String| {
        text.push_str(&line);
        text.push('\n');
    };
    line(format!("\n### `{}`: {}\n", kind.id, kind.title));
    line(format!("```text\n{}\n```\n", kind.equation));
    line("| parameter | unit | what | not there at | searched | |\n|---|---|---|---|---|---|".to_owned());
    for parameter in kind.parameters {
        line(row(parameter));
    }
    line(format!("\n{}\n", kind.signature));
    line(format!("- Frequency response: {}.", response(kind.linearity)));
    line(format!("- {}", shows(kind.shows)));
    for confusion in kind.confusions {
        line(format!("- or `{}`? {}", confusion.with, confusion.experiment));
    }
    line(format!("- What to do: {}.", kind.remedy));
    line(format!("- Sources: {}.", kind.sources.join("; ")));
}

fn row(parameter: &Parameter) -> String {
    let null = match (parameter.usage, parameter.null) {
        (Use::Optional(_) | Use::Shape { .. }, _) => "-".to_owned(),
        (_, null) if null.is_nan() => "any".to_owned(),
        (_, null) if null.is_infinite() => "infinity".to_owned(),
        (_, null) => format!("{null}"),
    };
    let (low, high) = parameter.plausible;
    let steps = match parameter.scale {
        Scale::Linear => "equal steps",
        Scale::Log => "equal factors",
    };
    let usage = match parameter.usage {
        Use::Fitted => String::new(),
        Use::Optional(default) => format!("optional, {default} where absent"),
        Use::Shape { neutral, .. } => format!("shape, {neutral} where absent"),
    };
    let (name, unit, meaning) = (parameter.name, parameter.unit, parameter.meaning);
    format!("| `{name}` | {unit} | {meaning} | {null} | {low} to {high}, {steps} | {usage} |")
}

fn site(site: Site) -> &'static str {
    match site {
        Site::Base => "the numbers of the lag",
        Site::Command => "command, ahead of the ESC",
        Site::Line => "between ESC and motor",
        Site::Supply => "supply",
        Site::Map => "static map",
        Site::Rotor => "rotor",
        Site::Air => "air",
        Site::Stand => "stand",
        Site::Sensor => "sensor",
        Site::Logger => "logger",
    }
}

fn response(linearity: Linearity) -> &'static str {
    match linearity {
        Linearity::Exact => "exact, at any amplitude",
        Linearity::Mean => "that of its mean; the images of the sampler are left out",
        Linearity::SmallSignal => "that of small deviations from the nominal command",
        Linearity::Absent => "none that amplitude or time would not change",
    }
}

fn shows(shows: Shows) -> &'static str {
    match shows {
        Shows::Anywhere => "Any record may show it.",
        Shows::BetweenLevels => "Steps from one settled level to the next do not show it.",
        Shows::InForce => "Logs of the speed do not show it.",
        Shows::BetweenClocks => "Logs that do not repeat, whose rows are stamped by one clock, do not show it.",
        Shows::OverLevels => "Only logs that go through many levels show it.",
    }
}

/// `page` with `section` between its marks; `None` where it has none.
#[must_use]
pub fn with_catalog(page: &str, section: &str) -> Option<String> {
    let (before, rest) = page.split_once(BEGIN)?;
    let (_, after) = rest.split_once(END)?;
    Some(format!("{before}{BEGIN}\n{section}\n{END}{after}"))
}
