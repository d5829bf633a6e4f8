//! Values of Python as those of a TOML file, and values of JSON as those of Python.

use pyo3::exceptions::PyTypeError;
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyMapping, PyString};
use rotorlead_records::files::KeyPath;
use serde_json::Value as Json;
use toml::{Table, Value as Toml};

use crate::error::refused;

/// Most levels of dicts and lists in each other. Files have four; what holds itself has no end.
const MOST_LEVELS: usize = 16;

/// A mapping as the table of a file. What is None is absent.
pub fn to_table(mapping: &Bound<PyMapping>) -> PyResult<Table> {
    table_within(mapping, MOST_LEVELS)
}

fn table_within(mapping: &Bound<PyMapping>, levels: usize) -> PyResult<Table> {
    let mut table = Table::new();
    for item in mapping.items()? {
        let (key, value): (String, Bound<PyAny>) = item.extract()?;
        if let Some(value) = to_toml(&key, &value, levels)? {
            table.insert(key, value);
        }
    }
    Ok(table)
}

/// The value of a key; `None` where it is None.
fn to_toml(key: &str, value: &Bound<PyAny>, levels: usize) -> PyResult<Option<Toml>> {
    if value.is_none() {
        return Ok(None);
    }
    let Some(inner) = levels.checked_sub(1) else {
        let fault = format!("more than {MOST_LEVELS} dicts and lists are in each other");
        return Err(refused(
            &KeyPath::root().key(key).fault(fault, "give what a file would hold, and nothing that holds itself"),
        ));
    };
    check_whole(key, value)?;
    let scalar = if let Ok(text) = value.cast::<PyString>() {
        Some(Toml::String(text.to_string()))
    } else if let Ok(flag) = value.extract::<bool>() {
        Some(Toml::Boolean(flag))
    } else if let Ok(number) = value.extract::<i64>() {
        Some(Toml::Integer(number))
    } else if let Ok(number) = value.extract::<f64>() {
        Some(Toml::Float(number))
    } else if let Ok(path) = value.call_method0("__fspath__") {
        Some(Toml::String(path.extract()?))
    } else {
        None
    };
    if scalar.is_some() {
        return Ok(scalar);
    }
    if let Ok(mapping) = value.cast::<PyMapping>() {
        return Ok(Some(Toml::Table(table_within(mapping, inner)?)));
    }
    // What has no length may have no end.
    let Some(items) = value.len().ok().and_then(|_| value.try_iter().ok()) else {
        let found = value.get_type().name()?;
        return Err(PyTypeError::new_err(format!(
            "`{key}` is of the type {found}: give a number, a text, a list or a dict"
        )));
    };
    let items = items.filter_map(|item| item.and_then(|item| to_toml(key, &item, inner)).transpose());
    Ok(Some(Toml::Array(items.collect::<PyResult<_>>()?)))
}

/// Refuses what NumPy would turn into plain numbers by dropping a part of it: imaginary parts, and masks.
pub fn check_whole(key: &str, value: &Bound<PyAny>) -> PyResult<()> {
    let place = || KeyPath::root().key(key);
    let Ok(dtype) = value.getattr(intern!(value.py(), "dtype")) else { return Ok(()) };
    if dtype.getattr(intern!(value.py(), "kind")).is_ok_and(|kind| kind.eq("c").unwrap_or(false)) {
        return Err(refused(
            &place().fault("these are complex numbers", "give their real part, if that is what is meant"),
        ));
    }
    let masked = value.py().import(intern!(value.py(), "numpy.ma"))?.call_method1("is_masked", (value,))?;
    if masked.extract()? {
        return Err(refused(&place().fault("values are masked", "leave their rows out of every column")));
    }
    Ok(())
}

/// Numbers, texts, lists and dicts. Null is None.
pub fn to_python<'py>(py: Python<'py>, json: &Json) -> PyResult<Bound<'py, PyAny>> {
    Ok(match json {
        Json::Null => py.None().into_bound(py),
        Json::Bool(flag) => PyBool::new(py, *flag).to_owned().into_any(),
        Json::Number(number) => match (number.as_i64(), number.as_u64(), number.as_f64()) {
            (Some(whole), ..) => PyInt::new(py, whole).into_any(),
            (_, Some(whole), _) => PyInt::new(py, whole).into_any(),
            (.., number) => PyFloat::new(py, number.unwrap_or(f64::NAN)).into_any(),
        },
        Json::String(text) => PyString::new(py, text).into_any(),
        Json::Array(items) => {
            let list = PyList::empty(py);
            items.iter().try_for_each(|item| list.append(to_python(py, item)?))?;
            list.into_any()
        }
        Json::Object(entries) => {
            let dict = PyDict::new(py);
            entries.iter().try_for_each(|(key, value)| dict.set_item(key, to_python(py, value)?))?;
            dict.into_any()
        }
    })
}

/// What a type of the library says of itself, as a dict.
///
/// # Panics
/// Never for the results of the library: their keys are text.
pub fn to_dict<'py>(py: Python<'py>, value: &impl serde::Serialize) -> PyResult<Bound<'py, PyDict>> {
    let json = serde_json::to_value(value).expect("keys are text, and no value fails to be written");
    Ok(to_python(py, &json)?.cast_into()?)
}
