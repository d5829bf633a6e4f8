//! What the conditioned inverse is held to, row by row: `cargo xtask inverse` prints the table.

use host_tests::TABLE_1;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use rotorlead::design::InverseDesign;
use rotorlead::inverse::ConditionedInverse;

use super::response::{SLEWS_PER_S, bandwidth, inverse_response, paper_inverse, physical_bound_s};
use super::{Exact, STEP, any_case, any_references, calm_case, command, rounded};

/// The ESC's frames.
const FRAME_HZ: f64 = 600.0;
/// Amplitude of the multisines: small signals.
const AMPLITUDE: f64 = 0.02;
/// Random steps at each slew limit, and random designs.
const STEPS: usize = 300;
const DESIGNS: usize = 400;

/// One requirement: its words, what is required, and what was found.
struct Row(&'static str, String, String, bool);

fn at_most(words: &'static str, limit: f64, found: f64, unit: &str) -> Row {
    Row(words, format!("<= {limit}{unit}"), format!("{found:.2}{unit}"), found <= limit)
}

fn at_least(words: &'static str, limit: f64, found: f64, unit: &str) -> Row {
    Row(words, format!(">= {limit}{unit}"), format!("{found:.2}{unit}"), found >= limit)
}

/// The same random values in every run.
fn random<T: std::fmt::Debug>(strategy: &impl Strategy<Value = T>, count: usize) -> Vec<T> {
    let mut runner = TestRunner::deterministic();
    (0..count).map(|_| strategy.new_tree(&mut runner).expect("a value").current()).collect()
}

/// The lowest bandwidth, rad/s, and the highest peak, dB, over all points.
fn worst_response(design: &InverseDesign, tau_factors: &[f64]) -> (f64, f64) {
    let points = TABLE_1.iter().flat_map(|point| tau_factors.iter().map(move |tau| (point.0, *tau)));
    points.fold((f64::INFINITY, f64::NEG_INFINITY), |(lowest, highest), (nominal, tau)| {
        let (bandwidth_rad_s, peak_db) = bandwidth(design, nominal, AMPLITUDE, tau, FRAME_HZ);
        (lowest.min(bandwidth_rad_s), highest.max(peak_db))
    })
}

/// Rise, where the physical bound exceeds 25 ms over that bound, and overshoot of random steps.
fn random_steps() -> (Vec<f64>, f64) {
    let (mut over_bound, mut overshoot) = (Vec::new(), 0.0_f64);
    for slew_per_s in SLEWS_PER_S {
        for (from, size) in random(&(0.40..0.65_f64, -0.3..0.3_f64), STEPS) {
            let response = inverse_response(from, from + size, slew_per_s, FRAME_HZ);
            let bound_s = physical_bound_s(from, from + size, slew_per_s, FRAME_HZ);
            overshoot = overshoot.max(response.overshoot);
            if bound_s > 0.025 {
                over_bound.push(response.rise_s / bound_s);
            }
        }
    }
    over_bound.sort_by(f64::total_cmp);
    (over_bound, overshoot)
}

/// Designs whose steady output is not the reference, and ticks in which the rotor's state leaves the limits.
fn misses() -> (usize, usize) {
    let (mut unsteady, mut outside) = (0, 0);
    for (case, [start, reference]) in random(&(any_case(), [0.0..=1.0_f64, 0.0..=1.0]), DESIGNS) {
        let mut inverse = ConditionedInverse::at_rest(case.limits, command(start));
        let mut last = inverse.output();
        for _ in 0..case.settling_ticks() {
            last = inverse.update(case.design.coefficients(), command(reference));
            outside += usize::from(!(case.limits.min()..=case.limits.max()).contains(&inverse.rotor_state()));
        }
        let want = command(rounded(command(reference).to_f64())).clamp_to(case.limits.min(), case.limits.max());
        unsteady += usize::from(last != want);
    }
    (unsteady, outside)
}

/// Largest difference from the recurrence in `f64`, in steps of the output.
fn largest_difference() -> f64 {
    let mut largest = 0.0_f64;
    for (case, references) in random(&(calm_case(), any_references()), DESIGNS) {
        let mut inverse = ConditionedInverse::at_rest(case.limits, command(references[0].0));
        let mut exact = Exact::at_rest(&case, command(references[0].0));
        for (reference, part) in references {
            for _ in 0..(part * case.settling_s() * case.design.loop_rate_hz()) as u32 {
                let got = inverse.update(case.design.coefficients(), command(reference)).to_f64();
                largest = largest.max((got - exact.update(command(reference))).abs() / STEP);
            }
        }
    }
    largest
}

#[test]
fn the_acceptance_table() {
    let (exact, peak_db) = worst_response(&paper_inverse(94.2156, 1.0), &[1.0]);
    let (robust, _) = worst_response(&paper_inverse(125.0, 0.9), &[0.9, 1.0, 1.1]);
    let (over_bound, mut overshoot) = random_steps();
    let mut rise_s = 0.0_f64;
    for (nominal, _, _) in TABLE_1 {
        for size in [0.02, 0.05, 0.1, 0.2, 0.3] {
            for to in [nominal + size, nominal - size] {
                let response = inverse_response(nominal, to, 0.0, FRAME_HZ);
                overshoot = overshoot.max(response.overshoot);
                if size == 0.05 {
                    rise_s = rise_s.max(response.rise_s);
                }
            }
        }
    }
    let (unsteady, outside) = misses();
    let median = over_bound[over_bound.len() / 2];
    let rows = [
        at_least("lowest bandwidth over all u_nom, exact time constants", 90.0, exact, " rad/s"),
        at_least("the same, robust setting, true time constants -10 to +10 %", 90.0, robust, " rad/s"),
        at_most("peak of the response", 0.3, peak_db, " dB"),
        at_most("overshoot of any step at any declared slew", 6.0, 100.0 * overshoot, " %"),
        at_most("rise over the physical bound, worst", 1.3, over_bound[over_bound.len() - 1], ""),
        at_most("the same, median", 1.3, median, ""),
        at_most("rise of a step of 0.05", 26.0, 1e3 * rise_s, " ms"),
        at_most("steady outputs that are not the input, of 400 designs", 0.0, unsteady as f64, ""),
        at_most("fixed point against f64, steps of 2^-16", 8.0, largest_difference(), ""),
        at_most("ticks in which v is outside [lo, hi]", 0.0, outside as f64, ""),
    ];
    println!("{:<62} {:>12} {:>14}", "", "required", "found");
    for Row(words, required, found, _) in &rows {
        println!("{words:<62} {required:>12} {found:>14}");
    }
    let missed: Vec<&str> = rows.iter().filter(|row| !row.3).map(|row| row.0).collect();
    assert!(missed.is_empty(), "{missed:?}");
}
