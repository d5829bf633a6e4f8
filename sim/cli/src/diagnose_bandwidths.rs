//! `rotorlead diagnose --bandwidths`

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use miette::WrapErr as _;
use rotorlead_answer::Report;
use rotorlead_answer::Verdict as Headline;
use rotorlead_diagnose::bandwidth_table::{
    BandwidthDiagnosis, BandwidthOptions, BandwidthTable, Column, Explanation, Scope, diagnose_bandwidths,
};
use rotorlead_diagnose::{Verdict, by_name};
use rotorlead_identify::design::{DesignOptions, design};
use rotorlead_plant::CompensatorDesign;
use rotorlead_plant::{Catalog, Model, Provenance};
use rotorlead_records::files::{Quantity, check_writable};
use rotorlead_results::{
    bandwidth_diagnosis_section, diagnosis_tone, explanations_table, parameter_table, predicted_table, ratios_table,
};
use serde_json::{Value, json};

use super::outcome::Outcome;
use super::parameters::number;
use super::replaced::written_to;
use super::report_option::ReportOption;
use super::report_pages;
use rotorlead_answer::words::wrapped;

/// Width of what is said.
const WIDTH: usize = 80;

/// A table of bandwidths in place of records.
#[derive(Args, Debug)]
pub struct BandwidthArguments {
    /// A table of measured bandwidths in place of records: a CSV file with the columns u_nom, uncompensated_rad_s and
    /// compensated_rad_s, in which a bandwidth that was not measured is left empty
    #[arg(long, value_name = "FILE", requires = "model")]
    bandwidths: Option<PathBuf>,
    /// The compensator with which the bandwidths were measured; the lead that `rotorlead design` makes of the model unless given
    #[arg(long, value_name = "FILE", conflicts_with = "experiment")]
    compensator: Option<PathBuf>,
    /// The column that numbers are fitted to; the other one is held out, and only predicted
    #[arg(long, value_name = "COLUMN", conflicts_with = "experiment", default_value = "uncompensated")]
    fit: FittedColumn,
    /// Standard error of a measured bandwidth, as a part of it, where it is known, as in 0.02
    #[arg(long, value_name = "PART", conflicts_with = "experiment", value_parser = number(Quantity::ACCURACY), allow_negative_numbers = true)]
    accuracy: Option<f64>,
    /// Take this explanation, by its name in the list, in place of the one that the rules choose
    #[arg(long, value_name = "EXPLANATION", conflicts_with = "experiment")]
    take: Option<String>,
}

/// A column, as an option.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum FittedColumn {
    Uncompensated,
    Compensated,
}

impl BandwidthArguments {
    /// The table's file, where one was given.
    pub fn table(&self) -> Option<&Path> {
        self.bandwidths.as_deref()
    }

    /// Diagnoses `table`; `model` was read from `model_file`.
    pub fn run(
        &self,
        table: &Path,
        model: &Model,
        model_file: &Path,
        out: Option<&Path>,
        report: &ReportOption,
    ) -> miette::Result<Outcome> {
        report.check()?;
        let fitted = match self.fit {
            FittedColumn::Uncompensated => Column::Uncompensated,
            FittedColumn::Compensated => Column::Compensated,
        };
        let measured = BandwidthTable::read(table, model, fitted)?;
        let design = match &self.compensator {
            Some(file) => *CompensatorDesign::read(file)?.as_lead().ok_or_else(|| {
                miette::miette!(
                    help = "give the compensator of the table: one for a lead; an inverse has a bandwidth of its own at each point",
                    "`{}` is an inverse, and bandwidths are diagnosed behind a lead",
                    file.display()
                )
            })?,
            None => design(model, &DesignOptions::default()).map_err(miette::Report::from).wrap_err_with(|| {
                format!("`{}` gives no compensator: give yours, --compensator", model_file.display())
            })?,
        };
        if let Some(out) = out {
            check_writable(out)?;
        }
        let catalog = Catalog::standard();
        let (accuracy, take) = (self.accuracy, self.take.as_deref());
        let options = BandwidthOptions { lead: design.lead(), fitted, accuracy, take, catalog: &catalog };
        let found = diagnose_bandwidths(&measured, model, &options)
            .map_err(miette::Report::from)
            .wrap_err_with(|| format!("nothing was diagnosed from `{}`", table.display()))?;
        let mut text = words(&found);
        if let Some(out) = out {
            let mut extended = found.model().map_err(miette::Report::from)?;
            if let Some(Provenance { records, records_crc32, .. }) = &mut extended.provenance {
                // It is of the others alone.
                *records_crc32 = None;
                records.push(table.display().to_string());
            }
            extended.write(out)?;
            let _ = writeln!(text, "\n{}", written_to(out));
        }
        text.push_str(&report.write(|| {
            let headline = Headline::new(diagnosis_tone(found.verdict), verdict(&found));
            let compensator = self.compensator.as_deref().map(|file| report_pages::file("Compensator", file));
            let facts = vec![report_pages::file("Bandwidths", table), report_pages::file("Model", model_file)];
            Report {
                facts: facts.into_iter().chain(compensator).chain([report_pages::version()]).collect(),
                sections: vec![bandwidth_diagnosis_section(&found)],
                ..report_pages::report("Diagnosis", format!("Diagnosis of {}", table.display()), headline)
            }
        })?);
        Ok(Outcome::new(text, &values(&found)))
    }
}

fn words(found: &BandwidthDiagnosis) -> String {
    let mut text = format!("{}\n", wrapped(&verdict(found), WIDTH, ""));
    let mut line = |line: String| {
        text.push_str(line.trim_end());
        text.push('\n');
    };
    line(format!("\n{}", ratios_table(found).text()));
    if !found.explanations.is_empty() {
        list(found, &mut line);
    }
    if !found.ruled_out.is_empty() {
        line("\nNo explanation:".to_owned());
        let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
        for one in &found.ruled_out {
            match reasons.iter_mut().find(|(reason, _)| *reason == one.reason) {
                Some((_, kinds)) => kinds.push(one.kind.id),
                None => reasons.push((&one.reason, vec![one.kind.id])),
            }
        }
        for (reason, kinds) in reasons {
            line(format!("  {}", wrapped(&format!("{reason}: {}", kinds.join(", ")), WIDTH - 2, "    ")));
        }
    }
    if let Some(one) = found.named() {
        let caption = format!("{} ({})", one.name(), one.kind.title);
        line(format!("\n{}", parameter_table(one.kind, caption, &one.parameters).text()));
        line(format!("\n{}", predicted_table(found, one).text()));
    }
    let on = match (found.held_out, found.fitted.other()) {
        (true, held_out) => format!("the {} column, which no number was fitted to", held_out.word()),
        (false, _) => format!("the {} column, which was fitted: nothing was held out", found.fitted.word()),
    };
    let after = found.named().map_or(found.gap.before, |_| found.gap.after);
    line(format!(
        "\nGap on {on}:\n  RMS of ln(measured / simulated) {:.3} before, {:.3} after",
        found.gap.before, after
    ));
    if let Some(next) = &found.next_experiment {
        let lines: Vec<String> = next.lines().map(|one| wrapped(one, WIDTH - 6, "  ")).collect();
        line(format!("\nNext: {}", lines.join("\n  ")));
    }
    text
}

fn verdict(found: &BandwidthDiagnosis) -> String {
    let title = |one: &Explanation| match one.scope {
        Scope::All => format!("{}, the same at every u_nom", one.kind.title),
        Scope::Each => format!("{}, another at each u_nom", one.kind.title),
    };
    let open = || {
        let others = found.alternatives().len();
        if others == 0 { "" } else { " The fitted column alone allows others, too." }
    };
    match (found.verdict, found.named()) {
        (Verdict::Agrees, None) => match found.accuracy {
            Some(_) => "Model and measurement agree: what is left is no more than the stated error.".to_owned(),
            None => "Model and measurement agree to a percent.".to_owned(),
        },
        (Verdict::Named, Some(one)) => format!("The gap is explained by: {}.{}", title(one), open()),
        (Verdict::PartlyNamed, Some(one)) => {
            format!("Much of the gap is explained by: {}. The rest is not.{}", title(one), open())
        }
        (_, Some(one)) => format!("Taken as asked for, although the bandwidths do not call for it: {}.", title(one)),
        (_, None) => {
            let why = match (found.chosen, found.held_out) {
                (Some(_), true) => "what would explain the fitted column does not predict the other one",
                (Some(_), false) => "a number at each u_nom would reproduce the table, which confirms nothing",
                (None, _) => "nothing that is known brings the model nearer",
            };
            format!("Model and measurement disagree, and nothing explains how: {why}.")
        }
    }
}

fn list(found: &BandwidthDiagnosis, line: &mut impl FnMut(String)) {
    line(format!("\n{}", explanations_table(found).text()));
    let rule = if found.is_asked_for {
        "The chosen one is taken, as asked for."
    } else {
        "Chosen: of the explanations that fit the column as well as the best one, with fewer parameters than the column has \
         values, the one with the fewest parameters, and of these the simplest model; if there is none, the simplest model with a \
         parameter at each u_nom. The other column is not used."
    };
    let rest = "Alternatives cannot be distinguished from it by the fitted column: as likely there, or with as many parameters as the column has values.";
    line(format!("  {}\n  {}", wrapped(rule, WIDTH - 2, "  "), wrapped(rest, WIDTH - 2, "  ")));
}

fn values(found: &BandwidthDiagnosis) -> Value {
    let share = |parts: &mut dyn Iterator<Item = f64>| parts.sum::<f64>();
    let by_nominal = found.table.rows.iter().zip(&found.parts).map(|(row, parts)| {
        json!({
            "axis": "nominal",
            "range": [row.nominal, row.nominal],
            "share": share(&mut parts.iter().map(|part| part.share)),
        })
    });
    let by_column = Column::ALL.into_iter().map(|column| {
        let place = column as usize;
        json!({
            "axis": "compensator",
            "range": [place, place],
            "share": share(&mut found.parts.iter().map(|parts| parts[place].share)),
        })
    });
    let parameters =
        |one: &Explanation| by_name(&one.parameters, serde_json::value::Serializer).expect("names are keys");
    let at_each = |one: &Explanation| -> Vec<Value> {
        let names = || one.kind.fitted().map(|(index, parameter)| (parameter.name, index));
        let rows = found.table.rows.iter().zip(&one.values).zip(&one.predicted_rad_s);
        let row = |((row, values), predicted): (
            (&rotorlead_diagnose::bandwidth_table::BandwidthRow, _),
            &[Option<f64>; 2],
        )| {
            let values: &Option<Vec<f64>> = values;
            json!({
                "nominal": row.nominal,
                "parameters": values.as_ref().map(|values| {
                    names().map(|(name, index)| (name.to_owned(), json!(values[index]))).collect::<serde_json::Map<_, _>>()
                }),
                "uncompensated_rad_s": predicted[0],
                "compensated_rad_s": predicted[1],
            })
        };
        rows.map(row).collect()
    };
    let named = found.named();
    let effects: Vec<Value> = named
        .into_iter()
        .map(|one| {
            json!({
                "kind": one.kind,
                "explanation": one.name(),
                "parameters": parameters(one),
                "gap_before": found.gap.before,
                "gap_after": found.gap.after,
                "evidence": one.score,
                "alternatives": found.alternatives(),
            })
        })
        .collect();
    let after = named.map_or(found.gap.before, |_| found.gap.after);
    json!({
        "verdict": found.verdict,
        "where": by_nominal.chain(by_column).collect::<Vec<_>>(),
        "effects": effects,
        "gap": { "before": found.gap.before, "after": after, "noise_floor": found.accuracy },
        "gap_is": "rms_log_ratio",
        "held_out": found.held_out,
        "fitted_column": found.fitted.name(),
        "bandwidths": found.table.rows.iter().zip(&found.parts).map(|(row, parts)| json!({
            "nominal": row.nominal,
            "measured_rad_s": row.measured_rad_s,
            "simulated_rad_s": parts.map(|part| part.simulated_rad_s),
            "ratio": parts.map(|part| part.ratio),
            "share": parts.map(|part| part.share),
        })).collect::<Vec<_>>(),
        "explanations": found.explanations.iter().map(|one| json!({
            "explanation": one.name(),
            "kind": one.kind,
            "numbers": one.numbers,
            "standing": one.standing,
            "parameters": parameters(one),
            "fitted_gap": one.fitted_rms,
            "held_out_gap": one.held_out_rms,
            "log_likelihood_gain": one.score.map(|_| one.gain),
            "evidence": one.score,
            "points": at_each(one),
        })).collect::<Vec<_>>(),
        "ruled_out": found.ruled_out,
        "next_experiment": found.next_experiment,
    })
}
