//! A stand that was identified.

use std::f64::consts::TAU;

use rotorlead_answer::{Answer, Cell, Column, Table, Tone, Verdict, with_std};
use rotorlead_identify::goodness_of_fit::{power_over_noise, times_noise};
use rotorlead_identify::stand::StandIdentification;
use rotorlead_identify::stand::transfer_function::{OrderScore, Root};
use rotorlead_records::{Finding, Severity, Topic};
use serde_json::{Map, Value, json};

use super::figures::stand::stand_figures;
use crate::json_object::json_object;
use crate::number::estimate_cell;

/// Up to which frequency a stand shows what its motor does, its poles and zeros, and its frequency response.
#[must_use]
pub fn stand_answer(stand: &StandIdentification) -> Answer {
    let finding = |warning| Finding::new(Severity::Warning, Topic::Identification, None, warning);
    let usable = match stand.usable_hz {
        Some(usable) => {
            let usable_hz = with_std(usable.value, Some(usable.std), 1.0, 2);
            format!("Usable up to {usable_hz} Hz: 3 dB off the static gain there.")
        }
        None => format!("Usable up to {:.1} Hz at least: nowhere 3 dB off the static gain.", stand.top_hz),
    };
    let tone = if stand.warnings.is_empty() { Tone::Good } else { Tone::Attention };
    let findings: Vec<Finding> = stand.warnings.iter().map(|warning| finding(warning)).collect();
    Answer {
        name: "stand",
        title: "The stand",
        text: vec![fit(stand)],
        verdict: Verdict::new(tone, usable),
        findings,
        tables: vec![poles_and_zeros(stand)],
        figures: stand_figures(stand),
        values: values(stand),
    }
}

fn fit(stand: &StandIdentification) -> String {
    let (fit, residual) = (&stand.fit, &stand.fit.residual);
    format!(
        "{}: {} lines up to {:.1} Hz, {}, static gain {}. It leaves {}; tail probabilities: power {:.2}, whiteness {:.2}, independence \
         of the force {:.2}.",
        stand.records.join(", "),
        stand.response.lines.len(),
        stand.top_hz,
        fit.structure,
        with_std(fit.gain.value, Some(fit.gain.std), 1.0, 4),
        times_noise(residual.reduced_chi_square, 2),
        residual.power_p_value,
        residual.whiteness_p_value,
        residual.input_independence_p_value,
    )
}

/// For programs. How well an order predicts is infinite, and so null, where nothing was found.
fn values(stand: &StandIdentification) -> Map<String, Value> {
    let residual = &stand.fit.residual;
    let order = |order: &OrderScore| {
        json!({
            "poles": order.structure.poles,
            "zeros": order.structure.zeros,
            "held_out": order.held_out,
            "score": order.score,
        })
    };
    json_object(&json!({
        "records": stand.records,
        "gain": stand.fit.gain.value,
        "gain_std": stand.fit.gain.std,
        "poles": stand.poles().collect::<Vec<&Root>>(),
        "zeros": stand.zeros().collect::<Vec<&Root>>(),
        "usable_hz": stand.usable_hz.map(|usable| usable.value),
        "usable_hz_std": stand.usable_hz.map(|usable| usable.std),
        "top_hz": stand.top_hz,
        "reduced_chi_square": power_over_noise(residual.reduced_chi_square),
        "power_p_value": residual.power_p_value,
        "whiteness_p_value": residual.whiteness_p_value,
        "input_independence_p_value": residual.input_independence_p_value,
        "orders": stand.scores.iter().map(order).collect::<Vec<_>>(),
    }))
}

/// The poles, and then the zeros.
fn poles_and_zeros(stand: &StandIdentification) -> Table {
    let roots = stand.poles().map(|root| ("pole", root)).chain(stand.zeros().map(|root| ("zero", root)));
    let rows = roots.map(|(kind, root)| {
        let frequency = root.frequency_rad_s;
        let damping = if root.is_pair() {
            estimate_cell(root.damping.value, Some(root.damping.std), 1.0, 4)
        } else {
            Cell::text(if root.damping.value < 0.0 { "real, right half" } else { "real" })
        };
        vec![
            Cell::text(kind),
            estimate_cell(frequency.value, Some(frequency.std), 1.0, 2),
            estimate_cell(frequency.value, Some(frequency.std), 1.0 / TAU, 3),
            damping,
        ]
    });
    Table {
        name: "poles_and_zeros".to_owned(),
        caption: format!(
            "Poles and zeros up to {:.1} Hz, as far as the lines say them; pairs count once",
            stand.top_hz
        ),
        columns: vec![
            Column::new("kind", "", ""),
            Column::new("frequency_rad_s", "frequency", "rad/s"),
            Column::new("frequency_hz", "frequency", "Hz"),
            Column::new("damping", "damping ratio", ""),
        ],
        rows: rows.collect(),
        notes: vec!["+- is one standard error, of the noise alone.".to_owned()],
        ..Table::default()
    }
}
