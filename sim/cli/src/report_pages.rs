//! What the reports of single commands say at their top, and of what parts they are made.

use std::path::Path;

use rotorlead_answer::{Answer, Fact, Report, Tone, Verdict};
use rotorlead_numerics::sample::extent;
use rotorlead_plant::Model;
use rotorlead_records::Experiment;
use rotorlead_results::experiment_facts;

use super::report_option::this_command;

/// A report without parts.
pub fn report(kind: &str, title: impl Into<String>, verdict: Verdict) -> Report {
    Report {
        kind: kind.to_owned(),
        title: title.into(),
        verdict,
        facts: Vec::new(),
        warnings: Vec::new(),
        sections: Vec::new(),
        commands: vec![this_command()],
    }
}

/// A report of one answer.
pub fn of_answer(kind: &str, title: impl Into<String>, answer: &Answer) -> Report {
    Report {
        warnings: answer.warnings(),
        sections: vec![answer.section()],
        ..report(kind, title, answer.verdict.clone())
    }
}

/// A fact about a file.
pub fn file(name: &str, path: &Path) -> Fact {
    Fact::new(name, path.display().to_string())
}

/// The version, for reports that rest on no records.
pub fn version() -> Fact {
    Fact::new("Version", format!("Rotorlead {}", env!("CARGO_PKG_VERSION")))
}

/// Facts about an experiment that was read from `source`, a folder or a log.
pub fn records(experiment: &Experiment, source: &Path) -> Vec<Fact> {
    let mut facts = experiment_facts(experiment, &source.display().to_string());
    facts.extend(Experiment::checksum(source).map(|sum| Fact::new("CRC-32 of these files", sum)));
    facts
}

/// The lags of a model, in a phrase.
pub fn lags(model: &Model) -> String {
    if model.points.is_empty() {
        return "a static map alone, and no lag".to_owned();
    }
    let (low, high) = extent(&model.points.iter().map(|point| point.time_constant_s).collect::<Vec<_>>());
    if let [_] = model.points.as_slice() {
        return format!("one lag, time constant {:.1} ms, a pole at {:.2} rad/s", 1e3 * low, 1.0 / low);
    }
    format!(
        "{} lags, time constants from {:.1} to {:.1} ms, poles from {:.2} to {:.2} rad/s",
        model.points.len(),
        1e3 * low,
        1e3 * high,
        1.0 / high,
        1.0 / low
    )
}

/// The same verdict where there may be warnings below, to be read before `what` happens.
pub fn warned(verdict: Verdict, warnings: usize, what: &str) -> Verdict {
    let said = match warnings {
        0 => return verdict,
        1 => format!("There is a warning: read it before {what}."),
        count => format!("There are {count} warnings: read them before {what}."),
    };
    let sentences = [verdict.sentences, vec![said]].concat();
    Verdict { tone: verdict.tone.max(Tone::Attention), sentences, ..verdict }
}
