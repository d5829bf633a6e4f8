//! The model that a command is about.

use std::path::{Path, PathBuf};

use clap::Args;

/// A model by its place, or by the option that once named it: scripts of users have that.
#[derive(Args, Debug)]
pub struct ModelArgument {
    /// The model, as `rotorlead identify` writes it
    #[arg(value_name = "MODEL", required = true)]
    model: Option<PathBuf>,
    // What excludes an argument that is required stands in for it.
    #[arg(long = "model", value_name = "FILE", hide = true, conflicts_with = "model")]
    model_option: Option<PathBuf>,
}

impl ModelArgument {
    /// The file.
    pub fn path(&self) -> &Path {
        self.model.as_deref().or(self.model_option.as_deref()).expect("one of the two is required")
    }
}
