//! `rotorlead.report`

use std::path::{Path, PathBuf};

use miette::WrapErr as _;
use pyo3::prelude::*;
use rotorlead_answer::{Answer, Report};
use rotorlead_plant::Model;
use rotorlead_results::{Asked, Kind, Overview, Watch, answer_page};

use crate::argument::{Given, one_of, read};
use crate::design::{KINDS, PURPOSES};
use crate::experiment::Records;
use crate::interrupt;
use crate::page::{Answered, answered};

/// All that records say.
#[pyfunction]
pub fn overview<'py>(
    py: Python<'py>,
    records: Records,
    model: Option<Given<'py>>,
    kind: Option<&str>,
    purpose: &str,
    with_diagnosis: bool,
) -> PyResult<Answered<'py>> {
    let kind: Option<Kind> = kind.map(|kind| one_of("kind", kind, &KINDS)).transpose()?;
    let purpose = one_of("purpose", purpose, &PURPOSES)?;
    let beside = || records.source().map(|source| source.join("model.toml")).filter(|file: &PathBuf| file.is_file());
    let model = match model {
        Some(model) => Some(model.model()?.0),
        None => beside().map(|file| read(Model::read(&file))).transpose()?,
    };
    let (values, page) = interrupt::run(py, move || {
        let experiment = records.read()?;
        let asked = Asked { model: model.as_ref(), kind, purpose, with_diagnosis };
        let watch = Watch { stage: &|_| (), step: &|| () };
        let source = records.source().unwrap_or(Path::new(""));
        let overview = Overview::from_experiment(&experiment, source.into(), asked, watch)
            .map_err(miette::Report::from)
            .wrap_err_with(|| format!("nothing was identified from `{}`", records.name()))?;
        let page = Report {
            facts: records.facts(&experiment),
            sections: overview.sections(&experiment),
            verdict: overview.verdict(&experiment),
            warnings: overview.warnings(),
            ..answer_page("Experiment", experiment.name.clone(), &Answer::default())
        };
        Ok((overview.values(&experiment, &page).into(), page))
    })?;
    answered(py, &values, &page)
}
