//! The Python package `rotorlead`: what the command line identifies, simulates, diagnoses and designs, on NumPy arrays and on
//! record folders. Both ask [`rotorlead_results`], so their numbers are the same. `rotorlead/_native.pyi` has the types.

mod argument;
mod design;
mod diagnose;
mod error;
mod experiment;
mod identify;
mod interrupt;
mod simulate;
mod value;

use pyo3::pymodule;

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::design::design;
    #[pymodule_export]
    use super::diagnose::diagnose;
    #[pymodule_export]
    use super::error::Error;
    #[pymodule_export]
    use super::identify::identify;
    #[pymodule_export]
    use super::simulate::simulate;
    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
