//! Where a compensator comes from.

use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Serialize};

use crate::model::Model;

/// The model that a compensator was designed for: the same request makes another filter of another motor.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CompensatorProvenance {
    /// [`Model::checksum`]: of what the model says, since its file may be moved, commented, or never have been there.
    pub model_crc32: String,
    /// The experiment from which the model was identified, where it names one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub experiment: Option<String>,
    /// The version of this tool.
    pub version: String,
}

impl CompensatorProvenance {
    /// That of a compensator which this version designs for `model`.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        Self {
            model_crc32: model.checksum(),
            experiment: model.provenance.as_ref().and_then(|provenance| provenance.experiment.clone()),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        }
    }
}

/// The model, as one is told from another.
impl Display for CompensatorProvenance {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match &self.experiment {
            Some(experiment) => write!(f, "the model of experiment `{experiment}`, CRC-32 {}", self.model_crc32),
            None => write!(f, "the model with CRC-32 {}", self.model_crc32),
        }
    }
}
