//! `rotorlead.export`

use std::path::PathBuf;

use miette::miette;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use rotorlead_export::{ExportSettings, Exporter, StackOptions, Target};
use rotorlead_records::files::{AcceptedRange, KeyPath, check_writable, write_file};
use rotorlead_results::export_warnings;
use serde_json::json;

use crate::argument::{Given, one_of, read};
use crate::design::commands;
use crate::error::{raised, refused};
use crate::experiment::Records;
use crate::interrupt;
use crate::value::to_dict;

/// What programs read, the content of the file, and whether it is text.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // They are options by name, as those of the command are.
pub fn export<'py>(
    py: Python<'py>,
    model: Given<'py>,
    target: &str,
    records: Option<Records>,
    compensator: Option<Given<'py>>,
    at: Option<f64>,
    output_range: Option<(f64, f64)>,
    motors: Option<u8>,
    step_rate_hz: Option<f64>,
    out: Option<PathBuf>,
) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyBytes>, bool)> {
    let targets: Vec<(&str, Target)> = Target::all().map(|target| (target.name(), target)).collect();
    let target = one_of("stack", target, &targets)?;
    let given = [
        (at.is_some(), "--at"),
        (output_range.is_some(), "--output-range"),
        (step_rate_hz.is_some(), "--step-rate"),
        (motors.is_some(), "--motors"),
        (compensator.is_some(), "--compensator"),
    ];
    for (_, option) in given.into_iter().filter(|(is_given, _)| *is_given) {
        if let Some(purpose) = target.foreign(option) {
            let name = target.name();
            return Err(raised(&miette!(
                help = format!("leave {option} out"),
                "{option} is {purpose}, and {name} has none"
            )));
        }
    }
    output_range.map_or(Ok(()), |range| commands("output_range", range)).map_err(|fault| refused(&fault))?;
    let numbers = [("at", AcceptedRange::DUTY, at), ("step_rate_hz", AcceptedRange::SAMPLE_RATE_HZ, step_rate_hz)];
    for (name, range, number) in numbers {
        let fault = |(message, help): (String, String)| refused(&KeyPath::root().key(name).fault(message, help));
        number.map_or(Ok(()), |number| range.accept_given(number)).map_err(fault)?;
    }
    if motors.is_some_and(|motors| !(1..=32).contains(&motors)) {
        let fault = KeyPath::root().key("motors").fault("this is no number of motors", "give one from 1 to 32");
        return Err(refused(&fault));
    }
    out.as_deref().map_or(Ok(()), |out| read(check_writable(out)))?;
    let (model, name) = model.any_model()?;
    let compensator = compensator.map(|given| given.compensator()).transpose()?;
    let exported = interrupt::run(py, move || {
        let experiment = records.map(|records| records.read()).transpose()?;
        let settings = ExportSettings {
            options: StackOptions { at, output_range, step_s: step_rate_hz.map(f64::recip) },
            motors,
            compensator: compensator.as_ref(),
            warnings: export_warnings(&model, compensator.as_ref()),
        };
        let exported = Exporter::new(&model, experiment.as_ref(), settings).export(target).map_err(|refused| {
            let reasons = refused.iter().map(|refusal| format!("{}: {}", refusal.full_name(), refusal.why));
            miette!(
                help = "docs/export.md says what each parameter is from, and what to record",
                "nothing is known from `{}`: {}",
                name.display(),
                reasons.collect::<Vec<_>>().join("; ")
            )
        })?;
        out.map_or(Ok(()), |out| write_file(&out, &exported.content))?;
        Ok(exported)
    })?;
    Ok((to_dict(py, &json!(exported.values))?, PyBytes::new(py, &exported.content), target.is_text()))
}
