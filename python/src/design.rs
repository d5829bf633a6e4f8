//! `rotorlead.design`

use std::path::PathBuf;

use miette::WrapErr as _;
use numpy::{Complex64, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rotorlead_answer::Report;
use rotorlead_design::{Latency, Setting};
use rotorlead_records::files::{Fault, KeyPath, check_writable};
use rotorlead_results::{DesignRequest, Kind, answer_page, version_fact};
use rotorlead_vehicle::Purpose;

use crate::argument::{Given, one_of, read};
use crate::error::refused;
use crate::interrupt;
use crate::page::{Answered, answered};
use crate::value::to_dict;

/// The kinds of compensator, and what one is for, by their names.
pub const KINDS: [(&str, Kind); 2] = [("lead", Kind::Lead), ("inverse", Kind::Inverse)];
pub const PURPOSES: [(&str, Purpose); 2] = [("force", Purpose::Force), ("rate_loop", Purpose::RateLoop)];

/// The answer, and the compensator.
#[pyfunction]
// They are options by name, as those of the command are.
#[allow(clippy::too_many_arguments)]
pub fn design<'py>(
    py: Python<'py>,
    model: Given<'py>,
    kind: Option<&str>,
    purpose: &str,
    omega_g_rad_s: Option<f64>,
    damping: Option<f64>,
    loop_rate_hz: Option<f64>,
    prewarp_rad_s: Option<f64>,
    natural_rad_s: Option<f64>,
    setting: Option<&str>,
    slew_per_s: Option<f64>,
    output_range: Option<(f64, f64)>,
    compensate_range: Option<(f64, f64)>,
    out: Option<PathBuf>,
) -> PyResult<(Answered<'py>, Bound<'py, PyDict>)> {
    let numbers = [
        ("omega_g_rad_s", omega_g_rad_s),
        ("damping", damping),
        ("loop_rate_hz", loop_rate_hz),
        ("prewarp_rad_s", prewarp_rad_s),
        ("natural_rad_s", natural_rad_s),
        ("slew_per_s", slew_per_s),
    ];
    for (name, number) in numbers {
        number.map_or(Ok(()), |number| KeyPath::root().key(name).accept(number)).map_err(|fault| refused(&fault))?;
    }
    for (name, range) in [("output_range", output_range), ("compensate_range", compensate_range)] {
        range.map_or(Ok(()), |range| commands(name, range)).map_err(|fault| refused(&fault))?;
    }
    let request = DesignRequest {
        kind: kind.map(|kind| one_of("kind", kind, &KINDS)).transpose()?,
        omega_g_rad_s,
        prewarp_rad_s,
        natural_rad_s,
        setting: setting
            .map(|setting| one_of("setting", setting, &[("exact", Setting::Exact), ("robust", Setting::Robust)]))
            .transpose()?,
        output_range,
        compensate_range,
        damping,
        loop_rate_hz,
        slew_per_s,
    };
    let purpose = one_of("purpose", purpose, &PURPOSES)?;
    if let Some(name) = request.foreign() {
        let fault =
            KeyPath::root().key(name).fault("no option of this kind of compensator", "leave it out, or change kind");
        return Err(refused(&fault));
    }
    let (model, name) = model.model()?;
    out.as_deref().map_or(Ok(()), |out| read(check_writable(out)))?;
    let (values, page, compensator) = interrupt::run(py, move || {
        let found = request
            .design(&model, purpose, Latency::standard(request.loop_rate_hz()))
            .map_err(miette::Report::from)
            .wrap_err_with(|| format!("`{}` gives no compensator", name.display()))?;
        out.map_or(Ok(()), |out| found.compensator.write(&out))?;
        let answer = found.answer(&model);
        let title = format!("Compensator for {}", name.display());
        let page = Report { facts: vec![version_fact()], ..answer_page("Design", title, &answer) };
        Ok((answer.json(), page, found.compensator))
    })?;
    Ok((answered(py, &values, &page)?, to_dict(py, &compensator.stored())?))
}

/// Two commands, the first lower.
pub fn commands(name: &str, (low, high): (f64, f64)) -> Result<(), Fault> {
    if 0.0 <= low && low < high && high <= 1.0 {
        return Ok(());
    }
    Err(KeyPath::root()
        .key(name)
        .fault(format!("({low}, {high}) is no range of commands"), "give two from 0 to 1, the lower first"))
}

/// The response of what runs at each nominal command and angular frequency, the integers and the loop's rate counted: a row for
/// each command.
#[pyfunction]
pub fn response<'py>(
    py: Python<'py>,
    compensator: Given<'py>,
    nominals: Vec<f64>,
    omega_rad_s: Vec<f64>,
) -> PyResult<Bound<'py, PyArray2<Complex64>>> {
    let compensator = compensator.compensator()?;
    let row = |nominal: &f64| omega_rad_s.iter().map(|omega| compensator.response(*nominal, *omega)).collect();
    let rows: Vec<Vec<Complex64>> = nominals.iter().map(row).collect();
    Ok(PyArray2::from_vec2(py, &rows)?)
}
