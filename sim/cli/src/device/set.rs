//! `rotorlead device set`

use clap::Args;
use rotorlead::settings::CompensatorKind;
use rotorlead_answer::words;
use rotorlead_device::{Applied, Session, apply};
use serde_json::{Map, Value, json};

use super::super::UsageError;
use super::super::outcome::Outcome;
use super::compensator::{Changes, CompensatorArguments};

#[derive(Args, Debug)]
pub struct Set {
    /// Which setting, as `get` shows them, or motor.*.KEY for every motor; and to what. Levels are commands from 0 to 1,
    /// time constants COMMAND:SECONDS,... or none, speeds
    /// COMMAND:ERPM,... or none. Settings that depend on each other go into one command. On a
    /// controller whose settings nobody has chosen, output.protocol has to be among them
    #[arg(value_names = ["KEY", "VALUE"], num_args = 2.., required_unless_present = "compensator")]
    pairs: Vec<String>,
    #[command(flatten)]
    compensator: CompensatorArguments,
}

impl Set {
    pub fn run(&self, session: &mut Session) -> miette::Result<Outcome> {
        let Changes { settings: changes, warning } = self.changes()?;
        let Applied { settings, warnings: of_controller } = apply(session, &changes, &self.pairs.join(" "))?;
        let mut warnings: Vec<String> = warning.into_iter().map(|finding| finding.sentence()).collect();
        warnings.extend(of_controller);
        let mut text = String::new();
        for (key, value) in &changes {
            text.push_str(&format!("{key} = {value}, "));
        }
        text.push_str("until the power goes; `rotorlead device save` stores it\n");
        if settings.compensator != CompensatorKind::Lead {
            text.push_str("the output of an inverse stays within each motor's idle and max\n");
        }
        text.extend(warnings.iter().map(|sentence| words::warning(sentence)));
        let set: Map<String, Value> = changes.iter().map(|(key, value)| (key.clone(), json!(value))).collect();
        let mut json = json!({ "set": set, "warnings": warnings });
        // As a script that sets one key reads it.
        if let [(key, value)] = &changes[..] {
            json["key"] = json!(key);
            json["value"] = json!(value);
        }
        Ok(Outcome::new(text, &json))
    }

    /// Names and values, those of the compensator's file first.
    fn changes(&self) -> miette::Result<Changes> {
        let (pairs, rest) = self.pairs.as_chunks::<2>();
        if let [key] = rest {
            return Err(UsageError::new(format!("`{key}` has no value"), "give KEY VALUE [KEY VALUE ...]").into());
        }
        let mut changes = self.compensator.changes()?;
        changes.settings.extend(pairs.iter().map(|[key, value]| (key.clone(), value.clone())));
        Ok(changes)
    }
}
