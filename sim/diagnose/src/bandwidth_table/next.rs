//! The experiment that would separate what a table cannot.

use std::f64::consts::TAU;

use rotorlead_plant::effect::Kind;

use super::case::Case;
use super::explanation::{Explanation, Standing};

/// Lowest line over the slowest bandwidth: a hundredth of a pole is where a static gain of its own shows.
const LOWEST_LINE: f64 = 0.01;
/// Highest line over the fastest bandwidth.
const HIGHEST_LINE: f64 = 2.0;
/// Nominal commands where the explanations are apart by this part of the furthest are worth records.
const WORTH_RECORDS: f64 = 0.5;

/// In words: where the explanations that are left disagree the most and what to record there, and on a line for each pair of them
/// what would tell the one from the other.
pub(super) fn next_experiment(case: &Case, explanations: &[Explanation]) -> String {
    let left: Vec<&Explanation> = explanations.iter().filter(|one| one.standing != Standing::Worse).collect();
    if left.len() < 2 {
        return "Record periodic multisines at these nominal commands, without and with the compensator, four periods or more, with \
                speed and voltage logged, and give their folder to `rotorlead diagnose`: they have a noise of their own, and \
                phases, which a table lacks."
            .to_owned();
    }
    let held_out = case.fitted.other();
    let apart: Vec<f64> = (0..case.rows.len())
        .map(|row| {
            // With more numbers than data an explanation predicts almost anything: it says nothing of where to look.
            let firm = left.iter().filter(|one| one.numbers <= case.fitted_rows().count());
            let logarithms = firm.filter_map(|one| one.predicted_rad_s[row][held_out as usize].map(f64::ln));
            let (low, high) = logarithms.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| (l.min(y), h.max(y)));
            if high > low { high - low } else { 0.0 }
        })
        .collect();
    let furthest = apart.iter().copied().fold(0.0, f64::max);
    let levels: Vec<String> = case
        .rows
        .iter()
        .zip(&apart)
        .filter(|(_, apart)| **apart >= WORTH_RECORDS * furthest)
        .map(|(row, _)| format!("{:.2}", row.point.nominal))
        .collect();
    let bandwidths =
        || case.rows.iter().flat_map(|row| row.simulated.into_iter().chain(row.measured.iter().flatten().copied()));
    let (slow, fast) = (bandwidths().fold(f64::INFINITY, f64::min), bandwidths().fold(0.0, f64::max));
    let mut words = format!(
        "Record periodic multisines at u_nom {}, where the explanations differ the most in the {} bandwidth (by a factor of up \
         to {:.1}), without and with the compensator, from {:.2} to {:.0} Hz, four periods or more, with speed and voltage \
         logged, and give their folder to `rotorlead diagnose`: the spread over the periods is the noise that a table lacks.",
        levels.join(", "),
        held_out.word(),
        furthest.exp(),
        LOWEST_LINE * slow / TAU,
        HIGHEST_LINE * fast / TAU,
    );
    let mut kinds: Vec<&'static Kind> = Vec::new();
    for one in &left {
        if !kinds.contains(&one.kind) {
            kinds.push(one.kind);
        }
    }
    for (index, kind) in kinds.iter().enumerate() {
        for other in &kinds[..index] {
            if let Some(experiment) = advice(kind, other).or_else(|| advice(other, kind)) {
                words.push_str(&format!("\n{} or {}: {experiment}", other.id, kind.id));
            }
        }
    }
    words
}

fn advice(kind: &Kind, with: &Kind) -> Option<&'static str> {
    kind.confusions.iter().find(|confusion| confusion.with == with.id).map(|confusion| confusion.experiment)
}
