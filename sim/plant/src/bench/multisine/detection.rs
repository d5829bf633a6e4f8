//! Multisines that show a nonlinearity: odd lines, some of them skipped, random phases.
//!
//! A linear actuator answers at the excited lines only. A quadratic one answers at even lines, which are
//! all empty; a cubic one at odd lines, of which one in each group is left empty to see it. Which one is
//! random, so that no regular pattern of sums falls beside the gaps. Phases are uniform and independent, which
//! makes the levels at the empty lines typical of the excited ones (Pintelon & Schoukens, 2012,
//! section 4.3). The crest factor is that of noise, 2.5 to 3.5: it is the price.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{LineSet, Multisine, MultisineError};

/// How a set of detection multisines is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectionRecipe {
    /// Lowest and highest line, hertz.
    pub band_hz: (f64, f64),
    /// Period in seconds.
    pub period_s: f64,
    /// One line is skipped in every group of this many neighboring odd lines; 2 or more.
    pub group: u32,
    /// Seed of the skipped lines and of the phases.
    pub seed: u64,
    /// How many signals, alike but for their phases; 1 or more.
    pub realizations: u32,
}

impl DetectionRecipe {
    /// What is skipped where nothing else is asked for: one odd line in four. Chosen: it leaves three quarters of the lines to the
    /// response; fewer skipped ones show odd distortion at fewer frequencies.
    pub const GROUP: u32 = 4;
}

/// Multisines of the same lines and amplitudes and of other phases.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectionSet {
    /// The excited lines.
    pub lines: LineSet,
    /// One signal per realization.
    pub realizations: Vec<Multisine>,
    /// The odd harmonics that are skipped, increasing.
    pub skipped: Vec<u32>,
    /// The highest peak of all realizations, in units of the lines' amplitudes: they share one scale.
    pub peak: f64,
}

impl DetectionSet {
    /// Draws the lines and the phases. Realization `m` does not depend on how many there are.
    ///
    /// The first and the last line of the band are never skipped; a last group that is not full loses none.
    ///
    /// # Errors
    /// [`MultisineError`] of [`LineSet::odd_in_band`]; [`MultisineError::Group`] when the band has no full group.
    pub fn new(recipe: &DetectionRecipe) -> Result<Self, MultisineError> {
        let group = recipe.group as usize;
        let all = LineSet::odd_in_band(recipe.band_hz.0, recipe.band_hz.1, recipe.period_s)?;
        let all = all.harmonics();
        if group < 2 || all.len() < group.max(3) {
            return Err(MultisineError::Group { group: recipe.group, lines: all.len() });
        }
        let mut rng = ChaCha8Rng::seed_from_u64(recipe.seed);
        let mut kept = Vec::with_capacity(all.len());
        let mut skipped = Vec::with_capacity(all.len() / group);
        for (number, lines) in all.chunks(group).enumerate() {
            let first = usize::from(number == 0);
            let last = lines.len() - usize::from((number + 1) * group >= all.len());
            let skip = (lines.len() == group && first < last).then(|| rng.random_range(first..last));
            for (place, &harmonic) in lines.iter().enumerate() {
                if skip == Some(place) { &mut skipped } else { &mut kept }.push(harmonic);
            }
        }
        let lines = LineSet::equal(kept)?;
        let realizations = (1..=u64::from(recipe.realizations.max(1)))
            .map(|realization| {
                let mut rng = ChaCha8Rng::seed_from_u64(recipe.seed);
                rng.set_stream(realization);
                let phases = lines.harmonics().iter().map(|_| rng.random_range(0.0..TAU)).collect();
                Multisine::starting_at_zero(lines.clone(), phases)
            })
            .collect::<Result<Vec<_>, _>>()?;
        let peak = realizations.iter().map(Multisine::peak).fold(0.0, f64::max);
        Ok(Self { lines, realizations, skipped, peak })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RECIPE: DetectionRecipe =
        DetectionRecipe { band_hz: (0.1, 30.0), period_s: 10.0, group: 4, seed: 1, realizations: 2 };

    #[test]
    fn one_odd_line_in_four_is_skipped_and_no_even_one_is_excited() {
        let set = DetectionSet::new(&RECIPE).unwrap();
        let excited = set.lines.harmonics();
        assert_eq!((excited.len(), set.skipped.len()), (113, 37));
        assert!(excited.iter().chain(&set.skipped).all(|harmonic| harmonic % 2 == 1));
        assert_eq!((excited[0], set.lines.top_harmonic()), (1, 299));
        for group in (0..148).step_by(4) {
            let in_group = |h: &&u32| (2 * group + 1..2 * group + 9).contains(*h);
            assert_eq!(set.skipped.iter().filter(in_group).count(), 1);
        }
        // Not always the same place of the group.
        let places: std::collections::BTreeSet<_> = set.skipped.iter().map(|h| (h - 1) / 2 % 4).collect();
        assert_eq!(places.len(), 4);
    }

    #[test]
    fn realizations_differ_in_phases_only_and_repeat_for_their_seed() {
        let set = DetectionSet::new(&RECIPE).unwrap();
        let [a, b] = &set.realizations[..] else { panic!("two were asked for") };
        assert_eq!(a.lines(), b.lines());
        assert_ne!(a.phases_rad(), b.phases_rad());
        let three = DetectionSet::new(&DetectionRecipe { realizations: 3, ..RECIPE }).unwrap();
        assert_eq!(three.realizations[..2], set.realizations);
        let other = DetectionSet::new(&DetectionRecipe { seed: 2, ..RECIPE }).unwrap();
        assert_ne!(other.skipped, set.skipped);
    }

    #[test]
    fn a_band_without_a_group_is_refused() {
        for (group, band_hz) in [(0, (0.1, 30.0)), (1, (0.1, 30.0)), (200, (0.1, 30.0)), (4, (0.1, 0.5))] {
            assert!(DetectionSet::new(&DetectionRecipe { group, band_hz, ..RECIPE }).is_err(), "{group}");
        }
    }
}
