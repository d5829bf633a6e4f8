//! Which ESC ramps its command otherwise than the others.

/// Two ramps are said to differ from this factor on. Chosen: the settings of ESCs step by two and more; less is the difference of two fits.
const CLEARLY: f64 = 1.25;
/// Motors below which none is odd. Derived: of two either may be.
pub const FEWEST_RAMPS: usize = 3;

/// From where to where the ramp of an ESC may be, up and down, in any unit; infinite where there may be none.
pub type RampRanges = [(f64, f64); 2];

/// Whether each motor's ramp is apart from the usual one of the others, upward or downward: from the median of their lower to that of their
/// upper ends, by a quarter at least. Where half of them or more are, none of them is the odd one.
#[must_use]
pub fn odd_ramps(motors: &[RampRanges]) -> Vec<bool> {
    let is_odd = |place: usize| {
        (0..2).any(|direction| {
            let others = || motors.iter().enumerate().filter(move |(other, _)| *other != place);
            let lower = middle(others().map(|(_, ranges)| ranges[direction].0));
            let upper = middle(others().map(|(_, ranges)| ranges[direction].1));
            let (low, high) = motors[place][direction];
            high * CLEARLY < lower || low > upper * CLEARLY
        })
    };
    let odd: Vec<bool> = (0..motors.len()).map(is_odd).collect();
    let count = odd.iter().filter(|odd| **odd).count();
    if motors.len() < FEWEST_RAMPS || 2 * count >= motors.len() { vec![false; motors.len()] } else { odd }
}

/// The middle one, the lower of two; infinite ones are the last.
fn middle(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len().saturating_sub(1) / 2).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: (f64, f64) = (2.0, f64::INFINITY);

    #[test]
    fn one_in_four_that_ramps_is_the_odd_one() {
        let slow = [(0.095, 0.106), NONE];
        assert_eq!(odd_ramps(&[[NONE; 2], [NONE; 2], slow, [NONE; 2]]), [false, false, true, false]);
        // And one without a ramp among those that have one.
        assert_eq!(odd_ramps(&[slow, slow, [NONE; 2], slow]), [false, false, true, false]);
    }

    #[test]
    fn none_is_odd_where_they_are_alike_or_half_of_them_differ() {
        let slow = [(0.095, 0.106); 2];
        let nearly = [(0.107, 0.115); 2];
        assert_eq!(odd_ramps(&[slow, nearly, slow]), [false; 3]);
        assert_eq!(odd_ramps(&[slow, slow, [NONE; 2], [NONE; 2]]), [false; 4]);
        assert_eq!(odd_ramps(&[slow, [NONE; 2]]), [false; 2]);
        // What the records do not tell is no difference.
        assert_eq!(odd_ramps(&[[(0.0, f64::INFINITY); 2], slow, slow]), [false; 3]);
    }
}
