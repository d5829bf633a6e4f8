//! `rotorlead.simulate`

use std::path::{Path, PathBuf};

use miette::WrapErr as _;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rotorlead_plant::bench::{Plan, run};
use rotorlead_records::files::{KeyPath, OutputFolder};
use rotorlead_results::{read_plan, simulation_json};

use crate::argument::{Given, read};
use crate::error::refused;
use crate::experiment::describe;
use crate::interrupt;
use crate::value::to_dict;

/// The compensator's file in the folder of an experiment.
const COMPENSATOR: &str = "compensator.toml";

/// Runs an experiment on a simulated actuator, through the controller's own code.
///
/// `model` is the actuator and `plan` what to run, both a path or a dict; the paper's experiment unless given. `compensator` is put
/// in front of the ESC. `seed` is that of the noise, instead of the plan's: the same arguments give the same numbers. `out` is
/// the folder of the experiment, which is made. The result has the keys of `rotorlead simulate --json`, those of
/// `experiment.toml`, and in each record its columns as arrays: it is what `identify` and `diagnose` take.
#[pyfunction]
#[pyo3(signature = (model, plan = None, *, compensator = None, seed = None, out = None))]
pub fn simulate<'py>(
    py: Python<'py>,
    model: Given<'py>,
    plan: Option<Given<'py>>,
    compensator: Option<Given<'py>>,
    seed: Option<i128>,
    out: Option<PathBuf>,
) -> PyResult<Bound<'py, PyDict>> {
    let (model, name) = model.model()?;
    let mut refusal = format!("the paper's experiment cannot be run on `{}`", name.display());
    let compensator = compensator.map(|given| given.compensator()).transpose()?;
    let (mut plan, design) = match plan {
        Some(given) => {
            let (text, file) = given.text("plan")?;
            let folder = file.parent().unwrap_or(Path::new(""));
            refusal = format!("`{}` cannot be run on `{}`", file.display(), name.display());
            read(read_plan(text, &model, folder, compensator))?
        }
        None => (Plan::paper(&model), compensator),
    };
    if let Some(seed) = seed {
        let fault = || KeyPath::root().key("seed").fault(format!("{seed} is not in 0 to 2^63 - 1"), "give another one");
        plan.seed = i64::try_from(seed).ok().and_then(|seed| seed.try_into().ok()).ok_or_else(|| refused(&fault()))?;
    }
    if design.is_some() {
        plan.compensator = Some(COMPENSATOR.into());
    }
    let seed = plan.seed;
    let experiment = interrupt::run(py, move || {
        let folder = out.as_deref().map(OutputFolder::create).transpose()?;
        let experiment =
            run(&plan, &model, design.as_ref(), &|_| ()).map_err(miette::Report::from).wrap_err(refusal)?;
        if let Some(folder) = folder {
            experiment.write_into(&folder)?;
            if let Some(design) = design {
                folder.write(COMPENSATOR, design.text(folder.destination())?.as_bytes())?;
            }
            folder.commit()?;
        }
        Ok(experiment)
    })?;
    let dict = to_dict(py, &simulation_json(&experiment, seed))?;
    describe(&dict, experiment)?;
    Ok(dict)
}
