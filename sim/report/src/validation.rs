//! How well a model explains records: the paper's Table 2 and the numbers behind its Figs. 6 and 7.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use rotorlead_identify::{
    ComparedLines, ComparedRow, Comparison, FitBesideCeiling, RecordValidation, TableRow, table_2,
};
use rotorlead_records::Output;

use super::figure::Figure;
use super::html::{Cell, Column, Table};
use super::{etfe, time_response};

/// Probability that a true model is called wrong on any of the records.
const LEVEL: f64 = 0.01;
/// An error of the model below this, percent of the response, is not worth a word however sure it is.
const SMALLEST_ERROR_PERCENT: f64 = 0.1;
/// Probability that the bands of a figure hold the truth, at each line.
const BAND: f64 = 0.95;

/// Characters of a record's name that the table has room for in 80 columns.
const LONGEST_NAME: usize = 18;
/// What stands behind the name of a compensated record.
const COMPENSATED: &str = " (c)";

/// A name in so many characters: its middle is what is left out.
fn shortened(name: &str, most: usize) -> String {
    let length = name.chars().count();
    if length <= most {
        return name.to_owned();
    }
    let begin = most / 2;
    let end = most - begin - 1;
    name.chars().take(begin).chain(['…']).chain(name.chars().skip(length - end)).collect()
}

/// One line per record.
#[must_use]
pub fn validation_table(records: &[RecordValidation]) -> String {
    let mut text = format!(
        "  u_nom  excitation  held   % fit  ceiling  left, over noise  record\n{:21}out{:>28}{:>8}\n",
        "", "power", "p"
    );
    for record in records {
        let left = record.left_over.map_or_else(
            || (String::from("-"), String::from("-")),
            |left| (format!("{:.2}", left.power_ratio), probability(left.p_value)),
        );
        let line = format!(
            "  {:<5.3}  {:<10}  {:<4} {:>7.2}  {:>7}  {:>8} {:>7}  {}{}\n",
            record.nominal,
            record.excitation.name(),
            match record.fitted {
                Some(true) => "no",
                Some(false) => "yes",
                None => "-",
            },
            record.fit_percent,
            percent(record.ceiling_percent),
            left.0,
            left.1,
            shortened(&record.file, if record.compensated { LONGEST_NAME - COMPENSATED.len() } else { LONGEST_NAME }),
            if record.compensated { COMPENSATED } else { "" },
        );
        text.push_str(&line);
    }
    text.push_str("  The ceiling is what a perfect model would score on average.\n");
    if records.iter().any(|record| record.compensated) {
        text.push_str("  (c): with the compensator.\n");
    }
    text
}

/// By nominal command, as the paper's Table 2; empty without multisines and squares.
#[must_use]
pub fn validation_by_nominal(records: &[RecordValidation]) -> String {
    let rows = table_2(records);
    if rows.is_empty() {
        return String::new();
    }
    let mut text =
        String::from("\n           frequency domain      square wave\n  u_nom     % fit  ceiling     % fit  ceiling\n");
    for row in rows {
        let [(frequency, frequency_ceiling), (square, square_ceiling)] = cells(&row);
        let line = format!(
            "  {:<5.3}  {frequency:>8}  {frequency_ceiling:>7}  {square:>8}  {square_ceiling:>7}\n",
            row.nominal
        );
        text.push_str(&line);
    }
    text
}

/// Fit and ceiling, in frequency and on the square wave.
#[must_use]
pub fn cells(row: &TableRow) -> [(String, String); 2] {
    [row.frequency, row.square].map(|found: Option<FitBesideCeiling>| {
        (percent(found.map(|found| found.fit_percent)), percent(found.and_then(|found| found.ceiling_percent)))
    })
}

/// Whether the record shows, at a level that holds over `tested` records, that the model is wrong by an amount worth a word.
fn shows_error(record: &RecordValidation, tested: f64) -> bool {
    record.left_over.is_some_and(|left| left.p_value * tested < LEVEL)
        && record.model_error_percent().is_some_and(|error| error >= SMALLEST_ERROR_PERCENT)
}

/// Whether any record shows the model to be wrong; `None` where no record shows its noise.
#[must_use]
pub fn is_wrong(records: &[RecordValidation]) -> Option<bool> {
    let tested = records.iter().filter(|record| record.left_over.is_some()).count();
    (tested > 0).then(|| records.iter().any(|record| shows_error(record, tested as f64)))
}

/// What the records say of the model, in sentences: which were held out, and whether it leaves more than noise.
#[must_use]
pub fn verdict(records: &[RecordValidation]) -> String {
    let mut text = held_out(records);
    let judged: Vec<&RecordValidation> = records.iter().filter(|record| record.left_over.is_some()).collect();
    let tested = judged.len() as f64;
    let wrong: Vec<&&RecordValidation> = judged.iter().filter(|record| shows_error(record, tested)).collect();
    let silent = records.len() - judged.len();
    if judged.is_empty() {
        text.push_str("No record shows its noise: whether the model leaves more than that cannot be said.\n");
        return text;
    }
    let least = judged.iter().filter_map(|record| record.left_over).map(|left| left.p_value).fold(1.0, f64::min);
    if wrong.is_empty() {
        let of = if judged.len() == 1 { "p" } else { "least p" };
        let sentence = format!(
            "As good as can be: the model leaves no more than noise on\n{} ({of} = {}).\n",
            counted(judged.len(), judged.len()),
            probability(least)
        );
        text.push_str(&sentence);
    } else {
        let sentence = format!(
            "The model leaves more than noise on {} (level {:.0} % over all):\n",
            counted(wrong.len(), judged.len()),
            100.0 * LEVEL
        );
        text.push_str(&sentence);
        for record in wrong {
            let (Some(left), Some(error)) = (record.left_over, record.model_error_percent()) else { continue };
            let line = format!(
                "  {}: {:.2} times the noise power (p {}),\n    the model is off by {error:.1} % of the response\n",
                record.file,
                left.power_ratio,
                equals(left.p_value),
            );
            text.push_str(&line);
        }
    }
    if silent > 0 {
        let line = format!("Of {} more nothing can be said: the noise does not show.\n", counted(silent, silent));
        text.push_str(&line);
    }
    text
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
        String::from("The model does not say what it was fitted to.\n")
    } else if held_out == 0 {
        String::from("No record was held out: the model was fitted to all of them (its [provenance]).\n")
    } else if held_out == all {
        String::from("The model was fitted to none of these records (its [provenance]).\n")
    } else {
        format!("{held_out} of {all} records were held out; the model names the others in [provenance].\n")
    }
}

fn equals(p_value: f64) -> String {
    if p_value < 1e-99 { probability(p_value) } else { format!("= {}", probability(p_value)) }
}

/// A tail probability in few characters.
pub(super) fn probability(p_value: f64) -> String {
    if p_value < 1e-99 {
        String::from("< 1e-99")
    } else if p_value < 1e-3 {
        format!("{p_value:.0e}")
    } else {
        format!("{p_value:.3}")
    }
}

fn percent(value: Option<f64>) -> String {
    value.map_or_else(|| String::from("-"), |value| format!("{value:.2}"))
}

/// Record and model side by side: the paper's Fig. 6 of a multisine, and its Fig. 7 of any other.
#[must_use]
pub(super) fn figures_of(record: &RecordValidation, output: Output) -> Figure {
    let ceiling = record.ceiling_percent.map_or_else(String::new, |ceiling| format!(", ceiling {ceiling:.2} %"));
    let title = format!("{}: fit {:.2} %{ceiling}", record.file, record.fit_percent);
    match &record.comparison {
        Comparison::Frequency(lines) => {
            let figure = etfe::compared(title, lines, output).of(&record.file);
            Figure { numbers: Some(lines_csv(lines)), ..figure }
        }
        Comparison::Time(rows) => {
            let figure = time_response::compared(title, rows, output).of(&record.file);
            Figure { numbers: Some(rows_csv(rows)), ..figure }
        }
    }
}

/// By nominal command, as the paper's Table 2; `None` without multisines and squares.
pub(super) fn table_by_nominal(records: &[RecordValidation]) -> Option<Table> {
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
        name: "table_2".to_owned(),
        caption: "Fit by nominal command".to_owned(),
        columns: vec![
            Column::new("u_nom", "u_nom", "duty"),
            Column::new("fit_frequency_percent", "in frequency", "%"),
            Column::new("ceiling_frequency_percent", "ceiling", "%"),
            Column::new("fit_square_percent", "on squares", "%"),
            Column::new("ceiling_square_percent", "ceiling", "%"),
        ],
        rows,
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

#[cfg(test)]
mod tests {
    use super::shortened;

    #[test]
    fn a_long_name_keeps_its_ends() {
        assert_eq!(shortened("u040_multisine.csv", 18), "u040_multisine.csv");
        assert_eq!(shortened("bench_2024_u040_multisine.csv", 18), "bench_202…sine.csv");
        assert_eq!(shortened("größere_namen.csv", 9), "größ….csv");
    }
}
