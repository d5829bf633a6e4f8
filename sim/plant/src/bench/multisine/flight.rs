//! Phases in the integers of the controller's generator, and the source file that holds them.

use std::f64::consts::TAU;
use std::fmt::Write;

use rotorlead::excitation::{ExcitationError, Lines, SUM_FRACTION_BITS};

use super::{LineSet, Multisine, MultisineError, Progress, Search, optimize};

/// Period of the controller's own line sets in seconds: lines 0.2 Hz apart from 0.1 Hz.
pub const PERIOD_S: u32 = 10;

/// One of the controller's own line sets, and how its phases are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Recipe {
    /// Its name in the controller's crate.
    pub name: &'static str,
    /// What it is for, one line.
    pub purpose: &'static str,
    /// How many odd harmonics it has.
    pub count: u32,
    /// The search that finds its phases.
    pub search: Search,
}

/// The controller's own line sets.
pub const RECIPES: [Recipe; 2] = [
    Recipe {
        name: "ODD_LINES_30_HZ",
        purpose: "150 lines from 0.1 to 29.9 Hz, 0.2 Hz apart: identifies a motor.",
        count: 150,
        search: Search { seed: 1, starts: 3 },
    },
    Recipe {
        name: "ODD_LINES_45_HZ",
        purpose: "225 lines from 0.1 to 44.9 Hz, 0.2 Hz apart: validates a compensated motor.",
        count: 225,
        search: Search { seed: 1, starts: 3 },
    },
];

/// What [`Lines`] is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Phases {
    /// Phases of the odd harmonics, 2^-32 turn.
    pub phases: Vec<u32>,
    /// Largest magnitude of the sum, in amplitudes of one line.
    pub peak: f64,
}

impl Phases {
    /// The phases of `multisine`, which must hold the first odd harmonics with equal amplitudes (the
    /// controller knows no others), rounded such that the controller's own sum is zero at the start.
    ///
    /// # Errors
    /// As [`Lines::odd`]. `phases` is named also when the lines are others.
    pub fn new(multisine: &Multisine) -> Result<Self, ExcitationError> {
        let harmonics = multisine.lines().harmonics();
        let amplitude = multisine.lines().amplitudes().first().copied().unwrap_or(1.0);
        let playable = harmonics.iter().enumerate().all(|(k, &m)| m as usize == 2 * k + 1)
            && multisine.lines().amplitudes().iter().all(|&a| a == amplitude);
        if !playable {
            return Err(ExcitationError::OutOfRange {
                parameter: "phases",
                value: harmonics.len() as f64,
                min: 1.0,
                max: Lines::MAX_COUNT as f64,
            });
        }
        let mut phases: Vec<u32> = multisine
            .phases_rad()
            .iter()
            // The generator's phase stands for half a unit more. The cast wraps a full turn to 0.
            .map(|phase| (phase / TAU * 4_294_967_296.0).floor() as u64 as u32)
            .collect();
        // Derived: rounding moves the sum by two units of each line at most, `2 * 2 pi / 2^32`, 3e-9.
        let margin = phases.len() as f64 * 3e-9;
        let peak = multisine.peak() / amplitude + margin;
        Lines::odd(PERIOD_S, &phases, peak)?;
        start_at_zero(&mut phases, peak)?;
        Ok(Self { phases, peak })
    }
}

/// Moves single phases by one unit as long as that brings the controller's sum at the start closer
/// to zero. One unit of one line moves it by 1.5e-9 at most, so few lines move.
fn start_at_zero(phases: &mut [u32], peak: f64) -> Result<(), ExcitationError> {
    let start = |phases: &[u32]| Lines::odd(PERIOD_S, phases, peak).map(|lines| lines.sum(0).abs());
    let mut best = start(phases)?;
    loop {
        let before = best;
        let mut choice = None;
        for k in 0..phases.len() {
            let kept = phases[k];
            for moved in [kept.wrapping_add(1), kept.wrapping_sub(1)] {
                phases[k] = moved;
                let distance = start(phases)?;
                if distance < best {
                    best = distance;
                    choice = Some((k, moved));
                }
            }
            phases[k] = kept;
        }
        match choice {
            Some((k, moved)) if best < before => phases[k] = moved,
            _ => return Ok(()),
        }
    }
}

/// Finds the phases of one of [`RECIPES`].
///
/// # Errors
/// None for the recipes of this module; the types are those of the steps.
pub fn find_phases(recipe: &Recipe, progress: impl FnMut(Progress)) -> Result<(Multisine, Phases), FlightError> {
    let multisine = optimize(&LineSet::odd(recipe.count)?, &recipe.search, progress)?;
    let phases = Phases::new(&multisine)?;
    Ok((multisine, phases))
}

/// Why a recipe fails.
#[derive(Clone, Debug, PartialEq, thiserror::Error, miette::Diagnostic)]
pub enum FlightError {
    /// The line set is none.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Multisine(#[from] MultisineError),
    /// The controller cannot play it.
    #[error("the controller cannot play these lines: {0}")]
    #[diagnostic(help("it plays 1 to 512 odd harmonics from the first on, all of equal amplitude"))]
    Excitation(#[from] ExcitationError),
}

/// The controller's source file `src/excitation/phases.rs`, from the recipes and their phases.
#[must_use]
pub fn source(sets: &[(Recipe, Phases)]) -> String {
    let mut text = String::from(
        "//! Phases of low crest factor. Written by `cargo run --release -p rotorlead-plant --example phases`;\n\
         //! change the recipes in `sim/plant/src/bench/multisine/flight.rs`, not this file.\n\n\
         use super::Lines;\n",
    );
    let mut put = |line: std::fmt::Arguments| {
        // Writing to a string cannot fail.
        let _ = text.write_fmt(line);
    };
    for (recipe, set) in sets {
        let Recipe { name, purpose, count, search } = recipe;
        put(format_args!("\n/// {purpose}\n///\n"));
        put(format_args!("/// Found with seed {} and {} starts.\n", search.seed, search.starts));
        put(format_args!("pub const {name}: Lines<'static> = {{\n"));
        put(format_args!("    #[rustfmt::skip]\n    const PHASES: [u32; {count}] = [\n"));
        for row in set.phases.chunks(8) {
            let row: Vec<String> = row.iter().map(|phase| format!("0x{phase:08x}")).collect();
            put(format_args!("        {},\n", row.join(", ")));
        }
        put(format_args!("    ];\n    match Lines::odd({PERIOD_S}, &PHASES, {:?}) {{\n", set.peak));
        put(format_args!("        Ok(lines) => lines,\n"));
        put(format_args!("        Err(_) => panic!(\"one of these numbers is out of range\"),\n"));
        put(format_args!("    }}\n}};\n"));
    }
    text
}

/// Value of [`Lines::sum`] in amplitudes of one line.
#[must_use]
pub fn sum_to_f64(sum: i64) -> f64 {
    sum as f64 / (1_u64 << SUM_FRACTION_BITS) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rounded_phases_start_closer_to_zero_than_one_unit_of_a_line() {
        let multisine = optimize(&LineSet::odd(40).unwrap(), &Search { seed: 2, starts: 1 }, |_| ()).unwrap();
        let set = Phases::new(&multisine).unwrap();
        let lines = Lines::odd(PERIOD_S, &set.phases, set.peak).unwrap();
        let start = sum_to_f64(lines.sum(0));
        assert!(start.abs() < 1e-10, "{start:e}");
        for (i, x) in multisine.waveform(1000).iter().enumerate() {
            let turn = (i as u64).wrapping_mul(u64::MAX / 1000);
            let sum = sum_to_f64(lines.sum(turn));
            assert!((sum - x).abs() < 40.0 * 1e-8, "{i}: {sum} {x}");
        }
    }

    #[test]
    fn lines_that_the_controller_cannot_play_are_refused() {
        for lines in [
            LineSet::equal(vec![1, 5, 7]).unwrap(),
            LineSet::new(vec![1, 3], vec![1.0, 2.0]).unwrap(),
            LineSet::odd(513).unwrap(),
        ] {
            let phases = vec![0.0; lines.harmonics().len()];
            let multisine = Multisine::starting_at_zero(lines, phases).unwrap();
            assert!(Phases::new(&multisine).is_err());
        }
    }
}
