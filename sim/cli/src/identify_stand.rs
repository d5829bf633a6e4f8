//! `rotorlead identify --stand`

use std::path::Path;

use clap::Args;
use miette::WrapErr as _;
use rotorlead_answer::words::warning;
use rotorlead_answer::{Report, Tone, Verdict, with_std};
use rotorlead_identify::parametric::{OrderScore, Root};
use rotorlead_identify::stand::{StandIdentification, StandOptions, identify_stand};
use rotorlead_identify::{power_over_noise, times_noise, with_advice};
use rotorlead_records::Experiment;
use rotorlead_records::files::{Quantity, check_writable};
use rotorlead_results::{stand_section, stand_table};
use serde::Serialize;

use super::identify::written;
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
    #[arg(long, value_name = "HZ", requires = "stand", value_parser = number(Quantity::FREQUENCY_HZ))]
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
    let (experiment, stand) = progress::of_files("identifying", &[folder], || -> miette::Result<_> {
        let experiment = Experiment::read_force(folder)?;
        let stand = identify_stand(&experiment, &options)
            .wrap_err_with(|| format!("no stand was identified from `{}`", folder.display()))?;
        Ok((experiment, stand))
    })?;
    out.map_or(Ok(()), |out| stand.model().write(out))?;

    let mut text = table(&stand);
    if !stand.warnings.is_empty() {
        text.push('\n');
    }
    text.extend(stand.warnings.iter().map(|one| warning(&with_advice(one))));
    text.push_str(&written(out));
    text.push_str(&report.write(|| {
        let usable = match stand.usable_hz {
            Some(usable) => format!("The stand can be used up to {:.1} Hz.", usable.value),
            None => format!("The stand can be used up to {:.1} Hz at least.", stand.top_hz),
        };
        let tone = if stand.warnings.is_empty() { Tone::Good } else { Tone::Attention };
        Report {
            facts: [
                report_pages::records(&experiment, folder),
                out.map(|out| report_pages::file("Stand model", out)).into_iter().collect(),
            ]
            .concat(),
            warnings: stand.warnings.iter().map(with_advice).collect(),
            sections: vec![stand_section(&stand)],
            ..report_pages::report("Stand", format!("Stand of {}", experiment.name), Verdict::new(tone, usable))
        }
    })?);
    Ok(Outcome::new(text, &Values::of(&stand)))
}

fn table(stand: &StandIdentification) -> String {
    let fit = &stand.fit;
    let mut text = format!(
        "{}\n\
         {} lines up to {:.1} Hz: {}, static gain {}\n\
         leaves {}\n\
         tail probabilities: power {:.2}, whiteness {:.2}, independence of the force {:.2}\n\n{}",
        stand.records.join(", "),
        stand.response.lines.len(),
        stand.top_hz,
        fit.structure,
        with_std(fit.gain.value, Some(fit.gain.std), 1.0, 4),
        times_noise(fit.residual.reduced_chi_square, 2),
        fit.residual.power_p_value,
        fit.residual.whiteness_p_value,
        fit.residual.input_independence_p_value,
        stand_table(stand).text(),
    );
    text += &match stand.usable_hz {
        Some(usable) => {
            let usable_hz = with_std(usable.value, Some(usable.std), 1.0, 2);
            format!("\nUsable up to {usable_hz} Hz: 3 dB off the static gain there\n")
        }
        None => format!("\nUsable up to {:.1} Hz at least: nowhere 3 dB off the static gain\n", stand.top_hz),
    };
    text.push_str("  +- is one standard error, of the noise alone.\n");
    text
}

/// What came out, for programs.
#[derive(Serialize)]
struct Values<'a> {
    records: &'a [String],
    gain: f64,
    gain_std: f64,
    poles: Vec<&'a Root>,
    zeros: Vec<&'a Root>,
    usable_hz: Option<f64>,
    usable_hz_std: Option<f64>,
    top_hz: f64,
    reduced_chi_square: Option<f64>,
    power_p_value: f64,
    whiteness_p_value: f64,
    input_independence_p_value: f64,
    orders: Vec<Order>,
    warnings: Vec<String>,
}

/// How well a structure predicts; infinite, and so null, where nothing was found.
#[derive(Serialize)]
struct Order {
    poles: usize,
    zeros: usize,
    held_out: f64,
    score: f64,
}

impl<'a> Values<'a> {
    fn of(stand: &'a StandIdentification) -> Self {
        let (gain, residual) = (stand.fit.gain, &stand.fit.residual);
        let order = |order: &OrderScore| Order {
            poles: order.structure.poles,
            zeros: order.structure.zeros,
            held_out: order.held_out,
            score: order.score,
        };
        Self {
            records: &stand.records,
            gain: gain.value,
            gain_std: gain.std,
            poles: stand.poles().collect(),
            zeros: stand.zeros().collect(),
            usable_hz: stand.usable_hz.map(|usable| usable.value),
            usable_hz_std: stand.usable_hz.map(|usable| usable.std),
            top_hz: stand.top_hz,
            reduced_chi_square: power_over_noise(residual.reduced_chi_square),
            power_p_value: residual.power_p_value,
            whiteness_p_value: residual.whiteness_p_value,
            input_independence_p_value: residual.input_independence_p_value,
            orders: stand.scores.iter().map(order).collect(),
            warnings: stand.warnings.iter().map(with_advice).collect(),
        }
    }
}
