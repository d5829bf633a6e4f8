//! What drives the records: the paper's multisine with skipped detection lines, and its square wave.

use std::f64::consts::TAU;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Rows per second.
pub const ROWS_HZ: f64 = 1000.0;
/// Period of both excitations in seconds: lines 0.1 Hz apart, and half periods of 5 s.
pub const PERIOD_S: f64 = 10.0;
/// Whole periods in a record.
pub const PERIODS: usize = 3;
/// Rows of a record.
pub const ROWS: usize = 30_000;

/// What a record is driven by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drive {
    /// Odd lines of random phase from 0.1 to 30 Hz.
    Multisine,
    /// A square wave.
    Square,
}

/// The commands of one record around `nominal` with peak `amplitude`.
///
/// The multisine has the odd lines from 0.1 to 29.9 Hz, of each four in a row one left out at random, at equal size and
/// with random phases; of eight draws of the phases the one with the lowest crest is taken, as on a real stand. The
/// square wave starts with its high half.
#[must_use]
pub fn commands(drive: Drive, nominal: f64, amplitude: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let period = match drive {
        Drive::Multisine => multisine(rng),
        Drive::Square => (0..ROWS / PERIODS).map(|row| if row < ROWS / PERIODS / 2 { 1.0 } else { -1.0 }).collect(),
    };
    (0..ROWS).map(|row| nominal + amplitude * period[row % period.len()]).collect()
}

fn multisine(rng: &mut ChaCha8Rng) -> Vec<f64> {
    let rows = ROWS / PERIODS;
    let odd: Vec<usize> = (0..150).map(|index| 2 * index + 1).collect();
    let lines: Vec<usize> = odd
        .chunks(4)
        .flat_map(|group| {
            let skipped = rng.random_range(0..group.len());
            group.iter().enumerate().filter(move |(index, _)| *index != skipped).map(|(_, line)| *line)
        })
        .collect();
    // One turn of a sine, read at multiples of its line's number: 10 000 rows are exact in it.
    let sine: Vec<f64> = (0..rows).map(|row| (TAU * row as f64 / rows as f64).sin()).collect();
    let mut best = (f64::MAX, Vec::new());
    for _ in 0..8 {
        let mut sum = vec![0.0; rows];
        for line in &lines {
            let mut at = rng.random_range(0..rows);
            for value in &mut sum {
                *value += sine[at];
                at = (at + line) % rows;
            }
        }
        let peak = sum.iter().fold(0.0_f64, |peak, value| peak.max(value.abs()));
        if peak < best.0 {
            best = (peak, sum);
        }
    }
    best.1.iter().map(|value| value / best.0).collect()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn a_multisine_excites_odd_lines_only_and_leaves_some_out() {
        let commands = commands(Drive::Multisine, 0.5, 0.05, &mut ChaCha8Rng::seed_from_u64(1));
        assert_eq!(commands.len(), ROWS);
        assert!((commands.iter().fold(0.0_f64, |peak, c| peak.max((c - 0.5).abs())) - 0.05).abs() < 1e-12);
        let size = |line: usize| {
            let (mut re, mut im) = (0.0, 0.0);
            for (row, command) in commands[..10_000].iter().enumerate() {
                let angle = TAU * ((row * line) % 10_000) as f64 / 10_000.0;
                re += command * angle.cos();
                im += command * angle.sin();
            }
            f64::hypot(re, im) / 5_000.0
        };
        let odd: Vec<f64> = (0..150).map(|index| size(2 * index + 1)).collect();
        let excited = odd.iter().filter(|size| **size > 1e-4).count();
        assert_eq!(excited, 112);
        assert!(odd.iter().all(|size| *size > 1e-4 || *size < 1e-12));
        assert!((1..10).all(|index| size(2 * index) < 1e-12) && size(301) < 1e-12);
    }

    #[test]
    fn a_square_wave_has_the_papers_half_period() {
        let commands = commands(Drive::Square, 0.5, 0.05, &mut ChaCha8Rng::seed_from_u64(1));
        assert_eq!((commands[0], commands[4_999], commands[5_000], commands[10_000]), (0.55, 0.55, 0.45, 0.55));
    }
}
