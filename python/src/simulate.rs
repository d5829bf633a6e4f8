//! `rotorlead.simulate`

use std::path::{Path, PathBuf};

use miette::WrapErr as _;
use pyo3::prelude::*;
use rotorlead_plant::bench::{Plan, run};
use rotorlead_records::files::{KeyPath, OutputFolder};
use rotorlead_results::read_plan;

use crate::argument::Given;
use crate::error::refused;
use crate::experiment::InMemory;
use crate::interrupt;

/// The compensator's file in the folder of an experiment.
const COMPENSATOR: &str = "compensator.toml";

/// The records.
#[pyfunction]
pub fn simulate<'py>(
    py: Python<'py>,
    model: Given<'py>,
    plan: Option<Given<'py>>,
    compensator: Option<Given<'py>>,
    seed: Option<i128>,
    out: Option<PathBuf>,
) -> PyResult<InMemory> {
    let (model, name) = model.model()?;
    let mut refusal = format!("the paper's experiment cannot be run on `{}`", name.display());
    let compensator = compensator.map(|given| given.compensator()).transpose()?;
    let (mut plan, design) = match plan {
        Some(given) => {
            let read = |text, file: &Path| read_plan(text, &model, file.parent().unwrap_or(Path::new("")), compensator);
            let (planned, file) = given.parsed("plan", read)?;
            refusal = format!("`{}` cannot be run on `{}`", file.display(), name.display());
            planned
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
    Ok(InMemory::new(experiment))
}
