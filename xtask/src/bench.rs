//! Figures that compare: everything in one table comes from one run.

use crate::run::{Result, cargo, run};

/// The filter beside its peers, and the simulated stand.
pub fn all() -> Result {
    run(&mut cargo(&["bench", "--package", "host-tests", "--bench", "filter", "--locked"]))?;
    run(&mut cargo(&["bench", "--package", "rotorlead-sim", "--bench", "plant", "--locked"]))
}
