//! What both kinds of file have in common: parameters, and the integers that the controller computes of them.

use std::fmt::Display;
use std::path::Path;

use rotorlead_records::files::{Fault, FileError, KeyPath, TextFile, TomlFile, to_toml};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A compensator's file. The parameters are what counts: a controller computes the integers from them at start-up. The integers are
/// in the file to be compared: they tell whether two programs mean the same filter.
pub(super) trait CompensatorFile: DeserializeOwned + Serialize {
    /// What is designed from it.
    type Design;

    /// The file of a design.
    fn from_design(design: &Self::Design) -> Self;

    /// Refuses parameters that make no filter at any number format.
    fn check(&self) -> Result<(), Fault>;

    /// The controller's own design; its error is the reason why it refuses the parameters.
    fn design(&self) -> Result<Self::Design, impl Display>;

    /// The stored integers with their places, in an order that depends on their number alone.
    fn integers(&self) -> Vec<(KeyPath, i32)>;

    /// Reads a file's text, and refuses it unless the controller makes the stored integers of its parameters.
    fn parse(text: TextFile) -> Result<(Self::Design, Self), FileError> {
        let (stored, file): (Self, _) = TomlFile::parse(text)?;
        stored.check().map_err(|fault| file.show(&fault))?;
        let design = stored.design().map_err(|reason| {
            file.show(&KeyPath::root().fault(
                format!("no filter can be made of these parameters: {reason}"),
                "run `rotorlead design`, or correct the parameter",
            ))
        })?;
        same(&stored.integers(), &Self::from_design(&design).integers()).map_err(|fault| file.show(&fault))?;
        Ok((design, stored))
    }

    /// The text of a file that is to be at `path`, checked.
    fn text(&self, path: &Path) -> Result<String, FileError> {
        self.check().map_err(|fault| FileError::refused(path, fault))?;
        Ok(to_toml(self))
    }
}

fn same(stored: &[(KeyPath, i32)], computed: &[(KeyPath, i32)]) -> Result<(), Fault> {
    let differs = |place: &KeyPath, stored: String, computed: String| {
        Err(place.clone().fault(
            format!("{stored} is stored, but the parameters give {computed}"),
            "a parameter or an integer was changed by hand, or another version wrote the file: run `rotorlead design` again",
        ))
    };
    for ((place, stored), (_, computed)) in stored.iter().zip(computed) {
        if stored != computed {
            return differs(place, stored.to_string(), computed.to_string());
        }
    }
    if stored.len() == computed.len() {
        return Ok(());
    }
    let count = |integers: &[(KeyPath, i32)]| format!("{} integers", integers.len());
    differs(&KeyPath::root().key("coefficients"), count(stored), count(computed))
}
