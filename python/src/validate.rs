//! `rotorlead.validate`

use miette::WrapErr as _;
use pyo3::prelude::*;
use rotorlead_answer::Report;
use rotorlead_assess::{Assessment, AssessmentContext, assess};
use rotorlead_results::{answer_page, validation_answer};

use crate::argument::Given;
use crate::experiment::Records;
use crate::interrupt;
use crate::page::{Answered, answered};

/// How well a model explains each record.
#[pyfunction]
pub fn validate<'py>(py: Python<'py>, model: Given<'py>, records: Records) -> PyResult<Answered<'py>> {
    let (model, name) = model.model()?;
    let (values, page) = interrupt::run(py, move || {
        let experiment = records.read()?;
        let Assessment { judgement, recommendation, records: found, .. } =
            assess(&experiment, &model, AssessmentContext::default());
        let found = found
            .map_err(miette::Report::from)
            .wrap_err_with(|| format!("`{}` was not compared with `{}`", records.name(), name.display()))?;
        let answer = validation_answer(&found, &judgement, recommendation.as_ref(), experiment.output);
        let page = Report {
            facts: records.facts(&experiment),
            ..answer_page("Validation", format!("Validation on {}", experiment.name), &answer)
        };
        Ok((answer.json(), page))
    })?;
    answered(py, &values, &page)
}
