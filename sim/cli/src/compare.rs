//! `rotorlead compare`

use std::path::{Path, PathBuf};

use clap::Args;
use miette::WrapErr as _;
use rotorlead_answer::Report;
use rotorlead_assess::compare;
use rotorlead_identify::identification::IdentifyOptions;
use rotorlead_plant::Model;
use rotorlead_records::files::TomlFile;
use rotorlead_results::{IdentifyResult, Subject, comparison_answer};

use super::measured::Reader;
use super::outcome::{JsonOption, Outcome};
use super::report_option::ReportOption;
use super::{progress, report_pages};

/// Says whether two motors differ: two propellers, two motors, or one before and after
///
/// Each of A and B is a model, an experiment's folder, or a log; of the latter two the lags are identified first, both with the same
/// options. Compared are time constant, gain and dead time at the commands that both have, between two points of a model by
/// interpolation. A difference is shown where its interval leaves zero out; the intervals of one quantity hold together
/// with 95 %, whatever the number of commands. A small difference may be sure, and not matter: its size stands beside.
#[derive(Args, Debug)]
pub struct Compare {
    /// What was before, or the first motor
    #[arg(value_name = "A")]
    a: PathBuf,
    /// What is compared with it
    #[arg(value_name = "B")]
    b: PathBuf,
    #[command(flatten)]
    reader: Reader,
    #[command(flatten)]
    pub(super) report: ReportOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl Compare {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        self.report.check()?;
        let (a, b) = progress::over_files("identifying", &[&self.a, &self.b], || -> miette::Result<_> {
            Ok((self.model(&self.a)?, self.model(&self.b)?))
        })?;
        let compared = compare(&a, &b)
            .map_err(miette::Report::from)
            .wrap_err_with(|| format!("`{}` and `{}` are not compared", self.a.display(), self.b.display()))?;
        let [name_a, name_b] = [&self.a, &self.b].map(|path| path.display().to_string());
        let [a, b] = [(&name_a, &a), (&name_b, &b)].map(|(name, model)| Subject { name, model });
        let answer = comparison_answer(&a, &b, &compared);
        let written = self.report.write(|| Report {
            facts: vec![report_pages::file("A", &self.a), report_pages::file("B", &self.b), report_pages::version()],
            ..report_pages::answer_page("Comparison", format!("{name_a} and {name_b}"), &answer)
        })?;
        Ok(Outcome::from_answer(&answer, &written))
    }

    /// The model at `path`, or that of the records there.
    fn model(&self, path: &Path) -> miette::Result<Model> {
        if TomlFile::is_called_so(path) {
            return Ok(Model::read(path)?);
        }
        let mut experiment = self.reader.read(path, u64::MAX)?.experiment;
        self.reader.choose_output(&mut experiment)?;
        let found = IdentifyResult::identify(&experiment, &IdentifyOptions::default())
            .map_err(miette::Report::from)
            .wrap_err_with(|| format!("nothing was identified from `{}`", path.display()))?;
        Ok(found.identification.model)
    }
}
