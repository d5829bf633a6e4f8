//! What a simulated experiment is made of, and what it says of itself.

use std::path::Path;

use miette::Diagnostic as _;
use rotorlead_plant::bench::Plan;
use rotorlead_plant::{CompensatorDesign, Model};
use rotorlead_records::files::{Fault, FileError, KeyPath, TextFile, TomlFile};
use rotorlead_records::{Excitation, Experiment};
use serde_json::{Value, json};

/// Reads a plan whose levels `model` knows, and the compensator that it names by a path that begins in `folder`, unless one is
/// given `instead`.
///
/// # Errors
/// Those of [`Plan::read`] and [`CompensatorDesign::read`], and where the model says nothing of a record's nominal command.
pub fn read_plan(
    text: TextFile,
    model: &Model,
    folder: &Path,
    instead: Option<CompensatorDesign>,
) -> Result<(Plan, Option<CompensatorDesign>), FileError> {
    let (plan, file) = TomlFile::parse::<Plan>(text)?;
    plan.check().and_then(|()| check_nominals(&plan, model)).map_err(|fault| file.show(&fault))?;
    let compensator = match (instead, &plan.compensator) {
        (None, Some(name)) => {
            let path = folder.join(name);
            if !path.is_file() {
                let fault = KeyPath::root().key("compensator").fault(
                    format!("`{}` does not exist", path.display()),
                    "correct the name, which begins in the plan's folder, or put the file there",
                );
                return Err(file.show(&fault));
            }
            Some(CompensatorDesign::read(&path)?)
        }
        (instead, _) => instead,
    };
    Ok((plan, compensator))
}

/// Refuses a nominal command of which the model says nothing.
fn check_nominals(plan: &Plan, model: &Model) -> Result<(), Fault> {
    for (index, record) in plan.records.iter().enumerate() {
        // A staircase follows the level through and beyond the points.
        if record.excitation != Excitation::Staircase
            && let Err(error) = model.at(record.nominal)
        {
            let help = error.help().map(|help| help.to_string()).unwrap_or_default();
            let place = KeyPath::root().key("record").item(index).key("nominal");
            return Err(place.fault(error.to_string(), help));
        }
    }
    Ok(())
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
