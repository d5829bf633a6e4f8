//! What a page asks.

use rotorlead_export::Target;
use rotorlead_records::import::ImportOptions;
use rotorlead_results::Kind;
use rotorlead_vehicle::Purpose;
use serde::Deserialize;
use serde_json::{Map, Value};

use crate::fault::Fault;

/// A question to a motor.
#[derive(Debug, Deserialize)]
#[serde(tag = "ask", rename_all = "snake_case", deny_unknown_fields)]
pub enum Request {
    /// Takes the logs, with what they do not say of themselves: options of `rotorlead import` by their names, as they are typed.
    Read {
        #[serde(default)]
        options: Map<String, Value>,
        /// Logs to which nothing is fitted: they judge what the others gave.
        #[serde(default)]
        held_out: Vec<String>,
    },
    /// All that they say.
    Answer {
        kind: Option<KindName>,
        #[serde(default)]
        purpose: PurposeName,
        #[serde(default)]
        diagnosis: bool,
    },
    /// What an inverse of this natural frequency gains and costs.
    Fly {
        natural_rad_s: f64,
        #[serde(default)]
        purpose: PurposeName,
    },
    /// The file for a flight stack, a simulator or a program.
    Export {
        #[serde(rename = "for")]
        target: String,
        #[serde(default)]
        compensated: bool,
    },
    /// A file to keep.
    File { name: FileName },
}

/// The kinds of compensator.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum KindName {
    Lead,
    Inverse,
}

/// What a compensator is for; a force unless said, as on the command line.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PurposeName {
    #[default]
    Force,
    RateLoop,
}

/// The files that a page gives.
#[derive(Clone, Copy, Debug, Deserialize)]
pub enum FileName {
    #[serde(rename = "model.toml")]
    Model,
    #[serde(rename = "compensator.toml")]
    Compensator,
    #[serde(rename = "compensator.h")]
    Header,
    #[serde(rename = "report.html")]
    Report,
}

impl KindName {
    /// The same for a design.
    pub fn kind(self) -> Kind {
        match self {
            Self::Lead => Kind::Lead,
            Self::Inverse => Kind::Inverse,
        }
    }
}

impl PurposeName {
    /// The same for a recommendation.
    pub fn purpose(self) -> Purpose {
        match self {
            Self::Force => Purpose::Force,
            Self::RateLoop => Purpose::RateLoop,
        }
    }
}

impl Request {
    /// An answer as options of `rotorlead report`.
    pub fn report_options(kind: Option<KindName>, purpose: PurposeName, diagnosis: bool) -> String {
        let kind = match kind {
            Some(KindName::Lead) => " --kind lead",
            Some(KindName::Inverse) => " --kind inverse",
            None => "",
        };
        let purpose = match purpose {
            PurposeName::Force => "",
            PurposeName::RateLoop => " --purpose rate-loop",
        };
        let diagnosis = if diagnosis { "" } else { " --no-diagnosis" };
        format!("{kind}{purpose}{diagnosis}")
    }

    /// A question as JSON.
    pub fn parse(text: &str) -> Result<Self, Fault> {
        serde_json::from_str(text).map_err(|error| Fault::new(format!("no question: {error}"), "load the page again"))
    }
}

/// The options of an import.
pub fn import_options(options: &Map<String, Value>) -> Result<ImportOptions, Fault> {
    let mut taken = ImportOptions::default();
    for (name, value) in options {
        let values = match value {
            Value::Array(values) => values.iter().map(typed).collect(),
            Value::Null | Value::Bool(false) => Vec::new(),
            value => vec![typed(value)],
        };
        for value in values {
            taken.set(name, &value).map_err(|reason| Fault::new(format!("{name}: {reason}"), "correct it"))?;
        }
    }
    taken.check()?;
    Ok(taken)
}

/// A value as it would be typed.
fn typed(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// The target of that name.
pub fn target(name: &str) -> Result<Target, Fault> {
    Target::all()
        .find(|target| target.name() == name)
        .ok_or_else(|| Fault::new(format!("nothing is exported for `{name}`"), "choose one of the list"))
}
