//! How well a model explains records: the paper's Table 2 and the numbers behind its Figs. 6 and 7.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use rotorlead_answer::{Answer, Cell, Column, Figure, Table};
use rotorlead_assess::{SIGNIFICANCE, SMALLEST_ERROR_PERCENT, records_with_model_error};
use rotorlead_identify::validate::{
    ComparedLines, ComparedRow, Comparison, Domain, FitBesideCeiling, RecordValidation, TableRow, table_2,
};
use rotorlead_plant::Judgement;
use rotorlead_records::Output;
use rotorlead_vehicle::Recommendation;
use serde_json::json;

use crate::figures::{etfe, time_response};
use crate::json_object::json_object;
use crate::recommendation::{JudgementValues, judged_verdict};

/// Probability that the bands of a figure hold the truth, at each line. Standard: 95 %, as of every interval that is printed.
const BAND: f64 = 0.95;

/// What the records say of the model, in sentences: which were held out, and whether it leaves more than noise.
#[must_use]
pub fn validation_in_words(records: &[RecordValidation]) -> Vec<String> {
    let mut said = vec![held_out(records)];
    let below = below_noise(records);
    let Some(wrong) = records_with_model_error(records) else {
        if below.is_empty() {
            said.push("No record shows its noise: whether the model leaves more than that cannot be said.".to_owned());
        }
        said.extend(below);
        return said;
    };
    let judged: Vec<&RecordValidation> = records.iter().filter(|record| record.judged_residual().is_some()).collect();
    let silent = records.iter().filter(|record| record.residual_power.is_none()).count();
    let least =
        judged.iter().filter_map(|record| record.judged_residual()).map(|left| left.p_value).fold(1.0, f64::min);
    if wrong.is_empty() && least * (judged.len() as f64) < SIGNIFICANCE {
        said.push(format!(
            "The model leaves more than noise (least p {}), and less than {SMALLEST_ERROR_PERCENT} % of the response: about what a \
             good fit leaves.",
            equals(least)
        ));
    } else if wrong.is_empty() {
        let of = if judged.len() == 1 { "p" } else { "least p" };
        said.push(format!(
            "As good as can be: the model leaves no more than noise on {} ({of} = {}).",
            counted(judged.len(), judged.len()),
            probability(least)
        ));
    } else {
        said.push(format!(
            "The model leaves more than noise on {} (level {:.0} % over all):",
            counted(wrong.len(), judged.len()),
            100.0 * SIGNIFICANCE
        ));
        for record in wrong {
            let (Some(left), Some(error)) = (record.residual_power, record.model_error_percent()) else { continue };
            said.push(format!(
                "{}: {:.2} times the noise power (p {}), the model is off by {error:.1} % of the response",
                record.file,
                left.power_ratio,
                equals(left.p_value),
            ));
        }
    }
    said.extend(below);
    if silent > 0 {
        said.push(format!("Of {} more nothing can be said: the noise does not show.", counted(silent, silent)));
    }
    said
}

/// Of which records the model leaves less than noise could.
fn below_noise(records: &[RecordValidation]) -> Vec<String> {
    let below =
        records.iter().filter_map(|record| Some((record, record.residual_power.filter(|left| left.is_below_noise())?)));
    below
        .map(|(record, left)| {
            format!(
                "{}: the model leaves {:.2} times the noise power, less than noise can ({} by chance). The noise is not what it seems, \
                 and says nothing of the model: look for readings that repeat, and for levels that drift or hum.",
                record.file,
                left.power_ratio,
                equals_from_below(1.0 - left.p_value),
            )
        })
        .collect()
}

fn equals_from_below(p_value: f64) -> String {
    // Chosen: the difference from one is not known to more digits.
    if p_value < 1e-12 { String::from("p < 1e-12") } else { format!("p = {}", probability(p_value)) }
}

/// How well a model explains records, and whether a compensator may be built on it.
#[must_use]
pub fn validation_answer(
    records: &[RecordValidation],
    judgement: &Judgement,
    recommendation: Option<&Recommendation>,
    output: Output,
) -> Answer {
    let mut scores = validation_scores(records);
    let by_nominal = validation_by_nominal(records);
    // Where no command has both kinds of records, each record is the summary.
    if by_nominal.is_some() {
        scores = scores.in_detail();
    }
    Answer {
        name: "validation",
        title: "Validation",
        text: validation_in_words(records),
        verdict: judged_verdict(judgement),
        tables: std::iter::once(scores).chain(by_nominal).collect(),
        figures: records.iter().map(|record| comparison_figure(record, output)).collect(),
        values: json_object(
            &json!({ "judgement": JudgementValues::new(judgement, recommendation), "records": records }),
        ),
        ..Answer::default()
    }
}

/// `1 record`, `all 12 records`, `3 of 12 records`.
fn counted(some: usize, all: usize) -> String {
    match (some, all) {
        (1, 1) => String::from("1 record"),
        (some, all) if some == all => format!("{all} records"),
        (some, all) => format!("{some} of {all} records"),
    }
}

fn held_out(records: &[RecordValidation]) -> String {
    let held_out = records.iter().filter(|record| record.fitted == Some(false)).count();
    let all = records.len();
    if records.iter().any(|record| record.fitted.is_none()) {
        String::from("The model does not say what it was fitted to.")
    } else if held_out == 0 {
        String::from("No record was held out: the model was fitted to all of them (its [provenance]).")
    } else if held_out == all {
        String::from("The model was fitted to none of these records (its [provenance]).")
    } else {
        format!("{held_out} of {all} records were held out; the model names the others in [provenance].")
    }
}

fn equals(p_value: f64) -> String {
    // Chosen: two digits of an exponent; what is less likely says no more.
    if p_value < 1e-99 { probability(p_value) } else { format!("= {}", probability(p_value)) }
}

/// A tail probability in few characters.
fn probability(p_value: f64) -> String {
    if p_value < 1e-99 {
        String::from("< 1e-99")
    } else if p_value < 1e-3 {
        format!("{p_value:.0e}")
    } else {
        format!("{p_value:.3}")
    }
}

/// Record and model side by side: the paper's Fig. 6 of a multisine, and its Fig. 7 of any other.
#[must_use]
fn comparison_figure(record: &RecordValidation, output: Output) -> Figure {
    let ceiling = record.ceiling_percent.map_or_else(String::new, |ceiling| format!(", ceiling {ceiling:.2} %"));
    let title = format!("{}: fit {:.2} %{ceiling}", record.file, record.fit_percent);
    match &record.comparison {
        Comparison::Frequency(lines) => {
            let figure = etfe::compared(title, lines, output).with_record(&record.file);
            Figure { numbers: Some(lines_csv(lines)), ..figure }
        }
        Comparison::Time(rows) => {
            let figure = time_response::compared(title, rows, output).with_record(&record.file);
            Figure { numbers: Some(rows_csv(rows)), ..figure }
        }
    }
}

/// The score of each record.
fn validation_scores(records: &[RecordValidation]) -> Table {
    let any_compensated = records.iter().any(|record| record.compensated);
    let row = |record: &RecordValidation| {
        let in_domain = match record.domain() {
            Domain::Frequency => "frequency",
            Domain::Time => "time",
        };
        let left = record.residual_power;
        let compensated = any_compensated.then(|| Cell::text(if record.compensated { "yes" } else { "no" }));
        [Cell::number(record.nominal, 3), Cell::text(record.excitation.name())]
            .into_iter()
            .chain(compensated)
            .chain([
                Cell::text(match record.fitted {
                    Some(true) => "no",
                    Some(false) => "yes",
                    None => "-",
                }),
                Cell::text(in_domain),
                Cell::number(record.fit_percent, 2),
                Cell::optional(record.ceiling_percent, 2),
                Cell::optional(left.map(|left| left.power_ratio), 2),
                left.map_or_else(|| Cell::unknown("-"), |left| Cell::shown(left.p_value, probability(left.p_value))),
                Cell::optional(record.model_error_percent(), 2),
                Cell::text(record.file.clone()),
            ])
            .collect()
    };
    let columns = [Column::new("u_nom", "u_nom", "duty"), Column::new("excitation", "excitation", "")]
        .into_iter()
        .chain(any_compensated.then(|| Column::new("compensated", "compensated", "")))
        .chain([
            Column::new("held_out", "held out", ""),
            Column::new("domain", "compared in", "").in_detail(),
            Column::new("fit_percent", "fit", "%"),
            Column::new("ceiling_percent", "ceiling", "%"),
            Column::new("left_over_noise", "power over noise", ""),
            Column::new("p_value", "p", ""),
            Column::new("model_error_percent", "model's error", "% of the response").in_detail(),
            Column::new("file", "record", ""),
        ])
        .collect();
    Table {
        name: "validation".to_owned(),
        caption: "Fit of each record. The ceiling is what a perfect model would score on average, given its noise."
            .to_owned(),
        columns,
        rows: records.iter().map(row).collect(),
        ..Table::default()
    }
}

/// By nominal command, as the paper's Table 2; `None` without multisines and squares.
fn validation_by_nominal(records: &[RecordValidation]) -> Option<Table> {
    let row = |row: &TableRow| {
        let pair = |found: Option<FitBesideCeiling>| {
            let ceiling = found.and_then(|found| found.ceiling_percent);
            [Cell::optional(found.map(|found| found.fit_percent), 2), Cell::optional(ceiling, 2)]
        };
        let mut cells = vec![Cell::number(row.nominal, 3)];
        cells.extend(pair(row.frequency));
        cells.extend(pair(row.square));
        cells
    };
    let rows: Vec<_> = table_2(records).iter().map(row).collect();
    (!rows.is_empty()).then(|| Table {
        name: "fit_by_nominal".to_owned(),
        caption: "Fit by nominal command".to_owned(),
        columns: vec![
            Column::new("u_nom", "u_nom", "duty"),
            Column::new("fit_frequency_percent", "in frequency", "%"),
            Column::new("ceiling_frequency_percent", "ceiling", "%"),
            Column::new("fit_square_percent", "on squares", "%"),
            Column::new("ceiling_square_percent", "ceiling", "%"),
        ],
        rows,
        ..Table::default()
    })
}

fn lines_csv(compared: &ComparedLines) -> String {
    let mut csv = String::from(
        "frequency_hz,etfe_magnitude,etfe_phase_deg,smoothed_magnitude,smoothed_magnitude_low,smoothed_magnitude_high,\
         smoothed_phase_deg,smoothed_phase_low_deg,smoothed_phase_high_deg,model_magnitude,model_phase_deg\n",
    );
    let degrees = |response: num_complex::Complex64| response.arg().to_degrees();
    let smoothed = &compared.smoothed;
    for ((line, raw), model) in smoothed.lines.iter().zip(&compared.raw).zip(&compared.model) {
        let (low, high) = smoothed.magnitude_interval(line, BAND);
        let (phase_low, phase_high) = smoothed.phase_interval_rad(line, BAND);
        writeln!(
            csv,
            "{},{},{},{},{low},{high},{},{},{},{},{}",
            line.omega_rad_s / TAU,
            raw.norm(),
            degrees(*raw),
            line.response.norm(),
            degrees(line.response),
            phase_low.to_degrees(),
            phase_high.to_degrees(),
            model.norm(),
            degrees(*model),
        )
        .expect("a string takes all");
    }
    csv
}

fn rows_csv(rows: &[ComparedRow]) -> String {
    let mut csv = String::from("time_s,measured,model,residual\n");
    for row in rows {
        let residual = row.measured - row.model;
        writeln!(csv, "{},{},{},{residual}", row.time_s, row.measured, row.model).expect("a string takes all");
    }
    csv
}
