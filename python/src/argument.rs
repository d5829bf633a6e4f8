//! What a function may be given: a path, or the same as a mapping.

use std::path::{Path, PathBuf};

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyMapping;
use rotorlead_plant::{CompensatorDesign, Model};
use rotorlead_records::files::{FileError, KeyPath, TextFile};

use crate::error::{raised, refused, refused_dict};
use crate::value::to_table;

/// A file or folder, or what it would hold.
pub enum Given<'py> {
    /// A text, or what `os.fspath` takes.
    Path(PathBuf),
    /// A mapping with its keys.
    Mapping(Bound<'py, PyMapping>),
}

impl<'a, 'py> FromPyObject<'a, 'py> for Given<'py> {
    type Error = PyErr;

    fn extract(value: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(mapping) = value.cast::<PyMapping>() {
            return Ok(Self::Mapping(mapping.to_owned()));
        }
        value.extract().map(Self::Path).map_err(|_| {
            let found = value.get_type().name().map_or_else(|_| String::new(), |name| name.to_string());
            PyTypeError::new_err(format!("a path or a dict is needed, and this is of the type {found}"))
        })
    }
}

impl Given<'_> {
    /// What `parse` makes of the text of the file, and what to call it. A mapping is written as the file would be, so that it is
    /// read and refused alike.
    pub fn parsed<T>(
        &self,
        name: &str,
        parse: impl FnOnce(TextFile, &Path) -> Result<T, FileError>,
    ) -> PyResult<(T, PathBuf)> {
        match self {
            Self::Path(path) => {
                let text = read(TextFile::read(path))?;
                Ok((read(parse(text, path))?, path.clone()))
            }
            Self::Mapping(mapping) => {
                let mut table = to_table(mapping)?;
                table.entry("format").or_insert(1.into());
                let text = TextFile::in_memory(name, table.to_string());
                let parsed = parse(text, Path::new(name)).map_err(|error| refused_dict(name, &error))?;
                Ok((parsed, name.into()))
            }
        }
    }

    /// The model, and what to call it.
    pub fn model(&self) -> PyResult<(Model, PathBuf)> {
        self.parsed("model", |text, _| Model::parse(text))
    }

    /// The model, and what to call it. A static map alone is one too.
    pub fn any_model(&self) -> PyResult<(Model, PathBuf)> {
        self.parsed("model", |text, _| Model::parse_with_map_alone(text))
    }

    /// The compensator.
    pub fn compensator(&self) -> PyResult<CompensatorDesign> {
        Ok(self.parsed("compensator", |text, _| CompensatorDesign::parse(text))?.0)
    }
}

/// What was read, or the exception that says why not.
pub fn read<T>(result: Result<T, FileError>) -> PyResult<T> {
    result.map_err(|error| raised(&error.into()))
}

/// One of the names that a parameter may have.
pub fn one_of<T: Copy>(parameter: &str, given: &str, choices: &[(&str, T)]) -> PyResult<T> {
    choices.iter().find(|(name, _)| *name == given).map(|(_, choice)| *choice).ok_or_else(|| {
        let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
        let place = KeyPath::root().key(parameter);
        refused(&place.fault(format!("`{given}` is not known"), format!("give one of: {}", names.join(", "))))
    })
}
