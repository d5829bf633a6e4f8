//! Writes the controller's phase tables, `src/excitation/phases.rs`, from their recipes.

use std::path::Path;

use rotorlead_plant::bench::multisine::flight::{RECIPES, find_phases, source};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut sets = Vec::new();
    for recipe in RECIPES {
        let (multisine, phases) = find_phases(&recipe, |_| ())?;
        println!("{}: crest factor {:.4}", recipe.name, multisine.crest_factor(50_000));
        sets.push((recipe, phases));
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../src/excitation/phases.rs");
    std::fs::write(&path, source(&sets))?;
    println!("{} written", path.display());
    Ok(())
}
