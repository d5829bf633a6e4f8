//! `rotorlead.design`

use std::f64::consts::PI;
use std::path::PathBuf;

use miette::WrapErr as _;
use numpy::{Complex64, IntoPyArray as _, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rotorlead_identify::design::redesign::KindOptions;
use rotorlead_identify::design::{DesignOptions, InverseOptions, Latency, Setting};
use rotorlead_plant::{ActiveEffect, CompensatorDesign};
use rotorlead_records::files::{Fault, Place, check_writable};
use rotorlead_results::{DesignResult, Designed};

use crate::argument::{Given, one_of, read};
use crate::error::refused;
use crate::interrupt;
use crate::value::to_dict;

/// Frequencies of the response, and the lowest of them in radians per second.
const FREQUENCIES: usize = 400;
const LOWEST_RAD_S: f64 = 0.1;

/// Designs one compensator for all points of a model.
///
/// `model` is a path, or a dict as `identify` gives it in `model`. `kind` is `lead` or `inverse`; `omega_g_rad_s` and
/// `prewarp_rad_s` are of a lead, `natural_rad_s`, `setting` (`exact` or `robust`), `output_range` and `compensate_range` of an
/// inverse. They are the options of `rotorlead design`, and have its defaults. `out` is where the
/// compensator goes. The result has the keys of `rotorlead design --json`; `compensator`, which is what `out` would hold; and
/// `frequency_response`, that of the compensator at each point of the model.
#[pyfunction]
#[pyo3(signature = (
    model, *, kind = "lead", omega_g_rad_s = None, damping = None, loop_rate_hz = None, prewarp_rad_s = None,
    natural_rad_s = None, setting = None, slew_per_s = None, output_range = None, compensate_range = None, out = None
))]
// They are options by name, as those of the command are.
#[allow(clippy::too_many_arguments)]
pub fn design<'py>(
    py: Python<'py>,
    model: Given<'py>,
    kind: &str,
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
        number.map_or(Ok(()), |number| Place::root().key(name).accept(number)).map_err(|fault| refused(&fault))?;
    }
    for (name, range) in [("output_range", output_range), ("compensate_range", compensate_range)] {
        range.map_or(Ok(()), |range| commands(name, range)).map_err(|fault| refused(&fault))?;
    }
    let of_lead = [("omega_g_rad_s", omega_g_rad_s.is_some()), ("prewarp_rad_s", prewarp_rad_s.is_some())];
    let of_inverse = [
        ("natural_rad_s", natural_rad_s.is_some()),
        ("setting", setting.is_some()),
        ("output_range", output_range.is_some()),
        ("compensate_range", compensate_range.is_some()),
    ];
    let is_lead = one_of("kind", kind, &[("lead", true), ("inverse", false)])?;
    let of_other = if is_lead { &of_inverse[..] } else { &of_lead[..] };
    if let Some((name, _)) = of_other.iter().find(|(_, is_given)| *is_given) {
        let fault =
            Place::root().key(name).fault("no option of this kind of compensator", "leave it out, or change kind");
        return Err(refused(&fault));
    }
    let setting = setting
        .map(|setting| one_of("setting", setting, &[("exact", Setting::Exact), ("robust", Setting::Robust)]))
        .transpose()?;
    let options = if is_lead {
        let default = DesignOptions::default();
        KindOptions::Lead(DesignOptions {
            omega_g_rad_s: omega_g_rad_s.unwrap_or(default.omega_g_rad_s),
            damping: damping.unwrap_or(default.damping),
            loop_rate_hz: loop_rate_hz.unwrap_or(default.loop_rate_hz),
            prewarp_rad_s,
            slew_per_s,
        })
    } else {
        let default = InverseOptions::default();
        KindOptions::Inverse(InverseOptions {
            setting,
            omega_f_rad_s: natural_rad_s,
            damping: damping.unwrap_or(default.damping),
            loop_rate_hz: loop_rate_hz.unwrap_or(default.loop_rate_hz),
            range: output_range.unwrap_or(default.range),
            slew_per_s,
            compensated: compensate_range,
        })
    };
    let (model, name) = model.model()?;
    out.as_deref().map_or(Ok(()), |out| read(check_writable(out)))?;
    let found = interrupt::run(py, move || {
        let effects = ActiveEffect::of_model(&model)?;
        let designed = Designed::of(&model, &options)
            .map_err(miette::Report::from)
            .wrap_err_with(|| format!("`{}` gives no compensator", name.display()))?;
        let latency = Latency::standard(designed.compensator().loop_rate_hz());
        let found = DesignResult::of(&model, &effects, designed, latency);
        out.map_or(Ok(()), |out| found.compensator.write(&out))?;
        Ok(found)
    })?;
    let dict = to_dict(py, &found.values())?;
    dict.set_item("compensator", to_dict(py, &found.compensator.stored())?)?;
    let nominals: Vec<f64> = found.points.iter().map(|point| point.nominal).collect();
    dict.set_item("frequency_response", frequency_response(py, &found.compensator, &nominals)?)?;
    Ok(dict)
}

/// Two commands, the first lower.
fn commands(name: &str, (low, high): (f64, f64)) -> Result<(), Fault> {
    if 0.0 <= low && low < high && high <= 1.0 {
        return Ok(());
    }
    Err(Place::root()
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
