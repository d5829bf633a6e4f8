//! `rotorlead.design`

use std::f64::consts::PI;
use std::path::PathBuf;

use miette::WrapErr as _;
use numpy::{Complex64, IntoPyArray as _, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rotorlead_design::{Latency, Setting};
use rotorlead_plant::CompensatorDesign;
use rotorlead_records::files::{Fault, KeyPath, check_writable};
use rotorlead_results::{DesignRequest, Kind};
use rotorlead_vehicle::Purpose;

use crate::argument::{Given, one_of, read};
use crate::error::refused;
use crate::interrupt;
use crate::value::to_dict;

/// Frequencies of the response, and the lowest of them in radians per second.
const FREQUENCIES: usize = 400;
const LOWEST_RAD_S: f64 = 0.1;

/// Designs one compensator for all points of a model.
///
/// `model` is a path, or a dict as `identify` gives it in `model`. `kind` is `lead` or `inverse`, and unless given what is
/// recommended for the `purpose`, `force` or `rate_loop`; `omega_g_rad_s` and
/// `prewarp_rad_s` are of a lead, `natural_rad_s`, `setting` (`exact` or `robust`), `output_range` and `compensate_range` of an
/// inverse. They are the options of `rotorlead design`, and have its defaults. `out` is where the
/// compensator goes. The result has the keys of `rotorlead design --json`; `compensator`, which is what `out` would hold; and
/// `frequency_response`, that of the compensator at each point of the model.
#[pyfunction]
#[pyo3(signature = (
    model, *, kind = None, purpose = "force", omega_g_rad_s = None, damping = None, loop_rate_hz = None, prewarp_rad_s = None,
    natural_rad_s = None, setting = None, slew_per_s = None, output_range = None, compensate_range = None, out = None
))]
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
) -> PyResult<Bound<'py, PyDict>> {
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
        kind: kind.map(|kind| one_of("kind", kind, &[("lead", Kind::Lead), ("inverse", Kind::Inverse)])).transpose()?,
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
    let purpose = one_of("purpose", purpose, &[("force", Purpose::Force), ("rate_loop", Purpose::RateLoop)])?;
    if let Some(name) = request.foreign() {
        let fault =
            KeyPath::root().key(name).fault("no option of this kind of compensator", "leave it out, or change kind");
        return Err(refused(&fault));
    }
    let (model, name) = model.model()?;
    out.as_deref().map_or(Ok(()), |out| read(check_writable(out)))?;
    let (answer, found) = interrupt::run(py, move || {
        let found = request
            .design(&model, purpose, Latency::standard(request.loop_rate_hz()))
            .map_err(miette::Report::from)
            .wrap_err_with(|| format!("`{}` gives no compensator", name.display()))?;
        out.map_or(Ok(()), |out| found.compensator.write(&out))?;
        Ok((found.answer(&model), found))
    })?;
    let dict = to_dict(py, &answer.json())?;
    dict.set_item("compensator", to_dict(py, &found.compensator.stored())?)?;
    let nominals: Vec<f64> = found.bandwidth.points.iter().map(|point| point.nominal).collect();
    dict.set_item("frequency_response", frequency_response(py, &found.compensator, &nominals)?)?;
    Ok(dict)
}

/// Two commands, the first lower.
fn commands(name: &str, (low, high): (f64, f64)) -> Result<(), Fault> {
    if 0.0 <= low && low < high && high <= 1.0 {
        return Ok(());
    }
    Err(KeyPath::root()
        .key(name)
        .fault(format!("({low}, {high}) is no range of commands"), "give two from 0 to 1, the lower first"))
}

/// The response of what runs, the integers and the loop's rate counted: a row for each nominal command, up to half the loop's rate.
fn frequency_response<'py>(
    py: Python<'py>,
    compensator: &CompensatorDesign,
    nominals: &[f64],
) -> PyResult<Bound<'py, PyDict>> {
    let highest = PI * compensator.loop_rate_hz();
    let ratio = (highest / LOWEST_RAD_S).ln() / (FREQUENCIES - 1) as f64;
    let omega_rad_s: Vec<f64> = (0..FREQUENCIES).map(|k| LOWEST_RAD_S * (ratio * k as f64).exp()).collect();
    let rows: Vec<Vec<Complex64>> = nominals
        .iter()
        .map(|nominal| omega_rad_s.iter().map(|omega| compensator.response(*nominal, *omega)).collect())
        .collect();
    let dict = PyDict::new(py);
    dict.set_item("nominal", nominals.to_vec().into_pyarray(py))?;
    dict.set_item("omega_rad_s", omega_rad_s.into_pyarray(py))?;
    dict.set_item("response", PyArray2::from_vec2(py, &rows)?)?;
    Ok(dict)
}
