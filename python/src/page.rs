//! An answer as Python takes it, and the page of one.

use std::path::PathBuf;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rotorlead_answer::{Figure, Report};
use rotorlead_records::files::{check_writable, write_file};
use rotorlead_report::html_with_stills;
use serde_json::Value;

use crate::argument::read;
use crate::error::raised;
use crate::value::to_dict;

/// What programs read of an answer, and its page as JSON.
pub type Answered<'py> = (Bound<'py, PyDict>, String);

/// An answer for Python.
///
/// # Panics
/// Never: a page is text and numbers.
pub fn answered<'py>(py: Python<'py>, values: &Value, page: &Report) -> PyResult<Answered<'py>> {
    Ok((to_dict(py, values)?, serde_json::to_string(page).expect("keys are text, and no value fails to be written")))
}

/// Writes a page as HTML. `stills` are pictures of its figures in their order, as elements of HTML; the interactive ones alone are
/// there where the list is empty.
#[pyfunction]
pub fn write_page(page: &str, stills: Vec<String>, path: PathBuf) -> PyResult<()> {
    read(check_writable(&path))?;
    let page: Report = serde_json::from_str(page).map_err(|error| PyValueError::new_err(error.to_string()))?;
    let names: Vec<&str> =
        page.sections.iter().flat_map(|section| &section.figures).map(|figure| &*figure.name).collect();
    let still = |figure: &Figure| {
        let place = names.iter().position(|name| *name == figure.name);
        Ok(place.and_then(|place| stills.get(place)).cloned().unwrap_or_default())
    };
    let html = html_with_stills(&page, &still).map_err(|error| raised(&error.into()))?;
    read(write_file(&path, html.as_bytes()))
}
