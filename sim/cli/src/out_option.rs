//! What a command says of `--out`.

use std::path::Path;

use rotorlead_records::import::MissingOption;

use super::replacement::written_to;
use super::report_option::this_command_with;

/// Where a model was written, or the command that writes it.
pub(super) fn model_written(out: Option<&Path>) -> String {
    match out {
        Some(out) => format!("{}\n", written_to(out)),
        None => {
            let out = MissingOption { name: "--out", value: "model.toml".to_owned() };
            format!("To keep the model: {}\n", this_command_with(&[out]))
        }
    }
}
