//! What is wrong with an experiment's folder.

use std::collections::BTreeSet;

use rotorlead_answer::words::counted;
use rotorlead_answer::{Answer, Tone, Verdict};
use rotorlead_identify::check::{Findings, RecordFault, check_rate, check_record};
use rotorlead_identify::identification::{IdentifyOptions, identify};
use rotorlead_identify::stand::{StandOptions, identify_stand};
use rotorlead_records::{Excitation, Experiment, Finding, Inspection, Role, Severity, Topic, Unreadable};
use serde_json::json;

use crate::json_object::json_object;

/// All that is wrong with the folder `name`, and how much that is.
#[must_use]
pub fn check_answer(name: &str, inspection: &Inspection) -> Answer {
    let findings = findings(inspection);
    let errors = findings.iter().filter(|finding| finding.severity == Severity::Error).count();
    let warnings = findings.len() - errors;
    let unread: BTreeSet<_> = inspection.unreadable.iter().filter_map(|fault| fault.file.as_deref()).collect();
    let records = inspection.experiment.as_ref().map(|experiment| experiment.records.len() + unread.len());
    let (tone, found) = match (errors, warnings) {
        (0, 0) => (Tone::Good, "nothing is wrong with the records; `rotorlead identify` judges the motor".to_owned()),
        (0, _) => (Tone::Attention, format!("{}, no error", counted(warnings, "warning"))),
        _ => (Tone::Bad, format!("{}, {}", counted(errors, "error"), counted(warnings, "warning"))),
    };
    let read = records.map(|records| counted(records, "record") + "; ").unwrap_or_default();
    Answer {
        name: "check",
        title: "Check",
        verdict: Verdict::new(tone, format!("{name}: {read}{found}")),
        values: json_object(
            &json!({ "records": records, "errors": errors, "warnings": warnings, "findings": findings }),
        ),
        findings,
        ..Answer::default()
    }
}

/// Everything that is wrong, errors first.
fn findings(inspection: &Inspection) -> Vec<Finding> {
    let mut findings = Findings::default();
    if let Some(files) = inspection.not_recorded() {
        let fault = RecordFault::NotRecorded { count: files.len(), files: files.join(", ") };
        return vec![Finding::new(Severity::Error, Topic::Files, None, &fault)];
    }
    for fault in &inspection.unreadable {
        findings.extend(unreadable(fault, inspection));
    }
    for file in &inspection.unnamed {
        let fault = RecordFault::Unnamed { file: file.clone() };
        findings.push(Finding::new(Severity::Warning, Topic::Files, Some(file), &fault));
    }
    if let Some(experiment) = &inspection.experiment {
        for record in &experiment.records {
            findings.extend(check_record(experiment, record, inspection.is_force));
        }
        if inspection.is_force {
            rehearse_stand(experiment, &mut findings);
        } else {
            rehearse(experiment, !inspection.unreadable.is_empty(), &mut findings);
        }
    }
    findings.sorted()
}

/// What cannot be read. Where the rows show the cause, such as a command in percent, that is said instead.
fn unreadable(fault: &Unreadable, inspection: &Inspection) -> Vec<Finding> {
    let file = fault.file.as_deref();
    let mut found = match (&fault.rows, &inspection.experiment) {
        (Some(rows), Some(experiment)) => check_record(experiment, rows, inspection.is_force),
        _ => Vec::new(),
    };
    // A command outside 0 to 1 is refused first; a rate that contradicts the times only then.
    let is_duty = |command: &f64| (0.0..=1.0).contains(command);
    let is_command = fault.rows.as_ref().is_some_and(|rows| !rows.command.iter().all(is_duty));
    // Rows that a finding is about are the ones that the stated rate contradicts.
    let is_cause = |finding: &&mut Finding| match finding.topic {
        Topic::CommandUnit => is_command,
        Topic::TimeUnit => !is_command,
        Topic::Sampling => !is_command && finding.row.is_some(),
        _ => false,
    };
    let topic = if fault.rows.is_some() && !is_command { Topic::Sampling } else { Topic::Files };
    match found.iter_mut().find(is_cause) {
        Some(cause) => cause.severity = Severity::Error,
        None => {
            let mut finding = Finding::new(Severity::Error, topic, file, &fault.error);
            if let Some((line, column)) = fault.error.line_and_column() {
                let place = fault.error.file_name().unwrap_or_default();
                finding.message = format!("{place}:{line}:{column}: {}", finding.message);
            }
            found.push(finding);
        }
    }
    found
}

/// What an identification would say. A record that it refuses is taken out and the rest tried again, so that every refusal is
/// said. `is_part` where records are missing already: that none is left to fit is no finding then.
fn rehearse(experiment: &Experiment, is_part: bool, findings: &mut Findings) {
    let mut rest = experiment.clone();
    let has_multisine = has_multisine_to_fit(experiment);
    let mut is_part = is_part;
    while !rest.records.is_empty() {
        if is_part && has_multisine && !has_multisine_to_fit(&rest) {
            return;
        }
        let refused = match identify(&rest, &IdentifyOptions::default()) {
            Ok(identified) => {
                // Which records are fitted is another question once all can be read.
                let warnings = identified.warnings.iter().filter(|warning| !is_part || warning.topic != Topic::Roles);
                warnings.cloned().for_each(|warning| findings.warn(warning));
                findings.extend(rest.records.iter().filter_map(|record| check_rate(record, &identified.model.points)));
                return;
            }
            Err(refused) => refused,
        };
        let is_of_roles = refused.topic() == Topic::Roles;
        if !(is_part && is_of_roles) {
            findings.refuse(&refused);
        }
        let Some(file) = refused.file().map(str::to_owned) else { return };
        let before = rest.records.len();
        rest.records.retain(|record| record.file != file);
        if rest.records.len() == before {
            return;
        }
        is_part = true;
    }
}

fn has_multisine_to_fit(experiment: &Experiment) -> bool {
    let is_one = |excitation, role| excitation == Excitation::Multisine && role != Some(Role::Validate);
    experiment.records.iter().any(|record| is_one(record.excitation, record.role))
}

/// As [`rehearse`], of a stand.
fn rehearse_stand(experiment: &Experiment, findings: &mut Findings) {
    if experiment.records.is_empty() {
        return;
    }
    match identify_stand(experiment, &StandOptions::default()) {
        Ok(stand) => findings.extend(
            stand.warnings.iter().map(|warning| Finding::new(Severity::Warning, Topic::Identification, None, warning)),
        ),
        Err(error) => findings.refuse(&error),
    }
}
