//! The native part of the Python package `rotorlead`: what the command line identifies, simulates, diagnoses and designs, on NumPy
//! arrays and on record folders. Both ask [`rotorlead_results`], so their numbers are the same. It gives dicts, arrays and JSON, of
//! which the package makes its objects; `rotorlead/_native.pyi` has the types.

mod argument;
mod bandwidth;
mod design;
mod diagnose;
mod document;
mod error;
mod experiment;
mod export;
mod identify;
mod interrupt;
mod overview;
mod page;
mod simulate;
mod validate;
mod value;

use pyo3::pymodule;

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::bandwidth::bandwidth;
    #[pymodule_export]
    use super::design::design;
    #[pymodule_export]
    use super::design::response;
    #[pymodule_export]
    use super::diagnose::diagnose;
    #[pymodule_export]
    use super::document::document;
    #[pymodule_export]
    use super::document::lag_at;
    #[pymodule_export]
    use super::document::lead_at;
    #[pymodule_export]
    use super::document::write_document;
    #[pymodule_export]
    use super::error::Error;
    #[pymodule_export]
    use super::experiment::InMemory;
    #[pymodule_export]
    use super::export::export;
    #[pymodule_export]
    use super::identify::identify;
    #[pymodule_export]
    use super::overview::overview;
    #[pymodule_export]
    use super::page::write_page;
    #[pymodule_export]
    use super::simulate::simulate;
    #[pymodule_export]
    use super::validate::validate;
    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
