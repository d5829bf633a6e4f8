//! The figures as a page of Markdown.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::case::{Class, Set};
use super::kind::Kind;
use super::score::Scored;
use super::tally::{Figure, by_parameter, ceilings, confusion, figures};

/// Names of the page's parts, in order: by these a test sees whether the page is current in shape.
pub const PARTS: [&str; 5] =
    ["## Figures", "## What can be identified at all", "## Confusion matrix", "## Parameters", "## Wrong names"];

/// What the cases are.
const CASES: &str = "\
Every case is twelve records of 30 s, a multisine and a square wave at six operating points, with noise of 0.2 to 5 % of the swing. It hides one
of these:

- one effect of the catalog, over its whole range, or nothing;
- two effects, all pairs of kinds equally likely, or three (`pair`, `triple`);
- one effect whose law is a little other than the catalog's (`perturbed`): several plays in parallel, a knee or a growing width of a
  dead band, a delay or frames that jitter, uneven steps of a quantizer, a second mode of the stand, an inflow that is faster at higher
  speed, a clock that drifts, a soft clip, an average of averages, and others: one or two for every kind but wrong numbers;
- something that no catalog names (`outside`);
- nothing but one or two nuisances of the stand (`nuisance`), which are no effects: hum of the mains with harmonics, blades that pass
  an arm, a load cell that warms up, gusts, missing rows, stamps that jitter; or one effect beside those of them that are forces
  (`single_in_nuisance`).
";

/// The page. `about` says by which command and version it was made.
#[must_use]
pub fn page(cases: &[Scored], set: Set, about: &str) -> String {
    // Writing to a string cannot fail, here and below.
    let mut text = String::from("# What the diagnosis gets right\n\n");
    let _ = write!(
        text,
        "Made by {about} from the `{}` set: {} cases. The `tune` set is for making the method, the `report` set for this \
         page; they share no seed and no sort of effect outside the catalog. The data come from code that shares nothing \
         with the simulator. A kind that is said to be significant and not to matter (`minor`) counts as named where it is \
         hidden, and is no wrong name. Intervals are Wilson's, of 95 %: what is required counts as missed only where they \
         exclude it. `p` is how often as unlikely a count happens where intervals hold in 95 of 100; a law that is bent has \
         no such parameter, and is not counted there.\n\n",
        set.name(),
        cases.len(),
    );
    text.push_str(CASES);
    let _ = writeln!(text, "\n{}\n\n{}", PARTS[0], table(&figures(cases)));
    let _ = write!(
        text,
        "{}\n\nAn effect shows when the generator's own model, fitted together with gains and time constants, is better \
         than these alone by 5 in log likelihood on the thrust. It can be identified when it is better than every rival by \
         that. Of two effects both show when they are better than either alone by that; they can be identified when they are \
         better by that, too, than either beside any other kind.\n\n{}\n",
        PARTS[1],
        table(&ceilings(cases)),
    );
    let _ = write!(
        text,
        "{}\n\nRows: what is hidden (single cases that show). Columns: the first name.\n\n{}\n",
        PARTS[2],
        matrix(cases)
    );
    let _ = writeln!(text, "{}\n\n{}", PARTS[3], parameters(cases));
    let _ = writeln!(text, "{}\n\n{}", PARTS[4], wrong(cases));
    text
}

fn table(figures: &[Figure]) -> String {
    let mut text = String::from("| what | count | required | holds |\n|---|---|---|---|\n");
    for figure in figures {
        let required = match figure.required {
            None => String::new(),
            Some((low, high)) if high >= 1.0 => format!(">= {:.1} %", 100.0 * low),
            Some((low, high)) => format!("{:.0} to {:.0} %", 100.0 * low, 100.0 * high),
        };
        let holds = figure.judgment().map_or(String::new(), |judgment| judgment.to_string());
        let _ = writeln!(text, "| {} | {} | {required} | {holds} |", figure.what, figure.share);
    }
    text
}

fn matrix(cases: &[Scored]) -> String {
    let counts = confusion(cases);
    let others = [Class::Empty, Class::Outside, Class::Nuisance].map(Class::name);
    let rows: Vec<&str> = Kind::ALL.iter().map(|kind| kind.name()).chain(others).collect();
    let mut columns: Vec<String> = Kind::ALL.iter().map(|kind| kind.name().to_owned()).collect();
    // Kinds of the tool's own that no case hides come after those that cases do.
    let known: BTreeSet<&str> = columns.iter().map(String::as_str).chain(["agrees", "unknown", "error"]).collect();
    let own: BTreeSet<String> =
        counts.keys().map(|(_, name)| name.clone()).filter(|name| !known.contains(name.as_str())).collect();
    columns.extend(own);
    columns.extend(["agrees", "unknown", "error"].map(str::to_owned));
    let mut text = format!("| hidden | {} |\n|---|{}\n", columns.join(" | "), "---|".repeat(columns.len()));
    for row in rows {
        let cells: Vec<String> = columns
            .iter()
            .map(|column| counts.get(&(row.to_owned(), column.clone())).map_or(String::new(), ToString::to_string))
            .collect();
        let _ = writeln!(text, "| {row} | {} |", cells.join(" | "));
    }
    text
}

fn parameters(cases: &[Scored]) -> String {
    let mut text = String::from(
        "| kind | parameter | within its interval | p | mean deviation in standard deviations |\n|---|---|---|---|---|\n",
    );
    for ((kind, name), parameter) in by_parameter(cases) {
        let (share, p_value, mean) = (parameter.share, parameter.p_value(), parameter.mean_off);
        let _ = writeln!(text, "| {kind} | {name} | {share} | {p_value:.2} | {mean:.2} |");
    }
    text
}

fn wrong(cases: &[Scored]) -> String {
    let mut text =
        String::from("| hidden | number | shows | first name | why there is no answer |\n|---|---|---|---|---|\n");
    for case in cases.iter().filter(|case| case.has_wrong_name() || case.answer.is_err()) {
        let kinds = case.truth.effects.iter().map(|hidden| hidden.kind.as_str());
        let hidden: Vec<&str> =
            kinds.chain(case.truth.outside.as_deref()).chain(case.truth.nuisances.iter().map(String::as_str)).collect();
        let hidden = match &case.truth.law {
            _ if hidden.is_empty() => case.truth.class.clone(),
            Some(law) => format!("{} ({law})", hidden.join(" + ")),
            None => hidden.join(" + "),
        };
        let shows = if case.truth.is_invisible() { "no" } else { "yes" };
        let error = case.answer.as_ref().err().map_or("", String::as_str).replace(['|', '\n'], " ");
        let _ = writeln!(text, "| {hidden} | {} | {shows} | {} | {error} |", case.truth.number, case.first());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::diagnosis::tests::naming;
    use super::super::score::tests::scored;
    use super::*;

    #[test]
    fn the_page_has_its_parts_and_counts() {
        let wrong = naming("named", &[(Kind::EscFrameHold, &[])]);
        let mut cases = [
            scored("transport_delay", &[Kind::TransportDelay], -100.0, -50.0, &wrong),
            scored("nothing", &[], 0.0, 0.0, "nonsense"),
            scored("perturbed", &[Kind::TransportDelay], -100.0, -50.0, &wrong),
            scored("nuisance", &[], 0.0, 0.0, &wrong),
        ];
        cases[2].truth.law = Some("delay_jitter".to_owned());
        cases[3].truth.nuisances = vec!["gusts".to_owned(), "mains_hum".to_owned()];
        let page = page(&cases, Set::Tune, "a test");
        let mut from = 0;
        for part in PARTS {
            from += page[from..].find(part).unwrap_or_else(|| panic!("{part} is missing or out of order"));
        }
        assert!(page.contains("| 0/1 = 0 % (0 to 79) | >= 97.0 % | no |"), "{page}");
        assert!(page.contains("| transport_delay | 0 | yes | esc_frame_hold |"), "{page}");
        assert!(page.contains("| transport_delay (delay_jitter) | 0 | yes | esc_frame_hold |"), "{page}");
        assert!(page.contains("| gusts + mains_hum | 0 | yes | esc_frame_hold |"), "{page}");
        let heads = page.lines().find(|line| line.starts_with("| hidden | parameter_error")).unwrap();
        let row = page.lines().find(|line| line.starts_with("| transport_delay |  |")).unwrap();
        assert_eq!(heads.matches('|').count(), row.matches('|').count());
    }
}
