//! Models, compensators and plans: read, held to their rules, and written as the command line writes them.

use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rotorlead_plant::bench::Plan;
use rotorlead_plant::{CompensatorDesign, Model};
use rotorlead_records::files::{FileError, TextFile, TomlFile, to_toml, write_file};

use crate::argument::{Given, one_of, read};
use crate::value::to_dict;

/// What is in a file.
enum Document {
    Model(Box<Model>),
    Compensator(Box<CompensatorDesign>),
    Plan(Plan),
}

impl Document {
    fn new(kind: &str, given: &Given) -> PyResult<Self> {
        let plan = |text: TextFile, _: &Path| -> Result<Plan, FileError> {
            let (plan, file) = TomlFile::parse::<Plan>(text)?;
            plan.check().map_err(|fault| file.show(&fault))?;
            Ok(plan)
        };
        match one_of("kind", kind, &[("model", 0), ("compensator", 1), ("plan", 2)])? {
            0 => Ok(Self::Model(Box::new(given.any_model()?.0))),
            1 => Ok(Self::Compensator(Box::new(given.compensator()?))),
            _ => Ok(Self::Plan(given.parsed("plan", plan)?.0)),
        }
    }
}

/// The keys of a file or a dict of this kind, `model`, `compensator` or `plan`, after its checks.
#[pyfunction]
pub fn document<'py>(py: Python<'py>, kind: &str, given: Given<'py>) -> PyResult<Bound<'py, PyDict>> {
    match Document::new(kind, &given)? {
        Document::Model(model) => to_dict(py, &*model),
        Document::Compensator(design) => to_dict(py, &design.stored()),
        Document::Plan(plan) => to_dict(py, &plan),
    }
}

/// Writes what [`document`] would give.
#[pyfunction]
pub fn write_document(kind: &str, given: Given, path: PathBuf) -> PyResult<()> {
    read(match Document::new(kind, &given)? {
        Document::Model(model) => model.write(&path),
        Document::Compensator(design) => design.write(&path),
        Document::Plan(plan) => write_file(&path, to_toml(&plan).as_bytes()),
    })
}

/// Gain, time constant in seconds and dead time in seconds of a model at a command, between its points along straight lines.
#[pyfunction]
pub fn lag_at(model: Given, nominal: f64) -> PyResult<(f64, f64, f64)> {
    let lag = model.model()?.0.at(nominal).map_err(|error| crate::error::raised(&error.into()))?;
    Ok((lag.gain, lag.time_constant_s, lag.delay_s))
}

/// Zero and poles in rad/s, and damping, of the continuous lead that a compensator is for small signals around a command; None where
/// it is bypassed.
#[pyfunction]
pub fn lead_at(compensator: Given, nominal: f64) -> PyResult<Option<(f64, f64, f64)>> {
    let lead = compensator.compensator()?.lead_at(nominal);
    Ok(lead.map(|lead| (lead.omega_z_rad_s, lead.omega_f_rad_s, lead.damping)))
}
