//! What a simulated experiment is made of, and what it says of itself.

use std::path::Path;

use miette::Diagnostic as _;
use rotorlead_plant::bench::Plan;
use rotorlead_plant::{CompensatorDesign, Model};
use rotorlead_records::files::{Fault, FileError, Place, TextFile, TomlFile};
use rotorlead_records::{Excitation, Experiment};
use serde_json::{Value, json};

/// Reads a plan whose levels `model` knows.
///
/// # Errors
/// Those of [`Plan::read`], and where the model says nothing of a record's nominal command.
pub fn read_plan(text: TextFile, model: &Model) -> Result<Plan, FileError> {
    let (plan, file) = TomlFile::parse::<Plan>(text)?;
    plan.check().and_then(|()| check_nominals(&plan, model)).map_err(|fault| file.show(&fault))?;
    Ok(plan)
}

/// Refuses a nominal command of which the model says nothing.
fn check_nominals(plan: &Plan, model: &Model) -> Result<(), Fault> {
    for (index, record) in plan.records.iter().enumerate() {
        // A staircase follows the level through and beyond the points.
        if record.excitation != Excitation::Staircase
            && let Err(error) = model.at(record.nominal)
        {
            let help = error.help().map(|help| help.to_string()).unwrap_or_default();
            let place = Place::root().key("record").item(index).key("nominal");
            return Err(place.fault(error.to_string(), help));
        }
    }
    Ok(())
}

/// The compensator that a plan names, by a path that begins in `folder`.
///
/// # Errors
/// Those of [`CompensatorDesign::read`].
pub fn compensator(plan: &Plan, folder: &Path) -> Result<Option<CompensatorDesign>, FileError> {
    plan.compensator.as_ref().map(|file| CompensatorDesign::read(&folder.join(file))).transpose()
}

/// Which records there are. `seed` is that of their noise.
#[must_use]
pub fn simulation_json(experiment: &Experiment, seed: u64) -> Value {
    json!({
        "name": experiment.name,
        "seed": seed,
        "records": experiment.records.iter()
            .map(|record| json!({ "file": record.file, "nominal": record.nominal, "rows": record.time_s.len() }))
            .collect::<Vec<_>>(),
    })
}
