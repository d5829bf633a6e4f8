//! Which ESC ramps its command otherwise than the others.

/// Two ramps are said to differ from this factor on. Chosen: the settings of ESCs step by two and more; less is the difference of two fits.
const CLEARLY: f64 = 1.25;
/// Motors below which none is odd. Derived: of two either may be.
pub const FEWEST_RAMPS: usize = 3;

/// From where to where the ramp of an ESC may be, up and down, in any unit; infinite where there may be none.
pub type RampRanges = [(f64, f64); 2];

/// How the ramps of several motors compare.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ComparedRamps {
    /// Whether each motor's is apart from those of more than half of the others, where fewer than half of the motors are so.
    pub is_odd: Vec<bool>,
    /// Whether any two are apart.
    pub differ: bool,
}

/// Compares the ramps of motors, upward and downward: two are apart where their ranges are, by a quarter at least. Of fewer than
/// [`FEWEST_RAMPS`] motors none is odd.
#[must_use]
pub fn compare_ramps(motors: &[RampRanges]) -> ComparedRamps {
    let apart = |one: &RampRanges, other: &RampRanges| {
        one.iter().zip(other).any(|(one, other)| one.1 * CLEARLY < other.0 || other.1 * CLEARLY < one.0)
    };
    let others = motors.len().saturating_sub(1);
    let counts: Vec<usize> = motors.iter().map(|one| motors.iter().filter(|other| apart(one, other)).count()).collect();
    let is_odd: Vec<bool> = counts.iter().map(|count| 2 * count > others).collect();
    let odd = is_odd.iter().filter(|odd| **odd).count();
    let is_split = motors.len() < FEWEST_RAMPS || 2 * odd >= motors.len();
    ComparedRamps {
        is_odd: if is_split { vec![false; motors.len()] } else { is_odd },
        differ: counts.iter().any(|count| *count > 0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: (f64, f64) = (2.0, f64::INFINITY);

    #[test]
    fn one_in_four_that_ramps_is_the_odd_one() {
        let slow = [(0.095, 0.106), NONE];
        assert_eq!(compare_ramps(&[[NONE; 2], [NONE; 2], slow, [NONE; 2]]).is_odd, [false, false, true, false]);
        // And one without a ramp among those that have one.
        assert_eq!(compare_ramps(&[slow, slow, [NONE; 2], slow]).is_odd, [false, false, true, false]);
    }

    #[test]
    fn a_slow_one_of_three_and_two_of_five_are_odd() {
        let slow = [(0.095, 0.106); 2];
        assert_eq!(compare_ramps(&[[NONE; 2], slow, [NONE; 2]]).is_odd, [false, true, false]);
        let five = compare_ramps(&[slow, [NONE; 2], slow, [NONE; 2], [NONE; 2]]);
        assert_eq!(five.is_odd, [true, false, true, false, false]);
        let halves = compare_ramps(&[slow, slow, [NONE; 2], [NONE; 2]]);
        assert!(halves.differ && !halves.is_odd.contains(&true), "{halves:?}");
        assert!(!compare_ramps(&[slow, slow, slow]).differ);
    }

    #[test]
    fn none_is_odd_where_they_are_alike_or_half_of_them_differ() {
        let slow = [(0.095, 0.106); 2];
        let nearly = [(0.107, 0.115); 2];
        assert_eq!(compare_ramps(&[slow, nearly, slow]).is_odd, [false; 3]);
        assert_eq!(compare_ramps(&[slow, slow, [NONE; 2], [NONE; 2]]).is_odd, [false; 4]);
        assert_eq!(compare_ramps(&[slow, [NONE; 2]]).is_odd, [false; 2]);
        // What the records do not tell is no difference.
        assert_eq!(compare_ramps(&[[(0.0, f64::INFINITY); 2], slow, slow]).is_odd, [false; 3]);
    }
}
