//! `rotorlead.identify`

use std::path::PathBuf;

use miette::{WrapErr as _, miette};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rotorlead_answer::Report;
use rotorlead_identify::identification::IdentifyOptions;
use rotorlead_identify::lag::first_order::FirstOrderOptions;
use rotorlead_records::files::check_writable;
use rotorlead_results::{IdentifyResult, answer_page, transform};

use crate::argument::{one_of, read};
use crate::experiment::{Records, response};
use crate::interrupt;
use crate::page::{Answered, answered};
use crate::value::to_dict;

/// The answer, and the model.
#[pyfunction]
pub fn identify<'py>(
    py: Python<'py>,
    records: Records,
    delay: &str,
    response_name: Option<&str>,
    out: Option<PathBuf>,
) -> PyResult<(Answered<'py>, Bound<'py, PyDict>)> {
    let delay_level =
        one_of("delay", delay, &[("auto", FirstOrderOptions::default().delay_level), ("none", 0.0), ("fit", 1.0)])?;
    let output = response(response_name)?;
    out.as_deref().map_or(Ok(()), |out| read(check_writable(out)))?;
    let (values, page, model) = interrupt::run(py, move || {
        let nothing = format!("nothing was identified from `{}`", records.name());
        let (mut experiment, long) = records.read_leaving_long()?;
        if let Some(output) = output {
            experiment.output = output;
            if let Some(record) = experiment.records.iter().find(|record| record.response(output).is_none()) {
                let column = output.column();
                let remedy = "leave `response` out, or give records that have this column";
                return Err(miette!(
                    help = remedy,
                    "`response` asks for `{column}`, and `{}` has no such column",
                    record.file
                ));
            }
        }
        let long = transform(&experiment, &long).map_err(miette::Report::from).wrap_err_with(|| nothing.clone())?;
        let options = IdentifyOptions { delay_level, stand: None, long: &long };
        let mut found =
            IdentifyResult::identify(&experiment, &options).map_err(miette::Report::from).wrap_err_with(|| nothing)?;
        let provenance = found.identification.model.provenance.iter_mut();
        provenance.for_each(|from| from.records_crc32 = records.checksum());
        out.map_or(Ok(()), |out| found.identification.model.write(&out))?;
        let answer = found.answer(&experiment);
        let page = Report {
            facts: records.facts(&experiment),
            sections: found.sections(&answer, &experiment),
            ..answer_page("Identification", format!("Identification of {}", experiment.name), &answer)
        };
        Ok((answer.json(), page, found.identification.model))
    })?;
    Ok((answered(py, &values, &page)?, to_dict(py, &model)?))
}
