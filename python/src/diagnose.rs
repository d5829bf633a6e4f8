//! `rotorlead.diagnose`

use std::path::PathBuf;

use miette::{IntoDiagnostic as _, WrapErr as _};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rotorlead_answer::Report;
use rotorlead_diagnose::{Options, diagnose as find};
use rotorlead_plant::Catalog;
use rotorlead_records::files::{check_writable, write_file};
use rotorlead_results::{answer_page, diagnosed_model, diagnosis_answer};

use crate::argument::{Given, read};
use crate::experiment::Records;
use crate::interrupt;
use crate::page::{Answered, answered};
use crate::value::to_dict;

/// The answer, the improved model, and the plan of the next experiment, which is None where none is needed.
type Diagnosed<'py> = (Answered<'py>, Bound<'py, PyDict>, Option<Bound<'py, PyDict>>);

/// What the model lacks.
#[pyfunction]
pub fn diagnose<'py>(
    py: Python<'py>,
    records: Records,
    model: Option<Given<'py>>,
    out_model: Option<PathBuf>,
    out_plan: Option<PathBuf>,
) -> PyResult<Diagnosed<'py>> {
    let model = model.map(|model| Ok::<_, PyErr>(model.model()?.0)).transpose()?;
    [&out_model, &out_plan].into_iter().flatten().try_for_each(|out| read(check_writable(out)))?;
    let (values, page, model, next) = interrupt::run(py, move || {
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
        let answer = diagnosis_answer(&found);
        let page = Report {
            facts: records.facts(&experiment),
            ..answer_page("Diagnosis", format!("Diagnosis of {}", experiment.name), &answer)
        };
        Ok((answer.json(), page, found.model, next))
    })?;
    let plan = next.map(|next| to_dict(py, &next.plan)).transpose()?;
    Ok((answered(py, &values, &page)?, to_dict(py, &model)?, plan))
}
