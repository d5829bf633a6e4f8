//! `rotorlead.diagnose`

use std::path::PathBuf;

use miette::{IntoDiagnostic as _, WrapErr as _};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rotorlead_diagnose::{Options, diagnose as find};
use rotorlead_plant::Catalog;
use rotorlead_records::files::{check_writable, write_file};
use rotorlead_results::{diagnosed_model, diagnosis_answer};

use crate::argument::{Given, read};
use crate::experiment::Records;
use crate::interrupt;
use crate::value::to_dict;

/// Finds where a model and records disagree, and names the effects that the model lacks.
///
/// `data` is as for `identify`. `model` is the model to be judged, a path or a dict; the lags that the records show unless given.
/// `out_model` is where the model with the effects goes, `out_plan` where the plan of the experiment goes that would say
/// more. The result has the keys of `rotorlead diagnose --json`, the improved `model`, and the `plan`, which is None where no
/// experiment is needed.
#[pyfunction]
#[pyo3(signature = (data, model = None, *, out_model = None, out_plan = None))]
pub fn diagnose<'py>(
    py: Python<'py>,
    data: Given<'py>,
    model: Option<Given<'py>>,
    out_model: Option<PathBuf>,
    out_plan: Option<PathBuf>,
) -> PyResult<Bound<'py, PyDict>> {
    let model = model.map(|model| Ok::<_, PyErr>(model.model()?.0)).transpose()?;
    [&out_model, &out_plan].into_iter().flatten().try_for_each(|out| read(check_writable(out)))?;
    let records = Records::of(&data, None)?;
    let (found, next) = interrupt::run(py, move || {
        let nothing = format!("nothing was diagnosed from `{}`", records.name());
        let experiment = records.read_with_esc_commands()?;
        let catalog = Catalog::standard();
        let options = Options { model: model.as_ref(), catalog: &catalog, progress: &|| () };
        let mut found = find(&experiment, &options).map_err(miette::Report::from).wrap_err_with(|| nothing)?;
        found.model = diagnosed_model(&experiment, model.as_ref(), &found);
        out_model.map_or(Ok(()), |out| found.model.write(&out))?;
        let next = found.next_experiment();
        if let (Some(next), Some(out)) = (&next, out_plan) {
            write_file(&out, next.file().into_diagnostic()?.as_bytes())?;
        }
        Ok((found, next))
    })?;
    let dict = to_dict(py, &diagnosis_answer(&found).json())?;
    dict.set_item("model", to_dict(py, &found.model)?)?;
    dict.set_item("plan", next.map(|next| to_dict(py, &next.plan)).transpose()?)?;
    Ok(dict)
}
