//! `rotorlead identify --stand`

use std::path::Path;

use clap::Args;
use miette::WrapErr as _;
use rotorlead_answer::Report;
use rotorlead_identify::stand::{StandOptions, identify_stand};
use rotorlead_records::Experiment;
use rotorlead_records::files::{AcceptedRange, check_writable};
use rotorlead_results::stand_answer;

use super::out_option::model_written;
use super::outcome::Outcome;
use super::parameters::number;
use super::report_option::ReportOption;
use super::{progress, report_pages};

/// What only a stand needs.
#[derive(Args, Debug)]
pub struct StandArguments {
    /// With --stand: the number of poles, instead of the one that predicts best
    #[arg(long, value_name = "POLES", requires = "stand", value_parser = clap::value_parser!(u8).range(1..=16))]
    order: Option<u8>,
    /// With --stand: the highest frequency of the fit, hertz
    #[arg(long, value_name = "HZ", requires = "stand", value_parser = number(AcceptedRange::FREQUENCY_HZ))]
    top: Option<f64>,
}

/// Identifies the stand of the experiment in `folder`, and writes it to `out` where that is given.
pub fn run(
    folder: &Path,
    out: Option<&Path>,
    arguments: &StandArguments,
    report: &ReportOption,
) -> miette::Result<Outcome> {
    out.map_or(Ok(()), check_writable)?;
    report.check()?;
    let mut options = StandOptions::default();
    if let Some(order) = arguments.order {
        options.poles = usize::from(order)..=usize::from(order);
    }
    if let Some(top_hz) = arguments.top {
        options.band_hz.1 = top_hz;
    }
    let (experiment, stand) = progress::over_files("identifying", &[folder], || -> miette::Result<_> {
        let experiment = Experiment::read_force_input(folder)?;
        let stand = identify_stand(&experiment, &options)
            .wrap_err_with(|| format!("no stand was identified from `{}`", folder.display()))?;
        Ok((experiment, stand))
    })?;
    out.map_or(Ok(()), |out| stand.model().write(out))?;

    let answer = stand_answer(&stand);
    let report = report.write(|| {
        let model = out.map(|out| report_pages::file("Stand model", out));
        let facts = [report_pages::records(&experiment, folder), model.into_iter().collect()].concat();
        Report { facts, ..report_pages::answer_page("Stand", format!("Stand of {}", experiment.name), &answer) }
    })?;
    Ok(Outcome::from_answer(&answer, &(model_written(out) + &report)))
}
